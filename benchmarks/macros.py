"""What the slider "order" does to a herd: ``python benchmarks/macros.py [BRUSH ...] [--slider order] [--seeds 4]``.

Fresh herds on an endless plane, headings at random, with the slider at 0, 1/4, 1/2, 3/4 and 1; a run's value is the
mean over its last part.  A measure moves by its largest mean less its smallest, in standard deviations between seeds
(pooled over the five places, and at least `LEAST` of the measure).  The goal is that polarization moves three times
as far as any other measure.
"""

from __future__ import annotations

import argparse

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.levels.build import plane

from flockbrush.studio.panels.macros import MACROS, macros_of

PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
MEASURES = ("polarization", "milling", "nnd", "group_spread", "largest_part", "speed_mean")
FIRST, DENSITY, RATE = 9001, 0.6, 32
SECONDS, SETTLED = 20, 12  # s of a run, and of those that are not measured
LEAST = 0.005  # of the largest value
GOAL = 3.0


def with_slider(name):
    """Names of the shipped brushes whose model has this slider."""
    library = shipped()
    return [one for one in library.names() if name in MACROS.get(library.get(one).model, {}) or name in MACROS[""]]


def run_of(brush, animals, seed):
    """(measures,) means over the last part of one run."""
    simulation, seen = plane(brush, animals, DENSITY, "scatter", seed), []
    simulation.run(SETTLED * RATE)
    for _ in range(SECONDS - SETTLED):
        simulation.run(RATE)
        told = simulation.measures()
        seen.append([told[name] for name in MEASURES])
    simulation.close()
    return np.mean(seen, axis=0)


def moved(values):
    """(measures,) how far each moves, in deviations, from (places, seeds, measures)."""
    means = values.mean(axis=1)
    deviation = np.sqrt(values.var(axis=1, ddof=1).mean(axis=0))
    return np.ptp(means, axis=0) / np.maximum(deviation, LEAST * np.abs(values).max(axis=(0, 1)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("brushes", nargs="*", metavar="BRUSH", help="all that have the slider unless told")
    parser.add_argument("--slider", default="order")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--animals", type=int, default=50)
    told = parser.parse_args()
    known = with_slider(told.slider)
    if wrong := [name for name in told.brushes if name not in known]:
        parser.error(f"no slider {told.slider!r} has {', '.join(wrong)}; {', '.join(known) or 'no brush'} has it")
    print(f"| brush | stands at | polarization at {', '.join(f'{place:g}' for place in PLACES)} | "
          f"{' | '.join(MEASURES)} | polarization over the next |")  # fmt: skip
    print("|---" * (len(MEASURES) + 4) + "|")
    for name in told.brushes or known:
        brush = shipped().get(name)
        slider = next(one for one in macros_of(brush) if one.name == told.slider)
        values = np.array([
            [run_of(slider.turned(brush, place), told.animals, FIRST + seed) for seed in range(told.seeds)]
            for place in PLACES
        ])  # fmt: skip
        far = moved(values)
        course = ", ".join(f"{value:.2f}" for value in values[:, :, 0].mean(axis=1))
        ratio = far[0] / far[1:].max()
        print(f"| {name} | {slider.value(brush):.2f} | {course} | {' | '.join(f'{one:.1f}' for one in far)} | "
              f"{ratio:.1f}{'' if ratio >= GOAL else ', below the goal'} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
