"""Clear terrain: who flies foresees the ground as any other obstacle, and climbs or turns in time.

It looks along the way the animal flies.  What rises ahead it climbs over, slower where that is steep; where its
slowest flight is too fast for that, it turns to the nearest way that it can climb, and climbs on the way.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards
from flockbrush.engine.maths import inner_kernel, sincos_
from flockbrush.engine.raster import bilinear_
from numba import njit

LOOKS = 12  # places along the way
LANDING = 1
SIDES, WIDEST = 9, np.pi  # ways to each side that are tried, and how far round, rad
LEAST_CLIMB = 0.1  # m/s, that every species can do
MARGIN = 0.9  # of its climb, that a way on which it turns may ask for


class Params(DriveParameters):
    """How far ahead, and how high above."""

    foresight: float = quantity(6.0, "s", "how far ahead the bird looks, as time of flight", 0.1, 60)
    clearance: float = quantity(4.0, "body lengths", "height kept above the ground ahead", 0, 1000)


@drive("clear_terrain", Params, always=True, safety=True)
def clear_terrain(scene, rows, p):
    """Climb as steeply as the ground ahead asks for; slow down, or turn, where that is more than the wings can."""
    bodies = scene.bodies
    if bodies is None or bodies.relief.shape[0] * bodies.relief.shape[1] <= 1 or not bodies.aloft[rows].any():
        return None
    velocity, most = scene.velocity[rows], np.maximum(bodies.climb[rows], LEAST_CLIMB)
    steering = bodies.aloft[rows] & (bodies.transit[rows] != LANDING)
    need, wanted = np.full(len(rows), -np.inf), np.empty((len(rows), 3))
    _way_over(rows, steering, bodies, scene.animals, p.clearance, p.foresight, need, wanted)
    acts = steering & (need > np.maximum(velocity[:, 2], 0.2))
    if not acts.any():
        return None
    urgency = np.clip(0.4 + 0.6 * need / most, 0.0, 1.0) * acts
    return Urges(towards(velocity, wanted, bodies.acceleration[rows]), p.strength * urgency)


@njit(cache=True, nogil=True, error_model="numpy")
def _way_over(rows, steering, bodies, animals, clearance, foresight, need, wanted):
    """m/s of climb that keeps each clear of the ground along its way, and the velocity that it should have."""
    xyz, velocity, forward, length = animals.xyz, animals.velocity, animals.forward, animals.length
    ground, slowest, climb = (bodies.relief[:, :, 0], bodies.relief_cell, animals.wrap), bodies.slowest, bodies.climb
    for k in range(len(rows)):
        if not steering[k]:
            continue
        i = rows[k]
        vx, vy, most = velocity[i, 0], velocity[i, 1], max(climb[i], LEAST_CLIMB)
        size = np.sqrt(vx * vx + vy * vy)
        if size < 1e-6:
            vx, vy, size = forward[i, 0], forward[i, 1], 1.0
        fx, fy, reach, low = vx / size, vy / size, foresight * size, xyz[i, 2] - clearance * length[i]
        steepness = _steepness(ground, xyz[i, 0], xyz[i, 1], fx, fy, low, reach)
        need[k] = steepness * size
        slow, bx, by, best = min(max(slowest[i], 0.0), size), fx, fy, steepness
        if steepness * slow > most:
            for step in range(1, 2 * SIDES + 1):
                side = 1.0 if step % 2 else -1.0
                sine, cosine = sincos_(side * ((step + 1) // 2) * WIDEST / SIDES)
                gx, gy = cosine * fx - sine * fy, sine * fx + cosine * fy
                other = _steepness(ground, xyz[i, 0], xyz[i, 1], gx, gy, low, reach)
                if other < best:
                    bx, by, best = gx, gy, other
                if best * slow <= MARGIN * most and step % 2 == 0:
                    break
        else:
            slow = min(max(slow, size * most / max(need[k], 1e-9)), size)
        wanted[k, 0], wanted[k, 1], wanted[k, 2] = slow * bx, slow * by, min(need[k], most)


@inner_kernel
def _steepness(ground, x, y, fx, fy, z, reach):
    """Rise per metre of way that clears the ground along a unit vector, as far as ``reach`` m."""
    height, cell, wrap = ground
    steepest = -np.inf
    for look in range(1, LOOKS + 1):
        far = reach * look / LOOKS
        steepest = max(steepest, (bilinear_(height, cell, x + far * fx, y + far * fy, wrap) - z) / far)
    return steepest
