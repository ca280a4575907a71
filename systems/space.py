"""Animals in the air: sorting into cubes, and visibility between them.

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
from flockbrush.engine.lanes import EIGHT, LANES, lane_numbers, load, load_where, pack, pointer, splat, store
from flockbrush.engine.lanes import count as count_lanes
from flockbrush.engine.maths import inner_kernel
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.scratch import Scratch
from flockbrush.engine.solid_queries import blocks_
from flockbrush.engine.solids import no_solids
from flockbrush.systems.sightline import kernel, step
from flockbrush.systems.visibility import VisibleBySlot, lists_overflow
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
    slot: np.ndarray  # (n,) int32: the slot of each row; -1 for one on the ground

    @property
    def order(self):
        """Rows in order of cubes: neighbours in space are neighbours in memory."""
        return self.row[~self.ghost]

    @property
    def axes(self):
        """Coordinates by slot."""
        return self.x, self.y, self.z


class EyesInSpace(NamedTuple):
    """Parameters of vision in space, (n,) each, by row."""

    range: np.ndarray  # m
    cosine: np.ndarray  # of half the field of view; -1 sees all round
    through: np.ndarray  # 1 for animals that see through bodies and solids
    radius: np.ndarray  # m, of the ball that hides others


def sort_in_space(xyz, forward, rows, reach, wrap=None):
    """Sort animals into cubes as wide as the largest range of vision.

    Parameters
    ----------
    xyz, forward : ndarray (n, 3)
        Positions in metres and unit headings.
    rows : ndarray (k,)
        The animals that are sorted.
    reach : float
        The largest range of vision, metres.
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
    while np.prod((high - low) // side + 1) > most:  # animals far away would need a map of empty cubes
        side *= 1.25
    nx, ny, nz = (int(k) + 1 for k in (high - low) // side)
    start = np.zeros(nx * ny * nz + 1, np.int32)
    order = np.empty(len(rows), np.int32)
    _sort(place, *low, side, nx, ny, nz, start, order)
    *columns, slot = _by_slot(order, place, rows, ghosts, forward)
    return Space(*columns, start, nx, ny, nz, float(side), *map(float, low), slot)


@njit(cache=True, nogil=True, error_model="numpy")
def _placed(xyz, rows, reach, width, depth):
    """Positions of the rows, followed by their copies within reach of a wrapped map: (positions, rows, ghosts)."""
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
    """How many of x, x - width and x + width lie within reach of the map; x itself always counts."""
    return 1 + (-reach < x - width) + (x + width < width + reach)


@njit(cache=True, nogil=True, error_model="numpy")
def _box(place):
    """Lowest and highest corner; not finite if some position is not."""
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
    """The columns of `Space` from x to ghost, and the slots of all rows."""
    m, slot = len(order), np.full(len(forward), -1, np.int32)
    x, y, z, fx, fy, fz = np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m), np.empty(m)
    row, ghost = np.empty(m, np.int32), np.empty(m, np.bool_)
    for s in range(m):
        i = order[s]
        r = rows[i]
        x[s], y[s], z[s] = place[i, 0], place[i, 1], place[i, 2]
        fx[s], fy[s], fz[s] = forward[r, 0], forward[r, 1], forward[r, 2]
        row[s], ghost[s] = r, ghosts[i]
        if not ghosts[i]:
            slot[r] = s
    return x, y, z, fx, fy, fz, row, ghost, slot


def birds_of(space, velocity, species):
    """State of the animals in a `Space` by slot: the table of `behaviours.behaviour.FlockBySlot`."""
    room = np.empty(8 * len(space.x) + 8)
    at = -room.ctypes.data % 64 // 8
    bird = room[at : at + 8 * len(space.x)].reshape(-1, 8)
    over_rows(_write_birds, len(bird), *space.axes, space.row, velocity, species, bird)
    return bird


@kernel
def _write_birds(lo, hi, x, y, z, row, velocity, species, bird):
    for s in range(lo, hi):
        r = row[s]
        bird[s, 0], bird[s, 1], bird[s, 2] = x[s], y[s], z[s]
        bird[s, 3], bird[s, 4], bird[s, 5] = velocity[r, 0], velocity[r, 1], velocity[r, 2]
        bird[s, 6], bird[s, 7] = species[r], 0.0


def visible_in_space(space, eyes, solids=None, width=32, scratch=None):
    """Lists of the visible neighbours of every animal in a `Space`.

    Parameters
    ----------
    space : Space
        With a reach of at least the largest range.
    eyes : EyesInSpace
    solids : Solids, optional
        Solids that also block the view.
    width : int
        First guess of the mean length of the lists; a guess that is too small costs time, and changes nothing.
    scratch : Scratch, optional
        Memory for the lists, which are then valid until the next call with it.

    Returns
    -------
    Found
        Empty lists for rows that are not in the space.
    """
    n, m = len(eyes.range), len(space.x)
    solids = no_solids() if solids is None else solids
    scratch = Scratch() if scratch is None else scratch
    begin, count = np.zeros(m, np.int64), np.zeros(n, np.int64)
    while True:
        seen = scratch.take("seen", (m * width + LANES,), np.int32)
        over_rows(_look, m, space, eyes, solids, width, seen, begin, count, chunk=CHUNK)
        if not lists_overflow(begin, space.ghost):
            return VisibleBySlot(space, seen, begin, count)
        width = 2 * max(width, -(-int(count.sum()) // m))


@kernel
def _look(lo, hi, space, eyes, solids, width, seen, begin, count):
    """Write the visible of observers lo to hi into ``seen`` from ``lo * width`` on; ``begin[i] = -1``: no room."""
    mine, runs = np.empty(len(space.x) + 2 * LANES, np.int32), np.empty(18, np.int64)
    _look_about(lo, hi, space, eyes, solids, width, seen, begin, count, (mine, runs))


@inner_kernel
def _look_about(lo, hi, space, eyes, solids, width, seen, begin, count, room):
    mine, runs = room
    axes = pointer(space.x), pointer(space.y), pointer(space.z)
    heading = pointer(space.fx), pointer(space.fy), pointer(space.fz)
    row, start, own, out = pointer(space.row), pointer(space.start), pointer(mine), pointer(seen)
    reach, cosine, through = pointer(eyes.range), pointer(eyes.cosine), pointer(eyes.through)
    at, end, around, among = lo * width, hi * width, pointer(runs), np.int64(0)
    cube, last = _cube_of(lo, start, len(space.start)), np.int64(-1)
    for i in range(lo, hi):
        while start[cube + 1] <= i:
            cube += 1
        if space.ghost[i]:
            continue
        if cube != last:  # observers of one cube follow one another
            last, among = cube, _runs_around(cube, space.nx, space.ny, space.nz, start, around)
        r = row[i]
        if through[r]:
            found = _in_view(i, among, around, axes, heading, reach[r] * reach[r], cosine[r], own)
        else:
            found = _in_view(i, among, around, axes, heading, reach[r] * reach[r], -1.0, own)
            found = _without_hidden(i, found, space, eyes, solids, mine)
        count[r] = found
        if at + found + LANES > end:
            begin[i] = -1
            continue
        begin[i] = at
        store(own, found, splat(np.int32(i)))
        for k in range(0, found, LANES):
            store(out, at + k, load(own, k))
        at += (found + EIGHT - 1) & -EIGHT


@step
def _cube_of(slot, start, n):
    """The cube of a slot: the last one that begins at or before it."""
    a, b = np.int64(0), np.int64(n)
    while b - a > 1:
        middle = (a + b) // 2
        if start[middle] <= slot:
            a = middle
        else:
            b = middle
    return a


@step
def _runs_around(cube, nx, ny, nz, start, runs):
    """The slots of a cube and those around it, row k from ``runs[2 * k]`` to ``runs[2 * k + 1]``; how many rows."""
    cx, cy, cz = cube % nx, cube // nx % ny, cube // (nx * ny)
    c0, c1, n = max(cx - 1, 0), min(cx + 1, nx - 1), 0
    for level in range(max(cz - 1, 0), min(cz + 1, nz - 1) + 1):
        for r in range(max(cy - 1, 0), min(cy + 1, ny - 1) + 1):
            first = (level * ny + r) * nx
            runs[2 * n], runs[2 * n + 1] = start[first + c0], start[first + c1 + 1]
            n += runs[2 * n] < runs[2 * n + 1]
    return n


@step
def _in_view(i, among, runs, axes, heading, reach2, cosine, seen):
    """Slots in range and in the cone of view, sixteen at a time; returns their number."""
    x, y, z = axes
    fx, fy, fz = heading
    cos2, found = cosine * cosine, 0
    for run in range(among):
        a, b = runs[2 * run], runs[2 * run + 1]
        for k in range(a, b, LANES):
            there, who = lane_numbers() < np.int32(b - k), lane_numbers() + np.int32(k)
            dx, dy, dz = load_where(x, k, there) - x[i], load_where(y, k, there) - y[i], load_where(z, k, there) - z[i]
            d2 = dx * dx + dy * dy + dz * dz
            ok = there & (d2 <= reach2) & (who != np.int32(i))
            if cosine > -1.0:
                ahead = dx * fx[i] + dy * fy[i] + dz * fz[i]
                if cosine < 0.0:
                    ok = ok & ((ahead >= 0.0) | (ahead * ahead <= d2 * cos2))
                else:
                    ok = ok & (ahead >= 0.0) & (ahead * ahead >= d2 * cos2)
            pack(seen, found, who, ok)
            found += count_lanes(ok)
    return found


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _without_hidden(i, n, space, eyes, solids, who):
    """Remove slots outside the cone, or hidden by others in range or by solids; returns the number left."""
    xi, yi, zi, fx, fy, fz = space.x[i], space.y[i], space.z[i], space.fx[i], space.fy[i], space.fz[i]
    ox, oy, oz, d2, others = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.int32)
    for k in range(n):
        others[k] = j = who[k]
        ox[k], oy[k], oz[k] = space.x[j] - xi, space.y[j] - yi, space.z[j] - zi
        d2[k] = ox[k] * ox[k] + oy[k] * oy[k] + oz[k] * oz[k]
    nearest = order_(d2, n)  # near animals hide most
    cosine = eyes.cosine[space.row[i]]
    visible, cos2 = 0, cosine * cosine
    for k in range(n):
        ahead = ox[k] * fx + oy[k] * fy + oz[k] * fz
        inside = cosine <= -1.0
        if cosine < 0.0:
            inside |= (ahead >= 0.0) | (ahead * ahead <= d2[k] * cos2)
        else:
            inside |= (ahead >= 0.0) & (ahead * ahead >= d2[k] * cos2)
        if (
            inside
            and not _hidden(k, nearest, others, ox, oy, oz, d2, space.row, eyes.radius)
            and not blocks_(solids, xi, yi, zi, ox[k], oy[k], oz[k])
        ):
            who[visible] = others[k]
            visible += 1
    return visible


@inner_kernel
def _hidden(k, nearest, who, ox, oy, oz, d2, rows, radius):
    """Whether the ball of a nearer animal meets the segment to k."""
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
