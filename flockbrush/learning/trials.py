"""Trials on clips: descents, and herds that are simulated, compared with the clip and tested for stability.

Each is a task of its own, of numbers that JSON can hold, so that processes can share them and work that was done can be
kept (`flockbrush.learning.workers`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec
from flockbrush.behaviours.wander import lasting
from flockbrush.film.observations import Evidence
from flockbrush.learning.battery import SHORTEST, Battery
from flockbrush.learning.confounding import correlation_of
from flockbrush.learning.herd_views import followed
from flockbrush.learning.initial_conditions import body_of, resized_among, speed_of, start_of
from flockbrush.learning.interaction import interaction_of
from flockbrush.learning.learned_parameters import forces_of
from flockbrush.learning.response import SPAN, correction, response, scatters, turns_seen
from flockbrush.learning.rollout import LEAST, MOST, Surroundings, params_of, rollout
from flockbrush.learning.scores import LOOKS, ClipTarget, distance, order_off, total
from flockbrush.learning.simulate import HerdParts
from flockbrush.learning.turns import all_turns, fit_turns, theta_seen, thinned, turns_of

USE = frozenset({"occlusion", "angular", "density", "variance"})  # what section 7.2 of the paper takes away, one by one
WHERE_DENSITY_COUNTS = (
    "aspect",
    "spread",
    "density",
    "nearest neighbour",
    "largest part",
    "neighbours",
    "spacing",
    "pairs",
)
WHERE_ORDER_COUNTS = ("order nearby", "directions")
HELD = 0.3  # of the frames, at the end, are held back until the choice
FEWEST = 24  # frames, with fewer nothing is held back
BEGINS = 0.0, 0.25, 0.5  # of the frames that are used, at which trials begin
BEYOND = (10.0, 16.0)  # s, a herd is run on after the clip: four times its length, within
DESCENT = 120  # steps on fields
FEW, MANY = 3000, 12_000  # turns that a descent looks at, first and last
LONG_SPAN = 0.2  # s over which a turn is taken in first fits: less disturbed by noise than `SPAN`
OFF = "of its limit, "  # before the name of a measure of the battery: how many limits a herd is off
LIMIT = 2.0  # deviations that count as much as a limit of the battery
MOST_WANDER, WANDERS = 2.5, 1.5  # rad/√s; s of a herd by which it is found
TURN_SPANS = SPAN, 0.5  # s over which random turns are looked at
WANDER_TIMES = np.geomspace(0.125, 2.0, 33)  # s for which random turns may go on: four ticks of a level or more
CLOSER = 3  # times that random turns are corrected
ANSWERS = 2  # runs by which numbers are corrected
STAY = 20.0  # s
OTHER_NUMBERS = 0.25, 4.0  # factors of the number of animals
LOST = 4.0  # deviations from what it was, from which on a herd is just another one
TOO_MANY = 600  # animals: larger herds are not tried, except by the report
RULES = "neighbour_range", "leader_neighbours", "leader_cone"  # parameters by which turns are chosen
SIGHTS = 4.0, 8.0, 16.0  # BL
HIDDEN = 0.1  # of a number, by which smoothed turns put it off, about
NEAR, ALIKE = 40, 0.05  # steps to the likeliest numbers; nats a turn by which others are about as likely


@dataclasses.dataclass(frozen=True)
class SearchSettings:
    """What is searched, and how long.

    Attributes
    ----------
    seed : int
        Of all chance.
    starts : int
        Random ones; the shipped brushes are tried besides.
    use : set of {"occlusion", "angular", "density", "variance"}
        What of the model and of the clip is made use of (section 7.2 of the paper).
    beta : float
        How much density counts against velocity in the descent on fields (eq. 11).
    budget_s : float
        Trials and evolution, in seconds of one usual core; counted in work, so that the clock changes nothing.
    speed, body : SpeedSpec, BodySpec, optional
        Instead of what the clip says.
    brushes : bool
        Begin with the shipped brushes, too.
    begins : list of (str, (12,) ndarray, dict), optional
        Names, numbers and other parameters to begin with, instead of random ones and the shipped brushes.
    device : str
        Of descents on fields alone, which need torch: "cpu", "cuda", or "auto" for a graphics card where there is one.
    quick : bool
        Only the random starts are fitted and fewer candidates tried; nobody asks whether they stay what they are.
    """

    seed: int = 0
    starts: int = 5
    use: frozenset[str] = USE
    beta: float = 0.5
    budget_s: float = 90.0
    speed: SpeedSpec | None = None
    body: BodySpec | None = None
    brushes: bool = True
    begins: Sequence[tuple] | None = None
    device: str = "auto"
    quick: bool = False


@dataclasses.dataclass(frozen=True)
class Setting:
    """What all tasks are given: the clips, and what follows from them directly."""

    wander_times: ClassVar[np.ndarray] = WANDER_TIMES  # s for which random turns may go on
    clips: tuple  # of Evidence, all frames
    seen: tuple  # of Evidence, without what is held back
    held: tuple  # of Evidence, what is held back
    speed: SpeedSpec
    body: BodySpec
    use: frozenset[str]  # of `USE`: parts that are left out leave what animals do, and every loss and score
    beta: float
    device: str = "auto"  # of descents on fields: cpu, cuda, or a graphics card where there is one

    @classmethod
    def of(cls, clips: Sequence[Evidence], settings: SearchSettings) -> Setting:
        """Of these clips, with the last frames of each held back."""
        cut = [len(c.fields) - round(HELD * len(c.fields)) if len(c.fields) >= FEWEST else 0 for c in clips]
        seen = tuple(c.part(slice(0, k)) if k else c for c, k in zip(clips, cut, strict=True))
        back = tuple(c.part(slice(k, None)) if k else c for c, k in zip(clips, cut, strict=True))
        speed = speed_of(list(clips)) if settings.speed is None else settings.speed
        body = body_of(list(clips)) if settings.body is None else settings.body
        return cls(tuple(clips), seen, back, speed, body, frozenset(settings.use), settings.beta, settings.device)

    def vision(self, extras):
        """What animals see, as far as they respond to it."""
        return VisionSpec(range=extras.get("neighbour_range", SIGHTS[0]), occlusion="occlusion" in self.use)

    def brush(self, theta, extras):
        """A brush with these numbers."""
        return HerdParts(params_of(theta, extras), self.speed, self.body, self.vision(extras))

    @property
    def ignore(self) -> tuple[str, ...]:
        """Measures that are not compared."""
        without_density = () if "density" in self.use else WHERE_DENSITY_COUNTS
        return without_density + (() if "variance" in self.use else WHERE_ORDER_COUNTS)


# by clip, in this process: what many tasks ask for; with the clip, so that ids stay its
_known: dict[tuple, tuple] = {}


def descend(given: Setting, theta, extras, seed, rows=FEW, span=LONG_SPAN):
    """One descent: {theta, extras, loss, by_turns}."""
    if all(followed(clip) for clip in given.seen):
        found = _descend_on_turns(given, np.array(theta), dict(extras), rows, span)
        if found is not None:
            return found
    return _descend_on_fields(given, np.array(theta), dict(extras), seed)


def _free(given):
    """(12,) bool, what may change: without angular ranges all directions count alike."""
    free = np.ones(12, bool)
    if "angular" not in given.use:
        free[2::3] = False
    return free


def _descend_on_turns(given, theta, extras, rows, span):
    """As `descend`; None if no turns are known, as in a region so narrow that all animals may see beyond it."""
    turns, params, free = _turns(given, extras, span), params_of(theta, extras), _free(given)
    if turns is None or not len(turns.ticks):
        return None
    some = thinned(turns, rows)
    fit = fit_turns(some, theta, params, free=free, tolerance=1e-5)
    theta = theta_seen(fit, some, free).tolist()
    return {"theta": theta, "extras": extras, "loss": fit.loss.tolist(), "by_turns": True}


def wandering(given: Setting, theta, extras, seed):
    """{wander, wander_time, theta}: of `chance_found`, and forces corrected for what random turns hide of them."""
    chance = chance_found(given, theta, extras, seed)
    answering = chance["wander"] > 0.0
    return chance | {"theta": _answering(given, theta, extras | chance, seed) if answering else list(theta)}


def chance_found(given: Setting, theta, extras, seed) -> dict[str, float]:
    """{wander, wander_time}, rad/√s and s, by which turns scatter about forces as those of the clips do.

    Herds are observed as the clips are, one that does not wander and others that do: the variance of turns grows with
    the square of wander, and with the span over which they are looked at as random turns last
    (`flockbrush.behaviours.wander.lasting`).
    """
    parts, time = [_beginning(clip) for clip in given.seen], float(given.wander_times[0])

    def variances(wander, time):
        """(2 spans, 2): of the clips, and of a herd that wanders so much."""
        brush, found = given.brush(theta, extras | {"wander": wander, "wander_time": time}), []
        for k, clip in enumerate(parts):
            run = simulate(clip, brush.params, brush.speed, given.body, brush.vision, [seed, k, 3])
            found.append([scatters(clip, brush, run, _turns_seen(clip, brush, span), span) for span in TURN_SPANS])
        known = [pairs for pairs in found if None not in pairs]
        return np.mean(np.square(known), axis=0) if known else np.zeros((2, 2))

    clip, still = variances(0.0, time).T
    left = np.maximum(clip - still, 0.0)
    if not left[0] > 0.0:
        return {"wander": 0.0, "wander_time": time}
    wander = min(float(np.sqrt(left[0] / TURN_SPANS[0])), MOST_WANDER)
    shares = np.array([lasting(TURN_SPANS, time) for time in given.wander_times])
    for _ in range(CLOSER):  # forces act against turns that last longer by more
        more = left / np.maximum(variances(wander, time)[:, 1] - still, 1e-9)
        now = lasting(TURN_SPANS, time)
        time = float(np.interp(more[1] / more[0] * now[1] / now[0], shares[:, 1] / shares[:, 0], given.wander_times))
        wander = min(float(wander * np.sqrt(more[0] * now[0] / lasting(TURN_SPANS[0], time))), MOST_WANDER)
    return {"wander": wander, "wander_time": time}


def _answering(given, theta, extras, seed):
    """The numbers of a herd, changed by `answer_step`."""
    theta, step = np.array(theta, float), answer_step(given, theta, extras, seed)
    if step is not None:
        theta[:9] = np.clip(theta[:9] + np.where(_free(given)[:9], step, 0.0), LEAST, MOST)
    return theta.tolist()


def answer_step(given: Setting, theta, extras, seed) -> np.ndarray | None:
    """By how much to change numbers so that herds answer to their neighbours as the animals of the clips do.

    Of the numbers that `flockbrush.learning.response` knows of the model; None if too few turns are seen.
    """
    brush, steps = given.brush(theta, extras), []
    for k, clip in enumerate(_beginning(clip) for clip in given.seen):
        how = clip, brush.params, brush.speed, given.body, brush.vision
        runs = [simulate(*how, [seed, k, 4 + run]) for run in range(ANSWERS)]
        steps.append(correction(clip, brush, runs, _turns_seen(clip, brush)))
    known = [step for step in steps if step is not None]
    return np.mean(known, axis=0) if known else None


def _beginning(clip):
    return _kept(("beginning",), clip, lambda: clip.part(slice(0, round(WANDERS * clip.fps) + 1)))


def stiffness(given: Setting, theta, extras) -> np.ndarray | None:
    """(12, 12) Fisher information of the numbers in one turn; None without turns."""
    turns = _turns(given, extras, SPAN) if all(followed(clip) for clip in given.seen) else None
    if turns is None or not len(turns.rows):
        return None
    few = thinned(turns, MANY)
    return fit_turns(few, theta, params_of(theta, extras), steps=0).information / few.weight.sum()


def certainty(given: Setting, theta, extras, others=()) -> tuple[np.ndarray, np.ndarray] | None:
    """(error (12,), correlation (12, 12)) of the given numbers, from the turns; None without turns.

    The error is made of what the turns leave open (Cramér-Rao), of how far the likeliest numbers near by are, of the
    scatter of ``others``, (theta, extras), by which turns are about as likely or likelier, and of what smoothing hides
    of turns.
    """
    if not all(followed(clip) for clip in given.seen):
        return None
    turns = _turns(given, extras, LONG_SPAN)
    if turns is None or not len(turns.ticks):
        return None

    def fit(numbers, rows, steps=0):
        return fit_turns(thinned(turns, rows), numbers, params_of(numbers, extras), free=_free(given), steps=steps)

    here, near = fit(theta, MANY), fit(theta, MANY, NEAR).theta
    same = [np.concatenate([forces_of(other, own)[:9], theta[9:]]) for other, own in others]
    for one in same:
        one[:9:3] *= 10.0 / params_of(theta, extras).sensitivity
    worths = [fit(one, FEW).loss[-1] for one in same]
    limit = min(*worths, fit(near, FEW).loss[-1], np.inf) + ALIKE
    alike = [near, *(one for one, worth in zip(same, worths, strict=True) if worth < limit)]
    off = np.fmax(np.abs(near - theta), np.sqrt(np.mean(np.square(alike - theta), axis=0)))
    error = np.sqrt(here.deviation**2 + off**2 + (HIDDEN * np.asarray(theta)) ** 2)
    return np.minimum(error, 1e6), correlation_of(here.information)


def interaction(given: Setting, theta, extras):
    """The part of the turns that forces with these numbers explain: an `Interaction` as dict; {} without turns."""
    if not all(followed(clip) for clip in given.seen):
        return {}
    turns = _turns(given, extras, LONG_SPAN)
    if turns is None or not len(turns.rows):
        return {}
    frames = max(LONG_SPAN * clip.fps for clip in given.seen)
    return dataclasses.asdict(interaction_of(turns, theta, extras, frames))


def _turns(given, extras, span):
    """The turns of all clips, as animals with this sight and this rule of leaders would make them."""
    params = params_of(np.ones(12), extras)

    def seen():
        parts = [turns_of(clip, given.body, given.vision(extras), params, span=span) for clip in given.seen]
        parts = [part for part in parts if part is not None]
        return all_turns(parts) if parts else None

    rules = (getattr(params, name) for name in RULES)
    return _kept(("all turns", span, *rules), given, seen)


def _descend_on_fields(given, theta, extras, seed):
    from flockbrush.learning.torch_descent import FollowedClip
    from flockbrush.learning.torch_descent import descend as descend_on_fields

    how = given.use, given.beta, given.speed, given.body, given.vision(extras), extras, given.device
    clips = [FollowedClip(clip, *how) for clip in given.seen]
    found = descend_on_fields(clips, theta, free=_free(given), seed=seed, steps=DESCENT)
    loss = np.asarray(found.losses).tolist()
    return {"theta": found.theta.tolist(), "extras": extras, "loss": loss, "by_turns": False}


def attempt(given: Setting, theta, extras, seeds, held, begin=0):
    """Run herds with these numbers and compare them with the clips: {score, figures}.

    ``held``: on the frames held back and from the end on; else on those that may be seen, one seed from their
    beginning, the next from later on (`BEGINS`), ``begin`` for the first.
    """
    runs = [
        [trial(given, theta, extras, seed, held, lasting, 0 if held else begin + turn) for lasting in (False, True)]
        for turn, seed in enumerate(seeds)
    ]
    return scored(runs)


def scored(runs: Sequence[Sequence[list]]):
    """{score, figures} of a candidate by its `trial`s: of each seed those beside the clip, then those that last."""
    clip, lasting = (
        means_of([part for parts in zip(*(run[k] for run in runs), strict=True) for part in parts]) for k in (0, 1)
    )
    beside, lasts = squares(clip), total(lasting) ** 2
    if len(beside) > 1:  # what the verdict asks of the long run is less strict, too
        lasts /= LIMIT**2
    score = float(np.sqrt(np.mean([*beside, lasts])))
    figures = clip | {f"lasting {name}": value for name, value in lasting.items()}
    return {"score": score, "figures": dict(sorted(figures.items()))}


def squares(parts: dict[str, float]) -> list[float]:
    """The square of a distance beside a clip, and that of what is off in the battery, where that is known."""
    plain = {name: value for name, value in parts.items() if not name.startswith(OFF)}
    limits = [value for name, value in parts.items() if name.startswith(OFF)]
    worst = [LIMIT**2 * float(np.sqrt(np.mean(np.power(limits, 4.0))))] if limits else []  # no measure may be far off
    return [total(plain) ** 2, *worst]


def means_of(parts: Sequence[dict[str, float]]):
    """The mean of each measure."""
    names = sorted({name for part in parts for name in part})
    return {name: float(np.mean([part[name] for part in parts if name in part])) for name in names}


def trial(given: Setting, theta, extras, seed, held, lasting, begin=0):
    """How far a herd is from each clip, by measure: as long as the clip goes on, or ``lasting``, well beyond."""
    return [_tried(given, k, theta, extras, seed, held, lasting, begin) for k in range(len(given.clips))]


def _tried(given, k, theta, extras, seed, held, lasting, begin):
    clip, shown = given.clips[k], (given.held if held else given.seen)[k]
    if not lasting:
        part, target = _from(shown, begin)
        span = (len(part.fields) - 1) / part.fps
        run = _run(given, part, theta, extras, [seed, k, 0], 0, span)
        return _not_ignored(given, distance(run, part, target)) | _of_limits(given, part, theta, extras, run)
    whole = clip if held else shown
    length = float(np.clip(4.0 * len(whole.fields) / whole.fps, *BEYOND))
    target = _from(whole)[1]
    return _compared(given, whole, target, theta, extras, [seed, k, 1], len(whole.fields) - 1, length)


def _from(clip, begin=0):
    """What is left of a clip from one of `BEGINS` on, and what it is like, in deviations of the whole clip."""
    begin = begin % len(BEGINS) if len(clip.fields) >= FEWEST else 0

    def left():
        if not begin:
            return clip, ClipTarget.of(clip)
        part = clip.part(slice(round(BEGINS[begin] * len(clip.fields)), None))
        return part, dataclasses.replace(ClipTarget.of(part), scale=_from(clip)[1].scale)

    return _kept(("from", begin), clip, left)


def _compared(given, clip, target, theta, extras, seed, frame, seconds):
    """The distance of one run from what should last of a clip, by measure."""
    run = _run(given, clip, theta, extras, seed, frame, seconds, LOOKS)
    return _not_ignored(given, distance(run, clip, target, True))


def _run(given, clip, theta, extras, seed, frame, seconds, looks=None):
    brush = given.brush(theta, extras)
    return simulate(clip, brush.params, brush.speed, given.body, brush.vision, seed, frame, seconds, looks)


def _of_limits(given, clip, theta, extras, run):
    """How many limits of the battery a run is off by measure, where animals are followed for long enough."""
    if not followed(clip) or len(clip.fields) < SHORTEST * clip.fps:
        return {}
    brush, battery = given.brush(theta, extras), _kept(("battery",), clip, lambda: Battery.of(clip))
    rows = battery.compared([battery.measured(run)]) + response(clip, brush, [run], _turns_seen(clip, brush))
    return {OFF + name: far for name, far in _not_ignored(given, {row.name: row.far for row in rows}).items()}


def _turns_seen(clip, brush, span=SPAN):
    """A function that gives the turns seen in a clip; they hang on no other numbers of the brush than these."""
    params = brush.params
    sight = "turns", span, brush.vision, *(getattr(params, name, None) for name in RULES)
    return lambda: _kept(sight, clip, lambda: turns_seen(clip, clip.sightings, brush, span))


def _not_ignored(given, parts):
    return {name: value for name, value in parts.items() if name not in given.ignore}


def keep(given: Setting, theta, extras, seed, factor):
    """How far herds with these numbers stray from what the clips are in the long run, for each clip: for `stayed`.

    Each goes on from the last frame for `STAY` seconds, with ``factor`` times as many animals; of others than as many
    only order and turning are compared.  Clips that see part of a herd are left out, and larger herds than `TOO_MANY`.
    """
    strayed = []
    for k, clip in enumerate(given.clips):
        if not clip.fields.holds_all:
            continue
        last, target = len(clip.fields) - 1, _from(clip)[1]
        if factor == 1.0:
            strayed.append(_strayed(_compared(given, clip, target, theta, extras, [seed, k, 2], last, STAY)))
            continue
        herd, around = resized_among(start_of(clip, last, seed, given.body), _around(clip).walls, factor, seed)
        if not 2 <= len(herd) <= TOO_MANY:
            continue
        brush = given.brush(theta, extras)
        run = rollout(
            herd, brush.params, brush.speed, given.body, brush.vision, seconds=STAY, fps=LOOKS / STAY, seed=seed,
            around=around,
        )  # fmt: skip
        parts = _not_ignored(given, order_off(run, clip, target))
        if parts:  # a photograph shows neither order nor turning
            strayed.append(_strayed(parts))
    return strayed


def stayed(found):
    """{score, figures} of a candidate, by what `keep` returned for one time as many animals and for `OTHER_NUMBERS`."""
    names = ["as many", *(f"{factor:g} times as many" for factor in OTHER_NUMBERS)]
    figures = {name: float(np.mean(values)) for name, values in zip(names, found, strict=True) if values}
    others = [value for name, value in figures.items() if name != "as many"]
    halves = [figures["as many"], float(np.mean(others)) if others else figures["as many"]] if figures else [0.0]
    return {"score": float(np.sqrt(np.mean(np.square(halves)))), "figures": figures}


def _strayed(parts):
    """One number of the parts of a distance; all that are lost are equally lost, and chance decides nothing there."""
    return total({name: min(value, LOST) for name, value in parts.items()})


def simulate(clip: Evidence, params, speed, body, vision, seed=0, frame=0, seconds=None, looks=None):
    """A herd with these numbers, started like a frame of the clip; default: to the end of the clip.

    Seen as often as the clip, or about ``looks`` times where nobody comes and goes between.
    """
    entropy = np.random.SeedSequence(seed).generate_state(2)
    seconds = (len(clip.fields) - 1 - frame) / clip.fps if seconds is None else seconds
    around = _around(clip)
    fps = clip.fps if looks is None or around.gates is not None else looks / seconds
    start = start_of(clip, frame, int(entropy[0]), body)
    seed = int(entropy[1])
    return rollout(start, params, speed, body, vision, seconds=seconds, fps=fps, seed=seed, around=around)


def _around(clip):
    """What is around the animals of a clip."""
    return _kept(("around",), clip, lambda: Surroundings.of(clip.fields))


def _kept(what, of, made):
    """Something of a clip, or of all clips, that is made once in a learning."""
    key = *what, id(of)
    if key not in _known:
        _known[key] = of, made()
    return _known[key][1]


def forget():
    """Drop what was kept from trial to trial of one learning."""
    _known.clear()
