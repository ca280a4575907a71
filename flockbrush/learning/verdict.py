"""Whether a brush moves like a clip, in one of four sentences, beside others that were not learned from it.

A brush *moves like the film* when every measure of the battery (`flockbrush.learning.battery`) that the clip tells is
within its limits, and stays so when the herd is left alone for 20 s more.  A part of a herd is not left alone: nobody
knows what is around it.  The clip tells a measure if one of the
rivals is beyond its limits; it tells nothing when herds that do nothing at all pass as well.  How often these sentences
are wrong is measured by ``benchmarks/learning.py calibration``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flockbrush.behaviours.models.herd import Params
from flockbrush.film.observations import Evidence
from flockbrush.learning.battery import DEVIATIONS, MEASURES, SHORTEST, Battery, BatteryRow, Series, looks_of_run
from flockbrush.learning.helpers import Common, Helpers
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.likelihood import likelihood_of, read
from flockbrush.learning.response import response
from flockbrush.learning.rollout import NAMES, Run, Surroundings, Walls, rollout
from flockbrush.learning.simulate import HerdParts, shaken, simulated
from flockbrush.learning.words_of_tracks import of_tracks

RUNS, RIVAL_RUNS, LONG_RUNS = 6, 2, 4
ALONE, MEASURED, FPS = 20.0, 10.0, 4.0  # s a herd is left alone, of which the end is measured; looks a second
LEAST_TOLD = 3  # measures that a clip must determine
NEARER = 0.7  # of a brush's distance: a rival is nearer below it
STEPPED = "speeds", "share standing"  # measures of steps, for which frames may be too far apart
FEWEST = 5  # animals
GROWN = 4.0  # times the spread of the clip: farther nothing is extrapolated
FILM, TRACKS = "film", "tracks"  # what judges
ANYWHERE = 0.25  # of a limit, by which it grows at most where runs differ: those that go anywhere excuse nothing
STILL, ONWARDS = "nobody moves", "all animals keep their velocity"
RANDOM = "random numbers"


@dataclass
class Contender:
    """A brush, or a way to move, beside a clip."""

    name: str
    rows: list[BatteryRow]
    lasting: list[BatteryRow] = field(default_factory=list)  # after 20 s alone

    def distance(self, names) -> float:
        """Root mean square of the limits it is off, over some measures."""
        far = [row.far for row in self.rows if row.name in names]
        return float(np.sqrt(np.mean(np.square(far)))) if far else np.inf

    def missed(self, names) -> list[str]:
        """Of some measures those beyond their limits."""
        return [row.name for row in self.rows if row.name in names and not row.met]


@dataclass
class Judgement:
    """The judgement of a brush."""

    kind: str  # {"like", "partly", "rival", "untold"}
    sentence: str
    brush: Contender
    rivals: list[Contender]  # the nearest first
    told: list[str]  # measures that the clip determines
    seconds: float = 0.0  # of the clip that judged
    count: float = 0.0  # animals in it
    doubt: str = ""  # why that clip can judge nothing
    source: str = FILM

    @property
    def missed(self) -> list[str]:
        """Measures beyond their limits, and those that do not last."""
        after = [f"{row.name} after {ALONE:g} s alone" for row in self.brush.lasting if not row.met]
        return self.brush.missed(self.told) + after


# herds that do nothing ---------------------------------------------------------------------------


def idle(clip: Evidence, seed=0, moving=False, frame=0, seconds=None, fps=None) -> Run:
    """The herd of a clip's frame that stands for ever, or goes on straight ahead with the speeds it has."""
    start = start_of(clip, frame, seed)
    fps = clip.fps if fps is None else fps
    seconds = (len(clip.fields) - 1) / clip.fps if seconds is None else seconds
    count, n = int(seconds * fps + 1e-6) + 1, len(start)
    velocity = start.forward * np.asarray(start.speed)[:, None] * moving
    times = np.arange(count) / fps
    xy = start.xy[None] + times[:, None, None] * velocity[None]
    return Run(
        times, np.arange(count + 1) * n, np.tile(np.arange(n), count), xy.reshape(-1, 2),
        np.tile(start.forward, (count, 1)), np.tile(velocity, (count, 1)),
    )  # fmt: skip


