"""Benchmark whole ticks: compared with C++, with a million animals, by density and strays, and against other commits.

    python benchmarks/ticks.py ticks [--sizes 1000 10000 100000] [--ceiling herd_ceiling.cpp]
    python benchmarks/ticks.py million [--animals 1000000]
    python benchmarks/ticks.py shape
    python benchmarks/ticks.py against DIR [--level crowded] [--pairs 20] [--ticks 16]

``ticks``: all systems of a level in the scene of ``flockbrush bench`` (0.25 animals/m², 10 m view range, exact
occlusion), alternating with a C++ kernel (visibility and three forces; float32; AVX2, or the source given by
``--ceiling``).  ``million``: spawning, ticks and memory of a herd.  ``shape``: ratio of the cost of perception at 1
per m² to .25 per m², and with to without a stray kilometres away.  ``against``: ratio of the CPU time of a level's
ticks to that in another checkout (``git worktree add DIR COMMIT``), median over alternating pairs.

On shared machines read the CPU times of all threads, the least of all rounds, and their ratio.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from flockbrush.engine import parallel
from flockbrush.engine.parallel import set_threads
from perception import build_ceiling, clump, machine, ours, scattered

from flockbrush.cli.bench import WARM_UP, scene
from flockbrush.runs.run import peak_memory

HERE = Path(__file__).resolve().parent
GOALS = {1_000: 1.2, 10_000: 9.0, 100_000: 95.0}  # ms per tick on two threads
DENSITY = 0.25


def tick_times(simulation, budget):
    """Return (CPU s, wall s) of ticks during `budget` seconds."""
    times, end = [], time.perf_counter() + budget
    while len(times) < 3 or time.perf_counter() < end:
        cpu, wall = time.process_time(), time.perf_counter()
        simulation.tick()
        times.append((time.process_time() - cpu, time.perf_counter() - wall))
    return times


def ceiling(program, animals, threads, budget):
    """Return the output of the C++ program."""
    env = {**os.environ, "OMP_NUM_THREADS": str(threads), "GOMP_SPINCOUNT": "10000", "BUDGET": str(budget)}
    command = [str(program), str(animals), str(DENSITY)]
    return json.loads(subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout)


def ticks(sizes, source, rounds, budget):
    """Print a row for each size and number of threads."""
    print(machine())
    print(" animals thr | ms/tick   least  median    goal | CPU us/animal | C++ us/animal  wall | ratio CPU  wall")
    with tempfile.TemporaryDirectory() as folder:
        program = build_ceiling(source, folder)
        for animals in sizes:
            for threads in (1, 2):
                set_threads(threads)
                simulation = scene(animals)
                simulation.run(WARM_UP)
                times, theirs = [], []
                for _ in range(rounds):
                    times += tick_times(simulation, budget)
                    theirs.append(ceiling(program, animals, threads, budget))
                simulation.close()
                print(_row(animals, threads, times, theirs), flush=True)
    print(machine())


def _row(animals, threads, times, theirs):
    cpu, wall = (min(t[k] for t in times) for k in range(2))
    median = statistics.median(t[1] for t in times)
    their_wall = min(t["us_per_agent_min"] for t in theirs)
    their_cpu = min(t.get("us_cpu_per_agent_min", t.get("us_user_cpu_per_agent")) for t in theirs)
    us, goal = 1e6 / animals, GOALS.get(animals)
    goal = f"{goal:8.1f}" if goal and threads == 2 else " " * 8
    line = f"{animals:8}{threads:4} |{1e3 * wall:16.2f}{1e3 * median:8.2f}{goal} |{cpu * us:14.2f} |{their_cpu:14.2f}"
    return line + f"{their_wall:6.2f} |{cpu * us / their_cpu:10.1f}{wall * us / their_wall:6.1f}"


def million(animals):
    """Print the cost of spawning, ticks and memory."""
    begin = time.perf_counter()
    simulation = scene(animals)
    spawned = time.perf_counter() - begin
    simulation.run(2)
    times = [tick for _ in range(2) for tick in tick_times(simulation, 0)]
    cpu, wall = (min(t[k] for t in times) for k in range(2))
    print(machine())
    print(
        f"{animals} animals, {parallel.threads()} threads: spawned in {spawned:.1f} s; a tick takes {wall:.2f} s"
        f" ({cpu:.2f} s CPU) at least; peak memory {peak_memory():.0f} MiB"
    )


def shape(rounds, budget):
    """Print the cost of perception at two densities, and with and without a stray, measured in alternation."""
    print(machine())
    print(" animals | us/animal .25 per m2  1 per m2  ratio | clump  with a stray  ratio   (CPU, one thread, least)")
    set_threads(1)
    for animals in (1_000, 10_000, 100_000):
        scenes = scattered(animals, 0.25), scattered(animals, 1.0), clump(animals), clump(animals, stray=True)
        least = [float("inf")] * len(scenes)
        for _ in range(rounds):
            for k, one in enumerate(scenes):
                least[k] = min(least[k], _cpu_of(one, budget))
        thin, dense, close, strayed = (1e6 * t / animals for t in least)
        line = f"{animals:8} |{thin:21.2f}{dense:10.2f}{dense / thin:7.2f}"
        print(f"{line} |{close:6.2f}{strayed:14.2f}{strayed / close:7.2f}", flush=True)


def _cpu_of(one, budget):
    """Return the CPU seconds of one visibility computation."""
    before, (_, times, _) = time.process_time(), ours(one, budget)
    return (time.process_time() - before) / len(times)


TICKING = """
import importlib, sys, time
simulation = importlib.import_module(sys.argv[1]).start(sys.argv[2])
for line in sys.stdin:
    before = time.process_time()
    simulation.run(int(line))
    print(time.process_time() - before, flush=True)
