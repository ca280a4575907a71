"""Animals sorted into square cells: the lookup that perception and contact share.

Animals are copied cell by cell into contiguous arrays, so that whoever reads
his neighbourhood reads memory in order.  Cells follow the density of the herd.
Across the seam of a wrapped map stand ghosts: copies of the animals of the
other side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit


class Cells(NamedTuple):
    """A herd by cell.  A slot is a place in the sorted order, a row the animal's place in the world's columns."""

    x: np.ndarray  # (m,) m, by slot; ghosts included
    y: np.ndarray  # (m,) m
    fx: np.ndarray  # (m,) heading
    fy: np.ndarray  # (m,)
    half: np.ndarray  # (m,) m, half the length of the capsule's axis
    radius: np.ndarray  # (m,) m
    row: np.ndarray  # (m,) int32
    ghost: np.ndarray  # (m,) bool: a copy across the seam, not an observer
    start: np.ndarray  # (cells + 1,) slots of cell c are start[c]:start[c + 1]; cells go east, then north
    nx: int
    ny: int
    cell: float  # m
    west: float  # m
    south: float  # m
    density: float  # animals per m^2 where the animals are
    slot: np.ndarray  # (n,) int32: the slot of each row


def sort_into_cells(xyz, forward, length, radius, reach, wrap=None):
    """Sort a herd into cells.

    Parameters
    ----------
    xyz, forward : ndarray (n, 3)
        Positions in metres and unit headings; only x and y count.
    length, radius : ndarray (n,)
        Capsules, metres.
    reach : float
        The farthest any animal sees, metres.
    wrap : (float, float), optional
        Width and height of a periodic map, metres.

    Returns
    -------
    Cells
    """
    rows = np.arange(len(xyz), dtype=np.int32)
    x, y = np.ascontiguousarray(xyz[:, 0]), np.ascontiguousarray(xyz[:, 1])
    if wrap is not None:
        x, y, rows = _with_ghosts(x, y, rows, reach, wrap)
    if len(x) == 0:
        west = south = east = north = 0.0
    else:
        west, south, east, north = x.min(), y.min(), x.max(), y.max()
    density = _local_density(x, y, west, south, east, north, reach)
    cell = min(max((1.5 / density) ** 0.5, reach / 12), reach / 2)
    # A stray far away must not cost a map of empty cells.
    most = max(4096, 8 * len(x))
    while ((east - west) // cell + 1) * ((north - south) // cell + 1) > most:
        cell *= 2
    nx, ny = int((east - west) // cell) + 1, int((north - south) // cell) + 1
    order, start = _sort(x, y, west, south, cell, nx, ny)
    row = rows[order]
    slot = np.empty(len(xyz), np.int32)
    ghost = order >= len(xyz)
    slot[row[~ghost]] = np.flatnonzero(~ghost)
    half = np.maximum(0.5 * length - radius, 0.0)
    return Cells(
        x[order],
        y[order],
        forward[row, 0],
        forward[row, 1],
        half[row],
        radius[row],
        row,
        ghost,
        start,
        nx,
        ny,
        float(cell),
        float(west),
        float(south),
        float(density),
        slot,
    )


def _with_ghosts(x, y, rows, reach, wrap):
    width, height = wrap
    xs, ys, rs = [x], [y], [rows]
    for dx in (-width, 0.0, width):
        for dy in (-height, 0.0, height):
            gx, gy = x + dx, y + dy
            near = (gx > -reach) & (gx < width + reach) & (gy > -reach) & (gy < height + reach)
            if dx or dy:
                xs.append(gx[near]), ys.append(gy[near]), rs.append(rows[near])
    return np.concatenate(xs), np.concatenate(ys), np.concatenate(rs)


@njit(cache=True, nogil=True, error_model="numpy")
def _local_density(x, y, west, south, east, north, reach):
    """Animals per m^2, averaged over the animals, on cells of half the reach: what one of them meets."""
    side = max(0.5 * reach, 1e-9)
    while ((east - west) // side + 1) * ((north - south) // side + 1) > max(4096, 8 * len(x)):
        side *= 2
    nx, ny = int((east - west) // side) + 1, int((north - south) // side) + 1
    count = np.zeros(nx * ny, np.int64)
    for i in range(len(x)):
        count[int((y[i] - south) // side) * nx + int((x[i] - west) // side)] += 1
    total = 0.0
    for c in range(nx * ny):
        total += float(count[c]) * count[c]
    return max(total / max(len(x), 1) / (side * side), 1e-6)


@njit(cache=True, nogil=True, error_model="numpy")
def _sort(x, y, west, south, cell, nx, ny):
    """Counting sort: (order, start)."""
    n = len(x)
    where = np.empty(n, np.int32)
    start = np.zeros(nx * ny + 1, np.int32)
    for i in range(n):
        c = min(int((y[i] - south) / cell), ny - 1) * nx + min(int((x[i] - west) / cell), nx - 1)
        where[i] = c
        start[c + 1] += 1
    for c in range(nx * ny):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    order = np.empty(n, np.int64)
    for i in range(n):
        order[fill[where[i]]] = i
        fill[where[i]] += 1
    return order, start
