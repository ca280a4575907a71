"""Animals in the air: sorted into cubes, and who of them sees whom.

*j* is visible to *i* when it is in range and within the cone of the field of
view, and, unless the brush sees through bodies, the segment from centre to
centre meets no ball (`components.Body.radius`) of a nearer animal and no solid
that blocks the view.  A ball that contains the observer's own centre blocks
nothing, as on the ground (`systems.visibility`).

Across the seam of a wrapped map stand ghosts, as in `systems.grid`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from engine.parallel import over_rows
from engine.solids import blocks_, no_solids
from systems.visibility import Lists, _crowded, nobody

CHUNK = 1024  # observers to a piece of work


class Space(NamedTuple):
    """Animals by cube.  A slot is a place in the sorted order, a row the animal's place in the world's columns."""

    x: np.ndarray  # (m,) m, by slot; ghosts included
    y: np.ndarray  # (m,) m
    z: np.ndarray  # (m,) m
    fx: np.ndarray  # (m,) heading
    fy: np.ndarray  # (m,)
    fz: np.ndarray  # (m,)
    row: np.ndarray  # (m,) int32
    ghost: np.ndarray  # (m,) bool: a copy across the seam, not an observer
    start: np.ndarray  # (cubes + 1,) slots of cube c are start[c]:start[c + 1]; cubes go east, north, then up
    nx: int
    ny: int
    nz: int
    side: float  # m
    west: float  # m
    south: float  # m
    low: float  # m

    @property
    def order(self):
        """Rows by place: neighbours in turn are neighbours in memory."""
        return self.row[~self.ghost]


def sort_in_space(xyz, forward, rows, reach, wrap=None):
    """Sort animals into cubes as wide as the farthest of them sees.

    Parameters
    ----------
    xyz, forward : ndarray (n, 3)
        Positions in metres and unit headings.
    rows : ndarray (k,)
        Who is sorted.
    reach : float
        The farthest any of them sees, metres.
    wrap : (float, float), optional
        Width and height of a periodic map, metres.

    Returns
    -------
    Space
    """
    rows = np.asarray(rows, np.int32)
    place = xyz[rows]
    ghosts = np.zeros(len(rows), np.bool_)
    if wrap is not None:
        place, rows, ghosts = _with_ghosts(place, rows, reach, wrap)
    if not len(rows):
        place = np.zeros((0, 3))
    low, high = _box(place)
    if not np.isfinite(low + high).all():
        wrong = np.flatnonzero(~np.isfinite(place).all(1))
        raise ValueError(f"the position of row {rows[wrong[0]]} is not a number: {place[wrong[0]]}")
    side, most = max(reach, 1e-3), max(1 << 14, 4 * len(rows))
    while np.prod((high - low) // side + 1) > most:  # strays far away would make a map of empty cubes
        side *= 1.25
    nx, ny, nz = (int(k) + 1 for k in (high - low) // side)
    start = np.zeros(nx * ny * nz + 1, np.int32)
    order = np.empty(len(rows), np.int32)
    _sort(place, *low, side, nx, ny, nz, start, order)
    columns = _by_slot(order, place, rows, ghosts, forward)
    return Space(*columns, start, nx, ny, nz, float(side), *map(float, low))


def _with_ghosts(place, rows, reach, wrap):
    places, all_rows, ghosts = [place], [rows], [np.zeros(len(rows), np.bool_)]
    for dx in (-wrap[0], 0.0, wrap[0]):
        for dy in (-wrap[1], 0.0, wrap[1]):
            moved = place + (dx, dy, 0.0)
            near = ((moved[:, :2] > -reach) & (moved[:, :2] < np.array(wrap) + reach)).all(1)
            if dx or dy:
                places.append(moved[near]), all_rows.append(rows[near]), ghosts.append(np.ones(near.sum(), np.bool_))
    return np.concatenate(places), np.concatenate(all_rows), np.concatenate(ghosts)


@njit(cache=True, nogil=True, error_model="numpy")
def _box(place):
    """Lowest and highest corner; not finite when some position is not."""
    low, high, total = np.zeros(3), np.zeros(3), 0.0
    for c in range(3):
        if len(place):
            low[c] = high[c] = place[0, c]
    for i in range(len(place)):
        for c in range(3):
            low[c], high[c] = min(low[c], place[i, c]), max(high[c], place[i, c])
            total += place[i, c]
    if not np.isfinite(total):
        low[0] = np.nan
    return low, high


@njit(cache=True, nogil=True, error_model="numpy")
def _sort(place, west, south, low, side, nx, ny, nz, start, order):
    """Counting sort."""
    where = np.empty(len(place), np.int32)
    for i in range(len(place)):
        cx = min(int((place[i, 0] - west) / side), nx - 1)
        cy = min(int((place[i, 1] - south) / side), ny - 1)
        cz = min(int((place[i, 2] - low) / side), nz - 1)
        where[i] = (cz * ny + cy) * nx + cx
        start[where[i] + 1] += 1
    for c in range(nx * ny * nz):
        start[c + 1] += start[c]
    fill = start[:-1].copy()
    for i in range(len(place)):
        order[fill[where[i]]] = i
        fill[where[i]] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _by_slot(order, place, rows, ghosts, forward):
    """The columns of `Space` from x to ghost."""
    m = len(order)
    x, y, z, fx, fy, fz = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    row, ghost = np.empty(m, np.int32), np.empty(m, np.bool_)
    for s in range(m):
        i = order[s]
        r = rows[i]
        x[s], y[s], z[s] = place[i, 0], place[i, 1], place[i, 2]
        fx[s], fy[s], fz[s] = forward[r, 0], forward[r, 1], forward[r, 2]
        row[s], ghost[s] = r, ghosts[i]
    return x, y, z, fx, fy, fz, row, ghost


def visible_in_space(space, view_range, cos_half_view, through, radius, solids=None, width=32):
    """Compressed lists of whom everybody in a `Space` sees.

    Parameters
    ----------
    space : Space
        With a reach of at least the largest range.
    view_range, cos_half_view : ndarray (n,)
        Metres, and the cosine of half the field of view, by row; -1 sees all round.
    through : ndarray (n,)
        1 for those who see through bodies and solids, by row.
    radius : ndarray (n,)
        Metres, of the ball that hides others, by row.
    solids : Solids, optional
        What blocks the view besides.
    width : int
        First guess of the mean length of the lists.

    Returns
    -------
    Lists
        Empty for rows that are not in the space; offsets are (m, 3).
    """
    n, m = len(view_range), len(space.x)
    if not m:
        return nobody(n, 3)
    solids = no_solids() if solids is None else solids
    begin, count = np.empty(m, np.int64), np.zeros(n, np.int64)
    while True:
        seen = np.empty(m * width, np.int32)
        given = (space, view_range, cos_half_view, through, radius, solids, width, seen, begin, count)
        over_rows(_look, m, *given, chunk=CHUNK)
        if not _crowded(begin, space.ghost):
            break
        width = 2 * max(width, -(-int(count.sum()) // m))
    first = np.zeros(n + 1, np.int64)
    np.cumsum(count, out=first[1:])
    near, offset = np.empty(first[-1], np.int32), np.empty((first[-1], 3))
    over_rows(_by_row, m, space, seen, begin, first, near, offset, chunk=CHUNK)
    return Lists(first, near, offset)


@njit(cache=True, nogil=True, error_model="numpy")
def _look(lo, hi, space, view_range, cos_half_view, through, radius, solids, width, seen, begin, count):
    """The visible of observers lo to hi, into ``seen`` from ``lo * width`` on; ``begin[i] = -1``: no room."""
    x, y, z = space.x, space.y, space.z
    nx, ny, nz, side = space.nx, space.ny, space.nz, space.side
    at, end = lo * width, hi * width
    who = np.empty(64, np.int32)
    ox, oy, oz, d2 = np.empty(64), np.empty(64), np.empty(64), np.empty(64)
    for i in range(lo, hi):
        if space.ghost[i]:
            continue
        row = space.row[i]
        xi, yi, zi = x[i], y[i], z[i]
        reach2, cosine = view_range[row] * view_range[row], cos_half_view[row]
        cx, cy, cz = int((xi - space.west) / side), int((yi - space.south) / side), int((zi - space.low) / side)
        c0, c1 = max(min(cx, nx - 1) - 1, 0), min(cx + 1, nx - 1)
        r0, r1 = max(min(cy, ny - 1) - 1, 0), min(cy + 1, ny - 1)
        found = 0
        for level in range(max(min(cz, nz - 1) - 1, 0), min(cz + 1, nz - 1) + 1):
            for r in range(r0, r1 + 1):
                a, b = space.start[(level * ny + r) * nx + c0], space.start[(level * ny + r) * nx + c1 + 1]
                if found + b - a > len(who):
                    who = _longer(who, found + b - a)
                for j in range(a, b):
                    dx, dy, dz = x[j] - xi, y[j] - yi, z[j] - zi
                    who[found] = j
                    found += (dx * dx + dy * dy + dz * dz <= reach2) & (j != i)
        if len(ox) < found:
            ox, oy, oz, d2 = np.empty(2 * found), np.empty(2 * found), np.empty(2 * found), np.empty(2 * found)
        for k in range(found):
            j = who[k]
            ox[k], oy[k], oz[k] = x[j] - xi, y[j] - yi, z[j] - zi
        for k in range(found):
            d2[k] = ox[k] * ox[k] + oy[k] * oy[k] + oz[k] * oz[k]
        visible = 0
        fx, fy, fz = space.fx[i], space.fy[i], space.fz[i]
        cos2 = cosine * cosine
        for k in range(found):
            ahead = fx * ox[k] + fy * oy[k] + fz * oz[k]
            inside = cosine <= -1.0
            if cosine < 0.0:
                inside |= (ahead >= 0.0) | (ahead * ahead <= cos2 * d2[k])
            else:
                inside |= (ahead >= 0.0) & (ahead * ahead >= cos2 * d2[k])
            if inside and not through[row]:
                inside = not _hidden(k, found, who, ox, oy, oz, d2, space.row, radius) and not blocks_(
                    solids, xi, yi, zi, ox[k], oy[k], oz[k]
                )
            if inside:
                if at + visible < end:
                    seen[at + visible] = who[k]
                visible += 1
        count[row] = visible
        if at + visible > end:
            begin[i] = -1
            continue
        begin[i] = at
        at += visible


@njit(cache=True, nogil=True)
def _longer(who, length):
    longer = np.empty(2 * length, np.int32)
    longer[: len(who)] = who
    return longer


@njit(cache=True, nogil=True, error_model="numpy")
def _hidden(k, found, who, ox, oy, oz, d2, rows, radius):
    """Whether the ball of somebody nearer meets the segment to k."""
    if d2[k] <= 0.0:
        return False
    for q in range(found):
        if d2[q] < d2[k]:
            r2 = radius[rows[who[q]]] * radius[rows[who[q]]]
            along = ox[q] * ox[k] + oy[q] * oy[k] + oz[q] * oz[k]  # times the distance to k
            if along > 0.0 and d2[q] > r2 and d2[q] - along * along / d2[k] < r2:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def _by_row(lo, hi, space, seen, begin, first, near, offset):
    """From lists of slots, by slot, to lists of rows, by row."""
    for i in range(lo, hi):
        if space.ghost[i]:
            continue
        at, to = begin[i], first[space.row[i]]
        for k in range(first[space.row[i] + 1] - to):
            j = seen[at + k]
            near[to + k] = space.row[j]
            offset[to + k, 0] = space.x[j] - space.x[i]
            offset[to + k, 1] = space.y[j] - space.y[i]
            offset[to + k, 2] = space.z[j] - space.z[i]
