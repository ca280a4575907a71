"""Time visibility: sorting into cells and line of sight, in microseconds per animal.

    python benchmarks/perception.py [--quick] [--ceiling herd_ceiling.cpp]

The scenes are random discs of half a metre in a square with a view range of ten metres all round, and clumps of
touching animals.  With ``--ceiling`` a hand-written C++ kernel runs in alternation, so that other load affects both.
The kernel also adds up three forces over the visible animals.  It uses only float32, and an animal inside a body sees
nothing on the far side of it, so fewer animals are visible.  On a shared machine read the minimum.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from flockbrush.engine import parallel
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.visibility import visible_neighbours

DENSITIES = (0.05, 0.25, 1.0)  # discs per m^2
HERDS = (1_000, 10_000, 100_000)
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fno-finite-math-only", "-fopenmp", "-std=c++17")


class PerceptionCase(NamedTuple):
    """A herd to measure."""

    name: str
    xyz: np.ndarray  # (n, 3) m
    forward: np.ndarray  # (n, 3)
    length: float  # m
    radius: float  # m
    view_range: float  # m
    density: float | None  # per m^2; None where the C++ kernel cannot do the same


def scattered(n, density):
    """Return random discs."""
    rng = np.random.default_rng(1)
    xyz = np.c_[rng.uniform(0, (n / density) ** 0.5, (n, 2)), np.zeros(n)]
    return PerceptionCase(f"{density:g} per m2", xyz, _headings(rng.uniform(0, 2 * np.pi, n)), 1.0, 0.5, 10.0, density)


def clump(n, stray=False):
    """Return capsules of 1.0 x .4 m, side by side and nose to tail, 2 per m^2; a stray is kilometres away."""
    rng = np.random.default_rng(2)
    rows = int(np.ceil((n / 2.3) ** 0.5))
    place = np.stack(np.divmod(np.arange(n), rows), axis=-1)[:, ::-1] * (1.05, 0.46)
    xyz = np.c_[place + rng.normal(0, 0.02, (n, 2)), np.zeros(n)]
    if stray:
        xyz[-1] = 5000, 5000, 0
    name = "clump, stray" if stray else "clump"
    return PerceptionCase(name, xyz, _headings(rng.normal(0, 0.1, n)), 1.0, 0.2, 4.0, None)


def _headings(angle):
    return np.c_[np.cos(angle), np.sin(angle), 0 * angle]


def ours(scene, budget):
    """Return seconds of sorting, seconds of the whole, and the mean number of visible neighbours."""
    n = len(scene.xyz)
    length, radius, view_range = np.full(n, scene.length), np.full(n, scene.radius), np.full(n, scene.view_range)
    sort, total, end = [], [], time.perf_counter() + budget
    while len(total) < 3 or time.perf_counter() < end:
        begin = time.perf_counter()
        cells = sort_into_cells(scene.xyz, scene.forward, length, radius, scene.view_range)
        sorted_ = time.perf_counter()
        lists = visible_neighbours(cells, view_range, np.full(n, -1.0))
        total.append(time.perf_counter() - begin)
        sort.append(sorted_ - begin)
    return sort, total, len(lists.near) / n


def build_ceiling(source, folder):
    """Compile the C++ kernel and return its path."""
    program = Path(folder) / "herd_ceiling"
    subprocess.run(["g++", *FLAGS, str(source), "-o", str(program)], check=True)
    return program


def ceiling(program, scene, threads, budget):
    """Return minimum and median of the C++ kernel in us per animal, and its mean number of visible neighbours."""
    env = {**os.environ, "OMP_NUM_THREADS": str(threads), "GOMP_SPINCOUNT": "10000", "BUDGET": str(budget)}
    command = [str(program), str(len(scene.xyz)), str(scene.density), "simd"]
    line = json.loads(subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout)
    return line["us_per_agent_min"], line["us_per_agent"], line["visible_mean"]


def machine():
    """Return processor, cores and load as text."""
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        model = next(
            (line.split(":")[1].strip() for line in info.read_text().splitlines() if "model name" in line), model
        )
    load = f", load {os.getloadavg()[0]:.2f}" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores{load}; Python {platform.python_version()}"


def measure(scene, threads, program, rounds, budget):
    """Print one line of the table."""
    parallel.set_threads(threads)
    n = len(scene.xyz)
    sort, total, cpp = [], [], []
    for _ in range(rounds):
        more_sort, more_total, visible = ours(scene, budget)
        sort, total = sort + more_sort, total + more_total
        if program and scene.density:
            cpp.append(ceiling(program, scene, threads, budget))
    us = 1e6 / n
    line = f"{scene.name:14}{n:8}{threads:3}{min(total) * us:9.2f}{statistics.median(total) * us:8.2f}"
    line += f"{min(sort) * us:7.2f}{visible:7.1f}"
    if cpp:
        least = min(c[0] for c in cpp)
        line += (
            f" |{least:7.2f}{statistics.median(c[1] for c in cpp):8.2f}{cpp[0][2]:7.1f}{min(total) * us / least:7.1f}"
        )
    print(line, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ceiling", type=Path, metavar="CPP", help="source of the C++ kernel for comparison")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="1,000 animals, one round")
    options = parser.parse_args()
    herds, rounds, budget = (HERDS[:1], 1, 0.05) if options.quick else (HERDS, options.rounds, 0.3)
    print(machine())
    print("us per animal   animals thr     min  median   sort  seen |  C++ min  median  seen  ratio")
    with tempfile.TemporaryDirectory() as folder:
        program = build_ceiling(options.ceiling, folder) if options.ceiling else None
        for threads in (1, 2):
            for n in herds:
                for scene in (*(scattered(n, density) for density in DENSITIES), clump(n), clump(n, stray=True)):
                    measure(scene, threads, program, rounds, budget)
    print(machine())


if __name__ == "__main__":
    main()
