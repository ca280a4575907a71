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

A_CELL = 5.0  # animals in a cell, about: fewer make more cells to visit, more make more animals to pass over


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
    slot: np.ndarray  # (n,) int32: the slot of each row; -1 for one in no cell


def sort_into_cells(xyz, forward, length, radius, reach, wrap=None, rows=None):
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
    rows : ndarray (k,) int32, optional
        Only these animals: the others are in no cell, and their slot is -1.

    Returns
    -------
    Cells
    """
    whole = rows is None
    rows = np.arange(len(xyz), dtype=np.int32) if whole else rows
    x, y = np.ascontiguousarray(xyz[:, 0], float), np.ascontiguousarray(xyz[:, 1], float)
    if not whole:
        x, y = x[rows], y[rows]
    count = len(x)
    if wrap is not None:
        x, y, rows = _with_ghosts(x, y, rows, reach, wrap)
    west, south, east, north, density = _survey(x, y, reach)
    if not np.isfinite(density):
        wrong = np.flatnonzero(~np.isfinite(xyz[:, 0] + xyz[:, 1]))
        raise ValueError(f"the position of row {wrong[0]} is not a number: {xyz[wrong[0]]}")
    cell = max(min((A_CELL / density) ** 0.5, reach / 2), reach / 12, 1e-3)
    cell, nx, ny = _shape(east - west, north - south, cell, len(x))
    order, start = _sort(x, y, west, south, cell, nx, ny)
    columns = _by_slot(order, count, x, y, rows, forward, length, radius)
    return Cells(*columns, start, nx, ny, cell, west, south, density, _slots(columns[6], columns[7], len(xyz)))


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


def _shape(width, height, cell, count):
    """(cell, nx, ny): as few metres to a cell as asked, unless strays far away would make a map of empty cells."""
    most = max(1 << 16, 8 * count)
    while (width // cell + 1) * (height // cell + 1) > most:
        cell *= 2
    return float(cell), int(width // cell) + 1, int(height // cell) + 1


@njit(cache=True, nogil=True, error_model="numpy")
def _survey(x, y, reach):
    """West, south, east and north end of the herd, and how many animals per m^2 one of them has around him.

    That is the density on cells of half the reach, averaged over the animals, not over the ground.
    """
    n = len(x)
    if n == 0:
        return 0.0, 0.0, 0.0, 0.0, 1e-6
    west = east = x[0]
    south = north = y[0]
    total = 0.0
    for i in range(n):
        west, east = min(west, x[i]), max(east, x[i])
        south, north = min(south, y[i]), max(north, y[i])
        total += x[i] + y[i]
    if not np.isfinite(total):
        return 0.0, 0.0, 0.0, 0.0, np.nan
    side = max(0.5 * reach, 1e-9)
    while (np.floor((east - west) / side) + 1.0) * (np.floor((north - south) / side) + 1.0) > max(1 << 14, 2 * n):
        side *= 2
    nx, ny = int((east - west) / side) + 1, int((north - south) / side) + 1
    inhabitants = np.zeros(nx * ny, np.int32)
    for i in range(n):
        inhabitants[int((y[i] - south) / side) * nx + int((x[i] - west) / side)] += 1
    total = 0.0
    for c in range(nx * ny):
        total += float(inhabitants[c]) * inhabitants[c]
    return west, south, east, north, total / n / (side * side)


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
    order = np.empty(n, np.int32)
    for i in range(n):
        order[fill[where[i]]] = i
        fill[where[i]] += 1
    return order, start


@njit(cache=True, nogil=True, error_model="numpy")
def _by_slot(order, n, x, y, rows, forward, length, radius):
    """The columns of `Cells` from x to ghost; who comes after the first n is a ghost."""
    m = len(order)
    sx, sy, fx, fy = np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    half, thick, row, ghost = np.empty(m), np.empty(m), np.empty(m, np.int32), np.empty(m, np.bool_)
    for s in range(m):
        i = order[s]
        r = rows[i]
        sx[s], sy[s] = x[i], y[i]
        fx[s], fy[s] = forward[r, 0], forward[r, 1]
        half[s], thick[s] = max(0.5 * length[r] - radius[r], 0.0), radius[r]
        row[s], ghost[s] = r, i >= n
    return sx, sy, fx, fy, half, thick, row, ghost


@njit(cache=True, nogil=True, error_model="numpy")
def _slots(row, ghost, n):
    """The slot of each row."""
    slot = np.full(n, -1, np.int32)
    for s in range(len(row)):
        if not ghost[s]:
            slot[row[s]] = s
    return slot
