"""Seconds of the first `flockbrush run` after installing, with nothing compiled: one process, all cores, and warm.

Run with::

    python benchmarks/cold_start.py [LEVEL]
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time

from flockbrush.cli.bench import machine


def seconds(level, folder, threads):
    """Wall seconds of a run of one tick, with kernels in a folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": folder, "FLOCKBRUSH_THREADS": str(threads)}
    begin = time.perf_counter()
    command = [sys.executable, "-m", "flockbrush", "run", level, "--ticks", "1"]
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("level", nargs="?", default="meadow")
    level, cores = parser.parse_args().level, os.cpu_count() or 1
    rows = []
    for threads in (1, cores):
        with tempfile.TemporaryDirectory() as folder:
            cold = seconds(level, folder, threads)
            rows.append((threads, cold, seconds(level, folder, threads)))
    print(f"first run of {level}")
    print(f"{'cores':>6} {'cold, s':>9} {'warm, s':>9} {'of one core':>12}")
    for threads, cold, warm in rows:
        print(f"{threads:>6} {cold:>9.1f} {warm:>9.1f} {cold / rows[0][1]:>12.2f}")
    print(machine())


if __name__ == "__main__":
    main()