IDLE = {STILL: False, ONWARDS: True}


def alone(clip: Evidence, brush, seed=0) -> Run:
    """A herd that begins as the clip ends and is left alone, among the obstacles of the clip."""
    last = len(clip.fields) - 1
    if isinstance(brush, bool):
        return idle(clip, seed, brush, last, ALONE, FPS)
    start = shaken(start_of(clip, last, seed, brush.body), clip, seed)
    around = Surroundings(Walls.of(clip.fields))
    how = brush.params, brush.speed, brush.body, brush.vision
    return rollout(start, *how, seconds=ALONE, fps=FPS, seed=seed, around=around)


def random_numbers(brush, seed=1):
    """The brush with parameters drawn at random."""
    return HerdParts(_anywhere(brush.params, seed), brush.speed, brush.body, brush.vision)


def _anywhere(params, seed):
    """Parameters whose numbers are drawn at random, of another model than the herd's where they are looked for."""
    chance = np.random.default_rng(seed)
    if type(params) is Params:
        return params.model_copy(update=dict(zip(NAMES, chance.uniform(0.05, 1.0, 12).tolist(), strict=True)))
    kind = likelihood_of(params)
    numbers = kind.numbers if kind else {}
    return params.model_copy(update=read(numbers, chance.uniform(0.0, 1.0, len(numbers))))


# judging --------------------------------------------------------------------------------------------


def beside(battery: Battery, brush, seeds) -> list[BatteryRow]:
    """Runs of a brush, or of True or False for a herd that goes on or stands, against a clip."""
    clip = battery.clip
    if isinstance(brush, bool):
        return battery.compared([battery.measured(idle(clip, s, brush)) for s in seeds])
    runs = [simulated(clip, brush, s, True) for s in seeds]
    return battery.compared([battery.measured(run) for run in runs]) + response(clip, brush, runs)


def settled(battery: Battery, run: Run) -> Series:
    """What becomes of a herd that is left alone."""
    looks = looks_of_run(run, battery.clip, 1, FPS, min(battery.series.yard.span, ALONE - MEASURED))
    return Series.of(looks[-int(MEASURED * FPS) :], battery.series.yard, MEASURED)


def left_alone(battery: Battery, brush, seed) -> Series:
    """The same of a brush, or of True or False for a herd that goes on or stands."""
    return settled(battery, alone(battery.clip, brush, seed))


def _of_battery(battery: Common, function, *args):
    """A task for a process beside this one."""
    return function(battery.value, *args)


def after_long(battery: Battery, rows: list[BatteryRow], found: list[Series]) -> list[BatteryRow]:
    """What became of runs against the clip, with limits of its own; what changes in the clip may go on changing."""
    growth = battery.series.growth if "growth" in battery.values else 0.0
    out = []
    for row in rows:
        kind = MEASURES[row.name]
        if not kind.lasting or (row.name in STEPPED and battery.series.yard.span > ALONE - MEASURED):
            continue
        value = battery.values[row.name]
        values = np.array(
            [s.value(row.name) if len(s.value(row.name)) == len(value) else value * np.nan for s in found]
        )
        level = float(np.abs(value).mean())
        limit = max(kind.lasting, kind.lasting_share * level, kind.lasting_limits * row.limit)
        limit += kind.onward * _trend(battery, row.name)
        mean, most = values.mean(0), value
        if kind.growth_error is not None and np.isfinite(growth):
            most = value * min(np.exp(max(growth, 0.0) * ALONE), GROWN)  # as far as it would grow so
            if mean.mean() > most.mean():
                unsure = (1.0 + kind.lasting_share) * np.exp(kind.growth_error * ALONE) - 1.0
                limit = max(limit, unsure * float(most.mean()))
        between = float(values.std(0, ddof=1).mean()) if len(values) > 1 else 0.0
        limit += min(DEVIATIONS * between / np.sqrt(len(values)), ANYWHERE * limit)
        off = float(np.abs(mean - np.clip(mean, value, most)).mean())
        spreads_on = bool(off <= limit < np.abs(mean - value).mean())
        out.append(BatteryRow(row.name, float(value.mean()), float(values.mean()), off, limit, spreads_on=spreads_on))
    return out


