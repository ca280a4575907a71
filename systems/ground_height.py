"""Height of the ground, for kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import sincos_
from flockbrush.engine.raster import corners_
from flockbrush.engine.seam import on_the_map_
from numba import njit


class Heights(NamedTuple):
    """The ground under those who move on it or above it."""

    relief: np.ndarray  # (my, mx, 3), as from `flockbrush.systems.terrain.relief_of`
    cell: float  # m
    wrap: tuple[float, float]  # m, width and height of a periodic map, else zeros


class Hills(NamedTuple):
    """Ground that is not level, and who walks how steep ground."""

    heights: Heights
    steepness: np.ndarray  # (my + 1, mx + 1) slopes, as from `flockbrush.systems.terrain.steepness_of`
    steepest: np.ndarray  # (n,) slope of the steepest ground that each animal walks on


TURNS, TURN = 24, np.pi / 24  # of a wish, to either side, in search of a way that is not too steep


@njit(cache=True, nogil=True)
def height_of_ground(heights, x, y):
    """Metres, bilinear between the centres of cells."""
    relief, cell, wrap = heights
    west, east, a = corners_(x, cell, relief.shape[1], wrap[0])
    south, north, b = corners_(y, cell, relief.shape[0], wrap[1])
    low = relief[south, west, 0] * (1.0 - a) + relief[south, east, 0] * a
    high = relief[north, west, 0] * (1.0 - a) + relief[north, east, 0] * a
    return low * (1.0 - b) + high * b


@njit(cache=True, nogil=True)
def heights_of_ground(heights, xyz):
    """(n,) m below places (n, 2 or 3)."""
    out = np.empty(len(xyz))
    for i in range(len(xyz)):
        out[i] = height_of_ground(heights, xyz[i, 0], xyz[i, 1])
    return out


@njit(cache=True, nogil=True)
def share_within(heights, x, y, dx, dy, most):
    """How much of a step (dx, dy) along the ground is no longer than ``most`` in space, m; 1 where all of it is."""
    below = height_of_ground(heights, x, y)
    low, high = 0.0, 1.0
    for again in range(24):
        part = 1.0 if again == 0 else 0.5 * (low + high)
        rise = height_of_ground(heights, x + part * dx, y + part * dy) - below
        if part * part * (dx * dx + dy * dy) + rise * rise <= most * most:
            if again == 0:
                return 1.0
            low = part
        else:
            high = part
    return low


@njit(cache=True, nogil=True)
def steepness_at(hills, x, y):
    """Slope of the ground at (x, y) m."""
    cell = hills.heights.cell
    x, y = on_the_map_(x, y, hills.heights.wrap)
    ny, nx = hills.steepness.shape
    ix, iy = min(max(x / cell + 0.5, 0.0), nx - 1.0), min(max(y / cell + 0.5, 0.0), ny - 1.0)
    return hills.steepness[int(iy), int(ix)]


@njit(cache=True, nogil=True)
def is_too_steep(hills, x, y, dx, dy, steepest):
    """Whether a step (dx, dy) leads onto steeper ground.  From such ground it may lead on, but not upwards."""
    if steepness_at(hills, x + dx, y + dy) <= steepest:
        return False
    up = height_of_ground(hills.heights, x + dx, y + dy) > height_of_ground(hills.heights, x, y)
    return up or steepness_at(hills, x, y) <= steepest


@njit(cache=True, nogil=True)
def shorten_on_slopes(order, x, y, step, most, hills, cut):
    """Cut, in place, steps (m, 2) of ``order`` that are longer than ``most`` (m,) in space or too steep; note whose."""
    for s in order:
        dx, dy = step[s, 0], step[s, 1]
        share = 0.0
        if not is_too_steep(hills, x[s], y[s], dx, dy, hills.steepest[s]):
            share = share_within(hills.heights, x[s], y[s], dx, dy, most[s])
        cut[s] = share < 1.0
        if cut[s]:
            step[s, 0], step[s, 1] = share * step[s, 0], share * step[s, 1]


@njit(cache=True, nogil=True)
def round_steep_ground(hills, i, x, y, dx, dy, fx, fy):
    """(dx, dy), or where it leads row i onto too steep ground, the nearest step as long that does not, else none.

    Of two that are as near, the one on the side to which the animal faces, (fx, fy).
    """
    steepest = hills.steepest[i]
    if not is_too_steep(hills, x, y, dx, dy, steepest):
        return dx, dy
    side = 1.0 if dx * fy - dy * fx >= 0.0 else -1.0
    for k in range(2, 2 * TURNS + 2):
        sine, cosine = sincos_((side if k % 2 == 0 else -side) * TURN * (k // 2))
        ex, ey = cosine * dx - sine * dy, sine * dx + cosine * dy
        if not is_too_steep(hills, x, y, ex, ey, steepest):
            return ex, ey
    return 0.0, 0.0


@njit(cache=True, nogil=True)
def turn_from_steep_ground(lo, hi, xyz, forward, wish, ahead, hills, turned):
    """Write wishes (n, 3), turned where they lead onto too steep ground, ``ahead`` (n,) m away."""
    for i in range(lo, hi):
        far = ahead[i]
        turned[i, 0], turned[i, 1], turned[i, 2] = wish[i, 0], wish[i, 1], wish[i, 2]
        dx, dy = far * wish[i, 0], far * wish[i, 1]
        ex, ey = round_steep_ground(hills, i, xyz[i, 0], xyz[i, 1], dx, dy, forward[i, 0], forward[i, 1])
        if (ex != dx or ey != dy) and (ex != 0.0 or ey != 0.0):
            turned[i, 0], turned[i, 1] = ex / far, ey / far


@njit(cache=True, nogil=True)
def below(heights, x, y, dx, dy, limit):
    """Where a step (dx, dy) ends that stays over ground no higher than ``limit``, m: along a slope, else cut short."""
    cell = heights.cell
    if height_of_ground(heights, x + dx, y + dy) <= limit:
        return x + dx, y + dy
    ex = height_of_ground(heights, x + dx + cell, y + dy) - height_of_ground(heights, x + dx - cell, y + dy)
    ey = height_of_ground(heights, x + dx, y + dy + cell) - height_of_ground(heights, x + dx, y + dy - cell)
    up = (dx * ex + dy * ey) / max(ex * ex + ey * ey, 1e-300)
    if up > 0.0:
        dx, dy = dx - up * ex, dy - up * ey
    low, high = 0.0, 1.0
    for again in range(24):
        part = 1.0 if again == 0 else 0.5 * (low + high)
        if height_of_ground(heights, x + part * dx, y + part * dy) <= limit:
            low = part
            if again == 0:
                break
        else:
            high = part
    return x + low * dx, y + low * dy
