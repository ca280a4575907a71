"""Words as arrays, in the font that comes with pygame-ce; no display is needed."""

from __future__ import annotations

import os
from functools import lru_cache

import numpy as np

HALO = 3  # pixels that a halo is wider than its word to every side
FINE = 4  # letters are drawn so much larger and shrunk: small ones keep their distances


@lru_cache(maxsize=64)
def _font(height: int):
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame.font

    if not pygame.font.get_init():
        pygame.font.init()
    return pygame.font.Font(None, max(6, round(height * 1.25)))


@lru_cache(maxsize=1024)
def words(text: str, height: int) -> np.ndarray:
    """The text as coverage, (h, w) float32 in 0..1, about `height` pixels high from top to bottom of its letters.

    Characters that no font can show (control characters) are left out.  The array is shared: do not write to it.
    """
    text = "".join(c for c in text if c.isprintable() and ord(c) < 0x10000)
    if not text:
        return np.zeros((height, 0), np.float32)
    surface = _font(FINE * height).render(text, True, (255, 255, 255))
    import cv2
    from pygame.surfarray import array_alpha

    alpha = np.ascontiguousarray(array_alpha(surface).T)
    alpha = np.pad(alpha, [(0, -side % FINE) for side in alpha.shape]).astype(np.float32) / 255
    alpha = cv2.resize(alpha, None, fx=1 / FINE, fy=1 / FINE, interpolation=cv2.INTER_AREA)
    alpha = np.minimum(alpha * 1.15, 1)  # as dark as letters drawn at this size
    alpha.setflags(write=False)
    return alpha


@lru_cache(maxsize=256)
def halo(text: str, height: int) -> np.ndarray:
    """Coverage around the text, (h + 2 HALO, w + 2 HALO) float32 in 0..1, shared like that of `words`."""
    import cv2

    grown = cv2.dilate(np.pad(words(text, height), HALO), np.ones((3, 3), np.uint8))
    soft = np.minimum(cv2.GaussianBlur(grown, (5, 5), 0) * 1.4, 1).astype(np.float32)
    soft.setflags(write=False)
    return soft


def width_of(text: str, height: int) -> int:
    """Pixels that the text takes across."""
    return words(text, height).shape[1]


def shortened(text: str, height: int, room: float) -> str:
    """The text, or its beginning with three dots when it is wider than the room (pixels); empty when nothing fits."""
    if width_of(text, height) <= room:
        return text
    low, high = 0, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if width_of(text[:middle].rstrip() + "...", height) <= room:
            low = middle
        else:
            high = middle - 1
    return text[:low].rstrip() + "..." if low else ""
