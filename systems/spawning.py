"""Places of newborn animals: inside their area, on free ground, touching no other animal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import sincos_
from flockbrush.engine.noise import uniform_
from flockbrush.engine.seam import images
from flockbrush.systems.contact import edge_segment_, edges_near, nearest_of_segments_
from flockbrush.systems.terrain import point_in_polygon
from flockbrush.systems.visibility import Edges
from numba import njit

TRIES = 400  # places looked at for each animal before giving up
RINGS = 400  # of a radius each, looked through for a place nearby


class NoRoom(ValueError):
    """Fewer animals fit than were asked for."""

    def __init__(self, fitted, wanted):
        super().__init__(f"only {fitted} of {wanted} animals fit")
        self.fitted, self.wanted = fitted, wanted


class FreeGround(NamedTuple):
    """Where bodies may stand."""

    edges: Edges  # of obstacles
    blocked: np.ndarray  # (ny, nx) bool: impassable cells
    cell: float  # m
    points: np.ndarray  # (m, 2) m: corners of solid polygons; cells may be coarser than an obstacle
    first: np.ndarray  # (k + 1,) of these points, by polygon
    bounds: tuple[float, float, float, float]  # m: west, south, east, north; no animal stands outside


class Capsules(NamedTuple):
    """Bodies, (n,) each."""

    x: np.ndarray  # m
    y: np.ndarray
    fx: np.ndarray  # heading, a unit vector
    fy: np.ndarray
    half: np.ndarray  # m, half the length of the axis
    radius: np.ndarray  # m


class Newborns(NamedTuple):
    """Who is to be put down, and how."""

    polygon: np.ndarray  # (k, 2) m
    box: tuple[float, float, float, float]  # m: west, south, east, north of the polygon
    half: np.ndarray  # (count,) m
    radius: np.ndarray  # (count,) m
    heading: float  # radians; nan: each its own
    inner: float  # radius of the hole over that of the disc, of herds that turn about a middle; else nan
    spots: np.ndarray  # (s, 2) m: places to stand, in order; none: at random
    key: np.uint64


class Crowd(NamedTuple):
    """Bodies with a table of lists by cell, folded."""

    bodies: Capsules
    head: np.ndarray  # (a power of two,) int32: the first body of each list, or -1
    link: np.ndarray  # (n,) int32: the next one
    side: float  # m, of a cell: no body is longer


def free_ground(edges, blocked, cell, polygons=(), bounds=(-np.inf, -np.inf, np.inf, np.inf)):
    """`FreeGround` outside of polygons [(k, 2)], metres."""
    first = np.cumsum([0] + [len(polygon) for polygon in polygons])
    points = np.ascontiguousarray(np.concatenate([np.zeros((0, 2)), *polygons]))
    return FreeGround(edges, blocked, float(cell), points, first, tuple(map(float, bounds)))


INNER = {"ring": 0.4, "mill": 0.0}  # radius of the hole over that of the disc, of herds that turn about a middle


def place(polygon, count, length, radius, heading, formation, key, ground, others=None):
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
    ground : FreeGround
    others : Capsules, optional
        Animals already there.

    Returns
    -------
    xy, forward : ndarray (count, 2)

    Raises
    ------
    NoRoom
    """
    polygon = np.ascontiguousarray(polygon, float)
    if others is None:
        others = Capsules(*np.zeros((6, 0)))
    aim = np.nan if heading is None else float(heading)
    spots = np.zeros((0, 2))
    length, radius = (np.broadcast_to(np.asarray(size, float), count) for size in (length, radius))
    longest = float(np.maximum(length, 2 * radius).max(initial=0.0)) or 1.0
    if formation in ("grid", "line"):
        spots = _lattice(polygon, count, longest * 1.001, 0.0 if heading is None else aim, formation)
    box, half = (*map(float, polygon.min(0)), *map(float, polygon.max(0))), np.maximum(0.5 * length - radius, 0.0)
    newborns = Newborns(polygon, box, half, radius + 0.0, aim, INNER.get(formation, np.nan), spots, key)
    crowd = _crowd(others, count, max(longest, 2.0 * float((others.half + others.radius).max(initial=0.0))))
    xy, forward = np.empty((count, 2)), np.empty((count, 2))
    fitted = _fill(newborns, ground, crowd, len(others.x), xy, forward)
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


def _crowd(others, count, side):
    """A `Crowd` of these bodies with room for more; its table is empty."""
    total = len(others.x) + count
    bodies = Capsules(*(np.concatenate([column, np.empty(count)]) for column in others))
    head = np.full(1 << max(2 * total - 1, 1).bit_length(), -1, np.int32)
    return Crowd(bodies, head, np.empty(total, np.int32), side)


@njit(cache=True, error_model="numpy")
def _fill(newborns, ground, crowd, n, xy, forward):
    """Put animals down one after the other into a crowd of n; returns how many found a place."""
    bodies, spots = crowd.bodies, newborns.spots
    west, south, east, north = newborns.box
    for k in range(n):
        _enter(crowd, k)
    spot = 0
    for k in range(len(xy)):
        half, radius = newborns.half[k], newborns.radius[k]
        x = y = ux = uy = 0.0
        found = False
        for t in range(TRIES):
            if len(spots):
                if spot == len(spots):
                    break
                x, y = spots[spot, 0], spots[spot, 1]
                spot += 1
            else:
                x = west + (east - west) * uniform_(newborns.key, k, 3 * t)
                y = south + (north - south) * uniform_(newborns.key, k, 3 * t + 1)
            found, ux, uy = _heading(newborns, x, y, uniform_(newborns.key, k, 3 * t + 2))
            found = found and _stands(ground, x, y, ux, uy, half, radius)
            found = found and _is_free(crowd, x, y, ux, uy, half, radius)
            if found:
                break
        if not found:
            return k
        bodies.x[n], bodies.y[n], bodies.fx[n], bodies.fy[n] = x, y, ux, uy
        bodies.half[n], bodies.radius[n] = half, radius
        _enter(crowd, n)
        n += 1
        xy[k, 0], xy[k, 1], forward[k, 0], forward[k, 1] = x, y, ux, uy
    return len(xy)


