"""Learn from the first half of a clip and predict the second.

    python benchmarks/learning.py halves [--clips band mill swarm ...] [--write]

The clips show herds of other models from the literature (``benchmarks/herd_film.py``), filmed by a camera that drifts,
turns and zooms and observed by ``observe``, and real sheep if ``../shared/data`` exists.  A herd with the learned
brush starts like the second half.  Its polarization and milling (means over the half and five runs) must agree with
the clip within two of the clip's own standard deviations or .05, whichever is larger.  Its distance to the clip over
all measures (``flockbrush.learning.scores``, mean over as many runs for all) is compared with those of random
parameters and of every shipped brush: as shipped and, harder to beat, with the speeds and bodies learned from the
clip, so that only the turning differs.

All are judged by the whole battery of the verdict, too.  Beside them stands the floor: the true model, with other
random numbers from the clip's middle on (polarization, milling, battery) and from its end on (what must last for
20 s), seen from the same camera.  ``--again`` learns nothing: it films the clips again and judges the stored
parameters by the battery.  ``--no-rivals`` leaves out random parameters and shipped brushes.
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np

CLIPS = "band", "mill", "swarm", "torus", "drifting mill", "topological", "school", "graze"  # all used in development
DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
SHEEP = Path("aerial_sheep", "sheep_0043.mp4")
RESULTS = Path(__file__).resolve().parent / "learning_halves.json"
RUNS, RANDOM = 5, 7
SEED = 11
COUNTED = {
    "Within the limits": "within",
    "Nearer to the clip than the median of random parameters": "better than random",
    "Nearer than the best of seven random ones": "better than all random",
    "Nearer than every brush as shipped": "better than all brushes as shipped",
    "Nearer than every brush with the clip's speeds": "better than all brushes",
}
JUDGED = "polarization", "milling"
KINDS = "missed", "not lasting"
OF_A_BRUSH = {"response to neighbours", "scatter of turns"}  # measures that the true model, which is none, cannot have
FLOOR, LONG_FLOOR = 6, 2  # runs of the true model, and those that go on for 20 s


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("halves", help="learn from the first half of clips and predict the second")
    parser.add_argument("--clips", nargs="*", default=[*CLIPS, "sheep"], help="models of foreign_herds, or sheep")
    parser.add_argument("--animals", type=int, default=70)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--budget", type=float, default=45.0, help="seconds of trials and evolution, counted in work")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=SEED, help="seed of the filmed herds")
    parser.add_argument("--perfect", action="store_true", help="a perfect observer instead of a film")
    parser.add_argument(
        "--again", action="store_true", help="judge the stored parameters by the battery, and the truth"
    )
    parser.add_argument("--model", default="auto", choices=("auto", "herd"), help="kind of model to learn")
    parser.add_argument("--no-rivals", dest="rivals", action="store_false", help="no random and no shipped parameters")
    parser.add_argument("--data", type=Path, default=DATA, help="folder with the data sets")
    parser.add_argument("--write", action="store_true", help=f"store the results in {RESULTS.name}")
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print a line for each clip."""
    results = json.loads(RESULTS.read_text()) if (options.write or options.again) and RESULTS.exists() else {}
    rows = {}
    for name in options.clips:
        if name == "sheep" and not (options.data / SHEEP).exists():
            print(f"sheep: skipped, there is no {options.data / SHEEP}")
            continue
        title = name if options.seed == SEED or name == "sheep" else f"{name}, seed {options.seed}"
        rows[title] = again(name, options, results[title]) if options.again else halves_of(name, options)
        print(f"{title}: {json.dumps(rows[title])}", flush=True)
        if options.write:
            RESULTS.write_text(json.dumps(results | rows, indent=1) + "\n")
    shown = results | rows if options.write else rows
    print(table_again(shown))
    if not options.again and options.rivals:
        print(table({name: row for name, row in shown.items() if "brushes" in row}))
    return [{"clip": name} | row for name, row in rows.items()]


