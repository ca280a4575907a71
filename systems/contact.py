"""Moving bodies that never overlap and never enter an obstacle.

Each animal wants to turn its body and to step forward.  Whoever touches
another in front turns along it rather than into it; bodies whose wishes
overlap push one another, half each.  Then every animal keeps to its side: a
line between two bodies that are apart moves along with both of them, and if
neither crosses it they cannot meet, whatever the other does.  So the step is
projected onto half-planes, one per neighbour and one per obstacle edge.  Who
cannot keep to all of them stands firm: his lines stay where they are, his
neighbours look again.  Standing still is allowed to the firm: whoever starts
free stays free, on any number of threads.

The half-planes are those of buffered Voronoi cells [1]_, here moving, and for
turning capsules: the support of a capsule with axis h f and radius r along a
unit vector n is ``h |f·n| + r``.

.. [1] Zhou, D., Wang, Z., Bandyopadhyay, S. & Schwager, M. (2017). Fast, on-line collision avoidance for dynamic
   vehicles using buffered Voronoi cells. IEEE Robotics and Automation Letters 2(2), 1047-1054.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import inner_kernel, sincos_
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.contact_candidates import contacts_within
from flockbrush.systems.grid import Cells
from flockbrush.systems.ground_height import Hills, shorten_on_slopes
from flockbrush.systems.sightline import step
from numba import njit

SLACK = 1e-9  # m, of room kept free against rounding
SKIN = 0.25  # of the radii: bodies push and turn aside this much before they touch.  By trial: .1 jams, .5 is loose
DEFLECT = 0.75  # of the heading into a body that is touched, taken away.  By trial: crowds jam from .3 downwards
PUSHES = 2  # rounds of pushing
ROUNDS = 8  # of looking again before all stand firm
PUSHED = 1.01  # times its top speed that an animal may be shoved
SWEEPS = 6  # projections onto the half-planes before the step is shortened


def move(cells, forward, wish, speed, max_turn, edges, dt, ghosts=np.inf, top=None, hills=None):
    """Turn and step a whole herd.

    Parameters
    ----------
    cells : Cells
        The herd as it is; whoever is in no cell does not move.
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
    ghosts : float
        How far across the seam of a wrapped map ``cells`` has copies, metres: who is faster than they allow is slowed.
    top : ndarray (n,), optional
        Metres per second that nobody exceeds, not even when others push.
    hills : Hills, optional
        The ground, where it is not level: there ``top`` is the speed along the ground, up or down, and nobody steps
        onto ground that is too steep for it.

    Returns
    -------
    Poses
        By row.
    """
    n = len(forward)
    order, (step, heading) = move_by_slot(cells, wish, speed, max_turn, edges, dt, ghosts, top, hills)
    if len(order) == n:  # everybody has a slot
        return Poses(step[cells.slot], heading[cells.slot])
    rows, steps, headings = cells.row[order], np.zeros((n, 2)), np.zeros((n, 2))
    steps[rows], headings[rows] = step[order], heading[order]
    return Poses(steps, headings)


def move_by_slot(cells, wish, speed, max_turn, edges, dt, ghosts=np.inf, top=None, hills=None):
    """As `move`: slots of the moved animals, and `Poses`."""
    m = len(cells.row)
    body, far = _bounds(cells)
    if ghosts < np.inf:
        speed = np.minimum(speed, max(ghosts - 2.0 * (body + far + SLACK), 0.0) / (4.0 * dt))
    far += 2.0 * dt * float(speed.max(initial=0.0))
    reach = 2.0 * (body + far + SLACK)  # farther animals cannot be met: none goes farther than ``far``
    # all by slot, so that neighbours in turn are neighbours in memory
    met = contacts_within(reach, cells)
    order = met.order
    wished, pushed = Poses(np.zeros((m, 2)), np.zeros((m, 2))), np.zeros((m, 2))
    over_rows(_turn, len(order), met, wish, speed, max_turn, edges, dt, wished)
    for _ in range(PUSHES):
        over_rows(_push, len(order), met, wished, far, pushed)
        wished, pushed = Poses(pushed, wished.heading), wished.step
    hills = hills if hills is None else hills._replace(steepest=hills.steepest[cells.row])
    within = None if top is None else Within(top[cells.row] * dt, cells, hills)
    if within is not None:
        within.shorten(order, wished.step)
    return order, _agree(met, edges, wished, far, within)


def _bounds(cells):
    """The longest body from its middle, and how far anybody may be shoved in a tick, m."""
    if not len(cells.x):
        return 0.0, 0.0
    body, radius = float((cells.half + cells.radius).max()), float(cells.radius.max())
    return body, min(SKIN * body, radius)


class Poses(NamedTuple):
    """Where everybody goes, by slot or by row."""

    step: np.ndarray  # (n, 2) m
    heading: np.ndarray  # (n, 2), unit vectors


class Within(NamedTuple):
    """Who may go how far, in space where the ground is not level."""

    most: np.ndarray  # (slots,) m
    cells: Cells
    hills: Hills | None  # by slot

    def shorten(self, order, step, slack=1.0):
        """(slots,) bool, whose steps (slots, 2) were too long; they are cut in place."""
        most = slack * self.most
        size = np.sqrt(step[:, 0] * step[:, 0] + step[:, 1] * step[:, 1])  # copies across a seam have no step
        over = size > most
        if over.any():
            step[over] *= (most[over] / size[over])[:, None]
        if self.hills is not None:
            cut = np.zeros(len(step), np.bool_)
            shorten_on_slopes(order, self.cells.x, self.cells.y, step, most, self.hills, cut)
            over |= cut
        return over


def _agree(met, edges, wished, far, within=None):
    """Steps that keep everybody on his side of lines which every two agree upon.

    At first the line between two bodies moves along with both of them, so that a crowd can stream and be pushed.
    Who cannot keep to all his lines stands firm: his lines stay where they are, and his neighbours look again.
    Likewise who would be shoved faster than he can go; firm, he may stay as he is.
    """
    m = len(wished.step)
    safe = Poses(np.zeros((m, 2)), np.empty((m, 2)))
    firm, fresh = np.zeros(m, np.uint8), np.ones(m, np.uint8)
    for again in range(ROUNDS + 1):
        if again == ROUNDS:
            fresh = 1 - firm
            firm[:] = 1
        stuck = np.zeros(m, np.uint8)
        over_rows(_keep_to_own_side, len(met.order), met, edges, wished, firm, fresh, stuck, far, safe)
        if within is not None:
            fast = within.shorten(met.order, safe.step.copy(), PUSHED)
            if fast.any():
                stays = fast & (firm > 0)
                safe.step[stays], safe.heading[stays] = 0.0, np.column_stack([met.fx, met.fy])[stays]
                stuck[fast & ~stays] = 1
        if not stuck.any():
            break
        firm |= stuck
        fresh = stuck
    return safe


@njit(inline="always")
def nearest_of_segments_(ax, ay, ux, uy, p, bx, by, vx, vy, q):
    """Nearest points of two segments: centre, unit direction, half length of each.  Returns their offset, a to b."""
    wx, wy = bx - ax, by - ay
    uv = ux * vx + uy * vy
    wu, wv = wx * ux + wy * uy, wx * vx + wy * vy
    cross = ux * vy - uy * vx
    s = 0.0
    if cross != 0.0:
        s = min(max((wx * vy - wy * vx) / cross, -p), p)
    t = min(max(s * uv - wv, -q), q)
    s = min(max(t * uv + wu, -p), p)
    t = min(max(s * uv - wv, -q), q)
    return wx + t * vx - s * ux, wy + t * vy - s * uy


@njit(inline="always")
def towards_body_(wx, wy, ux, uy, p, vx, vy, q, touch):
    """Offset of a body that may be touched, its size, and the share of a heading into it that is taken away.

    Segments as for `nearest_of_segments_`, their centres apart by (wx, wy); their bodies touch at ``touch``.  A share
    of 0 or less: it is not near enough.
    """
    x, y = nearest_of_segments_(0.0, 0.0, ux, uy, p, wx, wy, vx, vy, q)
    far = np.sqrt(x * x + y * y)
    share = DEFLECT * (1.0 - (far - touch) / (SKIN * touch))
    return x, y, far, share if far > 1e-12 else 0.0


@njit(inline="always")
def edge_segment_(ends, g):
    """Centre, unit direction and half length of an edge."""
    ux, uy = ends[g, 2] - ends[g, 0], ends[g, 3] - ends[g, 1]
    size = np.sqrt(ux * ux + uy * uy)
    if size > 0.0:
        ux, uy = ux / size, uy / size
    return 0.5 * (ends[g, 0] + ends[g, 2]), 0.5 * (ends[g, 1] + ends[g, 3]), ux, uy, 0.5 * size


@inner_kernel
def edges_near(x, y, edges):
    """First and last entry of the list of edges near a point."""
    ex, ey = (x - edges.west) / edges.cell, (y - edges.south) / edges.cell
    if ex >= 0.0 and ey >= 0.0 and ex < edges.nx and ey < edges.ny:
        c = int(ey) * edges.nx + int(ex)
        return edges.start[c], edges.start[c + 1]
    return 0, 0


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(lo, hi, met, wish, speed, max_turn, edges, dt, wished):
    """The heading within the limit of turning, along a wall that stands in the way, and the step wished for."""
    x, y, fx, fy = met.x, met.y, met.fx, met.fy
    half, radius, near, count = met.half, met.radius, met.near, met.count
    order, row, step, heading = met.order, met.row, wished.step, wished.heading
    ends, item = edges.ends, edges.item
    for o in range(lo, hi):
        s = order[o]
        i = row[s]
        gx, gy = wish[i, 0], wish[i, 1]
        ahead = speed[i] * dt
        for k in range(count[s]):
            t = near[s, k]
            touch = radius[s] + radius[t]
            far = (1.0 + SKIN) * touch + half[s] + half[t]
            if (x[t] - x[s]) ** 2 + (y[t] - y[s]) ** 2 >= far * far:
                continue
            wx, wy = x[t] - x[s], y[t] - y[s]
            ox, oy, d, room = towards_body_(wx, wy, fx[s], fy[s], half[s], fx[t], fy[t], half[t], touch)
            if room > 0.0:
                into = (gx * ox + gy * oy) / d
                if into > 0.0:
                    gx, gy = gx - room * into * ox / d, gy - room * into * oy / d
        e0, e1 = edges_near(x[s], y[s], edges)
        for e in range(e0, e1):
            cx, cy, ux, uy, p = edge_segment_(ends, item[e])
            nx, ny = nearest_of_segments_(x[s], y[s], fx[s], fy[s], half[s], cx, cy, ux, uy, p)
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
        heading[s, 0], heading[s, 1] = gx, gy
        step[s, 0], step[s, 1] = ahead * gx, ahead * gy


@njit(cache=True, nogil=True, error_model="numpy")
def _push(lo, hi, met, wished, far, pushed):
    """Half of every overlap that the wished poses would have."""
    x, y, half, radius, near, count = met.x, met.y, met.half, met.radius, met.near, met.count
    order, row, itself, step, heading = met.order, met.row, met.itself, wished.step, wished.heading
    for o in range(lo, hi):
        s = order[o]
        xi, yi = x[s] + step[s, 0], y[s] + step[s, 1]
        px = py = 0.0
        for k in range(count[s]):
            t = near[s, k]
            j = itself[t]
            touch = (1.0 + SKIN) * (radius[s] + radius[t])
            dx, dy = x[t] + step[j, 0] - xi, y[t] + step[j, 1] - yi
            apart = touch + half[s] + half[t]  # bounding discs
            if dx * dx + dy * dy >= apart * apart:
                continue
            nx, ny = nearest_of_segments_(
                0.0, 0.0, heading[s, 0], heading[s, 1], half[s], dx, dy, heading[j, 0], heading[j, 1], half[t]
            )
            d2 = nx * nx + ny * ny
            if d2 >= touch * touch:
                continue
            d = np.sqrt(d2)
            if d < 1e-9:  # axes cross: apart along the line of centres, or by row when that has no direction
                nx, ny = dx, dy
                d = np.sqrt(nx * nx + ny * ny)
                if d < 1e-9:
                    nx, ny, d = (1.0, 0.0, 1.0) if row[s] < row[j] else (-1.0, 0.0, 1.0)
                px -= 0.5 * touch * nx / d
                py -= 0.5 * touch * ny / d
            else:
                px -= 0.5 * (touch - d) * nx / d
                py -= 0.5 * (touch - d) * ny / d
        # no farther than an animal can be shoved in one tick
        shove, most = np.sqrt(px * px + py * py), 0.5 * radius[s]
        if shove > most:
            px, py = px * most / shove, py * most / shove
        px, py = step[s, 0] + px, step[s, 1] + py
        size = np.sqrt(px * px + py * py)
        if size > far:
            px, py = px * far / size, py * far / size
        pushed[s, 0], pushed[s, 1] = px, py


class Sides(NamedTuple):
    """Half-planes that a body keeps to: all its steps d with d · n <= free."""

    nx: np.ndarray  # (room,) unit vectors n
    ny: np.ndarray
    free: np.ndarray  # (room,) m


@njit(cache=True, nogil=True, error_model="numpy")
def _keep_to_own_side(lo, hi, met, edges, wished, firm, fresh, stuck, far, safe):
    """The nearest step to the wished one that stays on the animal's own side of everybody and everything."""
    x, y, order, itself, near, count = met.x, met.y, met.order, met.itself, met.near, met.count
    room = 64
    sides = Sides(np.empty(room), np.empty(room), np.empty(room))
    for o in range(lo, hi):
        s = order[o]
        anew = fresh[s]
        for k in range(count[s]):
            anew |= fresh[itself[near[s, k]]]
        if not anew:
            continue
        e0, e1 = edges_near(x[s], y[s], edges)
        if count[s] + e1 - e0 > room:
            room = 2 * (count[s] + e1 - e0)
            sides = Sides(np.empty(room), np.empty(room), np.empty(room))
        n = _sides_of_bodies(s, met, wished, firm, sides)
        n = _sides_of_edges(s, met, edges, e0, e1, n, sides)
        done, sx, sy, gx, gy = _step_within(s, met, wished, n, sides, far)
        if not done and not firm[s]:
            stuck[s] = 1
        elif not done:
            sx, sy = _shortened(sx, sy, n, sides, far)
        safe.step[s, 0], safe.step[s, 1] = sx, sy
        safe.heading[s, 0], safe.heading[s, 1] = gx, gy


