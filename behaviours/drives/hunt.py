"""Hunt: towards one animal of those that the species hunts and that are noticed.

The chosen one is near and ahead, so that it stays chosen; the hunter heads for where it will be.  Far from it the
hunter stalks, near to it it rushes as fast as its species can flee.  The model ``hunt`` does the same by itself.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards
from numba import njit

HUNT = 2  # of the lists of noticed animals
SOON = 2.0  # s at most that the prey's way is thought ahead


class Params(DriveParameters):
    """When to rush, and how to stalk."""

    charge: float = quantity(12.0, "body lengths", "nearer than this to the prey it charges", 0.5, 500)
    stalk: float = quantity(0.15, "1", "share of its fleeing speed at which it stalks before that", 0.01, 1)


@drive("hunt", Params, notices=("hunt",))
def hunt(scene, rows, p):
    """Stalk, then rush."""
    noticed, bodies = scene.noticed, scene.bodies
    if noticed is None or bodies is None:
        return None
    way, urgency = np.zeros((len(rows), 3)), np.zeros(len(rows))
    _hunt(rows, noticed, bodies.aloft, bodies.flee, scene.animals, p.charge, p.stalk, way, urgency)
    if not urgency.any():
        return None
    return Urges(towards(scene.velocity[rows], way, bodies.acceleration[rows]), p.strength * urgency)


@njit(cache=True, nogil=True, error_model="numpy")
def _hunt(rows, noticed, aloft, flee, animals, charge, stalk, way, urgency):
    """The velocity after the prey that each chooses, and its urgency."""
    first, near, offset, verb, weight, _ = noticed
    forward, velocity, length = animals.forward, animals.velocity, animals.length
    for k in range(len(rows)):
        i = rows[k]
        best, chosen, distance = np.inf, -1, 0.0
        for at in range(first[i], first[i + 1]):
            if verb[at] != HUNT:
                continue
            d = np.sqrt(offset[at, 0] ** 2 + offset[at, 1] ** 2 + offset[at, 2] ** 2)
            ahead = (
                forward[i, 0] * offset[at, 0] + forward[i, 1] * offset[at, 1] + forward[i, 2] * offset[at, 2]
            ) / max(d, 1e-9)
            cost = d * (1.5 - 0.5 * ahead) / max(weight[at], 1e-6)
            if cost < best:
                best, chosen, distance = cost, at, d
        if chosen < 0:
            continue
        rushes = distance < charge * length[i]
        speed = flee[i] * (1.0 if rushes else stalk)
        soon = min(distance / max(speed, 1e-6), SOON)
        j = near[chosen]
        x, y = offset[chosen, 0] + soon * velocity[j, 0], offset[chosen, 1] + soon * velocity[j, 1]
        z = offset[chosen, 2] + soon * velocity[j, 2] if aloft[i] else 0.0
        size = max(np.sqrt(x * x + y * y + z * z), 1e-9)
        way[k, 0], way[k, 1], way[k, 2] = speed * x / size, speed * y / size, speed * z / size
        urgency[k] = weight[chosen] * (1.0 if rushes else 0.7)