def evidence_of_clip(name, options, folder):
    """Return the observations of a clip, and its film."""
    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import CameraDrift, evidence_of_truth, shoot
    from flockbrush.film.observe import observe

    if name == "sheep":
        return observe(options.data / SHEEP), None
    truth = herd(name, options.animals, options.seconds, seed=options.seed)
    if options.perfect:
        return evidence_of_truth(truth), None
    # the camera follows the herd and sees all of it
    extent = float(np.ptp(truth.xy - truth.xy.mean(1, keepdims=True), axis=(0, 1)).max()) + 6.0
    body = float(np.clip(620.0 / extent, 11.0, 22.0))
    side = int(np.ceil(extent * body / 16) * 16)
    film = shoot(truth, Path(folder) / "clip.mp4", (side, side), body, CameraDrift(follow=1.0), seed=5)
    return observe(film.path), film


def learned_from(clip, budget, jobs=1, model="auto"):
    """Return what `flockbrush learn` would learn from a clip."""
    from flockbrush.learning.model_choice import AUTO, comparison_of, hopeless, nearest
    from flockbrush.learning.model_fit import learned_model
    from flockbrush.learning.recipe import SearchSettings, learn
    from flockbrush.learning.which_model import problem_of

    found = learn(clip, SearchSettings(budget_s=budget), jobs=jobs)
    if model != AUTO or problem_of([clip]):
        return found
    models, how = comparison_of([clip], 0), {"jobs": jobs, "hopeless": hopeless(found)}
    return nearest([found, *(learned_model([clip], kind, **how) for kind in models.contenders)], models.likelier)


def halves_of(name, options):
    """Return the figures of one clip."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        evidence, film = evidence_of_clip(name, options, folder)
    first, second = halves(evidence)
    looked = time.perf_counter()
    found = learned_from(first, options.budget, options.jobs, options.model)
    learned = time.perf_counter()
    given = found.speed, found.body
    mine = judged(second, found.params, *given, found.vision)
    row = {
        **mine, "kind": found.kind, "chosen": found.starts[found.chosen].name,
        "params": found.params.model_dump(), "vision": found.vision.model_dump(), "body": found.body.model_dump(),
        "speed": found.speed.model_dump(), "seen one by one": first.sightings is not None,
        "looking, s": round(looked - begun, 1), "learning, s": round(learned - looked, 1),
    }  # fmt: skip
    row |= _battery_of(name, options, evidence, film, second, found, row)
    return row | _rivals_of(second, given, mine) if options.rivals else row


def halves(evidence):
    """Return the first half of a clip's frames, to learn from, and the rest, held out."""
    cut = round(0.5 * len(evidence.fields))
    return evidence.part(slice(0, cut)), evidence.part(slice(cut, None))


def _rivals_of(second, given, mine):
    """Return the distances of random parameters and shipped brushes from a clip, and what is nearer than they are."""
    from flockbrush.behaviours.brush import shipped

    from flockbrush.learning.rollout import params_of

    rng = np.random.default_rng(3)
    random = [judged(second, params_of(rng.uniform(0.02, 1, 12)), *given, None) for _ in range(RANDOM)]
    brushes, as_shipped = {}, {}
    for brush in (shipped().get(name) for name in shipped().names()):
        if brush.model == "herd" and brush.provenance.kind != "learned":
            brushes[brush.name] = judged(second, brush.params, *given, brush.vision)["distance"]
            as_shipped[brush.name] = judged(second, brush.params, brush.speed, brush.body, brush.vision)["distance"]
    return {
        "random, median": float(np.median([r["distance"] for r in random])),
        "random, best": min(r["distance"] for r in random), "brushes": brushes, "brushes as shipped": as_shipped,
        "better than all brushes": mine["distance"] < min(brushes.values()),
        "better than all brushes as shipped": mine["distance"] < min(as_shipped.values()),
        "better than random": mine["distance"] < float(np.median([r["distance"] for r in random])),
        "better than all random": mine["distance"] < min(r["distance"] for r in random),
    }  # fmt: skip


