"""Questions to solids inside a kernel: what lies ahead, where its silhouette ends, and steps that never enter one.

The functions end in an underscore: they are called by kernels.  A body of radius w meets a solid grown by w: every face
is moved outwards by w, so corners stay sharp and a grown solid is never too small; very sharp ones are cut.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import inner_kernel, kernel_function
from flockbrush.engine.solids import CYLINDER, POLYHEDRON, SPHERE
from numba import njit

SLACK = 1e-6  # m of room kept free against rounding
SLIDES = 4  # surfaces a body slides along in one step
PUSHES = 16  # out of solids that have come over a body
GROWTH = 2.5  # no point of a solid grown by w is farther than this times w from the solid
LEVEL = 0.5  # up and down part of the normal of a wall, at most


@kernel_function
def far_(s, k, x, y, z, reach, w):
    """Whether a solid, grown by w, is surely farther than ``reach`` m."""
    dx, dy, dz = s.centre[k, 0] - x, s.centre[k, 1] - y, s.centre[k, 2] - z
    room = reach + s.bound[k] + GROWTH * w
    return dx * dx + dy * dy + dz * dz > room * room


@njit(cache=True, nogil=True, error_model="numpy")
def surface_(s, k, x, y, z):
    """(gap, nx, ny, nz): metres to the nearest face, less than 0 inside, and the way out.

    Beyond a corner the gap is that to the nearest of the grown faces, which is less than the distance.
    """
    dx, dy, dz = x - s.centre[k, 0], y - s.centre[k, 1], z - s.centre[k, 2]
    if s.kind[k] == SPHERE:
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        if d < 1e-12:
            return -s.radius[k], 0.0, 0.0, 1.0
        return d - s.radius[k], dx / d, dy / d, dz / d
    if s.kind[k] == CYLINDER:
        ax, ay, az = s.axis[k, 0], s.axis[k, 1], s.axis[k, 2]
        along = dx * ax + dy * ay + dz * az
        dx, dy, dz = dx - along * ax, dy - along * ay, dz - along * az
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        end = abs(along) - s.half[k]
        if d - s.radius[k] >= end and d > 1e-12:
            return d - s.radius[k], dx / d, dy / d, dz / d
        sign = 1.0 if along >= 0.0 else -1.0
        return end, sign * ax, sign * ay, sign * az
    gap, best = -np.inf, s.face_first[k]
    for f in range(s.face_first[k], s.face_first[k + 1]):
        away = s.face[f, 0] * x + s.face[f, 1] * y + s.face[f, 2] * z - s.face[f, 3]
        if away > gap:
            gap, best = away, f
    return gap, s.face[best, 0], s.face[best, 1], s.face[best, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def entry_(s, k, x, y, z, ux, uy, uz, w):
    """Metres along a unit vector to where it enters the solid grown by w; inf: never; 0 from inside."""
    first, last = -np.inf, np.inf
    dx, dy, dz = x - s.centre[k, 0], y - s.centre[k, 1], z - s.centre[k, 2]
    if s.kind[k] == POLYHEDRON:
        for f in range(s.face_first[k], s.face_first[k + 1]):
            away = s.face[f, 0] * x + s.face[f, 1] * y + s.face[f, 2] * z - s.face[f, 3] - w
            slope = s.face[f, 0] * ux + s.face[f, 1] * uy + s.face[f, 2] * uz
            if abs(slope) < 1e-14:
                if away > 0.0:
                    return np.inf
            elif slope < 0.0:
                first = max(first, -away / slope)
            else:
                last = min(last, -away / slope)
    else:
        ax = ay = az = 0.0
        if s.kind[k] == CYLINDER:
            ax, ay, az = s.axis[k, 0], s.axis[k, 1], s.axis[k, 2]
            along, slope = dx * ax + dy * ay + dz * az, ux * ax + uy * ay + uz * az
            half = s.half[k] + w
            if abs(slope) < 1e-14:
                if abs(along) > half:
                    return np.inf
            else:
                one, two = (-half - along) / slope, (half - along) / slope
                first, last = min(one, two), max(one, two)
            dx, dy, dz = dx - along * ax, dy - along * ay, dz - along * az
            ux, uy, uz = ux - slope * ax, uy - slope * ay, uz - slope * az
        r = s.radius[k] + w
        a, b, c = ux * ux + uy * uy + uz * uz, dx * ux + dy * uy + dz * uz, dx * dx + dy * dy + dz * dz - r * r
        if a < 1e-28:
            if c > 0.0:
                return np.inf
        else:
            root = b * b - a * c
            if root <= 0.0:
                return np.inf
            root = np.sqrt(root)
            first, last = max(first, (-b - root) / a), min(last, (-b + root) / a)
    if first > last or last < 0.0:
        return np.inf
    return max(first, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def blocks_(s, x, y, z, ox, oy, oz):
    """Whether a solid that blocks the view meets the segment from a point by an offset."""
    d = np.sqrt(ox * ox + oy * oy + oz * oz)
    if d > 0.0:
        for k in range(len(s.kind)):
            seen = s.opaque[k] and not far_(s, k, x, y, z, d, 0.0)
            if seen and entry_(s, k, x, y, z, ox / d, oy / d, oz / d, 0.0) <= d:
                return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def ahead_(s, x, y, z, ux, uy, uz, reach, w):
    """(k, metres) of the first solid, grown by w, that a heading would meet within reach; (-1, inf): none.

    A solid nearer than w is not grown as far as the body: who flies along a wall has nothing ahead.
    """
    who, hit = -1, np.inf
    for k in range(len(s.kind)):
        if far_(s, k, x, y, z, reach, w):
            continue
        gap = surface_(s, k, x, y, z)[0]
        t = entry_(s, k, x, y, z, ux, uy, uz, min(w, 0.99 * gap) if gap > 0.0 else 0.0)
        if t <= reach and t < hit:
            who, hit = k, t
    return who, hit


class BodyFrame(NamedTuple):
    """Where a body is and how it is held; all three as (x, y, z)."""

    place: tuple[float, float, float]  # m
    forward: tuple[float, float, float]  # unit vector, its heading
    up: tuple[float, float, float]  # unit vector out of its back, at right angles to the heading


@inner_kernel
def _tangent(d, r):
    """How far beside a middle, d m away, the tangent to the circle about it passes; at right angles from within it."""
    return d * r / np.sqrt(max(d * d - r * r, 1e-4 * d * d))


@inner_kernel
def _past_sphere(cx, cy, cz, r, pose, beyond):
    """A point ``beyond`` m past the silhouette of a ball at an offset, on the side to which the heading leans."""
    (fx, fy, fz), (ux, uy, uz) = pose.forward, pose.up
    d = np.sqrt(cx * cx + cy * cy + cz * cz)
    bx, by, bz = cx / d, cy / d, cz / d
    along = fx * bx + fy * by + fz * bz
    ex, ey, ez = fx - along * bx, fy - along * by, fz - along * bz
    if ex * ex + ey * ey + ez * ez < 1e-18:  # dead ahead: over its top
        along = ux * bx + uy * by + uz * bz
        ex, ey, ez = ux - along * bx, uy - along * by, uz - along * bz
    size = max(np.sqrt(ex * ex + ey * ey + ez * ez), 1e-300)
    out = _tangent(d, r + beyond)
    return cx + out * ex / size, cy + out * ey / size, cz + out * ez / size


@inner_kernel
def _past_cylinder(s, k, cx, cy, cz, forward, beyond, lowest, odd):
    """As `_past_sphere`: past one of its two sides, or over one of its ends; not below ``lowest`` m under the body."""
    fx, fy, fz = forward
    ax, ay, az = s.axis[k, 0], s.axis[k, 1], s.axis[k, 2]
    r, half = s.radius[k], s.half[k]
    along = cx * ax + cy * ay + cz * az
    mx, my, mz = cx - along * ax, cy - along * ay, cz - along * az
    d = np.sqrt(mx * mx + my * my + mz * mz)
    best, px, py, pz = -2.0, fx, fy, fz
    if d > r:
        mx, my, mz = mx / d, my / d, mz / d
        # where the heading crosses the plane through the axis, as far up as it is then
        depth = fx * mx + fy * my + fz * mz
        height = (fx * ax + fy * ay + fz * az) * d / depth if depth > 1e-6 else along
        height = min(max(height, along - half), along + half)
        sx, sy, sz = ay * mz - az * my, az * mx - ax * mz, ax * my - ay * mx
        out = _tangent(d, r + beyond)
        for turn in range(2):
            sign = 1.0 if (turn == 0) == (odd == 0) else -1.0
            qx, qy, qz = d * mx + sign * out * sx, d * my + sign * out * sy, d * mz + sign * out * sz
            qx, qy, qz = qx + height * ax, qy + height * ay, qz + height * az
            size = np.sqrt(qx * qx + qy * qy + qz * qz)
            lean = (fx * qx + fy * qy + fz * qz) / size
            if lean > best + 1e-12:
                best, px, py, pz = lean, qx, qy, qz
    for turn in range(2):
        end = along + (half + beyond) * (1.0 if turn == 0 else -1.0)
        depth = fx * mx + fy * my + fz * mz if d > r else 0.0
        share = (d - r) / depth if depth > 1e-6 else 1.0  # over the rim on this side
        up = fx * ax + fy * ay + fz * az
        qx, qy, qz = (
            share * (fx - up * ax) + end * ax,
            share * (fy - up * ay) + end * ay,
            share * (fz - up * az) + end * az,
        )
        size = np.sqrt(qx * qx + qy * qy + qz * qz)
        if size < 1e-12 or qz < -lowest:
            continue
        lean = (fx * qx + fy * qy + fz * qz) / size
        if lean > best + 1e-12:
            best, px, py, pz = lean, qx, qy, qz
    return px, py, pz


@inner_kernel
def _past_polyhedron(s, k, pose, beyond, lowest):
    """As `_past_sphere`: past the silhouette edge nearest, in perspective, to where the heading points."""
    (x, y, z), (fx, fy, fz), (ux, uy, uz) = pose
    rx, ry, rz = fy * uz - fz * uy, fz * ux - fx * uz, fx * uy - fy * ux  # to the right
    outward = 1.0 if entry_(s, k, x, y, z, fx, fy, fz, 0.0) < np.inf else -1.0  # it may point past the edge already
    best, px, py, pz = np.inf, 0.0, 0.0, 0.0
    for e in range(s.edge_first[k], s.edge_first[k + 1]):
        f, g = s.edge_face[e, 0], s.edge_face[e, 1]
        one = s.face[f, 0] * x + s.face[f, 1] * y + s.face[f, 2] * z > s.face[f, 3]
        two = s.face[g, 0] * x + s.face[g, 1] * y + s.face[g, 2] * z > s.face[g, 3]
        if one == two:
            continue
        ax, ay, az = s.edge[e, 0] - x, s.edge[e, 1] - y, s.edge[e, 2] - z
        bx, by, bz = s.edge[e, 3] - x, s.edge[e, 4] - y, s.edge[e, 5] - z
        da, db = ax * fx + ay * fy + az * fz, bx * fx + by * fy + bz * fz
        front = 1e-3
        if da < front and db < front:
            continue
        if da < front or db < front:  # cut off what is behind
            t = (front - da) / (db - da)
            mx, my, mz = ax + t * (bx - ax), ay + t * (by - ay), az + t * (bz - az)
            if da < front:
                ax, ay, az, da = mx, my, mz, front
            else:
                bx, by, bz, db = mx, my, mz, front
        au, av = (ax * rx + ay * ry + az * rz) / da, (ax * ux + ay * uy + az * uz) / da
        bu, bv = (bx * rx + by * ry + bz * rz) / db, (bx * ux + by * uy + bz * uz) / db
        du, dv = bu - au, bv - av
        square = du * du + dv * dv
        t = min(max(-(au * du + av * dv) / square, 0.0), 1.0) if square > 0.0 else 0.0
        qu, qv = au + t * du, av + t * dv
        depth = 1.0 / ((1.0 - t) / da + t / db)
        size = np.sqrt(qu * qu + qv * qv)
        if size >= best - 1e-12:
            continue
        if size > 1e-12:
            eu, ev = outward * qu / size, outward * qv / size
        else:  # the heading runs through the edge: away from the middle
            eu = -((s.centre[k, 0] - x) * rx + (s.centre[k, 1] - y) * ry + (s.centre[k, 2] - z) * rz)
            ev = -((s.centre[k, 0] - x) * ux + (s.centre[k, 1] - y) * uy + (s.centre[k, 2] - z) * uz)
            out = max(np.sqrt(eu * eu + ev * ev), 1e-300)
            eu, ev = eu / out, ev / out
        qu, qv = depth * qu + beyond * eu, depth * qv + beyond * ev
        qz = depth * fz + qu * rz + qv * uz
        if qz < -lowest:
            continue
        best = size
        px, py, pz = depth * fx + qu * rx + qv * ux, depth * fy + qu * ry + qv * uy, qz
    return best < np.inf, px, py, pz


@njit(cache=True, nogil=True, error_model="numpy")
def past_(s, k, pose, beyond, lowest, odd):
    """Unit vector to a point ``beyond`` m past the silhouette edge of a solid nearest to the heading of a `BodyFrame`.

    Points more than ``lowest`` m below the body are under the ground.  Dead ahead of a cylinder, ``odd`` says on which
    side.  From where there is no such edge (a plane, or inside) it leads along the nearest face, level along a wall.
    """
    (x, y, z), (fx, fy, fz), (ux, uy, uz) = pose
    cx, cy, cz = s.centre[k, 0] - x, s.centre[k, 1] - y, s.centre[k, 2] - z
    gap, nx, ny, nz = surface_(s, k, x, y, z)
    found, px, py, pz = False, 0.0, 0.0, 0.0
    if gap > 0.0:
        if s.kind[k] == SPHERE:
            found = True
            px, py, pz = _past_sphere(cx, cy, cz, s.radius[k], pose, beyond)
        elif s.kind[k] == CYLINDER:
            found = True
            px, py, pz = _past_cylinder(s, k, cx, cy, cz, pose.forward, beyond, lowest, odd)
        else:
            found, px, py, pz = _past_polyhedron(s, k, pose, beyond, lowest)
    if not found:
        into = fx * nx + fy * ny + fz * nz
        px, py, pz = fx - into * nx, fy - into * ny, fz - into * nz
        if abs(nz) < LEVEL:  # up and down leads past no wall
            pz = 0.0
            if px * px + py * py < 1e-12:
                side = 1.0 if odd else -1.0
                px, py = side * -ny, side * nx
        if px * px + py * py + pz * pz < 1e-12:
            into = ux * nx + uy * ny + uz * nz
            px, py, pz = ux - into * nx, uy - into * ny, uz - into * nz
        size = max(np.sqrt(px * px + py * py + pz * pz), 1e-300)
        px, py, pz = px / size + 0.2 * nx, py / size + 0.2 * ny, pz / size + 0.2 * nz
    size = np.sqrt(px * px + py * py + pz * pz)
    if size < 1e-12:
        return nx, ny, nz
    return px / size, py / size, pz / size


@njit(cache=True, nogil=True, error_model="numpy")
def out_of_(s, x, y, z, w):
    """(free, x, y, z): out of every solid that has come over a body of radius w, by the nearest faces."""
    for _ in range(PUSHES):
        worst, mx, my, mz = 0.5 * SLACK, 0.0, 0.0, 0.0
        for k in range(len(s.kind)):
            if far_(s, k, x, y, z, 0.0, w):
                continue
            gap, nx, ny, nz = surface_(s, k, x, y, z)
            if gap - w < worst:
                worst, mx, my, mz = gap - w, nx, ny, nz
        if mx == 0.0 and my == 0.0 and mz == 0.0:
            return True, x, y, z
        by = SLACK - worst
        x, y, z = x + by * mx, y + by * my, z + by * mz
    return False, x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def slide_(s, x, y, z, sx, sy, sz, w):
    """(touched, x, y, z): where a body of radius w that starts free comes to by a step, along whatever it meets."""
    touched = False
    for _ in range(SLIDES):
        length = np.sqrt(sx * sx + sy * sy + sz * sz)
        if length < 1e-12:
            break
        ux, uy, uz = sx / length, sy / length, sz / length
        hit, who = length + SLACK, np.int64(-1)  # a plain -1 is a type of its own, for which numba compiles all over
        for k in range(len(s.kind)):
            if far_(s, k, x, y, z, length, w):
                continue
            t = entry_(s, k, x, y, z, ux, uy, uz, w)
            if t < hit:
                hit, who = t, k
        if who < 0:
            return touched, x + sx, y + sy, z + sz
        touched = True
        go = max(hit - 2.0 * SLACK, 0.0)
        x, y, z = x + go * ux, y + go * uy, z + go * uz
        _, nx, ny, nz = surface_(s, who, x, y, z)
        rest = max(length - go, 0.0)
        sx, sy, sz = rest * ux, rest * uy, rest * uz
        into = sx * nx + sy * ny + sz * nz
        if into < 0.0:
            sx, sy, sz = sx - into * nx, sy - into * ny, sz - into * nz
    return touched, x, y, z
