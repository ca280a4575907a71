"""Height of the ground, for kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Heights(NamedTuple):
    """The ground under those who move on it or above it."""

    relief: np.ndarray  # (my, mx, 3), as from `flockbrush.systems.terrain.relief_of`
    cell: float  # m
    wrap: tuple[float, float]  # m, width and height of a periodic map, else zeros


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


@njit(cache=True, nogil=True)
def share_within(heights, x, y, dx, dy, most):
    """How much of a step (dx, dy) along the ground is no longer than ``most`` in space, m; 1 where all of it is."""
    relief, cell, wrap = heights
    below = height_of_ground(relief, cell, x, y)
    low, high = 0.0, 1.0
    for again in range(24):
        part = 1.0 if again == 0 else 0.5 * (low + high)
        px, py = x + part * dx, y + part * dy
        if wrap[0] > 0.0:
            px, py = px - wrap[0] * np.floor(px / wrap[0]), py - wrap[1] * np.floor(py / wrap[1])
        rise = height_of_ground(relief, cell, px, py) - below
        if part * part * (dx * dx + dy * dy) + rise * rise <= most * most:
            if again == 0:
                return 1.0
            low = part
        else:
            high = part
    return low


@njit(cache=True, nogil=True)
def shorten_on_slopes(order, x, y, step, most, heights, cut):
    """Cut, in place, steps (m, 2) of ``order`` that lead up or down farther than ``most`` (m,) in space; note whose."""
    for s in order:
        share = share_within(heights, x[s], y[s], step[s, 0], step[s, 1], most[s])
        cut[s] = share < 1.0
        if cut[s]:
            step[s, 0], step[s, 1] = share * step[s, 0], share * step[s, 1]


@njit(cache=True, nogil=True)
def below(relief, cell, x, y, dx, dy, limit):
    """Where a step (dx, dy) ends that stays over ground no higher than ``limit``, m: along a slope, else cut short."""
    if height_of_ground(relief, cell, x + dx, y + dy) <= limit:
        return x + dx, y + dy
    ex = height_of_ground(relief, cell, x + dx + cell, y + dy) - height_of_ground(relief, cell, x + dx - cell, y + dy)
    ey = height_of_ground(relief, cell, x + dx, y + dy + cell) - height_of_ground(relief, cell, x + dx, y + dy - cell)
    up = (dx * ex + dy * ey) / max(ex * ex + ey * ey, 1e-300)
    if up > 0.0:
        dx, dy = dx - up * ex, dy - up * ey
    low, high = 0.0, 1.0
    for again in range(24):
        part = 1.0 if again == 0 else 0.5 * (low + high)
        if height_of_ground(relief, cell, x + part * dx, y + part * dy) <= limit:
            low = part
            if again == 0:
                break
        else:
            high = part
    return x + low * dx, y + low * dy
