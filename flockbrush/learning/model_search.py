"""The numbers of a model other than the herd's, refined by simulated herds.

A fit to the next steps of animals has a bias: noise and smoothing of the tracks make animals appear to turn more slowly
than they do, so that herds simulated with these numbers differ from the clip.  From there an evolution
(`flockbrush.learning.evolution`) goes by the trials and scores of the herd's own recipe (`flockbrush.learning.trials`).
It begins with changes that leave the next steps about as likely as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from flockbrush.behaviours.brush import SpeedSpec, VisionSpec
from flockbrush.film.observations import Evidence
from flockbrush.learning.evolution import Evolution
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.initial_conditions import own_speed
from flockbrush.learning.learned_parameters import Attempt
from flockbrush.learning.likelihood import read
from flockbrush.learning.next_step import NextSteps
from flockbrush.learning.search_space import EXTRAS, STEP_OF_EXTRAS
from flockbrush.learning.simulate import HerdParts
from flockbrush.learning.trials import OTHER_NUMBERS, SearchSettings, Setting, attempt, forget, keep, stayed
from flockbrush.learning.workers import Workers
from flockbrush.learning.world_rollout import model_of

SIZE = 8  # candidates of a generation
GENERATIONS = 4, 12  # fewest and most
WORK = 80_000.0  # animals times seconds of simulation that the generations may take, about
LOOSE = 0.14  # of the scatter: what each number may change turns by in the first generation
STEP, WIDE_STEP = 0.1, 0.2  # of ranges, from a fit and from defaults: standard deviation of the first generation
PATIENCE = 3  # generations, after which a hopeless search ends
SEEDS, LAST_SEEDS = 2, 3  # runs of a candidate, and of those that are chosen from
LONG = 10.0  # s, about: a trial beyond the clip
TURN_TIMES = np.geomspace(1 / 64, 2.0, 57)  # s; the shortest are turns of one tick, as in most models
CHANCE = {"wander": (0.02, 2.5), "wander_time": (float(TURN_TIMES[0]), float(TURN_TIMES[-1]))}  # rad/√s, s


@dataclass(frozen=True)
class ModelSetting(Setting):
    """What trials of another model are given."""

    wander_times: ClassVar[np.ndarray] = TURN_TIMES

    view: VisionSpec = VisionSpec()  # noqa: RUF009  frozen
    base: Any = None  # parameters of the model; those that are not searched for keep these values
    numbers: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # searched for, and where
    steps: NextSteps | None = None  # of the clips; None: speeds are the animals' own

    @classmethod
    def of_model(cls, clips: Sequence[Evidence], base, view, numbers, steps=None) -> ModelSetting:
        """Of these clips; a model that wanders is searched for its wander, too."""
        numbers = dict(numbers) | {name: CHANCE[name] for name in type(base).model_fields if name in CHANCE}
        given = Setting.of(clips, SearchSettings())
        return cls(**vars(given), view=view, base=base, numbers=numbers, steps=steps)

    def params(self, x):
        """The parameters at positions (d,) from 0 to 1."""
        return self.base.model_copy(update=read(self.numbers, x))

    def brush(self, theta, extras):
        """A brush with the numbers at these positions, and other parameters."""
        params = self.params(theta).model_copy(update=extras)
        return HerdParts(params, self.speed_of(params), self.body, self.view)

    def speed_of(self, params) -> SpeedSpec:
        """The animals' own speed, of which these parameters make the observed one."""
        return self.speed if self.steps is None else speed_by(self.steps, params, self.speed)

    @property
    def generations(self) -> int:
        """As many as the work allows."""
        one = sum(float(np.nanmax(c.fields.count, initial=1.0)) * (len(c.fields) / c.fps + LONG) for c in self.clips)
        return int(np.clip(WORK / (SIZE * SEEDS * max(one, 1.0)), *GENERATIONS))


def speed_by(steps: NextSteps, params, observed: SpeedSpec) -> SpeedSpec:
    """The animals' own speed, of which a model with these parameters makes the observed one."""
    return own_speed(observed, steps.paces(model_of(params), params), steps.turns.weight)


def first_shape(numbers, information, precision, step) -> np.ndarray:
    """Covariance of a first generation, in squares of the step, that leaves the next steps about as likely.

    It is no wider than what a prior expects.

    Parameters
    ----------
    numbers : sequence of str
        Those searched for.
    information : (k, k) ndarray
        Fisher information in one turn of the first k of them.
    precision : (k, k) ndarray
        Of the prior of these; zeros without one.
    step : float
        Standard deviation where turns say nothing.
    """
    told = np.zeros((len(numbers), len(numbers)))
    told[: len(information), : len(information)] = information / LOOSE**2 + precision
    free = [k for k, name in enumerate(numbers) if name in EXTRAS]  # what noise hides is not held by the turns
    told[free], told[:, free] = 0.0, 0.0
    most = np.where(np.isin(np.arange(len(numbers)), free), STEP_OF_EXTRAS, step)
    return np.linalg.inv(told + np.diag(most**-2.0)) / step**2