def again(name, options, row):
    """Return a stored row with the battery of its parameters, and of the true model simulated again."""
    from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec

    from flockbrush.learning.likelihood import likelihoods

    with tempfile.TemporaryDirectory() as folder:
        evidence, film = evidence_of_clip(name, options, folder)
    second = halves(evidence)[1]
    learned = SimpleNamespace(
        params=likelihoods()[row["kind"]].behaviour.Params(**row["params"]),
        speed=SpeedSpec.model_validate_json(json.dumps(row["speed"])), body=BodySpec(**row["body"]),
        vision=VisionSpec(**row["vision"]),
    )  # fmt: skip
    return row | _battery_of(name, options, evidence, film, second, learned, row)


def _battery_of(name, options, evidence, film, second, learned, row):
    """Return what the battery says of learned parameters, and of the true model simulated again."""
    from flockbrush.learning.battery import Battery
    from flockbrush.learning.verdict import judge

    verdict = judge(second, learned, {}, runs=FLOOR)
    out = {"battery": {"sentence": verdict.sentence, "kind": verdict.kind, **_missed(verdict.brush)}}
    if film is not None:
        out["floor"] = floor_of(name, options, evidence, film, Battery.of(second), row)
    return out


def floor_of(name, options, evidence, film, battery, row):
    """Return how near the true model comes to a clip's second half, and which measures it misses."""
    from benchmarks.foreign_herds import herd
    from flockbrush.learning.verdict import ALONE, FPS, Contender, after_long, settled

    def seen(frame, seconds, seed, step=1):
        """Return a run of the true model that leaves the film at a frame, from there on."""
        truth = herd(name, options.animals, seconds, seed=options.seed, other=(frame, seed))
        return run_of(dataclasses.replace(film, truth=truth).seen_from(0, evidence.body_length_px), frame, step)

    end, clip = len(evidence.fields), battery.clip
    runs = [seen(end - len(clip.fields), options.seconds, seed) for seed in range(FLOOR)]
    step = round(evidence.fps / FPS)
    long = [seen(end - 1, options.seconds + ALONE, seed, step) for seed in range(LONG_FLOOR)]
    rows = battery.compared([battery.measured(run) for run in runs])
    near = within(clip, runs, row)
    return near | _missed(Contender(name, rows, after_long(battery, rows, [settled(battery, run) for run in long])))


def run_of(truth, frame=0, step=1):
    """Return a herd of `foreign_herds` from a frame on as a run; every so many frames."""
    from flockbrush.learning.rollout import Run

    velocity = np.gradient(truth.xy, 1 / truth.fps, axis=0)
    xy, forward, velocity = (values[frame::step] for values in (truth.xy, truth.forward, velocity))
    count, n = xy.shape[:2]
    ids, flat = np.tile(np.arange(n), count), (count * n, 2)
    times = np.arange(count) * step / truth.fps
    return Run(times, np.arange(count + 1) * n, ids, xy.reshape(flat), forward.reshape(flat), velocity.reshape(flat))


def _missed(contender):
    """Return the measures that a contender misses, and those that do not last."""
    short, long = ([r.name for r in rows if not r.met] for rows in (contender.rows, contender.lasting))
    return {"missed": short, "not lasting": long}


def within(clip, runs, row):
    """Return the polarization and milling of runs, and whether they are within the limits of a row."""
    from flockbrush.learning.herd_views import view_of_run
    from flockbrush.learning.scores import ClipTarget, measures_of

    target = ClipTarget.of(clip)
    seen = [measures_of(view_of_run(run, clip, target.single), target.every) for run in runs]
    out = {name: round(float(np.mean([np.nanmean(s[name]) for s in seen])), 3) for name in JUDGED}
    met = [abs(out[name] - row[name]["clip"]) <= row[name]["limit"] for name in JUDGED]
    return {"within": bool(all(met))} | out


