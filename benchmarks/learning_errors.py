"""How far the numbers of a learned brush are off, beside the errors that are reported.

    python benchmarks/learning.py errors [--herds 16] [--seed 0] [--quick] [--jobs N]

Herds of shipped brushes whose numbers were changed at random (by a factor of e to the .3 as a standard deviation) walk
on a plane for 10 s and are then tracked for 15 s, 10 positions a second with an error of .02 body lengths.  A brush of
the herd model is learned from each file of tracks.  Of each number that is reported as identifiable the true one is
known: how many errors off it is (z), weights at the default sensitivity, since only their product acts on a turn.
"""

from __future__ import annotations

import contextlib
import io
import math

import numpy as np

BRUSHES = "march", "swarm", "column", "stampede", "lanes", "sheep-narrow", "crowd", "mill-filled"
ANIMALS, BEFORE, SECONDS, FPS, NOISE, DENSITY = 40, 10.0, 15.0, 10.0, 0.02, 0.3
CHANGED, LEAST, MOST = 0.3, 0.05, 0.95  # of numbers between 0 and 1: standard deviation of the logarithm; bounds


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("errors", help="errors of learned numbers beside those reported")
    parser.add_argument("--herds", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="learn with --quick")
    parser.add_argument("--jobs", type=int, default=1)
    parser.set_defaults(run=run)


def herd(number, seed):
    """Return a known brush, and tracks (T, N, 2) BL of its animals."""
    from flockbrush.behaviours.brush import shipped
    from flockbrush.components import Position
    from flockbrush.levels.build import plane

    from flockbrush.learning.rollout import NAMES

    rng, brush = np.random.default_rng([seed, number, 71]), shipped().get(BRUSHES[number % len(BRUSHES)])
    values = {name: getattr(brush.params, name) for name in NAMES[:9]}
    values = {
        name: value if value in (0.0, 1.0) else float(np.clip(value * math.exp(CHANGED * rng.normal()), LEAST, MOST))
        for name, value in values.items()
    }
    brush = brush.with_parameters(**values, wander=0.3)
    simulation = plane(brush, ANIMALS, DENSITY, seed=seed + number)
    simulation.run(round(BEFORE / simulation.clock.dt))
    xy, step = [], 1.0 / FPS / simulation.clock.dt
    for k in range(round(SECONDS * FPS)):
        simulation.run(round((k + 1) * step) - round(k * step))
        xy.append(simulation.agents[Position.xyz][:, :2] / brush.body.length)
    simulation.close()
    return brush, np.array(xy) + NOISE * rng.normal(size=(len(xy), ANIMALS, 2))


def run(options):
    """Print a line for each number that is identifiable, and how the errors compare in all."""
    import flockbrush

    rows = []
    print("herd | number | true | learned | error | z")
    for number in range(options.herds):
        truth, xy = herd(number, options.seed)
        with contextlib.redirect_stderr(io.StringIO()):
            found = flockbrush.learn(
                xy, unit="bl", fps=FPS, model="herd", quick=options.quick, jobs=options.jobs, beside=False
            )
        for one in found.parameters:
            if not one.identifiable or not hasattr(truth.params, one.name):
                continue
            share, own = (
                brush.params.sensitivity / 10.0 if one.name.endswith("weight") else 1.0
                for brush in (found.brush, truth)
            )
            true, value, error = own * getattr(truth.params, one.name), share * one.value, share * one.error
            rows.append({"herd": number, "name": one.name, "true": true, "value": value, "error": error})
            z = (value - true) / error
            print(f"{number} {truth.name} | {one.name} | {true:.3f} | {value:.3f} | {error:.3f} | {z:+.1f}", flush=True)
    off = np.abs([(row["value"] - row["true"]) / row["error"] for row in rows])
    print(
        f"{len(off)} numbers; within 1 error {np.mean(off < 1):.0%} (68 %), within 2 {np.mean(off < 2):.0%} (95 %); "
        f"errors would have to be {np.quantile(off, 0.68):.2f} and {np.quantile(off, 0.95) / 2:.2f} times as large; "
        f"median absolute error {np.median([abs(row['value'] - row['true']) for row in rows]):.3f}"
    )
    return rows
