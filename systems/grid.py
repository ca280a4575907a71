"""Animals sorted into square cells: the lookup that perception and contact share.

Animals are copied cell by cell into contiguous arrays, so that whoever reads
his neighbourhood reads memory in order.  Cells follow the density of the herd.
Where strays far away would make a map of empty cells, the rows and columns
between them and the herd that hold nobody are left out.
Across the seam of a wrapped map stand ghosts: copies of the animals of the
other side.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

A_CELL = 5.0  # animals in a cell, about: fewer make more cells to visit, more make more animals to pass over
EMPTY = 8.0  # so many empty columns may be left out, if they are wider than any range of sight,
BETWEEN = 2  # except for these: no animal is farther away by cells than in truth


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
    west: np.ndarray  # (m,) m: where column 0 begins, counted from where the animal stands
    south: np.ndarray  # (m,) m: likewise row 0
    density: float  # animals per m^2 where the animals are
    slot: np.ndarray  # (n,) int32: the slot of each row; -1 for one in no cell

    @property
    def axes(self):
        """Where they are, by slot."""
        return self.x, self.y


def farthest_sight(wrap):
    """How far anybody can see on such a map, m: where it goes on at the opposite border, half its shorter side.

    So nobody is seen twice, or sees itself over the border.
    """
    return np.inf if wrap is None else (0.5 - 1e-6) * min(wrap)


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
        x, y, rows = with_ghosts(x, y, rows, reach, wrap)
    box = _extent(x, y)
    if not np.isfinite(box[0]):
        wrong = np.flatnonzero(~np.isfinite(xyz[:, 0] + xyz[:, 1]))
        raise ValueError(f"the position of row {wrong[0]} is not a number: {xyz[wrong[0]]}")
    begin = np.full(len(x), box[0]), np.full(len(x), box[1])
    density = _density(x, y, *_shape(x, y, box, begin, reach, max(reach / 2, 1e-9), max(1 << 14, 2 * len(x))))
    cell = max(min((A_CELL / density) ** 0.5, reach / 2), reach / 12, 1e-3)
    cell, nx, ny, west, south = _shape(x, y, box, begin, reach, cell, max(1 << 16, 8 * len(x)))
    order, start = _sort(x, y, cell, nx, ny, west, south)
    columns = _by_slot(order, count, x, y, rows, forward, length, radius)
    slots = _slots(columns[6], columns[7], len(xyz))
    if west is not begin[0]:
        west, south = west[order], south[order]
    return Cells(*columns, start, nx, ny, cell, west, south, density, slots)


def with_ghosts(x, y, rows, reach, wrap):
    """Places (n,) m and their rows, followed by the copies of those within ``reach`` m of a wrapped map."""
    width, height = wrap
    xs, ys, rs = [x], [y], [rows]
    for dx in (-width, 0.0, width):
        for dy in (-height, 0.0, height):
            gx, gy = x + dx, y + dy
            near = (gx > -reach) & (gx < width + reach) & (gy > -reach) & (gy < height + reach)
            if dx or dy:
                xs.append(gx[near]), ys.append(gy[near]), rs.append(rows[near])
    return np.concatenate(xs), np.concatenate(ys), np.concatenate(rs)


def _shape(x, y, box, begin, reach, cell, most):
    """(cell, nx, ny, west, south): no more cells than ``most``, of as few metres as asked if that can be.

    Where there would be more, empty rows and columns are left out, and then cells become larger.  ``west`` and
    ``south`` (m,), where column and row 0 begin for each animal, are ``begin`` if nothing is left out.
    """
    west, south, east, north = box
    across, up = (east - west) / cell, (north - south) / cell
    if (np.floor(across) + 1) * (np.floor(up) + 1) <= most:
        return float(cell), int(across) + 1, int(up) + 1, *begin
    in_order = np.sort(x), np.sort(y)
    while True:
        (nx, *columns), (ny, *rows) = (_inhabited(places, max(EMPTY * cell, reach), cell) for places in in_order)
        if nx * ny <= most:
            return float(cell), int(nx), int(ny), _begins(x, *columns), _begins(y, *rows)
        cell *= 2


def _inhabited(places, gap, cell):
    """How many columns there are without wide gaps; where each band of them begins, and where column 0 is for it."""
    apart = np.flatnonzero(np.diff(places) > gap) + 1
    first, last = np.concatenate([places[:1], places[apart]]), np.concatenate([places[apart - 1], places[-1:]])
    size = np.floor((last - first) / cell) + (1 + BETWEEN)
    return size.sum() - BETWEEN, first, first - (np.cumsum(size) - size) * cell


def _begins(places, first, begin):
    """Where column 0 is for each place."""
    return begin[np.searchsorted(first, places, side="right") - 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _extent(x, y):
    """West, south, east and north end of the herd; the first is not a number when some place is none."""
    if len(x) == 0:
        return 0.0, 0.0, 0.0, 0.0
    west = east = x[0]
    south = north = y[0]
    total = 0.0
    for i in range(len(x)):
        west, east = min(west, x[i]), max(east, x[i])
        south, north = min(south, y[i]), max(north, y[i])
        total += x[i] + y[i]
    if not np.isfinite(total):
        west = np.nan
    return west, south, east, north


@njit(cache=True, nogil=True, error_model="numpy")
def _density(x, y, side, nx, ny, west, south):
    """How many animals per m^2 one of them has around him: averaged over the animals, not over the ground."""
    n = len(x)
    if n == 0:
        return 1e-6
    inhabitants = np.zeros(nx * ny, np.int32)
    for i in range(n):
        inhabitants[_cell(x[i], y[i], side, nx, ny, west[i], south[i])] += 1
    total = 0.0
    for c in range(nx * ny):
        total += float(inhabitants[c]) * inhabitants[c]
    return total / n / (side * side)


@njit(inline="always")
def _cell(x, y, cell, nx, ny, west, south):
    return min(int((y - south) / cell), ny - 1) * nx + min(int((x - west) / cell), nx - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def _sort(x, y, cell, nx, ny, west, south):
    """Counting sort: (order, start)."""
    n = len(x)
    where = np.empty(n, np.int32)
    start = np.zeros(nx * ny + 1, np.int32)
    for i in range(n):
        where[i] = _cell(x[i], y[i], cell, nx, ny, west[i], south[i])
        start[where[i] + 1] += 1
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
