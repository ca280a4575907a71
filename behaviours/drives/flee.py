"""Flee: away from every danger that is noticed, and from where one was a moment ago.

Whom an animal fears says its species; fear is full within half the distance at which it notices the danger.  The
way is the sum of all dangers, each by its fear, turned along walls that are close ahead.  It runs or flies as fast as
its species does in full fear; with less it leaves more to its brush.  Who flies rises and sinks no faster than its
species does, ends its dive well above the ground, and goes the faster to the side; nobody flies backwards, so it turns
off to one side before a danger that is straight ahead.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import empty_noticed_lists, frozen, quantity
from flockbrush.behaviours.drive import LOW, DriveParameters, Urges, drive, towards, within_wings
from numba import njit

FEAR = 1  # of the lists of noticed animals
WALLS = 3.0  # body lengths: nearer walls ahead are run along


class Params(DriveParameters):
    """How firmly, and how fast."""

    pace: float = quantity(1.0, "1", "factor of the species' fleeing speed", 0.1, 3)


@drive("flee", Params, always=True, safety=True)
def flee(scene, rows, p):
    """Away, at the speed of its fear."""
    bodies, noticed = scene.bodies, scene.noticed
    if bodies is None or (noticed is None and not bodies.alarm.any()):
        return None
    if noticed is None:
        noticed = frozen(empty_noticed_lists(len(scene.ids)))
    away, fear = np.zeros((len(rows), 3)), np.zeros(len(rows))
    _flee(rows, noticed, bodies, scene.animals, scene.obstacle_first, scene.obstacle_offset, away, fear)
    if not fear.any():
        return None
    speed = p.pace * bodies.flee[rows] * (0.5 + 0.5 * fear)
    wanted = away * np.minimum(speed, bodies.top[rows])[:, None]
    flies = np.flatnonzero(bodies.aloft[rows] & (fear > 0.0))
    if len(flies):
        wanted[flies] = within_wings(scene, rows[flies], wanted[flies])
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * fear)


@njit(cache=True, nogil=True, error_model="numpy")
def _flee(rows, noticed, bodies, animals, obstacle_first, obstacle_offset, away, fear):
    """The unit vector away from all that each fears, along walls, and how much it fears."""
    first, _, offset, verb, weight, notice = noticed
    aloft, height, alarm, threat, length = bodies.aloft, bodies.height, bodies.alarm, bodies.threat, animals.length
    for k in range(len(rows)):
        i = rows[k]
        ax = ay = az = worst = 0.0
        for at in range(first[i], first[i + 1]):
            if verb[at] != FEAR:
                continue
            x, y, z = offset[at, 0], offset[at, 1], offset[at, 2] if aloft[i] else 0.0
            d = np.sqrt(offset[at, 0] ** 2 + offset[at, 1] ** 2 + offset[at, 2] ** 2)
            much = weight[at] * min(2.0 * (1.0 - d / notice[at]), 1.0)
            size = np.sqrt(x * x + y * y + z * z)
            if much <= 0.0 or size < 1e-9:
                continue
            ax, ay, az = ax - much * x / size, ay - much * y / size, az - much * z / size
            worst = max(worst, much)
        if alarm[i] > worst:  # out of sight, not out of mind
            x, y, z = threat[i, 0], threat[i, 1], threat[i, 2] if aloft[i] else 0.0
            size = max(np.sqrt(x * x + y * y + z * z), 1e-9)
            more = alarm[i] - worst
            ax, ay, az = ax - more * x / size, ay - more * y / size, az - more * z / size
            worst = alarm[i]
        size = np.sqrt(ax * ax + ay * ay + az * az)
        if worst <= 0.0 or size < 1e-9:
            continue
        ax, ay, az = ax / size, ay / size, az / size
        if not aloft[i]:
            reach = WALLS * length[i]
            for at in range(obstacle_first[i], obstacle_first[i + 1]):  # along walls, not into them
                ox, oy = obstacle_offset[at, 0], obstacle_offset[at, 1]
                d = np.sqrt(ox * ox + oy * oy)
                into = (ax * ox + ay * oy) / d if d > 1e-9 else 0.0
                if d < reach and into > 0.0:
                    much = into * (1.0 - d / reach)
                    ax, ay = ax - much * ox / d, ay - much * oy / d
        elif az < 0.0 and height[i] < LOW * length[i]:
            az = 0.0
        size = np.sqrt(ax * ax + ay * ay + az * az)
        if size < 1e-9:
            continue
        away[k, 0], away[k, 1], away[k, 2] = ax / size, ay / size, az / size
        fear[k] = worst
