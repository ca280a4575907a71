"""Seek: along the guides and to the goal, or to a place.

On the ground the way along guides and to goals is the navigation field, round obstacles; in the air it is straight to
where the bird is bound.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from flockbrush.behaviours.behaviour import air_of, quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards, unit_rows
from flockbrush.engine.seam import short_way
from pydantic import Field


class Params(DriveParameters):
    """Where to, and how fast."""

    what: Literal["guide", "place"] = Field(
        "guide",
        description="guide: follow guides to the goal or to the flock's destination; place: go to (x, y)",
        json_schema_extra={"unit": "-"},
    )
    x: float = quantity(0.0, "m", "east coordinate of the place", -1e6, 1e6)
    y: float = quantity(0.0, "m", "north coordinate of the place", -1e6, 1e6)
    near: float = quantity(3.0, "m", "the place is reached when nearer than this", 0, 1e5)
    pace: float = quantity(1.0, "1", "factor of the brush's speed", 0, 10)


@drive("seek", Params)
def seek(scene, rows, p):
    """To where it is bound."""
    bodies = scene.bodies
    if bodies is None:
        return None
    if p.what == "place":
        to = np.column_stack([short_way((p.x, p.y) - scene.xyz[rows, :2], scene.wrap), np.zeros(len(rows))])
    else:
        to = np.column_stack([scene.guidance[rows], np.zeros(len(rows))])
        air = air_of(scene)
        bound = bodies.aloft[rows] & (air.bound[rows] > 0)
        to[bound] = air.target[rows][bound]
    far = np.sqrt((to**2).sum(axis=1))
    acts = far > (p.near if p.what == "place" else 1e-6)
    if not acts.any():
        return None
    wanted = unit_rows(to) * (p.pace * scene.speed[rows])[:, None]
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * acts.astype(float))
