"""Time `flockbrush learn` on a clip of 100 frames with 200 animals.

    python benchmarks/learning.py time [--animals 200] [--frames 100] [--runs 1]

The clip is a simulated herd (`swarm` of ``benchmarks/foreign_herds.py``), filmed at 960 x 720.  The command runs in a
process of its own, with a report, in full and with ``--quick``.  The first run of each kind, which compiles kernels, is
not counted.  CPU time is that of all its threads and processes, user and system.  On a shared machine read CPU times.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZE, BODY = (960, 720), 16.0  # px
GOALS = {"full": 60.0, "quick": 15.0}  # s, wall


def add(commands):
    """Add the command's options."""
    parser = commands.add_parser("time", help="seconds that learning takes")
    parser.add_argument("--animals", type=int, default=200)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--runs", type=int, default=1, help="counted runs of each kind")
    parser.add_argument("--only", choices=list(GOALS), help="one kind only")
    parser.set_defaults(run=run)


def run(options):
    """Time both kinds; print a line for each run."""
    from benchmarks.foreign_herds import herd
    from benchmarks.herd_film import CameraDrift, shoot

    rows = []
    with tempfile.TemporaryDirectory() as folder:
        truth = herd("swarm", options.animals, options.frames / 25.0, seed=3)
        frames = len(truth.xy)
        film = shoot(truth, Path(folder) / "clip.mp4", SIZE, BODY, CameraDrift(follow=1.0), seed=3)
        print(f"{frames} frames, {options.animals} animals, load {os.getloadavg()[0]:.1f}")
        print("settings | goal, s | wall, s | CPU, s | observing | learning | comparing | verdict")
        for kind in [options.only] if options.only else GOALS:
            _learned(film.path, Path(folder), kind == "quick")
            for _ in range(options.runs):
                row = {"settings": kind, "goal, s": GOALS[kind], **_learned(film.path, Path(folder), kind == "quick")}
                print(" | ".join(str(value) for value in row.values()), flush=True)
                rows.append(row)
    return rows


def _learned(clip, folder, quick):
    """Seconds of one run of the command, and what it says of the brush."""
    words = [sys.executable, "-m", "flockbrush", "learn", clip, "--out", folder / "timed.brush.toml", "--json"]
    words += ["--report", folder / "report", *(["--quick"] if quick else [])]
    begin, before = time.perf_counter(), os.times()
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=True)
    wall, after = time.perf_counter() - begin, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    told = json.loads(done.stdout)["brushes"][0]
    parts = told["seconds"]
    observing = wall - sum(parts.values())
    return {
        "wall, s": round(wall, 1), "CPU, s": round(cpu, 1), "observing": round(observing, 1),
        "learning": round(parts["learning"], 1), "comparing": round(parts["comparing"], 1), "verdict": told["verdict"],
    }  # fmt: skip
