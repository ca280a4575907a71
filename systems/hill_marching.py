"""Least costs over hills: a front that comes later the slower animals go up or down to where it came from.

As `flockbrush.systems.fast_marching`, but what a metre costs depends on the way it leads: up and down differ, along a
hillside it is flat.  Each cell takes the least over points on the ring of its eight neighbours, linear between two of
them that the front has passed (semi-Lagrangian [1]_).  In one pass, cheapest cell first: on steep ground a way may be
some percent dearer than the cheapest, but each leads on to a cheaper cell, so none goes in circles.

.. [1] Sethian & Vladimirsky 2003, Ordered upwind methods for static Hamilton-Jacobi equations, SIAM J. Numer. Anal.
   41(1), section 3: the control-theoretic discretisation.
"""

from __future__ import annotations

import numpy as np
from flockbrush.systems.fast_marching import replace_first_, rimmed_, rise_
from flockbrush.systems.terrain import slope_factor_
from numba import njit

PARTS = 8  # pieces between two neighbours at whose ends ways are tried: ways bend by 6 degrees


@njit(cache=True, nogil=True)
def march_on_hills_(seeds, slowness, height, cell):
    """Least cost from the seeds to every cell, and the way back to them.

    Parameters
    ----------
    seeds : (ny, nx)
        Cost at the seeds, infinite elsewhere.
    slowness : (ny, nx)
        Cost per cell on the level, positive; infinite where blocked.
    height : (ny, nx)
        Metres.
    cell : float
        Size of a cell, m.

    Returns
    -------
    time : (ny, nx)
        Infinite where the front does not come.
    direction : (ny, nx, 2)
        Unit vectors of the cheapest way to the seeds; zero there and where none leads.
    """
    ny, nx = slowness.shape
    wide = nx + 2
    slow, first, up = rimmed_(slowness), rimmed_(seeds), rimmed_(height)
    known, way = np.full(slow.size, np.inf), np.zeros((slow.size, 2))
    # a cell is put on the heap as a seed and once by each neighbour at most
    keys, cells, size = np.empty(9 * slow.size), np.empty(9 * slow.size, np.int64), np.int64(0)
    for c in range(slow.size):
        if first[c] < np.inf and slow[c] < np.inf:
            rise_(keys, cells, size, first[c], c)
            size += 1
    while size > 0:
        t, c = keys[0], cells[0]
        size -= 1
        replace_first_(keys, cells, size, keys[size], cells[size])
        if known[c] < np.inf:
            continue
        known[c] = t
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                to = c + dx + dy * wide
                if slow[to] == np.inf or known[to] < np.inf:
                    continue
                new, wx, wy = cheapest_(known, slow, up, wide, to, -dx, -dy, cell)
                if new < first[to]:
                    first[to], way[to, 0], way[to, 1] = new, wx, wy
                    rise_(keys, cells, size, new, to)
                    size += 1
    ways = way.reshape(ny + 2, wide, 2)[1:-1, 1:-1].copy()
    return known.reshape(ny + 2, wide)[1:-1, 1:-1].copy(), ways


@njit(cache=True, nogil=True, error_model="numpy")  # the steepest cliffs cost infinitely much
def cheapest_(known, slow, up, wide, c, dx, dy, cell):
    """Least cost of a cell (of rimmed grids) by way of its neighbour at (dx, dy), or between that and those beside it.

    Returns the cost and the unit vector of the way, east and north.
    """
    best, bx, by = np.inf, 0.0, 0.0
    for side in (-1, 1):
        if dx * dy == 0:
            ax, ay, ox, oy = dx, dy, dx + side * dy, dy + side * dx
        else:
            ax, ay, ox, oy = (dx, 0, dx, dy) if side < 0 else (0, dy, dx, dy)
        straight, corner, beside = c + ax + ay * wide, c + ox + oy * wide, c + (ox - ax) + (oy - ay) * wide
        # no way leads between two blocked cells that touch
        open_ = slow[straight] < np.inf and slow[beside] < np.inf and known[corner] < np.inf
        if open_ and known[straight] < np.inf:
            low, high = 0, PARTS
        elif open_ and dx * dy != 0:
            low, high = PARTS, PARTS
        elif known[straight] < np.inf and dx * dy == 0:
            low, high = 0, 0
        else:
            continue
        for part in range(low, high + 1):
            b = part / PARTS
            far = np.sqrt(1.0 + b * b)
            there, rise = 0.0, -up[c]
            if part < PARTS:
                there, rise = there + (1.0 - b) * known[straight], rise + (1.0 - b) * up[straight]
            if part > 0:
                there, rise = there + b * known[corner], rise + b * up[corner]
            rise /= far * cell
            new = there + far * slow[c] / slope_factor_(rise)
            if new < best:
                best, bx, by = new, (ax + b * (ox - ax)) / far, (ay + b * (oy - ay)) / far
    return best, bx, by
