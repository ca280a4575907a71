"""The herd model, of animals that see what is near: with derivatives (`flockbrush.learning.turns`)."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.brush import VisionSpec, shipped
from flockbrush.behaviours.models.herd import Params
from flockbrush.learning.likelihood import Likelihood, register
from flockbrush.learning.rollout import LEAST, MOST, NAMES, params_of, theta_of
from flockbrush.learning.turns import best_fit, fit_turns, thinned

TURNS, FEW, STARTS, STEPS = 1000, 300, 2, 15
ALSO = "march", "swarm", "ants-mill"  # shipped brushes whose numbers are also starts of the search
VIEWS = tuple(
    VisionSpec(range=reach, occlusion=seen == "exact", sight=seen) for seen in ("exact", "metric") for reach in (4, 8)
)
NUMBERS = {name: (LEAST, MOST) for name in NAMES if not name.startswith("obstacle")}
BY_WALLS = {name: (LEAST, MOST) for name in NAMES if name not in NUMBERS}


def fitted(turns, vision, seed, begin=None):
    """The likeliest twelve numbers; those of obstacles keep their defaults where no animal sees one."""
    base, walls = Params(neighbour_range=min(vision.range, 20.0)), len(turns.percept.walls_offset) > 0
    free, some = np.array([name in NUMBERS or walls for name in NAMES]), thinned(turns, TURNS)
    if begin is not None:
        fit = fit_turns(some, theta_of(begin), base, free=free, steps=STEPS, tolerance=1e-4)
    else:
        first = [theta_of(shipped().get(name).params) for name in ALSO]
        fit = best_fit(
            some, base, seed=seed, starts=STARTS, first=first, free=free, held=theta_of(base), rows=FEW
        )  # fmt: skip
    return params_of(fit.theta, {"neighbour_range": base.neighbour_range})


register(Likelihood("herd", "herd", VIEWS, fitted, NUMBERS, by_walls=BY_WALLS))
