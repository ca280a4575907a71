"""The ground-truth convergence of Gong et al. (2025), section 7.1.1, beside ours.

    python benchmarks/learning.py paper [--animals 500 1000 1500] [--truths march swarm column] [--starts 2]

The paper runs a herd with known parameters, computes density and velocity fields, learns all twelve parameters from
them by gradient descent, and gives the sum of their errors, a mean over starts: .72, and .85 without density.  It gives
milliseconds of an optimisation step for three numbers of animals.  It names neither the truth nor the starts.

This runs the same descent (`flockbrush.learning.torch_descent`) on fields of shipped brushes, 30 x 30 cells, from two
kinds of starts: random ones, and starts that are off by at most ``--near`` in each parameter.  ``before`` is the sum of
the errors of the starts.  No obstacle is in these fields, so the three parameters of obstacle avoidance stay where they
start; ``obstacles`` is their part of the sum after learning.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np

PAPER = {"with density": 0.72, "without density": 0.85}  # sum of 12 errors, sections 7.1.1 and 7.2
PAPER_MS = {500: 100.0, 1000: 300.0, 1500: 1200.0}  # a step of optimisation, section 7
USED = {"with density": {"occlusion", "angular", "density", "variance"}}
USED["without density"] = USED["with density"] - {"density"}


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("paper", help="errors of parameters learned from fields, beside the paper's")
    parser.add_argument("--animals", type=int, nargs="+", default=list(PAPER_MS))
    parser.add_argument("--truths", nargs="+", default=["march", "swarm", "column"])
    parser.add_argument("--starts", type=int, default=2, help="of each kind")
    parser.add_argument("--near", type=float, default=0.12, help="largest error of a parameter at a near start")
    parser.add_argument("--steps", type=int, default=120, help="frames that a descent looks at")
    parser.set_defaults(run=run)


def run(options):
    """Run the study; print the table."""
    rows = [row for animals in options.animals for row in rows_of(animals, options)]
    print(f"{', '.join(options.truths)}; {options.starts} starts of each kind; {options.steps} steps")
    print(table(rows))
    return rows


def rows_of(animals, options):
    """Yield a row for each kind of start and each way of learning, means over truths and starts."""
    from benchmarks.learning_truth import film_of

    clips = {}
    for name in options.truths:
        brush, _, clip = film_of(name, animals)
        clips[name] = brush, dataclasses.replace(clip, sightings=None)
    for kind in ("random", "near"):
        for way, use in USED.items():
            found = [
                _learned(brush, clip, kind, seed, use, options)
                for brush, clip in clips.values()
                for seed in range(options.starts)
            ]
            mean = {key: float(np.mean([one[key] for one in found])) for key in found[0]}
            yield {"animals": animals, "starts": kind, "way": way} | mean


def _learned(brush, clip, kind, seed, use, options):
    from flockbrush.learning.rollout import LEAST, MOST, theta_of
    from flockbrush.learning.torch_descent import FollowedClip, descend

    rng, truth = np.random.default_rng([seed, 12]), theta_of(brush.params)
    near = np.clip(truth + rng.uniform(-options.near, options.near, 12), LEAST, MOST)
    start = near if kind == "near" else rng.uniform(0.0, 1.0, 12)
    begun = time.process_time()
    followed = FollowedClip(clip, use, speed=brush.speed, body=brush.body, vision=brush.vision, device="cpu")
    found = descend([followed], start, seed=seed, steps=options.steps)
    took = 1e3 * (time.process_time() - begun) / len(found.losses)
    error = np.abs(found.theta - truth)
    return {
        "before": float(np.abs(start - truth).sum()), "sum of 12": float(error.sum()),
        "obstacles": float(error[9:].sum()), "ms": took,
    }  # fmt: skip


def table(rows):
    """Return the results beside the paper's, as Markdown."""
    lines = [
        "| animals | starts | fields | sum of 12 before | after | obstacles | the paper | CPU ms a step | the paper |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = row["animals"], row["starts"], row["way"], *(f"{row[key]:.2f}" for key in NUMBERS), PAPER[row["way"]]
        cells = *cells, f"{row['ms']:.0f}", PAPER_MS.get(row["animals"], "-")
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    return "\n".join(lines)


NUMBERS = "before", "sum of 12", "obstacles"
