"""The arrays of a level's ground, cell by cell."""

from __future__ import annotations

import numpy as np
from flockbrush.levels.schema import Terrain


def bare_ground(shape):
    """Ground on which nothing is painted."""
    blank = np.ones(shape, bool), np.ones(shape), np.ones(shape), np.zeros(shape, bool)
    return Terrain(*blank, np.full(shape, -1, np.int16), [], [])


def put_ground(ground, here, values, number=None):
    """Make cells a kind of ground, by its values of class Terrain; its number among the kinds."""
    for name in ("walkable", "speed_factor", "cost", "blocks_view"):
        getattr(ground, name)[here] = values[name]
    if number is None:
        number = len(ground.names)
        ground.names.append(values["name"])
        ground.colours.append(values["colour"])
    ground.index[here] = number
    return number
