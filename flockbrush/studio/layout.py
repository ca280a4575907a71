"""The layout of the window for any size."""

from __future__ import annotations

from dataclasses import dataclass

from pygame import Rect

from flockbrush.studio.theme import px

NARROW, VERY_NARROW, LOW, VERY_LOW = 700, 430, 300, 200  # pixels: below, the right column, the left one, bars go


@dataclass(frozen=True)
class Places:
    """Rectangles of the window's parts; those for which there is no room are None."""

    top: Rect | None
    left: Rect | None
    right: Rect | None
    time: Rect | None
    hint: Rect | None
    canvas: Rect


def places(size, scale: float, columns=True) -> Places:
    """Divide a window."""
    width, height = size
    small = min(scale, 1.0)  # large words never take controls away: those then scroll
    top = px(scale, 42) if height >= px(small, LOW) else 0
    bottom = px(scale, 62) if height >= px(small, VERY_LOW) else 0
    left = min(px(scale, 208), width // 3) if columns and width >= px(small, VERY_NARROW) else 0
    right = min(px(scale, 300), width // 3) if columns and width >= px(small, NARROW) else 0
    hint = px(scale, 28) if height >= px(small, LOW) else 0
    inner = height - top - bottom
    middle = width - left - right
    return Places(
        Rect(0, 0, width, top) if top else None,
        Rect(0, top, left, inner) if left else None,
        Rect(width - right, top, right, inner) if right else None,
        Rect(0, height - bottom, width, bottom) if bottom else None,
        Rect(left, height - bottom - hint, middle, hint) if hint else None,
        Rect(left, top, middle, inner - hint),
    )
