"""Kernels that predict the turns of observed animals by the herd model, with derivatives for the fit.

The equations are those of `flockbrush.behaviours.models.herd` (Gong et al. 2025); theta (12,) holds weight, radial
range and angular range of avoidance, cohesion, alignment and obstacle avoidance, ranges in 0 to 1. Lengths are in body
lengths (BL).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from flockbrush.engine.lane_maths import exponential, lane_function, square_of_angle
from flockbrush.engine.lanes import EIGHT, fused, load8, pointer, root, splat8, store, total, totals, where
from flockbrush.engine.maths import atan2_, sincos_
from flockbrush.systems.contact import DEFLECT, SKIN, nearest_of_segments_, towards_body_

REACH = 4.0  # BL: a radial range of 1
ROOT_HALF, BELL = 0.5**0.5, (2 * np.pi) ** -0.5
JAMMED = 0.03  # BL of room between bodies below which one hinders the other in turning.  By trial


@njit(cache=True, nogil=True, error_model="numpy")
def room_kernel(percept, half, radius, free):
    """Lower `free` (n,) to the gap to the nearest body divided by `JAMMED`, 0 to 1; `half` and `radius` in BL."""
    forward, first, near, offset = percept.forward, percept.first, percept.near, percept.offset
    for i in range(len(free)):
        for at in range(first[i], first[i + 1]):
            x, y = offset[at, 0], offset[at, 1]
            far = 2.0 * (half + radius) + JAMMED
            if x * x + y * y < far * far:
                j = near[at]
                ox, oy = nearest_of_segments_(
                    0.0, 0.0, forward[i, 0], forward[i, 1], half, x, y, forward[j, 0], forward[j, 1], half
                )
                room = np.sqrt(ox * ox + oy * oy) - 2.0 * radius
                free[i] = min(free[i], max(room / JAMMED, 0.0))


def is_inside(evidence, frames, reach):
    """Whether the surroundings of each sighting are inside the picture, if the picture shows only part of a herd.

    A film whose edge nobody touches shows the whole herd, wherever the camera has not looked.

    Parameters
    ----------
    evidence : Evidence
    frames : iterable of int
    reach : float
        BL.

    Returns
    -------
    (n,) bool ndarray
        For all sightings of these frames, one after the other.
    """
    seen, fields, cut = evidence.sightings, evidence.fields, evidence.fields.shows_part
    if not cut and (fields.at_edge is not None or fields.seen.all()):
        return np.ones(sum(seen.first[t + 1] - seen.first[t] for t in frames), bool)
    out, ways = [], np.arange(8) * np.pi / 4
    around = reach * np.stack([np.cos(ways), np.sin(ways)], 1)
    for t in frames:
        row, column, inside = fields.cells_of((seen.xy[seen.of(t), None] + around).reshape(-1, 2))
        whole = np.where(inside, fields.seen[t, row, column], not cut)
        out.append(whole.reshape(-1, len(around)).all(1))
    return np.concatenate(out) if out else np.zeros(0, bool)


@njit(cache=True, nogil=True, error_model="numpy")
def spin_kernel(angle, spun):
    """Write the cosine and sine of each angle (n,), rad, to `spun` (n, 2)."""
    for j in range(len(angle)):
        spun[j, 1], spun[j, 0] = sincos_(angle[j])


class TurnLaw(NamedTuple):
    """Parameters of a turn other than theta."""

    sensitivity: float  # Ω, 1/s
    neighbour_range: float  # BL
    limit: float  # rad a tick
    drift: float  # rad, by which a turn wanders in a tick
    aside: float  # rad a tick, steady turning to the left


class Gaussians(NamedTuple):
    """The Gaussians of the four forces, (4,) each: avoidance, cohesion, alignment, obstacles."""

    weight: np.ndarray
    # -(d² radial + b² angular) is the exponent at a distance d and bearing b
    radial: np.ndarray
    angular: np.ndarray
    # of that exponent by the normalised ranges: d² by_radial and b² by_angular
    by_radial: np.ndarray
    by_angular: np.ndarray


class ForceSums(NamedTuple):
    """Sum of each force, and its derivatives by radial range, angular range and heading, (4, 4) each."""

    x: np.ndarray
    y: np.ndarray
    found: np.ndarray  # (8,) room for sums


# columns of neighbours, BL: where they begin, how they move, their headings and by how much these turn in a tick; 1
# where there is one; and where they are, their distance and bearing, squared and plain
X, Y, VX, VY, GX, GY, COSINE, SINE, THERE, AT_X, AT_Y, FAR2, ASIDE2, ASIDE = range(14)


@njit(cache=True, nogil=True, error_model="numpy")
def turn_kernel(lo, hi, turns, spun, theta, law, turn, slope):
    """Predict turns over some ticks with the neighbours as observed, and their derivatives by theta.

    Parameters
    ----------
    lo, hi : int
        Rows of `Turns`.
    turns : Turns
    spun : (n, 2) ndarray
        Cosine and sine of the angle by which each animal turns in a tick: `spin_kernel`.
    theta : (12,) ndarray
    law : TurnLaw
    turn : (k,) ndarray
        Output, rad.
    slope : (k, 12) ndarray
        Output: derivatives of `turn`; with three dimensions nothing is written.
    """
    forces, sloped = _gaussians(theta), slope.ndim == 2
    sums = ForceSums(np.zeros((4, 4)), np.zeros((4, 4)), np.empty(8))
    d, dx, dy = np.empty(12), np.empty(12), np.empty(12)
    gain, forward = turns.dt * law.sensitivity, turns.percept.forward
    social = sloped or forces.weight[:3].any()
    near = _columns(lo, hi, turns.rows, turns.percept.first)
    walls = _columns(lo, hi, turns.rows, turns.percept.walls_first)
    for k in range(lo, hi):
        i = turns.rows[k]
        start = atan2_(forward[i, 1], forward[i, 0])
        angle = start
        d[:] = 0.0
        left, s = turns.ticks[k], 0
        many = _gather_neighbours(near, turns, spun, i, law.neighbour_range) if social else 0
        many_walls = _gather_walls(walls, turns, i)
        while left > 1e-9:
            share = min(left, 1.0)  # a part of a tick turns by its part
            time = s * turns.dt
            fy, fx = sincos_(angle)
            if many:
                _look_again(pointer(near), near.shape[1], many, time, fx, fy, s > 0)
                _add(sums, forces, 0, near, many, AT_X, -1.0, sloped)
                _add(sums, forces, 1, near, many, AT_X, 1.0, sloped)
                _add(sums, forces, 2, near, many, GX, 1.0, sloped)
            else:
                sums.x[:3], sums.y[:3] = 0.0, 0.0
            if many_walls:
                _look_again(pointer(walls), walls.shape[1], many_walls, time, fx, fy, False)
                _add(sums, forces, 3, walls, many_walls, AT_X, -1.0, sloped)
            else:
                sums.x[3], sums.y[3] = 0.0, 0.0
            hx, hy = _next_heading(sums, forces, gain, law.aside, fx, fy, d, dx, dy, sloped)
            if turns.radius > 0.0:
                hx, hy = _turned_aside(turns, i, time, fx, fy, hx, hy, dx, dy)
            size = hx * hx + hy * hy
            if size > 1e-24:
                change = atan2_(fx * hy - fy * hx, fx * hx + fy * hy)
                change, passed = _limited(change, law.limit, law.drift)
                angle += share * change
                for q in range(12 if sloped else 0):
                    d[q] += share * passed * ((hx * dy[q] - hy * dx[q]) / size - d[q])
            left -= share
            s += 1
        turn[k] = angle - start
        if sloped:
            slope[k] = d


@njit(inline="always")
def _gaussians(theta):
    weight, r, a, by_r, by_a = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    for f in range(4):
        weight[f] = theta[3 * f]
        far, aside = REACH * theta[3 * f + 1], np.pi * theta[3 * f + 2]
        r[f], a[f] = 0.5 / far**2, 0.5 / aside**2
        by_r[f], by_a[f] = REACH / far**3, np.pi / aside**3
    return Gaussians(weight, r, a, by_r, by_a)


@njit(inline="always")
def _columns(lo, hi, rows, first):
    """Room for the columns of the most neighbours, or walls, that one of these rows has."""
    most = 1
    for k in range(lo, hi):
        most = max(most, first[rows[k] + 1] - first[rows[k]])
    return np.empty((ASIDE + 1, (most + 2 * EIGHT) // EIGHT * EIGHT | EIGHT))


@njit(inline="always")
def _gather_neighbours(columns, turns, spun, i, reach):
    """Write down the neighbours of a row in reach; their number."""
    percept, velocity, n = turns.percept, turns.velocity, 0
    for at in range(percept.first[i], percept.first[i + 1]):
        j = percept.near[at]
        x, y = percept.offset[at, 0], percept.offset[at, 1]
        if x * x + y * y > reach * reach:
            continue
        columns[X, n], columns[Y, n] = x, y
        columns[VX, n], columns[VY, n] = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
        columns[GX, n], columns[GY, n] = percept.forward[j, 0], percept.forward[j, 1]
        columns[COSINE, n], columns[SINE, n] = spun[j, 0], spun[j, 1]
        columns[THERE, n] = 1.0
        n += 1
    columns[:ASIDE, n : n + EIGHT] = 0.0  # behind the last stands nobody
    return n


@njit(inline="always")
def _gather_walls(columns, turns, i):
    """Write down the nearest points of walls of a row; their number."""
    percept, velocity, n = turns.percept, turns.velocity, 0
    for at in range(percept.walls_first[i], percept.walls_first[i + 1]):
        columns[X, n], columns[Y, n] = percept.walls_offset[at, 0], percept.walls_offset[at, 1]
        columns[VX, n], columns[VY, n] = -velocity[i, 0], -velocity[i, 1]
        columns[THERE, n] = 1.0
        n += 1
    columns[:ASIDE, n : n + EIGHT] = 0.0
    return n


@lane_function
def _look_again(column, step, n, time, fx, fy, on):
    """Where the neighbours are after a time; ``on``: their headings have turned for another tick."""
    for q in range(0, n, EIGHT):
        x = fused(load8(column, VX * step + q), splat8(time), load8(column, X * step + q))
        y = fused(load8(column, VY * step + q), splat8(time), load8(column, Y * step + q))
        cross = y * fx - x * fy
        aside2 = square_of_angle(cross, fused(x, splat8(fx), y * fy))
        aside = root(aside2)
        store(column, AT_X * step + q, x)
        store(column, AT_Y * step + q, y)
        store(column, FAR2 * step + q, fused(x, x, y * y))
        store(column, ASIDE2 * step + q, aside2)
        store(column, ASIDE * step + q, where(cross < 0.0, splat8(0.0) - aside, aside))
        if on:
            gx, gy = load8(column, GX * step + q), load8(column, GY * step + q)
            cosine, sine = load8(column, COSINE * step + q), load8(column, SINE * step + q)
            store(column, GX * step + q, cosine * gx - sine * gy)
            store(column, GY * step + q, sine * gx + cosine * gy)


@njit(inline="always")
def _add(sums, forces, f, columns, n, what, sign, sloped):
    """The sum of a force: two columns, weighed by its Gaussians (eq. 4)."""
    r, a = forces.radial[f], forces.angular[f]
    if not sloped:
        px, py = _weighed(pointer(columns), columns.shape[1], n, what, r, a)
        sums.x[f, 0], sums.y[f, 0] = sign * px, sign * py
        return
    found = pointer(sums.found)
    _weighed_and_sloped(pointer(columns), columns.shape[1], n, what, r, a, found)
    sums.x[f, 0], sums.y[f, 0] = sign * found[0], sign * found[1]
    sums.x[f, 1], sums.y[f, 1] = sign * found[2] * forces.by_radial[f], sign * found[3] * forces.by_radial[f]
    sums.x[f, 2], sums.y[f, 2] = sign * found[4] * forces.by_angular[f], sign * found[5] * forces.by_angular[f]
    sums.x[f, 3], sums.y[f, 3] = sign * found[6] * 2.0 * a, sign * found[7] * 2.0 * a


@lane_function
def _weighed(column, step, n, what, radial, angular):
    """Weighed sums of two columns."""
    px = py = splat8(0.0)
    for q in range(0, n, EIGHT):
        x, y, _, _ = _weighed_lanes(column, step, q, what, radial, angular)
        px, py = px + x, py + y
    return total(px), total(py)


@lane_function
def _weighed_and_sloped(column, step, n, what, radial, angular, found):
    """Weighed sums of two columns, plain and by the squared distance, the squared bearing, and the bearing."""
    px = py = rx = ry = ax = ay = hx = hy = splat8(0.0)
    for q in range(0, n, EIGHT):
        x, y, far2, aside2 = _weighed_lanes(column, step, q, what, radial, angular)
        px, py = px + x, py + y
        aside = load8(column, ASIDE * step + q)
        rx, ry, ax, ay = fused(x, far2, rx), fused(y, far2, ry), fused(x, aside2, ax), fused(y, aside2, ay)
        hx, hy = fused(x, aside, hx), fused(y, aside, hy)
    store(found, 0, totals((px, py, rx, ry, ax, ay, hx, hy)))


@lane_function
def _weighed_lanes(column, step, q, what, radial, angular):
    """Two columns weighed by a Gaussian, and what that is of: the squared distance and bearing."""
    far2, aside2 = load8(column, FAR2 * step + q), load8(column, ASIDE2 * step + q)
    w = load8(column, THERE * step + q) * exponential(splat8(0.0) - fused(far2, splat8(radial), aside2 * angular))
    return w * load8(column, what * step + q), w * load8(column, (what + 1) * step + q), far2, aside2


@njit(inline="always")
def _next_heading(sums, forces, gain, aside, fx, fy, d, dx, dy, sloped):
    """Eqs. 3 and 2: the wished heading, and its derivatives into ``dx`` and ``dy``, those of the angle being ``d``."""
    weight = forces.weight
    hx, hy, own_x, own_y = fx - aside * fy, fy + aside * fx, -fy - aside * fx, fx - aside * fy
    for f in range(4):
        hx += gain * weight[f] * sums.x[f, 0]
        hy += gain * weight[f] * sums.y[f, 0]
        own_x += gain * weight[f] * sums.x[f, 3]
        own_y += gain * weight[f] * sums.y[f, 3]
    for f in range(4 if sloped else 0):
        for c in range(3):
            scale = gain if c == 0 else gain * weight[f]
            dx[3 * f + c] = scale * sums.x[f, c] + own_x * d[3 * f + c]
            dy[3 * f + c] = scale * sums.y[f, c] + own_y * d[3 * f + c]
    return hx, hy


@njit(inline="always")
def _turned_aside(turns, i, time, fx, fy, hx, hy, dx, dy):
    """The heading after deflection by touching bodies, as in `flockbrush.systems.contact`, with derivatives."""
    percept, velocity, half, touch = turns.percept, turns.velocity, turns.half, 2.0 * turns.radius
    touch_far = ((1.0 + SKIN) * touch + 2.0 * half) ** 2
    for at in range(percept.first[i], percept.first[i + 1]):
        j = percept.near[at]
        x = percept.offset[at, 0] + time * (velocity[j, 0] - velocity[i, 0])
        y = percept.offset[at, 1] + time * (velocity[j, 1] - velocity[i, 1])
        if x * x + y * y >= touch_far:
            continue
        ox, oy, room = aside_of_(fx, fy, half, x, y, percept.forward[j, 0], percept.forward[j, 1], touch)
        into = hx * ox + hy * oy
        if into > 0.0:
            hx, hy = hx - room * into * ox, hy - room * into * oy
            for q in range(12):
                into = dx[q] * ox + dy[q] * oy
                dx[q] -= room * into * ox
                dy[q] -= room * into * oy
    return hx, hy


@njit(inline="always")
def aside_of_(fx, fy, half, x, y, gx, gy, touch):
    """Unit vector to a body at (x, y) BL, and the share of a heading towards it that contact removes; 0 when far.

    The bodies have headings (fx, fy) and (gx, gy) and axes of half-length `half`; `touch` is the distance at contact
    (BL).
    """
    ox, oy, far, room = towards_body_(x, y, fx, fy, half, gx, gy, half, touch)
    if room <= 0.0:
        return 0.0, 0.0, 0.0
    return ox / far, oy / far, min(room, DEFLECT)  # a film may show bodies one over the other


@njit(inline="always")
def _limited(change, limit, drift):
    """Expected turn (rad) after noise of standard deviation `drift` and a limit, and its derivative by the turn."""
    if drift <= 1e-9:
        if abs(change) <= limit:
            return change, 1.0
        return (limit if change > 0.0 else -limit), 0.0
    low, high = (-limit - change) / drift, (limit - change) / drift
    below, above = 0.5 * math.erfc(-low * ROOT_HALF), 0.5 * math.erfc(high * ROOT_HALF)
    bells = math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)
    inside = 1.0 - below - above
    return limit * (above - below) + change * inside + drift * bells * BELL, inside
