"""The zones of Couzin et al. 2002: found by a search, since membership in a zone has no derivative."""

from __future__ import annotations

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.zones import Params
from flockbrush.learning.likelihood import Likelihood, register, searched

REACH = 16.0  # BL
VIEWS = VisionSpec(range=REACH, occlusion=False, sight="metric"), VisionSpec(range=REACH)
NUMBERS = {
    "repulsion": (0.2, 4.0), "orientation": (0.1, 12.0), "attraction": (0.1, 16.0), "blind_angle": (0.0, 240.0),
    "max_turn": (0.1, 12.0),
}  # fmt: skip


def fitted(turns, vision, seed, begin=None):
    """The likeliest zones."""
    return searched(turns, behaviours()["zones"], NUMBERS, Params(), seed, begin)


register(Likelihood("zones", "zones", VIEWS, fitted, NUMBERS))
