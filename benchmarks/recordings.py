"""Benchmark recordings: announced and actual size on disk, peak memory, time to open a moment.

    python benchmarks/recordings.py                          # one hour of 300 animals, 60 s of 100,000
    python benchmarks/recordings.py --animals 1000 --seconds 20

Each recording is made in a process of its own.  Memory is printed after a tenth of the ticks and at the end; it should
not grow.  Moments are opened in another process; the first one is reported separately, because it loads the program.
`cpu` is the CPU time of all threads, for busy machines.
"""

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def record(path, level, animals, seconds):
    """Record a run and print its cost as JSON."""
    from flockbrush.runs import run as running

    simulation = running.start(level, agents=animals)
    ticks = round(seconds / simulation.clock.dt)
    said, before = running.recording_size(simulation, ticks), running.peak_memory()
    recorder, began = running.record(path, simulation), time.perf_counter()
    for k in range(ticks):
        simulation.tick()
        recorder.take()
        if k == ticks // 10:
            early = running.peak_memory()
    recorder.close()
    told = {
        "ticks": ticks, "said_mb": said / 1e6, "mb": Path(path).stat().st_size / 1e6, "mib_before": before,
        "mib_at_a_tenth": early, "mib_at_the_end": running.peak_memory(), "seconds": time.perf_counter() - began,
    }  # fmt: skip
    print(json.dumps(told))


def open_at(path, moments):
    """Open a recording at random moments and print the seconds as JSON."""
    from flockbrush.engine.recording import open_recording

    from flockbrush.runs import run as running

    rng, seconds, busy = random.Random(1), [], []
    for _ in range(moments + 1):
        began, worked = time.perf_counter(), time.process_time()
        run = open_recording(path)
        simulation = running.rebuild(run)
        running.go_to(run, simulation, rng.randrange(run.last_tick + 1))
        seconds.append(time.perf_counter() - began)
        busy.append(time.process_time() - worked)
        simulation.close()
    told = {"first_s": seconds[0]}
    for kind, taken in (("", seconds), ("cpu_", busy)):
        told |= {f"median_{kind}s": sorted(taken[1:])[moments // 2], f"worst_{kind}s": max(taken[1:])}
    print(json.dumps(told))


def elsewhere(*words):
    """Run this script in another process and return its output."""
    done = subprocess.run([sys.executable, __file__, *map(str, words)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--level", default="crowded")
    parser.add_argument("--animals", type=int)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--moments", type=int, default=7)
    parser.add_argument("--make", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--open", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.make:
        return record(options.make, options.level, options.animals, options.seconds)
    if options.open:
        return open_at(options.open, options.moments)
    asked = [(options.animals, options.seconds)] if options.animals else [(300, 3600), (100_000, 60)]
    for animals, seconds in asked:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.flock"
            words = ["--level", options.level, "--animals", animals, "--seconds", seconds]
            print(f"{animals:,} animals, {seconds:g} s:", elsewhere("--make", path, *words), flush=True)
            print("  open a moment:", elsewhere("--open", path, "--moments", options.moments), flush=True)


if __name__ == "__main__":
    main()
