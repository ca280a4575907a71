"""Charts of a report: lines with bands, parameters in rows, maps of neighbours; drawn large enough to print."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flockbrush.output.plot import ticks
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import Colour, rgb, scale_colours
from flockbrush.render.text import shortened, width_of

SCALE = 2  # pixels of the picture for one of the page: sharp on paper
PANEL = 440, 250  # pixels of the page
GAP, HEAD = 26, 44
EDGE = 2  # pixels of the page around a panel that stands alone
SMALL, SMALLER = 13, 12  # pixels of the page, height of names and of numbers along axes
PAPER, INK, MUTED = rgb("#ffffff"), rgb("#26302c"), rgb("#66716a")
CLIP, HERD, OTHER = rgb("#26302c"), rgb("#d0402b"), rgb("#097abe")  # what was filmed, what was simulated, a third
BAND = 0.16  # opacity of what lies within the bounds


class ChartLine(NamedTuple):
    """One curve of a chart."""

    name: str
    x: np.ndarray
    y: np.ndarray
    colour: Colour
    band: tuple[np.ndarray, np.ndarray] | None = None  # the lowest and the highest that would do
    marks: bool = False
    width: float = 2.0
    alpha: float = 1.0
    pieces: tuple[int, ...] = ()  # where a new piece begins, after what is not known


class CurveChart(NamedTuple):
    """Curves in a frame."""

    title: str
    across: str
    lines: list[ChartLine]
    span: tuple[float, float] | None = None  # of the upright axis; as the curves need unless told
    logarithmic: bool = False


class ParamRow(NamedTuple):
    """One parameter: what was found, by every start, and whether the clip tells it."""

    name: str
    value: float
    others: np.ndarray  # what other starts came to
    told: bool = True
    group: str = ""
    alike: np.ndarray = np.zeros(0)  # what those came to that describe the clip about as well


class Rows(NamedTuple):
    """Parameters below one another on one axis."""

    title: str
    rows: list[ParamRow]
    span: tuple[float, float] = (0.0, 1.0)


class Maps(NamedTuple):
    """Squares of numbers beside one another, on one scale of colours."""

    title: str
    names: list[str]
    squares: list[np.ndarray]  # (bins, bins), row 0 is behind
    reach: float  # from the middle to a side
    unit: str


def drawn(panel) -> np.ndarray:
    """One panel on white paper without a margin to speak of, (h, w, 3) uint8."""
    height = _height(panel)
    image = np.full(((height + 2 * EDGE) * SCALE, (PANEL[0] + 2 * EDGE) * SCALE, 3), PAPER, np.uint8)
    _draw(Pen(image), np.array([EDGE, EDGE], float), panel, height)
    return image


def sheet(panels, columns=2) -> np.ndarray:
    """Panels beside and below one another on white paper, (h, w, 3) uint8."""
    columns = max(1, min(columns, len(panels)))
    heights = [_height(panel) for panel in panels]
    lines = [heights[k : k + columns] for k in range(0, len(heights), columns)]
    width = columns * (PANEL[0] + GAP) + GAP
    height = sum(max(line) + GAP for line in lines) + GAP
    image = np.full((height * SCALE, width * SCALE, 3), PAPER, np.uint8)
    top = GAP
    for r, line in enumerate(lines):
        for c in range(len(line)):
            corner = np.array([GAP + c * (PANEL[0] + GAP), top], float)
            _draw(Pen(image), corner, panels[r * columns + c], line[c])
        top += max(line) + GAP
    return image


class Pen(Canvas):
    """A canvas in pixels of the page, whatever the picture has for one of them."""

    def words(self, text, at, height, colour, alpha=1.0, anchor=(0, 0), halo=None):
        """Write; how wide it came out."""
        return super().words(text, np.multiply(at, SCALE), height * SCALE, colour, alpha, anchor, halo) / SCALE

    def line(self, points, width, colour, alpha=1.0, closed=False, dash=None):
        """Draw a line."""
        dash = None if dash is None else tuple(SCALE * d for d in dash)
        super().line(np.asarray(points, float) * SCALE, width * SCALE, colour, alpha, closed, dash)

    def area(self, points, colour, alpha=1.0):
        """Fill a polygon."""
        super().area(np.asarray(points, float) * SCALE, colour, alpha)

    def dot(self, at, radius, colour, alpha=1.0):
        """Fill a circle."""
        self.disc(np.multiply(at, SCALE), radius * SCALE, colour, alpha)


def _height(panel):
    if isinstance(panel, Rows):
        return HEAD + 19 * len(panel.rows) + 10 * _groups(panel) + 26
    if isinstance(panel, Maps):
        return HEAD + round(_side(panel)) + 44
    return PANEL[1]


def _groups(panel):
    return len({row.group for row in panel.rows}) - 1


def _draw(pen, corner, panel, height):
    draw = {Rows: _rows, Maps: _maps}.get(type(panel), _chart)
    pen.words(shortened(panel.title, 15 * SCALE, PANEL[0] * SCALE), corner, 15, INK)
    draw(pen, corner, panel, height)


# lines -----------------------------------------------------------------------------------


def _chart(pen, corner, chart, height):
    """Frame, axes, bands, curves, names."""
    _names(pen, corner, chart.lines)
    box = np.array([corner[0] + 46, corner[1] + HEAD + 6, corner[0] + PANEL[0] - 6, corner[1] + height - 38])
    lines = [_cleaned(line, chart.logarithmic) for line in chart.lines]
    lines = [line for line in lines if len(line.x)]
    if not lines:
        pen.words("the clip does not tell", (box[[0, 2]].mean(), box[[1, 3]].mean()), 13, MUTED, anchor=(0.5, 0.5))
        return
    low, high, step = _upright(chart, lines)
    start, stop = _level(lines)

    def at(x, y):
        px = box[0] + (np.asarray(x, float) - start) / (stop - start) * (box[2] - box[0])
        y = np.clip(np.asarray(y, float), low, high)
        return np.stack(np.broadcast_arrays(px, box[3] - (y - low) / (high - low) * (box[3] - box[1])), axis=-1)

    for value, words in _heights(chart, low, high, step):
        pen.line(at([start, stop], value), 0.8, MUTED, 0.28)
        pen.words(words, at(start, value) - (6, 0), SMALLER, MUTED, anchor=(1, 0.5))
    across = nice((stop - start) / 5)
    for x in np.arange(math.ceil(start / across - 1e-9), math.floor(stop / across + 1e-9) + 1) * across:
        pen.line(at(x, [low, high]), 0.8, MUTED, 0.14)
        pen.words(f"{x:.4g}", at(x, low) + (0, 11), SMALLER, MUTED, anchor=(0.5, 0.5))
    pen.words(chart.across, (box[[0, 2]].mean(), box[3] + 27), SMALL, MUTED, anchor=(0.5, 0.5))
    for line in lines:
        _curve(pen, at, line)


def _cleaned(line, logarithmic):
    """The line without what is no number."""
    x, y = np.asarray(line.x, float), np.asarray(line.y, float)
    band = [y, y] if line.band is None else [np.broadcast_to(np.asarray(b, float), y.shape) for b in line.band]
    if logarithmic:
        with np.errstate(divide="ignore", invalid="ignore"):
            y, band = np.log10(y), [np.log10(b) for b in band]
    good = np.isfinite(x) & np.isfinite(y)
    pieces = tuple(np.flatnonzero(np.diff(np.flatnonzero(good)) > 1) + 1)
    band = None if line.band is None else (band[0][good], band[1][good])
    return line._replace(x=x[good], y=y[good], band=band, pieces=pieces)


def _heights(chart, low, high, step):
    """(value, words) along the upright axis: powers of ten with twos and fives where it is logarithmic."""
    if not chart.logarithmic:
        return [(v, f"{v:.4g}") for v in np.arange(round(low / step), round(high / step) + 1) * step]
    decades = range(math.floor(low), math.ceil(high) + 1)
    parts = (1, 1.5, 2, 3, 4, 5, 7) if high - low < 0.8 else (1, 2, 5) if high - low < 2 else (1,)
    values = [part * 10.0**decade for decade in decades for part in parts]
    return [(math.log10(v), f"{v:.4g}") for v in values if low - 1e-9 <= math.log10(v) <= high + 1e-9]


def _upright(chart, lines):
    if chart.span is not None:
        return ticks(*chart.span, 5)
    values = np.concatenate([np.concatenate([line.y, *(line.band or ())]) for line in lines])
    values = values[np.isfinite(values)]
    low, high = float(values.min()), float(values.max())
    if chart.logarithmic:
        return low - 0.05, max(high, low + 0.35) + 0.05, 1.0
    if 0 <= low < 0.6 * high:
        low = 0.0
    return ticks(low, high, 5)


def _level(lines):
    xs = np.concatenate([line.x for line in lines])
    start, stop = float(xs.min()), float(xs.max())
    return (start, stop) if stop > start else (start - 0.5, stop + 0.5)


def _curve(pen, at, line):
    for rows in np.split(np.arange(len(line.x)), line.pieces):
        points = at(line.x[rows], line.y[rows])
        if line.band is not None and len(rows) > 1:
            low, high = (at(line.x[rows], side[rows]) for side in line.band)
            pen.area(np.concatenate([low, high[::-1]]), line.colour, BAND)
        pen.line(points, line.width, line.colour, line.alpha)
        if line.marks or len(rows) == 1:
            for point in points:
                pen.dot(point, 3.2 if line.marks else 0.9 * line.width, line.colour, line.alpha)


def _names(pen, corner, lines):
    """Who is who, each name once, below the title."""
    x, y = corner[0] + 2, corner[1] + 28
    for name, line in {line.name: line for line in lines if line.name}.items():
        wide = width_of(name, SMALL * SCALE) / SCALE
        if x + wide + 20 > corner[0] + PANEL[0]:
            return
        pen.line([(x, y), (x + 14, y)], line.width, line.colour, line.alpha)
        pen.words(name, (x + 19, y), SMALL, MUTED, anchor=(0, 0.5))
        x += wide + 36


# parameters ------------------------------------------------------------------------------


def _rows(pen, corner, panel, height):
    """A row for each parameter: a disc where it was found, small ones where other starts came to."""
    left, right = corner[0] + 152, corner[0] + PANEL[0] - 12
    low, high = panel.span
    top, bottom = corner[1] + HEAD - 6, corner[1] + height - 26

    def across(value):
        return left + (np.clip(value, low, high) - low) / (high - low) * (right - left)

    for value in np.linspace(low, high, 6):
        pen.line([(across(value), top), (across(value), bottom)], 0.8, MUTED, 0.2)
        pen.words(f"{value:.3g}", (across(value), bottom + 12), SMALLER, MUTED, anchor=(0.5, 0.5))
    y, group = top + 9, panel.rows[0].group if panel.rows else ""
    for row in panel.rows:
        if row.group != group:
            y, group = y + 10, row.group
        _row(pen, row, y, corner[0], across)
        y += 19


def _row(pen, row, y, left, across):
    colour = HERD if row.told else MUTED
    pen.words(row.name, (left, y), SMALL, INK if row.told else MUTED, 1.0 if row.told else 0.8, anchor=(0, 0.5))
    pen.line([(across(-1e9), y), (across(1e9), y)], 0.8, MUTED, 0.15)
    for values, radius, alpha in ((row.others, 2.0, 0.3), (row.alike, 2.8, 0.6)):
        for value in values[np.isfinite(values)]:
            pen.dot((across(value), y), radius, colour, alpha)
    if len(row.alike):
        ends = np.array([*row.alike, row.value])
        pen.line([(across(np.nanmin(ends)), y), (across(np.nanmax(ends)), y)], 3.0, colour, 0.3)
    pen.dot((across(row.value), y), 4.6, PAPER)
    pen.dot((across(row.value), y), 3.8, colour)


# maps ------------------------------------------------------------------------------------


def _side(panel):
    return (PANEL[0] - 60 - 14 * (len(panel.squares) - 1)) / max(2, len(panel.squares))


def _maps(pen, corner, panel, height):
    """Squares on one scale: light where few stand, dark where many do; the animal in the middle looks up."""
    side, top = _side(panel), corner[1] + HEAD
    most = max((float(np.nanmax(square)) for square in panel.squares if np.isfinite(square).any()), default=1.0) or 1.0
    for k, (name, square) in enumerate(zip(panel.names, panel.squares, strict=True)):
        left = corner[0] + k * (side + 14)
        pen.words(name, (left, corner[1] + 28), SMALL, MUTED, anchor=(0, 0.5))
        _square(pen, (left, top), side, square, most)
        _walker(pen, (left + side / 2, top + side / 2), side / (2 * panel.reach))
        for words, share in ((f"-{panel.reach:g}", 0.0), ("0", 0.5), (f"{panel.reach:g}", 1.0)):
            pen.words(words, (left + share * side, top + side + 10), SMALLER, MUTED, anchor=(share, 0.5))
        pen.words("body lengths to the right", (left + side / 2, top + side + 26), SMALL, MUTED, anchor=(0.5, 0.5))
    _scale_bar(pen, corner[0] + len(panel.squares) * (side + 14), top, side, most, panel.unit)


def _square(pen, corner, side, square, most):
    bins, colours = len(square), scale_colours("light")
    left, top = round(corner[0] * SCALE), round(corner[1] * SCALE)
    wide = round(side * SCALE)
    at = np.minimum(np.arange(wide) * bins // wide, bins - 1)
    levels = np.nan_to_num(np.clip(square[::-1] / most, 0, 1))
    pen.image[top : top + wide, left : left + wide] = colours[(levels * 255).astype(int)][at][:, at]


def _walker(pen, at, length):
    """A body one long that looks up."""
    x, y = at
    pen.line([(x, y + 0.3 * length), (x, y - 0.3 * length)], 0.4 * length, PAPER)
    pen.line([(x, y + 0.3 * length), (x, y - 0.3 * length)], 0.4 * length - 2, INK)
    pen.dot((x, y - 0.32 * length), max(1.2, 0.12 * length), PAPER)


def _scale_bar(pen, left, top, side, most, unit):
    colours = scale_colours("light")
    tall = round(side * SCALE)
    bar = colours[np.linspace(255, 0, tall).astype(int)]
    x = round(left * SCALE)
    pen.image[round(top * SCALE) : round(top * SCALE) + tall, x : x + 9 * SCALE] = bar[:, None]
    for share in (0.0, 0.5, 1.0):
        pen.words(f"{share * most:.2g}", (left + 13, top + (1 - share) * side), SMALLER, MUTED, anchor=(0, 0.5))
    pen.words(unit, (left + 9, top - 12), SMALLER, MUTED, anchor=(0.5, 0.5))
