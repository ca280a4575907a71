"""Boids: how long a tick takes beside hand-written C++, and a hundred flocks through fields of pillars.

    python benchmarks/boids.py speed [--quick]
    python benchmarks/boids.py pillars [--seeds 100] [--first 0]

``speed``: flocks at random in a box, wrapped to the sides, with about 12 visible neighbours each; whole ticks of a
level (all systems) and, round by round, the C++ program ``boids_ceiling.cpp`` when there is a compiler, which does the
work of the flock alone, in float32.  On a shared machine read the CPU times: of all threads, least of the ticks.

``pillars``: 60 starlings fly through 24 pillars at random, a new field for every seed.  For each flock: the least room
between a bird and an obstacle in any tick, how many birds got through, into how many parts it was torn and whether it
is one again at the end.
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

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from perception import machine
from small_herd import boids, box, brush, meadow, obstacle, put_aloft

from components import Body, Heading, Position
from engine import parallel
from engine.solids import surface_
from systems.commands import Migrate
from systems.landscape import Landscape
from systems.measures import compute_largest_part, compute_polarization
from systems.senses import SightInSpace

HERE = Path(__file__).resolve().parent
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp", "-std=c++17")
OWN, REACH, SEPARATION = 0.2, 5.0, 3.0  # m; the first is a body length
IN_RANGE = 13.5  # others in the ball: 12 of them in the cone of 300 degrees


def start(n):
    """(side of the box, positions, velocities), m and m/s."""
    side = (n * 4 / 3 * np.pi * REACH**3 / IN_RANGE) ** (1 / 3)
    rng = np.random.default_rng(1)
    angle = rng.normal(0, 0.3, n)
    xyz = rng.uniform(0, side, (n, 3))
    return side, xyz, 9.0 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def flock_of(n):
    """A world of n starlings."""
    side, xyz, velocity = start(n)
    body = {"length": OWN, "radius": 0.04, "contact": "disc"}
    eyes = {"range": REACH / OWN, "field_of_view": 300.0, "occlusion": False}
    reach = {"separation": SEPARATION / OWN, "neighbour_range": REACH / OWN}
    asset = brush("boids", "boids", 45.0, body, eyes, speed={"deviation": 2.0}, **reach)
    simulation = meadow(asset, width=side, height=side, cell=side / 50, boundary="wrap")
    put_aloft(simulation, xyz + (0, 0, 50), velocity)
    return simulation


def ours(simulation, ticks):
    """(CPU ms, wall ms) of each tick."""
    times = []
    for _ in range(ticks):
        cpu, wall = time.process_time(), time.perf_counter()
        simulation.tick()
        times.append((1e3 * (time.process_time() - cpu), 1e3 * (time.perf_counter() - wall)))
    return times


def ceiling(program, n, threads, folder, ticks):
    """What the C++ program prints."""
    side, xyz, velocity = start(n)
    path = Path(folder) / f"start-{n}.bin"
    head = np.int64(n).tobytes() + np.array([side, REACH, SEPARATION]).tobytes()
    path.write_bytes(head + xyz.astype("f4").tobytes() + velocity.astype("f4").tobytes())
    env = os.environ | {"OMP_NUM_THREADS": str(threads), "GOMP_SPINCOUNT": "10000"}
    done = subprocess.run([str(program), str(path), str(ticks)], env=env, check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def speed(quick):
    """The table of times."""
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
    """One line of the table; flock and C++ in turn, so that other load falls on both."""
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


def field_of_pillars(seed, birds=60, pillars=24):
    """A flock before a field of pillars at random, round and square, and sent beyond it."""
    rng = np.random.default_rng(seed)
    things = []
    for k in range(pillars):
        x, y, r = 40 + 60 * rng.uniform(), 70 + 60 * rng.uniform(), rng.uniform(0.6, 2.2)
        thing = obstacle(box(x - r, y - r, x + r, y + r), f"pillar {k}")
        thing.shape, thing.z_max = str(rng.choice(["cylinder", "box"])), 100.0
        things.append(thing)
    simulation = meadow(boids(separation=5.0), width=200, height=200, cell=2.0, obstacles=things, seed=seed)
    put_aloft(simulation, rng.uniform(0, 1, (birds, 3)) * (8, 16, 6) + (20, 92, 30))
    simulation.submit(Migrate(200.0, 100.0, 33.0))
    return simulation


def least_room(simulation):
    """Metres between the bird and the solid that are nearest to one another; less than 0: inside."""
    sky, agents = simulation.world.resource(Landscape).sky, simulation.agents
    room = np.inf
    for (x, y, z), radius in zip(agents[Position.xyz], agents[Body.radius], strict=True):
        near = np.flatnonzero(np.hypot(sky.centre[:, 0] - x, sky.centre[:, 1] - y) < 4.0)
        room = min([room, *(surface_(sky, k, x, y, z)[0] - radius for k in near)])
    return room


def pillars(seeds, first, ticks=560):
    """A line for every flock, and what they have in common."""
    print(machine())
    rooms, through, parts, again, touched = [], [], [], [], 0
    for seed in range(first, first + seeds):
        simulation = field_of_pillars(seed)
        room, part = np.inf, 1.0
        for tick in range(ticks):
            simulation.tick()
            room = min(room, least_room(simulation))
            if tick % 8 == 0:
                part = min(part, compute_largest_part(simulation.agents[Position.xyz], 4.0))
        xyz = simulation.agents[Position.xyz]
        rooms.append(room)
        through.append((xyz[:, 0] > 100).mean())
        parts.append(part)
        again.append(compute_largest_part(xyz, 8.0))
        touched += room < 1e-3
        order = compute_polarization(simulation.agents[Heading.forward])
        print(
            f"seed {seed:4}: least room {room:9.6f} m, through {through[-1]:.2f}, largest part {part:.2f} in between"
            f" and {again[-1]:.2f} at the end, polarization {order:.2f}",
            flush=True,
        )
        simulation.close()
    print(f"{seeds} flocks: {sum(r < 0 for r in rooms)} with a bird inside an obstacle, least room {min(rooms):.7f} m;")
    print(f"  in {touched} a bird came to touch one; {np.mean(through):.3f} of the birds got through;")
    print(f"  {np.sum(np.array(parts) < 0.9)} were torn, of these {_joined(parts, again)} were one again at the end")


def _joined(parts, again):
    torn = np.array(parts) < 0.9
    return int((torn & (np.array(again) >= 0.9)).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_subparsers(dest="what", required=True)
    what.add_parser("speed").add_argument("--quick", action="store_true", help="1,000 boids, one round")
    study = what.add_parser("pillars")
    study.add_argument("--seeds", type=int, default=100)
    study.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    if options.what == "speed":
        speed(options.quick)
    else:
        pillars(options.seeds, options.first)


if __name__ == "__main__":
    main()
