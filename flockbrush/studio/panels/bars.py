"""Bars with words: how much of each thing there is."""

from __future__ import annotations

from dataclasses import dataclass

import pygame

from flockbrush.render.style import Colour
from flockbrush.studio.panels.panel import blank, write


@dataclass(frozen=True)
class Bar:
    """One bar: its words, its length as a share of the longest, what is written at its end, its colour."""

    words: str
    share: float
    said: str
    colour: Colour | str
    strong: bool = False


def bars_picture(
    bars, size, row: int, font: int, colours, left: float = 0.42, both_ways: bool = False
) -> pygame.Surface:
    """Bars below one another, each in a row: words at the left, the bar, the number at the right end.

    Parameters
    ----------
    size : (int, int)
        Pixels; rows that do not fit are left out.
    row, font : int
        Height of a row and of its letters, pixels.
    colours : Chrome
    left : float
        Share of the width for the words.
    both_ways : bool
        Bars begin in the middle: positive ones go left, negative ones right, as an animal turns.
    """
    surface = blank(size)
    width = size[0]
    start, stop = left * width, width - 4.2 * font
    for k, bar in enumerate(bars):
        y = (k + 0.5) * row
        if y + row / 2 > size[1]:
            break
        write(surface, bar.words, (0, y), font, colours.ink, bold=bar.strong, room=start - font / 2)
        track = pygame.Rect(start, y - 0.22 * row, max(1, stop - start), max(3, 0.44 * row))
        pygame.draw.rect(surface, colours.sunken, track, border_radius=3)
        _fill(surface, track, bar, both_ways)
        if both_ways:
            pygame.draw.line(surface, colours.muted, (track.centerx, track.top - 1), (track.centerx, track.bottom))
        write(surface, bar.said, (width, y), font, colours.ink, (1, 0.5), bold=bar.strong)
    return surface


def _fill(surface, track, bar, both_ways):
    share = min(max(bar.share, -1.0 if both_ways else 0.0), 1.0)
    long = abs(share) * track.width * (0.5 if both_ways else 1.0)
    if long > 0:
        begin = track.x if not both_ways else track.centerx - (long if share > 0 else 0)
        filled = pygame.Rect(round(begin), track.y, max(2, round(long)), track.height)
        pygame.draw.rect(surface, bar.colour, filled, border_radius=3)
