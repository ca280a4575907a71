"""Film the shipped levels, observe the films, and compare the observed herds with the simulated ones.

    python benchmarks/own_films.py [LEVEL ...] [--overlays]

Each level is filmed from above for 1.6 s at 10 frames per second, as `run --export walk.mp4 --no-overlays` does, and
the film is observed as `learn` does.  Each cell shows simulated / observed.  Only walking animals are counted in the
simulation.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flockbrush.systems.measures import compute_polarization  # noqa: E402

from flockbrush.film.observations import CannotObserve  # noqa: E402
from flockbrush.film.observe import observe  # noqa: E402
from flockbrush.output.export import Exports  # noqa: E402
from flockbrush.runs.run import shipped_levels, start  # noqa: E402

WALKS = 0.6  # own body lengths that an animal walks in a film; others rest


class HerdSummary(NamedTuple):
    """Means over the frames of a film."""

    polarization: float
    speed: float  # m/s
    count: float
    length: float  # m, the median animal


def film(level, path, seconds=1.6, fps=10, warm=1.0, overlays=False):
    """Film a level from above into ``path``; returns (the simulated herd, pixels per metre)."""
    simulation = start(level)
    dt = simulation.clock.dt
    for _ in range(round(warm / dt)):
        simulation.tick()
    moments = []
    with Exports([path], simulation, fps=fps, overlays=overlays) as exports:
        kind, sampler = exports._pairs[0]
        for _ in range(round(seconds / dt)):
            simulation.tick()
            for moment in sampler.due():
                kind.take(moment)
                moments.append(moment)
        scale = kind._painter.camera.scale
    simulation.close()
    return _truth(moments), scale


def _truth(moments):
    """Means over the animals that walk; animals at rest count as ground, as `docs/fields.md` says."""
    low, high, long = {}, {}, {}
    for m in moments:
        for name, at, length in zip(m.ids.tolist(), m.xyz[:, :2], m.length, strict=True):
            low[name], high[name] = np.minimum(low.get(name, at), at), np.maximum(high.get(name, at), at)
            long[name] = length
    walks = {name for name in low if np.linalg.norm(high[name] - low[name]) > WALKS * long[name]}
    rows = [(m, np.isin(m.ids, list(walks))) for m in moments]
    rows = [(m, chosen) for m, chosen in rows if chosen.any()]
    if not rows:
        return HerdSummary(np.nan, 0.0, 0.0, np.nan)
    orders = [compute_polarization(m.forward[chosen]) for m, chosen in rows]
    speeds = [np.linalg.norm(m.velocity[chosen, :2], axis=1).mean() for m, chosen in rows]
    length = float(np.median(np.concatenate([m.length[chosen] for m, chosen in rows])))
    count = float(np.mean([chosen.sum() for _, chosen in rows]))
    return HerdSummary(float(np.mean(orders)), float(np.mean(speeds)), count, length)


def seen(path, scale, **options):
    """(the observed herd of a film, all observations)."""
    told = observe(path, **options)
    worked = np.sqrt(abs(np.linalg.det(told.camera[0, :, :2])))  # px of the pictures worked on, for one of the film's
    px = told.body_length_px / worked / scale
    if told.sightings is None:
        return HerdSummary(np.nan, np.nan, float(told.fields.count.mean()), px), told
    rows = told.sightings
    orders = [np.linalg.norm(rows.forward[rows.of(t)].mean(0)) for t in range(len(rows)) if len(rows.xy[rows.of(t)])]
    speed = float(np.nanmean(rows.speed)) * px
    return HerdSummary(float(np.mean(orders)), speed, float(np.diff(rows.first).mean()), px), told


def main():
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("levels", nargs="*", metavar="LEVEL")
    parser.add_argument("--overlays", action="store_true", help="film with text, guides and trails")
    args = parser.parse_args()
    print("| level | body, px | polarization | speed, m/s | animals | length, m | note |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for level in args.levels or shipped_levels():
            print(_row(level, Path(folder) / f"{level}.mp4", args.overlays), flush=True)


def _row(level, path, overlays):
    was, scale = film(level, path, overlays=overlays)
    begin = f"| {level} | {was.length * scale:.1f} |"
    try:
        now, told = seen(path, scale)
    except CannotObserve as error:
        return (
            f"{begin} {was.polarization:.2f} | {was.speed:.2f} | {was.count:.0f} | {was.length:.2f} | {_said(error)} |"
        )
    pairs = zip(was, now, (".2f", ".2f", ".0f", ".2f"), strict=True)
    cells = " | ".join(f"{a:{form}} / {b:{form}}" for a, b, form in pairs)
    warnings = "too ", "only", "unreliable", "never moves", "several species"
    said = "; ".join(note.split(":")[0] for note in told.notes if any(word in note for word in warnings))
    return f"{begin} {cells} | {said} |"


def _said(error):
    return error.problems[0].message.split(":")[0]


if __name__ == "__main__":
    main()
