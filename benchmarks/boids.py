"""Benchmark boids: ticks compared with C++, and flocks that fly through fields of pillars.

    python benchmarks/boids.py speed [--quick]
    python benchmarks/boids.py pillars [--seeds 100] [--first 0] [--way point|direction] [--together]
    python benchmarks/boids.py plane [--animals 10000] [--taichi taichi_boids.py] [--python PYTHON] [--ceiling CPP]

``speed``: whole ticks of a level (all systems) with random flocks in a box with periodic sides, about 12 visible
neighbours each.  If there is a compiler, the C++ program ``boids_ceiling.cpp`` runs in alternation; it computes only
the flock, in float32.  On a shared machine read the CPU times (all threads, least of the ticks).

``pillars``: 60 starlings fly through 24 random pillars, a new field for every seed.  For each flock it prints the
least distance between a bird and an obstacle in any tick, the share of birds that got through, the smallest size of
its largest part, and when the flock was whole again: nine tenths of it in one part, with links of 4 m.  With
``--together`` the birds see, fly and keep together as those of the brush `starlings`.

``plane``: see `boids_plane`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from boids_plane import plane
from flockbrush.behaviours.drives import keep_group
from flockbrush.components import Heading, Position
from flockbrush.engine import parallel
from flockbrush.systems.commands import Migrate
from flockbrush.systems.measures import compute_largest_part, compute_polarization
from flockbrush.systems.senses import SightInSpace
from perception import machine
from small_herd import boids, box, brush, meadow, obstacle, put_aloft, room_in_the_air

HERE = Path(__file__).resolve().parent
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp", "-std=c++17")
OWN, REACH, SEPARATION = 0.2, 5.0, 3.0  # m; the first is a body length
LINK = 4.0  # m; birds nearer than this belong to one part
SOON = 30.0  # s
TOGETHER = keep_group.Params(distance=20.0, hurry=40.0)
FAR = 150.0  # body lengths that birds with this drive see
WHOLE = 0.9  # a flock whose largest part has a smaller share is split
IN_RANGE = 13.5  # others within range; 12 of them in the cone of 300 degrees


def start(n):
    """Return (side of the box, positions, velocities), m and m/s."""
    side = (n * 4 / 3 * np.pi * REACH**3 / IN_RANGE) ** (1 / 3)
    rng = np.random.default_rng(1)
    angle = rng.normal(0, 0.3, n)
    xyz = rng.uniform(0, side, (n, 3))
    return side, xyz, 9.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def flock_of(n):
    """Return a world of n starlings."""
    side, xyz, velocity = start(n)
    body = {"length": OWN, "radius": 0.04, "contact": "disc"}
    eyes = {"range": REACH / OWN, "field_of_view": 300.0, "occlusion": False}
    reach = {"separation": SEPARATION / OWN, "neighbour_range": REACH / OWN}
    asset = brush("boids", "boids", 45.0, body, eyes, speed={"deviation": 2.0}, **reach)
    simulation = meadow(asset, width=side, height=side, cell=side / 50, boundary="wrap")
    put_aloft(simulation, xyz + (0, 0, 50), velocity)
    return simulation


def ours(simulation, ticks):
    """Return (CPU ms, wall ms) of each tick."""
    times = []
    for _ in range(ticks):
        cpu, wall = time.process_time(), time.perf_counter()
        simulation.tick()
        times.append((1e3 * (time.process_time() - cpu), 1e3 * (time.perf_counter() - wall)))
    return times


def ceiling(program, n, threads, folder, ticks):
    """Return the output of the C++ program."""
    side, xyz, velocity = start(n)
    path = Path(folder) / f"start-{n}.bin"
    head = np.int64(n).tobytes() + np.array([side, REACH, SEPARATION]).tobytes()
    path.write_bytes(head + xyz.astype("f4").tobytes() + velocity.astype("f4").tobytes())
    env = os.environ | {"OMP_NUM_THREADS": str(threads), "GOMP_SPINCOUNT": "10000"}
    done = subprocess.run([str(program), str(path), str(ticks)], env=env, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def speed(quick):
    """Print the table of times."""
    sizes, rounds = ((1_000,), 1) if quick else ((1_000, 10_000, 100_000), 4)
    print(machine())
    print("           boids thr | CPU ms  wall ms  us/boid  seen | C++ CPU ms  wall ms  seen | ratio of CPU times")
    with tempfile.TemporaryDirectory() as folder:
        program = None
        if shutil.which("g++"):
            program = Path(folder) / "boids_ceiling"
            subprocess.run(["g++", *FLAGS, str(HERE / "boids_ceiling.cpp"), "-o", str(program)], check=True)
        for threads in (1, 2):
            for n in sizes:
                row(n, threads, rounds, program, folder)
    print(machine())


def row(n, threads, rounds, program, folder):
    """Print one line of the table; flock and C++ alternate, so that other load affects both."""
    parallel.set_threads(threads)
    ticks = max(3, min(30, 100_000 // n))
    simulation = flock_of(n)
    simulation.run(3)
    times, cpp = [], []
    for _ in range(rounds):
        if len(times) < 60:
            times += ours(simulation, ticks)
        if program:
            cpp.append(ceiling(program, n, threads, folder, ticks))
    cpu, wall = np.min(times, axis=0)
    seen = np.diff(simulation.world.resource(SightInSpace).lists.first).mean()
    line = f"{n:16}{threads:4} |{cpu:7.2f}{wall:9.2f}{1e3 * cpu / n:9.2f}{seen:6.1f}"
    if cpp:
        theirs = min(c["cpu_ms_min"] for c in cpp)
        line += f" |{theirs:11.2f}{min(c['ms_min'] for c in cpp):9.2f}{cpp[0]['neighbours']:6.1f} |{cpu / theirs:6.1f}"
    print(line, flush=True)
    simulation.close()


# a hundred flocks ----------------------------------------------------------------------------------


def field_of_pillars(seed, way, together=False, birds=60, pillars=24):
    """Return a flock sent through random round and square pillars, to a point beyond them or just east."""
    asset = boids(separation=5.0, min_speed=20.0) if together else boids(separation=5.0)
    if together:
        far = asset.vision.model_copy(update={"range": FAR})
        asset = asset.model_copy(update={"vision": far, "drives": {"keep_group": TOGETHER}})
    rng = np.random.default_rng(seed)
    things = []
    for k in range(pillars):
        x, y, r = 40 + 60 * rng.uniform(), 70 + 60 * rng.uniform(), rng.uniform(0.6, 2.2)
        thing = obstacle(box(x - r, y - r, x + r, y + r), f"pillar {k}")
        thing.shape, thing.z_max = str(rng.choice(["cylinder", "box"])), 100.0
        things.append(thing)
    simulation = meadow(asset, width=200, height=200, cell=2.0, obstacles=things, seed=seed)
    put_aloft(simulation, rng.uniform(0, 1, (birds, 3)) * (8, 16, 6) + (20, 92, 30))
    simulation.submit(Migrate(200.0, 100.0, 33.0) if way == "point" else Migrate(1.0, 0.0, 0.0, kind="direction"))
    return simulation


def pillars(seeds, first, way, together, ticks=1280):
    """Print a line for every flock, and a summary."""
    print(machine())
    flocks = []
    for seed in range(first, first + seeds):
        flocks.append(passage(seed, way, together, ticks))
        flock = flocks[-1]
        again = f"rejoined after {flock.joined - flock.torn:4.1f} s" if np.isfinite(flock.joined) else "not rejoined"
        print(
            f"seed {seed:4}: clearance {flock.room:9.6f} m, through {flock.through:.2f}, largest part {flock.part:.2f},"
            f" {again if flock.part < WHOLE else 'not split'}, at the end {flock.last:.2f},"
            f" polarization {flock.order:.2f}",
            flush=True,
        )
    room, touched, through, part, last, torn, joined, _ = np.array(flocks).T
    split = part < WHOLE
    again = split & np.isfinite(joined)
    print(f"{seeds} flocks: {(room < 0).sum()} with a bird inside an obstacle, least clearance {room.min():.7f} m;")
    print(f"  {touched.mean():.3f} of the birds touched one; {through.mean():.3f} got through;")
    print(f"  {split.sum()} were split, of these {again.sum()} were whole again at the end")
    soon = ~split | (joined - np.where(split, torn, 0.0) <= SOON)
    print(f"  {soon.sum()} of {seeds} stayed whole or were whole again within {SOON:g} s")
    if again.any():
        wait = joined[again] - torn[again]
        print(f"  (half of them within {np.median(wait):.1f} s, nine tenths within {np.quantile(wait, 0.9):.1f} s);")
    print(f"  at the end {last.mean():.3f} of the birds were in the largest part, {last.min():.2f} in the worst flock")


class Passage(NamedTuple):
    """The result of one flock that flies through the pillars."""

    room: float  # m, the least distance between a bird and an obstacle in any tick; negative: inside
    touched: float  # share of the birds that touched an obstacle
    through: float  # share of the birds that got past the field
    part: float  # share in the largest part, at worst
    last: float  # share in the largest part at the end
    torn: float  # s, when it was first split; inf: never
    joined: float  # s, since when it is whole again; inf: not at the end
    order: float  # polarization at the end


def passage(seed, way, together, ticks):
    """Return the `Passage` of a flock sent to a point beyond the field, or in a direction."""
    simulation = field_of_pillars(seed, way, together)
    room, parts = np.full(len(simulation.agents), np.inf), []
    for tick in range(ticks):
        simulation.tick()
        room = np.minimum(room, room_in_the_air(simulation, ground=False))
        if tick % 8 == 7:
            parts.append(compute_largest_part(simulation.agents[Position.xyz], LINK))
    apart = np.flatnonzero(np.array(parts) < WHOLE)
    torn, joined = (apart[0], apart[-1] + 1) if len(apart) else (np.inf, np.inf)
    if joined == len(parts):
        joined = np.inf
    through = (simulation.agents[Position.xyz][:, 0] > 100).mean()
    order = compute_polarization(simulation.agents[Heading.forward])
    simulation.close()
    return Passage(room.min(), (room < 1e-3).mean(), through, min(parts), parts[-1], torn / 4, joined / 4, order)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_subparsers(dest="what", required=True)
    what.add_parser("speed").add_argument("--quick", action="store_true", help="1,000 boids, one round")
    study = what.add_parser("pillars")
    study.add_argument("--seeds", type=int, default=100)
    study.add_argument("--first", type=int, default=0)
    study.add_argument("--way", choices=("point", "direction"), default="point", help="destination of the flock")
    study.add_argument("--together", action="store_true", help="birds see far and have the drive keep_group")
    flat = what.add_parser("plane")
    flat.add_argument("--animals", type=int, default=10_000)
    flat.add_argument("--taichi", type=Path, help="Taichi program of the same flock")
    flat.add_argument("--python", default=sys.executable, help="Python interpreter with Taichi")
    flat.add_argument("--ceiling", type=Path, help="C++ source of the same flock")
    flat.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    if options.what == "speed":
        speed(options.quick)
    elif options.what == "plane":
        plane(options.animals, options.taichi, options.python, options.ceiling, options.rounds)
    else:
        pillars(options.seeds, options.first, options.way, options.together)


if __name__ == "__main__":
    main()
