"""Bodies as cones: what a body hides from an observer, sixteen bodies or directions at a time.

Seen from the observer a body is a cone, an axis and the cosine of half its angle, in float32.  ``shut`` is minus that
cosine, so that a direction lies ``direction . axis + shut`` deep in the cone.  Numba's cache does not see a change in
this file: after one, touch `flockbrush.systems.sight`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from flockbrush.engine.lanes import (
    LANES,
    count,
    fused,
    gather,
    lane_numbers,
    largest,
    load,
    narrow,
    pack,
    root,
    splat,
    store,
    where,
)
from flockbrush.systems.sightline import step

NEVER = np.float32(-4.0)  # the ``shut`` of a cone that covers nothing
COVERED = np.float32(1e-5)  # a rim this deep in a cone is covered; rounding stays below half of it
SLOT = np.int32(0x7FFFFFFF)  # the bits of ``slot`` that are a slot
_F0, _F1 = np.float32(0.0), np.float32(1.0)


class RingNear(NamedTuple):
    """Whoever is in range of one observer, in the order of the cells."""

    x: Any  # float32, unit vector to his centre
    y: Any
    d2: Any  # float64, m^2
    slot: Any  # int32, his place in the cells; negative outside the field of view
    axis_x: Any  # float32, axis of his body's cone; a disc's is (x, y) itself
    axis_y: Any
    shut: Any  # float32, minus the cosine of half the cone's angle; NEVER when the observer stands in the body
    far2: Any  # float64, m^2, where his body certainly hides all in the cone
    sine: Any  # float32, of half the cone's angle; in a dense herd only


class RingBodies(NamedTuple):
    """Bodies by ring, as in `Near`; each ring's part is a multiple of four long."""

    x: Any
    y: Any
    shut: Any
    d2: Any
    far2: Any
    slot: Any
    sine: Any


class Rims(NamedTuple):
    """Rims of cones that no cone covers so far: unit vectors, float32."""

    x: Any
    y: Any


@step
def _inverse(square):
    """1 over the square root; 0 for 0."""
    return where(square > _F0, splat(_F1) / root(square), splat(_F0))


@step
def cones_of_discs(n, dense, near):
    """Offsets become unit vectors, 'd2 - radius^2' becomes the cone: cosine = sqrt(d2 - radius^2) / d."""
    for k in range(0, n, LANES):
        inverse, outside = _inverse(narrow(load(near.d2, k))), load(near.shut, k)
        store(near.x, k, load(near.x, k) * inverse)
        store(near.y, k, load(near.y, k) * inverse)
        store(near.shut, k, where(outside > _F0, splat(_F0) - root(outside) * inverse, splat(NEVER)))
        if dense:
            store(near.sine, k, load(near.sine, k) * inverse)


@step
def _contains_origin(ax, ay, bx, by, radius):
    """Whether the origin is in capsules: `sightline.point_to_segment2`, the same bits."""
    ux, uy = bx - ax, by - ay
    zero = splat(0.0)
    t, uu = (zero - ax) * ux + (zero - ay) * uy, ux * ux + uy * uy
    t = where((t <= 0.0) | (uu <= 0.0), zero, t / uu)
    t = where(t < 1.0, t, splat(1.0))
    ex, ey = ax + t * ux, ay + t * uy
    return ex * ex + ey * ey <= radius * radius


