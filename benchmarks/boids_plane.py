"""Compare boids in a periodic plane, 12 neighbours within 1 m, with Taichi and C++ in float32 on one thread.

    python benchmarks/boids.py plane [--animals 10000] [--taichi taichi_boids.py] [--python PYTHON] [--ceiling CPP]

A Flockbrush tick finds the neighbours within 1 m, steers by the model `boids` and takes a step, in float64.  Alignment
(mean velocity of the neighbours) and cohesion (their mean offset) are the same as in the other programs and are first
compared with brute force.  Separation differs: the model uses the inverse square, zero at .5 m; the others use the
inverse distance, cut at .5 m.

``--taichi`` and ``--ceiling`` name programs that print a line of JSON with ``min_user_cpu_per_tick``; ``--python`` is
an interpreter with Taichi.  All programs run in alternation.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from flockbrush.behaviours.behaviour import Air, FlockBySlot, Scene
from flockbrush.behaviours.models import boids
from flockbrush.engine import parallel
from flockbrush.engine.scratch import Scratch
from flockbrush.systems.space import EyesInSpace, birds_of, sort_in_space, visible_in_space
from numba import njit
from perception import machine
from scipy.spatial import cKDTree

REACH, DT, SLOWEST, FASTEST = 1.0, 1 / 60, 0.5, 1.5  # m, s, m/s
OWN = 0.1  # m, a body length
PROCESSOR = os.environ.get("NUMBA_CPU_NAME", "native")  # C++ is compiled for the same processor as numba's code
FLAGS = ("-O3", f"-march={PROCESSOR}", "-ffast-math", "-fopenmp", "-std=c++17")
MOST = 1000.0  # body lengths/s²: large enough that no urge is ever cut


def start(n, seed=12345):
    """Return (side, positions, velocities) of the common start, m and m/s."""
    rng = np.random.default_rng(seed)
    side = ((n - 1) * np.pi * REACH**2 / 12) ** 0.5
    place = (rng.random((n, 2)) * side).astype("f4")
    place[place >= np.float32(side)] = 0
    angle = rng.random(n) * 2 * np.pi
    return side, place, np.stack([np.cos(angle), np.sin(angle)], 1).astype("f4")


class Flock:
    """Positions and velocities in float64, and the model's input."""

    def __init__(self, n, separation=0.1):
        self.side, place, velocity = start(n)
        self.xyz, self.velocity = np.zeros((n, 3)), np.zeros((n, 3))
        self.xyz[:, :2], self.velocity[:, :2] = place, velocity
        self.forward, self.rows, self.scratch = self.velocity.copy(), np.arange(n, dtype=np.int32), Scratch()
        ones, nothing, far = np.ones(n), np.zeros((n, 3)), np.full(n, np.inf)
        self.eyes = EyesInSpace(np.full(n, REACH), -ones, np.ones(n, np.uint8), np.zeros(n))
        self.air = Air(
            None, None, None, np.tile([0.0, 0, 1], (n, 1)), far, self.forward, far, nothing, far,
            np.zeros(n, np.uint8), nothing, np.zeros(n + 1, np.int64), nothing[:0],
        )  # fmt: skip
        self.scene = Scene(*[None] * 22)._replace(dt=DT, length=OWN * ones, species=np.zeros(n, np.int64))
        self.params = boids.Params(
            exponent=0.0, forward_weight=0.0, neighbour_range=REACH / OWN, separation=0.5 / OWN, matching_time=1.0,
            centring_strength=REACH / OWN / MOST, matching_strength=1.0, separation_strength=separation,
            height_strength=0.0, clearance=0.0, max_speed=FASTEST / OWN, max_acceleration=MOST / (FASTEST / OWN),
        )  # fmt: skip

    def acceleration(self):
        """Return the rows (n,) in cell order and their accelerations (n, 3), m/s²."""
        space = sort_in_space(self.xyz, self.forward, self.rows, REACH, (self.side, self.side))
        found = visible_in_space(space, self.eyes, scratch=self.scratch)
        bird = birds_of(found.cells, self.velocity, self.scene.species)
        flock = FlockBySlot(found.cells.slot, found.begin, found.count, found.seen, bird)
        scene = self.scene._replace(velocity=self.velocity, forward=self.forward, air=self.air._replace(by_slot=flock))
        rows = found.cells.order
        return rows, boids.steer(scene, rows, self.params).acceleration

    def tick(self):
        """Simulate one tick."""
        _move(self.xyz, self.velocity, self.forward, *self.acceleration(), self.side)


