"""Where newborn animals stand: inside their area, on free ground, touching nobody."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.maths import sincos_
from engine.noise import uniform_
from systems.contact import _edge, _edges_near, _nearest
from systems.terrain import point_in_polygon

TRIES = 400  # places looked at for each animal before giving up


class NoRoom(ValueError):
    """Fewer animals fit than were asked for."""

    def __init__(self, fitted, wanted):
        super().__init__(f"only {fitted} of {wanted} animals fit")
        self.fitted, self.wanted = fitted, wanted


def place(polygon, count, length, radius, heading, formation, key, solid, blocked, cell, others=None):
    """Positions and headings for newborn animals.

    Parameters
    ----------
    polygon : ndarray (k, 2)
        Their area, metres.
    count : int
    length, radius : float
        Their bodies, metres.
    heading : float or None
        Radians counter-clockwise from east; None: each its own.
    formation : {"scatter", "grid", "ring", "line"}
        At random; on a square lattice; at random on a ring, turning counter-clockwise; abreast.
    key : uint64
        Noise key; animal k draws with number k.
    solid : Edges
        Obstacles' edges.
    blocked : ndarray (ny, nx) bool
        Ground on which nobody can stand, cells of ``cell`` metres.
    others : (x, y, fx, fy, length, radius) arrays, optional
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
        others = tuple(np.zeros(0) for _ in range(6))
    low, high = polygon.min(0), polygon.max(0)
    aim = np.nan if heading is None else float(heading)
    spots = np.zeros((0, 2))
    if formation in ("grid", "line"):
        spots = _lattice(polygon, count, max(length, 2 * radius) * 1.001, 0.0 if heading is None else aim, formation)
    xy, forward = np.empty((count, 2)), np.empty((count, 2))
    side = max(length, 2 * radius, float(max(np.max(others[4], initial=0), 2 * np.max(others[5], initial=0))))
    fitted = _fill(
        polygon, low, high, count, max(0.5 * length - radius, 0.0), radius, aim, formation == "ring", spots, key,
        *solid, blocked, cell, side, *others, xy, forward,
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
    while True:
        if formation == "line":  # ranks abreast, close together along the way
            step = np.array([body, max(body, (high - low)[1] / count)])
        else:
            step = np.array([spacing, spacing])
        u = np.arange(high[0] - 0.5 * step[0], low[0], -step[0])
        v = np.arange(low[1] + 0.5 * step[1], high[1], step[1])
        points = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
        world = middle + points[:, :1] * along + points[:, 1:] * across
        inside = np.array([point_in_polygon(x, y, polygon) for x, y in world], bool)
        if inside.sum() >= count or spacing <= body or formation == "line":
            return np.ascontiguousarray(world[inside])
        spacing = max(body, 0.97 * spacing)


@njit(cache=True, error_model="numpy")
def _fill(
    polygon, low, high, count, half, radius, aim, ring, spots, key,
    ends, start, item, nx, ny, ecell, west, south, blocked, cell, side,
    ox, oy, ofx, ofy, olength, oradius, xy, forward,
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
            dx, dy = px - middle_x, py - middle_y
            d = np.sqrt(dx * dx + dy * dy)
            if ring and (d < 0.4 * outer or d > outer):
                continue
            if ring:
                ux, uy = -dy / d, dx / d
            else:
                a = aim
                if np.isnan(aim):
                    a = 2.0 * np.pi * uniform_(key, k, 3 * t + 2)
                uy, ux = sincos_(a)
            ix, iy = int(np.floor(px / cell)), int(np.floor(py / cell))
            if 0 <= ix < blocked.shape[1] and 0 <= iy < blocked.shape[0] and blocked[iy, ix]:
                continue
            if _is_free(px, py, ux, uy, half, radius, x, y, fx, fy, h, r, head, link, side, size) and _off_edges(
                px, py, ux, uy, half, radius, ends, start, item, nx, ny, ecell, west, south
            ):
                found = True
                break
        if not found:
            break
        x[n], y[n], fx[n], fy[n], h[n], r[n] = px, py, ux, uy, half, radius
        b = _bucket(int(np.floor(px / side)), int(np.floor(py / side)), size)
        link[n], head[b] = head[b], n
        n += 1
        xy[k, 0], xy[k, 1], forward[k, 0], forward[k, 1] = px, py, ux, uy
        fitted += 1
    return fitted


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
