"""Hidden-point removal: who is visible among animals without bodies.

Katz, Tal and Basri [1]_ flip every point over a sphere about the viewpoint,
``p -> p + 2 (R - |p|) p / |p|``, so that what is near comes to lie far out.
Visible is who then lies on the convex hull of all flipped points and the
viewpoint.  No body, no radius of an animal: how much a point hides follows from
how near the points lie to one another, and from R.  The larger R, the more
points are visible.

.. [1] Katz, S., Tal, A. and Basri, R. (2007). Direct visibility of point sets. ACM Transactions on Graphics 26(3), 24.
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.arrays import order_, write_
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.visibility import Lists, visible_neighbours
from numba import njit
from scipy.spatial import ConvexHull, QhullError

RADIUS_FACTOR = 100.0  # by eye; larger sees more
STRAIGHT = 1e-12  # sine of a turn that counts as none
FLAT = 1e-9  # of the extent: thinner point sets are treated as lying in a plane, or in a line


def hidden_point_removal(points, viewpoint, radius_factor=RADIUS_FACTOR):
    """Points that are visible from a viewpoint.

    Parameters
    ----------
    points : array_like (n, 2) or (n, 3)
        Metres.
    viewpoint : array_like (2,) or (3,)
        Metres.
    radius_factor : float
        Radius R of the sphere, in distances of the farthest point, at least 1; larger sees more.

    Returns
    -------
    ndarray (k,)
        Indices of the visible, ascending.  Points at the viewpoint are visible.  Of points at one place all are
        visible or none.

    Raises
    ------
    ValueError
        When the shapes do not fit, a number is not finite or the factor is below 1.

    References
    ----------
    .. [1] Katz, S., Tal, A. and Basri, R. (2007). Direct visibility of point sets. ACM TOG 26(3), 24.
    """
    points, viewpoint = np.asarray(points, float), np.asarray(viewpoint, float)
    _check(points, viewpoint, radius_factor)
    away = points - viewpoint
    distance = np.linalg.norm(away, axis=1)
    there = np.flatnonzero(distance > 0)
    visible = distance == 0
    if len(there):
        places, place = np.unique(away[there], axis=0, return_inverse=True)
        on_hull = np.zeros(len(places), bool)
        on_hull[_on_hull(_flip(places, radius_factor))] = True
        visible[there] = on_hull[place.ravel()]
    return np.flatnonzero(visible)


def _check(points, viewpoint, radius_factor):
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise ValueError(f"points must be an array of shape (n, 2) or (n, 3), got shape {points.shape}")
    if viewpoint.shape != points.shape[1:]:
        raise ValueError(f"viewpoint must have {points.shape[1]} numbers, as the points, got shape {viewpoint.shape}")
    if not np.isfinite(points).all() or not np.isfinite(viewpoint).all():
        raise ValueError("points and viewpoint must be finite numbers")
    if not radius_factor >= 1:
        raise ValueError(f"radius_factor must be at least 1, got {radius_factor}")


def _flip(away, radius_factor):
    """Spherical flipping about the origin."""
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    return away * (2.0 * radius_factor * distance.max() / distance - 1.0)


def _on_hull(flipped):
    """Indices of points that are corners of the convex hull of all and the origin."""
    flipped = flipped / np.abs(flipped).max()
    if flipped.shape[1] == 2:
        return _corners(flipped[:, 0], flipped[:, 1])
    axes = np.linalg.svd(flipped, full_matrices=False)
    if len(flipped) < 3 or axes.S[2] < FLAT * axes.S[0]:  # a plane through the viewpoint
        flat = flipped @ axes.Vh[:2].T if len(axes.S) > 1 else np.c_[flipped @ axes.Vh[0], np.zeros(len(flipped))]
        return _corners(flat[:, 0].copy(), flat[:, 1].copy())
    with_viewpoint = np.vstack([flipped, np.zeros(3)])
    try:
        corners = ConvexHull(with_viewpoint).vertices
    except QhullError:  # all but flat: let Qhull move the points by a hair
        corners = ConvexHull(with_viewpoint, qhull_options="QJ").vertices
    return corners[corners < len(flipped)]


@njit(cache=True, nogil=True, error_model="numpy")
def _corners(x, y):
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


def visible_by_hpr(cells, view_range, cos_half_view, radius_factor=RADIUS_FACTOR, z=None):
    """Compressed lists of the neighbours of every animal that hidden-point removal leaves.

    Everybody in range takes part in the removal; who is outside the field of view is left out afterwards.

    Parameters
    ----------
    cells : Cells
        From `flockbrush.systems.grid.sort_into_cells`, with a reach of at least the largest range.
    view_range : ndarray (n,)
        Metres on the plane, by row.
    cos_half_view : ndarray (n,)
        Cosine of half the field of view, on the plane; -1 sees all round.
    radius_factor : float
        As in `hidden_point_removal`: R in distances of the farthest animal in range.
    z : ndarray (n,), optional
        Heights in metres, by row: then the removal is in space, some forty times slower.

    Returns
    -------
    Lists
        As from `flockbrush.systems.visibility.visible_neighbours`.
    """
    if not radius_factor >= 1:
        raise ValueError(f"radius_factor must be at least 1, got {radius_factor}")
    n = len(view_range)
    in_range = visible_neighbours(cells, view_range, np.full(n, -1.0), occlusion=False)
    in_view = visible_neighbours(cells, view_range, cos_half_view, occlusion=False)
    keep = np.zeros(len(in_range.near), np.bool_)
    if z is None:
        over_rows(_remove_hidden, n, in_range.first, in_range.offset, float(radius_factor), keep)
    else:
        for i in range(n):
            mine = slice(in_range.first[i], in_range.first[i + 1])
            offset = np.c_[in_range.offset[mine], z[in_range.near[mine]] - z[i]]
            keep[mine][hidden_point_removal(offset, np.zeros(3), radius_factor)] = True
    over_rows(_leave_out_of_view, n, in_range.first, in_range.near, in_view.first, in_view.near, keep)
    first = np.zeros(n + 1, np.int64)
    np.cumsum(np.bincount(np.repeat(np.arange(n), np.diff(in_range.first))[keep], minlength=n), out=first[1:])
    return Lists(first, in_range.near[keep], in_range.offset[keep])


@njit(cache=True, nogil=True, error_model="numpy")
def _remove_hidden(lo, hi, first, offset, radius_factor, keep):
    """`hidden_point_removal` on the plane, for the lists of rows lo to hi."""
    for i in range(lo, hi):
        a, b = first[i], first[i + 1]
        x, y = offset[a:b, 0].copy(), offset[a:b, 1].copy()
        distance = np.sqrt(x * x + y * y)
        far = distance.max() if b > a else 0.0
        for k in range(b - a):
            keep[a + k] = distance[k] == 0.0
            stretch = 2.0 * radius_factor * far / distance[k] - 1.0 if distance[k] > 0.0 else 0.0
            x[k] *= stretch
            y[k] *= stretch
        for k in _corners(x, y):
            keep[a + k] = True
        for k in range(b - a):  # those at the place of a visible one
            if not keep[a + k]:
                for other in range(b - a):
                    if keep[a + other] and offset[a + k, 0] == offset[a + other, 0]:
                        keep[a + k] |= offset[a + k, 1] == offset[a + other, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _leave_out_of_view(lo, hi, first, near, first_in_view, in_view, keep):
    """Both lists are in the same order, the one in view shorter."""
    for i in range(lo, hi):
        at = first_in_view[i]
        for k in range(first[i], first[i + 1]):
            if at < first_in_view[i + 1] and in_view[at] == near[k]:
                at += 1
            else:
                keep[k] = False
