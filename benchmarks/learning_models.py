"""Identify the model of simulated herds from their tracks alone.

    python benchmarks/learning.py models [--seeds 3] [--animals 40] [--seconds 10] [--only TRUTH ...] [--write]

Each known model is simulated once per seed, with random headings at the start.  The comparison gets only the
positions, with noise of a thousandth of a body length, at 16 frames per second.  The table has a row for each true
model: how often it alone was found, how often it tied with others for the best, and how often only others were found.
"""

from __future__ import annotations

import datetime
import json
import time
from pathlib import Path

import numpy as np

FPS, WARM, DENSITY, NOISE = 16, 1.0, 0.5, 0.001  # frames/s, s before the first frame, animals/BL², BL
RESULTS = Path(__file__).resolve().parent / "learning_models.json"
BROAD = {"range": 16.0, "sight": "metric"}
NEAREST = {"range": 20.0, "sight": "topological", "neighbours": 6, "occlusion": False}


def truths() -> dict[str, tuple[str, object]]:
    """Return {name: (kind of the true model, its brush)}; animals are one metre long."""
    from flockbrush.behaviours.brush import BodySpec, Brush, Provenance, SpeedSpec, VisionSpec, shipped

    march = shipped().get("march").params.model_dump() | {"wander": 0.3}
    boids = {
        "grounded": True, "min_speed": 0.2, "max_speed": 4.0, "neighbour_range": 8.0, "separation": 1.5,
        "matching_time": 0.6, "max_acceleration": 0.5, "exponent": 1.0,
    }  # fmt: skip
    zones = {"repulsion": 1.0, "orientation": 2.0, "attraction": 8.0, "max_turn": 1.5, "wander": 0.2}
    morse = {"attraction": 8.0, "attraction_reach": 10.0, "repulsion": 8.0, "repulsion_reach": 1.2}
    force_map = {
        "attraction_half": -8.0, "attraction_1": -2.0, "attraction_2": 0.5, "attraction_4": 1.5, "attraction_8": 3.0,
        "alignment_1": 1.5, "alignment_2": 1.0, "alignment_4": 0.0, "front_alignment": 0.5, "wander": 0.4,
    }  # fmt: skip
    made = {
        "herd": ("herd", "herd", march, {"range": 4.0}),
        "topological, 6": ("topological", "herd", march | {"neighbour_range": 20.0}, NEAREST),
        "zones": ("zones", "zones", zones, BROAD),
        "zones, seen": ("zones", "zones", zones, {"range": 16.0}),
        "boids": ("boids", "boids", boids, BROAD),
        "morse": ("morse", "morse", morse, BROAD),
        "force_map": ("force_map", "force_map", force_map, BROAD),
    }
    told = Provenance(
        kind="hand-set", source="a benchmark", date=datetime.date(2026, 1, 1), by="benchmarks/learning.py"
    )
    return {
        name: (kind, Brush(
            name=model, model=model, parameters=parameters, speed=SpeedSpec(mean=2.0, deviation=0.1), body=BodySpec(),
            vision=VisionSpec(**vision), provenance=told,
        ))
        for name, (kind, model, parameters, vision) in made.items()
    }  # fmt: skip


def tracks_of(brush, count=40, seconds=10.0, seed=3):
    """Return positions (T, N, 2), BL."""
    from flockbrush.components import Position

    import flockbrush

    simulation = flockbrush.plane(brush, count, DENSITY, "scatter", seed)
    simulation.run(round(32 * WARM))
    xy = []
    for _ in range(round(seconds * FPS)):
        xy.append(simulation.agents[Position.xyz][:, :2].copy())
        simulation.run(32 // FPS)
    return np.array(xy)


def evidence_of(xy, noise=NOISE):
    """Return the observations made of tracks in body lengths."""
    from flockbrush.film.track_evidence import evidence_of_tracks
    from flockbrush.film.track_files import Trajectories

    xy = xy + noise * np.random.default_rng(0).normal(size=xy.shape)
    ids = tuple(map(str, range(xy.shape[1])))
    return evidence_of_tracks(Trajectories(xy, ids, float(FPS), "bl", frames=np.arange(len(xy))), 1.0)


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("models", help="identify the model of simulated herds from tracks")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--animals", type=int, default=40)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--only", nargs="*", default=None, metavar="TRUTH")
    parser.add_argument("--write", action="store_true", help=f"store the results in {RESULTS.name}")
    parser.set_defaults(run=run)


def run(args):
    """Return a row for each true model and seed; print the confusion table."""
    from flockbrush.learning.which_model import compare_models

    rows = []
    for name, (kind, brush) in truths().items():
        for seed in range(args.seeds) if args.only is None or name in args.only else ():
            begin = time.perf_counter()
            found = compare_models([evidence_of(tracks_of(brush, args.animals, args.seconds, seed))], seed=seed)
            best = found.rows[0]
            rows.append({
                "truth": name, "kind": kind, "seed": seed, "equal": found.equal, "best": best.name,
                "perception": best.perception, "score": best.score, "seconds": time.perf_counter() - begin,
                "behind": {row.name: [row.behind, row.behind_error] for row in found.rows[1:]},
            })  # fmt: skip
            print(f"{name}, seed {seed}: {found.sentence}", flush=True)
    print(f"\n{args.animals} animals, {args.seconds:g} s\n" + table_of(rows))
    if args.write:
        kept = {"animals": args.animals, "seconds": args.seconds, "rows": rows}
        RESULTS.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    return rows


def table_of(rows) -> str:
    """Return the confusion table as Markdown."""
    kinds = sorted({row["kind"] for row in rows})
    lines = ["| true model | found alone | tied for best | wrong | likeliest |", "|---|---|---|---|---|"]
    for truth in dict.fromkeys(row["truth"] for row in rows):
        mine = [row for row in rows if row["truth"] == truth]
        alone = sum(row["equal"] == [row["kind"]] for row in mine)
        among = sum(row["kind"] in row["equal"] for row in mine) - alone
        best = {kind: sum(row["best"] == kind for row in mine) for kind in [*kinds, "herd"]}
        named = ", ".join(f"{kind} {count}" for kind, count in best.items() if count)
        lines.append(f"| {truth} | {alone} of {len(mine)} | {among} | {len(mine) - alone - among} | {named} |")
    return "\n".join(lines)