@step
def _sides_of_bodies(s, met, wished, firm, sides):
    """Write the sides that the body in slot s keeps to beside others; returns how many."""
    x, y, fx, fy, half, radius = met.x, met.y, met.fx, met.fy, met.half, met.radius
    near, itself, step = met.near, met.itself, wished.step
    n = 0
    for k in range(met.count[s]):
        t = near[s, k]
        ox, oy = nearest_of_segments_(x[s], y[s], fx[s], fy[s], half[s], x[t], y[t], fx[t], fy[t], half[t])
        d = np.sqrt(ox * ox + oy * oy)
        if d > 1e-12:
            nx, ny = ox / d, oy / d
            gap = max(d - radius[s] - radius[t] - 2 * SLACK, 0.0)
            j = itself[t]
            both = 0.5 * ((step[s, 0] + step[j, 0]) * nx + (step[s, 1] + step[j, 1]) * ny)
            if firm[s] or firm[j]:
                both = min(max(both, -0.5 * gap), 0.5 * gap)
            sides.nx[n], sides.ny[n], sides.free[n] = nx, ny, 0.5 * gap + both
            n += 1
    return n


@step
def _sides_of_edges(s, met, edges, first, last, n, sides):
    """Write the sides that it keeps to of some edges, behind the n that there are; returns how many it keeps to."""
    x, y, fx, fy, half, radius = met.x[s], met.y[s], met.fx[s], met.fy[s], met.half[s], met.radius[s]
    for e in range(first, last):
        cx, cy, ux, uy, p = edge_segment_(edges.ends, edges.item[e])
        ox, oy = nearest_of_segments_(x, y, fx, fy, half, cx, cy, ux, uy, p)
        d = np.sqrt(ox * ox + oy * oy)
        if d > 1e-12:
            sides.nx[n], sides.ny[n], sides.free[n] = ox / d, oy / d, max(d - radius - SLACK, 0.0)
            n += 1
    return n


