"""Benchmark line formations: recognition of shapes, time of key shapes, and limits kept by flights.

    python benchmarks/formations.py

With `--reach`, count how many scattered flocks form up if birds do not perceive others farther away than that:

    python benchmarks/formations.py --reach 50 25 12.5 --seeds 9001:9008

A flock passes if every bird keeps its place after at most 300 wingspans of flight (`WITHIN`).
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from example_formations import movie, places
from flockbrush.behaviours.formation.extraction import extract_frame
from flockbrush.behaviours.formation.formation_shapes import textbook
from flockbrush.behaviours.formation.hummel import total_power
from flockbrush.behaviours.formation.key_shapes import NoShape, solve_levenberg_marquardt
from flockbrush.behaviours.formation.reaching import FormingRules
from flockbrush.behaviours.formation.steady_flight import SteadyFlight
from flockbrush.systems.initiation import initiate, random_flock, target_of

KINDS = "V", "U", "J", "line"
SIZES = 9, 14, 16, 28, 41  # birds
WITHIN, HOLD = 300.0, 60  # wingspans of flight until all are in place; frames for which they must stay


def known(frames=24):
    """Print the extraction of frames with a tenth of the birds off the line."""
    print("extraction: 10 % outliers, deviation .15 wingspans\n")
    print("| shape | birds | frames | shape right | leader right | outliers found | false outliers per frame |")
    print("|---|---|---|---|---|---|---|")
    total = np.zeros(3, int)
    for kind in KINDS:
        for n in SIZES:
            right = leads = found = out = false = 0
            for frame in range(frames):
                x, y, leader, strays = places(kind, n, seed=7, frame=frame, outliers=round(n / 10))
                seen = extract_frame(x, y)
                right += seen.kind == kind
                leads += seen.leader == leader
                found += len(set(strays) & set(seen.outliers))
                out += len(strays)
                false += len(set(seen.outliers) - set(strays))
            total += right, leads, frames
            print(f"| {kind} | {n} | {frames} | {right} | {leads} | {found} of {out} | {false / frames:.2f} |")
    print(f"\nall: shape right in {total[0]} of {total[2]}, leader in {total[1]} of {total[2]}\n")


def false_birds(frames=20):
    """Print the extraction with false birds in 24 by 22 wingspans and a given heading."""
    print("extraction with false birds: deviation .1 wingspans\n")
    print("| shape | birds | false | frames | shape right | leader right |")
    print("|---|---|---|---|---|---|")
    total = np.zeros(3, int)
    for kind in KINDS:
        for n in (8, 12):
            for false in (1, 2):
                right = leads = 0
                for frame in range(frames):
                    x, y, leader, _ = places(kind, n, seed=frame, deviation=0.1)
                    drawn = np.random.default_rng(frame)
                    more = drawn.uniform(-12, 12, false), drawn.uniform(-14, 8, false)
                    names = [*map(str, range(n)), *("f" + str(k) for k in range(false))]
                    seen = extract_frame(np.r_[x, more[0]], np.r_[y, more[1]], birds=names)
                    right += seen.kind == kind
                    leads += seen.birds[seen.leader] == str(leader)
                total += right, leads, frames
                print(f"| {kind} | {n} | {false} | {frames} | {right} | {leads} |")
    print(f"\nall: shape right in {total[0]} of {total[2]}, leader in {total[1]} of {total[2]}\n")


def solved(keys=20):
    """Print the time of key shapes and the limits kept by flights."""
    print("key shapes, and flights of 300 frames at 5 frames per second\n")
    print("| example | birds | key shape, ms | Levenberg-Marquardt, ms (solved) | outside ranges, % | by at most, % | "
          "fastest, b/s | leader in front, % |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    for kind in KINDS:
        for have, want in ((9, 14), (16, 28), (41, 40), (41, 100)):
            flight = SteadyFlight(movie(kind, have, frames=12), want, seed=1)
            each, lm, fine = _both_solvers(flight, keys)
            said = flight.report(flight.frames(300, 5.0), 5.0)
            print(f"| {kind} of {have} | {want} | {1e3 * each:.1f} | {1e3 * lm:.1f} ({fine} of {keys}) | "
                  f"{100 * said['outside']:.2f} | {100 * said['beyond']:.1f} | {said['fastest']:.2f} | "
                  f"{100 * said['leader_in_front']:.0f} |")  # fmt: skip


def _both_solvers(flight, keys):
    """Return seconds per key shape, the same for the paper's solver, and how many shapes the latter solved."""
    ours = paper = fine = 0
    last, share, arrangement = flight.initial[0], flight.shares[0], flight.arrangements[0]
    flight.drawn(0, last, share, arrangement)  # compiled
    for k in range(1, keys + 1):
        began = time.perf_counter()
        shape, share = flight.drawn(k, last, share, arrangement)
        ours, began = ours + time.perf_counter() - began, time.perf_counter()
        try:
            solve_levenberg_marquardt(shape[:, 0], share * total_power(shape[:, 0]), last[:, 1])
            fine += 1
        except NoShape:
            pass
        paper, last = paper + time.perf_counter() - began, shape
    return ours / keys, paper / keys, fine


def formed_up(kind: str, birds: int, seeds: range, reach: float, within: float = WITHIN) -> int:
    """Return how many flocks are in place after ``within`` wingspans of flight; ``reach`` limits perception."""
    last = round(within / FormingRules().cruise)  # frame
    goal = target_of(*textbook(kind, birds))
    flown = [initiate(*random_flock(birds, seed), goal, most=last + HOLD + 1, hold=HOLD, reach=reach) for seed in seeds]
    return sum(0 <= one.frames <= last for one in flown)


def initiation(reaches: list[float], seeds: range) -> None:
    """Print the number of flocks in place within `WITHIN`, by reach and size, over the four shapes."""
    of = len(KINDS) * len(seeds)
    print(f"in place within {WITHIN:.0f} wingspans, of {of} flocks in each cell (V, U, J, line)\n")
    print("| reach, wingspans | " + " | ".join(f"{n} birds" for n in SIZES) + " | all |")
    print("|---" * (len(SIZES) + 2) + "|")
    for reach in reaches:
        cells = [sum(formed_up(kind, n, seeds, reach) for kind in KINDS) for n in SIZES]
        share = sum(cells) / (of * len(SIZES))
        print(f"| {reach:g} | " + " | ".join(map(str, cells)) + f" | {sum(cells)} of {of * len(SIZES)}, {share:.1%} |",
              flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reach", type=float, nargs="+", help="perception range, wingspans; inf: unlimited")
    parser.add_argument("--seeds", default="9001:9008", help="first:last")
    options = parser.parse_args()
    if options.reach:
        first, last = (int(seed) for seed in (options.seeds.split(":") * 2)[:2])  # a single seed is a range of one
        initiation(options.reach, range(first, last + 1))
        return
    known()
    false_birds()
    solved()


if __name__ == "__main__":
    main()
