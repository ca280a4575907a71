"""Maps of attraction and alignment by distance: found by the search that serves all kinds."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.force_map import KNOTS, Params
from flockbrush.learning.likelihood import Likelihood, register, searched

REACH = 40.0  # BL: who is left behind comes back
VIEWS = VisionSpec(range=REACH, occlusion=False, sight="metric"), VisionSpec(range=REACH)
ATTRACTION = (-12.0, 12.0), (-12.0, 12.0), (-6.0, 6.0), (-3.0, 6.0), (0.0, 6.0)  # who is far does not repel
ALIGNMENT = (-1.0, 8.0)
FRONT = (-0.95, 0.95)
NUMBERS = {
    **{f"attraction_{knot}": within for knot, within in zip(KNOTS, ATTRACTION, strict=True)},
    **{f"alignment_{knot}": ALIGNMENT for knot in KNOTS},
    "front_attraction": FRONT, "front_alignment": FRONT,
}  # fmt: skip
# by how much the map changes from one distance to the next, rad/s, more where bodies are close; and what the fronts are
# about.  Standard deviations by which turns of frames that were held out are likeliest (docs/decisions-learning.md)
STEPS = {"attraction": (8.0, 2.0, 0.25, 0.25), "alignment": (0.25, 0.25, 0.25, 0.25)}
ONE_SIDED = 0.125
FASTEST = {"max_turn": (0.3, 12.0)}
BY_WALLS = {"obstacle_repulsion": (0.5, 60.0)}


def fitted(turns, vision, seed, begin=None):
    """The likeliest map."""
    walls = BY_WALLS if len(turns.percept.walls_offset) else {}
    return searched(turns, behaviours()["force_map"], NUMBERS | walls, Params(), seed, begin, unevenness)


def unevenness(values):
    """The `Prior`: a map is smooth, and animals ahead count like those behind."""
    steps = [np.diff([values[f"{of}_{knot}"] for knot in KNOTS]) / step for of, step in STEPS.items()]
    return np.concatenate([*steps, [values["front_attraction"] / ONE_SIDED, values["front_alignment"] / ONE_SIDED]])


register(
    Likelihood("force_map", "force_map", VIEWS, fitted, NUMBERS, FASTEST, BY_WALLS, general=True, prior=unevenness)
)
