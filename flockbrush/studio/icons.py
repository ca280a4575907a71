"""Icons of buttons: SVG files drawn in white; black parts erase white.

They are drawn at the size and in the colour that they are needed in.
"""

from __future__ import annotations

import io
from functools import lru_cache
from pathlib import Path

import numpy as np
import pygame

from flockbrush.render.style import Colour

FOLDER = Path(__file__).with_name("button_icons")


@lru_cache(maxsize=512)
def icon(name: str, size: int, colour: Colour) -> pygame.Surface:
    """The picture of this name, size x size pixels, in one colour on nothing."""
    image = pygame.image.load_sized_svg(io.BytesIO((FOLDER / f"{name}.svg").read_bytes()), (size, size))
    white = pygame.surfarray.pixels_red(image).astype(int) * pygame.surfarray.pixels_alpha(image) // 255
    surface = pygame.Surface((size, size), pygame.SRCALPHA)
    surface.fill((*colour, 0))
    pygame.surfarray.pixels_alpha(surface)[:] = white.astype(np.uint8)
    return surface.premul_alpha()  # as pygame_gui wants it
