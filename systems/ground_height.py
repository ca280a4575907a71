"""Height of the ground, for kernels."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def height_of_ground(relief, cell, x, y):
    """Metres, bilinear between the centres of cells; ``relief`` as from `flockbrush.systems.terrain.relief_of`."""
    my, mx = relief.shape[0], relief.shape[1]
    u, v = min(max(x / cell - 0.5, 0.0), mx - 1.0), min(max(y / cell - 0.5, 0.0), my - 1.0)
    west, south = int(u), int(v)
    east, north = min(west + 1, mx - 1), min(south + 1, my - 1)
    a, b = u - west, v - south
    low = relief[south, west, 0] * (1.0 - a) + relief[south, east, 0] * a
    high = relief[north, west, 0] * (1.0 - a) + relief[north, east, 0] * a
    return low * (1.0 - b) + high * b


@njit(cache=True, nogil=True)
def heights_of_ground(relief, cell, xyz):
    """(n,) m below places (n, 2 or 3)."""
    out = np.empty(len(xyz))
    for i in range(len(xyz)):
        out[i] = height_of_ground(relief, cell, xyz[i, 0], xyz[i, 1])
    return out
