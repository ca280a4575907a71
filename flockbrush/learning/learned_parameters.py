"""What learning brings home: a brush's numbers, how sure they are, and how well they did on what was held back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from flockbrush.learning.rollout import LEAST, MOST, NAMES

FAINT = 0.1  # of the strongest weight, below which the ranges of a force are not identifiable
KEEPING = 0.2  # of the merit of an attempt: what its herds do in the long run
SURE = 0.1  # of the range 0 to 1: an identifiable number has a smaller error


@dataclass
class Attempt:
    """One start of the search and where it ended."""

    name: str  # "random 3", or the shipped brush whose numbers it began with
    seed: int  # what its chance came from
    # first_theta, theta: (12,); the numbers it began and ended with, in the order of
    # `flockbrush.learning.rollout.NAMES`
    first_theta: np.ndarray
    theta: np.ndarray
    extras: dict = field(default_factory=dict)  # other parameters of the model that it set
    loss: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (k,); of the descent, step by step
    # how unlike the clip its herds are, in the clip's own standard deviations; 0 is the same, inf not tried
    score: float = np.inf
    figures: dict[str, float] = field(default_factory=dict)  # the parts of the score by name
    # how far its herds stray from what the clip is in 20 s and with other numbers of animals; NaN not tried
    staying: float = np.nan

    @property
    def merit(self) -> float:
        """What attempts are chosen by: less is better."""
        return float(np.sqrt((1 - KEEPING) * self.score**2 + KEEPING * self.staying**2))


@dataclass
class Learned:
    """A herd learned from clips."""

    params: Any  # of the herd model: theta, extras, and the defaults for the rest
    # speed, body, vision: SpeedSpec, BodySpec, VisionSpec; with ``params`` all that a brush needs; body.length is 1, in
    # body lengths
    speed: SpeedSpec
    body: BodySpec
    vision: VisionSpec
    theta: np.ndarray  # (12,); the normalised numbers, in the order of `flockbrush.learning.rollout.NAMES`
    extras: dict = field(default_factory=dict)  # other parameters of the model that were set from the clip
    # all that was tried, as it came out of the descent and the evolution
    starts: list[Attempt] = field(default_factory=list)
    chosen: int = 0  # which of them this is
    # (12,); standard deviation over the attempts that describe the clip about as well; of weights as they are at Ω = 10
    spread: np.ndarray = field(default_factory=lambda: np.zeros(12))
    # (12,) or None; standard deviation of each number as far as the turns of the animals tell (Cramér-Rao); None
    # without turns
    deviation: np.ndarray | None = None
    # (12,) bool; whether the clip says what this number is (`told_of`)
    identifiable: np.ndarray = field(default_factory=lambda: np.ones(12, bool))
    # figures of the chosen herd on the frames held back inside the clips, by name
    held_out: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  # what whoever uses this should know
    interrupted: bool = False  # it was stopped: this is the best so far
    # (12, 12) or None; of the errors of the numbers (`flockbrush.learning.confounding`), NaN where the turns say
    # nothing; None without turns
    correlation: np.ndarray | None = None
    # of behaviour. With another than the herd ``theta`` and what goes with it are of ``names``, each normalised to
    # where it was looked for (`flockbrush.learning.likelihood`).
    model: str = "herd"
    names: tuple[str, ...] = NAMES  # parameters that were learned
    kind: str = "herd"  # as ``--model`` names it
    scales: np.ndarray | None = None  # by how much ``values`` change with ``theta``; None: they are the same

    @property
    def values(self) -> np.ndarray:
        """The numbers as the model has them; the herd's are normalised in the model, too."""
        return self.theta if self.names == NAMES else np.array([getattr(self.params, name) for name in self.names])

    @property
    def loss(self) -> np.ndarray:
        """The curve of the chosen start's descent."""
        return self.starts[self.chosen].loss if self.starts else np.zeros(0)


def forces_of(theta, extras):
    """(12,) theta with weights at the default Ω: only the product of the two is identifiable."""
    out = np.array(theta, float)
    out[0:12:3] *= extras.get("sensitivity", 10.0) / 10.0
    return out


def told_of(theta, spread, deviation=None):
    """(12,) bool, identifiable numbers: those on which all equally good herds and the turns of animals agree.

    A number at its bound is only known to lie there or beyond, and so is a weight of less than two deviations.  The
    ranges of a force that is weak beside the others, may be none at all, or whose weight is not told, mean nothing.
    """
    theta = np.asarray(theta, float)
    deviation = np.zeros(12) if deviation is None else np.asarray(deviation)
    told = (spread < SURE) & (deviation < SURE) & (theta > 1.01 * LEAST) & (theta < MOST)
    told[0::3] &= theta[0::3] > 2.0 * deviation[0::3]
    for k in range(0, 12, 3):
        faint = theta[k] < max(3.0 * deviation[k], FAINT * theta[0:9:3].max())
        told[k + 1 : k + 3] &= told[k] and not faint
    return told
