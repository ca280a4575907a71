"""Figures of line formations: how well shapes are known, how soon key shapes are solved, what flights keep to.

python benchmarks/formations.py
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from example_formations import movie, places
from flockbrush.behaviours.formation.extraction import extract_frame
from flockbrush.behaviours.formation.key_shapes import NoShape, solve_levenberg_marquardt
from flockbrush.behaviours.formation.steady_flight import SteadyFlight

KINDS = "V", "U", "J", "line"


def known(frames=24):
    """Extraction of frames with a tenth out of line."""
    print("extraction: 10 % outliers, deviation .15 wingspans\n")
    print("| shape | birds | frames | shape right | leader right | outliers found | false outliers a frame |")
    print("|---|---|---|---|---|---|---|")
    total = np.zeros(3, int)
    for kind in KINDS:
        for n in (9, 14, 16, 28, 41):
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
    """Extraction with birds that are none, anywhere in 24 by 22 wingspans, the heading given."""
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
    """Time of key shapes and what flights keep to."""
    print("key shapes and flights of 300 frames, 5 a second\n")
    print("| example | birds | key shape, ms | Levenberg-Marquardt, ms (solved) | outside ranges, % | by at most, % | "
          "fastest, b/s | leader in front, % |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|")
    for kind in KINDS:
        for have, want in ((9, 14), (16, 28), (41, 40), (41, 100)):
            flight = SteadyFlight(movie(kind, have, frames=12), want, seed=1)
            flight.key(1)
            began = time.perf_counter()
            flight.key(keys)
            each = (time.perf_counter() - began) / (keys - 1)
            lm, fine = _paper(flight, keys)
            said = flight.report(flight.frames(300, 5.0), 5.0)
            print(f"| {kind} of {have} | {want} | {1e3 * each:.1f} | {1e3 * lm:.1f} ({fine} of {keys}) | "
                  f"{100 * said['outside']:.2f} | {100 * said['beyond']:.1f} | {said['fastest']:.2f} | "
                  f"{100 * said['leader_in_front']:.0f} |")  # fmt: skip


def _paper(flight, keys):
    fine, began = 0, time.perf_counter()
    for k in range(1, keys + 1):
        wanted = flight._shares[k] * flight.total
        try:
            solve_levenberg_marquardt(flight.x, wanted, flight.key(k - 1))
            fine += 1
        except NoShape:
            pass
    return (time.perf_counter() - began) / keys, fine


if __name__ == "__main__":
    known()
    false_birds()
    solved()
