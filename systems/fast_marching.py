"""Fast marching over a grid: least costs from seeds, and values carried along with the front.

Own code, because its bits must be the same on every CPU, its seeds may carry
sub-cell distances, it must not slip between two obstacles that touch at a
corner, and painted costs may be as rough as a designer likes [1]_.

.. [1] Sethian 1996, A fast marching level set method for monotonically advancing fronts, PNAS 93(4).
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.arrays import write_
from numba import njit

EVERYWHERE = np.empty(0, np.int64)

AROUND = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
QUADRANTS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


@njit(cache=True, nogil=True)
def march_(seeds, slowness, limit, targets):
    """Least cost from the seeds to every cell: |grad T| = slowness, by fast marching.

    First order; a front never squeezes through the point where two blocked cells touch.

    Parameters
    ----------
    seeds : (ny, nx)
        Cost at the seeds, infinite elsewhere.
    slowness : (ny, nx)
        Cost per cell, positive; infinite where blocked.
    limit : float
        Cells that cost more are left out.
    targets : (k,) int64
        Stop as soon as these cells, ``iy * nx + ix``, are reached; empty: go everywhere.

    Returns
    -------
    time : (ny, nx)
        Infinite where the front does not come.
    order : (m,) int64
        The cells reached, as ``iy * nx + ix``, the nearest first.
    """
    ny, nx = slowness.shape
    wide = nx + 2  # a rim of blocked cells spares every look at the edge
    slow = rimmed_(slowness)
    first = rimmed_(seeds)  # the earliest time found so far
    known = np.full(slow.size, np.inf)
    wanted = np.zeros(slow.size, np.bool_)
    for c in targets:
        wanted[(c // nx + 1) * wide + c % nx + 1] = True
    missing = wanted.sum() if len(targets) else -1
    # a cell is put on the heap as a seed and once by each neighbour at most; memory that stays unused costs nothing
    times, cells, size = np.empty(5 * slow.size), np.empty(5 * slow.size, np.int64), np.int64(0)
    for c in range(slow.size):
        if first[c] < np.inf and first[c] <= limit and slow[c] < np.inf:
            rise_(times, cells, size, first[c], c)
            size += 1
        else:
            first[c] = np.inf
    order, count = np.empty(ny * nx, np.int64), 0
    while size > 0 and missing != 0:
        t, c = times[0], cells[0]
        size -= 1
        replace_first_(times, cells, size, times[size], cells[size])
        if known[c] < np.inf:
            continue  # it was reached earlier, by a shorter way
        known[c] = t
        order[count] = c
        count += 1
        if wanted[c]:
            missing -= 1
        for step in (1, wide, -1, -wide):
            to = c + step
            if known[to] == np.inf and slow[to] < np.inf:
                new, _, _ = arrive_(known, slow, wide, to)
                if new < first[to] and new <= limit:
                    first[to] = new
                    rise_(times, cells, size, new, to)
                    size += 1
    iy, ix = order[:count] // wide - 1, order[:count] % wide - 1
    return known.reshape(ny + 2, wide)[1:-1, 1:-1].copy(), iy * nx + ix


@njit(cache=True, nogil=True)
def rimmed_(values):
    """The grid with a rim of infinity, flat."""
    ny, nx = values.shape
    out = np.full((ny + 2) * (nx + 2), np.inf)
    for iy in range(ny):
        for ix in range(nx):
            out[(iy + 1) * (nx + 2) + ix + 1] = values[iy, ix]
    return out


@njit(cache=True, nogil=True)
def arrive_(known, slow, wide, c):
    """When a front of known times arrives at a cell (of rimmed grids), and where from: not normalised, east, north."""
    f = slow[c]
    west, east, south, north = known[c - 1], known[c + 1], known[c - wide], known[c + wide]
    tx, dx = (east, 1) if east <= west else (west, -1)
    ty, dy = (north, 1) if north <= south else (south, -1)
    if tx == np.inf and ty == np.inf:
        return np.inf, 0.0, 0.0
    apart = abs(tx - ty)
    if apart >= f:
        return (tx + f, dx * f, 0.0) if tx < ty else (ty + f, 0.0, dy * f)
    if slow[c + dx + dy * wide] < np.inf:
        t = 0.5 * (tx + ty + np.sqrt(2.0 * f * f - apart * apart))
        return t, dx * (t - tx), dy * (t - ty)
    return arrive_beside_(known, slow, wide, c)


@njit(cache=True, nogil=True)
def arrive_beside_(known, slow, wide, c):
    """`arrive_` where the best two neighbours have the corner of an obstacle between them: the best of four."""
    f = slow[c]
    best, gx, gy = np.inf, 0.0, 0.0
    for dx, dy in QUADRANTS:
        tx, ty = known[c + dx], known[c + dy * wide]
        apart = abs(tx - ty)
        if apart < f and slow[c + dx + dy * wide] < np.inf:
            t = 0.5 * (tx + ty + np.sqrt(2.0 * f * f - apart * apart))
            if t < best:
                best, gx, gy = t, dx * (t - tx), dy * (t - ty)
        elif tx <= ty and tx + f < best:
            best, gx, gy = tx + f, dx * f, 0.0
        elif ty < tx and ty + f < best:
            best, gx, gy = ty + f, 0.0, dy * f
    return best, gx, gy


@njit(cache=True, nogil=True)
def rise_(keys, items, i, key, item):
    """Put an item at position i of a binary heap, or as far above as its key is smaller."""
    while i > 0 and key < keys[(i - 1) >> 1]:
        above = (i - 1) >> 1
        keys[i], items[i] = keys[above], items[above]
        i = above
    keys[i], items[i] = key, item


@njit(cache=True, nogil=True)
def replace_first_(keys, items, size, key, item):
    """Take the first of a binary heap out and put another in, of which there are then that many.

    The gap goes down to a leaf first, and the item up from there: it was the last, so it rarely rises far.
    """
    i = np.int64(0)
    while 2 * i + 2 < size:
        below = 2 * i + 1
        below += keys[below + 1] < keys[below]
        keys[i], items[i] = keys[below], items[below]
        i = below
    if 2 * i + 1 < size:
        keys[i], items[i] = keys[2 * i + 1], items[2 * i + 1]
        i = 2 * i + 1
    rise_(keys, items, i, key, item)


@njit(cache=True, nogil=True)
def spread_(values, seeds, distance, order):
    """Carry values (ny, nx, k) from the seeds outwards: each cell takes the mean of its neighbours that are nearer.

    A neighbour counts by how much nearer it is; a neighbour behind the corner of an obstacle does not count.
    """
    nx = distance.shape[1]
    wide = nx + 2
    far = rimmed_(distance)
    out = np.zeros(values.shape)
    for c in order:
        iy, ix = c // nx, c % nx
        if seeds[iy, ix] < np.inf:
            write_(out[iy, ix], values[iy, ix])
            continue
        here, total = (iy + 1) * wide + ix + 1, 0.0
        for dx, dy in AROUND:
            weight = far[here] - far[here + dx + dy * wide]
            if weight <= 0.0:
                continue
            if dx * dy != 0:
                if far[here + dx] == np.inf or far[here + dy * wide] == np.inf:
                    continue
                weight *= 0.5
            total += weight
            for k in range(values.shape[2]):
                out[iy, ix, k] += weight * out[iy + dy, ix + dx, k]
        for k in range(values.shape[2]):
            out[iy, ix, k] /= total
    return out
