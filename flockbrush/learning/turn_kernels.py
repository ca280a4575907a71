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

from flockbrush.engine.maths import atan2_, exp_, sincos_
from flockbrush.learning.rollout import Gates
from flockbrush.systems.contact import DEFLECT, SKIN, _nearest, towards_body_

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
                ox, oy = _nearest(
                    0.0, 0.0, forward[i, 0], forward[i, 1], half, x, y, forward[j, 0], forward[j, 1], half
                )
                room = np.sqrt(ox * ox + oy * oy) - 2.0 * radius
                free[i] = min(free[i], max(room / JAMMED, 0.0))


def is_inside(evidence, frames, reach):
    """Whether the surroundings of each sighting are inside the picture, if the picture shows only part of a herd.

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
    seen, fields, cut = evidence.sightings, evidence.fields, Gates.of(evidence.fields) is not None
    out = []
    for t in frames:
        xy = seen.xy[seen.of(t)]
        whole = np.ones(len(xy), bool)
        for way in np.arange(8) * np.pi / 4:
            row, column, inside = fields.cells_of(xy + reach * np.array([np.cos(way), np.sin(way)]))
            whole &= np.where(inside, fields.seen[t, row, column], not cut)
        out.append(whole)
    return np.concatenate(out) if out else np.zeros(0, bool)


class TurnLaw(NamedTuple):
    """Parameters of a turn other than theta."""

    sensitivity: float  # Ω, 1/s
    neighbour_range: float  # BL
    limit: float  # rad a tick
    drift: float  # rad, by which a turn wanders in a tick


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


@njit(cache=True, nogil=True, error_model="numpy")
def turn_kernel(lo, hi, turns, theta, law, turn, slope):
    """Predict turns over some ticks with the neighbours as observed, and their derivatives by theta.

    Parameters
    ----------
    lo, hi : int
        Rows of `Turns`.
    turns : Turns
    theta : (12,) ndarray
    law : TurnLaw
    turn : (k,) ndarray
        Output, rad.
    slope : (k, 12) ndarray
        Output: derivatives of `turn`.
    """
    forces, sums = _gaussians(theta), ForceSums(np.empty((4, 4)), np.empty((4, 4)))
    d, dx, dy = np.empty(12), np.empty(12), np.empty(12)
    gain, forward = turns.dt * law.sensitivity, turns.percept.forward
    for k in range(lo, hi):
        i = turns.rows[k]
        start = atan2_(forward[i, 1], forward[i, 0])
        angle = start
        d[:] = 0.0
        left, s = turns.ticks[k], 0
        while left > 1e-9:
            share = min(left, 1.0)  # a part of a tick turns by its part
            time = s * turns.dt
            fy, fx = sincos_(angle)
            sums.x[:], sums.y[:] = 0.0, 0.0
            _add_neighbours(sums, forces, turns, i, time, fx, fy, law.neighbour_range)
            _add_walls(sums, forces, turns, i, time, fx, fy)
            hx, hy = _next_heading(sums, forces, gain, fx, fy, d, dx, dy)
            if turns.radius > 0.0:
                hx, hy = _turned_aside(turns, i, time, fx, fy, hx, hy, dx, dy)
            size = hx * hx + hy * hy
            if size > 1e-24:
                change = atan2_(fx * hy - fy * hx, fx * hx + fy * hy)
                change, passed = _limited(change, law.limit, law.drift)
                angle += share * change
                for q in range(12):
                    d[q] += share * passed * ((hx * dy[q] - hy * dx[q]) / size - d[q])
            left -= share
            s += 1
        turn[k] = angle - start
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
def _add(sums, forces, f, x, y, d2, b):
    """Add a vector, weighted by the Gaussian (eq. 4) of squared distance (BL²) and bearing (rad), with derivatives."""
    w = exp_(-(d2 * forces.radial[f] + b * b * forces.angular[f]))
    px, py = w * x, w * y
    by_r, by_a, by_h = d2 * forces.by_radial[f], b * b * forces.by_angular[f], 2.0 * b * forces.angular[f]
    sums.x[f, 0] += px
    sums.y[f, 0] += py
    sums.x[f, 1] += px * by_r
    sums.y[f, 1] += py * by_r
    sums.x[f, 2] += px * by_a
    sums.y[f, 2] += py * by_a
    sums.x[f, 3] += px * by_h
    sums.y[f, 3] += py * by_h


@njit(inline="always")
def _add_neighbours(sums, forces, turns, i, time, fx, fy, reach):
    """Avoidance of all neighbours; cohesion and alignment with those of the same species."""
    percept, velocity, spin = turns.percept, turns.velocity, turns.spin
    for at in range(percept.first[i], percept.first[i + 1]):
        j = percept.near[at]
        x, y = percept.offset[at, 0], percept.offset[at, 1]
        if x * x + y * y > reach * reach:
            continue
        x += time * (velocity[j, 0] - velocity[i, 0])
        y += time * (velocity[j, 1] - velocity[i, 1])
        d2 = x * x + y * y
        b = atan2_(fx * y - fy * x, fx * x + fy * y)
        _add(sums, forces, 0, -x, -y, d2, b)
        if percept.species[i] != percept.species[j]:
            continue
        _add(sums, forces, 1, x, y, d2, b)
        gx, gy = percept.forward[j, 0], percept.forward[j, 1]
        if spin[j] != 0.0 and time > 0.0:
            sine, cosine = sincos_(spin[j] * time)
            gx, gy = cosine * gx - sine * gy, sine * gx + cosine * gy
        _add(sums, forces, 2, gx, gy, d2, b)


@njit(inline="always")
def _add_walls(sums, forces, turns, i, time, fx, fy):
    """Avoidance of the nearest points of obstacles."""
    percept, velocity = turns.percept, turns.velocity
    for at in range(percept.walls_first[i], percept.walls_first[i + 1]):
        x = percept.walls_offset[at, 0] - time * velocity[i, 0]
        y = percept.walls_offset[at, 1] - time * velocity[i, 1]
        _add(sums, forces, 3, -x, -y, x * x + y * y, atan2_(fx * y - fy * x, fx * x + fy * y))


@njit(inline="always")
def _next_heading(sums, forces, gain, fx, fy, d, dx, dy):
    """Eqs. 3 and 2: the next heading, and its derivatives in `dx` and `dy`, given those of the angle in `d`."""
    weight = forces.weight
    hx, hy, own_x, own_y = fx, fy, -fy, fx
    for f in range(4):
        hx += gain * weight[f] * sums.x[f, 0]
        hy += gain * weight[f] * sums.y[f, 0]
        own_x += gain * weight[f] * sums.x[f, 3]
        own_y += gain * weight[f] * sums.y[f, 3]
    for f in range(4):
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
