"""Shapes: from Tiled's pixels (y down, clockwise) to metres (y up, counter-clockwise)."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from flockbrush.engine.maths import sincos_
from flockbrush.systems.terrain import centroid

ROUND = 32  # corners of an ellipse

# where a tile object's (x, y) is on its picture, as fractions of width and height from the top left
ALIGNMENTS = {
    "unspecified": (0, 1),
    "topleft": (0, 0),
    "top": (0.5, 0),
    "topright": (1, 0),
    "left": (0, 0.5),
    "center": (0.5, 0.5),
    "right": (1, 0.5),
    "bottomleft": (0, 1),
    "bottom": (0.5, 1),
    "bottomright": (1, 1),
}


@cache
def circle():
    """Corners of the unit circle, (32, 2), clockwise on a screen: the same bits on every processor."""
    corners = [sincos_(2 * math.pi / ROUND * k)[::-1] for k in range(ROUND // 8 + 1)]
    corners += [(s, c) for c, s in corners[-2::-1]]  # mirrored, so that the circle is symmetric to the last bit
    corners += [(-s, c) for c, s in corners[1:]]
    corners += [(-c, -s) for c, s in corners[1:-1]]
    return np.array(corners)


def rectangle(w, h):
    """Corners of a w x h box from its top left, (4, 2) px."""
    return np.array([(0, 0), (w, 0), (w, h), (0, h)], float)


def ellipse(w, h):
    """The ellipse in a w x h box, (32, 2) px."""
    return (1 + circle()) * (w / 2, h / 2)


def capsule(w, h):
    """The box with its short sides made half circles, (34, 2) px."""
    r = min(w, h) / 2
    arc = circle()[: ROUND // 2 + 1] * r  # half a circle from +x over +y to -x
    if w >= h:
        turned = np.column_stack([arc[:, 1], -arc[:, 0]])  # from -y over +x to +y
        return np.vstack([turned + (w - r, r), -turned + (r, r)])
    return np.vstack([arc + (r, h - r), -arc + (r, r)])


def turn(points, degrees):
    """Points turned about (0, 0), clockwise on a screen with y down."""
    if degrees % 90 == 0:
        c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][int(degrees // 90) % 4]
    else:
        s, c = sincos_(degrees % 360 * (math.pi / 180))
    return points @ np.array([(c, s), (-s, c)])


def signed_area(polygon):
    """Area, positive counter-clockwise (y up)."""
    x, y = (polygon - polygon[0]).T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def span_area(polygon):
    """Twice the area of the largest triangle on its longest diagonal from the first corner: 0 for a line."""
    d = polygon - polygon[0]
    far = d[np.argmax((d**2).sum(axis=1))]
    return float(np.abs(far[0] * d[:, 1] - far[1] * d[:, 0]).max())


def counter_clockwise(polygon):
    """The polygon wound so that its area is positive."""
    return polygon if signed_area(polygon) >= 0 else polygon[::-1].copy()


def without_repeats(points, closed):
    """The points with those left out that repeat the one before."""
    if len(points) < 2:
        return points
    keep = np.ones(len(points), bool)
    keep[1:] = np.any(points[1:] != points[:-1], axis=1)
    if closed and np.array_equal(points[0], points[-1]):
        keep[-1] = False
    if not keep.any():
        keep[0] = True
    return points[keep]


def inner_point(polygon):
    """A point (2,) in a polygon: its centre of mass, or far from its edges where that lies outside, as in a ring."""
    middle = centroid(polygon)
    if inside(middle[None], polygon)[0]:
        return middle
    points = sample(polygon)
    return points[distance_to_line(points, polygon, loop=True)[0].argmax()]


def sign_of(goal):
    """Where the flag of a goal stands, (2,) m: at its place, or in its area."""
    polygon = getattr(goal, "polygon", None)
    return np.asarray(goal.xy if polygon is None else inner_point(polygon))


def distance_to_line(xy, points, loop=False):
    """(distances m, indices of the nearest segments) from points (..., 2) to a line through points (k, 2)."""
    points = np.asarray(points, float)
    if loop:
        points = np.vstack([points, points[:1]])
    a, d = points[:-1], np.diff(points, axis=0)
    from_start = np.asarray(xy, float)[..., None, :] - a
    along = np.clip((from_start * d).sum(-1) / np.maximum((d**2).sum(-1), 1e-12), 0, 1)
    away = np.hypot(*np.moveaxis(from_start - along[..., None] * d, -1, 0))
    return away.min(-1), away.argmin(-1)


def crossing(polygon):
    """Two edges that cross or touch without being neighbours, or None: (i, j).

    Edges are swept by their western ends, so that only those side by side are compared.
    """
    n = len(polygon)
    a, b = polygon, np.roll(polygon, -1, axis=0)
    west, east = np.minimum(a, b)[:, 0], np.maximum(a, b)[:, 0]
    order = np.argsort(west, kind="stable")
    for apart in range(1, n):
        i, j = order[:-apart], order[apart:]
        near = west[j] <= east[i]
        if not near.any():
            return None
        near &= ~np.isin(np.abs(i - j), (1, n - 1))
        i, j = i[near], j[near]
        hit = _touch(a[i], b[i], a[j], b[j])
        if hit.any():
            first = hit.argmax()
            return int(min(i[first], j[first])), int(max(i[first], j[first]))
    return None


def _touch(p, q, a, b):
    """Which segments pq meet their segments ab, (n,) bool."""
    overlap = np.all((np.minimum(a, b) <= np.maximum(p, q)) & (np.maximum(a, b) >= np.minimum(p, q)), axis=-1)
    return (_side(p, q, a) * _side(p, q, b) <= 0) & (_side(a, b, p) * _side(a, b, q) <= 0) & overlap


def _side(u, v, w):
    """1 where w is left of u -> v, -1 right, 0 on the line."""
    (ux, uy), (vx, vy), (wx, wy) = (np.moveaxis(k, -1, 0) for k in (u, v, w))
    return np.sign((vx - ux) * (wy - uy) - (vy - uy) * (wx - ux))


def inside(points, polygon):
    """Which points lie in the polygon, (n,) bool."""
    x, y = np.asarray(points, float).T
    within = np.zeros(len(x), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if ay != by:
            within ^= ((ay > y) != (by > y)) & (x < (bx - ax) * (y - ay) / (by - ay) + ax)
    return within


def sample(polygon, n=24):
    """Points spread over a polygon, up to about n x n, (m, 2)."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    x, y = (low[k] + (np.arange(n) + 0.5) / n * (high[k] - low[k]) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = grid[inside(grid, polygon)]
    return points if len(points) else centroid(polygon)[None]
