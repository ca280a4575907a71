"""Strip charts: a measure over the whole run, with the present marked."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pygame

from flockbrush.render.hud import clock
from flockbrush.studio.panels.panel import blank, write

FINE = 2  # pixels drawn for each one shown
FADED = 90  # of 255: what is yet to come, seen from the past


@dataclass(frozen=True)
class Strip:
    """What one chart shows."""

    title: str
    time: np.ndarray  # (n,); seconds, rising
    lines: list  # list of ((n,), colour); NaN where there is nothing to show
    # now, end: seconds: the present, and the end of the chart
    now: float
    end: float
    top: float  # the value at the upper edge; the lower one is 0
    said: str  # the value of the present, with its unit
    stacked: bool = False  # lines are laid on top of one another, and filled


def strip_picture(strip: Strip, size, font: int, colours) -> pygame.Surface:
    """A chart as a surface: its title and the value of the present above, the course of it below."""
    surface, head = blank(size), round(1.5 * font)
    write(surface, strip.title, (0, head / 2), font, colours.ink, bold=True)
    write(surface, strip.said, (size[0], head / 2), font, colours.ink, (1, 0.5))
    plot = pygame.Rect(0, head, size[0], max(8, size[1] - head))
    pygame.draw.rect(surface, colours.sunken, plot, border_radius=4)
    _grid(surface, plot, colours)
    curves = _curves(strip, plot.size)
    now = _x(strip.now, strip, plot.width)
    if now < plot.width - 2 and len(strip.time) and strip.time[-1] > strip.now + 0.2:
        ahead = curves.subsurface(pygame.Rect(now, 0, plot.width - now, plot.height))
        ahead.fill((255, 255, 255, FADED), special_flags=pygame.BLEND_RGBA_MULT)
    surface.blit(curves, plot)
    _present(surface, plot, now, colours)
    write(surface, _brief(strip.top), (plot.x + 3, plot.y + 2), round(0.8 * font), colours.muted, (0, 0))
    return surface


def axis_picture(end: float, size, font: int, colours) -> pygame.Surface:
    """Times under the charts: the beginning, the middle and the end."""
    surface = blank(size)
    for share in (0.0, 0.5, 1.0):
        write(surface, clock(share * end), (share * size[0], size[1] / 2), font, colours.muted, (share, 0.5))
    return surface


def end_of(last: float) -> float:
    """Where a chart ends that has to show so many seconds: it does not move at every sample."""
    last = max(float(last), 10.0)
    step = 10.0 ** math.floor(math.log10(last)) / 2
    return math.ceil(last / step - 1e-9) * step


def top_of(values) -> float:
    """A round number that no value is above."""
    known = values[np.isfinite(values)]
    most = float(known.max()) if len(known) else 0.0
    if most <= 0:
        return 1.0
    size = 10.0 ** math.floor(math.log10(most))
    return next(step * size for step in (1.0, 1.5, 2.0, 3.0, 5.0, 7.5, 10.0) if step * size >= most * 0.999)


def value_at(time, values, now) -> float:
    """The last value up to a time, NaN when there is none."""
    at = int(np.searchsorted(time, now + 1e-9, side="right")) - 1
    return float(values[at]) if at >= 0 else math.nan


def _x(time, strip, width):
    return int(np.clip(round(time / strip.end * (width - 1)), 0, width - 1))


def _grid(surface, plot, colours):
    for share in (0.25, 0.5, 0.75):
        y = plot.bottom - share * plot.height
        pygame.draw.line(surface, (*colours.border, 130), (plot.left + 2, y), (plot.right - 3, y))


def _curves(strip, size) -> pygame.Surface:
    """The lines alone, drawn large and shrunk so that they are smooth."""
    width, height = size[0] * FINE, size[1] * FINE
    large = pygame.Surface((width, height), pygame.SRCALPHA)
    if len(strip.time) > 1:
        x = np.clip(strip.time / strip.end, 0, 1) * (width - 1)
        base = np.zeros(len(x))
        for values, colour in strip.lines:
            y = height - 2 - (base + values if strip.stacked else values) / strip.top * (height - 4 * FINE)
            if strip.stacked:
                low = height - 2 - base / strip.top * (height - 4 * FINE)
                _fill(large, x, low, y, colour)
                base = base + values
            else:
                _stroke(large, x, y, colour)
    return pygame.transform.smoothscale(large, size)


def _stroke(large, x, y, colour):
    """A line through the points, broken where there is no value."""
    good = np.isfinite(y)
    for part in np.split(np.arange(len(x)), np.flatnonzero(np.diff(good)) + 1):
        if good[part[0]] and len(part) > 1:
            pygame.draw.lines(large, colour, False, np.stack([x[part], y[part]], 1).tolist(), 2 * FINE)


def _fill(large, x, low, high, colour):
    """The area between two lines."""
    if np.abs(low - high).max() < 0.5:
        return
    points = np.concatenate([np.stack([x, high], 1), np.stack([x, low], 1)[::-1]])
    pygame.draw.polygon(large, colour, points.tolist())


def _present(surface, plot, now, colours):
    x = plot.x + now
    pygame.draw.line(surface, colours.ink, (x, plot.y), (x, plot.bottom - 1))
    pygame.draw.polygon(surface, colours.ink, [(x - 4, plot.y), (x + 4, plot.y), (x, plot.y + 5)])


def _brief(number):
    return f"{number:,.0f}" if number >= 10 else f"{number:g}"
