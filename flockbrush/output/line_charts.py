"""Means over a parameter as pictures: a panel for each measure, a line for each group, bars for their errors."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flockbrush.output.plot import ticks
from flockbrush.render import write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import PALETTE, rgb, theme_of
from flockbrush.render.text import shortened, width_of

PANEL = 460, 320  # pixels
GAP, HEAD = 28, 62
COLUMNS = 3
MARK = 5.0  # pixels, half the size of a mark
LABELS = 165  # pixels for the words of a row


class ChartCurve(NamedTuple):
    """One line of a panel."""

    name: str
    x: np.ndarray
    y: np.ndarray
    error: np.ndarray | None = None  # of y, each way
    marks: bool = True


class ChartPanel(NamedTuple):
    """One frame of a chart."""

    title: str
    across: str
    curves: list[ChartCurve]
    words: list[str] | None = None  # x counts these when it is no number: the panel then has a row for each


def draw_chart(path, title, panels, theme="light", note=""):
    """Draw panels, three to a row, one legend for all, and below the title what lines and bars are (`note`)."""
    look = theme_of(theme)
    columns = min(COLUMNS, max(len(panels), 1))
    rows = max(1, math.ceil(len(panels) / columns))
    width = columns * (PANEL[0] + GAP) + GAP
    height = HEAD + rows * (PANEL[1] + GAP)
    image = np.full((height, width, 3), rgb(look.paper), np.uint8)
    canvas = Canvas(image)
    names = list(dict.fromkeys(curve.name for panel in panels for curve in panel.curves if curve.marks and curve.name))
    colours = {name: rgb(PALETTE[k % len(PALETTE)]) for k, name in enumerate(names)}
    end = _legend(canvas, colours, names, width - GAP, look)
    canvas.words(shortened(title, 21, end - GAP - 20), (GAP, HEAD / 2 - 4), 21, look.ink, anchor=(0, 0.5))
    if note:
        canvas.words(shortened(note, 14, width - 2 * GAP), (GAP, HEAD - 11), 14, look.muted, anchor=(0, 0.5))
    for k, panel in enumerate(panels):
        left, top = GAP + k % columns * (PANEL[0] + GAP), HEAD + k // columns * (PANEL[1] + GAP)
        _panel(canvas, (left, top), panel, colours, names, look)
    write_png(path, image)


def _legend(canvas, colours, names, right, look):
    """Names of the lines at the upper right; where they begin."""
    x = right
    for k in range(len(names) - 1, -1, -1):
        x -= width_of(names[k], 16)
        canvas.words(names[k], (x, HEAD / 2 - 4), 16, look.ink, anchor=(0, 0.5))
        _mark(canvas, (x - 14, HEAD / 2 - 4), k, colours[names[k]])
        x -= 44
    return x


def _mark(canvas, at, kind, colour):
    """A disc, square, triangle or lozenge: lines can be told apart without colours."""
    x, y = at
    if kind % 4 == 0:
        canvas.disc(at, MARK, colour)
        return
    corners = {
        1: [(-1, -1), (1, -1), (1, 1), (-1, 1)],
        2: [(0, -1.3), (1.2, 0.9), (-1.2, 0.9)],
        3: [(0, -1.4), (1.4, 0), (0, 1.4), (-1.4, 0)],
    }[kind % 4]
    canvas.area([(x + MARK * 0.95 * a, y + MARK * 0.95 * b) for a, b in corners], colour)


def _panel(canvas, corner, panel, colours, names, look):
    if panel.words is not None:
        _rows(canvas, corner, panel, colours, names, look)
        return
    (left, top), (wide, tall) = corner, PANEL
    box = np.array([left + 56, top + 30, left + wide - 10, top + tall - 46], float)
    low, high, step = _span_of(panel)
    xs = np.concatenate([curve.x for curve in panel.curves])
    start, stop = (float(xs.min()), float(xs.max())) if len(xs) else (0.0, 1.0)
    slack = 0.06 * (stop - start) if stop > start else 0.5
    if not all(curve.marks for curve in panel.curves):
        slack = 0.0
    start, stop = start - slack, stop + slack

    def at(x, y):
        px = box[0] + (np.asarray(x, float) - start) / (stop - start) * (box[2] - box[0])
        py = box[3] - (np.asarray(y, float) - low) / (high - low) * (box[3] - box[1])
        return np.stack([px, py], axis=-1)

    canvas.words(panel.title, (left, top + 10), 17, look.ink, anchor=(0, 0.5))
    for value in np.arange(round(low / step), round(high / step) + 1) * step:
        canvas.line(at([start, stop], [value, value]), 1, look.muted, 0.25)
        canvas.words(f"{value:.5g}", at(start, value) - (8, 0), 13, look.muted, anchor=(1, 0.5))
    for x, words in _stops(start, stop, xs):
        canvas.line(at([x, x], [low, high]), 1, look.muted, 0.12)
        canvas.words(words, at(x, low) + (0, 14), 13, look.muted, anchor=(0.5, 0.5))
    canvas.words(panel.across, ((box[0] + box[2]) / 2, box[3] + 33), 14, look.muted, anchor=(0.5, 0.5))
    for k, curve in enumerate(panel.curves):
        colour = colours.get(curve.name, rgb(PALETTE[k % len(PALETTE)]))
        _curve(canvas, at, curve, names.index(curve.name) if curve.name in names else 0, colour)


def _span_of(panel):
    values = [
        np.concatenate([c.y - (0 if c.error is None else c.error), c.y + (0 if c.error is None else c.error)])
        for c in panel.curves
    ]
    values = np.concatenate(values) if values else np.zeros(1)
    values = values[np.isfinite(values)]
    low, high = (values.min(), values.max()) if len(values) else (0.0, 1.0)
    if low >= 0.0 and low < 0.6 * high:
        low = 0.0
    return ticks(float(low), float(high), 5)


def _stops(start, stop, xs):
    """(place, words) of what is written along the axis."""
    own = np.unique(xs)
    if len(own) <= 8:
        yield from ((x, f"{x:g}") for x in own)
        return
    step = nice((stop - start) / 5)
    yield from ((x, f"{x:g}") for x in np.arange(math.ceil(start / step), math.floor(stop / step) + 1) * step)


def _rows(canvas, corner, panel, colours, names, look):
    """A panel of words: a row each, and the marks of all lines in it."""
    (left, top), (wide, tall) = corner, PANEL
    box = np.array([left + LABELS + 8, top + 30, left + wide - 10, top + tall - 26], float)
    low, high, step = _span_of(panel)

    def at(value, row):
        x = box[0] + (value - low) / (high - low) * (box[2] - box[0])
        return np.array([x, box[1] + (row + 0.5) / len(panel.words) * (box[3] - box[1])])

    canvas.words(panel.title, (left, top + 10), 17, look.ink, anchor=(0, 0.5))
    for value in np.arange(round(low / step), round(high / step) + 1) * step:
        x = at(value, 0)[0]
        canvas.line([(x, box[1]), (x, box[3])], 1, look.muted, 0.25)
        canvas.words(f"{value:.5g}", (x, box[3] + 12), 13, look.muted, anchor=(0.5, 0.5))
    for row, words in enumerate(panel.words):
        canvas.line([at(low, row), at(high, row)], 1, look.muted, 0.12)
        canvas.words(shortened(words, 13, LABELS), at(low, row) - (8, 0), 13, look.muted, anchor=(1, 0.5))
    for k, curve in enumerate(panel.curves):
        colour = colours.get(curve.name, rgb(PALETTE[k % len(PALETTE)]))
        for n, (row, value) in enumerate(zip(curve.x, curve.y, strict=True)):
            if not np.isfinite(value):
                continue
            if curve.error is not None and np.isfinite(curve.error[n]):
                canvas.line([at(value - curve.error[n], row), at(value + curve.error[n], row)], 1.4, colour, 0.8)
            _mark(canvas, at(value, row), names.index(curve.name) if curve.name in names else 0, colour)


def _curve(canvas, at, curve, kind, colour):
    points = at(curve.x, curve.y)
    known = np.isfinite(points).all(1)
    points = points[known]
    canvas.line(points, 2.0 if curve.marks else 1.4, colour, 1.0 if curve.marks else 0.8)
    if curve.error is not None:
        for x, y, e in zip(curve.x[known], curve.y[known], curve.error[known], strict=True):
            if np.isfinite(e) and e > 0:
                ends = at([x, x], [y - e, y + e])
                canvas.line(ends, 1.4, colour, 0.8)
                for end in ends:
                    canvas.line([end - (4, 0), end + (4, 0)], 1.4, colour, 0.8)
    if curve.marks:
        for point in points:
            _mark(canvas, point, kind, colour)