"""  # the same for every checkout


def as_installed(tree, folder):
    """Link a checkout's packages in the installed layout; return the import folder and the module with `start`."""
    setuptools = tomllib.loads((tree / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    if "package-dir" not in setuptools:  # before the packages were inside flockbrush
        return tree, "flockbrush.run"
    package = folder / "flockbrush"
    package.mkdir(parents=True)
    for one in (tree / "flockbrush").iterdir():
        (package / one.name).symlink_to(one)
    for name, room in setuptools["package-dir"].items():
        below = package / name.removeprefix("flockbrush.")
        if name != "flockbrush" and not below.exists():
            below.symlink_to(tree / room)
    return folder, "flockbrush.runs.run"


def against(other, level, pairs, ticks):
    """Print the ratio of tick times here and in another checkout, measured in alternation."""
    if not (other / "pyproject.toml").is_file():
        raise SystemExit(f"{other}: not a checkout (no pyproject.toml); create one: git worktree add {other} COMMIT")
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        sides = [_started(tree.resolve(), Path(folder, str(k)), level) for k, tree in enumerate((HERE.parent, other))]
        for side in sides:
            _ticked(side, WARM_UP)
        times = [[0.0] * pairs, [0.0] * pairs]
        for pair in range(pairs):
            for k in (0, 1) if pair % 2 == 0 else (1, 0):
                times[k][pair] = _ticked(sides[k], ticks) / ticks
        for side in sides:
            side.communicate()
    ratios = sorted(here / there for here, there in zip(*times, strict=True))
    here, there = (1e3 * statistics.median(some) for some in times)
    print(f"{level}: {here:.2f} ms CPU per tick here, {there:.2f} there (medians of {pairs} times {ticks} ticks)")
    print(f"ratio here / there, median of pairs: {statistics.median(ratios):.3f} ({ratios[0]:.3f} to {ratios[-1]:.3f})")
    print(machine())


def _started(tree, folder, level):
    """Start a process that runs ticks of a level with the code of a checkout."""
    found, module = as_installed(tree, folder)
    return subprocess.Popen(
        [sys.executable, "-c", TICKING, module, level], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        cwd=found, env={**os.environ, "PYTHONPATH": str(found)},
    )  # fmt: skip


def _ticked(side, ticks):
    """Return the CPU seconds of `ticks` ticks in another process."""
    side.stdin.write(f"{ticks}\n")
    side.stdin.flush()
    told = side.stdout.readline()
    if not told:
        raise SystemExit("a checkout could not run the level; see its output above")
    return float(told)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    what = parser.add_subparsers(dest="what", required=True)
    whole = what.add_parser("ticks")
    whole.add_argument("--sizes", type=int, nargs="+", default=list(GOALS))
    whole.add_argument("--ceiling", type=Path, default=HERE / "herd_ceiling.cpp", help="source of the C++ kernel")
    many = what.add_parser("million")
    many.add_argument("--animals", type=int, default=1_000_000)
    form = what.add_parser("shape")
    pair = what.add_parser("against")
    pair.add_argument("other", type=Path, help="another checkout")
    pair.add_argument("--level", default="crowded")
    pair.add_argument("--pairs", type=int, default=20)
    pair.add_argument("--ticks", type=int, default=16, help="ticks of each side in a pair")
    for one in (whole, form):
        one.add_argument("--rounds", type=int, default=5)
        one.add_argument("--budget", type=float, default=0.5, help="seconds per round")
    options = parser.parse_args()
    if options.what == "ticks":
        ticks(options.sizes, options.ceiling, options.rounds, options.budget)
    elif options.what == "million":
        million(options.animals)
    elif options.what == "against":
        against(options.other, options.level, options.pairs, options.ticks)
    else:
        shape(options.rounds, options.budget)


if __name__ == "__main__":
    main()