@njit(cache=True, error_model="numpy")
def _heading(newborns, x, y, chance):
    """(whether a newborn may be there, its heading): in the polygon and, about a middle, on the ring."""
    west, south, east, north = newborns.box
    dx, dy = x - 0.5 * (west + east), y - 0.5 * (south + north)
    d, outer = np.sqrt(dx * dx + dy * dy), 0.5 * min(east - west, north - south)
    turning = not np.isnan(newborns.inner)
    inside = point_in_polygon(x, y, newborns.polygon) and not (turning and (d < newborns.inner * outer or d > outer))
    if turning and d > 0.0:
        return inside, -dy / d, dx / d
    uy, ux = sincos_(2.0 * np.pi * chance if np.isnan(newborns.heading) else newborns.heading)
    return inside, ux, uy


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_free(px, py, ux, uy, half, radius, ground, others):
    """The nearest place where a body stands free, looking outwards in rings: (found, x, y)."""
    for ring in range(RINGS):
        for k in range(max(8 * ring, 1)):
            sine, cosine = sincos_(2.0 * np.pi * k / max(8 * ring, 1))
            x, y = px + ring * radius * cosine, py + ring * radius * sine
            free = _stands(ground, x, y, ux, uy, half, radius)
            for j in range(len(others.x) if free else 0):
                if overlaps_(x, y, ux, uy, half, radius + 1e-6, others, j):
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
            cx, cy, vx, vy, p = edge_segment_(edges, e)
            gx, gy = nearest_of_segments_(
                xyz[i, 0], xyz[i, 1], forward[i, 0], forward[i, 1], half[i], cx, cy, vx, vy, p
            )
            out[i] |= gx * gx + gy * gy < radius[i] * radius[i]
    return out


def inside_polygon(xyz, polygon, wrap=None):
    """(n,) bool, who stands in a polygon (k, 2) m, which reaches over the borders of a map of size ``wrap``."""
    out = np.zeros(len(xyz), np.bool_)
    for way in images(polygon, wrap):
        _inside_too(xyz, polygon + way, out)
    return out


@njit(cache=True, nogil=True)
def _inside_too(xyz, polygon, out):
    """Note who stands in a polygon."""
    for i in range(len(xyz)):
        out[i] |= point_in_polygon(xyz[i, 0], xyz[i, 1], polygon)


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


@njit(inline="always")
def overlaps_(x, y, ux, uy, half, radius, bodies, k):
    """Whether a body meets the k-th of others."""
    bx, by, vx, vy, p = bodies.x[k], bodies.y[k], bodies.fx[k], bodies.fy[k], bodies.half[k]
    gx, gy = nearest_of_segments_(x, y, ux, uy, half, bx, by, vx, vy, p)
    touch = radius + bodies.radius[k]
    return gx * gx + gy * gy < touch * touch


@njit(cache=True, error_model="numpy")
def _enter(crowd, k):
    """Enter the k-th body into the table."""
    bodies, side = crowd.bodies, crowd.side
    b = _bucket(int(np.floor(bodies.x[k] / side)), int(np.floor(bodies.y[k] / side)), len(crowd.head))
    crowd.link[k], crowd.head[b] = crowd.head[b], k


@njit(cache=True, error_model="numpy")
def _is_free(crowd, x, y, ux, uy, half, radius):
    """Whether a body touches no other of a crowd."""
    cx, cy = int(np.floor(x / crowd.side)), int(np.floor(y / crowd.side))
    for iy in range(cy - 1, cy + 2):
        for ix in range(cx - 1, cx + 2):
            k = crowd.head[_bucket(ix, iy, len(crowd.head))]
            while k >= 0:
                if overlaps_(x, y, ux, uy, half, radius + 1e-6, crowd.bodies, k):
                    return False
                k = crowd.link[k]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _stands(ground, x, y, ux, uy, half, radius):
    """Whether a body stands on free ground."""
    west, south, east, north = ground.bounds
    if not (west <= x <= east and south <= y <= north) or _inside_any(x, y, ground.points, ground.first):
        return False
    ix, iy, blocked = int(np.floor(x / ground.cell)), int(np.floor(y / ground.cell)), ground.blocked
    if 0 <= ix < blocked.shape[1] and 0 <= iy < blocked.shape[0] and blocked[iy, ix]:
        return False
    e0, e1 = edges_near(x, y, ground.edges)
    for e in range(e0, e1):
        cx, cy, vx, vy, p = edge_segment_(ground.edges.ends, ground.edges.item[e])
        gx, gy = nearest_of_segments_(x, y, ux, uy, half, cx, cy, vx, vy, p)
        touch = radius + 1e-6
        if gx * gx + gy * gy < touch * touch:
            return False
    return True
