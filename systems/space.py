"""Animals in the air: sorted into cubes, and who of them sees whom.

*j* is visible to *i* when it is in range and within the cone of the field of
view, and, unless the brush sees through bodies, the segment from centre to
centre meets no ball (`components.Body.radius`) of a nearer animal and no solid
that blocks the view.  A ball that contains the observer's own centre blocks
nothing, as on the ground (`flockbrush.systems.visibility`).

Across the seam of a wrapped map stand ghosts, as in `flockbrush.systems.grid`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.arrays import order_
from flockbrush.engine.lanes import LANES, load, pack, pointer
from flockbrush.engine.lanes import count as count_lanes
from flockbrush.engine.maths import inner_kernel
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.scratch import Scratch
from flockbrush.engine.solid_queries import blocks_
from flockbrush.engine.solids import no_solids
from flockbrush.systems.sightline import kernel, step
from flockbrush.systems.visibility import Lists, _crowded, by_row, nobody
from numba import njit

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


class EyesInSpace(NamedTuple):
    """How animals see in space, (n,) each, by row."""

    range: np.ndarray  # m
    cosine: np.ndarray  # of half the field of view; -1 sees all round
    through: np.ndarray  # 1 for those who see through bodies and solids
    radius: np.ndarray  # m, of the ball that hides others


class Around(NamedTuple):
    """Who lives in a cube and those around it, side by side."""

    x: np.ndarray  # (room,) m
    y: np.ndarray
    z: np.ndarray
    slot: np.ndarray  # (room,) int32


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
    place, rows, ghosts = _placed(xyz, rows, reach, *(wrap or (0.0, 0.0)))
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


@njit(cache=True, nogil=True, error_model="numpy")
def _placed(xyz, rows, reach, width, depth):
    """Where the rows are, and after them their copies within reach of a wrapped map: (positions, rows, ghosts)."""
    n, total = len(rows), len(rows)
    if width > 0.0:
        for k in range(n):
            x, y = xyz[rows[k], 0], xyz[rows[k], 1]
            total += _images(x, width, reach) * _images(y, depth, reach) - 1
    place, row, ghost = np.empty((total, 3)), np.empty(total, np.int32), np.zeros(total, np.bool_)
    at = n
    for k in range(n):
        x, y, z = xyz[rows[k], 0], xyz[rows[k], 1], xyz[rows[k], 2]
        place[k, 0], place[k, 1], place[k, 2], row[k] = x, y, z, rows[k]
        if width > 0.0 and _images(x, width, reach) * _images(y, depth, reach) > 1:
            for i in range(-1, 2):
                for j in range(-1, 2):
                    gx, gy = x + i * width, y + j * depth
                    if (i or j) and -reach < gx < width + reach and -reach < gy < depth + reach:
                        place[at, 0], place[at, 1], place[at, 2] = gx, gy, z
                        row[at], ghost[at] = rows[k], True
                        at += 1
    return place, row, ghost


@njit(inline="always")
def _images(x, width, reach):
    """How many of x, one width less and one more lie within reach of the map; x itself always counts."""
    return 1 + (-reach < x - width) + (x + width < width + reach)


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


def visible_in_space(space, eyes, solids=None, width=32, scratch=None):
    """Compressed lists of whom everybody in a `Space` sees.

    Parameters
    ----------
    space : Space
        With a reach of at least the largest range.
    eyes : EyesInSpace
    solids : Solids, optional
        What blocks the view besides.
    width : int
        First guess of the mean length of the lists; too small a one costs time, and changes nothing.
    scratch : Scratch, optional
        Memory for the lists, which then are good until the next call with it.

    Returns
    -------
    Lists
        Empty for rows that are not in the space; offsets are (m, 3).
    """
    n, m = len(eyes.range), len(space.x)
    if not m:
        return nobody(n, 3)
    solids = no_solids() if solids is None else solids
    scratch = Scratch() if scratch is None else scratch
    begin, count = np.empty(m, np.int64), np.zeros(n, np.int64)
    while True:
        seen = scratch.take("seen", (m * width + LANES,), np.int32)
        given = (space, eyes, solids, width, seen, begin, count)
        over_rows(_look, m, *given, chunk=CHUNK)
        if not _crowded(begin, space.ghost):
            break
        width = 2 * max(width, -(-int(count.sum()) // m))
    first = np.zeros(n + 1, np.int64)
    np.cumsum(count, out=first[1:])
    near, offset = scratch.take("near", (first[-1],), np.int32), scratch.take("offset", (first[-1], 3))
    axes = space.x, space.y, space.z
    over_rows(by_row, m, axes, space.row, space.ghost, seen, begin, first, near, offset, chunk=CHUNK)
    return Lists(first, near, offset)


@kernel
def _look(lo, hi, space, eyes, solids, width, seen, begin, count):
    """The visible of observers lo to hi, into ``seen`` from ``lo * width`` on; ``begin[i] = -1``: no room."""
    through, room = eyes.through, np.int64(1024)  # as its type is later
    around = _room_for(room)
    at, end = lo * width, hi * width
    cube, n = -1, 0
    for i in range(lo, hi):
        if space.ghost[i]:
            continue
        row = space.row[i]
        cx, cy, cz = _cube(space, space.x[i], space.y[i], space.z[i])
        if (cz * space.ny + cy) * space.nx + cx != cube:  # observers of one cube follow one another
            cube = (cz * space.ny + cy) * space.nx + cx
            n = _population(space, cx, cy, cz)
            if n + LANES > room:
                room = 2 * (n + LANES)
                around = _room_for(room)
            _gather(space, cx, cy, cz, around)
        if through[row] and at + n + LANES <= end:
            visible = _in_view(n, around, seen, at, i, space, eyes)
        else:
            visible = _in_view_by_one(n, around, seen, at, end, i, space, eyes, solids)
        count[row] = visible
        if at + visible > end:
            begin[i] = -1
            continue
        begin[i] = at
        at += visible


@step
def _cube(space, x, y, z):
    """The cube of a place."""
    return (
        min(int((x - space.west) / space.side), space.nx - 1),
        min(int((y - space.south) / space.side), space.ny - 1),
        min(int((z - space.low) / space.side), space.nz - 1),
    )


@inner_kernel
def _population(space, cx, cy, cz):
    """How many live in a cube and those around it."""
    n = 0
    c0, c1 = max(cx - 1, 0), min(cx + 1, space.nx - 1)
    for level in range(max(cz - 1, 0), min(cz + 1, space.nz - 1) + 1):
        for r in range(max(cy - 1, 0), min(cy + 1, space.ny - 1) + 1):
            first = (level * space.ny + r) * space.nx
            n += space.start[first + c1 + 1] - space.start[first + c0]
    return n


@inner_kernel
def _room_for(animals):
    """`Around` for so many."""
    return Around(np.empty(animals), np.empty(animals), np.empty(animals), np.empty(animals, np.int32))


@inner_kernel
def _gather(space, cx, cy, cz, around):
    """All who live in a cube and those around it, side by side, and nobody after them."""
    x, y, z, slot = around
    n = 0
    c0, c1 = max(cx - 1, 0), min(cx + 1, space.nx - 1)
    for level in range(max(cz - 1, 0), min(cz + 1, space.nz - 1) + 1):
        for r in range(max(cy - 1, 0), min(cy + 1, space.ny - 1) + 1):
            first = (level * space.ny + r) * space.nx
            for j in range(space.start[first + c0], space.start[first + c1 + 1]):
                x[n], y[n], z[n], slot[n] = space.x[j], space.y[j], space.z[j], j
                n += 1
    for k in range(n, n + LANES):
        x[k], y[k], z[k], slot[k] = np.inf, 0.0, 0.0, -1


@inner_kernel
def _in_view(n, around, seen, at, i, space, eyes):
    """Slots of those in range and in the cone, sixteen at a time; returns how many."""
    px, py, pz, ps, out = (
        pointer(around.x), pointer(around.y), pointer(around.z), pointer(around.slot), pointer(seen),
    )  # fmt: skip
    xi, yi, zi, fx, fy, fz = space.x[i], space.y[i], space.z[i], space.fx[i], space.fy[i], space.fz[i]
    reach, cosine = eyes.range[space.row[i]], eyes.cosine[space.row[i]]
    reach2 = reach * reach
    cos2 = cosine * cosine
    found = at
    for k in range(0, n, LANES):
        dx, dy, dz, who = load(px, k) - xi, load(py, k) - yi, load(pz, k) - zi, load(ps, k)
        d2 = dx * dx + dy * dy + dz * dz
        ok = (d2 <= reach2) & ((who < np.int32(i)) | (who > np.int32(i)))
        if cosine > -1.0:
            ahead = dx * fx + dy * fy + dz * fz
            if cosine < 0.0:
                ok = ok & ((ahead >= 0.0) | (ahead * ahead <= d2 * cos2))
            else:
                ok = ok & (ahead >= 0.0) & (ahead * ahead >= d2 * cos2)
        pack(out, found, who, ok)
        found += count_lanes(ok)
    return found - at


@inner_kernel
def _in_view_by_one(n, around, seen, at, end, i, space, eyes, solids):
    """As `_in_view`, one at a time: with occlusion, and where room may be short."""
    x, y, z, slot = around
    row, radius = space.row[i], eyes.radius
    reach, cosine, occlusion = eyes.range[row], eyes.cosine[row], not eyes.through[row]
    xi, yi, zi, fx, fy, fz = space.x[i], space.y[i], space.z[i], space.fx[i], space.fy[i], space.fz[i]
    ox, oy, oz, d2, who = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.int32)
    found = 0
    for k in range(n):
        ox[found], oy[found], oz[found], who[found] = x[k] - xi, y[k] - yi, z[k] - zi, slot[k]
        d2[found] = ox[found] * ox[found] + oy[found] * oy[found] + oz[found] * oz[found]
        found += (d2[found] <= reach * reach) & (slot[k] != i)
    nearest = order_(d2, found if occlusion else np.int64(0))  # who is near hides most
    visible, cos2 = 0, cosine * cosine
    for k in range(found):
        ahead = ox[k] * fx + oy[k] * fy + oz[k] * fz
        inside = cosine <= -1.0
        if cosine < 0.0:
            inside |= (ahead >= 0.0) | (ahead * ahead <= d2[k] * cos2)
        else:
            inside |= (ahead >= 0.0) & (ahead * ahead >= d2[k] * cos2)
        if inside and occlusion:
            inside = not _hidden(k, nearest, who, ox, oy, oz, d2, space.row, radius) and not blocks_(
                solids, xi, yi, zi, ox[k], oy[k], oz[k]
            )
        if inside:
            if at + visible < end:
                seen[at + visible] = who[k]
            visible += 1
    return visible


@inner_kernel
def _hidden(k, nearest, who, ox, oy, oz, d2, rows, radius):
    """Whether the ball of somebody nearer meets the segment to k."""
    if d2[k] <= 0.0:
        return False
    for q in nearest:
        if d2[q] >= d2[k]:
            return False
        r2 = radius[rows[who[q]]] * radius[rows[who[q]]]
        along = ox[q] * ox[k] + oy[q] * oy[k] + oz[q] * oz[k]  # times the distance to k
        if along > 0.0 and d2[q] > r2 and d2[q] - along * along / d2[k] < r2:
            return True
    return False
