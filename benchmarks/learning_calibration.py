"""Measure how often the verdict on a brush is wrong, with true brushes and with wrong ones.

    python benchmarks/learning.py calibration [--count 60] [--first 0] [--truths] [--write]

A true brush is a shipped brush with randomly changed parameters and speeds.  The clip is four seconds of a herd of 40
to 100 animals with that brush, observed with noise (positions and body axes, no identities).  Two brushes are judged
by the clip: the true one with another seed, and a wrong one, which is either another shipped brush with the clip's
speeds or the true brush with one change.  A wrong brush counts only if it is separable from the true one: over 20
seeds, at least one measure orders 95 of 100 pairs of runs the same way, over the four seconds or after 20 s on its
own.  ``--truths`` judges the true brushes alone: nothing is simulated to tell brushes apart.

Wrongly accepted: the verdict on a wrong brush is "moves like the film".  Wrongly rejected: a true brush gets any other
verdict, including "cannot be told".
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np

BASES = "march", "mill-filled", "swarm", "column", "stampede", "graze", "sheep-narrow"
WARM, SECONDS, FPS = 10.0, 4.0, 25.0
ANIMALS = 40, 70, 100
SEPARATE, SEEDS = 0.95, 20
RESULTS = Path(__file__).resolve().parent / "learning_calibration.json"
CHANGES = {  # of a true brush, which make a wrong one
    "hardly any alignment": {"alignment_weight": 0.1},
    "hardly any cohesion": {"cohesion_weight": 0.1},
    "hardly any avoidance": {"avoidance_weight": 0.1},
    "wanders": {"wander": 1.5},
    "fast": {"speed": 1.6},
    "uneven speeds": {"deviation": 5.0},
}


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("calibration", help="how often the verdict on a brush is wrong")
    parser.add_argument("--count", type=int, default=60, help="number of true brushes, and of wrong ones")
    parser.add_argument("--first", type=int, default=0, help="number of the first case; each case is another herd")
    parser.add_argument("--rivals", type=int, default=4, help="shipped brushes compared with each brush")
    parser.add_argument("--truths", action="store_true", help="judge the true brushes alone")
    parser.add_argument("--write", action="store_true", help=f"store the results in {RESULTS.name}")
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print a line for each judgement, and the counts.

    With ``--write`` each case is stored as soon as it is done, with the version of the recipe that judged it.  The same
    command then continues with the missing cases.  Cases of another version of the recipe are computed again.
    """
    recipe = recipe_of(options.rivals) + " truths" * options.truths
    kept = json.loads(RESULTS.read_text()) if options.write and RESULTS.exists() else {}
    done = kept.get("cases", {}) if kept.get("recipe") == recipe else {}
    for number in range(options.first, options.first + options.count):
        if str(number) in done:
            continue
        done[str(number)] = list(case(number, options.rivals, options.truths))
        for row in done[str(number)]:
            print(json.dumps(row), flush=True)
        if options.write:
            RESULTS.write_text(json.dumps({"recipe": recipe, "cases": done}, indent=1) + "\n")
    wanted = {str(n) for n in range(options.first, options.first + options.count)}
    rows = [row for number, found in done.items() if number in wanted for row in found]
    print(table(rows))
    return rows


def recipe_of(rivals):
    """Return what the judgements depend on: the code of battery, verdict and simulation, and the number of rivals."""
    from flockbrush.engine.fingerprint import build_of

    from flockbrush.runs.builds import RUNNING

    return f"{build_of((*RUNNING, 'flockbrush.learning')).code} {rivals}"


def truth_of(rng):
    """Return a shipped brush with random changes, enough to make another herd of the same kind."""
    from flockbrush.behaviours.brush import shipped

    brush = shipped().get(BASES[rng.integers(len(BASES))])
    return _changed(brush, {name: float(rng.uniform(0.8, 1.25)) for name in _numbers(brush)}, rng.uniform(0.7, 1.3))


def _numbers(brush):
    return [n for n in type(brush.params).model_fields if n.endswith(("_weight", "_radial")) and "obstacle" not in n]


def _changed(brush, factors, speed=1.0, deviation=1.0, wander=None):
    params = {name: min(getattr(brush.params, name) * factor, 1.0) for name, factor in factors.items()}
    if wander is not None:
        params["wander"] = wander
    spec = brush.speed
    pace = {"mean": spec.mean * speed, "deviation": max(spec.deviation, 0.02 * spec.mean) * speed * deviation}
    return brush.model_copy(
        update={"params": brush.params.model_copy(update=params), "speed": spec.model_copy(update=pace)}
    )


