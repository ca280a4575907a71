"""Self-propelled particles of D'Orsogna et al. 2006: found by the search that serves all kinds."""

from __future__ import annotations

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.morse import Params
from flockbrush.learning.likelihood import Likelihood, register, searched

REACH = 16.0  # BL
VIEWS = VisionSpec(range=REACH, occlusion=False, sight="metric"), VisionSpec(range=REACH)
NUMBERS = {
    "attraction": (0.2, 100.0), "attraction_reach": (1.0, 40.0), "repulsion": (0.1, 50.0),
    "repulsion_reach": (0.2, 5.0), "max_turn": (0.3, 12.0),
}  # fmt: skip
SPEEDS = {"propulsion": (0.1, 10.0)}


def fitted(turns, vision, seed, begin=None):
    """The likeliest forces."""
    return searched(turns, behaviours()["morse"], NUMBERS, Params(), seed, begin)


register(Likelihood("morse", "morse", VIEWS, fitted, NUMBERS, SPEEDS))
