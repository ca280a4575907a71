"""What learning brings home: a brush's numbers, how sure they are, and how well they did on what was held back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from flockbrush.learning.rollout import NAMES


@dataclass
class Attempt:
    """One start of the search and where it ended.

    Attributes
    ----------
    name : str
        "random 3", or the shipped brush whose numbers it began with.
    seed : int
        What its chance came from.
    first_theta, theta : (12,) ndarray
        The numbers it began and ended with, in the order of `flockbrush.learning.rollout.NAMES`.
    extras : dict
        Other parameters of the model that it set.
    loss : (k,) ndarray
        Of the descent, step by step.
    score : float
        How unlike the clip its herds are, in the clip's own standard deviations; 0 is the same, inf not tried.
    figures : dict
        The parts of the score by name.
    staying : float
        How far its herds stray from what the clip is in 20 s and with other numbers of animals; NaN not tried.
    """

    name: str
    seed: int
    first_theta: np.ndarray
    theta: np.ndarray
    extras: dict = field(default_factory=dict)
    loss: np.ndarray = field(default_factory=lambda: np.zeros(0))
    score: float = np.inf
    figures: dict[str, float] = field(default_factory=dict)
    staying: float = np.nan


@dataclass
class Learned:
    """A herd learned from clips.

    Attributes
    ----------
    params : Params
        Of the herd model: theta, extras, and the defaults for the rest.
    speed, body, vision : SpeedSpec, BodySpec, VisionSpec
        With ``params`` all that a brush needs; body.length is 1, in body lengths.
    theta : (12,) ndarray
        The normalised numbers, in the order of `flockbrush.learning.rollout.NAMES`.
    extras : dict
        Other parameters of the model that were set from the clip.
    starts : list of Attempt
        All that was tried, as it came out of the descent and the evolution.
    chosen : int
        Which of them this is.
    spread : (12,) ndarray
        Standard deviation over the attempts that describe the clip about as well; of weights as they are at Ω = 10.
    deviation : (12,) ndarray or None
        Standard deviation of each number as far as the turns of the animals tell (Cramér-Rao); None without turns.
    correlation : (12, 12) ndarray or None
        Of the errors of the numbers (`flockbrush.learning.confounding`), NaN where the turns say nothing; None without
        turns.
    identifiable : (12,) bool ndarray
        Whether the clip says what this number is (`flockbrush.learning.recipe.told_of`).
    held_out : dict
        Figures of the chosen herd on the frames held back inside the clips, by name.
    notes : list of str
        What whoever uses this should know.
    interrupted : bool
        It was stopped: this is the best so far.
    model : str
        Of behaviour.  With another than the herd ``theta`` and what goes with it are of ``names``, each normalised to
        where it was looked for (`flockbrush.learning.likelihood`).
    names : tuple of str
        Parameters that were learned.
    kind : str
        As ``--model`` names it.
    scales : ndarray or None
        By how much ``values`` change with ``theta``; None: they are the same.
    """

    params: Any
    speed: SpeedSpec
    body: BodySpec
    vision: VisionSpec
    theta: np.ndarray
    extras: dict = field(default_factory=dict)
    starts: list[Attempt] = field(default_factory=list)
    chosen: int = 0
    spread: np.ndarray = field(default_factory=lambda: np.zeros(12))
    deviation: np.ndarray | None = None
    identifiable: np.ndarray = field(default_factory=lambda: np.ones(12, bool))
    held_out: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    interrupted: bool = False
    correlation: np.ndarray | None = None
    model: str = "herd"
    names: tuple[str, ...] = NAMES
    kind: str = "herd"
    scales: np.ndarray | None = None

    @property
    def values(self) -> np.ndarray:
        """The numbers as the model has them; the herd's are normalised in the model, too."""
        return self.theta if self.names == NAMES else np.array([getattr(self.params, name) for name in self.names])

    @property
    def loss(self) -> np.ndarray:
        """The curve of the chosen start's descent."""
        return self.starts[self.chosen].loss if self.starts else np.zeros(0)
