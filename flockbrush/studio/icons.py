"""Small pictures for buttons, drawn at the size they are needed."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pygame

from flockbrush.render.canvas import Canvas, circle
from flockbrush.render.style import Colour

FINE = 4  # pixels drawn for each one shown


@lru_cache(maxsize=512)
def icon(name: str, size: int, colour: Colour) -> pygame.Surface:
    """The picture of this name, size x size pixels, in one colour on nothing."""
    side = size * FINE
    image = np.zeros((side, side, 3), np.uint8)
    pen = _Pen(Canvas(image), side / 24)
    ICONS[name](pen)
    cover = image[:, :, 0].reshape(size, FINE, size, FINE).mean((1, 3))
    surface = pygame.Surface((size, size), pygame.SRCALPHA)
    surface.fill((*colour, 0))
    pygame.surfarray.pixels_alpha(surface)[:] = cover.T.astype(np.uint8)
    return surface.premul_alpha()  # as pygame_gui wants it


class _Pen:
    """Draws in units of a square of 24 x 24, white on black."""

    def __init__(self, canvas, unit):
        self.canvas, self.unit = canvas, unit

    def line(self, *points, width=1.9, closed=False, dash=None):
        dash = None if dash is None else tuple(part * self.unit for part in dash)
        self.canvas.line(np.array(points, float) * self.unit, width * self.unit, INK, closed=closed, dash=dash)

    def area(self, *points):
        self.canvas.area(np.array(points, float) * self.unit, INK)

    def hole(self, *points):
        self.canvas.area(np.array(points, float) * self.unit, NOTHING)

    def ring(self, x, y, radius, width=1.9, dash=None):
        dash = None if dash is None else tuple(part * self.unit for part in dash)
        self.canvas.ring((x * self.unit, y * self.unit), radius * self.unit, width * self.unit, INK, dash=dash)

    def disc(self, x, y, radius):
        self.canvas.area(circle((x * self.unit, y * self.unit), radius * self.unit), INK)

    def arrow(self, tip, direction, size):
        self.canvas.arrowhead(np.array(tip, float) * self.unit, direction, size * self.unit, INK)

    def arc(self, x, y, radius, start, stop, width=1.9):
        turn = np.radians(np.linspace(start, stop, 24))
        self.line(*np.stack([x + radius * np.cos(turn), y - radius * np.sin(turn)], axis=1), width=width)


INK, NOTHING = (255, 255, 255), (0, 0, 0)


def _brush(pen):
    pen.line((20, 4), (12, 13), width=3.4)
    pen.area((12.8, 11), (14.6, 14), (11.5, 18.5), (4, 20.5), (7.2, 17.5), (8.4, 13.6))


def _cap(pen):
    pen.arc(12, 15, 8.5, -10, 190)
    pen.line((12, 15), (16.5, 9), width=2.2)
    pen.disc(12, 15, 2)


def _surface(pen):
    pen.line((3, 19), (8, 9), (12, 15), (16, 7), (21, 19), closed=True, width=1.8)
    pen.line((6, 19), (18, 19))


def _obstacle(pen):
    pen.area((4, 18), (6, 9), (12, 5), (18, 8), (20.5, 15), (17, 19))


def _rectangle(pen):
    pen.area((4, 7), (20, 7), (20, 17), (4, 17))


def _polygon(pen):
    corners = [(5, 17), (7, 6), (18, 5), (20, 15), (12, 19)]
    pen.line(*corners, closed=True, width=1.6)
    for x, y in corners:
        pen.disc(x, y, 2.1)


def _erase(pen):
    pen.line((3.5, 14.5), (12, 5), (20, 12), (13, 19.5), (8, 19.5), closed=True)
    pen.area((3.5, 14.5), (8, 9.5), (15.5, 16.5), (13, 19.5), (8, 19.5))


def _pick(pen):
    pen.line((4.5, 19.5), (12.5, 11.5), width=2.6)
    pen.line((11, 8), (16, 13), width=2.4)
    pen.line((14, 10), (18, 6), width=5)


def _fill(pen):
    pen.line((5, 12), (12, 5), (19, 12), (12, 19), closed=True)
    pen.area((5, 12), (19, 12), (12, 19))
    pen.disc(21, 18, 1.9)


def _guide(pen):
    pen.line((4, 19), (6, 13), (12, 11.5), (17, 7.5), width=2.2)
    pen.arrow((21, 4.5), (4, -3), 8)
    pen.disc(4.2, 19, 2.2)


def _goal(pen):
    pen.line((7, 21), (7, 3.5), width=2)
    pen.area((7, 4), (19, 8), (7, 12.5))


def _exit(pen):
    pen.line((14, 4), (5, 4), (5, 20), (14, 20))
    pen.line((10, 12), (17, 12), width=2)
    pen.arrow((21.5, 12), (1, 0), 7)


def _spawn(pen):
    pen.ring(12, 12, 9, width=1.7, dash=(4.2, 2.9))
    _body(pen, 12, 12, 0.8)


def _body(pen, x, y, scale=1.0):
    turn = np.radians(np.arange(0, 360, 15))
    pen.area(*np.stack([x + 6.2 * scale * np.cos(turn), y + 3.3 * scale * np.sin(turn)], axis=1))


def _zone(pen):
    pen.line((4, 8), (11, 4), (20, 7), (19, 17), (9, 20), closed=True, width=1.8, dash=(3.6, 2.4))
    pen.disc(12, 12, 3.2)


def _line(pen):
    pen.line((4, 19), (20, 5), width=2.2)
    pen.line((7, 8), (14, 15), width=1.7)
    pen.arrow((16.5, 17.5), (1, 1), 6)


def _key(pen):
    pen.ring(12, 12, 9)
    pen.line((12, 6), (12, 12), (16, 14.5), width=2.2)


def _area(pen):
    pen.line((4, 5), (20, 5), (20, 19), (4, 19), closed=True, width=1.8)
    for x in (8, 12, 16):
        pen.line((x, 15.5), (x, 8.5), width=1.8)


def _add(pen):
    _body(pen, 10, 15, 1.2)
    pen.line((18, 3), (18, 10), width=2.2)
    pen.line((14.5, 6.5), (21.5, 6.5), width=2.2)


def _remove(pen):
    _body(pen, 10, 15, 1.2)
    pen.line((14.5, 6.5), (21.5, 6.5), width=2.2)


def _predator(pen):
    pen.area((3, 12), (8, 5), (10, 9), (14, 9), (16, 5), (21, 12), (15, 16), (12, 21), (9, 16))
    pen.hole((8, 11.5), (10.6, 12.8), (8.6, 13.4))
    pen.hole((16, 11.5), (13.4, 12.8), (15.4, 13.4))


def _select(pen):
    pen.area((6, 3), (19, 14), (13, 14.4), (16.2, 20.4), (13.4, 21.6), (10.4, 15.6), (6, 19.4))


def _lead(pen):
    pen.ring(6.5, 17, 3.4)
    pen.line((9, 14.6), (17.4, 6.2), width=2.2)
    pen.arrow((20.6, 3.2), (1, -1), 8)


def _play(pen):
    pen.area((7, 4), (20, 12), (7, 20))


def _pause(pen):
    pen.area((6, 4), (10, 4), (10, 20), (6, 20))
    pen.area((14, 4), (18, 4), (18, 20), (14, 20))


def _step(pen):
    pen.area((5, 5), (15, 12), (5, 19))
    pen.area((16, 5), (19, 5), (19, 19), (16, 19))


def _back(pen):
    pen.area((19, 5), (9, 12), (19, 19))
    pen.area((5, 5), (8, 5), (8, 19), (5, 19))


def _restart(pen):
    pen.arc(12, 12.5, 7.5, -50, 215, width=2.1)
    pen.arrow((3.6, 19.5), (-0.35, 1), 7)


def _undo(pen):
    pen.arc(12.5, 14.5, 6.2, -80, 150, width=2.1)
    pen.arrow((2.9, 12.5), (-0.75, 0.55), 8)


def _redo(pen):
    pen.arc(11.5, 14.5, 6.2, 30, 260, width=2.1)
    pen.arrow((21.1, 12.5), (0.75, 0.55), 8)


def _save(pen):
    pen.line((4, 4), (16.5, 4), (20, 7.5), (20, 20), (4, 20), closed=True)
    pen.area((8, 4), (15, 4), (15, 9), (8, 9))
    pen.area((7, 13), (17, 13), (17, 20), (7, 20))


def _record(pen):
    pen.ring(12, 12, 9)
    pen.disc(12, 12, 5)


def _camera(pen):
    pen.line((3, 8), (8, 8), (9.5, 5), (14.5, 5), (16, 8), (21, 8), (21, 19), (3, 19), closed=True)
    pen.ring(12, 13, 3.6)


def _help(pen):
    pen.arc(12, 8.6, 4.4, -50, 180, width=2.2)
    pen.line((14.8, 12), (12, 14), (12, 16), width=2.2)
    pen.disc(12, 20, 1.5)


def _sun(pen):
    pen.ring(12, 12, 8.2)
    turn = np.radians(np.arange(90, 271, 10))
    pen.area(*np.stack([12 + 8.2 * np.cos(turn), 12 - 8.2 * np.sin(turn)], axis=1))


def _cube(pen):
    top, bottom, left, right = (12, 2.8), (12, 21.2), 4.2, 19.8
    pen.line(top, (right, 7.4), (right, 16.6), bottom, (left, 16.6), (left, 7.4), closed=True)
    pen.line((left, 7.4), (12, 12), (right, 7.4))
    pen.line((12, 12), bottom)


def _fit(pen):
    for x, y in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
        pen.line((12 - 8 * x, 12 - 3 * y), (12 - 8 * x, 12 - 8 * y), (12 - 3 * x, 12 - 8 * y))


def _branch(pen):
    pen.line((7, 4), (7, 20))
    pen.line((7, 14), (17, 9), (17, 6))
    for x, y in ((7, 4.5), (7, 19.5), (17, 5)):
        pen.disc(x, y, 2.6)


def _menu(pen):
    for y in (6, 12, 18):
        pen.line((4, y), (20, y), width=2.2)


ICONS = {
    name[1:]: draw
    for name, draw in list(globals().items())
    if name.startswith("_") and name[1:].isalpha() and callable(draw) and name not in ("_Pen", "_body")
}