@njit(error_model="numpy")
def _move(xyz, velocity, forward, rows, acceleration, side):
    for at in range(len(rows)):
        i = rows[at]
        u, v = velocity[i, 0] + DT * acceleration[at, 0], velocity[i, 1] + DT * acceleration[at, 1]
        speed = np.sqrt(u * u + v * v)
        forward[i, 0], forward[i, 1] = u / speed, v / speed
        goes = min(max(speed, SLOWEST), FASTEST)
        for k in range(2):
            velocity[i, k] = goes * forward[i, k]
            place = xyz[i, k] + DT * velocity[i, k]
            xyz[i, k] = place + side if place < 0.0 else place - side if place >= side else place


def worst_difference(n):
    """Return the largest difference of alignment and cohesion from brute force, m/s²."""
    flock = Flock(n, separation=0.0)
    place, velocity, wrong = flock.xyz[:, :2], flock.velocity[:, :2], 0.0
    near = cKDTree(place, boxsize=flock.side).query_ball_point(place, REACH)
    for i, found in zip(*flock.acceleration(), strict=True):
        others = np.array([j for j in near[i] if j != i], int)
        if len(others):
            offset = (place[others] - place[i] + flock.side / 2) % flock.side - flock.side / 2
            wanted = offset.mean(0) + velocity[others].mean(0) - velocity[i]
            wrong = max(wrong, np.abs(found[:2] - wanted).max())
    return wrong


def plane(n, taichi, python, ceiling, rounds):
    """Print the times of all programs, measured in alternation."""
    parallel.set_threads(1)
    print(machine())
    print(f"alignment and cohesion differ from brute force by at most {worst_difference(n):.1e} m/s²")
    flock, least = Flock(n), {}
    for _ in range(10):
        flock.tick()
    with tempfile.TemporaryDirectory() as folder:
        peers = _peers(n, taichi, python, ceiling, Path(folder))
        for _ in range(rounds):
            for _ in range(60):
                before = time.process_time()
                flock.tick()
                least["Flockbrush"] = min(least.get("Flockbrush", np.inf), time.process_time() - before)
            for name, command in peers.items():
                least[name] = min(least.get(name, np.inf), _peer(command))
    for name, seconds in least.items():
        ratio = least["Flockbrush"] / seconds
        print(f"{name:10}{1e3 * seconds:8.2f} ms CPU per tick; Flockbrush takes {ratio:.2f} times as long")
    print(machine())


def _peers(n, taichi, python, ceiling, folder):
    """Return {name: command} of the available programs."""
    peers = {}
    if ceiling:
        side, place, velocity = start(n)
        given, program = folder / "start.bin", folder / "ceiling"
        given.write_bytes(np.int64(n).tobytes() + np.float64(side).tobytes() + place.tobytes() + velocity.tobytes())
        subprocess.run(["g++", *FLAGS, str(ceiling), "-o", str(program)], check=True)
        peers["C++"] = [str(program), str(given)]
    if taichi and subprocess.run([python, "-c", "import taichi"], capture_output=True).returncode == 0:
        peers["Taichi"] = [python, str(taichi), str(n)]
    else:
        print("Taichi is not compared: give its program with --taichi and a Python that has it with --python")
    return peers


def _peer(command):
    """Return the least CPU seconds of a tick."""
    env = os.environ | {"THREADS": "1", "OMP_NUM_THREADS": "1", "TICKS": "30", "BLOCKS": "5", "BUDGET": "4"}
    out = subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout
    return json.loads(out.splitlines()[-1])["min_user_cpu_per_tick"]
