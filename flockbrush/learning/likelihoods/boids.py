"""Boids of Reynolds 1987 held to the ground: found by a search, since allocation by priority is not smooth."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.boids import Params
from flockbrush.learning.likelihood import Likelihood, register, searched

REACH = 16.0  # BL
VIEWS = VisionSpec(range=REACH, occlusion=False, sight="metric"), VisionSpec(range=REACH)
NUMBERS = {
    "separation_strength": (0.01, 1.0), "matching_strength": (0.01, 1.0), "centring_strength": (0.01, 1.0),
    "separation": (0.5, 8.0), "neighbour_range": (1.0, 16.0), "exponent": (0.0, 4.0), "matching_time": (0.05, 5.0),
    "max_acceleration": (0.02, 10.0),
}  # fmt: skip
FASTEST = 1.5  # times the speed of all but a few: what a boid may reach


def fitted(turns, vision, seed, begin=None):
    """The likeliest strengths and distances, for animals as fast as those seen."""
    speed = np.hypot(*turns.velocity.T)
    top = max(FASTEST * float(np.quantile(speed, 0.99)), 0.2) if len(speed) else 1.0
    base = Params(
        grounded=True, min_speed=0.0, max_speed=top, neighbour_range=8.0, separation=1.5, matching_time=0.4,
        clearance=0.0, height_strength=0.0,
    )  # fmt: skip
    return searched(turns, behaviours()["boids"], NUMBERS, base, seed, begin)


register(Likelihood("boids", "boids", VIEWS, fitted, NUMBERS))
