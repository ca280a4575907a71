"""Benchmark learning from clips.

    python benchmarks/learning.py step [--animals 500 1000 1500] [--rounds 20]
    python benchmarks/learning.py truth [--quick] [--write]     known truths (learning_truth.py)
    python benchmarks/learning.py halves [--clips ...] [--write]  predict the second half of clips (learning_halves.py)
    python benchmarks/learning.py foreign [--quick] [--write]   models not developed on (learning_foreign.py)
    python benchmarks/learning.py paper [--starts 2]            errors from fields and the paper's (learning_paper.py)
    python benchmarks/learning.py calibration [--count 60] [--write]  errors of the verdict (learning_calibration.py)
    python benchmarks/learning.py errors [--herds 16]          numbers and the errors reported (learning_errors.py)
    python benchmarks/learning.py tracks --data DIR [--write]   tracks of real animals (learning_tracks.py)
    python benchmarks/learning.py sheep [--budget 90]           density overlap with real sheep (learning_sheep.py)
    python benchmarks/learning.py models [--seeds 3] [--write]  identify the model (learning_models.py)
    python benchmarks/learning.py observed                     known herds and their noisy tracks (learning_observed.py)
    python benchmarks/learning.py time [--runs 1]               seconds of learning a clip (learning_times.py)
    python benchmarks/learning.py photos [--full]               spacing from photographs (learning_photos.py)
    python benchmarks/learning.py variants [--full]             compressions and crops (learning_variants.py)
    python benchmarks/learning.py positions [--animals 200] [--starts 5] [--noise DEGREES BODYLENGTHS]

``step``: milliseconds of one optimisation step (visibility, the turns of all animals and their gradients), by torch
with the errors of the paper (eqs. 7 and 8), and by the kernel that fits turns.  Gong et al. (2025) report 100, 300 and
1,200 ms for 500, 1,000 and 1,500 animals in C++.  On a shared machine read the minimum.

``positions``: error of the learned parameters when all positions and turns are known exactly (section 7.1.1), for five
known herds and random starts.  A parameter counts as identifiable if its Cramér-Rao deviation is below .1.  The sum of
all twelve errors depends on the starts, because parameters that are not identifiable keep their start or default.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import time
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parent.parent)]

import learning_calibration  # noqa: E402
import learning_errors  # noqa: E402
import learning_foreign  # noqa: E402
import learning_halves  # noqa: E402
import learning_models  # noqa: E402
import learning_observed  # noqa: E402
import learning_paper  # noqa: E402
import learning_photos  # noqa: E402
import learning_sheep  # noqa: E402
import learning_times  # noqa: E402
import learning_tracks  # noqa: E402
import learning_truth  # noqa: E402
import learning_variants  # noqa: E402
from flockbrush.behaviours.brush import BodySpec, SpeedSpec, VisionSpec  # noqa: E402

TRUTHS = {  # weight, radial, angular of avoidance, cohesion, alignment; speed and its deviation, BL/s
    "march": ((0.742, 0.526, 1, 0.505, 1, 0.965, 0.499, 1, 1), 4.0, 0.2),
    "filled mill": ((0.31, 0.18, 0.18, 0.43, 0.83, 0.98, 0.46, 0.32, 0.40), 6.7, 0.67),
    "swarm": ((0.68, 0.31, 0.80, 0.11, 1, 1, 0.001, 0.31, 0.98), 1.28, 0.13),
    "graze": ((0.90, 0.30, 1, 0.08, 1, 1, 0.015, 0.60, 1), 0.3, 0.06),
    "column": ((0.42, 0.16, 0.27, 0.44, 1, 0.29, 0.63, 0.72, 0.39), 3.5, 0.35),
}  # found with an independent simulator
BODIES = {"filled mill": BodySpec(radius=0.25, contact="disc")}  # capsules would jam
OBSTACLE = 0.15, 0.5, 0.5  # of the known herds; there are no obstacles
PAPER = learning_paper.PAPER_MS


# a step of optimisation ---------------------------------------------------------------------------------


def step(args):
    """Return a row per number of animals: neighbours, and milliseconds of each method."""
    import torch

    from flockbrush.learning.torch_herd import threads

    with threads(args.threads):
        rows = [_step_of(count, args.rounds) for count in args.animals]
    _print(rows, f"{platform.processor() or platform.machine()}, torch {torch.__version__}, {args.threads} threads")
    return rows


def _step_of(count, rounds, density=0.7):
    from flockbrush.learning.perceive import perceive
    from flockbrush.learning.torch_herd import headings, sight_of, theta_tensor
    from flockbrush.learning.torch_losses import aims, error_mean, error_var
    from flockbrush.learning.turns import Turns, predicted

    xy, forward, fields = _herd(count, density)
    theta, body, vision = np.full(12, 0.5), BodySpec(), VisionSpec()

    def see():
        return perceive(xy, forward, body, vision)

    def by_torch():
        sight, leaf = sight_of(see()), theta_tensor(theta, requires_grad=True)
        ahead, aim = headings(leaf, sight), aims(fields, 0, xy, 0.5, leaf.device)
        follows = ~sight.leader
        error = error_mean(ahead, aim, follows) + error_var(ahead, aim, follows, int(np.prod(fields.shape)))
        error.backward()
        return leaf.grad

    def by_kernel():
        rest = np.zeros((count, 2)), np.zeros(count), np.arange(count), np.ones(count), np.zeros(count), np.ones(count)
        turn, slope = predicted(Turns(see(), *rest, 0.3, 0.2), theta)
        return slope.T @ slope, slope.T @ turn

    return {
        "animals": count, "visible": round(len(see().near) / count, 1), "seeing, ms": _least(see, rounds),
        "torch, ms": _least(by_torch, rounds), "kernel, ms": _least(by_kernel, rounds),
        "paper, ms": PAPER.get(count, float("nan")),
    }  # fmt: skip


def _herd(count, density):
    """Return positions and headings of animals on a jittered lattice, and the fields of one frame."""
    from flockbrush.film.observations import Fields

    rng = np.random.default_rng(count)
    side = int(np.ceil(count**0.5))
    lattice = np.argwhere(np.ones((side, side)))[:count] / density**0.5
    xy, angle = lattice + rng.uniform(-0.3, 0.3, (count, 2)), rng.uniform(-np.pi, np.pi, count)
    cell, shape = float(xy.max() + 1) / 30, (1, 30, 30)
    fields = Fields(
        fps=25.0, cell=cell, origin=np.zeros(2), density=rng.uniform(0, 2 * density, shape),
        velocity=rng.normal(0, 1, (*shape, 2)), speed_variance=np.zeros(shape),
        angular_variance=rng.uniform(0, 2700, shape), seen=np.ones(shape, bool), obstacle=np.zeros(shape[1:], bool),
        region=np.zeros(shape[1:], np.uint8), count=np.array([float(count)]), frames=np.arange(1),
    )  # fmt: skip
    return xy, np.column_stack([np.cos(angle), np.sin(angle)]), fields


def _least(work, rounds):
    """Return the least milliseconds of several rounds; the 5th percentile of 50 or more."""
    work()
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - begin))
    return round(min(times), 2) if rounds < 50 else round(statistics.quantiles(times, n=20)[0], 2)


# parameters from positions ------------------------------------------------------------------------------------


def positions(args):
    """Return a row per known herd and start: identifiable parameters and errors."""
    rows = [row for name in args.truths for row in _found(name, args)]
    _print(rows, f"{args.animals} animals, {args.seconds:g} s, noise {args.noise[0]:g} degrees, {args.noise[1]:g} BL")
    known = [row["identifiable, each"] for row in rows if row["identifiable"]]
    print(f"mean error of the identifiable parameters: {np.mean(known):.4f}, worst {np.max(known):.4f}")
    print(f"sum of 12: {np.mean([row['sum of 12'] for row in rows]):.2f} (the paper, from fields: .72)")
    return rows


def _found(name, args):
    from flockbrush.learning.rollout import BODY, DT
    from flockbrush.learning.turns import best_fit, turns_of

    evidence, truth = _evidence(name, args)
    turns = turns_of(evidence, BODIES.get(name, BODY), span=args.span or DT)
    for start in range(args.starts):
        begin = time.perf_counter()
        fit = best_fit(turns, seed=start)
        known, off = fit.deviation < 0.1, np.abs(fit.theta - truth)
        yield {
            "truth": name, "start": start, "identifiable": int(known.sum()),
            "identifiable, each": round(float(off[known].mean()), 4) if known.any() else np.nan,
            "sum of 9": round(float(off[:9].sum()), 2), "sum of 12": round(float(off.sum()), 2),
            "seconds": round(time.perf_counter() - begin, 1),
        }  # fmt: skip


def _evidence(name, args):
    """Return exact or noisy observations of a known herd, and its twelve parameters."""
    from benchmarks.foreign_herds import Truth
    from benchmarks.herd_film import evidence_of_truth
    from flockbrush.learning.rollout import BODY, HerdStart, params_of, rollout

    nine, mean, deviation = TRUTHS[name]
    truth, rng = np.array([*nine, *OBSTACLE]), np.random.default_rng(1)
    side = int(np.ceil(args.animals**0.5))
    spacing = (1 / 0.15) ** 0.5 if name == "graze" else (1 / 0.7) ** 0.5
    xy = np.argwhere(np.ones((side, side)))[: args.animals] * spacing + rng.uniform(-0.3, 0.3, (args.animals, 2))
    angle = rng.uniform(-np.pi, np.pi, args.animals) * (0.1 if name == "column" else 1.0)
    start = HerdStart(xy, np.column_stack([np.cos(angle), np.sin(angle)]))
    whole = rollout(
        start,
        params_of(truth),
        SpeedSpec(mean=mean, deviation=deviation),
        BODIES.get(name, BODY),
        seconds=args.warm + args.seconds,
        fps=args.fps,
    )
    frames = round(args.seconds * args.fps)
    place, ahead = (v.reshape(len(whole), -1, 2)[-frames:] for v in (whole.xy, whole.forward))
    speed = np.hypot(*np.moveaxis(whole.velocity.reshape(len(whole), -1, 2)[-frames:], -1, 0))
    wrong = np.radians(args.noise[0]) * rng.normal(size=ahead.shape[:2])
    ahead = np.stack([
        np.cos(wrong) * ahead[..., 0] - np.sin(wrong) * ahead[..., 1],
        np.sin(wrong) * ahead[..., 0] + np.cos(wrong) * ahead[..., 1],
    ], -1)  # fmt: skip
    place = place + args.noise[1] * rng.normal(size=place.shape)
    return evidence_of_truth(Truth(name, args.fps, place, ahead, speed)), truth


# the command ---------------------------------------------------------------------------------------------


def _print(rows, title):
    print(title)
    print(" | ".join(rows[0]))
    for row in rows:
        print(" | ".join(str(value) for value in row.values()))


def main(argv=None):
    """Run one of the benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="also write the rows to this file")
    parts = parser.add_subparsers(dest="part", required=True)
    one = parts.add_parser("step", help="milliseconds of one optimisation step")
    one.add_argument("--animals", type=int, nargs="+", default=list(PAPER))
    one.add_argument("--rounds", type=int, default=20)
    one.add_argument("--threads", type=int, default=1)
    one.set_defaults(run=step)
    two = parts.add_parser("positions", help="parameters from exact positions and turns")
    two.add_argument("--truths", nargs="+", choices=list(TRUTHS), default=list(TRUTHS))
    two.add_argument("--animals", type=int, default=200)
    two.add_argument("--starts", type=int, default=5)
    two.add_argument("--seconds", type=float, default=2.0)
    two.add_argument("--warm", type=float, default=4.0, help="seconds simulated before the observation starts")
    two.add_argument("--fps", type=float, default=32.0)
    two.add_argument("--span", type=float, default=0.0, help="seconds over which turns are taken; default: one tick")
    two.add_argument("--noise", type=float, nargs=2, default=(0.0, 0.0), help="noise of headings and positions")
    two.set_defaults(run=positions)
    learning_truth.add(parts)
    learning_halves.add(parts)
    learning_foreign.add(parts)
    learning_paper.add(parts)
    learning_calibration.add(parts)
    learning_errors.add(parts)
    learning_tracks.add(parts)
    learning_models.add(parts)
    learning_observed.add(parts)
    learning_photos.add(parts)
    learning_sheep.add(parts)
    learning_times.add(parts)
    learning_variants.add(parts)
    args = parser.parse_args(argv)
    rows = args.run(args)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
