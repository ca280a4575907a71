"""The arena of tracked animals: the wall of a tank or a pen, which a file of tracks does not show.

Turns away from a wall are turns that no neighbour causes. Without the wall a model has to explain them otherwise, and
herds simulated with it leave on all sides.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from flockbrush.engine.files import refused
from flockbrush.film.track_files import Trajectories

SIDES = 64  # of the polygon that stands for a circle
BEYOND = 0.5  # BL that an animal may be outside a given arena: positions have errors
FARTHEST = 1e12  # in the unit of the tracks, as for their positions
SHAPES = {"circle": ("X", "Y", "R"), "rectangle": ("X0", "Y0", "X1", "Y1")}


@dataclass(frozen=True)
class Arena:
    """A wall around animals, in the unit and with the axes of their file of tracks.

    Without numbers it is to be found: the smallest circle, or upright rectangle, that holds all positions.
    """

    shape: str  # of `SHAPES`
    numbers: tuple[float, ...] = ()  # centre and radius of a circle; two opposite corners of a rectangle

    @classmethod
    def read(cls, text: str) -> Arena:
        """From ``circle``, ``rectangle``, ``circle:X,Y,R`` or ``rectangle:X0,Y0,X1,Y1``.

        Raises
        ------
        ValueError
            With what would be right.
        """
        shape, colon, rest = text.strip().lower().partition(":")
        try:
            numbers = tuple(float(word) for word in rest.split(",")) if colon else ()
        except ValueError:
            numbers = (np.nan,)
        near = all(abs(number) < FARTHEST for number in numbers)
        if not near or shape not in SHAPES or (colon and len(numbers) != len(SHAPES[shape])):
            ways = " or ".join(f"{name}:{','.join(words)}" for name, words in SHAPES.items())
            raise ValueError(f"must be circle, rectangle, {ways}, got {text!r}")
        if numbers and (numbers[2] <= 0 if shape == "circle" else numbers[0] == numbers[2] or numbers[1] == numbers[3]):
            raise ValueError(f"has no inside: {text!r}")
        return cls(shape, numbers)

    def around(self, tracks: Trajectories, room: float) -> Arena:
        """The same with numbers: where it has none, those that hold all positions and so much room, in their unit."""
        if self.numbers:
            return self
        xy, room = tracks.xy[tracks.seen] / tracks.axes, room / abs(tracks.axes[0])
        if self.shape == "rectangle":
            return Arena(self.shape, (*(xy.min(0) - room), *(xy.max(0) + room)))
        (x, y), _ = cv2.minEnclosingCircle(xy.astype(np.float32))  # which rounds
        return Arena(self.shape, (x, y, float(np.hypot(*(xy - (x, y)).T).max()) + room))

    @property
    def corners(self) -> np.ndarray:
        """(k, 2), counter-clockwise."""
        if self.shape == "circle":
            x, y, radius = self.numbers
            angle = 2 * np.pi * (np.arange(SIDES) + 0.5) / SIDES
            return (x, y) + radius / np.cos(np.pi / SIDES) * np.column_stack([np.cos(angle), np.sin(angle)])
        (x0, x1), (y0, y1) = sorted(self.numbers[::2]), sorted(self.numbers[1::2])
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])

    def told(self, unit: str) -> str:
        """A sentence; the unit is that of the file."""
        if self.shape == "circle":
            x, y, radius = self.numbers
            return f"the arena is a circle of radius {radius:.4g} {unit} about ({x:.4g}, {y:.4g})"
        (x0, y0), (x1, y1) = self.corners[[0, 2]]
        return f"the arena is a rectangle from ({x0:.4g}, {y0:.4g}) to ({x1:.4g}, {y1:.4g}) {unit}"


def wall_of(arena: Arena, tracks: Trajectories, length: float) -> np.ndarray:
    """The corners of an arena with numbers, (k, 2) BL, counter-clockwise with y up.

    Parameters
    ----------
    length : float
        Body length in the unit of the tracks.

    Raises
    ------
    ProblemsError
        When an animal is outside, with its name and frame.
    """
    corners = arena.corners[:: int(np.sign(np.prod(tracks.axes)))] * tracks.axes
    out = _outside(tracks.xy[tracks.seen], corners)
    if out.max() > BEYOND * length:
        frame, animal = np.argwhere(tracks.seen)[int(out.argmax())]
        raise refused(
            tracks.name,
            f"animal {tracks.ids[animal]} is {out.max() / abs(tracks.axes[0]):.3g} {tracks.file_unit} outside the "
            f"arena in frame {tracks.frames[frame]}: {arena.told(tracks.file_unit)}",
        )
    return corners / length


def _outside(xy, corners):
    """How far points (n, 2) are outside a convex polygon (k, 2), at least."""
    along = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([along[:, 1], -along[:, 0]]) / np.hypot(*along.T)[:, None]
    out = np.full(len(xy), -np.inf)
    for corner, way in zip(corners, outward, strict=True):  # one by one: a file may have millions of positions
        np.maximum(out, (xy - corner) @ way, out=out)
    return out


def ring(corners, low, high) -> np.ndarray:
    """(k, 5) edges of an obstacle that fills the ground from ``low`` to ``high`` around an arena (`Fields.outline`)."""
    (x0, y0), (x1, y1) = low, high
    ground = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    edges = [np.hstack([line, np.roll(line, -1, axis=0)]) for line in (ground, corners[::-1])]
    return np.column_stack([np.concatenate(edges), np.zeros(len(ground) + len(corners))])


def lines_of(outline) -> list[np.ndarray]:
    """The two closed lines of a `ring`, (4, 2) and (k - 4, 2)."""
    return np.split(outline[:, :2], [4])


def beyond(corners, centres) -> np.ndarray:
    """(ny, nx) bool: cells with their centres (ny, nx, 2) outside an arena."""
    return _outside(centres.reshape(-1, 2), corners).reshape(centres.shape[:2]) > 0.0
