"""Time the first `flockbrush run` after an installation, with nothing compiled: one core, all cores, and warm.

CPU times of all processes and the number of compiled kernels are printed too; on a busy machine read these.

Run with::

    python benchmarks/cold_start.py [LEVEL]
    python benchmarks/cold_start.py --wheel   # also from a wheel with compiled kernels, which it builds (minutes)
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import tempfile
import time
import venv
from pathlib import Path

from flockbrush.cli.bench import machine


def seconds(level, folder, threads):
    """Return wall and CPU seconds of a run of one tick, with the kernel cache in a folder."""
    environment = os.environ | {"NUMBA_CACHE_DIR": folder, "FLOCKBRUSH_THREADS": str(threads)}
    begin, before = time.perf_counter(), os.times()
    command = [sys.executable, "-m", "flockbrush", "run", level, "--ticks", "1"]
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return time.perf_counter() - begin, cpu


def from_wheel(level, folder):
    """Return wall seconds of the first and the second run from a wheel that `build-wheel` makes for this level."""
    home, env = Path(folder, "home"), Path(folder, "env")
    subprocess.run([sys.executable, "-m", "flockbrush", "build-wheel", folder, "--level", level], check=True)
    venv.create(env, symlinks=True, with_pip=False)
    packages = next(env.rglob("site-packages"))
    (packages / "requirements.pth").write_text(sysconfig.get_path("purelib"))
    python = next(env.glob("*/python"))
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*map(str, pip), *map(str, Path(folder).glob("*.whl"))], check=True)
    environment = {"PATH": os.environ["PATH"], "HOME": str(home), "XDG_CACHE_HOME": str(home)}
    taken = []
    for _ in range(2):
        begin = time.perf_counter()
        command = [python, "-P", "-m", "flockbrush", "run", level, "--ticks", "1"]
        subprocess.run(command, env=environment, cwd=folder, stdout=subprocess.DEVNULL, check=True)
        taken.append(time.perf_counter() - begin)
    return taken


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("level", nargs="?", default="meadow")
    parser.add_argument("--wheel", action="store_true", help="also time a wheel with compiled kernels")
    options = parser.parse_args()
    level, cores = options.level, os.cpu_count() or 1
    rows = []
    for threads in (1, cores):
        with tempfile.TemporaryDirectory() as folder:
            cold, cpu = seconds(level, folder, threads)
            kernels = sum(1 for _ in Path(folder).rglob("*.nbc"))
            rows.append((threads, cold, seconds(level, folder, threads)[0], cpu, kernels))
    print(f"first run of {level}")
    print(f"{'cores':>6} {'cold, s':>9} {'warm, s':>9} {'/ one core':>12} {'CPU, s':>9} {'kernels':>8}")
    for threads, cold, warm, cpu, kernels in rows:
        print(f"{threads:>6} {cold:>9.1f} {warm:>9.1f} {cold / rows[0][1]:>12.2f} {cpu:>9.1f} {kernels:>8}")
    if options.wheel:
        with tempfile.TemporaryDirectory() as folder:
            print(
                "from a wheel with compiled kernels: first run {:.1f} s, second {:.1f} s".format(
                    *from_wheel(level, folder)
                )
            )
    print(machine())


if __name__ == "__main__":
    main()
