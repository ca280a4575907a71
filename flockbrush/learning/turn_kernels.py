"""Kernels of the turns that a model expects of animals."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from flockbrush.engine.maths import atan2_, exp_, sincos_
from flockbrush.learning.rollout import Gates
from flockbrush.systems.contact import DEFLECT, SKIN, _nearest, towards_body_

REACH = 4.0  # BL: a radial range of 1
ROOT_HALF, BELL = 0.5**0.5, (2 * np.pi) ** -0.5
JAMMED = 0.03  # BL of room between bodies below which one hinders the other in turning.  By trial


@njit(cache=True, nogil=True, error_model="numpy")
def room_kernel(forward, first, near, offset, half, radius, free):
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
    """(n,) bool: whose surroundings are in the picture as far as it sees, where the picture cuts a herd."""
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


@njit(cache=True, nogil=True, error_model="numpy")
def turn_kernel(
    lo, hi, rows, ticks, forward, species, first, near, offset, walls_first, walls_offset, velocity, spin,
    theta, dt, sensitivity, neighbour_range, limit, drift, half, radius,
    turn, slope,
):  # fmt: skip
    """Some ticks of the herd model with the neighbours as they were seen, and the derivatives of the heading."""
    gain = dt * sensitivity
    weight, r, a = np.empty(4), np.empty(4), np.empty(4)
    r_theta, a_theta = np.empty(4), np.empty(4)  # of -(d² r + b² a) by the normalised ranges: d² r_theta, b² a_theta
    for f in range(4):
        weight[f] = theta[3 * f]
        far, aside = REACH * theta[3 * f + 1], np.pi * theta[3 * f + 2]
        r[f], a[f] = 0.5 / far**2, 0.5 / aside**2
        r_theta[f], a_theta[f] = REACH / far**3, np.pi / aside**3
    # force, then its derivatives by radial range, angular range and the heading itself
    sx, sy = np.empty((4, 4)), np.empty((4, 4))
    d, dx, dy, by = np.empty(12), np.empty(12), np.empty(12), np.empty(4)
    touch = 2.0 * radius
    touch_far = ((1.0 + SKIN) * touch + 2.0 * half) ** 2
    for k in range(lo, hi):
        i = rows[k]
        start = atan2_(forward[i, 1], forward[i, 0])
        angle = start
        d[:] = 0.0
        left, s = ticks[k], 0
        while left > 1e-9:
            share = min(left, 1.0)  # a part of a tick turns by its part
            time = s * dt
            fy, fx = sincos_(angle)
            sx[:], sy[:] = 0.0, 0.0
            for at in range(first[i], first[i + 1]):
                j = near[at]
                x, y = offset[at, 0], offset[at, 1]
                if x * x + y * y > neighbour_range * neighbour_range:
                    continue
                x += time * (velocity[j, 0] - velocity[i, 0])
                y += time * (velocity[j, 1] - velocity[i, 1])
                d2 = x * x + y * y
                b = atan2_(fx * y - fy * x, fx * x + fy * y)
                gx, gy = forward[j, 0], forward[j, 1]
                if spin[j] != 0.0 and time > 0.0:
                    sine, cosine = sincos_(spin[j] * time)
                    gx, gy = cosine * gx - sine * gy, sine * gx + cosine * gy
                kin = species[i] == species[j]
                for f in range(3):
                    if f > 0 and not kin:
                        continue
                    w = exp_(-(d2 * r[f] + b * b * a[f]))  # eq. 4
                    if f == 0:
                        px, py = -w * x, -w * y
                    elif f == 1:
                        px, py = w * x, w * y
                    else:
                        px, py = w * gx, w * gy
                    by_r, by_a, by_h = d2 * r_theta[f], b * b * a_theta[f], 2.0 * b * a[f]
                    sx[f, 0] += px
                    sy[f, 0] += py
                    sx[f, 1] += px * by_r
                    sy[f, 1] += py * by_r
                    sx[f, 2] += px * by_a
                    sy[f, 2] += py * by_a
                    sx[f, 3] += px * by_h
                    sy[f, 3] += py * by_h
            for at in range(walls_first[i], walls_first[i + 1]):
                x, y = walls_offset[at, 0] - time * velocity[i, 0], walls_offset[at, 1] - time * velocity[i, 1]
                d2 = x * x + y * y
                b = atan2_(fx * y - fy * x, fx * x + fy * y)
                w = exp_(-(d2 * r[3] + b * b * a[3]))
                for c in range(4):
                    by = (
                        1.0
                        if c == 0
                        else d2 * r_theta[3]
                        if c == 1
                        else b * b * a_theta[3]
                        if c == 2
                        else 2.0 * b * a[3]
                    )
                    sx[3, c] -= w * x * by
                    sy[3, c] -= w * y * by
            # eqs. 3 and 2
            hx, hy, own_x, own_y = fx, fy, -fy, fx
            for f in range(4):
                hx += gain * weight[f] * sx[f, 0]
                hy += gain * weight[f] * sy[f, 0]
                own_x += gain * weight[f] * sx[f, 3]
                own_y += gain * weight[f] * sy[f, 3]
            for f in range(4):
                for c in range(3):
                    scale = gain if c == 0 else gain * weight[f]
                    dx[3 * f + c] = scale * sx[f, c] + own_x * d[3 * f + c]
                    dy[3 * f + c] = scale * sy[f, c] + own_y * d[3 * f + c]
            # who is touched turns the heading aside, as in `flockbrush.systems.contact`
            if radius > 0.0:
                for at in range(first[i], first[i + 1]):
                    j = near[at]
                    x = offset[at, 0] + time * (velocity[j, 0] - velocity[i, 0])
                    y = offset[at, 1] + time * (velocity[j, 1] - velocity[i, 1])
                    if x * x + y * y >= touch_far:
                        continue
                    gx, gy = forward[j, 0], forward[j, 1]
                    ox, oy, room = aside_of_(fx, fy, half, x, y, gx, gy, touch)
                    into = hx * ox + hy * oy
                    if into > 0.0:
                        hx, hy = hx - room * into * ox, hy - room * into * oy
                        for q in range(12):
                            into = dx[q] * ox + dy[q] * oy
                            dx[q] -= room * into * ox
                            dy[q] -= room * into * oy
            size = hx * hx + hy * hy
            if size > 1e-24:
                change = atan2_(fx * hy - fy * hx, fx * hx + fy * hy)
                change, passed = _limited(change, limit, drift)
                angle += share * change
                for q in range(12):
                    d[q] += share * passed * ((hx * dy[q] - hy * dx[q]) / size - d[q])
            left -= share
            s += 1
        turn[k] = angle - start
        for q in range(12):
            slope[k, q] = d[q]


@njit(inline="always")
def aside_of_(fx, fy, half, x, y, gx, gy, touch):
    """Unit vector to a body at (x, y), and the share of a heading into it that it takes away; zeros where it is far."""
    ox, oy, far, room = towards_body_(x, y, fx, fy, half, gx, gy, half, touch)
    if room <= 0.0:
        return 0.0, 0.0, 0.0
    return ox / far, oy / far, min(room, DEFLECT)  # a film may show bodies one over the other


@njit(inline="always")
def _limited(change, limit, drift):
    """A turn that wanders by ``drift`` rad and is then limited, on average; and its derivative by the turn."""
    if drift <= 1e-9:
        if abs(change) <= limit:
            return change, 1.0
        return (limit if change > 0.0 else -limit), 0.0
    low, high = (-limit - change) / drift, (limit - change) / drift
    below, above = 0.5 * math.erfc(-low * ROOT_HALF), 0.5 * math.erfc(high * ROOT_HALF)
    bells = math.exp(-0.5 * low * low) - math.exp(-0.5 * high * high)
    inside = 1.0 - below - above
    return limit * (above - below) + change * inside + drift * bells * BELL, inside
