"""A brush's numbers of any kind of model: by the turns of animals where it has a likelihood, else by simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from flockbrush.behaviours.behaviour import Behaviour, behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.herd import Params
from flockbrush.behaviours.wander import lasting
from flockbrush.engine.files import refused
from flockbrush.film.observations import Evidence
from flockbrush.learning.battery import SHORTEST, Battery
from flockbrush.learning.confounding import correlation_of
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.initial_conditions import body_of, speed_of
from flockbrush.learning.learned_parameters import Attempt, Learned
from flockbrush.learning.likelihood import Likelihood, Slopes, likelihoods, place, read, scales_of, tension
from flockbrush.learning.model_search import (
    CHANCE,
    STEP,
    WIDE_STEP,
    Beginnings,
    ModelSetting,
    first_shape,
    refined,
    speed_by,
)
from flockbrush.learning.next_step import NextSteps
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.learning.rollout import LEAST, MOST, NAMES, theta_of
from flockbrush.learning.simulate import HerdParts, simulated
from flockbrush.learning.trials import answer_step, chance_found
from flockbrush.learning.turns import FREEDOM, cramer_rao, thinned
from flockbrush.learning.which_model import ModelRow, TurnBlocks, likeliest
from flockbrush.learning.workers import WorkStopped

SURE = 0.1  # of the range of a number: an identifiable one has a smaller error
WIDER = 1.2  # of what is left over to the wander it makes, as the recipe of the herd takes it
MOST_WANDER, QUIET = 2.0, 0.02  # rad/√s
SPAN = 4.0  # times the default up and down, within which a fit by simulation looks
SEES = VisionSpec(range=8.0)
RUNS = 2
CORRECTIONS = 4  # of answers, of which the best is taken
PACES = 1000  # turns by which the paces are known that a model asks for


def kinds_of_models() -> list[str]:
    """Names that ``--model`` takes besides auto: those with a likelihood, and models on the ground without one."""
    fitted = likelihoods()
    plain = [name for name, model in behaviours().items() if _by_simulation(model)]
    return sorted({*fitted, *plain})


def _by_simulation(model: Behaviour) -> bool:
    taken = {kind.model for kind in likelihoods().values()}
    return not (model.flight or model.formation or model.danger or model.has or model.name in taken)


def wander_of(spread: float, blocks: TurnBlocks) -> float:
    """How much animals wander, rad/√s, for `with_wander`: by what a fit leaves over beyond the noise of headings."""
    ticks = np.concatenate([turns.ticks for turns in blocks.reference])
    own = math.sqrt(max(spread**2 - blocks.noise**2, 0.0))
    span = max(float(ticks.mean()) * blocks.reference[0].dt, 1e-9)
    found = WIDER * own / math.sqrt(span * float(lasting(span, CHANCE["wander_time"][0])))
    return float(np.clip(found, 0.0, MOST_WANDER)) if found > QUIET else 0.0


def learned_model(
    clips: Sequence[Evidence], name: str, seed: int = 0, *, quick: bool = False, jobs: int | Helpers = 1,
    stop: Callable[[], bool] | None = None, say: Callable[[int, int, float, str], None] | None = None,
    hopeless: float = math.inf, parts: Sequence[Any] = (),
) -> Learned:  # fmt: skip
    """The numbers of one kind of model, by these frames alone.

    Parameters
    ----------
    quick : bool
        Without refinement by simulated herds.
    jobs, stop, say
        As for `flockbrush.learning.recipe.learn`; a search that is stopped leaves the fit to next steps.
    hopeless : float
        As for `refined`.
    parts : sequence of Parameters
        Learned from parts of these frames: the best of them and of the fit to next steps is chosen, with no new search.

    Raises
    ------
    LookupError
        When there is no such kind.
    ProblemsError
        When no turns are visible.
    """
    if name not in likelihoods():
        return _simulated_fit(clips, behaviours()[name], seed, parts, {"jobs": jobs, "stop": stop, "say": say})
    kind, blocks = likelihoods()[name], TurnBlocks(clips)
    if not blocks.reference:
        raise refused(clips[0].name, f"no turns of animals are visible: leave out --model {name}")
    vision, params = likeliest(kind, blocks, seed)
    train = blocks.train(vision)
    told = kind.told_by(train)
    slopes, x = Slopes(train, kind.behaviour, told, params), place(told, params)
    information, spread = _information(slopes, x)
    params, numbers = with_wander(params, wander_of(spread, blocks)), {**told, **kind.untold}
    steps = NextSteps(thinned(slopes.steps.turns, PACES))
    given = ModelSetting.of_model(clips, params, vision, numbers, steps)
    turns = max(float(slopes.steps.turns.weight.sum()), 1.0)
    begin, precision = place(given.numbers, params), tension(kind.prior, told, x)[1]
    shape = first_shape(list(given.numbers), information / turns, precision, STEP)
    start, stopped = Attempt(name, seed, begin, begin), False
    try:
        if not quick:
            tried = answering(given, kind, params, seed)
            places, ends = ([place(given.numbers, one) for one in those] for those in (tried, parts))
            beginnings = Beginnings(places, ends, shape=shape)
            start = refined(given, beginnings, name, seed, jobs=jobs, stop=stop, say=say, hopeless=hopeless)
    except (KeyboardInterrupt, WorkStopped):
        stopped = True
    x = start.theta[: len(told)]
    return _as_learned(kind, given, told, x, _information(slopes, x)[0], start, stopped)


def answering(given: ModelSetting, kind: Likelihood, params, seed: int) -> list:
    """Parameters by which herds wander and answer to their neighbours as the animals of the clips do, again corrected.

    Each correction is a step of a line through what was found before, and the next one may go too far.
    """
    found = []
    for _ in range(CORRECTIONS):
        params = _answering(given, kind, params, seed)
        found.append(params)
    return found


def _answering(given, kind, params, seed):
    if chance_of(params):
        params = params.model_copy(update=chance_found(given, place(given.numbers, params), {}, seed))
    step = answer_step(given, place(given.numbers, params), {}, seed)
    if step is None:
        return params
    if type(params) is Params:
        values = np.clip(theta_of(params)[: len(step)] + step, LEAST, MOST)
        return params.model_copy(update=dict(zip(NAMES, values.tolist(), strict=False)))
    return params.model_copy(update=read(kind.numbers, np.clip(place(kind.numbers, params) + step, 0.0, 1.0)))


def with_wander(params, wander: float):
    """Parameters with this wander, of turns that last as shortly as is searched for, if the model has any."""
    found = {"wander": wander, "wander_time": CHANCE["wander_time"][0]}
    return params.model_copy(update={name: found[name] for name in chance_of(params)})


def chance_of(params) -> dict[str, float]:
    """How parameters turn animals at random."""
    return {name: getattr(params, name) for name in CHANCE if name in type(params).model_fields}


def _information(slopes: Slopes, x):
    """(d, d) Fisher information of the numbers at positions x, and the spread of what they leave over, rad."""
    off = slopes.off(x)
    spread = slopes.score(off)[1]
    share = slopes.steps.turns.weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2) / spread**2
    return normal_equations(slopes.slopes(x, off), share, off)[1], spread


def _as_learned(kind: Likelihood, given: ModelSetting, numbers, x, information, start, stopped) -> Learned:
    names, deviation, params = tuple(numbers), cramer_rao(information), given.params(start.theta)
    told = (deviation < SURE) & (x > 0.005) & (x < 0.995)
    extras = chance_of(params)
    correlation, theta, spread = correlation_of(information), x, np.zeros(len(x))
    scales: np.ndarray | None = scales_of(numbers, x)
    if set(names) <= set(NAMES):  # the herd's twelve, of which those of obstacles may keep their defaults
        at = [NAMES.index(name) for name in names]
        theta, spread, names = theta_of(params), np.zeros(12), NAMES
        deviation, told, correlation = _spread_out(at, deviation, told, correlation)
        theta = np.clip(theta, LEAST, MOST)
        extras |= {"neighbour_range": params.neighbour_range}
        scales = None
    start = replace(start, theta=theta, first_theta=theta)
    how = "then refined by simulated herds" if np.isfinite(start.score) else "without simulations"
    notes = [f"model {kind.name}: {given.view.sight} sight, fitted to the next steps of the animals, {how}"]
    notes += ["learning was stopped: these are the best parameters so far"] if stopped else []
    return Learned(
        params, given.speed_of(params), given.body, given.view, theta, extras, [start], 0, spread, deviation, told,
        start.figures, notes, stopped, correlation, kind.model, names, kind.name, scales,
    )  # fmt: skip


def _spread_out(at, deviation, told, correlation):
    """The same of all twelve, of which only some were looked for."""
    wide, sure, alike = np.full(12, np.inf), np.zeros(12, bool), np.full((12, 12), np.nan)
    wide[at], sure[at], alike[np.ix_(at, at)] = deviation, told, correlation
    return wide, sure, alike


# without a likelihood ---------------------------------------------------------------------------


def simulation_numbers(model: Behaviour) -> dict[str, tuple[float, float]]:
    """Free parameters of a model and where they are looked for: about its defaults, within its own bounds."""
    found = {}
    for name, field in model.Params.model_fields.items():
        told = model.Params.model_json_schema()["properties"][name]
        if field.annotation is not float or told.get("chance") or "minimum" not in told or "maximum" not in told:
            continue
        low, high, usual = told["minimum"], told["maximum"], float(field.default)
        near = max(low, usual / SPAN), min(high, max(usual * SPAN, low + 0.1 * (high - low)))
        if near[1] > near[0]:
            found[name] = near
    return found


def _simulated_fit(clips, model: Behaviour, seed, parts, how) -> Learned:
    """By running herds and measuring how far they are from the clips."""
    numbers = simulation_numbers(model)
    given = ModelSetting.of_model(clips, model.Params(), SEES, numbers)
    begin = place(given.numbers, given.base)
    start, stopped = Attempt(model.name, seed, begin, begin), False
    try:
        ends = [place(given.numbers, part) for part in parts]
        start = refined(given, Beginnings([begin], ends, WIDE_STEP), model.name, seed, **how)
    except (KeyboardInterrupt, WorkStopped):
        stopped = True
    params, x = given.params(start.theta), start.theta[: len(numbers)]
    start = replace(start, theta=x, first_theta=x)
    notes = [f"model {model.name}: it has no likelihood; fitted by simulation, which identifies no single parameter"]
    d = len(numbers)
    return Learned(
        params, given.speed, given.body, SEES, x, chance_of(params), [start], 0,
        np.zeros(d), None, np.zeros(d, bool), start.figures, notes, stopped, None, model.name, tuple(numbers),
        model.name, scales_of(numbers, x),
    )  # fmt: skip


def distance_of(battery: Battery, parts, seeds) -> float:
    """Root mean square deviation of a herd, in limits, over the measures that the clip determines."""
    rows = battery.compared([battery.measured(simulated(battery.clip, parts, seed)) for seed in seeds])
    far = [row.far for row in rows]
    return float(np.sqrt(np.mean(np.square(far)))) if far else math.nan


def add_distances(rows: list[ModelRow], clips: Sequence[Evidence], seed: int = 0) -> None:
    """Fill in how far the herds of each model are from frames that it was fitted without, if these are not too few."""
    clips = list(clips)
    half = len(clips[0].fields) // 2
    seen, held = (
        (clips[:1], clips[1]) if len(clips) > 1
        else ([clips[0].part(slice(None, half))], clips[0].part(slice(half, None)))
    )  # fmt: skip
    blocks = TurnBlocks(seen)
    if len(held.fields) < SHORTEST * held.fps or not blocks.reference:
        return
    battery, speed, body = Battery.of(held), speed_of(seen), body_of(seen)
    for row in rows:
        params = row.halves[-1]
        params = with_wander(params, wander_of(row.spread, blocks))
        own = speed_by(NextSteps(thinned(blocks.train(row.vision), PACES)), params, speed)
        row.distance = distance_of(battery, HerdParts(params, own, body, row.vision), range(seed, seed + RUNS))
