"""Reaching one's place: speed and direction of a bird that follows another (Klotsman & Tal [1]_, eqs. 5 and 6).

Lengths in wingspans, times in frames, angles in radians clockwise from the track (the way the flock migrates), so that
x is to the right of the track and y along it.  What is added to the paper, because without it no flock converged, has a
switch each in `Rules`.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import atan2_, sincos_
from numba import njit

PI = np.pi


class FormingRules(NamedTuple):
    """The rules of initiation with their numbers; the booleans are what can be left out."""

    cruise: float = 1.0 / 3.0  # v0, wingspans per frame
    gain: float = 0.06  # K of eq. 5
    turning: float = 0.2  # α of eq. 6
    most_faster: float = 0.02  # of v0 and frame
    most_turn: float = np.pi / 45  # radians a frame
    slowest: float = 0.4  # of v0
    fastest: float = 1.8  # of v0
    volume: float = np.pi / 2  # visual volume per eye
    narrow: float = 0.35 * np.pi  # per eye: there the reference bird is looked for first
    separation_distance: float = 10.0  # wingspans: nearer rivals for a place part
    look_ahead: float = 12.0  # frames that steering looks ahead; 0: the paper
    farthest: float = 10.0  # r in eq. 6 is at most this; inf: the paper
    hidden_points: bool = True  # hidden-point removal; without, all in view are visible
    separation: bool = True  # the separation drive
    ahead_only: bool = True  # only birds ahead may become references
    loyal: bool = True  # a reference is kept; without, the nearest visible one is chosen every frame
    signed_gain: bool = True  # K is negative for birds that must fall back
    homing: bool = True  # birds without reference turn to the track, and wait ahead of the leader
    capacity: bool = True  # an arm has as many places as the target's; birds beyond go to the other
    onward: float = np.pi / 4  # radians, largest wished angle to the track; π: the paper
    apart: bool = True  # birds on a course for one another part in height
    margin: float = 1.1  # wingspans: nearer approaches are parted
    foresight: float = 12.0  # frames ahead in which approaches are seen
    climb: float = 0.15  # wingspans per frame, up or down, at most


@njit(cache=True, nogil=True, error_model="numpy")
def wrap_(angle):
    """The angle between -π and π."""
    return angle - 2.0 * PI * np.floor(angle / (2.0 * PI) + 0.5)


@njit(cache=True, nogil=True, error_model="numpy")
def reach_(x, y, heading, speed, tx, ty, lead_speed, lead_heading, rules):
    """(speed, heading) in the next frame of a bird at (x, y) with target (tx, ty), its reference's speed and heading.

    The target is where it is in the next frame already.
    """
    rx, ry = tx - x, ty - y
    r = np.sqrt(rx * rx + ry * ry)
    sine, cosine = sincos_(lead_heading)
    far = rules.look_ahead * lead_speed
    ax, ay = rx + far * sine, ry + far * cosine
    aim = min(max(atan2_(ax, ay), -rules.onward), rules.onward) if ax * ax + ay * ay > 1e-18 else heading
    off = wrap_(aim - heading)
    along = rx * sine + ry * cosine
    gain = rules.gain if along > lead_speed or not rules.signed_gain else -rules.gain
    wanted = lead_speed * (1.0 - abs(off) / PI + gain * np.sqrt(abs(r - lead_speed)))  # eq. 5
    turn = rules.turning * off / max(min(r, rules.farthest), 1.0)  # eq. 6
    return limited_speed_(speed, wanted, rules), limited_turn_(heading, turn, rules)


@njit(cache=True, nogil=True, error_model="numpy")
def home_(heading, speed, waits, rules):
    """(speed, heading) of a bird that follows no other: along the track; birds ahead of the leader wait."""
    wanted = 0.5 * rules.cruise if waits else rules.cruise
    return limited_speed_(speed, wanted, rules), limited_turn_(heading, -rules.turning * wrap_(heading), rules)


@njit(cache=True, nogil=True, error_model="numpy")
def limited_speed_(speed, wanted, rules):
    """Changed by no more than a bird can; who is slower than the slowest is taking off, and gathers speed."""
    change, slowest = rules.most_faster * rules.cruise, rules.slowest * rules.cruise
    after = speed + min(max(wanted - speed, -change), change)
    if after < slowest:
        after = min(slowest, speed + change)
    return min(after, rules.fastest * rules.cruise)


@njit(cache=True, nogil=True, error_model="numpy")
def limited_turn_(heading, turn, rules):
    return wrap_(heading + min(max(turn, -rules.most_turn), rules.most_turn))


@njit(cache=True, nogil=True, error_model="numpy")
def part_in_height(x, y, z, heading, speed, rules, climb):
    """How much each bird climbs in this frame to keep apart from those it would meet, (n,).

    Two that will come nearer than ``margin`` within ``foresight`` frames part in height until they are as far apart
    there; who meets nobody comes back to height 0, if nobody is in the way.
    """
    n = len(x)
    vx, vy = np.empty(n), np.empty(n)
    for i in range(n):
        sine, cosine = sincos_(heading[i])
        vx[i], vy[i] = speed[i] * sine, speed[i] * cosine
    for i in range(n):
        up = down = 0.0
        back = min(max(-0.05 * z[i], -0.25 * rules.climb), 0.25 * rules.climb)
        for j in range(n):
            if j == i:
                continue
            dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
            if abs(dz) >= rules.margin + 0.2:
                continue
            ux, uy = vx[j] - vx[i], vy[j] - vy[i]
            u2 = ux * ux + uy * uy
            soon = min(max(-(dx * ux + dy * uy) / u2, 0.0), rules.foresight) if u2 > 1e-12 else 0.0
            mx, my = dx + soon * ux, dy + soon * uy
            near = mx * mx + my * my
            if near >= rules.margin * rules.margin:
                continue
            if (dz > 0.0) == (back > 0.0):
                back = 0.0
            need = np.sqrt(rules.margin * rules.margin - near) - abs(dz)
            if need > 0.0:
                rate = need / max(soon, 1.0)  # each goes twice as far as it must, in case the other cannot
                now = dx * dx + dy * dy
                if now < rules.margin * rules.margin:
                    rate = max(rate, 0.5 * (np.sqrt(rules.margin * rules.margin - now) - abs(dz)))
                if dz < 0.0 or (dz == 0.0 and i > j):  # the higher bird climbs; of two level ones the later
                    up = max(up, rate)
                else:
                    down = max(down, rate)
        climb[i] = min(max(up - down, -rules.climb), rules.climb) if up > 0.0 or down > 0.0 else back
