"""Test the scenes of the papers on many seeds: ``python benchmarks/scenes.py SCENE [--seeds A:B]``; the scenes are:

* ``anthill`` (Gong et al. 2025, fig. 17): the share of ants that go at least half round the square in 120 s, the mean
  rotation about it from 60 s on, and the shares of ants that pass the west and the east lane.  Then for the mill patch
  and the swarm patch how far ants head along the arrow (1: exactly): the lowest mean in the 4 s after they enter, and
  the mean when they leave.  A seed passes with .8 round, .5 of rotation, half of the ants through each lane, and if
  each patch lowers the mean by .1 and ants leave it with .8.
* ``river`` (fig. 8): milling after 90 s, mean of the last 5 s, and the mean speed in that of the brush; a seed passes
  with .8 and .5.  --brush and --animals set another mill and flock; the map grows with the flock.
* ``mills``: a wider disc, on open water, hollow and filled, 50 to 800 ducks (or --brush, --animals).  There is a herd
  for each seed; all are side by side in one world with the first seed.
* ``lifetimes``: such herds of 30 to 100 for 120 s: how long a mill lasts (from milling of .8 until it is below .5), and
  how long it takes to form again.
* ``lines``: the brushes front and lanes for 90 s on a plane with 50, 200 and 800 animals (or --brush, --animals); a
  seed passes if the means from 60 s on are in the bands of ``bands.json``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Heading, Position
from flockbrush.levels import reader
from flockbrush.levels.build import build, herds_apart
from flockbrush.levels.reader import read_level
from flockbrush.systems.measures import compute_milling

from flockbrush.runs.run import start

sys.path.insert(0, str(Path(__file__).parent.parent))  # the repository, when run as a program
from benchmarks.brush_bands import outside, stated, watch

MIDDLE = np.array([7.0, 9.0])  # m, of the ant hill
AFTER = 16  # quarters of a second after an ant has entered a patch
LINES = ("front", "lanes")
OPEN = 0.72  # ducks per square body length at the start on open water


def anthill(seed):
    """Return what the module says of ``anthill``, and whether the seed passes."""
    simulation = start("anthill", seed=seed)
    agents = simulation.agents
    away, along = [], []
    for _ in range(480):
        simulation.run(8)
        away.append(agents[Position.xyz][:, :2] - MIDDLE)
        out, forward = away[-1] / np.linalg.norm(away[-1], axis=1)[:, None], agents[Heading.forward]
        along.append(out[:, 0] * forward[:, 1] - out[:, 1] * forward[:, 0])
    away, along = np.array(away), np.array(along)
    angle = np.unwrap(np.arctan2(away[..., 1], away[..., 0]), axis=0)
    half_round = float(np.mean(np.abs(angle[-1] - angle[0]) >= np.pi))
    rotation = float(np.mean(along[240:]))
    west, upper = away[1:, :, 0] < 0, away[..., 1] > 0
    lanes, patches = [], []
    for enters in (west & upper[:-1] & ~upper[1:], ~west & ~upper[:-1] & upper[1:]):  # as the arrow points
        lanes.append(float(np.mean(enters.any(0))))
        ticks, ants = np.nonzero(enters[: 480 - AFTER])
        patches.append(np.array([along[ticks + k, ants].mean() for k in range(AFTER)]))
    (mill, swarm), ends = patches, (patches[1][0], patches[0][0])  # who leaves a patch enters the other one
    found = half_round, rotation, *lanes, mill.min(), ends[0], swarm.min(), ends[1]
    recover = all(p.min() <= p[0] - 0.1 and end >= 0.8 for p, end in zip((mill, swarm), ends, strict=True))
    return found, half_round >= 0.8 and rotation >= 0.5 and min(lanes) >= 0.5 and recover


def river(seed, brush="mill-filled", ducks=None):
    """Return (milling, mean speed in that of the brush), and whether the seed passes."""
    level = read_level(Path(reader.__file__).parent / "shipped" / "river.tmj")
    level.spawns[0].brush = brush
    for layer in level.brush_layers:
        layer.assets = [brush] * len(layer.assets)
    simulation = build(level, seed=seed, agents=ducks, library=shipped())
    simulation.run(85 * 32)
    found = []
    for _ in range(5):
        simulation.run(32)
        now = simulation.measures()
        found.append(
            (now["milling"], now["speed_mean"] / (shipped().get(brush).speed.mean * level.spawns[0].body_length))
        )
    milling, speed = np.mean(found, axis=0).tolist()
    return (milling, speed), milling >= 0.8 and speed >= 0.5


def mills(brush, ducks, herds, seed, first=86, last=90):
    """Return the milling (seconds, herds) of herds side by side, at every second from the first to the last."""
    own = shipped().get(brush)
    reach = last * own.speed.mean  # body lengths: herds meet only if they drift straight towards each other
    brushes = [own.model_copy(update={"name": f"{brush}-{k}"}) for k in range(herds)]
    simulation = herds_apart(brushes, ducks, OPEN, "mill", seed, apart=reach * own.body.length)
    simulation.run((first - 1) * 32)
    milling = []
    for _ in range(first, last + 1):
        simulation.run(32)
        xy, forward = simulation.agents[Position.xyz], simulation.agents[Heading.forward]
        rows = [slice(k * ducks, (k + 1) * ducks) for k in range(herds)]
        milling.append([compute_milling(xy[r, :2], forward[r]) for r in rows])
    simulation.close()
    return np.array(milling)


def stays(milling, gained=0.8, lost=0.5):
    """Return the time in each of two states and the number of exits: (s, times) milling, (s, times) not milling.

    A herd mills from the first second at which its milling is ``gained`` until it is below ``lost``.
    """
    seconds, left = [0, 0], [0, 0]
    for herd in np.transpose(milling):
        mills = herd[0] >= gained
        for value in herd[1:]:
            state = 0 if mills else 1
            seconds[state] += 1
            if value < lost if mills else value >= gained:
                left[state] += 1
                mills = not mills
    return tuple(zip(seconds, left, strict=True))


def lifetimes(brush, sizes, herds, seed):
    """Print how long mills last, and how long herds are without one, by size."""
    print(f"{brush} on open water, {herds} herds for 120 s, begun as a disc that turns; seeds from {seed} on")
    print("animals  lost  mill lasts, s  formed again  after, s  share of time at .8 or more", flush=True)
    for ducks in sizes:
        milling = mills(brush, ducks, herds, seed, 11, 120)
        (milled, lost), (without, formed) = stays(milling)
        lasts = f"{milled / lost:.0f}" if lost else f"over {milled}"
        after = f"{without / formed:.0f}" if formed else "-"
        print(
            f"{ducks:>7}  {lost:>4}  {lasts:>13}  {formed:>12}  {after:>8}  {np.mean(milling >= 0.8):.2f}", flush=True
        )


def lines(seed, brush, animals):
    """Return the measures with bands, and whether all are in band from 60 to 90 s."""
    plan = stated()[brush]
    seen = watch(shipped().get(brush), plan["scene"], animals, seed)
    return tuple(seen[name] for name in plan["bands"]), not outside(seen, plan["bands"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", choices=["anthill", "river", "mills", "lifetimes", "lines"])
    parser.add_argument("--seeds", default="9001:9020", help="first:last")
    parser.add_argument("--brush", help="river, mills: mill to use; lines: only this brush")
    parser.add_argument("--animals", type=int, help="number of animals; default: 160 (river), 50 to 800 (mills, lines)")
    told = parser.parse_args()
    first, last = (int(seed) for seed in (told.seeds.split(":") * 2)[:2])  # a single seed is a range of one
    if told.scene == "anthill":
        return judge(
            told.scene, "half round, rotation, west, east, mill and swarm patch: lowest, end", anthill, first, last
        )
    if told.scene == "river":
        brush = told.brush or "mill-filled"
        name = f"river, {brush}, {told.animals or 160} ducks"
        return judge(name, "milling and speed at 90 s", lambda seed: river(seed, brush, told.animals), first, last)
    if told.scene == "lines":
        if told.brush not in (None, *LINES):
            parser.error(f"--brush {told.brush}: lines has only {' and '.join(LINES)}")
        brushes = [told.brush] if told.brush else LINES
        sizes = [told.animals] if told.animals else (50, 200, 800)
        return judge_lines(first, last, brushes, sizes)
    for brush in [told.brush] if told.brush else ("mill-filled", "mill-hollow"):
        if told.scene == "lifetimes":
            lifetimes(brush, [told.animals] if told.animals else (30, 50, 70, 100), last - first + 1, first)
            continue
        for ducks in [told.animals] if told.animals else (50, 100, 200, 400, 800):
            found = mills(brush, ducks, last - first + 1, first).mean(0)
            judge(
                f"{brush}, {ducks} ducks on open water",
                "milling at 90 s",
                lambda seed, v=found: ((v[seed - first],), v[seed - first] >= 0.8),
                first,
                last,
            )


def judge_lines(first, last, brushes, sizes):
    """Judge the given brushes at every given size."""
    for animals in sizes:
        for brush in brushes:
            words = ", ".join(stated()[brush]["bands"])
            judge(f"{brush}, {animals} animals", words, lambda s, b=brush, n=animals: lines(s, b, n), first, last)


def judge(name, words, measure, first, last):
    """Print the result of each seed and how many seeds pass."""
    print(f"{name}: {words}")
    passed = 0
    for seed in range(first, last + 1):
        found, good = measure(seed)
        passed += good
        print(f"{seed}  {'  '.join(f'{value:.2f}' for value in found)}  {'yes' if good else 'no'}", flush=True)
    print(f"{passed} of {last - first + 1} seeds", flush=True)


if __name__ == "__main__":
    main()
