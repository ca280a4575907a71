"""Time a behaviour program: 10,000 animals with six states and ten triggers, and the same herd without a program.

    python benchmarks/programs.py [--animals N] [--pairs K]

Prints the CPU time of a tick (all threads), the median of alternating pairs of half a second each.  The states set no
brush, so both herds move by the same one.
"""

import argparse
import math
import time

import numpy as np
from flockbrush.behaviours.program import load_program
from flockbrush.levels.build import build
from flockbrush.levels.schema import Area, Level, Spawn

PROGRAM = b"""schema = "flockbrush.program/1"
[state.graze]
[state.walk]
[state.drink]
for = "5..10 s"
then = "graze"
[state.watch]
[state.bolt]
for = "2..4 s"
then = "calm"
[state.calm]
for = "3..6 s"
then = { graze = 2, walk = 1 }
[[trigger]]
to = "bolt"
when = { any = [{ sees = "wolf", within = "15 m" }, { event = "alarm" }] }
delay = "0..0.6 s"
[[trigger]]
from = ["graze", "walk"]
to = "bolt"
when = { share_of_seen_in = "bolt", at_least = 0.4 }
delay = "0..0.6 s"
[[trigger]]
from = "graze"
to = "watch"
when = { sees_fewer_than = 3, within = "3 m" }
[[trigger]]
from = "watch"
to = "graze"
when = { sees_more_than = 4 }
[[trigger]]
from = ["graze", "walk"]
to = "drink"
when = { all = [{ inside = "pond" }, { since_state = "drink", at_least = "20..40 s" }] }
[[trigger]]
from = "graze"
to = "walk"
when = { since_in = "pond", at_least = "60..120 s" }
[[trigger]]
from = ["graze", "watch"]
to = "walk"
when = { alone_for = "5..8 s" }
[[trigger]]
from = "graze"
to = "walk"
when = { rate = "0.03 /s", imitating = "walk", gain = 2 }
[[trigger]]
from = "walk"
to = "graze"
when = { time_in_state = "6..12 s" }
[[trigger]]
from = "drink"
to = "watch"
when = { acceleration_above = "20 m/s^2" }
"""


def herd(animals, program):
    """Return a herd of grazing sheep, three wolves, and a pond."""
    side = math.sqrt(animals / 0.4) * 1.2
    size = side + 80.0
    square = np.array([(40, 40), (40 + side, 40), (40 + side, 40 + side), (40, 40 + side)])
    den = np.array([(5, 5), (30, 5), (30, 30), (5, 30)], float)
    spawns = [
        Spawn(1, "", square, "sheep", "graze", animals, program=program and program.name),
        Spawn(2, "", den, "wolf", "wolf-hunt", 3),
    ]
    pond = Area(1, "pond", square * 0.2 + 0.4 * size)
    level = Level("bench", None, size, size, 4.0, "open", 1, spawns=spawns, areas=[pond])
    level.programs = {program.name: program} if program else {}
    return build(level)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--animals", type=int, default=10_000)
    parser.add_argument("--pairs", type=int, default=20)
    options = parser.parse_args()
    scenes = [herd(options.animals, ""), herd(options.animals, load_program(PROGRAM, "bench.program.toml"))]
    for scene in scenes:
        scene.run(96)
    spent = np.empty((options.pairs, 2))
    for pair in range(options.pairs):
        for k in (0, 1) if pair % 2 else (1, 0):
            begin = time.process_time()
            scenes[k].run(16)
            spent[pair, k] = (time.process_time() - begin) / 16
    ratio = np.median(spent[:, 1] / spent[:, 0])
    low, high = np.percentile(spent[:, 1] / spent[:, 0], (10, 90))
    without, within = 1e3 * np.median(spent, axis=0)
    print(f"{options.animals:,} animals: {without:.2f} ms per tick without a program, {within:.2f} ms with one")
    print(f"{ratio:.3f} times (10 to 90 % of {options.pairs} pairs: {low:.3f} to {high:.3f})")
    nanoseconds = scenes[1].schedule.nanoseconds
    print(f"RunPrograms: {100 * nanoseconds['RunPrograms'] / sum(nanoseconds.values()):.1f} % of the wall time")
    print(scenes[1].states()["bench"])


if __name__ == "__main__":
    main()
