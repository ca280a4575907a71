"""The picture of ``flockbrush brush preview``: a herd on a plane at the start, in the middle and at the end."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.engine.files import whole
from flockbrush.levels.build import plane
from flockbrush.output.pictures import herd_of
from flockbrush.render import Painter, write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import rgb, theme_of, worn
from flockbrush.runs.snapshots import Moment, moment_of
from flockbrush.runs.terminal import progress
from flockbrush.systems.measures import compute_milling, compute_polarization

PANEL, GAP, HEAD, FOOT = 560, 20, 64, 56  # pixels
MEMORY = 2.0  # s of trails
ALOFT = dict(density=0.03, heading=0.0)  # birds need room for their wings, and a flock meets in the air


def preview(brush, path, agents=200, seconds=30.0, seed=0, start="scatter", theme="light"):
    """Write the picture; headings are at random at the start, or all along a ring, and birds begin all one way.

    Parameters
    ----------
    path : path
        A PNG.
    agents : int
    seconds : float
        When the last panel is taken, half of it for the middle one.
    start : {"scatter", "grid", "ring", "line"}
        How the herd stands at first.
    theme : str or Theme
    """
    simulation = plane(brush, agents, start=start, seed=seed, **(ALOFT if behaviours()[brush.model].flight else {}))
    ticks = round(seconds / simulation.clock.dt)
    shots = {0, ticks // 2, ticks}
    recent: deque[Moment] = deque(maxlen=max(1, round(MEMORY / simulation.clock.dt / 2)))
    panels = []
    with progress(f"preview of {brush.name}", ticks) as bar:
        for tick in range(ticks + 1):
            if tick:
                simulation.tick()
                bar(tick)
            if tick % 2 == 0 or tick in shots:
                recent.append(moment_of(simulation, labels=()))
            if tick in shots:
                panels.append(list(recent))
    with whole(path) as temporary:
        write_png(temporary, _sheet(simulation, brush, panels, theme))


def _sheet(simulation, brush, panels, theme):
    """All panels in one picture, to one scale."""
    look = theme_of(theme)
    side = _window([panel[-1] for panel in panels])
    width = len(panels) * (PANEL + GAP) + GAP
    image = np.full((HEAD + PANEL + FOOT, width, 3), rgb(look.paper), np.uint8)
    canvas = Canvas(image)
    canvas.disc((GAP + 9, HEAD / 2), 9, rgb(worn([brush.colour], look)[0]))
    title = f"{brush.title or brush.name}"
    used = canvas.words(title, (GAP + 28, HEAD / 2), 24, look.ink, anchor=(0, 0.5))
    about = f"{brush.name}, model {brush.model}, {len(panels[-1][-1])} animals of {brush.body.length:g} m"
    canvas.words(about, (GAP + 52 + used, HEAD / 2 + 2), 16, look.muted, anchor=(0, 0.5))
    for k, panel in enumerate(panels):
        left = GAP + k * (PANEL + GAP)
        image[HEAD : HEAD + PANEL, left : left + PANEL] = _panel(simulation, panel, side, theme)
        last = panel[-1]
        order = compute_polarization(last.forward), compute_milling(last.xyz[:, :2], last.forward)
        words = f"{last.time:g} s     polarization {order[0]:.2f}     milling {order[1]:.2f}"
        away = int((_off(last) > 0.5 * side).sum())
        words += f"     {away:,} outside the picture" if away else ""
        canvas.words(words, (left, HEAD + PANEL + FOOT / 2), 16, look.ink, anchor=(0, 0.5))
    _bar(canvas, (width - GAP, HEAD / 2), PANEL / side, look)
    return image


def _window(moments):
    """Side of a square, m, that shows each of these herds around its middle; those far from it may be left out."""
    inner, outer = np.transpose([np.quantile(_off(m), (0.5, 0.97)) for m in moments])
    return 2.2 * np.minimum(outer, 2.5 * inner).max() + 6 * float(moments[0].length.max())


def _off(moment):
    """(n,) distance of each animal from the middle, m, east or north, whichever is more."""
    return np.abs(moment.xyz[:, :2] - _middle(moment)).max(1)


def _middle(moment):
    return np.median(moment.xyz[:, :2], axis=0)


def _panel(simulation, moments, side, theme):
    """The last of some moments, with trails of those before, in a square of so many metres."""
    ground = SimpleNamespace(name="", width=side, height=side)
    painter = Painter(ground, (PANEL, PANEL), theme, trails=MEMORY, words=False)
    shift = np.append(0.5 * side - _middle(moments[-1]), 0.0)
    for moment in moments:
        herd = herd_of(simulation, replace(moment, xyz=moment.xyz + shift))
        frame = painter.frame(herd, time=moment.time, legend=False)
    return frame


def _bar(canvas, end, scale, look):
    """A scale bar that ends here."""
    metres = nice(140 / scale)
    (x, y), long = end, metres * scale
    wide = canvas.words(f"{metres:g} m", (x, y), 16, look.ink, anchor=(1, 0.5))
    right = x - wide - 10
    marks = [[right - long, y, right, y], [right - long, y - 5, right - long, y + 5], [right, y - 5, right, y + 5]]
    canvas.segments(marks, 2, look.ink, 0.9)
