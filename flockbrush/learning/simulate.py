"""Herds that begin as a clip begins and are then left alone."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from flockbrush.film.observations import Evidence
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.rollout import HerdStart, Run, Surroundings, rollout


class HerdParts(NamedTuple):
    """What simulations need of a brush."""

    params: Any
    speed: SpeedSpec
    body: BodySpec
    vision: VisionSpec


def simulated(evidence: Evidence, brush, seed=0, unsure=False) -> Run:
    """What a herd does from the clip's first frame on, frame by frame as long as the clip.

    Where the picture holds the whole herd nobody leads it: what the clip does later is not known to it.  Where it shows
    a part, who leaves is taken out, others come in where animals came in, and leaders go the clip's way (sections 6.1
    and 7.1.3 of the paper).

    Parameters
    ----------
    brush : Brush or Learned
        Anything with ``params``, ``speed``, ``body`` and ``vision``.
    seed : int
        Of the start's chance and the noise.
    unsure : bool
        Begin anywhere within the noise of the sightings, elsewhere with each seed.

    Raises
    ------
    ValueError
        When the first frame has no animals.
    """
    fields = evidence.fields
    start = start_of(evidence, 0, seed, brush.body)
    start = shaken(start, evidence, seed) if unsure else start
    if not len(start):
        raise ValueError(f"no animal is visible in frame {fields.frames[0]} of {evidence.name}")
    return rollout(
        start, brush.params, brush.speed, brush.body, brush.vision, seconds=(len(fields) - 1) / fields.fps,
        fps=fields.fps, seed=seed, around=Surroundings.of(fields),
    )  # fmt: skip


def shaken(start: HerdStart, evidence: Evidence, seed=0) -> HerdStart:
    """The start with places as far off as the sightings of the clip may be."""
    rng = np.random.default_rng([seed, 41])
    return HerdStart(start.xy + evidence.place_noise * rng.normal(size=start.xy.shape), start.forward, start.speed)


def longest_way(run: Run) -> np.ndarray:
    """(k, 2) places that nearly all animals of a run keep to, for a picture's edges: BL."""
    if not len(run.xy):
        return np.zeros((0, 2))
    return np.quantile(run.xy, [0.01, 0.99], axis=0)
