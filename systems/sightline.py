"""The definition of a line of sight: what a segment from an observer to a neighbour meets, in float64."""

from __future__ import annotations

from numba import njit

kernel = njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)
step = njit(
    cache=True, nogil=True, error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True
)


@step
def point_to_segment2(px, py, ax, ay, bx, by):
    """Squared distance from a point to a segment."""
    ux, uy = bx - ax, by - ay
    t = (px - ax) * ux + (py - ay) * uy
    uu = ux * ux + uy * uy
    t = 0.0 if t <= 0.0 or uu == 0.0 else min(t / uu, 1.0)
    ex, ey = ax + t * ux - px, ay + t * uy - py
    return ex * ex + ey * ey


@step
def crosses(px, py, qx, qy, ax, ay, bx, by):
    """Whether segments pq and ab meet, end points included; segments in one line do not count."""
    d1 = (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    d2 = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
    d3 = (qx - px) * (ay - py) - (qy - py) * (ax - px)
    d4 = (qx - px) * (by - py) - (qy - py) * (bx - px)
    return d1 * d2 <= 0.0 and d3 * d4 <= 0.0 and not (d1 == 0.0 and d2 == 0.0)


@kernel
def meets_capsule(jx, jy, cx, cy, fx, fy, half, radius):
    """Whether the segment from the origin to (jx, jy) passes within ``radius`` of a capsule's axis.

    The axis goes ``half`` to both sides of (cx, cy) along the unit vector (fx, fy).
    """
    ax, ay, bx, by = cx - half * fx, cy - half * fy, cx + half * fx, cy + half * fy
    r2 = radius * radius
    if (
        point_to_segment2(ax, ay, 0.0, 0.0, jx, jy) < r2
        or point_to_segment2(bx, by, 0.0, 0.0, jx, jy) < r2
        or point_to_segment2(jx, jy, ax, ay, bx, by) < r2
    ):
        return True
    return crosses(0.0, 0.0, jx, jy, ax, ay, bx, by)
