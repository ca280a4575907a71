"""Rest: stand still, on the ground and in water, never in flight.

It takes the share `depth` of the body's acceleration to brake and hold still; the brush has what is left.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards


class Params(DriveParameters):
    """How deeply."""

    depth: float = quantity(1.0, "1", "share of control used for resting; the brush has the rest", 0, 1)


@drive("rest", Params)
def rest(scene, rows, p):
    """No speed at all."""
    bodies = scene.bodies
    if bodies is None or bodies.aloft[rows].all():
        return None
    still = np.zeros((len(rows), 3))
    urgency = p.strength * p.depth * (~bodies.aloft[rows]).astype(float)
    return Urges(towards(scene.velocity[rows], still, bodies.acceleration[rows]), urgency)