@step
def _step_within(s, met, wished, n, sides, far):
    """(whether it keeps to all n sides, its step, its heading): with the turn wished for, with half of it, or none."""
    fx, fy, h, wx, wy = met.fx[s], met.fy[s], met.half[s], wished.step[s, 0], wished.step[s, 1]
    nx, ny, free = sides
    gx, gy = wished.heading[s, 0], wished.heading[s, 1]
    sx, sy, done, attempt = wx, wy, False, 0
    while not done and attempt < 3:  # no `break`: with two ways out references to arrays are counted for every animal
        turns = True
        if attempt == 1:
            gx, gy = gx + fx, gy + fy
            size = np.sqrt(gx * gx + gy * gy)
            turns = size >= 1e-9
            if turns:
                gx, gy = gx / size, gy / size
        elif attempt == 2:
            gx, gy = fx, fy
        attempt += 1
        if turns:
            sx, sy, sweep = wx, wy, 0
            while not done and sweep < SWEEPS:
                sweep, done = sweep + 1, True
                for k in range(n):
                    wider = h * (abs(gx * nx[k] + gy * ny[k]) - abs(fx * nx[k] + fy * ny[k]))
                    over = sx * nx[k] + sy * ny[k] + wider - free[k]
                    if over > 0.0:
                        sx -= (over + 1e-12) * nx[k]
                        sy -= (over + 1e-12) * ny[k]
                        done = False
            done = done and sx * sx + sy * sy <= far * far * (1.0 + 1e-12)
    return done, sx, sy, gx, gy


@step
def _shortened(sx, sy, n, sides, far):
    """As much of a step as keeps to all n sides and is no longer than ``far``."""
    share = 1.0
    for k in range(n):
        along = sx * sides.nx[k] + sy * sides.ny[k]
        if along > sides.free[k]:
            share = min(share, sides.free[k] / along)
    size = np.sqrt(sx * sx + sy * sy)
    if share * size > far:
        share = far / size
    return share * sx, share * sy
