"""Measure size and time of every export format: ``python benchmarks/exports.py [LEVEL] [SECONDS] [ENDING]``.

One run writes all formats.  The time is that of the exporter, without the simulation.
"""

import sys
import tempfile
import time
from pathlib import Path

from flockbrush.output.exporter import exporters
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import Sampler

MODES = {".usdc": ("usd_mode", ("instancer", "xforms", "skel")), ".glb": ("gltf_mode", ("nodes", "crowd"))}


def main(level="sheep-pasture", seconds="30", only=""):
    """Print a row for each format, or for one."""
    simulation, spent, writers = start(level), {}, []
    with tempfile.TemporaryDirectory() as folder:
        for ending, kind in exporters().items():
            if ending == ".usda" or only not in ("", ending):
                continue  # .usda is .usdc as text
            option, modes = MODES.get(ending, ("", ("",)))
            for mode in modes:
                path = Path(folder) / f"run{mode}{ending}"
                begin = time.perf_counter()
                writer = kind(path, simulation, kind.fps, **({option: mode} if option else {}))
                writer.open()
                spent[path] = time.perf_counter() - begin
                writers.append((path, writer, Sampler(simulation, kind.fps)))
        for tick in range(round(float(seconds) / simulation.clock.dt) + 1):
            if tick:
                simulation.tick()
            for path, writer, sampler in writers:
                begin = time.perf_counter()
                for moment in sampler.due():
                    writer.take(moment)
                spent[path] += time.perf_counter() - begin
        print("| file | frames/s | MB | s |\n|---|---|---|---|")
        for path, writer, _ in writers:
            begin = time.perf_counter()
            writer.close()
            spent[path] += time.perf_counter() - begin
            written = path.parent.glob(path.name.replace("####", "[0-9]*"))
            size = sum(p.stat().st_size for p in (*written, *type(writer).beside(path)) if p.exists())
            print(f"| {path.name} | {writer.fps:g} | {size / 1e6:.1f} | {spent[path]:.1f} |")


if __name__ == "__main__":
    main(*sys.argv[1:4])
