"""Land and take off: the way from one medium to another, when a brush of the other one is given on purpose.

Landing is a glide along the heading at the sinking speed of the species, a flare in which the bird slows down as it
comes near the ground, and a touchdown slower than its slowest flight; then it walks (`systems.binding`).  On a slope it
sinks towards the ground below, and turns from downhill to along the slope: there the ground does not fall away.  Taking
off is
a run along the heading and a climb, until the bird is fast and high enough; then it goes on climbing beside what its
brush wants, to the height at which its species flies, unless it is bound somewhere.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import air_of, quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards
from flockbrush.engine.raster import Raster

LANDING, TAKING_OFF = 1, 2
CLEAR = 8.0  # body lengths above the ground: so high a bird has taken off
FLARE = 3.0  # m and 4 body lengths above the ground the glide becomes shallow
STEEP = 0.1  # fall of the ground per metre of way from which it lands along the slope
CREEP = 0.3  # m/s that a bird sinks at least


class LandParams(DriveParameters):
    """How steeply."""

    steepness: float = quantity(1.0, "1", "factor of the species' sink rate while landing", 0.1, 1)


class TakeOffParams(DriveParameters):
    """How far beyond the slowest flight."""

    margin: float = quantity(1.3, "1", "take-off speed, as a multiple of the slowest flying speed", 1, 3)


@drive("land", LandParams, always=True, safety=True)
def land(scene, rows, p):
    """Glide, flare, touch down."""
    here = _in(scene, rows, LANDING)
    if here is None:
        return None
    bodies, velocity = scene.bodies, scene.velocity[rows]
    height, length = np.maximum(bodies.height[rows], 0.0), scene.length[rows]
    ahead, speed = _level(scene.forward[rows], velocity)
    ahead, rise = _along_slopes(scene, rows, ahead)
    flare = FLARE + 4.0 * length
    sink = p.steepness * bodies.sink[rows] * np.clip(height / flare, 0.0, 1.0)
    least = 0.3 * bodies.slowest[rows]
    glide = least + (1.3 * bodies.slowest[rows] - least) * np.clip(height / flare, 0.0, 1.0)
    wanted = ahead * np.minimum(np.maximum(speed, least), glide)[:, None]
    wanted[:, 2] = np.clip(rise * speed - np.maximum(sink, CREEP), -bodies.sink[rows], bodies.climb[rows])
    return Urges(towards(velocity, wanted, bodies.acceleration[rows]), p.strength * here)


@drive("take_off", TakeOffParams, always=True, safety=True)
def take_off(scene, rows, p):
    """Run and climb; once it flies, climb beside what the brush wants."""
    here = _in(scene, rows, TAKING_OFF)
    if here is None:
        return None
    bodies, velocity = scene.bodies, scene.velocity[rows]
    ahead, speed = _level(scene.forward[rows], velocity)
    fast = p.margin * bodies.slowest[rows]
    up = (bodies.height[rows] > CLEAR * scene.length[rows]) & (speed >= bodies.slowest[rows])
    wanted = ahead * np.maximum(speed, fast)[:, None]
    enough = np.clip(speed / np.maximum(bodies.slowest[rows], 1e-6), 0.0, 1.0)
    wanted[:, 2] = bodies.climb[rows] * enough * np.clip(bodies.cruise[rows] - bodies.height[rows], 0.0, 1.0)
    bound = air_of(scene).bound[rows] > 0
    urgency = np.where(up, np.where(bound, 0.0, 0.5), 1.0)
    return Urges(towards(velocity, wanted, bodies.acceleration[rows]), p.strength * urgency * here)


def _along_slopes(scene, rows, ahead):
    """((k, 3) level ways, turned from downhill to along the slope, (k,) rise of the ground per metre along them)."""
    bodies = scene.bodies
    if bodies.relief.shape[0] * bodies.relief.shape[1] <= 1:
        return ahead, np.zeros(len(ahead))
    slope = Raster(bodies.relief_cell, bodies.relief[..., 1:]).sample(scene.xyz[rows, :2], scene.wrap)
    steepness = np.maximum(np.sqrt((slope**2).sum(axis=1)), 1e-12)[:, None]
    up = slope / steepness
    across = np.column_stack([-up[:, 1], up[:, 0]])
    along = np.where((ahead[:, :2] * across).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * across
    down = np.maximum(-(ahead[:, :2] * up).sum(axis=1), 0.0)[:, None]
    share = np.minimum(down * steepness / STEEP, 1.0)  # of the way from where it heads to along the slope
    mixed = (1.0 - share) * ahead[:, :2] + share * along
    mixed = mixed / np.maximum(np.sqrt((mixed**2).sum(axis=1)), 1e-12)[:, None]
    turned = np.column_stack([mixed, np.zeros(len(mixed))])
    return turned, (slope * mixed).sum(axis=1)


def _in(scene, rows, transit):
    """(k,) 1.0 for animals on this way, None if none is."""
    if scene.bodies is None:
        return None
    here = (scene.bodies.transit[rows] == transit) & scene.bodies.aloft[rows]
    return here.astype(float) if here.any() else None


def _level(forward, velocity):
    """((k, 3) level unit vectors along the way, (k,) m/s level)."""
    speed = np.sqrt(velocity[:, 0] ** 2 + velocity[:, 1] ** 2)
    size = np.sqrt(forward[:, 0] ** 2 + forward[:, 1] ** 2)
    level = np.column_stack([forward[:, 0], forward[:, 1], np.zeros(len(forward))])
    level = np.where(size[:, None] > 1e-9, level / np.maximum(size, 1e-9)[:, None], [1.0, 0.0, 0.0])
    return level, speed
