"""Time each step of measuring a film of a herd.

    python benchmarks/fields.py [--size 960x720] [--animals 200] [--frames 100] [--rounds 3]

The benchmark first makes a film of milling animals under a camera that drifts, turns and zooms.  It prints wall and
CPU milliseconds per frame of the fastest round.  Steps run in parallel, so they add up to more than the whole.  The
goal is 100 ms per frame of 960 x 720 on two cores (Gong et al. 2025 report 200 ms).  On a shared machine read the CPU
time.
"""

from __future__ import annotations

import argparse
import platform
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import cv2  # noqa: E402

from benchmarks.foreign_herds import herd  # noqa: E402
from benchmarks.herd_film import CameraDrift, shoot  # noqa: E402
from flockbrush.film import clip_fields as cells  # noqa: E402
from flockbrush.film import clip_reader as clip  # noqa: E402
from flockbrush.film import flow, masks, observe, sightings, stabilise  # noqa: E402

PARTS = {  # name: the functions that do the work
    "decode": [(clip, "_look_through")],
    "stabilise": [(stabilise.GroundFollower, "step")],
    "colours, size": [(observe, "colours_of"), (observe, "_size")],
    "mask": [(masks.BodyColours, "mask"), (observe, "without_specks")],
    "flow": [(flow.Flow, "between"), (flow.Flow, "small")],
    "cells": [(cells.Collector, "add")],
    "animals": [(observe, "bodies_of"), (observe, "sightings_of")],
}
assert sightings  # timed under its name in `observe`


def main():
    """Print a table of milliseconds per frame."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", default="960x720", help="size of the film, px")
    parser.add_argument("--animals", type=int, default=200)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    size = tuple(int(side) for side in args.size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mill.mp4"
        truth = herd("mill", count=args.animals, seconds=args.frames / 25, fps=25, seed=5)
        shoot(truth, path, size, 14.0, CameraDrift(drift=(1.0, 0.6), turn=0.05, zoom=0.02), seed=6)
        observe.observe(path, frames=(0, 11))  # compile
        whole = min((_whole(path) for _ in range(args.rounds)), key=lambda row: row[0])
        parts = _parts(path)
    print(f"{size[0]} x {size[1]}, {args.animals} animals, {args.frames} frames; {_machine()}")
    print(f"{'ms per frame':<16}{'wall':>8}{'CPU':>12}")
    for name, (wall, processor) in {"all of it": whole, **parts}.items():
        print(f"{name:<16}{1e3 * wall / args.frames:>8.1f}{1e3 * processor / args.frames:>12.1f}")


def _machine():
    return f"{platform.processor() or platform.machine()}, OpenCV {cv2.__version__} with {cv2.getNumThreads()} threads"


def _whole(path):
    """Return (wall, CPU) seconds of the whole measurement."""
    wall, processor = time.perf_counter(), time.process_time()
    observe.observe(path)
    return time.perf_counter() - wall, time.process_time() - processor


def _parts(path):
    """Return {step: (wall, CPU of the Python threads)}, seconds of one more round."""
    spent = {name: [0.0, 0.0] for name in PARTS}
    lock, kept = threading.Lock(), []
    for name, places in PARTS.items():
        for where, what in places:
            kept.append((where, what, where.__dict__[what]))
            setattr(where, what, _timed(getattr(where, what), spent[name], lock))
    try:
        observe.observe(path)
    finally:
        for where, what, work in kept:
            setattr(where, what, work)
    return {name: tuple(times) for name, times in spent.items()}


def _timed(work, spent, lock):
    """Wrap a function so that its time is added to a sum."""

    def timed(*args, **kwargs):
        with _added(spent, lock):
            return work(*args, **kwargs)

    return timed


@contextmanager
def _added(spent, lock):
    wall, processor = time.perf_counter(), time.thread_time()
    try:
        yield
    finally:
        with lock:
            spent[0] += time.perf_counter() - wall
            spent[1] += time.thread_time() - processor


if __name__ == "__main__":
    main()
