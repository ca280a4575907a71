"""Measure size and time of every export format: ``python benchmarks/exports.py [LEVEL] [SECONDS] [ENDING ...]``.

One run writes all formats.  The time is that of the exporter, without the simulation; CPU time counts all threads and
hardly depends on what else the machine does.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from flockbrush.output.exporter import exporters
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import Sampler

MODES = {".usdc": ("usd_mode", ("instancer", "xforms", "skel")), ".glb": ("gltf_mode", ("nodes", "crowd"))}


def clocks():
    """Return wall-clock and CPU time, s."""
    return np.array([time.perf_counter(), time.process_time()])


def main(level="sheep-pasture", seconds="30", *only):
    """Print a row for each format, or for some."""
    simulation, spent, writers = start(level), {}, []
    with tempfile.TemporaryDirectory() as folder:
        for ending, kind in exporters().items():
            if ending == ".usda" or (only and ending not in only):
                continue  # .usda is .usdc as text
            option, modes = MODES.get(ending, ("", ("",)))
            for mode in modes:
                path = Path(folder) / f"run{mode}{ending}"
                begin = clocks()
                writer = kind(path, simulation, kind.fps, **({option: mode} if option else {}))
                writer.open()
                spent[path] = clocks() - begin
                writers.append((path, writer, Sampler(simulation, kind.fps)))
        for tick in range(round(float(seconds) / simulation.clock.dt) + 1):
            if tick:
                simulation.tick()
            for path, writer, sampler in writers:
                begin = clocks()
                for moment in sampler.due():
                    writer.take(moment)
                spent[path] += clocks() - begin
        print("| file | frames/s | MB | s | CPU s |\n|---|---|---|---|---|")
        for path, writer, _ in writers:
            begin = clocks()
            writer.close()
            spent[path] += clocks() - begin
            written = path.parent.glob(path.name.replace("####", "[0-9]*"))
            size = sum(p.stat().st_size for p in (*written, *type(writer).beside(path)) if p.exists())
            print(
                f"| {path.name} | {writer.fps:g} | {size / 1e6:.1f} | {spent[path][0]:.1f} | {spent[path][1]:.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
