"""Learn from the first half of a clip and predict the second.

    python benchmarks/learning.py halves [--clips band mill swarm ...] [--write]

The clips show herds of other models from the literature (``benchmarks/herd_film.py``), filmed by a camera that drifts,
turns and zooms and observed by ``observe``, and real sheep if ``../shared/data`` exists.  A herd with the learned
brush starts like the second half.  Its polarization and milling (means over the half and five runs) must agree with
the clip within two of the clip's own standard deviations or .05, whichever is larger.  Its distance to the clip over
all measures (``flockbrush.learning.scores``, mean over as many runs for all) is compared with those of random
parameters and of every shipped brush: as shipped and, harder to beat, with the speeds and bodies learned from the
clip, so that only the turning differs.
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

import numpy as np

CLIPS = "band", "mill", "swarm", "torus", "drifting mill", "topological", "school", "graze"  # all used in development
SHEEP = Path(__file__).resolve().parents[2] / "shared" / "data" / "aerial_sheep" / "sheep_0043.mp4"
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


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("halves", help="learn from the first half of clips and predict the second")
    parser.add_argument("--clips", nargs="*", default=[*CLIPS, "sheep"], help="models of foreign_herds, or sheep")
    parser.add_argument("--animals", type=int, default=70)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--budget", type=float, default=90.0, help="seconds of trials and evolution, counted in work")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=SEED, help="seed of the filmed herds")
    parser.add_argument("--perfect", action="store_true", help="a perfect observer instead of a film")
    parser.add_argument("--write", action="store_true", help=f"store the results in {RESULTS.name}")
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print a line for each clip."""
    results = json.loads(RESULTS.read_text()) if options.write and RESULTS.exists() else {}
    rows = {}
    for name in options.clips:
        if name == "sheep" and not SHEEP.exists():
            print("sheep: skipped, there is no ../shared/data")
            continue
        title = name if options.seed == SEED or name == "sheep" else f"{name}, seed {options.seed}"
        rows[title] = halves_of(name, options)
        print(f"{title}: {json.dumps(rows[title])}", flush=True)
        if options.write:
            RESULTS.write_text(json.dumps(results | rows, indent=1) + "\n")
    print(table(results | rows if options.write else rows))
    return [{"clip": name} | row for name, row in rows.items()]


def evidence_of_clip(name, options, folder):
    """Return the observations of a clip."""
    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import Camera, evidence_of_truth, shoot
    from flockbrush.film.observe import observe

    if name == "sheep":
        return observe(SHEEP)
    truth = herd(name, options.animals, options.seconds, seed=options.seed)
    if options.perfect:
        return evidence_of_truth(truth)
    # the camera follows the herd and sees all of it
    extent = float(np.ptp(truth.xy - truth.xy.mean(1, keepdims=True), axis=(0, 1)).max()) + 6.0
    body = float(np.clip(620.0 / extent, 11.0, 22.0))
    side = int(np.ceil(extent * body / 16) * 16)
    film = shoot(truth, Path(folder) / "clip.mp4", (side, side), body, Camera(follow=1.0), seed=5)
    return observe(film.path)


def halves_of(name, options):
    """Return the figures of one clip."""
    from flockbrush.behaviours.brush import shipped

    from flockbrush.film.observations import halves
    from flockbrush.learning.recipe import SearchSettings, learn
    from flockbrush.learning.rollout import params_of

    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        first, second = halves(evidence_of_clip(name, options, folder))
    looked = time.perf_counter()
    found = learn(first, SearchSettings(budget_s=options.budget), jobs=options.jobs)
    learned = time.perf_counter()
    given = found.speed, found.body
    mine = judged(second, found.params, *given, found.vision)
    rng = np.random.default_rng(3)
    random = [judged(second, params_of(rng.uniform(0.02, 1, 12)), *given, None) for _ in range(RANDOM)]
    brushes, as_shipped = {}, {}
    for brush in (shipped().get(name) for name in shipped().names()):
        if brush.model == "herd" and brush.provenance.kind != "learned":
            brushes[brush.name] = judged(second, brush.params, *given, brush.vision)["distance"]
            as_shipped[brush.name] = judged(second, brush.params, brush.speed, brush.body, brush.vision)["distance"]
    return {
        "within": mine["within"], "polarization": mine["polarization"], "milling": mine["milling"],
        "distance": mine["distance"], "random, median": float(np.median([r["distance"] for r in random])),
        "random, best": min(r["distance"] for r in random), "brushes": brushes, "brushes as shipped": as_shipped,
        "better than all brushes": mine["distance"] < min(brushes.values()),
        "better than all brushes as shipped": mine["distance"] < min(as_shipped.values()),
        "better than random": mine["distance"] < float(np.median([r["distance"] for r in random])),
        "better than all random": mine["distance"] < min(r["distance"] for r in random),
        "chosen": found.starts[found.chosen].name, "theta": np.round(found.theta, 3).tolist(),
        "extras": {k: round(v, 3) if isinstance(v, float) else v for k, v in found.extras.items()},
        "seen one by one": first.sightings is not None, "looking, s": round(looked - begun, 1),
        "learning, s": round(learned - looked, 1),
    }  # fmt: skip


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
    for name in ("polarization", "milling"):
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
        cells = [
            f"{row[m]['clip']:.2f} / {row[m]['herd']:.2f} ({row[m]['limit']:.2f})" for m in ("polarization", "milling")
        ]
        cells += [f"{row['distance']:.2f}", f"{row['random, median']:.2f} ({row['random, best']:.2f})"]
        for rivals in (row["brushes as shipped"], row["brushes"]):
            best = min(rivals, key=rivals.get)
            cells.append(f"{best} {rivals[best]:.2f}")
        lines.append(f"| {name}{'' if row['within'] else ' (missed)'} | " + " | ".join(cells) + " |")
    for what, key in COUNTED.items():
        names = [name for name, row in rows.items() if row[key]]
        lines.append(f"\n{what}: {len(names)} of {len(rows)} ({', '.join(names)})")
    return "\n".join(lines)