class Beginnings(NamedTuple):
    """Where a search begins, in positions from 0 to 1 in the ranges of the numbers."""

    places: Sequence  # of (d,) ndarray: it begins with the best of them
    parts: Sequence = ()  # of (d,) ndarray: what came of parts of the frames
    step: float = STEP
    shape: np.ndarray | None = None  # (d, d), see `first_shape`


def refined(
    given: ModelSetting, beginnings: Beginnings, name: str, seed: int = 0, *, jobs: int | Helpers = 1,
    stop: Callable[[], bool] | None = None, say: Callable[[int, int, float, str], None] | None = None,
    hopeless: float = math.inf,
) -> Attempt:  # fmt: skip
    """The best of where the search begins and what an evolution makes of it, with its score and its staying.

    Of parts of the frames there was an evolution each: what came of them is tried, and their mean, without another one.

    Parameters
    ----------
    beginnings : Beginnings
    name : str
        Of the attempt.
    jobs, stop, say
        As for `flockbrush.learning.recipe.learn`.
    hopeless : float
        If no candidate of the first generations has a smaller score, the beginning is returned, without a score.

    Raises
    ------
    WorkStopped
        When ``stop`` says so.
    """
    parts = list(beginnings.parts)
    forget()
    with Workers(given, jobs, stop=stop) as workers:
        begin = _best(workers, beginnings.places, seed)
        if parts:
            ends, worth = [*parts, *([np.mean(parts, axis=0)] if len(parts) > 1 else [])], []
        else:
            _, _, step, shape = beginnings
            cloud = Evolution(begin, step, SIZE, (seed, 62), shape)
            ends, worth = _evolved(given, workers, seed, cloud, say, hopeless)
        made = [Attempt("", seed, begin, begin)] if ends is None else _judged(workers, [begin, *ends], seed)
    chosen = min(made, key=lambda one: one.merit)
    chosen.name, chosen.seed, chosen.first_theta, chosen.loss = name, seed, begin, np.array(worth)
    return chosen


def _best(workers, begins, seed):
    """The one whose herds are nearest to the clips."""
    if len(begins) == 1:
        return begins[0]
    seeds = [seed + 4000 + k for k in range(SEEDS)]
    return begins[int(np.argmin([one["score"] for one in workers.map(attempt, [_task(x, seeds) for x in begins])]))]


def _evolved(given, workers, seed, cloud, say, hopeless):
    """The middle and the best of an evolution, and its scores; None and none of a hopeless one."""
    tried, worth = [], []
    for g in range(given.generations):
        asked = cloud.ask()
        seeds = [seed + 1000 + SEEDS * g + k for k in range(SEEDS)]
        scores = [one["score"] for one in workers.map(attempt, [_task(x, seeds, begin=SEEDS * g) for x in asked])]
        cloud.tell(scores)
        worth.append(min(scores))
        tried.append(asked[int(np.argmin(scores))])
        if say is not None:
            say(g + 1, given.generations + 1, min(worth), "evolution")
        if g + 1 == PATIENCE and min(worth) > hopeless:
            return None, []
    return ([np.clip(cloud.mean, 0.0, 1.0), tried[int(np.argmin(worth))]] if tried else []), worth


def _place(x):
    return {"theta": np.round(x, 12).tolist(), "extras": {}}


def _task(x, seeds, held=False, begin=0):
    """An `attempt`."""
    return {**_place(x), "seeds": seeds, "held": held, "begin": begin}


def _judged(workers, ends, seed) -> list[Attempt]:
    """Attempts with their scores on frames shown and held back, and with how far their herds stray in the long run."""
    seeds, factors = [seed + 2000 + k for k in range(LAST_SEEDS)], (1.0, *OTHER_NUMBERS)
    tried = workers.map(attempt, [_task(x, seeds, held) for x in ends for held in (False, True)])
    long = [{**_place(x), "seed": seed + 3000, "factor": factor} for x in ends for factor in factors]
    kept = workers.map(keep, long)
    made = []
    for k, x in enumerate(ends):
        shown, held = tried[2 * k : 2 * k + 2]
        staying = stayed(kept[len(factors) * k : len(factors) * (k + 1)])["score"]
        score = float(np.sqrt(0.5 * (shown["score"] ** 2 + held["score"] ** 2)))
        made.append(Attempt("", seed, x, x, score=score, figures=held["figures"], staying=staying))
    return made
