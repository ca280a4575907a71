"""Hidden-point removal: who is visible among animals without bodies.

Katz, Tal and Basri [1]_ flip every point over a sphere of radius R about the viewpoint,
``p -> p + 2 (R - |p|) p / |p|``, so that near points come to lie far out.  Visible are the points that then lie on the
convex hull of all flipped points and the viewpoint.  Animals have no bodies here: how much a point hides depends on how
near the points are to one another, and on R.  The larger R, the more points are visible.
`flockbrush.systems.perception` and `flockbrush.systems.initiation` flip the points and ask for the corners of the hull.

.. [1] Katz, S., Tal, A. and Basri, R. (2007). Direct visibility of point sets. ACM Transactions on Graphics 26(3), 24.
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.arrays import order_, write_
from numba import njit

RADIUS_FACTOR = 100.0  # R in distances of the farthest point; by eye; larger sees more
STRAIGHT = 1e-12  # sine of a turn that counts as none


@njit(cache=True, nogil=True, error_model="numpy")
def hull_corners(x, y):
    """Corners of the convex hull of points and the origin, on a plane; the origin, of index n, is left out.

    Monotone chain: from west to east below, and back above, leaving out whoever makes no left turn.
    """
    n = len(x)
    px, py = np.zeros(n + 1), np.zeros(n + 1)
    write_(px[:n], x)
    write_(py[:n], y)
    order = order_(px, n + 1)
    for k in range(1, n + 1):  # those on one meridian from south to north
        i, at = order[k], k
        while at > 0 and px[order[at - 1]] == px[i] and py[order[at - 1]] > py[i]:
            order[at] = order[at - 1]
            at -= 1
        order[at] = i
    chain, is_corner = np.empty(n + 2, np.int64), np.zeros(n + 1, np.bool_)
    for side in range(2):
        size = 0
        for step in range(n + 1):
            i = order[n - step] if side else order[step]
            while size > 1 and not _turns_left(px, py, chain[size - 2], chain[size - 1], i):
                size -= 1
            chain[size] = i
            size += 1
        is_corner[chain[:size]] = True
    return np.flatnonzero(is_corner[:n])


@njit(cache=True, nogil=True, error_model="numpy")
def _turns_left(x, y, a, b, c):
    """Whether a to b to c turns left, by more than rounding."""
    ux, uy, vx, vy = x[b] - x[a], y[b] - y[a], x[c] - x[b], y[c] - y[b]
    return ux * vy - uy * vx > STRAIGHT * (abs(ux) + abs(uy)) * (abs(vx) + abs(vy))
