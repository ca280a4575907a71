"""Keep height: fly at a height above the ground, that of the species by default.

It acts in the air only and asks for at most half of what the body can do, so that a bird may still flee or turn; it
climbs and sinks no faster than its species can.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards


class Params(DriveParameters):
    """Which height."""

    height: float = quantity(0.0, "m", "height above the ground; 0: the usual height of the species", 0, 1e5)
    slack: float = quantity(
        5.0, "m", "height error at which it requests half of the control; less when nearer", 0.1, 1e4
    )


@drive("keep_height", Params, safety=True)
def keep_height(scene, rows, p):
    """Up or down, along the way it flies."""
    bodies = scene.bodies
    if bodies is None or not bodies.aloft[rows].any():
        return None
    height = p.height if p.height > 0.0 else bodies.cruise[rows]
    off = np.where(np.asarray(height) > 0.0, height - bodies.height[rows], 0.0)
    wanted = scene.velocity[rows].copy()
    wanted[:, 2] = np.clip(off / 2.0, -bodies.sink[rows], bodies.climb[rows])
    urgency = 0.5 * p.strength * np.minimum(np.abs(off) / p.slack, 1.0) * bodies.aloft[rows]
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), urgency)
