"""Benchmark of ticks, in the scene that the documented figures refer to.

One herd on an endless plane: 0.25 animals/m², 10 m view range (about 78 neighbours in range), exact occlusion.
"""

from __future__ import annotations

import os
import platform
import sys
import time

import numpy as np

from flockbrush.behaviours.brush import shipped
from flockbrush.engine.parallel import set_threads
from flockbrush.levels.build import plane
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_for
from flockbrush.runs.kernel_helper import FEW, TICKS
from flockbrush.runs.run import peak_memory, versions
from flockbrush.runs.terminal import print_json, print_line, say, show, table

BRUSH = "crowd"
DENSITY = 0.25  # animals per m²
RANGE = 10.0  # m
WARM_UP = 5  # ticks


def scene(agents):
    """The simulation to time, before its first tick."""
    brush = shipped().get(BRUSH)
    length = brush.body.length
    sight = brush.vision.model_copy(update={"range": RANGE / length, "occlusion": True})
    far = brush.with_parameters(neighbour_range=RANGE / length).model_copy(update={"vision": sight})
    return plane(far, agents, DENSITY * length**2)


def rehearse():
    """Run the scene with few animals, so that `compile_ahead` can list the kernels it calls."""
    simulation = scene(FEW)
    simulation.run(TICKS)
    simulation.close()


def timed(simulation, ticks):
    """(seconds of each tick, {system: mean seconds per tick})."""
    simulation.run(WARM_UP)
    before, seconds = dict(simulation.schedule.nanoseconds), []
    for _ in range(ticks):
        begin = time.perf_counter()
        simulation.tick()
        seconds.append(time.perf_counter() - begin)
    after = simulation.schedule.nanoseconds
    return seconds, {name: (after[name] - before[name]) / 1e9 / ticks for name in after}


def machine():
    """The processor, operating system and Python version, as one line of text."""
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{_processor()}, {os.cpu_count()} CPUs, {system}"


def _processor():
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown processor"


def benchmark(sizes, ticks, thread_counts, json):
    """Time every herd size with every number of threads and print the tables."""
    results = []
    with compiling_for("flockbrush.cli.bench:rehearse"):
        for agents in sizes:
            for threads in thread_counts:
                simulation = scene(agents)  # anew: every row times the same ticks
                before = set_threads(threads)
                try:
                    results.append(_result(simulation, agents, threads, _fewer(ticks, agents)))
                finally:
                    set_threads(before)
                    simulation.close()
                if terminal.is_terminal(sys.stderr):
                    say(f"{agents:,} animals, {threads} threads: {1e3 * results[-1]['median']:.2f} ms")
    if json:
        scene_of = {"brush": BRUSH, "density": DENSITY, "range": RANGE, "occlusion": True}
        print_json({"machine": machine(), "versions": versions(), "scene": scene_of, "results": results})
        return
    _show(results)


def _fewer(ticks, agents):
    """Number of timed ticks; fewer for large herds, whose ticks vary less."""
    return max(2, min(ticks, 600_000 // agents if agents > 10_000 else ticks))


def _result(simulation, agents, threads, ticks):
    seconds, systems = timed(simulation, ticks)
    median = float(np.median(seconds))
    return {
        "agents": agents,
        "threads": threads,
        "ticks": ticks,
        "median": median,
        "p95": float(np.percentile(seconds, 95)),
        "microseconds_an_animal": 1e6 * median / agents,
        "systems": systems,
        "peak_memory_mib": peak_memory(),
    }


def _show(results):
    numbers = ("animals", "threads", "ms per tick", "95th percentile, ms", "µs per animal", "memory, MiB")
    made = table(*numbers, title="0.25 animals/m², 10 m view range, exact occlusion", right=numbers)
    for r in results:
        times = f"{1e3 * r['median']:.2f}", f"{1e3 * r['p95']:.2f}", f"{r['microseconds_an_animal']:.2f}"
        made.add_row(f"{r['agents']:,}", str(r["threads"]), *times, f"{r['peak_memory_mib']:.0f}")
    show(made)
    heads = [f"{r['agents']:,} x {r['threads']}" for r in results]
    rows = ((name, *(f"{1e3 * r['systems'][name]:.3f}" for r in results)) for name in results[0]["systems"])
    show(table("system", *heads, rows=rows, title="ms per tick by system (animals x threads)", right=heads))
    print_line(machine())
