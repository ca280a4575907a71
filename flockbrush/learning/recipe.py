"""From the observations of a clip to a brush: starts, descents, trials, evolution, and uncertainty.

1. Speed, bodies and the way animals begin follow from the clip directly (`flockbrush.learning.initial_conditions`).
2. **Starts**: some at random, the numbers of every shipped brush of the herd model that was not itself learned, and, of
   fields alone and photographs, draws that are only tried: a descent on fields gains little.
3. **Descent** of each: on the turns of single animals where they are told apart (`flockbrush.learning.turns`), else on
   the fields (`flockbrush.learning.torch_descent`, the paper's way [1]_).  The best fits to turns wander so far
   and for so long that herds, observed as the clip is, scatter about what forces say as its animals do, and their
   forces are corrected for what these random turns hide; herds with twice the forces are tried, too.
4. **Trials**: herds with those numbers are run from frames of the clip and compared with it
   (`flockbrush.learning.scores`; of single animals by the limits of `flockbrush.learning.battery`, too): once as far
   as the clip goes, and the better third (of draws a sixth) well beyond, so that a mill must keep milling and not only
   begin as one.
5. **Evolution** of the best two on the same trials, which also sets what the equations of the paper leave out: wander
   and its time, how fast animals can turn and how fast they answer.  It begins with changes that leave the turns as
   likely as they are.
6. The choice among the best and the evolved: on the last part of the frames, which neither descent nor evolution was
   shown; and of the first of these, whether they stay what the clip is for 20 s more, and with a quarter and four
   times as many animals.

Work is counted in animals times ticks, never by the clock, and chance comes from seeds: the same evidence, seed and
versions give the same brush, with any number of processes, in one go or taken up again.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Sequence

import numpy as np

from flockbrush.engine.fingerprint import build_of
from flockbrush.film.observations import Evidence
from flockbrush.learning.cloud import GENERATION, Cloud
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.herd_views import followed
from flockbrush.learning.interaction import idle_ones
from flockbrush.learning.learned_parameters import Attempt, Learned, forces_of, told_of
from flockbrush.learning.rollout import DT, params_of
from flockbrush.learning.search_space import begins, rescaled, rotation_of, turn_limits
from flockbrush.learning.trials import (
    BEYOND,
    FEWEST,
    MANY,
    MOST_WANDER,
    OTHER_NUMBERS,
    SPAN,
    STAY,
    TOO_MANY,
    USE,
    SearchSettings,
    Setting,
    attempt,
    certainty,
    descend,
    forget,
    interaction,
    keep,
    means_of,
    scored,
    squares,
    stayed,
    trial,
    wandering,
)
from flockbrush.learning.workers import Workers, WorkStopped
from flockbrush.runs.builds import RUNNING
from flockbrush.runs.cluster import Cluster

RATE = 280_000  # animal ticks that count as a second
ALWAYS = 100  # animals whose work a tick costs besides
LONGER = 2.0  # times the budget where only fields or a photograph tell of candidates, most of which are far off
DRAWS, QUICK_DRAWS, TWICE = 384, 64, 9  # random ones that are tried where a descent has only fields; most, tried again
ONE_OF, ONE_OF_DRAWS = 3, 6  # of so many, one is tried to the end
CLEARLY = 0.15  # of the logarithm of the likelihood of a turn, by which one reach of sight is worse than another
# by factor of the forces, of which turns show less if random ones last: factors of the wander that gives the usual
# scatter; lasting herds need less, large turns more
WANDERING = {1.0: (0.5, 1.2), 2.0: (1.0,)}
FINALISTS, QUICK_FINALISTS = 4, 3
KEEPERS = 4  # candidates, re-run for 20 s to test stability
AGREEING = 3  # starts, where no turns say how sure a number is


def learn(
    evidences: Evidence | Sequence[Evidence], settings: SearchSettings = SearchSettings(), *, jobs: int | Helpers = 1,  # noqa: B008  frozen
    cluster: Cluster | None = None, say: Callable[[int, int, float, str], None] | None = None,
    stop: Callable[[], bool] | None = None, resume=None,
) -> Learned:  # fmt: skip
    """Learn the herd of a clip, or of several of one kind.

    Parameters
    ----------
    evidences : Evidence or list of Evidence
    settings : SearchSettings
    jobs : int or Helpers
        Processes, this one among them.
    cluster : Cluster, optional
        Its workers do what ``jobs`` processes would; the result is the same.
    say : callable, optional
        ``say(done, total, loss, text)``; loss is NaN while there is none.
    stop : callable, optional
        Asked now and then; when it says True the best so far is returned, as after Ctrl-C.
    resume : path, optional
        Where work is kept; a second call with the same evidence and settings goes on from there.

    Raises
    ------
    ValueError
        When there is nothing to learn from.
    """
    clips = tuple([evidences] if isinstance(evidences, Evidence) else evidences)
    if not clips:
        raise ValueError("there are no clips to learn from")
    if unknown := set(settings.use) - USE:
        raise ValueError(f"use names {', '.join(sorted(unknown))}; it may have {', '.join(sorted(USE))}")
    given = Setting.of(clips, settings)
    search = _Search(given, settings, say or _silent)
    forget()
    with Workers(given, jobs, _signature(clips, given, settings), resume, stop, cluster) as workers:
        try:
            search.run(workers)
        except (KeyboardInterrupt, WorkStopped):
            search.interrupted = True
    return search.learned()


def _silent(done, total, loss, text):
    """A progress function that does nothing."""


def _version():
    """What the results of trials hang on besides: the code that herds are run and compared by, and the libraries."""
    build = build_of((*RUNNING, "flockbrush.learning"))
    return f"{build.code} {build.packages}".encode()


def _signature(clips, given, settings):
    options = settings.seed, settings.starts, settings.budget_s, settings.quick, settings.brushes
    digest = hashlib.sha256(json.dumps([*options, given.speed.model_dump(), given.body.model_dump()]).encode())
    digest.update(repr((sorted(given.use), given.beta, given.device)).encode() + _version())
    for clip in clips:
        fields, outline = clip.fields, clip.fields.outline
        for array in (fields.density, fields.velocity, fields.angular_variance, fields.obstacle, outline):
            digest.update(b"" if array is None else np.ascontiguousarray(array).tobytes())
        if clip.sightings is not None:
            digest.update(clip.sightings.xy.tobytes() + clip.sightings.forward.tobytes())
    return digest.hexdigest()


class _Search:
    """The search of one call: what was tried, and what is best."""

    def __init__(self, given, settings, say):
        self.given, self.seed, self.say = given, settings.seed, say
        self.quick = settings.quick
        self.by_fields = any(not followed(clip) for clip in given.clips)
        self.attempts: list[Attempt] = []
        self.fitted: list[int] = []  # attempts whose forces come from a fit to turns
        self.budget = settings.budget_s * RATE * (LONGER if self.by_fields else 1.0)
        if settings.begins is None:
            draws, spin = (QUICK_DRAWS if self.quick else DRAWS) if self.by_fields else 0, rotation_of(given.seen)
            self.begins = begins(settings.seed, settings.starts, "angular" in given.use, settings.brushes, draws, spin)
        else:
            self.begins = [(name, np.array(theta, float), dict(extras)) for name, theta, extras in settings.begins]
        self.final: list[int] = []  # attempts that were judged to the end, the best first
        self.interrupted, self.notes = False, []
        self.idle: list[str] = []  # attempts that were left out, since their animals hardly interact

    @property
    def cost(self):
        """Animal ticks of one trial with one seed."""
        return self._cost(lambda length: length + float(np.clip(4.0 * length, *BEYOND)))

    @property
    def cost_beside(self):
        """Likewise, of a trial no longer than the clip."""
        return self._cost(lambda length: length)

    def _cost(self, seconds):
        """Animal ticks of herds like those of the clips, for ``seconds(length)`` of each."""
        total = 0.0
        for clip in self.given.clips:
            animals = ALWAYS + float(np.nanmax(clip.fields.count, initial=1.0))
            total += animals * seconds(len(clip.fields) / clip.fps) / DT
        return max(total, 1.0)

    @property
    def cost_of_keeping(self):
        """Animal ticks of one `keep`."""
        total = 0.0
        for clip in self.given.clips:
            if clip.fields.holds_all:
                animals = float(np.nanmax(clip.fields.count, initial=1.0))
                herds = [animals, *(f * animals for f in OTHER_NUMBERS if f * animals <= TOO_MANY)]
                total += sum(ALWAYS + herd for herd in herds) * STAY / DT
        return total

    def run(self, workers):
        """All of it."""
        self._descend(workers)
        self._sift(workers)
        self._evolve(workers)
        self._choose(workers)

    def _descend(self, workers):
        tasks = [
            {"theta": theta.tolist(), "extras": extras, "seed": _seed(self.seed, 1, k)}
            for k, (_, theta, extras) in enumerate(self.begins)
        ]
        random = [name.startswith("random") for name, _, _ in self.begins]
        draw = np.array([name.startswith("draw") for name, _, _ in self.begins])
        fits = np.array(random) if self.quick and any(random) else ~draw
        count = int(fits.sum())
        self.say(0, count, np.nan, "descents")
        chosen = [task for task, fit in zip(tasks, fits, strict=True) if fit]
        results = iter(workers.map(descend, chosen, lambda done: self.say(done, count, np.nan, "descents")))
        for k, ((name, theta, extras), task) in enumerate(zip(self.begins, tasks, strict=True)):
            if not random[k]:  # as it is, too
                self._add(Attempt(name, task["seed"], theta, theta, extras))
                name += ", fitted"
            if fits[k]:
                self._add_found(Attempt(name, task["seed"], theta, theta, extras), next(results))
        if self.fitted:
            self._limit(workers, list(self.fitted))

    def _limit(self, workers, fitted):
        """The best fit of each view range to more turns, with and without a limit of turning, and wandering."""
        best: dict[float, Attempt] = {}
        for k in sorted(fitted, key=lambda k: self.attempts[k].loss[-1], reverse=True):
            best[self.attempts[k].extras["neighbour_range"]] = self.attempts[k]
        parents = sorted(best.values(), key=lambda a: a.loss[-1])[: 1 if self.quick else None]
        limits = [10.0, *([] if self.quick else turn_limits(self.given.seen)[-1:])]
        which = [(parent, limit) for parent in parents for limit in limits]
        tasks = []
        for a, limit in which:  # weights that came to their end get room
            theta, extras = rescaled(a.theta, a.extras | {"max_turn": limit})
            tasks.append({"theta": theta, "extras": extras, "seed": a.seed, "rows": MANY, "span": SPAN})
        found = workers.map(descend, tasks)
        pairs = list(zip(which, found, strict=True))
        least = {limit: min(fit["loss"][-1] for (_, own), fit in pairs if own == limit) for limit in limits}
        pairs = [(at, fit) for at, fit in pairs if fit["loss"][-1] < least[at[1]] + CLEARLY]
        made = [
            self._add_found(dataclasses.replace(a, name=f"{a.name}, at most {limit:.3g} rad/s"), fit)
            for (a, limit), fit in pairs
        ]
        best_loss = min(self.attempts[k].loss[-1] for k in fitted)
        self._wander(workers, [*(k for k in fitted if self.attempts[k].loss[-1] < best_loss + CLEARLY), *made])

    def _wander(self, workers, which):
        """These, wandering so much that herds scatter as the animals of the clip do."""
        seed, forces = _seed(self.seed, 7, 0), [times for _ in which for times in WANDERING]
        parents = [_stronger(self.attempts[k], times) for k in which for times in WANDERING]
        tasks = [{"theta": a.theta.tolist(), "extras": a.extras, "seed": seed} for a in parents]
        for times, parent, found in zip(forces, parents, workers.map(wandering, tasks), strict=True):
            for factor in WANDERING[times] if 0.0 < found["wander"] < MOST_WANDER else ():
                extras = parent.extras | {"wander": factor * found["wander"], "wander_time": found["wander_time"]}
                name, theta = f"{parent.name}, wandering {factor:g}", np.array(found["theta"])
                new = dataclasses.replace(parent, name=name, theta=theta, extras=extras)
                self._add(new, True)

    def _add_found(self, attempt, found):
        theta, loss = np.array(found["theta"]), np.array(found["loss"])
        new = dataclasses.replace(attempt, theta=theta, extras=found["extras"], loss=loss)
        return self._add(new, found["by_turns"])

    def _add(self, new, by_turns=False):
        self.attempts.append(new)
        if by_turns:
            self.fitted.append(len(self.attempts) - 1)
        return len(self.attempts) - 1

    def _judge(self, workers, which, seeds, held, text, over=None):
        """Try some attempts; their scores."""
        shown, total = over or (0, len(which))
        tasks = [
            self._trial(k, seed, held, lasting, 0 if held else turn)
            for k in which
            for turn, seed in enumerate(seeds)
            for lasting in (False, True)
        ]
        each = 2 * len(seeds)
        told = lambda done: self.say(shown + done // each, total, self._best_score(), text)  # noqa: E731
        found = workers.map(trial, tasks, told)
        self.budget -= self.cost * len(seeds) * len(which)
        for at, k in enumerate(which):
            runs = found[at * each : (at + 1) * each]
            result = scored(list(zip(runs[::2], runs[1::2], strict=True)))
            self.attempts[k].score, self.attempts[k].figures = result["score"], result["figures"]
        return np.array([self.attempts[k].score for k in which])

    def _numbers(self, k):
        """What a task is given of an attempt."""
        return {"theta": np.round(self.attempts[k].theta, 12).tolist(), "extras": self.attempts[k].extras}

    def _trial(self, k, seed, held, lasting, begin=0):
        """The task of one `trial`."""
        return self._numbers(k) | {"seed": seed, "held": held, "lasting": lasting, "begin": begin}

    def _best_score(self):
        scores = [a.score for a in self.attempts if np.isfinite(a.score)]
        return min(scores) if scores else np.nan

    def _sift(self, workers):
        """Try all beside the clip, the better third to the end, and the best of these again."""
        which, seed = self._interacting(workers, self._distinct()), _seed(self.seed, 2, 0)
        self.say(0, len(which), np.nan, "trials")
        beside = workers.map(trial, [self._trial(k, seed, False, False) for k in which])
        far = [sum(squares(means_of(run))) for run in beside]
        one_of = ONE_OF_DRAWS if self.by_fields else ONE_OF
        many, some = max(4, min(TWICE, len(which) // 3)), max(4, -(-len(which) // one_of))
        kept = [which[k] for k in np.argsort(far, kind="stable")[:some]]
        scores = self._judge(workers, kept, [seed], False, "trials")
        self.budget -= self.cost_beside * (len(which) - len(kept))
        better = [kept[k] for k in np.argsort(scores, kind="stable")[:many]]
        again = [_seed(self.seed, 2, k) for k in (0, 1, 2)]
        self._judge(workers, better, again, False, "trials of the best candidates")
        self.ranked = sorted(better, key=lambda k: self.attempts[k].score)

    def _distinct(self):
        """Attempts without those that are as good as equal to an earlier one."""
        kept = []
        for k, a in enumerate(self.attempts):
            before = [self.attempts[j] for j in kept if self.attempts[j].extras == a.extras]
            if not any(np.abs(a.theta[:9] - b.theta[:9]).max() < 0.02 for b in before):
                kept.append(k)
        return kept

    def _evolve(self, workers):
        """Evolve the best two as long as the budget lasts."""
        parents = [self.attempts[k] for k in self.ranked[:2]]
        staying = 0.0 if self.quick else self.cost_of_keeping * KEEPERS
        left = self.budget - staying - self.cost * 2 * 3 * (self._finalists + 2 * len(parents))
        generations = int(left / (self.cost * GENERATION * len(parents)))
        if generations < 2:
            return
        for number, parent in enumerate(parents):
            cloud = Cloud.about(parent, self.given, (self.seed, 3, number), self.by_fields)
            for g in range(generations):
                asked, read = cloud.ask()
                how = {"seeds": [_seed(self.seed, 4, g)], "held": False, "begin": g}
                found = workers.map(attempt, [{"theta": theta, "extras": extras} | how for theta, extras in read])
                self.budget -= self.cost * len(read)
                cloud.tell(asked, [result["score"] for result in found])
                done = number * generations + g + 1
                self.say(done, generations * len(parents), min(cloud.worths), "evolution")
            for end in cloud.ends:
                self._add(end)

    @property
    def _finalists(self):
        """How many of those that are not evolved come into the choice."""
        return QUICK_FINALISTS if self.quick else FINALISTS

    def _choose(self, workers):
        """The best on what was held back, of the ranked and the evolved."""
        evolved = [k for k, a in enumerate(self.attempts) if ", evolved" in a.name]
        final = [*self.ranked[: self._finalists], *self._interacting(workers, evolved)]
        seeds = [_seed(self.seed, 5, k) for k in range(3)]
        shown = self._judge(workers, final, seeds, False, "choice", (0, 2 * len(final)))
        held = self._judge(workers, final, seeds, True, "choice", (len(final), 2 * len(final)))
        scores = {k: float(np.sqrt(0.5 * a**2 + 0.5 * b**2)) for k, a, b in zip(final, shown, held, strict=True)}
        for k in final:
            self.attempts[k].score = scores[k]
        best = sorted(final, key=lambda k: scores[k])
        self.final = best if self.quick else self._keepers(workers, best[:KEEPERS])

    def _interacting(self, workers, which):
        """Those that answer to their neighbours, where the clip shows that its animals do."""
        fits = self.fitted
        asked = list(dict.fromkeys([*fits, *which])) if fits else []
        found = dict(zip(asked, workers.map(interaction, list(map(self._numbers, asked))), strict=True))
        idle = idle_ones([found[k] for k in fits], [found.get(k, {}) for k in which])
        self.idle += [self.attempts[k].name for k, alone in zip(which, idle, strict=True) if alone]
        return [k for k, alone in zip(which, idle, strict=True) if not alone]

    def _keepers(self, workers, final):
        """Re-run these candidates for longer, and return them in order of merit with the results."""
        seed, factors = _seed(self.seed, 6, 0), (1.0, *OTHER_NUMBERS)
        tasks = [self._numbers(k) | {"seed": seed, "factor": factor} for k in final for factor in factors]
        each, best = 1 + len(OTHER_NUMBERS), self._best_score()
        found = workers.map(keep, tasks, lambda done: self.say(done // each, len(final), best, "staying"))
        for at, k in enumerate(final):
            result = stayed(found[at * each : (at + 1) * each])
            self.attempts[k].staying = result["score"]
            self.attempts[k].figures |= {f"staying, {name}": value for name, value in result["figures"].items()}
        return sorted(final, key=lambda k: self.attempts[k].merit)

    # what comes of it

    def learned(self) -> Learned:
        """The best there is."""
        given = self.given
        tried = [k for k, a in enumerate(self.attempts) if np.isfinite(a.score)]
        if self.final or tried:
            chosen = self.final[0] if self.final else min(tried, key=lambda k: self.attempts[k].score)
        else:  # stopped before anything was tried
            if not self.attempts:
                name, theta, extras = self.begins[0]
                self._add(Attempt(name, self.seed, theta, theta, extras))
            chosen = len(self.attempts) - 1
        best = self.attempts[chosen]
        fits = [(self.attempts[k].theta, self.attempts[k].extras) for k in self.fitted]
        asked = fits or not self.interrupted
        deviation, correlation = (certainty(given, best.theta, best.extras, fits) if asked else None) or (None, None)
        alike = self._alike(chosen)
        spread = np.std([forces_of(a.theta, a.extras) for a in alike], axis=0)
        identifiable = told_of(best.theta, spread, deviation)
        if deviation is None and len({a.name.split(",")[0] for a in alike}) < AGREEING:
            identifiable[:] = False  # nothing but one start and what came of it says so
        if not any(clip.fields.obstacle.any() for clip in given.clips):
            identifiable[9:] = False
        return Learned(
            params_of(best.theta, best.extras), given.speed, given.body, given.vision(best.extras), best.theta,
            best.extras, self.attempts, chosen, spread, deviation, identifiable, dict(best.figures),
            self._notes(best), self.interrupted, correlation,
        )  # fmt: skip

    def _alike(self, chosen):
        """Those about as good, wherever they came from."""
        limit = 1.25 * self.attempts[chosen].score + 0.1
        return [self.attempts[chosen]] + [a for k, a in enumerate(self.attempts) if k != chosen and a.score <= limit]

    def _notes(self, best):
        notes = [note for clip in self.given.clips for note in clip.notes]
        how = "turns of single animals" if all(followed(c) for c in self.given.clips) else "fields alone"
        notes.append(
            f"learned from {how}; chosen start: {best.name}, {best.score:.2f} standard deviations of the clip away"
        )
        if self.interrupted:
            notes.append("learning was stopped: these are the best parameters so far")
        if self.idle:
            notes.append(
                f"{len(self.idle)} of {len(self.attempts)} candidates were dropped: their animals hardly react to "
                "neighbours, and the turns in the clip show such reactions"
            )
        if any(len(c.fields) < FEWEST for c in self.given.clips):
            notes.append(
                f"with fewer than {FEWEST} frames to learn from, none of them was held back for the choice of the start"
            )
        return notes


def _stronger(attempt, times):
    """The same with so many times the forces between animals."""
    if times == 1.0:
        return attempt
    name, theta = f"{attempt.name}, forces times {times:g}", attempt.theta.copy()
    theta[9] /= times  # no random turn hides that of obstacles, which do not turn themselves
    extras = attempt.extras | {"sensitivity": times * params_of(attempt.theta, attempt.extras).sensitivity}
    return dataclasses.replace(attempt, name=name, theta=theta, extras=extras)


def _seed(*numbers):
    """A seed for each purpose."""
    return int(np.random.SeedSequence(numbers).generate_state(1)[0])
