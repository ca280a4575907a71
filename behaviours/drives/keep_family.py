"""Keep family: an animal that has left its family goes back to it.

It heads for the middle of those of its family that it sees, as `keep_group` does for its kind.  Families are groups
inside a herd (``family_size`` of a spawn); an animal without one, or that sees nobody of it, asks for nothing.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, drive
from flockbrush.behaviours.drives.keep_group import back_to, to_kin


class Params(DriveParameters):
    """What is far."""

    distance: float = quantity(3.0, "body lengths", "farther than this from its family it returns", 0, 500)
    hurry: float = quantity(
        10.0, "body lengths", "distance beyond that at which it returns with full control", 0.1, 1000
    )


@drive("keep_family", Params)
def keep_family(scene, rows, p):
    """Towards the middle of those of its family that it sees."""
    if scene.bodies is None or not scene.bodies.family.any():
        return None
    middle = to_kin(scene, rows, scene.bodies.family, np.zeros_like(scene.known))
    middle[scene.bodies.family[rows] == 0] = 0.0
    return back_to(scene, rows, p, middle)
