"""Likelihoods of models and their registry: estimation of parameters from the turns of animals.

A likelihood is one file in ``flockbrush/learning/likelihoods`` that registers itself::

    register(Likelihood("zones", "zones", VIEWS, fitted, NUMBERS))

The folder is scanned; third parties register through the entry point group ``flockbrush.likelihoods``.  A model without
one is fitted by simulation (`flockbrush.learning.model_fit`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial, update_wrapper
from typing import Any

import numpy as np

from flockbrush.behaviours.behaviour import Behaviour, Parameters, behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.engine.plugins import PluginError, blaming, file_of, load_entry_points, load_modules
from flockbrush.engine.problems import Problem, did_you_mean
from flockbrush.learning.evolution import Evolution
from flockbrush.learning.next_step import NextSteps, mean_score
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.learning.turns import FREEDOM, Turns, thinned

FEW, MANY = 300, 1000  # turns that a search looks at, first and last
STARTS, SIZE, GENERATIONS = 3, 8, 5  # of a search: places to begin, candidates, generations
FIRST_STEP, DIFFERENCE = 0.25, 0.01  # of a range: the width of the first generation; what slopes are measured by
STEPS, LAST_STEPS = 8, 6  # of descents on few and on many turns
DAMPING, MOST_DAMPING = 1e-2, 1e4
BETTER = 1e-4  # of the likelihood of a turn: a descent ends when a step gains less


# by how many standard deviations (r,) values of free parameters are off what is expected of them; linear in the values
Prior = Callable[[Mapping[str, float]], np.ndarray]


@dataclass(frozen=True)
class Likelihood:
    """Estimation of one kind of model from turns."""

    name: str  # as ``flockbrush learn --model`` names it
    model: str  # of behaviour, as a brush names it
    views: tuple[VisionSpec, ...]  # perceptions that are tried; the likeliest is kept
    # ``fit(turns, vision, seed, begin) -> Params``: the likeliest parameters with that perception; near ``begin``,
    # which are parameters of other turns or another perception, where that is not None
    fit: Callable[[Turns, VisionSpec, int, Any], Any]
    # str to (float, float); free parameters and the range they are looked for in
    numbers: Mapping[str, tuple[float, float]]
    # the same for parameters of which turns tell nothing: only simulated herds refine them
    untold: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # the same for parameters of which only turns tell whose animals see obstacles
    by_walls: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # whether it assumes little of how answers fall with distance: then it is learned wherever it may be the right one
    general: bool = False
    prior: Prior | None = None  # what is expected of the free parameters

    def told_by(self, turns: Turns) -> dict[str, tuple[float, float]]:
        """Free parameters that these turns determine, with their search ranges."""
        return {**self.numbers, **(self.by_walls if len(turns.percept.walls_offset) else {})}

    @property
    def behaviour(self) -> Behaviour:
        """The model; `PluginError` where there is none, or it lacks a parameter of `numbers`."""
        model = behaviours().get(self.model)
        if model is None:
            raise self._problem(f"there is no model {self.model!r}{did_you_mean(self.model, behaviours())}")
        for name in (*self.numbers, *self.untold, *self.by_walls):
            if name not in model.Params.model_fields:
                known = did_you_mean(name, model.Params.model_fields)
                raise self._problem(f"model {self.model!r} has no parameter {name!r}{known}")
        return model

    def _problem(self, text):
        return PluginError([Problem(file_of(self.fit.__module__), None, None, f"likelihood {self.name!r}: {text}")])


_registry: dict[str, Likelihood] = {}


def register(likelihood: Likelihood) -> Likelihood:
    """Register a likelihood; errors of its functions name it.  ValueError when its name is taken."""
    if likelihood.name in _registry:
        raise ValueError(f"there is a likelihood {likelihood.name!r} already")
    prior = likelihood.prior and partial(_expected, likelihood)
    told = replace(likelihood, fit=update_wrapper(partial(_fitted, likelihood), likelihood.fit), prior=prior)
    _registry[likelihood.name] = told
    return told


def _fitted(likelihood, turns, vision, seed, begin):
    with blaming("likelihood", likelihood.name, likelihood.fit.__module__):
        params, wanted = likelihood.fit(turns, vision, seed, begin), likelihood.behaviour.Params
        if not isinstance(params, wanted):
            must = f"must return {wanted.__name__} of model {likelihood.model!r}"
            raise TypeError(f"likelihood {likelihood.name!r} {must}, got {type(params).__name__}")
        return params


def _expected(likelihood, values):
    with blaming("likelihood", likelihood.name, likelihood.fit.__module__):
        return likelihood.prior(values)


@cache
def _scan() -> None:
    import flockbrush.learning.likelihoods as package

    load_modules(package)
    load_entry_points("flockbrush.likelihoods")


def likelihoods() -> dict[str, Likelihood]:
    """All likelihoods by name, in order of name."""
    _scan()
    return dict(sorted(_registry.items()))


def likelihood_of(params) -> Likelihood | None:
    """That of the model of these parameters; None where there is none."""
    return next((kind for kind in likelihoods().values() if kind.behaviour.Params is type(params)), None)


# numbers between 0 and 1 ------------------------------------------------------------------------


def read(numbers: Mapping[str, tuple[float, float]], x) -> dict[str, float]:
    """Parameters of positions (d,) between 0 and 1 in their ranges: logarithmic where these begin above 0."""
    return {
        name: float(low * (high / low) ** u) if low > 0 else float(low + (high - low) * u)
        for (name, (low, high)), u in zip(numbers.items(), x, strict=True)
    }


def place(numbers: Mapping[str, tuple[float, float]], params) -> np.ndarray:
    """The inverse of `read`, (d,), kept between 0 and 1."""
    out = []
    for name, (low, high) in numbers.items():
        value = float(getattr(params, name))
        out.append(np.log(max(value, low) / low) / np.log(high / low) if low > 0 else (value - low) / (high - low))
    return np.clip(out, 0.0, 1.0)


def scales_of(numbers: Mapping[str, tuple[float, float]], x) -> np.ndarray:
    """By how much parameters change with their positions, (d,)."""
    values = read(numbers, x)
    return np.array([
        values[name] * np.log(high / low) if low > 0 else high - low for name, (low, high) in numbers.items()
    ])  # fmt: skip


def tension(prior: Prior | None, numbers, x) -> tuple[np.ndarray, np.ndarray]:
    """The pull (d,) of a prior on positions in the ranges of numbers, and its precision (d, d); zeros without one."""
    d = len(x)
    if prior is None:
        return np.zeros(d), np.zeros((d, d))
    here = prior(read(numbers, x))
    steps = np.array([prior(read(numbers, x + DIFFERENCE * one)) - here for one in np.eye(d)]) / DIFFERENCE
    return -steps @ here, steps @ steps.T


def searched(
    turns: Turns, model: Behaviour, numbers, base: Parameters, seed: int, begin=None, prior: Prior | None = None
) -> Parameters:
    """The likeliest parameters of a model without derivatives.

    From several places a short evolution, then damped Gauss-Newton steps with differences for slopes: few animals stand
    at the edge of a zone, so that what has kinks for one is smooth for all.

    Parameters
    ----------
    numbers : mapping of str to (float, float)
        What is looked for, and where.
    base : Params
        The other parameters, and one of the places to begin.
    begin : Params, optional
        Look near these only.
    prior : Prior, optional
        What is expected of them besides.
    """
    many = Slopes(thinned(turns, MANY), model, numbers, base, prior)
    if begin is not None:
        return many.params(many.descended(place(numbers, begin), LAST_STEPS)[1])
    few, chance = Slopes(thinned(turns, FEW), model, numbers, base, prior), np.random.default_rng([seed, 61])
    begins = [place(numbers, base), *chance.uniform(0.1, 0.9, (STARTS - 1, len(numbers)))]
    ends = [few.descended(_evolved(few.loss, x, (seed, k))[1], STEPS) for k, x in enumerate(begins)]
    return many.params(many.descended(min(ends, key=lambda end: end[0])[1], LAST_STEPS)[1])


def _evolved(loss, centre, seed):
    """(loss, position) of the best candidate."""
    cloud, best = Evolution(centre, FIRST_STEP, SIZE, seed), (loss(np.asarray(centre)), np.asarray(centre))
    for _ in range(GENERATIONS):
        asked = cloud.ask()
        losses = [loss(x) for x in asked]
        cloud.tell(losses)
        k = int(np.argmin(losses))
        best = min(best, (losses[k], asked[k]), key=lambda end: end[0])
    return best


class Slopes:
    """The likelihood of turns by positions between 0 and 1, and the way down."""

    def __init__(self, turns, model, numbers, base, prior: Prior | None = None):
        self.steps, self.model, self.numbers, self.base = NextSteps(turns), model, numbers, base
        self.prior = prior

    def params(self, x):
        """The parameters at a place."""
        return self.base.model_copy(update=read(self.numbers, x))

    def off(self, x):
        """(k,) rad by which the animals turned otherwise."""
        return self.steps.off(self.model, self.params(x))

    def score(self, off):
        """(logarithm of the likelihood a turn, spread) of differences."""
        return mean_score(off, self.steps.turns.weight)

    def loss(self, x):
        """To be made small."""
        return self.strain(x) - mean_score(self.off(x), self.steps.turns.weight)[0]

    def strain(self, x):
        """What the prior takes from the likelihood of a turn."""
        if self.prior is None:
            return 0.0
        unexpected = self.prior(read(self.numbers, x))
        return 0.5 * float(unexpected @ unexpected) / max(float(self.steps.turns.weight.sum()), 1.0)

    def slopes(self, x, off):
        """(k, d) of what is predicted, by differences to the side where there is room."""
        made = np.empty((len(off), len(x)))
        for q in range(len(x)):
            aside, by = x.copy(), DIFFERENCE if x[q] < 0.5 else -DIFFERENCE
            aside[q] += by
            made[:, q] = (off - self.off(aside)) / by
        return made

    def descended(self, x, steps):
        """(loss, place) after some steps, none of which goes up."""
        weight, x, damping = self.steps.turns.weight, np.array(x, float), DAMPING
        off = self.off(x)
        score, spread = mean_score(off, weight)
        score -= self.strain(x)
        for _ in range(steps):
            slopes, was = self.slopes(x, off), score
            share = weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2)
            pull, system = normal_equations(slopes, share, off)
            if self.prior is not None:
                back, precision = tension(self.prior, self.numbers, x)
                pull, system = pull + spread**2 * back, system + spread**2 * precision
            scale = np.diag(system) + 1e-9 * max(float(np.diag(system).max()), 1e-30)
            while damping < MOST_DAMPING:
                trial = np.clip(x + np.linalg.solve(system + np.diag(damping * scale), pull), 0.0, 1.0)
                off_there = self.off(trial)
                there, wide = mean_score(off_there, weight)
                there -= self.strain(trial)
                if there > score:
                    x, off, score, spread, damping = trial, off_there, there, wide, max(damping / 5.0, 1e-6)
                    break
                damping *= 6.0
            if score - was < BETTER:
                break
        return -score, x
