"""How clearly obstacles are drawn that stand between the eye and what the view follows."""

from __future__ import annotations

import numpy as np

from flockbrush.render.solid_meshes import CLEAR

LOOKED_AT = 0.3  # of the distance: radius of the place that the view follows
NEARER = 0.8  # of the distance: what is farther from the eye than this stands in that place, and stays solid
EDGE = 0.25  # of the radius: from here to there, what is in the way becomes solid
PIECES = 8  # points on each edge of an outline


def opacities(obstacles, camera) -> np.ndarray:
    """(n,) opacity of obstacles, 1 where they hide nothing of what the camera looks at.

    What the camera looks at is a disc about its target; seen from above, an obstacle is in the way if it reaches into
    the cone from the eye to that disc.
    """
    eye, target = camera.eye[:2], np.asarray(camera.target[:2], float)
    long = float(np.hypot(*(target - eye)))
    if long < 1e-9 or not len(obstacles):
        return np.ones(len(obstacles))
    ahead = (target - eye) / long
    return np.array([_opacity(np.asarray(o.polygon, float), eye, ahead, long, camera.distance) for o in obstacles])


def _opacity(polygon, eye, ahead, long, distance):
    steps = np.linspace(0, 1, PIECES, endpoint=False)[:, None, None]
    points = (polygon + steps * (np.roll(polygon, -1, axis=0) - polygon)).reshape(-1, 2) - eye
    along, aside = points @ ahead, np.abs(points @ (-ahead[1], ahead[0]))
    between = (along > 0) & (along < NEARER * long)
    if not between.any():
        return 1.0
    radius = LOOKED_AT * distance / long * along[between]
    outside = float(np.min((aside[between] - radius) / np.maximum(radius, 1e-9)))
    return float(np.clip(CLEAR + (1 - CLEAR) * outside / EDGE, CLEAR, 1.0))