@step
def cones_of_capsules(i, n, cells, near):
    """The cone between the outermost of the four tangents to the two ends of each capsule."""
    for k in range(0, n, LANES):
        there, slot = lane_numbers() < np.int32(n - k), load(near.slot, k) & SLOT
        d2, h, b = load(near.d2, k), gather(cells.half, slot, there), gather(cells.radius, slot, there)
        cx, cy = gather(cells.x, slot, there) - cells.x[i], gather(cells.y, slot, there) - cells.y[i]
        ox, oy = h * gather(cells.fx, slot, there), h * gather(cells.fy, slot, there)
        ax, ay, bx, by = cx - ox, cy - oy, cx + ox, cy + oy
        within = _contains_origin(ax, ay, bx, by, b)
        # end a to the right, b to the left
        flip = ax * by - ay * bx < 0.0
        ax, bx, ay, by = where(flip, bx, ax), where(flip, ax, bx), where(flip, by, ay), where(flip, ay, by)
        a2, b2 = ax * ax + ay * ay, bx * bx + by * by
        ta, tb = a2 - b * b, b2 - b * b  # squared lengths of the tangents
        ta, tb = where(ta > 0.0, ta, splat(0.0)), where(tb > 0.0, tb, splat(0.0))
        ia, ib, thick = _inverse(narrow(a2)), _inverse(narrow(b2)), narrow(b)
        ca, sa, cb, sb = root(narrow(ta)) * ia, thick * ia, root(narrow(tb)) * ib, thick * ib
        ax, ay, bx, by = narrow(ax) * ia, narrow(ay) * ia, narrow(bx) * ib, narrow(by) * ib
        # right tangents of both ends, then left ones
        px, py, qx, qy = ax * ca + ay * sa, ay * ca - ax * sa, bx * cb + by * sb, by * cb - bx * sb
        right = px * qy - py * qx >= _F0
        rx, ry = where(right, px, qx), where(right, py, qy)
        px, py, qx, qy = ax * ca - ay * sa, ay * ca + ax * sa, bx * cb - by * sb, by * cb + bx * sb
        left = qx * py - qy * px <= _F0
        lx, ly = where(left, qx, px), where(left, qy, py)
        # right and left tangent, and their difference turned back a right angle, add up to the axis and never cancel
        x, y = rx + lx + (ly - ry), ry + ly - (lx - rx)
        inverse = _inverse(x * x + y * y)
        x, y = x * inverse, y * inverse
        store(near.axis_x, k, x)
        store(near.axis_y, k, y)
        store(near.shut, k, where(within, splat(NEVER), splat(_F0) - (x * lx + y * ly)))
        store(near.sine, k, x * ly - y * lx)
        # no body between observer and near side is farther away than the farther tangent point
        tr, tl = where(right, ta, tb), where(left, tb, ta)
        far2 = where(tr > tl, tr, tl) * (1.0 + 1e-6)
        store(near.far2, k, where(far2 > d2, far2, d2))
        inverse = _inverse(narrow(d2))
        store(near.x, k, load(near.x, k) * inverse)
        store(near.y, k, load(near.y, k) * inverse)


@step
def _cone(x, y, k, bodies):
    """How deep directions lie in a cone: the difference of two cosines, negative outside."""
    return fused(x, splat(bodies.x[k]), fused(y, splat(bodies.y[k]), splat(bodies.shut[k])))


@step
def depth_in_cones(x, y, a, b, bodies):
    """How deep directions lie in the cones a to b, at most."""
    q0 = q1 = q2 = q3 = splat(np.float32(-1.0))
    for k in range(a, b, 4):
        q0 = largest(_cone(x, y, k, bodies), q0)
        q1 = largest(_cone(x, y, k + 1, bodies), q1)
        q2 = largest(_cone(x, y, k + 2, bodies), q2)
        q3 = largest(_cone(x, y, k + 3, bodies), q3)
    return largest(largest(q0, q1), largest(q2, q3))


@step
def depth_in_nearer_cones(x, y, d2, a, b, bodies, from2):
    """The same, a cone beginning at its ``from2``."""
    q0 = q1 = q2 = q3 = splat(np.float32(-1.0))
    for k in range(a, b, 4):
        q0 = where(d2 > from2[k], largest(_cone(x, y, k, bodies), q0), q0)
        q1 = where(d2 > from2[k + 1], largest(_cone(x, y, k + 1, bodies), q1), q1)
        q2 = where(d2 > from2[k + 2], largest(_cone(x, y, k + 2, bodies), q2), q2)
        q3 = where(d2 > from2[k + 3], largest(_cone(x, y, k + 3, bodies), q3), q3)
    return largest(largest(q0, q1), largest(q2, q3))


@step
def uncovered(n, first, a, b, bodies, rims):
    """Strike out the rims from ``first`` on that lie in cones a to b; returns how many there are, with those before."""
    left = first
    for k in range(first, n, LANES):
        x, y = load(rims.x, k), load(rims.y, k)
        ok = (lane_numbers() < np.int32(n - k)) & (depth_in_cones(x, y, a, b, bodies) <= COVERED)
        pack(rims.x, left, x, ok)
        pack(rims.y, left, y, ok)
        left += count(ok)
    return left


@step
def left_rims(n, a, b, fx, fy, cosine, bodies, rims):
    """Append the left rims of the cones a to b, in the field of view; returns how many rims there are."""
    for k in range(a, b, LANES):
        x, y, cosh, sinh = load(bodies.x, k), load(bodies.y, k), load(bodies.shut, k), load(bodies.sine, k)
        # the axis turned left by half the angle; shut is minus its cosine
        ex, ey = splat(_F0) - x * cosh - y * sinh, x * sinh - y * cosh
        ok = (lane_numbers() < np.int32(b - k)) & (cosh > NEVER)
        ok = ok & (ex * np.float32(fx) + ey * np.float32(fy) >= np.float32(cosine) - COVERED)
        pack(rims.x, n, ex, ok)
        pack(rims.y, n, ey, ok)
        n += count(ok)
    return n


@step
def rim_of_view(fx, fy, cosine, rims):
    """The right rim of the field of view, where there is one; returns how many rims that makes."""
    if cosine <= -1.0:
        return 0
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    rims.x[0], rims.y[0] = np.float32(fx * cosine + fy * sine), np.float32(fy * cosine - fx * sine)
    return 1
