"""Measure packing events of merino sheep: ``python benchmarks/merino.py [--seeds 9001:9005] [--minutes 60]``.

The level `merino` (100 sheep on 80 x 80 m, after Ginelli et al. 2015 [1]_) is sampled four times per second.  An event
starts with the first sheep that runs and ends when no sheep has run for five seconds.  Its size is the number of sheep
that run in it.  Also printed: the area of the herd's convex hull at its start and its least area until 30 s after its
end, the position of the first runner, how fast the hull grows and shrinks, and the time between events of half of the
herd.

.. [1] Ginelli, F. et al. (2015). Intermittent collective dynamics emerge from conflicting imperatives in sheep herds.
   PNAS 112, 12729-12734.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

RATE = 4  # samples per second
QUIET, AFTER = 5 * RATE, 30 * RATE  # samples: without a runner, to end an event; after it, while the herd packs
SIZES = (1, 2, 4, 8, 16, 32, 64, 101)  # bins of sizes


class PackingEvent(NamedTuple):
    """A period in which sheep run."""

    begin: int  # sample
    end: int  # first sample after it
    size: int  # sheep that run in it
    outside: float  # share of the herd that is nearer to its centre than the first runners
    before: float  # m² of the convex hull
    after: float


def packing_events(runs: np.ndarray, xy: np.ndarray) -> list[PackingEvent]:
    """Return the events of a trial.

    Parameters
    ----------
    runs : ndarray (samples, n) bool
    xy : ndarray (samples, n, 2)
        Positions, m.
    """
    found, looks = [], np.flatnonzero(runs.any(axis=1))
    for part in np.split(looks, np.flatnonzero(np.diff(looks) > QUIET) + 1) if len(looks) else []:
        begin, end = int(part[0]), int(part[-1]) + 1
        away = np.linalg.norm(xy[begin] - xy[begin].mean(axis=0), axis=1)
        outside = np.mean([(away < mine).mean() for mine in away[runs[begin]]])
        after = min(hull_area(look) for look in xy[begin : end + AFTER])
        size = int(runs[begin:end].any(axis=0).sum())
        found.append(PackingEvent(begin, end, size, float(outside), hull_area(xy[begin]), after))
    return found


def hull_area(xy: np.ndarray) -> float:
    """Return the area of the convex hull of (n, 2) positions, m²."""
    return float(ConvexHull(xy).volume)


def trial(seed: int, minutes: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (runs, xy) of the level `merino`."""
    from flockbrush.components import Position, ProgramState
    from flockbrush.levels import reader
    from flockbrush.levels.build import build
    from flockbrush.levels.reader import read_level
    from flockbrush.systems.programs import Programs

    simulation = build(read_level(Path(reader.__file__).parent / "shipped" / "merino.tmj"), seed)
    program = simulation.world.resource(Programs).programs[0]
    run = list(program.states).index("run")
    runs, xy = [], []
    for _ in range(round(60 * minutes * RATE)):
        simulation.run(32 // RATE)
        runs.append(simulation.agents[ProgramState.state] == run)
        xy.append(simulation.agents[Position.xyz][:, :2].copy())
    simulation.close()
    return np.array(runs), np.array(xy)


def main() -> None:
    """Print the sizes of all trials."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="9001:9005", help="first:last")
    parser.add_argument("--minutes", type=float, default=60.0, help="of each trial; the paper's lasted an hour")
    options = parser.parse_args()
    first, last = (int(seed) for seed in (options.seeds.split(":") * 2)[:2])  # a single seed is a range of one
    events, growth, shrinkage, gaps = [], [], [], []
    print("seed  events  largest  of half the herd  hull m²: least, median, most")
    for seed in range(first, last + 1):
        runs, xy = trial(seed, options.minutes)
        mine, area = packing_events(runs, xy), np.array([hull_area(look) for look in xy])
        large = [event for event in mine if event.size >= runs.shape[1] / 2]
        change, busy = np.diff(area), runs[1:].any(axis=1)
        growth.append(RATE * change[~busy])
        shrinkage += [RATE * (event.before - event.after) / (event.end - event.begin) for event in large]
        gaps += (np.diff([event.begin for event in large]) / (60 * RATE)).tolist()
        events += mine
        sizes = max((event.size for event in mine), default=0)
        spread = f"{area.min():.0f}  {np.median(area):.0f}  {area.max():.0f}"
        print(f"{seed}  {len(mine):6d}  {sizes:7d}  {len(large):16d}  {spread}", flush=True)
    _tell(events, np.concatenate(growth), shrinkage, gaps)


def _tell(events, growth, shrinkage, gaps):
    """Print the sizes of all trials together."""
    print("\nsheep that run  events  hull after / before (median)  seconds (median)")
    for low, high in zip(SIZES, SIZES[1:], strict=False):
        some = [event for event in events if low <= event.size < high]
        if some:
            left = np.median([event.after / event.before for event in some])
            lasts = np.median([event.end - event.begin for event in some]) / RATE
            print(f"{low:3d} to {high - 1:3d}  {len(some):12d}  {left:28.2f}  {lasts:16.0f}")
    if not events:
        return
    outside = np.mean([event.outside for event in events])
    print(
        f"\n{len(events)} events; the first to run is farther out than {100 * outside:.0f} % of the herd (50 by chance)"
    )
    print(f"hull while no sheep runs: {growth.mean():+.2f} m²/s")
    if shrinkage:
        print(f"hull in events of half of the herd: {-np.mean(shrinkage):+.0f} m²/s")
    if gaps:
        print(f"between events of half of the herd: {np.mean(gaps):.1f} min (median {np.median(gaps):.1f})")


if __name__ == "__main__":
    main()
