"""What a picture of animals needs to know about them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.mesh_bodies import NO_LOOK, Postures
from flockbrush.render.wakes import Wakes


class DrawnHerd(NamedTuple):
    """The animals of one moment, in metres, one row each; rows are drawn in order, later ones on top."""

    xy: np.ndarray  # (n, 2) or (n, 3) array; position, m
    forward: np.ndarray  # (n, 2) or (n, 3) array; heading, a unit vector
    # length, radius: (n,) array or float; of the body, m; the length is from tip to tip
    length: np.ndarray | float = 1.0
    radius: np.ndarray | float = 0.3
    leader: np.ndarray | None = None  # (n,) bool array, optional
    brush: np.ndarray | None = None  # (n,) int array, optional; which of `brush_colours` the animal has; -1 for none
    species: np.ndarray | None = None  # (n,) int array, optional
    z: np.ndarray | None = None  # (n,) array, optional; height over the ground, m; moves the shadow
    brush_colours: np.ndarray | tuple = ()  # (k, 3) uint8 array or k strings "#rrggbb"
    brush_names: tuple = ()  # k strings; for the legend
    predator: np.ndarray | None = None  # (n,) bool array, optional
    # (n,) int array, optional; lets trails follow their animals when others are born or die
    ids: np.ndarray | None = None
    # (n,) array, optional; how high the wings of a bird in flight are, from -1 to 1; NaN for who has none, or keeps
    # them folded
    wings: np.ndarray | None = None
    # (n, 3) array, optional; unit vector out of the back, for those that bank; seen in space only
    up: np.ndarray | None = None
    # look, clip and phase of each, for who is large enough in the picture for legs and wings
    postures: Postures | None = None
    wakes: Wakes | None = None  # dust and ripples that each leaves behind; drawn where the time is told


EMPTY = DrawnHerd(np.zeros((0, 2)), np.zeros((0, 2)))


def column(values, count: int, dtype, default, name: str) -> np.ndarray:
    """Values as one contiguous column of `count` rows; ValueError when they cannot be."""
    values = default if values is None else values
    array = np.asarray(values, dtype)
    if array.ndim == 0:
        return np.full(count, array, dtype)
    if array.shape != (count,):
        raise ValueError(f"{name} of {count} animals has shape ({count},), got {array.shape}")
    return np.ascontiguousarray(array)


def plane(values, name: str) -> np.ndarray:
    """East and north of (n, 2) or (n, 3) values; ValueError naming the first row that is not finite."""
    array = np.asarray(values, np.float64)
    if array.ndim != 2 or array.shape[1] not in (2, 3):
        raise ValueError(f"{name} has shape (n, 2) or (n, 3), got {array.shape}")
    array = np.ascontiguousarray(array[:, :2])
    refuse_nan(array, name)
    return array


def refuse_nan(array: np.ndarray, name: str):
    """ValueError naming the first row of the array that is not finite."""
    good = np.isfinite(array)
    if not good.all():
        row = int(np.argwhere(~good)[0, 0])
        raise ValueError(f"animal in row {row} cannot be drawn: its {name} is {array[row]}")


def checked(herd: DrawnHerd) -> DrawnHerd:
    """The herd with every column filled, contiguous and finite; ValueError names an animal that is not."""
    xy, forward = plane(herd.xy, "position"), plane(herd.forward, "heading")
    count = len(xy)
    if len(forward) != count:
        raise ValueError(f"{count} animals need as many headings, got {len(forward)}")
    length = column(herd.length, count, np.float64, 1.0, "length")
    radius = column(herd.radius, count, np.float64, 0.3, "radius")
    z = column(herd.z, count, np.float64, 0.0, "z")
    for values, name in ((length, "length"), (radius, "radius"), (z, "z")):
        refuse_nan(values, name)
    return herd._replace(
        xy=xy,
        forward=forward,
        length=length,
        radius=radius,
        z=z,
        leader=column(herd.leader, count, np.bool_, False, "leader"),
        predator=column(herd.predator, count, np.bool_, False, "predator"),
        wings=column(herd.wings, count, np.float64, np.nan, "wings"),
        brush=column(herd.brush, count, np.int64, -1, "brush"),
        postures=_postures(herd.postures, count),
    )


def _postures(postures, count):
    """Postures of all animals; None if no animal has a look."""
    look, clip, phase = postures or (None, None, None)
    return Postures(
        column(look, count, np.int64, NO_LOOK, "look"),
        column(clip, count, np.int64, 0, "clip"),
        column(phase, count, np.float64, 0.0, "phase"),
    )
