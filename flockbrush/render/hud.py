"""What stands around the level: title, clock and measures above, legend and scale bar below."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from flockbrush.render.animal_figures import KINDS, LEADER, NO_WINGS, PLAIN, PREDATOR, figure
from flockbrush.render.brush_marks import swatch
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_ground import brush_key
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.shapes import Pose
from flockbrush.render.style import Theme, rgb
from flockbrush.render.text import shortened, width_of
from flockbrush.render.view_camera import ViewCamera

PATCH = 0.55  # scale of the patterns on patches of ground in the legend


@dataclass(frozen=True)
class Layout:
    """How a picture of this size is divided: a band above, the ground, and one or two rows below."""

    size: tuple[int, int]
    unit: float  # pixels of a hairline
    font: int  # pixels; 0 when the picture is too small for words
    above: int
    below: int

    @classmethod
    def of(cls, size, rows=1) -> Layout:
        """The layout with so many rows below; pictures too small for words have none."""
        width, height = size
        unit = float(np.clip(min(width / 1280, height / 720), 0.45, 6))
        if width < 300 or height < 200:
            return cls(size, unit, 0, 0, 0)
        font = max(11, round(14.5 * unit))
        return cls(size, unit, font, round(2.3 * font), round((0.7 + 1.6 * rows) * font))

    @property
    def view(self):
        """Left, top, right and bottom of the ground."""
        return 0, self.above, self.size[0], self.size[1] - self.below

    @property
    def pad(self):
        """Pixels left free at the sides."""
        return max(2, round(1.1 * self.font)) if self.font else max(1, round(4 * self.unit))


class Hud:
    """The words around a level, in one theme and layout."""

    def __init__(self, layout: Layout, theme: Theme):
        self.layout, self.theme = layout, theme

    def above(self, frame, title, time, measures):
        """Title on the left, measures in the middle, clock on the right."""
        layout, theme = self.layout, self.theme
        if not layout.font:
            return
        canvas, height, y = Canvas(frame), layout.font, layout.above / 2
        right = layout.size[0] - layout.pad
        if time is not None:
            digits = width_of(re.sub(r"\d", "0", clock(time)), height)  # so that the words do not dance
            canvas.words(clock(time), (right - digits, y), height, theme.ink, anchor=(0, 0.5))
            right -= digits + 2 * height
        large = round(1.2 * height)
        name = shortened(str(title or ""), large, right - layout.pad)
        left = layout.pad + canvas.words(name, (layout.pad, y), large, theme.ink, anchor=(0, 0.5)) + 2 * height
        text = shortened(say(measures), height, right - left)
        canvas.words(text, (right, y), height, theme.muted, anchor=(1, 0.5))

    def scale_bar(self, frame, camera: ViewCamera) -> float:
        """A bar of a round number of metres at the bottom right; returns its left end in pixels."""
        layout, theme = self.layout, self.theme
        right = layout.size[0] - layout.pad
        if not layout.font:
            return right
        canvas, height, unit = Canvas(frame), layout.font, layout.unit
        metres = nice(150 * unit / camera.scale)
        y = layout.size[1] - layout.below + round(1.15 * height)
        text = f"{metres:g} m" if metres < 1000 else f"{metres / 1000:g} km"
        wide = canvas.words(text, (right, y), height, theme.ink, anchor=(1, 0.5))
        stop = right - wide - 0.6 * height
        start = stop - metres * camera.scale
        thick, tick = max(1.5, 2 * unit), 0.32 * height
        ends = [[start, y - tick, start, y + tick], [stop, y - tick, stop, y + tick]]
        canvas.segments([[start, y, stop, y], *ends], thick, theme.ink, 0.9)
        return start - 1.5 * height

    def legend(self, frame, right, herd, colours, painted=()):
        """First row of the legend of a `checked` herd; `colours` are those of all looks.

        Animals whose brush is `painted` on the level stand on a patch of its ground.
        """
        if not len(herd.xy):
            return
        known = len(colours) // KINDS - 1
        brush = np.where((herd.brush >= 0) & (herd.brush < known), herd.brush, -1)
        counts = np.bincount(brush[~herd.predator] + 1, minlength=known + 1)
        names = ["animals", *(str(name) for name in herd.brush_names)]
        names += [f"brush {k + 1}" for k in range(known)][len(names) - 1 :]
        shown = [(names[k], k * KINDS, int(counts[k])) for k in np.argsort(-counts, kind="stable") if counts[k]]
        named_colours = zip(map(str, herd.brush_names), map(rgb, herd.brush_colours), strict=False)
        grounds = {name: colour for name, colour in named_colours if brush_key(name) in painted}
        self.animals(frame, right, shown, int(herd.leader.sum()), int(herd.predator.sum()), colours, grounds)

    def animals(self, frame, right, brushes, leaders, predators, colours, grounds=None):
        """First row of the legend: brushes with their counts, then leaders and predators.

        `brushes` are (name, look, count), in the order they are to be shown; `colours` those of all looks,
        `grounds` {name: colour} of those that stand on painted ground.
        """
        layout = self.layout
        if not layout.font:
            return
        entries = [(name, f"{count:,}", look + PLAIN) for name, look, count in brushes]
        first = brushes[0][1] if brushes else 0
        marked = [("leader" if leaders == 1 else "leaders", leaders, first + LEADER)]
        marked += [("predator" if predators == 1 else "predators", predators, PREDATOR)]
        marks = [(name, f"{count:,}", look) for name, count, look in marked if count]
        self._row(frame, layout.pad, right, entries, marks, colours, grounds or {})

    def _row(self, frame, left, right, entries, marks, colours, grounds):
        height = self.layout.font
        y = self.layout.size[1] - self.layout.below + round(1.15 * height)
        room = right - left - sum(map(self._width, marks))
        fitting = list(entries)
        while len(fitting) > 1 and sum(map(self._width, fitting)) + (fitting != entries) * 5 * height > room:
            fitting.pop()
        canvas, x = Canvas(frame), left
        more = [(f"+{len(entries) - len(fitting)} more", "", None)] * (fitting != entries)
        for name, count, look in [*fitting, *more, *marks]:
            if x + self._width((name, count, look)) - height > right:
                return
            if look is not None:
                if name in grounds and look % KINDS == PLAIN:
                    self._ground(frame, x, y, name, grounds[name])
                self._animal(frame, x + 0.6 * height, y, look, colours)
                x += 1.7 * height
            ink = self.theme.muted if look is None else self.theme.ink
            x += canvas.words(name, (x, y), height, ink, anchor=(0, 0.5)) + 0.5 * height
            x += canvas.words(count, (x, y), height, self.theme.muted, anchor=(0, 0.5)) + 1.4 * height

    def _width(self, entry):
        name, count, look = entry
        height = self.layout.font
        return width_of(name, height) + width_of(count, height) + (1.9 if look is None else 3.6) * height

    def _ground(self, frame, x, y, name, colour):
        """A patch of ground painted with a brush, under an animal of the legend."""
        tall = self.layout.font
        left, top, wide, high = round(x - 0.2 * tall), round(y - 0.65 * tall), round(1.6 * tall), round(1.3 * tall)
        patch = swatch(name, colour, self.theme, (wide, high), PATCH * self.layout.unit)
        rows, columns = slice(max(top, 0), top + high), slice(max(left, 0), left + wide)
        view = frame[rows, columns]
        view[:] = patch[: view.shape[0], : view.shape[1]]

    def _animal(self, frame, x, y, look, colours):
        clip = np.array([0, 0, *self.layout.size])
        long = 1.15 * self.layout.font
        thick = 0.27 * long
        kind = look % 4
        if kind == PREDATOR:
            long *= 0.9
        figure(frame, clip, Pose(float(x), float(y), 1.0, 0.0), long, thick, kind, False, colours[look], NO_WINGS)

    def things(self, frame, present):
        """Second row of the legend: what is drawn on the ground; `present` are the names of kinds in `GLYPHS`."""
        layout = self.layout
        if not layout.font:
            return
        canvas, height, x = Canvas(frame), layout.font, layout.pad
        y = layout.size[1] - layout.below + round(2.75 * height)
        small = max(10, round(0.9 * height))
        for kind in present:
            if x + 1.55 * height + width_of(kind, small) > layout.size[0] - layout.pad:
                return
            GLYPHS[kind](canvas, np.array([x, y]), height, self.theme)
            canvas.words(kind, (x + 1.55 * height, y), small, self.theme.muted, anchor=(0, 0.5))
            x += 3.0 * height + width_of(kind, small)


def _box(at, height):
    return np.array([[0.05, -0.38], [1.15, -0.38], [1.15, 0.38], [0.05, 0.38]]) * height + at


def _guide(canvas, at, height, theme):
    canvas.line([at, at + (0.9 * height, 0)], 0.14 * height, theme.guide)
    canvas.arrowhead(at + (1.2 * height, 0), (1, 0), 0.62 * height, theme.guide)


def _goal(canvas, at, height, theme):
    foot = at + np.array([0.35, 0.45]) * height
    canvas.line([foot, foot - (0, 0.95 * height)], 0.13 * height, theme.goal)
    canvas.area(foot + np.array([[0, -1], [0.7, -0.75], [0, -0.5]]) * height, theme.goal)


def _exit(canvas, at, height, theme):
    canvas.area(_box(at, height), theme.exit, 0.25)
    canvas.line(_box(at, height), 0.12 * height, theme.exit, closed=True)


def _spawn(canvas, at, height, theme):
    canvas.line(_box(at, height), 0.1 * height, theme.spawn, closed=True, dash=(0.24 * height, 0.2 * height))


def _obstacle(canvas, at, height, theme):
    canvas.area(_box(at, height), theme.obstacle)
    canvas.line(_box(at, height), 0.1 * height, theme.obstacle_edge, closed=True)


def _speed(canvas, at, height, theme):
    for share in (0.05, 0.4, 0.75):
        canvas.line(
            [at + (share * height, 0.35 * height), at + ((share + 0.4) * height, -0.35 * height)],
            0.09 * height,
            theme.cap,
        )


def _count(canvas, at, height, theme):
    canvas.line([at, at + (1.15 * height, 0)], 0.12 * height, theme.muted, dash=(0.42 * height, 0.2 * height))


def _area(canvas, at, height, theme):
    canvas.area(_box(at, height), theme.muted, 0.07)
    canvas.line(_box(at, height), 0.08 * height, theme.muted, 0.7, closed=True)


GLYPHS = {
    "guide": _guide, "goal": _goal, "exit": _exit, "start": _spawn, "obstacle": _obstacle, "speed limit": _speed,
    "counting line": _count, "measured area": _area,
}  # fmt: skip


def things_of(level) -> list[str]:
    """Which kinds of `GLYPHS` a level has."""
    has = {
        "guide": "guides", "goal": "goals", "exit": "exits", "start": "spawns", "obstacle": "obstacles",
        "counting line": "lines", "measured area": "areas",
    }  # fmt: skip
    kinds = [kind for kind in GLYPHS if kind in has and getattr(level, has[kind], None)]
    zones = getattr(level, "zones", None) or []
    capped = any(np.isfinite(zone.max_speed) or zone.factor != 1 for zone in zones)
    cap, factor = getattr(level, "cap", None), getattr(level, "factor", None)
    capped |= cap is not None and bool(np.isfinite(np.asarray(cap.values)).any())
    capped |= factor is not None and bool((np.asarray(factor.values) != 1).any())
    return kinds + ["speed limit"] * capped


def clock(seconds: float) -> str:
    """A time as minutes, seconds and tenths."""
    tenths = int(np.floor(abs(seconds) * 10 + 1e-6))
    minutes, rest = divmod(tenths, 600)
    hours, minutes = divmod(minutes, 60)
    sign = "-" if seconds < 0 and tenths else ""
    text = f"{minutes}:{rest // 10:02d}.{rest % 10}"
    return sign + (f"{hours}:{minutes:02d}:{rest // 10:02d}.{rest % 10}" if hours else text)


def say(measures) -> str:
    """Measures as words: a text as it is, numbers by name with two decimals."""
    if measures is None:
        return ""
    if isinstance(measures, str):
        return measures
    return "     ".join(f"{name.replace('_', ' ')}  {value:.2f}" for name, value in measures.items())
