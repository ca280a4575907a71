"""Clear terrain: who flies foresees the ground as any other obstacle, and climbs in time.

It looks along the way the animal flies, as far as it needs to climb over what rises ahead.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards
from flockbrush.engine.raster import bilinear_
from numba import njit

LOOKS = 12  # places along the way
LANDING = 1


class Params(DriveParameters):
    """How far ahead, and how high above."""

    foresight: float = quantity(6.0, "s", "how far ahead it looks, in time of its flight", 0.1, 60)
    clearance: float = quantity(4.0, "body lengths", "kept above the ground ahead", 0, 1000)


@drive("clear_terrain", Params, always=True)
def clear_terrain(scene, rows, p):
    """Climb as steeply as the ground ahead asks for; slow down where that is more than the wings can."""
    bodies = scene.bodies
    if bodies is None or bodies.relief.shape[0] * bodies.relief.shape[1] <= 1 or not bodies.aloft[rows].any():
        return None
    need = np.full(len(rows), -np.inf)
    velocity = scene.velocity[rows]
    _needed(rows, scene.xyz, scene.velocity, scene.length, bodies.relief, bodies.relief_cell, p.foresight, p.clearance,
            need)  # fmt: skip
    acts = bodies.aloft[rows] & (need > np.maximum(velocity[:, 2], 0.2)) & (bodies.transit[rows] != LANDING)
    if not acts.any():
        return None
    most = np.maximum(bodies.climb[rows], 0.1)
    wanted = velocity.copy()
    wanted[:, 2] = np.minimum(need, most)
    ease = np.clip(most / np.maximum(need, 1e-9), 0.0, 1.0)[:, None]  # slower, so that the climb is in time
    size = np.maximum(np.sqrt((velocity[:, :2] ** 2).sum(axis=1)), 1e-9)
    slowest = np.minimum(np.maximum(bodies.slowest[rows], 0.0) / size, 1.0)[:, None]
    wanted[:, :2] *= np.maximum(ease, slowest)
    urgency = np.clip(0.4 + 0.6 * need / most, 0.0, 1.0) * acts
    return Urges(towards(velocity, wanted, bodies.acceleration[rows]), p.strength * urgency)


@njit(cache=True, nogil=True, error_model="numpy")
def _needed(rows, xyz, velocity, length, relief, cell, foresight, clearance, need):
    """m/s of climb that keeps each clear of the ground along its way."""
    height = relief[:, :, 0]
    for k in range(len(rows)):
        i = rows[k]
        for look in range(1, LOOKS + 1):
            t = foresight * look / LOOKS
            x, y = xyz[i, 0] + t * velocity[i, 0], xyz[i, 1] + t * velocity[i, 1]
            low = bilinear_(height, cell, x, y) + clearance * length[i]
            need[k] = max(need[k], (low - xyz[i, 2]) / t)
