"""Moving bodies that never overlap and never enter an obstacle.

Each animal wants to turn its body and to step forward.  First, bodies whose
wishes overlap push one another, half each.  Then every animal keeps to its
side: between two bodies that are apart lies a strip of free ground, and if
neither crosses the middle of it they cannot meet, whatever the other does.
So the step is projected onto half-planes (one per neighbour, one per obstacle
edge), and shortened where that is not enough.  Standing still is always
allowed: whoever starts free stays free, to the last bit, on any number of
threads.

The half-planes are those of buffered Voronoi cells [1]_, here for turning
capsules: the support of a capsule with axis h f and radius r along a unit
vector n is ``h |f·n| + r``.

.. [1] Zhou, D., Wang, Z., Bandyopadhyay, S. & Schwager, M. (2017). Fast, on-line collision avoidance for dynamic
   vehicles using buffered Voronoi cells. IEEE Robotics and Automation Letters 2(2), 1047-1054.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.maths import sincos_
from engine.parallel import over_rows

SLACK = 1e-9  # m, of room kept free against rounding
SWEEPS = 6  # projections onto the half-planes before the step is shortened


def move(cells, forward, wish, speed, max_turn, edges, dt, pushes=2):
    """Turn and step a whole herd.

    Parameters
    ----------
    cells : Cells
        The herd as it is.
    forward, wish : ndarray (n, 3)
        Unit headings: as they are and as the models wish them.
    speed : ndarray (n,)
        Metres per second the animal tries to do.
    max_turn : ndarray (n,)
        Radians per second.
    edges : Edges
        Solid edges of obstacles.
    dt : float
        Seconds.
    pushes : int
        Rounds of pushing.

    Returns
    -------
    step : ndarray (n, 2)
        Metres to go.
    heading : ndarray (n, 2)
        The new unit heading.
    """
    n = len(forward)
    reach = _contact_reach(cells, speed, dt)
    near, count = _contacts(cells, reach, n)
    step, heading = np.zeros((n, 2)), np.zeros((n, 2))
    over_rows(_turn, n, cells.slot, *_bodies(cells), forward, wish, speed, max_turn, *edges, dt, step, heading)
    for _ in range(pushes):
        pushed = np.empty_like(step)
        over_rows(_push, n, *_bodies(cells), cells.row, cells.slot, near, count, step, heading, pushed)
        step = pushed
    safe, turned = np.empty_like(step), np.empty_like(heading)
    over_rows(_keep_to_own_side, n, *_bodies(cells), cells.slot, near, count, *edges, step, heading, safe, turned)
    return safe, turned


def _bodies(cells):
    return cells.x, cells.y, cells.fx, cells.fy, cells.half, cells.radius


def _contact_reach(cells, speed, dt):
    if not len(cells.x):
        return 0.0
    body = float((cells.half + cells.radius).max())
    # both may step towards each other, and be pushed as far again
    return 2.0 * body + 4.0 * dt * float(speed.max()) + 4 * SLACK


def _contacts(cells, reach, n, width=16):
    """Slots of the bodies that could be met in this tick, by row."""
    count = np.zeros(n, np.int32)
    while True:
        near = np.empty((n, width), np.int32)
        grid = cells.start, cells.nx, cells.ny, cells.cell, cells.west, cells.south
        over_rows(_find_contacts, n, cells.x, cells.y, cells.slot, *grid, reach, near, count)
        most = int(count.max()) if n else 0
        if most <= width:
            return near, count
        width = 1 << most.bit_length()


@njit(cache=True, nogil=True, error_model="numpy")
def _find_contacts(lo, hi, x, y, slot, start, nx, ny, cell, west, south, reach, near, count):
    width, reach2 = near.shape[1], reach * reach
    for i in range(lo, hi):
        s = slot[i]
        xi, yi = x[s], y[s]
        r0, r1 = max(0, int((yi - reach - south) / cell)), min(ny - 1, int((yi + reach - south) / cell))
        c0, c1 = max(0, int((xi - reach - west) / cell)), min(nx - 1, int((xi + reach - west) / cell))
        found = 0
        for r in range(r0, r1 + 1):
            for j in range(start[r * nx + c0], start[r * nx + c1 + 1]):
                dx, dy = x[j] - xi, y[j] - yi
                if dx * dx + dy * dy < reach2 and j != s:
                    if found < width:
                        near[i, found] = j
                    found += 1
        count[i] = found


@njit(inline="always")
def _nearest(ax, ay, ux, uy, p, bx, by, vx, vy, q):
    """Nearest points of two segments: centre, unit direction, half length of each.  Returns their offset, a to b."""
    wx, wy = bx - ax, by - ay
    uv = ux * vx + uy * vy
    wu, wv = wx * ux + wy * uy, wx * vx + wy * vy
    across = 1.0 - uv * uv
    s = 0.0
    if across > 1e-12:
        s = (wu - uv * wv) / across
    s = min(max(s, -p), p)
    t = min(max(s * uv - wv, -q), q)
    s = min(max(t * uv + wu, -p), p)
    t = min(max(s * uv - wv, -q), q)
    return wx + t * vx - s * ux, wy + t * vy - s * uy


@njit(inline="always")
def _edge(ends, g):
    """Centre, unit direction and half length of an edge."""
    ux, uy = ends[g, 2] - ends[g, 0], ends[g, 3] - ends[g, 1]
    size = np.sqrt(ux * ux + uy * uy)
    if size > 0.0:
        ux, uy = ux / size, uy / size
    return 0.5 * (ends[g, 0] + ends[g, 2]), 0.5 * (ends[g, 1] + ends[g, 3]), ux, uy, 0.5 * size


@njit(inline="always")
def _edges_near(x, y, start, nx, ny, cell, west, south):
    """First and last entry of the list of edges near a point."""
    ex, ey = (x - west) / cell, (y - south) / cell
    if ex >= 0.0 and ey >= 0.0 and ex < nx and ey < ny:
        c = int(ey) * nx + int(ex)
        return start[c], start[c + 1]
    return 0, 0


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(
    lo, hi, slot, x, y, fx, fy, half, radius, forward, wish, speed, max_turn,
    ends, estart, eitem, enx, eny, ecell, ewest, esouth,
    dt, step, heading,
):  # fmt: skip
    """The heading within the limit of turning, along a wall that stands in the way, and the step wished for."""
    for i in range(lo, hi):
        s = slot[i]
        gx, gy = wish[i, 0], wish[i, 1]
        ahead = speed[i] * dt
        e0, e1 = _edges_near(x[s], y[s], estart, enx, eny, ecell, ewest, esouth)
        for e in range(e0, e1):
            cx, cy, ux, uy, p = _edge(ends, eitem[e])
            nx, ny = _nearest(x[s], y[s], fx[s], fy[s], half[s], cx, cy, ux, uy, p)
            d = np.sqrt(nx * nx + ny * ny)
            if d <= 1e-12 or d > radius[s] + 2.0 * ahead + 0.25 * radius[s]:
                continue
            nx, ny = nx / d, ny / d
            into = gx * nx + gy * ny
            if into > 0.0:
                gx, gy = gx - into * nx, gy - into * ny
                if gx * gx + gy * gy < 1e-6:  # head on: to the side the body leans to
                    side = 1.0 if fx[s] * ny - fy[s] * nx <= 0.0 else -1.0
                    gx, gy = -ny * side, nx * side
        size = np.sqrt(gx * gx + gy * gy)
        if size <= 1e-12:
            gx, gy, size = fx[s], fy[s], 1.0
        gx, gy = gx / size, gy / size
        limit = max_turn[i] * dt
        if limit < np.pi:
            sine, cosine = sincos_(limit)
            if fx[s] * gx + fy[s] * gy < cosine:
                if fx[s] * gy - fy[s] * gx < 0.0:
                    sine = -sine
                gx, gy = fx[s] * cosine - fy[s] * sine, fx[s] * sine + fy[s] * cosine
                size = np.sqrt(gx * gx + gy * gy)
                gx, gy = gx / size, gy / size
        heading[i, 0], heading[i, 1] = gx, gy
        step[i, 0], step[i, 1] = ahead * gx, ahead * gy


@njit(cache=True, nogil=True, error_model="numpy")
def _push(lo, hi, x, y, fx, fy, half, radius, row, slot, near, count, step, heading, pushed):
    """Half of every overlap that the wished poses would have."""
    for i in range(lo, hi):
        s = slot[i]
        xi, yi = x[s] + step[i, 0], y[s] + step[i, 1]
        px = py = 0.0
        for k in range(count[i]):
            t = near[i, k]
            j = row[t]
            touch = radius[s] + radius[t]
            dx, dy = x[t] + step[j, 0] - xi, y[t] + step[j, 1] - yi
            far = touch + half[s] + half[t]
            if dx * dx + dy * dy >= far * far:
                continue
            nx, ny = _nearest(
                0.0, 0.0, heading[i, 0], heading[i, 1], half[s], dx, dy, heading[j, 0], heading[j, 1], half[t]
            )
            d2 = nx * nx + ny * ny
            if d2 >= touch * touch:
                continue
            d = np.sqrt(d2)
            if d < 1e-9:  # axes cross: apart along the line of centres, or by slot when that has no direction
                nx, ny = dx, dy
                d = np.sqrt(nx * nx + ny * ny)
                if d < 1e-9:
                    nx, ny, d = (1.0, 0.0, 1.0) if i < j else (-1.0, 0.0, 1.0)
                px -= 0.5 * touch * nx / d
                py -= 0.5 * touch * ny / d
            else:
                px -= 0.5 * (touch - d) * nx / d
                py -= 0.5 * (touch - d) * ny / d
        # no farther than an animal can be shoved in one tick
        shove, most = np.sqrt(px * px + py * py), 0.5 * radius[s]
        if shove > most:
            px, py = px * most / shove, py * most / shove
        pushed[i, 0], pushed[i, 1] = step[i, 0] + px, step[i, 1] + py


@njit(cache=True, nogil=True, error_model="numpy")
def _keep_to_own_side(
    lo, hi, x, y, fx, fy, half, radius, slot, near, count,
    ends, estart, eitem, enx, eny, ecell, ewest, esouth,
    step, heading, safe, turned,
):  # fmt: skip
    """The nearest step to the wished one that stays on the animal's own side of everybody and everything."""
    room = 64
    nx, ny, free = np.empty(room), np.empty(room), np.empty(room)
    for i in range(lo, hi):
        s = slot[i]
        e0, e1 = _edges_near(x[s], y[s], estart, enx, eny, ecell, ewest, esouth)
        if count[i] + e1 - e0 > room:
            room = 2 * (count[i] + e1 - e0)
            nx, ny, free = np.empty(room), np.empty(room), np.empty(room)
        h = half[s]
        n = 0
        for k in range(count[i]):
            t = near[i, k]
            ox, oy = _nearest(x[s], y[s], fx[s], fy[s], h, x[t], y[t], fx[t], fy[t], half[t])
            d = np.sqrt(ox * ox + oy * oy)
            if d > 1e-12:
                nx[n], ny[n] = ox / d, oy / d
                free[n] = max(0.5 * (d - radius[s] - radius[t]) - SLACK, 0.0)
                n += 1
        for e in range(e0, e1):
            cx, cy, ux, uy, p = _edge(ends, eitem[e])
            ox, oy = _nearest(x[s], y[s], fx[s], fy[s], h, cx, cy, ux, uy, p)
            d = np.sqrt(ox * ox + oy * oy)
            if d > 1e-12:
                nx[n], ny[n] = ox / d, oy / d
                free[n] = max(d - radius[s] - SLACK, 0.0)
                n += 1
        gx, gy = heading[i, 0], heading[i, 1]
        sx, sy = step[i, 0], step[i, 1]
        done = False
        for attempt in range(3):
            if attempt == 1:  # half the turn
                gx, gy = gx + fx[s], gy + fy[s]
                size = np.sqrt(gx * gx + gy * gy)
                if size < 1e-9:
                    continue
                gx, gy = gx / size, gy / size
            elif attempt == 2:
                gx, gy = fx[s], fy[s]
            sx, sy = step[i, 0], step[i, 1]
            for _ in range(SWEEPS):
                done = True
                for k in range(n):
                    wider = h * (abs(gx * nx[k] + gy * ny[k]) - abs(fx[s] * nx[k] + fy[s] * ny[k]))
                    over = sx * nx[k] + sy * ny[k] + wider - free[k]
                    if over > 0.0:
                        sx -= (over + 1e-12) * nx[k]
                        sy -= (over + 1e-12) * ny[k]
                        done = False
                if done:
                    break
            if done:
                break
        if not done:
            share = 1.0
            for k in range(n):
                along = sx * nx[k] + sy * ny[k]
                if along > free[k]:
                    share = min(share, free[k] / along)
            sx, sy = share * sx, share * sy
        safe[i, 0], safe[i, 1] = sx, sy
        turned[i, 0], turned[i, 1] = gx, gy
