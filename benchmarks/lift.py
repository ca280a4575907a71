"""A flock lifted from one camera, measured against truth: ``python benchmarks/lift.py depth|tracking [--cases N]``.

The birds are own boids (brush ``starlings``) before a virtual camera; every figure is printed from the run itself.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from behaviours.brush import shipped
from behaviours.learning.camera import Camera
from behaviours.learning.lift import LiftError, lift
from behaviours.learning.lift_thesis import lift_by_thesis
from behaviours.learning.tracking import Tracker
from behaviours.learning.tracks import Tracks
from benchmarks.sky_film import compute_tracking, film
from components import Position
from levels.build import build
from levels.schema import Level, Spawn

FRAMES, FPS, WARM = 200, 32, 128  # frames, frames a second (every tick), ticks before the film begins
MARGIN = 1.05  # of the picture's half width and height


def flight(birds, seed):
    """A flock of starlings, (FRAMES, birds, 3) m, about its own middle."""
    side = 2.0 * birds ** (1 / 3)
    square = np.array([(1000, 1000), (1000 + side, 1000), (1000 + side, 1000 + side), (1000, 1000 + side)])
    heading = 0.7 * seed
    spawn = Spawn(
        1, "flock", square, "starling", "starlings", birds, heading, None, 60.0, 0.0, 0.0, "scatter", None, side
    )
    simulation = build(Level("sky", None, 2000, 2000, 20.0, "open", seed, spawns=[spawn]), library=shipped())
    simulation.run(WARM)
    path = []
    for _ in range(FRAMES):
        path.append(simulation.agents[Position.xyz].copy())
        simulation.tick()
    simulation.close()
    xyz = np.array(path)
    return xyz - xyz.mean((0, 1))


def filmed(xyz, least=40.0):
    """(xyz before the camera, camera): as near as the whole flight is in the picture, and at least so far, m."""
    speed = float(np.linalg.norm(np.diff(xyz, axis=0), axis=-1).mean() * FPS)
    camera = Camera(width=1280, height=720, horizontal_fov_deg=60, fps=FPS, mean_speed=speed, near=1, far=1000)
    half = 0.5 * np.array([camera.width, camera.height]) / camera.focal
    needs = np.abs(xyz[..., [0, 2]]) * MARGIN / half - xyz[..., 1:2]
    return xyz + [0, max(least, float(needs.max())), 0], camera


def compute_depth(truth, flight):
    """How true depths are, after the one scale that no camera knows.

    Returns
    -------
    dict
        error and constant: root mean square error over the mean depth, of the flight and of one constant depth;
        correlation; order: share of pairs more than .5 m apart in the right order; direction: degrees.
    """
    deep, found = np.linalg.norm(truth, axis=-1), flight.depth
    scaled = found * (deep * found).sum() / (found**2).sum()
    i, j = np.triu_indices(deep.shape[1], 1)
    apart = np.abs(deep[:, i] - deep[:, j]) > 0.5
    order = (np.sign(deep[:, i] - deep[:, j]) == np.sign(found[:, i] - found[:, j]))[apart]
    a, b = np.diff(truth, axis=0), np.diff(flight.xyz, axis=0)
    cosine = (a * b).sum(-1) / np.maximum(np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1), 1e-12)
    return {
        "error": np.sqrt(((scaled - deep) ** 2).mean()) / deep.mean(),
        "constant": deep.std() / deep.mean(),
        "correlation": np.corrcoef(deep.ravel(), found.ravel())[0, 1] if np.ptp(found) > 0 else 0.0,
        "order": order.mean() if len(order) else np.nan,
        "direction": np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean(),
    }


def depth(cases, noise):
    """The table of depths."""
    print("| birds | method | error | p90 | / constant | correlation | order | direction | time |")
    print("|---|---|---|---|---|---|---|---|---|")
    for birds in (5, 10, 20, 50):
        for name, method in (("smooth", lift), ("thesis", lift_by_thesis)):
            if name == "thesis" and birds > 10:
                continue
            rows, seconds = [], []
            for seed in range(cases):
                xyz, camera = filmed(flight(birds, seed))
                px = camera.project(xyz) + noise * np.random.default_rng(seed).normal(size=(FRAMES, birds, 2))
                begin = time.process_time()
                try:
                    rows.append(compute_depth(xyz, method(Tracks(px, np.arange(birds)), camera)))
                except LiftError as error:
                    print(f"case {seed}: {error}")
                seconds.append(time.process_time() - begin)
            told = {key: np.array([row[key] for row in rows]) for key in rows[0]}
            print(
                f"| {birds} | {name} | {np.median(told['error']):.3f} | {np.percentile(told['error'], 90):.3f} "
                f"| {told['error'].mean() / told['constant'].mean():.2f} | {np.median(told['correlation']):.2f} "
                f"| {np.nanmean(told['order']):.2f} | {told['direction'].mean():.1f}° | {np.median(seconds):.2f} s |",
                flush=True,
            )


def tracking(cases):
    """The table of tracking."""
    print("| birds | tracks | recall | precision | switches | IDF1 | ms a frame |")
    print("|---|---|---|---|---|---|---|")
    for birds in (5, 20, 50):
        for seed in range(cases):
            xyz, camera = filmed(flight(birds, seed))
            px = camera.project(xyz)
            visible = ((px > 4) & (px < (camera.width - 4, camera.height - 4))).all(-1)
            tracker, spent = Tracker(), 0.0
            for picture in film(xyz, camera, seed):
                tick = time.process_time()
                tracker.step(picture)
                spent += time.process_time() - tick
            told = compute_tracking(px, visible, tracker.tracks())
            print(
                f"| {birds} | {told['tracks']} | {told['recall']:.3f} | {told['precision']:.3f} | {told['switches']} "
                f"| {told['idf1']:.3f} | {1e3 * spent / FRAMES:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["depth", "tracking"])
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--noise", type=float, default=0.5, help="pixels")
    options = parser.parse_args()
    if options.what == "depth":
        depth(options.cases, options.noise)
    else:
        tracking(min(options.cases, 3))
