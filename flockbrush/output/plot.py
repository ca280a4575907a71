"""Measures over time as a picture, drawn with the program's own pen."""

from __future__ import annotations

import math

import numpy as np

from flockbrush.render import write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import PALETTE, rgb, theme_of
from flockbrush.render.text import shortened
from flockbrush.systems.measures import measures

PANEL = 620, 260  # pixels
GAP, HEAD = 28, 64


def draw_series(path, series, title, names, theme="light"):
    """Draw measures over time, a panel each.

    Parameters
    ----------
    path : path
        A PNG.
    series : dict of str to list
        ``time`` in seconds, and the measures; NaN where there is none.
    names : sequence of str
        Which measures; those without a number are left out.
    """
    look = theme_of(theme)
    names = [name for name in names if name in series and np.isfinite(np.array(series[name], float)).any()]
    rows = max(1, math.ceil(len(names) / 2))
    width, height = 2 * PANEL[0] + 3 * GAP, HEAD + rows * (PANEL[1] + GAP)
    image = np.full((height, width, 3), rgb(look.paper), np.uint8)
    canvas = Canvas(image)
    canvas.words(title, (GAP, HEAD / 2), 22, look.ink, anchor=(0, 0.5))
    for k, name in enumerate(names):
        left, top = GAP + k % 2 * (PANEL[0] + GAP), HEAD + k // 2 * (PANEL[1] + GAP)
        _panel(canvas, (left, top), series["time"], series[name], name, rgb(PALETTE[k % len(PALETTE)]), look)
    write_png(path, image)


def _panel(canvas, corner, time, values, name, colour, look):
    """One measure in its frame."""
    time, values = np.array(time, float), np.array(values, float)
    (left, top), (wide, tall) = corner, PANEL
    known = measures().get(name)
    bounded = known is not None and known.low is not None and known.high is not None
    low, high, step = ticks(*((known.low, known.high) if bounded else (np.nanmin(values), np.nanmax(values))))
    box = np.array([left + 52, top + 30, left + wide - 8, top + tall - 26], float)
    start, stop = time[0], time[-1] if time[-1] > time[0] else time[0] + 1

    def at(t, v):
        x = box[0] + (np.asarray(t) - start) / (stop - start) * (box[2] - box[0])
        y = box[3] - (np.asarray(v) - low) / (high - low) * (box[3] - box[1])
        return np.stack([x, y], axis=-1)

    used = canvas.words(known.axis if known else name, (left, top + 10), 17, look.ink, anchor=(0, 0.5))
    if known is not None:
        meaning = shortened(known.meaning, 13, wide - used - 24)
        canvas.words(meaning, (left + used + 16, top + 11), 13, look.muted, anchor=(0, 0.5))
    for value in np.arange(round(low / step), round(high / step) + 1) * step:
        canvas.line(at([start, stop], [value, value]), 1, look.muted, 0.25)
        canvas.words(f"{value:.6g}", at(start, value) - (8, 0), 13, look.muted, anchor=(1, 0.5))
    across = nice((stop - start) / 4)
    for t in np.arange(math.ceil(start / across), math.floor(stop / across) + 1) * across:
        canvas.line(at([t, t], [low, high]), 1, look.muted, 0.12)
        canvas.words(f"{t:g} s", at(t, low) + (0, 14), 13, look.muted, anchor=(0.5, 0.5))
    for part in _unbroken(values):
        points = at(time[part], values[part])
        if len(points) > 1:
            canvas.line(points, 2.2, colour)
        else:
            canvas.disc(points[0], 2.5, colour)


def ticks(low, high, about=4):
    """(lowest, highest, step) of an axis with round numbers that holds both ends."""
    if not high > low:
        low, high = low - 0.5 * max(abs(low), 1e-9), high + 0.5 * max(abs(high), 1e-9)
    step = nice((high - low) / (about - 1))
    return math.floor(low / step + 1e-9) * step, math.ceil(high / step - 1e-9) * step, step


def _unbroken(values):
    """Slices of the runs of finite numbers."""
    known = np.concatenate([[False], np.isfinite(values), [False]])
    edges = np.flatnonzero(known[1:] != known[:-1])
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
