"""Work of one trial of each kind, in animal ticks: what a search counts instead of time."""

from __future__ import annotations

import numpy as np

from flockbrush.learning.rollout import DT
from flockbrush.learning.trials import BESIDE, BEYOND, COARSE_DT, OTHER_NUMBERS, STAY, TOO_MANY, Setting

ALWAYS = 40  # animals whose work a tick costs besides


def cost_of_trial(given: Setting) -> float:
    """Of a `trial` beside the clips and one that lasts, with ticks of a level."""
    total = 0.0
    for clip in given.clips:
        length = len(clip.fields) / clip.fps
        total += (ALWAYS + _animals(clip)) * (length + float(np.clip(4.0 * length, *BEYOND))) / DT
    return max(total, 1.0)


def cost_of_limits(given: Setting) -> float:
    """Of a `likeness`."""
    total = 0.0
    for clip in given.clips:
        alone = STAY * DT / COARSE_DT if clip.fields.holds_all else 0.0
        total += (ALWAYS + _animals(clip)) * (BESIDE * len(clip.fields) / clip.fps + alone) / DT
    return max(total, 1.0)


def cost_of_keeping(given: Setting) -> float:
    """Of a `keep`."""
    total = 0.0
    for clip in given.clips:
        if clip.fields.holds_all:
            animals = _animals(clip)
            herds = [animals, *(f * animals for f in OTHER_NUMBERS if f * animals <= TOO_MANY)]
            total += sum(ALWAYS + herd for herd in herds) * STAY / DT
    return total


def _animals(clip):
    return float(np.nanmax(clip.fields.count, initial=1.0))
