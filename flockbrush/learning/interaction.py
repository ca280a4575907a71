"""How much animals answer to their neighbours: in a clip, by its turns, and in a herd that was learned from it.

A few seconds of order and turning can be met by animals that take no notice of each other.  The turns tell more: where
forces say them significantly better than none do, a herd that hardly has forces is not that of the clip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from flockbrush.learning.rollout import params_of
from flockbrush.learning.turns import Turns, likelihood, predicted, thinned

ROWS = 6000  # turns that are looked at
SHOWN = 40.0  # twice the logarithm of the likelihood ratio, from which on a clip shows interaction: chi-square of 12
#               degrees of freedom is beyond it once in 10,000 clips of animals without any
LEAST = 0.25  # of the turning that neighbours cause in the clip: with less, a herd hardly interacts


@dataclass(frozen=True)
class Interaction:
    """What neighbours cause of the turns of one herd."""

    strength: float  # mean absolute turn by forces, rad
    evidence: float  # twice the logarithm of how much likelier the clip's turns are with these forces than with none


def interaction_of(turns: Turns, theta, extras, overlap=1.0) -> Interaction:
    """Of a herd with these numbers, where the animals of a clip are.

    Parameters
    ----------
    theta : (12,) array_like
    extras : dict
        What theta has not.
    overlap : float
        How many of an animal's turns lie over one another: frames to a turn.
    """
    few = thinned(turns, ROWS)
    none, params = np.array(theta, float), params_of(theta, extras)
    none[0:9:3] = 0.0
    with_forces, without = predicted(few, theta, params, False), predicted(few, none, params, False)
    gain = likelihood(few, with_forces) - likelihood(few, without)
    share = few.weight / max(few.weight.sum(), 1e-12)
    independent = min(len(few.rows), len(turns.rows) / max(overlap, 1.0))
    return Interaction(float((share * np.abs(with_forces[0] - without[0])).sum()), 2.0 * independent * gain)


def idle_ones(fits: Sequence[Mapping[str, float]], herds: Sequence[Mapping[str, float]]) -> list[bool]:
    """Which of some herds hardly interact though the clip does, by the best of its fits.

    Parameters
    ----------
    fits, herds : sequence of mapping
        With ``strength`` and ``evidence`` as of an `Interaction`; empty where turns are not told.
    """
    known = [fit for fit in fits if fit]
    if not known:
        return [False] * len(herds)
    best = max(known, key=lambda fit: fit["evidence"])
    if best["evidence"] < SHOWN:
        return [False] * len(herds)
    return [bool(herd) and herd["strength"] < LEAST * best["strength"] for herd in herds]
