"""Where newborn animals stand: inside their area, on free ground, touching nobody."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.maths import sincos_
from flockbrush.engine.noise import uniform_
from flockbrush.systems.contact import _edge, _edges_near, _nearest
from flockbrush.systems.terrain import point_in_polygon
from numba import njit

TRIES = 400  # places looked at for each animal before giving up
RINGS = 400  # of a radius each, looked through for a place nearby


class NoRoom(ValueError):
    """Fewer animals fit than were asked for."""

    def __init__(self, fitted, wanted):
        super().__init__(f"only {fitted} of {wanted} animals fit")
        self.fitted, self.wanted = fitted, wanted


def outlines(polygons):
    """Polygons as one array of points (m, 2) and the first point of each, (k + 1,)."""
    first = np.cumsum([0] + [len(polygon) for polygon in polygons])
    points = np.concatenate([np.zeros((0, 2)), *polygons])
    return np.ascontiguousarray(points), first


NOTHING = outlines([])
INNER = {"ring": 0.4, "mill": 0.0}  # radius of the hole over that of the disc, of those who turn about a middle
EVERYWHERE = (-np.inf, -np.inf, np.inf, np.inf)


def place(
    polygon, count, length, radius, heading, formation, key, solid, blocked, cell, others=None, obstacles=NOTHING,
    bounds=EVERYWHERE,
):  # fmt: skip
    """Positions and headings for newborn animals.

    Parameters
    ----------
    polygon : ndarray (k, 2)
        Their area, metres.
    count : int
    length, radius : float or ndarray (count,)
        Their bodies, metres.
    heading : float or None
        Radians counter-clockwise from east; None: each its own.
    formation : {"scatter", "grid", "ring", "mill", "line"}
        At random; on a square lattice; at random on a ring or on a disc, turning counter-clockwise; abreast.
    key : uint64
        Noise key; animal k draws with number k.
    solid : Edges
        Obstacles' edges.
    blocked : ndarray (ny, nx) bool
        Ground on which nobody can stand, cells of ``cell`` metres.
    others : (x, y, fx, fy, length, radius) arrays, optional
        Animals already there.
    obstacles : (ndarray (m, 2), ndarray (k + 1,))
        Polygons nobody may stand in, from `outlines`: cells may be coarser than an obstacle.
    bounds : (west, south, east, north)
        Metres; nobody stands outside.

    Returns
    -------
    xy, forward : ndarray (count, 2)

    Raises
    ------
    NoRoom
    """
    polygon = np.ascontiguousarray(polygon, float)
    if others is None:
        others = tuple(np.zeros(0) for _ in range(6))
    low, high = polygon.min(0), polygon.max(0)
    aim = np.nan if heading is None else float(heading)
    spots = np.zeros((0, 2))
    length, radius = (np.broadcast_to(np.asarray(size, float), count) for size in (length, radius))
    longest = float(np.maximum(length, 2 * radius).max(initial=0.0)) or 1.0
    if formation in ("grid", "line"):
        spots = _lattice(polygon, count, longest * 1.001, 0.0 if heading is None else aim, formation)
    xy, forward = np.empty((count, 2)), np.empty((count, 2))
    side = max(longest, float(max(np.max(others[4], initial=0), 2 * np.max(others[5], initial=0))))
    fitted = _fill(
        polygon, low, high, count, np.maximum(0.5 * length - radius, 0.0), radius + 0.0, aim,
        INNER.get(formation, np.nan), spots, key, *solid, blocked, cell, side, *others, *obstacles, *bounds, xy,
        forward,
    )  # fmt: skip
    if fitted < count:
        raise NoRoom(fitted, count)
    return xy, forward


def _lattice(polygon, count, body, heading, formation):
    """At least ``count`` points on a square lattice turned to the heading, widest spacing that holds them."""
    along = np.array(sincos_(heading))[::-1]
    across = np.array([-along[1], along[0]])
    middle = polygon.mean(0)
    local = (polygon - middle) @ np.array([along, across]).T
    low, high = local.min(0), local.max(0)
    spacing = max(body, np.sqrt(np.prod(np.maximum(high - low, body)) / count))

    def lattice(u, v):
        points = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
        world = middle + points[:, :1] * along + points[:, 1:] * across
        return world[inside_polygon(world, polygon)]

    if formation == "line":  # ranks abreast, close together along the way
        step = max(body, (high - low)[1] / count)
        v = np.arange(low[1] + 0.5 * step, high[1], step)
        ranks, found = [np.zeros((0, 2))], 0
        for u in np.arange(high[0] - 0.5 * body, low[0], -body):
            ranks.append(lattice([u], v))
            found += len(ranks[-1])
            if found >= 4 * count:  # more than enough, also when some of the spots are taken
                break
        return np.concatenate(ranks)
    while True:
        u = np.arange(high[0] - 0.5 * spacing, low[0], -spacing)
        v = np.arange(low[1] + 0.5 * spacing, high[1], spacing)
        world = lattice(u, v)
        if len(world) >= count or spacing <= body:
            return world
        spacing = max(body, 0.97 * spacing)


@njit(cache=True, error_model="numpy")
def _fill(
    polygon, low, high, count, half, radius, aim, inner, spots, key,
    ends, start, item, nx, ny, ecell, west, south, blocked, cell, side,
    ox, oy, ofx, ofy, olength, oradius, points, first, least_x, least_y, most_x, most_y, xy, forward,
):  # fmt: skip
    """Put animals down one after the other; returns how many found a place."""
    total = len(ox) + count
    x, y, fx, fy = np.empty(total), np.empty(total), np.empty(total), np.empty(total)
    h, r = np.empty(total), np.empty(total)
    # a table of lists by cell, folded: cells of one body length
    size = 1
    while size < 2 * total:
        size *= 2
    head, link = np.full(size, -1, np.int32), np.empty(total, np.int32)
    n = 0
    for k in range(len(ox)):
        x[n], y[n], fx[n], fy[n], r[n] = ox[k], oy[k], ofx[k], ofy[k], oradius[k]
        h[n] = max(0.5 * olength[k] - oradius[k], 0.0)
        b = _bucket(int(np.floor(x[n] / side)), int(np.floor(y[n] / side)), size)
        link[n], head[b] = head[b], n
        n += 1
    middle_x, middle_y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    outer = 0.5 * min(high[0] - low[0], high[1] - low[1])
    fitted, spot = 0, 0
    for k in range(count):
        found = False
        for t in range(TRIES):
            if len(spots):
                if spot >= len(spots):
                    break
                px, py = spots[spot, 0], spots[spot, 1]
                spot += 1
            else:
                px = low[0] + (high[0] - low[0]) * uniform_(key, k, 3 * t)
                py = low[1] + (high[1] - low[1]) * uniform_(key, k, 3 * t + 1)
            if not point_in_polygon(px, py, polygon):
                continue
            if not (least_x <= px <= most_x and least_y <= py <= most_y) or _inside_any(px, py, points, first):
                continue
            dx, dy = px - middle_x, py - middle_y
            d = np.sqrt(dx * dx + dy * dy)
            turning = not np.isnan(inner)
            if turning and (d < inner * outer or d > outer):
                continue
            if turning and d > 0.0:
                ux, uy = -dy / d, dx / d
            else:
                a = aim
                if np.isnan(aim):
                    a = 2.0 * np.pi * uniform_(key, k, 3 * t + 2)
                uy, ux = sincos_(a)
            ix, iy = int(np.floor(px / cell)), int(np.floor(py / cell))
            if 0 <= ix < blocked.shape[1] and 0 <= iy < blocked.shape[0] and blocked[iy, ix]:
                continue
            if _is_free(px, py, ux, uy, half[k], radius[k], x, y, fx, fy, h, r, head, link, side, size) and _off_edges(
                px, py, ux, uy, half[k], radius[k], ends, start, item, nx, ny, ecell, west, south
            ):
                found = True
                break
        if not found:
            break
        x[n], y[n], fx[n], fy[n], h[n], r[n] = px, py, ux, uy, half[k], radius[k]
        b = _bucket(int(np.floor(px / side)), int(np.floor(py / side)), size)
        link[n], head[b] = head[b], n
        n += 1
        xy[k, 0], xy[k, 1], forward[k, 0], forward[k, 1] = px, py, ux, uy
        fitted += 1
    return fitted


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_free(
    px, py, ux, uy, half, radius, ends, start, item, nx, ny, ecell, west, south, blocked, cell, points, first,
    least_x, least_y, most_x, most_y, ox, oy, ofx, ofy, ohalf, oradius,
):  # fmt: skip
    """The nearest place where a body stands free, looking outwards in rings: (found, x, y)."""
    for ring in range(RINGS):
        for k in range(max(8 * ring, 1)):
            sine, cosine = sincos_(2.0 * np.pi * k / max(8 * ring, 1))
            x, y = px + ring * radius * cosine, py + ring * radius * sine
            if not (least_x <= x <= most_x and least_y <= y <= most_y) or _inside_any(x, y, points, first):
                continue
            ix, iy = int(np.floor(x / cell)), int(np.floor(y / cell))
            if 0 <= ix < blocked.shape[1] and 0 <= iy < blocked.shape[0] and blocked[iy, ix]:
                continue
            if not _off_edges(x, y, ux, uy, half, radius, ends, start, item, nx, ny, ecell, west, south):
                continue
            free = True
            for j in range(len(ox)):
                gx, gy = _nearest(x, y, ux, uy, half, ox[j], oy[j], ofx[j], ofy[j], ohalf[j])
                touch = radius + oradius[j] + 1e-6
                if gx * gx + gy * gy < touch * touch:
                    free = False
                    break
            if free:
                return True, x, y
    return False, px, py


@njit(cache=True, nogil=True, error_model="numpy")
def touching(xyz, forward, half, radius, edges):
    """(n,) bool, whose body touches one of the edges (k, 4)."""
    out = np.zeros(len(xyz), np.bool_)
    for i in range(len(xyz)):
        for e in range(len(edges)):
            cx, cy, vx, vy, p = _edge(edges, e)
            gx, gy = _nearest(xyz[i, 0], xyz[i, 1], forward[i, 0], forward[i, 1], half[i], cx, cy, vx, vy, p)
            out[i] |= gx * gx + gy * gy < radius[i] * radius[i]
    return out


@njit(cache=True, nogil=True)
def inside_polygon(xyz, polygon):
    """(n,) bool, who stands in a polygon (k, 2)."""
    out = np.empty(len(xyz), np.bool_)
    for i in range(len(xyz)):
        out[i] = point_in_polygon(xyz[i, 0], xyz[i, 1], polygon)
    return out


@njit(cache=True, nogil=True)
def _inside_any(x, y, points, first):
    """Whether a point is inside one of the polygons."""
    inside = False
    for k in range(len(first) - 1):
        inside = inside or point_in_polygon(x, y, points[first[k] : first[k + 1]])
    return inside


@njit(inline="always")
def _bucket(ix, iy, size):
    return (ix * 73856093 ^ iy * 19349663) & (size - 1)


@njit(cache=True, error_model="numpy")
def _is_free(px, py, ux, uy, half, radius, x, y, fx, fy, h, r, head, link, side, size):
    cx, cy = int(np.floor(px / side)), int(np.floor(py / side))
    for iy in range(cy - 1, cy + 2):
        for ix in range(cx - 1, cx + 2):
            k = head[_bucket(ix, iy, size)]
            while k >= 0:
                gx, gy = _nearest(px, py, ux, uy, half, x[k], y[k], fx[k], fy[k], h[k])
                touch = radius + r[k] + 1e-6
                if gx * gx + gy * gy < touch * touch:
                    return False
                k = link[k]
    return True


@njit(cache=True, error_model="numpy")
def _off_edges(px, py, ux, uy, half, radius, ends, start, item, nx, ny, ecell, west, south):
    e0, e1 = _edges_near(px, py, start, nx, ny, ecell, west, south)
    for e in range(e0, e1):
        cx, cy, vx, vy, p = _edge(ends, item[e])
        gx, gy = _nearest(px, py, ux, uy, half, cx, cy, vx, vy, p)
        touch = radius + 1e-6
        if gx * gx + gy * gy < touch * touch:
            return False
    return True
