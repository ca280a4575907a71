"""Masks that are painted over a picture: obstacles, and regions that are learned apart."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from flockbrush.engine.files import refused, whole
from flockbrush.film.media import read_picture
from flockbrush.render.style import PALETTE, rgb

OBSTACLE = 1  # the value of an obstacle
REGIONS = tuple(rgb(colour) for colour in PALETTE)  # red, green, blue of regions 1 to 8; 0 is everything else
NEAR = 40  # distance in red, green and blue up to which a colour of a file is one of ours


@dataclass(frozen=True)
class MaskLayer:
    """A mask that stays as it is, kept small: undo keeps many of them."""

    size: tuple[int, int]  # width and height, pixels
    packed: bytes  # of an array (h, w) uint8

    @classmethod
    def of(cls, array) -> MaskLayer:
        """The layer of an array (h, w) uint8."""
        array = np.ascontiguousarray(array, np.uint8)
        return cls((array.shape[1], array.shape[0]), zlib.compress(array.tobytes(), 1))

    @classmethod
    def empty(cls, size) -> MaskLayer:
        """Nothing painted."""
        return cls.of(np.zeros((size[1], size[0]), np.uint8))

    @cached_property
    def array(self) -> np.ndarray:
        """(h, w) uint8, not to be written to."""
        flat = np.frombuffer(zlib.decompress(self.packed), np.uint8)
        return flat.reshape(self.size[1], self.size[0])

    @cached_property
    def share(self) -> float:
        """How much of the picture is painted, 0 to 1."""
        return np.count_nonzero(self.array) / self.array.size

    @property
    def blank(self) -> bool:
        """Whether nothing is painted."""
        return not self.share


def stroke(array, start, end, radius, value):
    """Paint a line with round ends into an array (h, w) uint8, in place; places and radius in pixels."""
    fine = 16
    ends = [tuple(round((part - 0.5) * fine) for part in point) for point in (start, end)]
    if radius > 0.75:
        for point in ends:
            cv2.circle(array, point, round(radius * fine), int(value), -1, cv2.LINE_8, 4)
    cv2.line(array, *ends, int(value), max(1, round(2 * radius)), cv2.LINE_8, 4)


def fill(array, at, value):
    """Paint all that hangs together with a place and is painted alike, in place."""
    x, y = int(at[0]), int(at[1])
    high, wide = array.shape
    if 0 <= x < wide and 0 <= y < high and array[y, x] != value:
        cv2.floodFill(array, None, (x, y), int(value), flags=4)


def write_obstacles(path, layer: MaskLayer):
    """Write obstacles as a grey PNG: 255 where one is."""
    _write_png(path, np.where(layer.array > 0, 255, 0).astype(np.uint8))


def write_regions(path, layer: MaskLayer):
    """Write regions as a PNG in colours; what is black belongs to none."""
    table = np.array([(0, 0, 0), *REGIONS], np.uint8)
    _write_png(path, table[layer.array][..., ::-1])


def _write_png(path, picture):
    ok, data = cv2.imencode(".png", picture)
    if not ok:
        raise refused(path, "cannot be written as PNG")
    with whole(path) as temporary:
        temporary.write_bytes(data.tobytes())


def read_obstacles(path, size) -> MaskLayer:
    """Obstacles of a picture: everything that is not black.

    Raises
    ------
    ProblemsError
        When it is no picture, or not as large as the film.
    """
    picture = _read_png(path, size)
    return MaskLayer.of((picture.max(-1) > 127).astype(np.uint8))


def read_regions(path, size) -> MaskLayer:
    """Regions of a picture: each colour one, black none.

    Raises
    ------
    ProblemsError
        When it is no picture, not as large as the film, or has colours that no region has.
    """
    picture = _read_png(path, size)[..., ::-1].astype(int)
    table = np.array([(0, 0, 0), *REGIONS])
    colours, where = np.unique(picture.reshape(-1, 3), axis=0, return_inverse=True)
    gaps = np.linalg.norm(colours[:, None] - table[None], axis=-1)
    if (gaps.min(1) > NEAR).any():
        odd = ", ".join(str(int(part)) for part in colours[np.argmax(gaps.min(1))])
        raise refused(
            path, f"has the colour {odd}, which is not a region colour of this window; paint regions with this window"
        )
    return MaskLayer.of(np.argmin(gaps, axis=1)[where.ravel()].reshape(size[1], size[0]))


def _read_png(path, size):
    picture = read_picture(path)
    if picture.shape[1::-1] != tuple(size):
        own_size, film = f"{picture.shape[1]} x {picture.shape[0]}", f"{size[0]} x {size[1]}"
        raise refused(path, f"has {own_size} pixels, but the clip has {film}; a mask must have the size of the clip")
    return picture
