"""The kernel of `flockbrush.systems.visibility`: rings outwards, bodies as cones, sixteen animals at a time.

For one observer:

gather
    whoever is in range, from the cells, in float64, and the unit vector to each.
cones
    Seen from the observer a body is a cone: an axis and the cosine of half its angle.  It hides those in the cone who
    stand beyond its far side, and nobody who is nearer than its centre.
rings
    The bodies of a ring strike out animals of that ring and beyond, so the list grows shorter from ring to ring.
rims
    In a dense herd the animal first looks only as far as it can expect to see.  When the rim of every cone lies in
    another cone, bodies cover the whole circle, and nobody farther out can be seen; else it looks on.

Cones are compared in float32.  Whatever comes within ``DOUBT`` of an edge, or between centre and far side of a body,
is decided by the definition itself in float64: the result is exact, and the same on every processor.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from flockbrush.engine.lanes import (
    LANES,
    bits,
    count,
    lane_numbers,
    load,
    load_where,
    lowest,
    mask_of,
    narrow,
    pack,
    pointer,
    splat,
    store,
    where,
)  # fmt: skip
from flockbrush.systems.cones import (
    NEVER,
    SLOT,
    Rims,
    RingBodies,
    RingNear,
    cones_of_capsules,
    cones_of_discs,
    depth_in_cones,
    depth_in_nearer_cones,
    left_rims,
    rim_of_view,
    uncovered,
)  # fmt: skip
from flockbrush.systems.sightline import crosses, kernel, meets_capsule, step

DOUBT = np.float32(2e-6)  # cosines nearer than this to an edge are decided in float64; rounding stays below 1.5e-6

# In units of optical depth, the distance within which bodies side by side would cover the circle once:
DENSE = 5.0  # looking in several steps is worth its cost where the range is longer than this
FIRST_LOOK = 4.5  # how far a dense herd is looked into first,
NEXT_LOOK = 1.6  # how many times as far at each further look,
RING = 1.0  # width of a ring,
DENSE_RING = 2.0  # and in a dense herd, whose rings have enough bodies to strike out many
RINGS = 8  # at most, in one look

_BEHIND = np.int32(-0x80000000)  # added to the slot of an animal outside the field of view


class CellPointers(NamedTuple):
    """`Cells`, by pointers: arrays would be counted at every call, which costs more than the work."""

    x: Any
    y: Any
    fx: Any
    fy: Any
    half: Any
    radius: Any
    start: Any
    nx: int
    ny: int
    cell: float
    west: Any
    south: Any


class ViewBounds(NamedTuple):
    """How far and how wide animals see, by row."""

    reach: Any  # (n,) m
    cosine: Any  # (n,) of half the field of view; -1 sees all round


class Sizes(NamedTuple):
    """Of the bodies of a herd."""

    width: float  # m, mean apparent width
    widest: float  # m, the longest distance from a centre to the skin; 0 when all bodies are discs


class Views(NamedTuple):
    """Whom everybody sees.

    What observers in slots lo to hi see goes to ``seen`` from ``lo * room`` on, as slots, side by side.
    """

    room: int
    seen: Any  # (slots * room + LANES,) int32
    begin: Any  # (slots,) where the list of each begins, or -1 where room was too small
    count: Any  # type: ignore[assignment]  # (n,) how many, by row


class Desk(NamedTuple):
    """What an observer works with."""

    near: RingNear
    bodies: RingBodies
    rims: Rims
    rings: Any  # ring m has bodies rings[3 * m] to rings[3 * m + 2], from rings[3 * m + 1] on astride its outer edge
    outers2: Any  # m^2, the outer edge of each ring
    seen: Any  # int32 slots


# --- the definition ---------------------------------------------------------------------------------------------------


@kernel
def _hidden_exactly(i, at, a, b, cells, near, bodies):
    """Whether a body from a to b hides neighbour ``at``, where the cones leave a doubt."""
    x, y, d2, j = near.x[at], near.y[at], near.d2[at], near.slot[at]
    xi, yi = cells.x[i], cells.y[i]
    for k in range(a, b):
        if bodies.d2[k] < d2 and bodies.x[k] * x + bodies.y[k] * y + bodies.shut[k] > -2 * DOUBT:
            s = bodies.slot[k]
            if meets_capsule(
                cells.x[j] - xi, cells.y[j] - yi, cells.x[s] - xi, cells.y[s] - yi,
                cells.fx[s], cells.fy[s], cells.half[s], cells.radius[s],
            ):  # fmt: skip
                return True
    return False


@kernel
def _without_hidden_by_edges(i, n, cells, edges, seen):
    """Strike out whom an edge hides; returns how many are left."""
    xi, yi = cells.x[i], cells.y[i]
    ex, ey = (xi - edges.west) / edges.cell, (yi - edges.south) / edges.cell
    if not (0.0 <= ex < edges.nx and 0.0 <= ey < edges.ny):
        return n
    c = int(ey) * edges.nx + int(ex)
    left = 0
    for k in range(n):
        x, y = cells.x[seen[k]] - xi, cells.y[seen[k]] - yi
        hidden = False
        for at in range(edges.start[c], edges.start[c + 1]):
            e = edges.item[at]
            ax, ay, bx, by = edges.ends[e, 0] - xi, edges.ends[e, 1] - yi, edges.ends[e, 2] - xi, edges.ends[e, 3] - yi
            if crosses(0.0, 0.0, x, y, ax, ay, bx, by):
                hidden = True
                break
        seen[left] = seen[k]
        left += not hidden
    return left


# --- gather ----------------------------------------------------------------------------------------------------------


@step
def _span(xi, yi, south, r, inner2, outer2, cells):
    """The slots in row r of the cells that touch the annulus about a place: the first to the second, third to fourth.

    ``xi`` is counted from where column 0 begins, ``south`` is where row 0 does.
    """
    size, per, slack = cells.cell, 1.0 / cells.cell, 1e-9 * cells.cell
    low, last, first = south + r * size - yi, cells.nx - 1, r * cells.nx
    gap = max(0.0, max(low, -low - size))
    w = math.sqrt(max(outer2 - gap * gap, 0.0)) + slack
    c0, c1 = max(0, int((xi - w) * per)), min(last, int((xi + w) * per)) + 1
    a = b = c1
    deep = max(abs(low), abs(low + size))
    if inner2 > deep * deep:  # the cells wholly within the inner circle are left out
        w = math.sqrt(inner2 - deep * deep) - slack
        a, b = max(math.ceil((xi - w) * per), c0), min(int((xi + w) * per), c1)
        if b <= a:
            a = b = c1
    return cells.start[first + c0], cells.start[first + a], cells.start[first + b], cells.start[first + c1]


@step
def _in_view(dx, dy, d2, fx, fy, cosine):
    """Who is in the field of view, or at the very same place."""
    dot = dx * fx + dy * fy
    ahead, square, limit = dot >= 0.0, dot * dot, d2 * (cosine * cosine)
    front = ahead & (square >= limit) if cosine >= 0.0 else ahead | (square <= limit)
    return front | (d2 <= 0.0)


@step
def _gather(i, inner2, outer2, cosine, dense, cells, near):
    """Everybody from ``inner2`` to ``outer2`` (m^2) from i; returns how many.

    Offsets where the cones will have unit vectors, 'd2 - radius^2' for their cosine and the radius for their sine.
    """
    xi, yi, fx, fy = cells.x[i], cells.y[i], cells.fx[i], cells.fy[i]
    west, south = cells.west[i], cells.south[i]
    up, per, outer = yi - south, 1.0 / cells.cell, math.sqrt(outer2) + 1e-9 * cells.cell
    r0, r1 = max(0, int((up - outer) * per)), min(cells.ny - 1, int((up + outer) * per))
    n = 0
    for r in range(r0, r1 + 1):
        a0, b0, a1, b1 = _span(xi - west, yi, south, r, inner2, outer2, cells)
        for side in range(2):
            a, b = (a1, b1) if side else (a0, b0)
            for k in range(a, b, LANES):
                there = lane_numbers() < np.int32(b - k)
                dx, dy = load_where(cells.x, k, there) - xi, load_where(cells.y, k, there) - yi
                radius = load_where(cells.radius, k, there)
                d2, slot = dx * dx + dy * dy, lane_numbers() + np.int32(k)
                ok = there & (d2 >= inner2) & (d2 < outer2) & (slot != np.int32(i))
                if cosine > -1.0:
                    slot = where(_in_view(dx, dy, d2, fx, fy, cosine), slot, slot + _BEHIND)
                pack(near.x, n, narrow(dx), ok)
                pack(near.y, n, narrow(dy), ok)
                pack(near.d2, n, d2, ok)
                pack(near.slot, n, slot, ok)
                pack(near.shut, n, narrow(d2 - radius * radius), ok)
                if dense:
                    pack(near.sine, n, narrow(radius), ok)
                n += count(ok)
    return n


# --- rings -----------------------------------------------------------------------------------------------------------


@step
def _add_bodies(at, inner2, outer2, far_from2, far_to2, n, dense, capsules, near, bodies):
    """Append the bodies with centres from inner2 to outer2 and far sides beyond far_from2, up to far_to2."""
    for k in range(0, n, LANES):
        d2, shut = load(near.d2, k), load(near.shut, k)
        ok = (lane_numbers() < np.int32(n - k)) & (d2 >= inner2) & (d2 < outer2) & (shut > NEVER)
        if capsules:
            far2 = load(near.far2, k)
            ok = ok & (far2 > far_from2) & (far2 <= far_to2)
            pack(bodies.far2, at, far2, ok)
        pack(bodies.x, at, load(near.axis_x, k), ok)
        pack(bodies.y, at, load(near.axis_y, k), ok)
        pack(bodies.shut, at, shut, ok)
        pack(bodies.d2, at, d2, ok)
        pack(bodies.slot, at, load(near.slot, k) & SLOT, ok)
        if dense:
            pack(bodies.sine, at, load(near.sine, k), ok)
        at += count(ok)
    store(bodies.x, at, splat(np.float32(0.0)))
    store(bodies.y, at, splat(np.float32(0.0)))
    store(bodies.shut, at, splat(NEVER))
    store(bodies.d2, at, splat(np.inf))
    if capsules:
        store(bodies.far2, at, splat(np.inf))
    return (at + 3) & ~3


@step
def _look_through(i, ring, n, found, capsules, cells, desk):
    """Strike out whom the bodies of a ring hide; who is within its edge and not hidden is seen.

    Those astride the edge hide nobody beyond it.  The others beyond stay in ``near``; returns how many stay and are
    seen.
    """
    near, bodies, seen = desk.near, desk.bodies, desk.seen
    a, plain, b = desk.rings[3 * ring], desk.rings[3 * ring + 1], desk.rings[3 * ring + 2]
    outer2 = desk.outers2[ring]
    left = 0
    for k in range(0, n, LANES):
        x, y, d2, slot = load(near.x, k), load(near.y, k), load(near.d2, k), load(near.slot, k)
        ok = (lane_numbers() < np.int32(n - k)) & (slot >= np.int32(0))
        own = ok & (d2 < outer2)
        if bits(own) == 0:
            surely = maybe = depth_in_cones(x, y, a, plain, bodies)
        elif capsules:
            maybe = depth_in_nearer_cones(x, y, d2, a, b, bodies, bodies.d2)
            surely = depth_in_nearer_cones(x, y, d2, a, b, bodies, bodies.far2)
        else:
            surely = maybe = depth_in_nearer_cones(x, y, d2, a, b, bodies, bodies.d2)
        open_ = ok & (surely <= DOUBT)
        doubts = bits(open_ & (maybe > -DOUBT))
        while doubts:
            lane = lowest(doubts)
            doubts &= doubts - 1
            if _hidden_exactly(i, k + lane, a, b, cells, near, bodies):
                open_ = open_ & ~mask_of(1 << lane)
        within, beyond = open_ & own, open_ & ~own
        pack(seen, found, slot, within)
        found += count(within)
        pack(near.x, left, x, beyond)
        pack(near.y, left, y, beyond)
        pack(near.d2, left, d2, beyond)
        pack(near.slot, left, slot, beyond)
        left += count(beyond)
    return left, found


# --- looks ---------------------------------------------------------------------------------------------------------


@step
def _optical_depth(i, width, cells):
    """Metres per unit of optical depth where the animal stands: 1 / (width of a body * animals per m^2)."""
    cx, cy = int((cells.x[i] - cells.west[i]) / cells.cell), int((cells.y[i] - cells.south[i]) / cells.cell)
    c0, c1 = max(0, cx - 1), min(cells.nx - 1, cx + 1) + 1
    r0, r1 = max(0, cy - 1), min(cells.ny - 1, cy + 1) + 1
    n = 0
    for first in range(r0 * cells.nx, r1 * cells.nx, cells.nx):
        n += cells.start[first + c1] - cells.start[first + c0]
    return (r1 - r0) * (c1 - c0) * cells.cell * cells.cell / (max(width, 1e-6) * max(n - 1, 0.5))


@step
def _add_rings(inner, outer, width, widest, n, at, plain, dense, desk):
    """Sort the bodies of a look by ring, after those of the looks before; returns how many rings and bodies.

    Those astride the outer edge of a ring are also the first of the next ring, which is wide enough to hold them.
    Ring 0 is all the looks before.
    """
    near, bodies, rings, outers2 = desk.near, desk.bodies, desk.rings, desk.outers2
    steps = min(int((outer - inner) / width + 0.25), RINGS)
    if widest > 0.0:
        steps = min(steps, int((outer - inner) / widest))
    steps = max(steps, 1)
    rings[0], rings[1], rings[2], outers2[0] = 0, plain, at, inner * inner
    for m in range(1, steps + 1):
        edge = inner + (outer - inner) * (m / steps) if m < steps else outer
        low2, high2 = outers2[m - 1], edge * edge
        rings[3 * m], outers2[m] = plain, high2
        plain = at = _add_bodies(at, low2, high2, -1.0, high2, n, dense, widest > 0.0, near, bodies)
        if widest > 0.0:
            at = _add_bodies(at, low2, high2, high2, np.inf, n, dense, widest > 0.0, near, bodies)
        rings[3 * m + 1], rings[3 * m + 2] = plain, at
    return steps, at, plain


@step
def _covered_by(old, new, steps, n, i, cosine, cells, desk):
    """How many rims are left uncovered when the bodies ``old`` to ``new`` come to those before.

    When it is 0, bodies cover the whole view: a gap would end at a rim.
    """
    if new == 0:
        return 1
    bodies, rings, rims = desk.bodies, desk.rings, desk.rims
    n = uncovered(n, np.int64(0), old, new, bodies, rims)
    first = n
    n = left_rims(n, old, new, cells.fx[i], cells.fy[i], cosine, bodies, rims)
    for m in range(steps + 1):
        n = uncovered(n, first, rings[3 * m], rings[3 * m + 1], bodies, rims)
    return n


@step
def _view_by_looks(i, reach, cosine, depth, widest, cells, desk):
    """Slots of the visible, in ``seen``; returns how many."""
    dense = reach > DENSE * depth
    inner, inner2, outer = 0.0, -1.0, max(FIRST_LOOK * depth, widest) if dense else reach
    found = at = old = plain = np.int64(0)
    gaps = rim_of_view(cells.fx[i], cells.fy[i], cosine, desk.rims) if dense else 0
    while True:
        if outer > 0.8 * reach:
            outer = reach
        n = _gather(i, inner2, outer * outer, cosine, dense, cells, desk.near)
        if widest > 0.0:
            cones_of_capsules(i, n, cells, desk.near)
        else:
            cones_of_discs(n, dense, desk.near)
        steps, at, plain = _add_rings(
            inner, outer, (DENSE_RING if dense else RING) * depth, widest, n, at, plain, dense, desk
        )
        for m in range(0 if desk.rings[2] else 1, steps + 1):
            n, found = _look_through(i, m, n, found, widest > 0.0, cells, desk)
        if outer == reach:
            return found
        gaps = _covered_by(old, plain, steps, gaps, i, cosine, cells, desk)
        if gaps == 0:
            return found
        inner, inner2, outer, old = outer, outer * outer, max(NEXT_LOOK * outer, outer + widest), plain


@step
def _all_in_view(i, reach, cosine, cells, near, seen):
    """Whoever is in range and in the field of view, hidden or not."""
    dense = np.bool_(False)  # a plain False is a type of its own, for which numba would compile once more
    n = _gather(i, -1.0, reach * reach, cosine, dense, cells, near)
    found = 0
    for k in range(0, n, LANES):
        slot = load(near.slot, k)
        ok = (lane_numbers() < np.int32(n - k)) & (slot >= np.int32(0))
        pack(seen, found, slot, ok)
        found += count(ok)
    return found


@kernel
def look(lo, hi, cells, eyes, edges, occlusion, sizes, views):
    """The visible of the observers in slots lo to hi, into ``views``."""
    f4, f8 = np.float32, np.float64
    n = len(cells.x) + LANES
    x, y = np.empty(n, f4), np.empty(n, f4)
    own = n if sizes.widest > 0.0 else 0  # a disc's cone has no axis of its own, nor another far side
    ax, ay, far2 = np.empty(own, f4), np.empty(own, f4), np.empty(own, f8)
    if own == 0:
        ax, ay = x, y
    near = RingNear(x, y, np.empty(n, f8), np.empty(n, np.int32), ax, ay, np.empty(n, f4), far2, np.empty(n, f4))
    k = 4 * n  # a part of a ring is padded to a multiple of four
    own = k if own else 0
    shut, far2 = np.empty(k, f4), np.empty(own, f8)
    bodies = RingBodies(
        np.empty(k, f4), np.empty(k, f4), shut, np.empty(k, f8), far2, np.empty(k, np.int32), np.empty(k, f4)
    )
    rims = Rims(np.empty(k, f4), np.empty(k, f4))
    rings, outers2 = np.empty(3 * RINGS + 3, np.int64), np.empty(RINGS + 1, f8)
    desk = Desk(near, bodies, rims, rings, outers2, np.empty(n, np.int32))
    _look(lo, hi, cells, eyes, edges, occlusion, sizes, views, desk)


@step
def _pointers(desk):
    near, bodies, rims, rings, outers2, seen = desk
    near = RingNear(
        pointer(near.x), pointer(near.y), pointer(near.d2), pointer(near.slot), pointer(near.axis_x),
        pointer(near.axis_y), pointer(near.shut), pointer(near.far2), pointer(near.sine),
    )  # fmt: skip
    bodies = RingBodies(
        pointer(bodies.x), pointer(bodies.y), pointer(bodies.shut), pointer(bodies.d2),
        pointer(bodies.far2), pointer(bodies.slot), pointer(bodies.sine),
    )  # fmt: skip
    rims = Rims(pointer(rims.x), pointer(rims.y))
    return Desk(near, bodies, rims, pointer(rings), pointer(outers2), pointer(seen))


@kernel
def _look(lo, hi, cells, eyes, edges, occlusion, sizes, views, desk):
    herd = CellPointers(
        pointer(cells.x), pointer(cells.y), pointer(cells.fx), pointer(cells.fy), pointer(cells.half),
        pointer(cells.radius), pointer(cells.start), cells.nx, cells.ny, cells.cell,
        pointer(cells.west), pointer(cells.south),
    )  # fmt: skip
    desk, seen = _pointers(desk), pointer(views.seen)
    at, end = lo * views.room, hi * views.room
    for i in range(lo, hi):
        if cells.ghost[i]:
            continue
        row = cells.row[i]
        reach, cosine = eyes.reach[row], eyes.cosine[row]
        if occlusion:
            depth = _optical_depth(i, sizes.width, herd)
            found = _view_by_looks(i, reach, cosine, depth, sizes.widest, herd, desk)
        else:
            found = _all_in_view(i, reach, cosine, herd, desk.near, desk.seen)
        if len(edges.ends):
            found = _without_hidden_by_edges(i, found, herd, edges, desk.seen)
        views.count[row] = found
        if at + found > end - LANES:
            views.begin[i] = -1
            continue
        views.begin[i] = at
        for k in range(0, found, LANES):
            store(seen, at + k, load(desk.seen, k))
        at += found