def wrong_of(truth, rng):
    """Return (name, wrong brush): another shipped brush with the true speeds, or the true brush with one change."""
    from flockbrush.behaviours.brush import shipped

    if rng.random() < 0.5:
        name = [n for n in BASES if n != truth.name][rng.integers(len(BASES) - 1)]
        return name, shipped().get(name).model_copy(update={"speed": truth.speed, "body": truth.body})
    name = list(CHANGES)[rng.integers(len(CHANGES))]
    change = dict(CHANGES[name])
    pace = {key: change.pop(key) for key in ("speed", "deviation", "wander") if key in change}
    return name, _changed(truth, change, **pace)


def clip_of(truth, count, seed):
    """Return noisy observations of four seconds of a herd, after a warm-up."""
    from flockbrush.components import Heading, Position, Speed
    from flockbrush.levels.build import plane
    from learning_truth import _as_blobs, evidence_of

    from flockbrush.learning.rollout import HerdStart, rollout

    heading = 0.3 if truth.name in ("march", "column", "stampede", "sheep-narrow") else None
    simulation = plane(truth, count, 0.6, "scatter", seed, heading)
    simulation.run(round(WARM * 32))
    agents, length = simulation.agents, truth.body.length
    begin = HerdStart(
        agents[Position.xyz][:, :2] / length, agents[Heading.forward][:, :2].copy(), agents[Speed.drawn] / length
    )
    film = rollout(begin, truth.params, truth.speed, truth.body, truth.vision, seconds=SECONDS, fps=FPS, seed=seed + 7)
    return _as_blobs(evidence_of(film, truth.name, truth.body.radius / length), np.random.default_rng(seed))


def separable(battery, one, other):
    """Return whether 20 runs of each brush differ in a measure, over the clip's time or after 20 s on their own."""
    from flockbrush.learning.simulate import simulated
    from flockbrush.learning.verdict import left_alone

    def measured(brush):
        for seed in range(500, 500 + SEEDS):
            yield battery.measured(simulated(battery.clip, brush, seed, True))

    def after(brush):
        for seed in range(500, 500 + SEEDS // 2):
            end = left_alone(battery, brush, seed)
            yield {name: end.value(name) for name in battery.values if name != "growth"}

    return any(_apart(list(take(one)), list(take(other))) for take in (measured, after))


def _apart(ones, others):
    for name in ones[0]:
        a, b = (np.array([r[name].mean() for r in rows]) for rows in (ones, others))
        higher = (a[:, None] > b[None]).mean()
        if max(higher, 1 - higher) >= SEPARATE and np.isfinite(a).all() and np.isfinite(b).all():
            return True
    return False


def case(number, rivals, truths=False):
    """Yield two judgements: of a true brush, and of a wrong brush that is separable from it; or of truths alone."""
    from flockbrush.behaviours.brush import shipped

    from flockbrush.learning.battery import Battery
    from flockbrush.learning.verdict import judge

    begun = time.perf_counter()
    rng = np.random.default_rng([73, number])
    truth, count = truth_of(rng), int(ANIMALS[rng.integers(len(ANIMALS))])
    clip = clip_of(truth, count, 100 + number)
    battery = Battery.of(clip)
    name, wrong = wrong_of(truth, rng)
    while not (truths or separable(battery, truth, wrong)):
        name, wrong = wrong_of(truth, rng)
    others = [n for n in shipped().names() if shipped().get(n).model == "herd" and n not in (truth.name, name)]
    chosen = rng.permutation(others)[:rivals]
    tried = {n: shipped().get(n).model_copy(update={"speed": truth.speed}) for n in chosen}
    for what, brush in ((truth.name, truth), (name, wrong))[: 1 if truths else 2]:
        verdict = judge(clip, brush, tried, seed=7000 + number)
        yield {
            "case": number, "truth": truth.name, "animals": count, "judged": "truth" if brush is truth else what,
            "verdict": verdict.kind, "sentence": verdict.sentence,
            "far": {r.name: round(r.far, 2) for r in verdict.brush.rows},
            "lasting": {r.name: round(r.far, 2) for r in verdict.brush.lasting},
            "told": verdict.told, "seconds": round(time.perf_counter() - begun, 1),
        }  # fmt: skip


def table(rows):
    """Return the counts of wrong verdicts as text."""
    truths, wrong = ([r for r in rows if (r["judged"] == "truth") == side] for side in (True, False))
    praised = [r["case"] for r in wrong if r["verdict"] == "like"]
    blamed = [r["case"] for r in truths if r["verdict"] != "like"]
    return (
        f"wrongly accepted: {len(praised)} of {len(wrong)} wrong brushes {praised}\n"
        f"wrongly rejected: {len(blamed)} of {len(truths)} true brushes {blamed}"
    )