def _trend(battery, name):
    """How much a measure changes from the first to the last third of what is looked at."""
    n = len(battery.series.rows[name]) if name in battery.series.rows else 0
    first, last = (battery.series.value(name, part) for part in (slice(0, n // 3), slice(n - n // 3, n)))
    change = float(np.abs(last - first).mean()) if n >= 6 and len(first) == len(last) else 0.0
    return change if np.isfinite(change) else 0.0


def judge(
    clip: Evidence, brush, rivals: Mapping[str, object], *, name="the brush", seed=0, runs=RUNS,
    say: Callable[[int, int], None] | None = None, helpers: Helpers | None = None,
) -> Judgement:  # fmt: skip
    """Compare a brush with a clip it was not learned from, and with rivals.

    Parameters
    ----------
    clip : Evidence
        The frames that judge.
    brush : Brush or Learned
        Anything with ``params``, ``speed``, ``body`` and ``vision``.
    rivals : mapping of str to the same
        Besides those that are always used: no motion, constant velocities, random parameters.
    say : callable, optional
        (how much is done, of how much).
    helpers : Helpers, optional
        Processes that do a part of it.
    """
    seeds = [seed + k for k in range(runs)]
    others: dict[str, object] = {**IDLE, RANDOM: random_numbers(brush), **rivals}
    herds = [(name, brush, seeds, seeds[:LONG_RUNS])]
    for other, herd in others.items():
        once = isinstance(herd, bool)
        herds.append((other, herd, [1000 + seed + r for r in range(1 if once else RIVAL_RUNS)], [seed] if once else []))
    mine, *tried = _contenders(Battery.of(clip), herds, helpers or Helpers(), say)
    seconds, count = len(clip.fields) / clip.fps, float(np.nanmedian(clip.fields.count))
    return concluded(mine, tried, seconds, count, clip.doubt, TRACKS if clip.from_tracks else FILM)


def _contenders(battery: Battery, herds, helpers: Helpers, say) -> list[Contender]:
    """Each of the herds (name, brush, seeds beside the clip, seeds alone), all runs shared among the helpers."""
    common, whole = helpers.common(battery), battery.clip.fields.holds_all
    long = [(k, seed) for k, (_, _, _, seeds) in enumerate(herds) for seed in seeds if whole]
    tasks: list[tuple] = [(common, beside, brush, seeds) for _, brush, seeds, _ in herds]
    tasks += [(common, left_alone, herds[k][1], seed) for k, seed in long]
    found: dict[int, Any] = {}
    for task, result in helpers.run(_of_battery, tasks):
        found[task] = result
        if say is not None:
            say(len(found), len(tasks))
    made = []
    for k, (name, *_) in enumerate(herds):
        ends = [found[len(herds) + at] for at, (own, _) in enumerate(long) if own == k]
        made.append(Contender(name, found[k], after_long(battery, found[k], ends) if ends else []))
    return made


def concluded(
    mine: Contender, rivals: list[Contender], seconds: float, count: float, doubt="", source=FILM
) -> Judgement:
    """The judgement of a comparison, for its duration and number of animals, unless there is a doubt."""
    told = [row.name for row in mine.rows if not row.met or any(r.missed([row.name]) for r in rivals)]
    rivals = sorted(rivals, key=lambda r: r.distance(told))
    kind, sentence = ("untold", doubt) if doubt else _said(mine, rivals, told, seconds, count, source)
    if kind == "untold":
        sentence = f"How it moves cannot be told from this clip: {sentence}."
        sentence = of_tracks(sentence) if source == TRACKS else sentence
    return Judgement(kind, sentence, mine, rivals, told, seconds, count, doubt, source)


def once_fitted(judgement: Judgement, check: Judgement) -> Judgement:
    """The judgement of brushes learned from parts, for the one fitted to all frames.

    It is not praised for what it misses in these frames, which it knows.
    """
    lost = [name for name in check.missed if name not in judgement.missed]
    if judgement.kind != "like" or not lost:
        return judgement
    met = listed(name for name in judgement.told if name not in lost)
    sentence = f"It moves like the {judgement.source} in {met}; fitted to all frames, not in {listed(lost)}."
    return replace(judgement, kind="partly", sentence=sentence)


def combined(judgements: list[Judgement]) -> Judgement:
    """One judgement of several: of brushes learned from parts of the clips, each by what was held out."""
    if len(judgements) == 1:
        return judgements[0]
    mine = _joined([j.brush for j in judgements])
    names = [r.name for r in judgements[0].rivals]
    by_name = [{r.name: r for r in j.rivals} for j in judgements]
    rivals = [_joined([tried[name] for tried in by_name]) for name in names if all(name in tried for tried in by_name)]
    seconds, count = sum(j.seconds for j in judgements), float(np.mean([j.count for j in judgements]))
    doubt = next((j.doubt for j in judgements if j.doubt), "")
    return concluded(mine, rivals, seconds, count, doubt, judgements[0].source)


def _joined(contenders):
    """One contender of several with the same name: root mean squares of what they are off, in limits."""

    def rows_of(tables):
        known = [{row.name: row for row in table} for table in tables]
        for name in known[0]:
            if all(name in table for table in known):
                yield _joined_row([table[name] for table in known])

    lasting = [c.lasting for c in contenders if c.lasting]
    rows = list(rows_of([c.rows for c in contenders]))
    return Contender(contenders[0].name, rows, list(rows_of(lasting)) if lasting else [])


def _joined_row(rows):
    values = {
        key: float(np.mean([getattr(row, key) for row in rows]))
        for key in ("clip", "herd", "limit", "by_chance", "boot")
    }
    off = float(np.sqrt(np.mean([row.far**2 for row in rows]))) * values["limit"]
    return BatteryRow(rows[0].name, off=off, spreads_on=any(row.spreads_on for row in rows), **values)


def _said(mine, rivals, told, seconds, count, source):
    """(kind, sentence); of "untold" the reason."""
    least = {f"{SHORTEST:g} s": seconds < SHORTEST, f"{FEWEST} animals": count < FEWEST}
    least[f"{LEAST_TOLD} measures"] = len(told) < LEAST_TOLD
    lacking = [what for what, lacks in least.items() if lacks]
    if lacking:
        time = f"{seconds:.{2 if seconds < 1 else 1}f} s"
        tell = f"{time} of {count:.0f} animals tell {len(told)} of {len(MEASURES)} measures"
        return "untold", f"{tell}; at least {listed(lacking)} are needed"
    missed = mine.missed(told)
    strayed = [row.name for row in mine.lasting if not row.met]
    if not missed and not strayed:
        as_good = [r.name for r in rivals if r.name in IDLE and not r.missed(told) and all(x.met for x in r.lasting)]
        if as_good:
            return "untold", f"{as_good[0]}, and it looks the same"
        lasts = f", and does so when left alone for {ALONE:g} s"
        onward = [row.name for row in mine.lasting if row.spreads_on]
        if onward:
            lasts += f", in {listed(onward)} only if the herd of the {source} goes on spreading"
        if not mine.lasting:
            lasts = f"; a part of a herd cannot be left alone for {ALONE:g} s"
        return "like", f"It moves like the {source}: in {listed(told)}{lasts}."
    own = mine.distance(told)
    nearer = [r for r in rivals if r.distance(told) < NEARER * own and len(r.missed(told)) < len(missed)]
    met = [n for n in told if n not in missed]
    if nearer or not met:
        return "rival", f"It is no better than {quoted((nearer or rivals)[0].name)}."
    lost = listed(missed + [f"{n} after {ALONE:g} s alone" for n in strayed if n not in missed])
    return "partly", f"It moves like the {source} in {listed(met)}, not in {lost}."


def quoted(name):
    """The name of a rival in a sentence."""
    return f'"{name}"' if name in (*IDLE, RANDOM) else f"the brush {name}"


def listed(names) -> str:
    """ "a, b and c"."""
    names = list(names)
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
