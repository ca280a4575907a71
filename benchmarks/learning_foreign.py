"""Learn from clips of models that learning was not developed on, and ask whether the verdict is right.

    python benchmarks/learning.py foreign [--clips turners pursuit ...] [--quick | --thorough] [--write]
    python benchmarks/learning.py foreign --floor --seed 45

Eight models (`UNSEEN` of ``benchmarks/unseen_herds.py``) are filmed like the clips of ``halves``, and a brush is
learned as ``flockbrush learn`` does it.  Its herd starts as the last frame was observed and runs for 20 s, and so does
the model itself with other random numbers.  The herd *moves alike* if polarization and milling agree within .1 and the
distance to the nearest neighbour within 10 %, as means over the last 15 s and `FUTURES` runs of both: the limits of
``truth``.  The verdict is *right* if it is "moves like the film" for a herd that moves alike and another sentence for
one that does not; "cannot be told" is right if the model itself is beyond the limits.  Beside each stand two floors in
the place of the herd: `FUTURES` further runs of the model, and the model in the frames of the clip, which is what a
herd comes to that stays as it was filmed (``--floor`` learns nothing and tells these alone).
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.unseen_herds import UNSEEN

RESULTS = Path(__file__).resolve().parent / "learning_foreign.json"
SEED, FUTURES = 41, 4
FLOORS = ("model against itself", "floor"), ("model as in its clip", "filmed")


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("foreign", help="clips of models that learning was not developed on")
    parser.add_argument("--clips", nargs="*", default=list(UNSEEN), help=", ".join(UNSEEN))
    parser.add_argument("--animals", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--seed", type=int, default=SEED, help="seed of the filmed herds")
    parser.add_argument("--quick", action="store_true", help="learn with --quick")
    parser.add_argument("--thorough", action="store_true", help="learn with --thorough")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--floor", action="store_true", help="only the model against itself")
    parser.add_argument("--write", action="store_true", help=f"store the results in {RESULTS.name}")
    parser.set_defaults(run=run, perfect=False)


def run(options):
    """Run the study; print a line for each clip, and the table."""
    if options.floor:
        return floors(options)
    rows = json.loads(RESULTS.read_text()) if options.write and RESULTS.exists() else {}
    for name in options.clips:
        rows[name] = of_clip(name, options)
        print(f"{name}: {json.dumps(rows[name])}", flush=True)
        if options.write:
            RESULTS.write_text(json.dumps(rows, indent=1) + "\n")
    print(table(rows))
    return [{"clip": name} | row for name, row in rows.items()]


def of_clip(name, options):
    """Return the figures of one clip."""
    from flockbrush.engine.problems import ProblemsError
    from learning_halves import evidence_of_clip
    from learning_truth import fresh, judged

    from flockbrush.learning.learn import LearnOptions, learn_brushes

    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        clip, film = evidence_of_clip(name, options, folder)
        wishes = LearnOptions(
            [film.path], Path(folder) / "foreign.brush.toml", quick=options.quick, thorough=options.thorough,
            jobs=options.jobs, silent=True,
        )  # fmt: skip
        try:
            found = learn_brushes(wishes)[0]
        except ProblemsError as refusal:
            return {"kind": "refused", "sentence": str(refusal), "alike": False, "right": False}
    learned = found.learned
    model, floor, filmed = *futures(name, clip, film, options), as_filmed(clip, film)
    told = learned.params, learned.speed, learned.body, learned.vision
    herds = [fresh(None, clip, *told, 300 + seed) for seed in range(FUTURES)]
    mine = _means(herds)
    alike, steady, same = (judged(which, model)["kept"] for which in (mine, floor, filmed))
    kind = "untold" if found.judgement is None else found.judgement.kind
    return {
        "kind": kind, "learned as": learned.kind, "sentence": found.verdict(), "alike": alike, "floor": steady,
        "filmed": same, "right": not steady if kind == "untold" else (kind == "like") == alike,
        "model": model, "model again": floor, "model in the clip": filmed, "herd": mine,
        "seen one by one": clip.sightings is not None,
        "seconds": round(time.perf_counter() - begun),
    }  # fmt: skip


def futures(name, clip, film, options):
    """Return the means of `FUTURES` runs of the model from the last frame of its clip, and of as many others."""
    from learning_halves import run_of
    from learning_truth import FPS, FRESH, measures_of_run

    from benchmarks.foreign_herds import herd

    end, runs = len(clip.fields) - 1, []
    for seed in range(2 * FUTURES):
        truth = herd(name, options.animals, options.seconds + FRESH, seed=options.seed, other=(end, seed))
        seen = dataclasses.replace(film, truth=truth).seen_from(0, clip.body_length_px)
        runs.append(measures_of_run(run_of(seen, end, round(seen.fps / FPS))))
    return _means(runs[:FUTURES]), _means(runs[FUTURES:])


def as_filmed(clip, film):
    """Return the means of the model over the frames of its clip."""
    from learning_halves import run_of
    from learning_truth import measures_of_run

    run = run_of(film.seen_from(0, clip.body_length_px))
    return _means([measures_of_run(run, range(0, len(clip.fields), 5))])


def floors(options):
    """Print whether the models move as in other runs of theirs, and as in their clips; learn nothing."""
    from learning_halves import evidence_of_clip
    from learning_truth import judged

    rows = []
    for name in options.clips:
        with tempfile.TemporaryDirectory() as folder:
            clip, film = evidence_of_clip(name, options, folder)
            model, again, filmed = *futures(name, clip, film, options), as_filmed(clip, film)
        same, still = judged(again, model)["kept"], judged(filmed, model)["kept"]
        told = {"model": model, "model again": again, "model in the clip": filmed, "floor": same, "filmed": still}
        rows.append({"clip": name} | told)
        print(f"{name}: {json.dumps(rows[-1])}", flush=True)
    for what, key in FLOORS:
        print(f"{what}: {sum(row[key] for row in rows)} of {len(rows)}")
    return rows


def _means(rows):
    return {name: round(float(np.mean([row[name] for row in rows])), 3) for name in rows[0]}


def table(rows):
    """Return the results as Markdown."""
    names = ("polarization", "milling", "nearest neighbour")
    lines = ["| clip | " + " | ".join(f"{n}, model / herd" for n in names) + " | moves alike | verdict | right |"]
    lines.append("|---" * 7 + "|")
    for name, row in rows.items():
        cells = [f"{row['model'][n]:.2f} / {row['herd'][n]:.2f}" for n in names] if "herd" in row else ["-"] * 3
        cells += ["yes" if row["alike"] else "no", row["sentence"], "yes" if row["right"] else "no"]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    for what, key in (("moves alike", "alike"), ("verdict right", "right"), *FLOORS):
        lines.append(f"\n{what}: {sum(bool(row.get(key)) for row in rows.values())} of {len(rows)}")
    return "\n".join(lines)