def judged(clip, params, speed, body, vision, runs=RUNS):
    """Return the distance to a clip of herds with these parameters that start like the clip."""
    from flockbrush.behaviours.brush import VisionSpec

    from flockbrush.learning.herd_views import view_of_run
    from flockbrush.learning.scores import ClipTarget, distance, measures_of, total
    from flockbrush.learning.trials import simulate

    target = ClipTarget.of(clip)
    vision = VisionSpec() if vision is None else vision
    seen, parts = [], []
    for seed in range(runs):
        went = simulate(clip, params, speed, body, vision, [77, seed])
        seen.append(measures_of(view_of_run(went, clip, target.single), target.every))
        parts.append(total(distance(went, clip, target)))
    out = {"distance": round(float(np.mean(parts)), 3), "within": True}
    for name in JUDGED:
        theirs, mine = target.over_time[name], float(np.mean([np.nanmean(s[name]) for s in seen]))
        limit = max(2.0 * float(np.nanstd(theirs)), 0.05)
        off = abs(mine - float(np.nanmean(theirs)))
        out[name] = {"clip": round(float(np.nanmean(theirs)), 3), "herd": round(mine, 3), "limit": round(limit, 3)}
        out["within"] = bool(out["within"] and off <= limit)
    return out


def table(rows):
    """Return the results as Markdown."""
    lines = [
        "| clip | polarization, clip / herd (limit) | milling | distance | random, median (best) "
        "| best brush as shipped | best brush with the clip's speeds |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        cells = [f"{row[m]['clip']:.2f} / {row[m]['herd']:.2f} ({row[m]['limit']:.2f})" for m in JUDGED]
        cells += [f"{row['distance']:.2f}", f"{row['random, median']:.2f} ({row['random, best']:.2f})"]
        for rivals in (row["brushes as shipped"], row["brushes"]):
            best = min(rivals, key=rivals.get)
            cells.append(f"{best} {rivals[best]:.2f}")
        lines.append(f"| {name}{'' if row['within'] else ' (missed)'} | " + " | ".join(cells) + " |")
    for what, key in COUNTED.items():
        names = [name for name, row in rows.items() if row[key]]
        lines.append(f"\n{what}: {len(names)} of {len(rows)} ({', '.join(names)})")
    return "\n".join(lines)


def table_again(rows):
    """Return the battery of the stored parameters beside the floor, as Markdown."""
    rows = {name: row for name, row in rows.items() if "battery" in row}
    lines = [
        "| clip | polarization, clip / herd / floor (limit) | milling | battery, learned | battery, floor |",
        "|---|---|---|---|---|",
    ]
    for name, row in rows.items():
        floor = row.get("floor")
        cells = [
            f"{row[m]['clip']:.2f} / {row[m]['herd']:.2f} / {'-' if floor is None else format(floor[m], '.2f')} "
            f"({row[m]['limit']:.2f})"
            for m in JUDGED
        ]
        cells += ["-" if found is None else _said(found) for found in (row["battery"], floor)]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    known = [row for row in rows.values() if "floor" in row]
    for what, some, key in (("learned", list(rows.values()), "battery"), ("floor", known, "floor")):
        near = sum((row if key == "battery" else row[key])["within"] for row in some)
        short, both = (sum(not any(row[key][k] for k in kinds) for row in some) for kinds in (KINDS[:1], KINDS))
        lines.append(
            f"\n{what}: polarization and milling within the limits: {near} of {len(some)}; whole battery: "
            f"{short} of {len(some)}, and still so after 20 s alone: {both}"
        )
        same = sum(not set(row[key]["missed"]) - OF_A_BRUSH for row in some)
        lines.append(f"{what}, without the measures that only a brush has: {same} of {len(some)}")
        often = Counter(name for row in some for name in row[key]["missed"])
        lines.append(f"{what}, missed in so many: " + ", ".join(f"{name} {n}" for name, n in often.most_common()))
    kinds = [row["battery"]["kind"] for row in rows.values()]
    lines.append(
        "\nsentences on the learned brushes: " + ", ".join(f"{k} {kinds.count(k)}" for k in sorted(set(kinds)))
    )
    return "\n".join(lines)


def _said(found):
    text = ", ".join(found["missed"] + [f"{name} after 20 s" for name in found["not lasting"]])
    return f"misses {text}" if text else "met"
