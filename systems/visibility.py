"""Who sees whom: field of view, range and exact line of sight, on a plane.

*j* is visible to *i* when it is in range and in the field of view, and the
segment from centre to centre meets no body of an animal nearer than *j* and no
edge that blocks the view (Gong et al. 2025 [1]_, section 5.3).  A body that
contains the observer's own centre blocks nothing.

How it is found quickly: see `flockbrush.systems.sight`.  In a dense herd the cost follows
the number of visible neighbours, not of those in range.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from flockbrush.engine.lanes import LANES
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.sight import Sizes, ViewBounds, Views, look
from numba import njit

CHUNK = 2048  # observers to a piece of work


class Lists(NamedTuple):
    """Compressed lists: the neighbours of row i are ``near[first[i]:first[i + 1]]``, at ``offset`` from it."""

    first: np.ndarray  # (n + 1,) int64
    near: np.ndarray  # (m,) int32 rows
    offset: np.ndarray  # (m, 2 or 3) m, from the observer to the neighbour, across the seam where that is shorter

    def of(self, row):
        """Rows of the neighbours of one row."""
        return self.near[self.first[row] : self.first[row + 1]]


class VisibleBySlot(NamedTuple):
    """Who is seen, as it was found: by slot, so that neighbours in turn are neighbours in memory."""

    cells: Any  # the herd as it was: `Cells`, or a `Space`
    seen: np.ndarray  # int32 slots; those that row i sees are ``seen[begin[slot[i]]:][:count[i]]``
    begin: np.ndarray  # (slots,) int64
    count: np.ndarray  # type: ignore[assignment]  # (n,) int64, by row; 0 for animals in no cell


class Edges(NamedTuple):
    """Line segments that block the view, by coarse cell."""

    ends: np.ndarray  # (k, 4) x0, y0, x1, y1 in m
    start: np.ndarray  # (cells + 1,) int32
    item: np.ndarray  # edges whose box is within reach of the cell
    nx: int
    ny: int
    cell: float
    west: float
    south: float


def no_edges():
    """A landscape that hides nothing."""
    return Edges(np.zeros((0, 4)), np.zeros(2, np.int32), np.zeros(0, np.int32), 1, 1, 1.0, 0.0, 0.0)


def edges_by_cell(ends, reach):
    """Sort edges by coarse cell, so that an animal meets only those within its reach.

    Parameters
    ----------
    ends : array_like (k, 4)
        ``x0, y0, x1, y1`` of each edge, metres.
    reach : float
        Metres.
    """
    ends = np.asarray(ends, float).reshape(-1, 4)
    if not len(ends):
        return no_edges()
    low, high = np.minimum(ends[:, :2], ends[:, 2:]) - reach, np.maximum(ends[:, :2], ends[:, 2:]) + reach
    west, south = low.min(0)
    extent = high.max(0) - (west, south)
    cell = float(max(reach / 2, *(extent / 256)))
    nx, ny = (int(e // cell) + 1 for e in extent)
    first, last = (((corner - (west, south)) // cell).astype(int) for corner in (low, high))
    wide, deep = (last - first + 1).T
    edge = np.repeat(np.arange(len(ends)), wide * deep)  # each as often as it has cells, row by row
    place = np.arange(len(edge)) - np.repeat(np.cumsum(wide * deep) - wide * deep, wide * deep)
    at = (first[edge, 1] + place // wide[edge]) * nx + first[edge, 0] + place % wide[edge]
    start = np.zeros(nx * ny + 1, np.int32)
    np.cumsum(np.bincount(at, minlength=nx * ny), out=start[1:])
    item = edge[np.argsort(at, kind="stable")].astype(np.int32)
    return Edges(ends, start, item, nx, ny, cell, float(west), float(south))


def visible_neighbours(cells, view_range, cos_half_view, edges=None, occlusion=True, width=64):
    """Compressed lists of the visible neighbours of every animal.

    Parameters
    ----------
    cells : Cells
        From `sort_into_cells`, with a reach of at least the largest range.
    view_range : ndarray (n,)
        Metres, by row.
    cos_half_view : ndarray (n,)
        Cosine of half the field of view; -1 sees all round.
    edges : Edges, optional
        What blocks the view besides bodies.
    occlusion : bool
        False: everybody in range and in the field of view is seen.
    width : int
        First guess of the mean length of the lists.

    Returns
    -------
    Lists
    """
    return lists_of(look_around(cells, view_range, cos_half_view, edges, occlusion, width))


def look_around(cells, view_range, cos_half_view, edges=None, occlusion=True, width=64) -> VisibleBySlot:
    """What `visible_neighbours` makes its lists of, with the same parameters."""
    n, m = len(view_range), len(cells.x)
    edges = no_edges() if edges is None else edges
    eyes, sizes = ViewBounds(_plain(view_range), _plain(cos_half_view)), Sizes(*_widths(cells.half, cells.radius))
    begin, count = np.empty(m, np.int64), np.zeros(n, np.int64)
    while True:
        views = Views(width, np.empty(m * width + LANES, np.int32), begin, count)
        over_rows(look, m, cells, eyes, edges, occlusion, sizes, views, chunk=CHUNK)
        if not lists_overflow(begin, cells.ghost):
            return VisibleBySlot(cells, views.seen, begin, count)
        width = 2 * max(width, -(-int(count.sum()) // max(m, 1)))


def lists_of(found: VisibleBySlot) -> Lists:
    """The same by row."""
    cells, seen, begin, count = found
    first = np.zeros(len(count) + 1, np.int64)
    np.cumsum(count, out=first[1:])
    near, offset = np.empty(first[-1], np.int32), np.empty((first[-1], len(cells.axes)))
    over_rows(by_row, len(cells.x), cells.axes, cells.row, cells.ghost, seen, begin, first, near, offset, chunk=CHUNK)
    return Lists(first, near, offset)


def _plain(numbers):
    """The kind of array the kernel is compiled for."""
    return np.require(numbers, np.float64, ("C", "W"))


@njit(cache=True, nogil=True, error_model="numpy")
def _widths(half, radius):
    """Mean apparent width of a body, from all sides; and how far the longest reaches from its centre, 0 for discs."""
    total, longest, widest = 0.0, 0.0, 0.0
    for i in range(len(half)):
        total += 2.0 * radius[i] + 4.0 / np.pi * half[i]
        longest, widest = max(longest, half[i]), max(widest, half[i] + radius[i])
    return total / max(len(half), 1), widest if longest > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def lists_overflow(begin, ghost):
    """Whether somebody's list found no room."""
    crowded = False
    for i in range(len(begin)):
        crowded |= begin[i] < 0 and not ghost[i]
    return crowded


@njit(cache=True, nogil=True, error_model="numpy")
def by_row(lo, hi, axes, row, ghost, seen, begin, first, near, offset):
    """From lists of slots, by slot, to lists of rows, by row; ``axes``: places of the slots, two or three (m,)."""
    for i in range(lo, hi):
        if ghost[i]:
            continue
        at, to = begin[i], first[row[i]]
        for k in range(first[row[i] + 1] - to):
            j = seen[at + k]
            near[to + k] = row[j]
            for a in range(len(axes)):
                offset[to + k, a] = axes[a][j] - axes[a][i]
