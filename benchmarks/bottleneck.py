"""Compare people at a bottleneck with JuPedSim: ``python benchmarks/bottleneck.py [--peer PYTHON] [--seeds 1:3]``.

A room of 12 m by 12 m has 150 people and one door, 0.8 to 4 m wide, in a wall of 1 m, with a goal behind it.  Flow is
measured between the first fifth and the fourth fifth of the people who come through.  Density is the mean over the
same time in the 2 m by 2 m in front of the door.  Flockbrush uses the brush `evacuate` of the level `city` and the
species human; JuPedSim uses its collision-free speed model with default parameters.  ``--peer`` is a Python with the
package `jupedsim`; without it only Flockbrush is measured.  The last column is the specific flow ``d v(d)`` from
Weidmann's (1993) relation of speed and density, at the measured density.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

SIDE, WALL, PEOPLE, SECONDS = 12.0, 1.0, 150, 240.0  # m, m, persons, s
WIDTHS = 0.8, 1.2, 1.6, 2.4, 3.2, 4.0  # m
FREE, JAM, SLOPE = 1.34, 5.4, 1.913  # m/s, persons per m², of Weidmann's curve
EVERY = 0.125  # s between samples

PEER = """
import json, sys
import jupedsim as jps
from shapely.geometry import box as rectangle
width, people, seed, side, wall, seconds, every = json.loads(sys.argv[1])
low, high = side / 2 - width / 2, side / 2 + width / 2
room = [(0, 0), (side, 0), (side, low), (side + wall, low), (side + wall, 0), (side + 8, 0), (side + 8, side),
        (side + wall, side), (side + wall, high), (side, high), (side, side), (0, side)]
kind = jps.CollisionFreeSpeedModelAgentParameters
world = jps.Simulation(model=jps.CollisionFreeSpeedModel(), geometry=room, dt=0.01)
out = world.add_exit_stage([(side + 5, 0), (side + 8, 0), (side + 8, side), (side + 5, side)])
way = world.add_journey(jps.JourneyDescription([out]))
box = rectangle(0.5, 0.5, side - 0.5, side - 0.5)
places = jps.distribute_by_number(polygon=box, number_of_agents=people, distance_to_agents=0.5,
                                  distance_to_polygon=0.3, seed=seed)
for place in places:
    world.add_agent(kind(position=place, journey_id=way, stage_id=out))
looks = []
for step in range(round(seconds / 0.01)):
    if step % round(every / 0.01) == 0:
        looks.append([[a.id, *a.position] for a in world.agents()])
        if not looks[-1]:
            break
    world.iterate()
print(json.dumps({"version": jps.__version__, "looks": looks}))
"""


def ours(width, seed, folder):
    """Return [(ids, xy)] of each sample, in a level drawn here."""
    from flockbrush.behaviours.brush import shipped
    from flockbrush.components import Position
    from flockbrush.levels.build import build
    from flockbrush.levels.reader import read_level
    from flockbrush.levels.sketch import LevelSketch
    from flockbrush.levels.tiled import write_project

    write_project(folder, shipped())
    sketch = LevelSketch(24, 14, 1.0, "tilesets", "wall", seed)
    sketch.ground("road")
    low, high = 7.0 - width / 2, 7.0 + width / 2  # the room is 1 m from the map's edges
    walls = {
        "west": [(0, 0), (1, 0), (1, 14), (0, 14)], "south": [(1, 0), (24, 0), (24, 1), (1, 1)],
        "north": [(1, 13), (24, 13), (24, 14), (1, 14)],
        "below": [(13, 1), (13 + WALL, 1), (13 + WALL, low), (13, low)],
        "above": [(13, high), (13 + WALL, high), (13 + WALL, 13), (13, 13)],
    }  # fmt: skip
    for name, corners in walls.items():
        sketch.draw("Obstacle", corners, name, z_max=3)
    sketch.draw("Goal", [(19, 1), (23, 1), (23, 13), (19, 13)], "out", on_arrive="despawn")
    sketch.box("Spawn", 7, 7, SIDE - 1, SIDE - 1, "people", species="human", brush="evacuate", count=PEOPLE)
    simulation = build(read_level(sketch.save(folder / "door.tmj")), seed=seed, library=shipped())
    looks = []
    for _ in range(round(SECONDS / EVERY)):
        agents = simulation.agents
        looks.append((agents.ids.copy(), agents[Position.xyz][:, :2] - 1.0))
        if not len(agents):
            break
        simulation.run(round(EVERY / simulation.clock.dt))
    simulation.close()
    return looks


def peers(python, width, seed):
    """Return the samples of JuPedSim, and its version."""
    given = json.dumps([width, PEOPLE, seed, SIDE, WALL, SECONDS, EVERY])
    done = subprocess.run([python, "-c", PEER, given], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{python} does not run JuPedSim: {done.stderr.strip().splitlines()[-1]}")
    told = json.loads(done.stdout.splitlines()[-1])
    looks = [np.array(look, float).reshape(-1, 3) for look in told["looks"]]
    return [(look[:, 0].astype(np.int64), look[:, 1:]) for look in looks], told["version"]


def flow_and_density(looks, width):
    """Return (persons per second, persons per m² in front of the door, share that came through)."""
    inside, came, before = set(), [], []
    for k, (ids, xy) in enumerate(looks):
        now = set(ids[xy[:, 0] < SIDE + 0.5 * WALL].tolist())
        came += [k * EVERY] * len(inside - now)
        inside = now
        middle = np.abs(xy[:, 1] - 0.5 * SIDE) < max(1.0, 0.5 * width)
        near = (xy[:, 0] > SIDE - 2.0) & (xy[:, 0] < SIDE) & middle
        before.append(near.sum() / (2.0 * max(2.0, width)))
    through = len(came) / PEOPLE
    first, last = int(0.2 * PEOPLE), int(0.8 * PEOPLE)
    if len(came) <= last:
        return np.nan, np.nan, through
    times = np.array(came)
    looked = slice(round(times[first] / EVERY), round(times[last] / EVERY) + 1)
    return (last - first) / (times[last] - times[first]), float(np.mean(before[looked])), through


def weidmann(density):
    """Return the flow in persons per metre and second."""
    return density * FREE * (1.0 - np.exp(-SLOPE * (1.0 / density - 1.0 / JAM)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", help="Python interpreter with the package jupedsim")
    parser.add_argument("--seeds", default="1:3", help="first:last")
    options = parser.parse_args()
    first, last = (int(seed) for seed in (options.seeds.split(":") * 2)[:2])
    kinds = ["flockbrush", *(["JuPedSim"] if options.peer else [])]
    if not options.peer:
        print("only flockbrush is measured; --peer PYTHON (with the package jupedsim) adds JuPedSim")
    print(
        "| | door, m | flow, 1/s | flow, 1/(m s) | density, 1/m² | came through | Weidmann at this density, 1/(m s) |"
    )
    print("|---|---|---|---|---|---|---|")
    for kind in kinds:
        for width in WIDTHS:
            found = []
            for seed in range(first, last + 1):
                if kind == "flockbrush":
                    with tempfile.TemporaryDirectory() as folder:
                        looks = ours(width, seed, Path(folder))
                else:
                    looks, _ = peers(options.peer, width, seed)
                found.append(flow_and_density(looks, width))
            flow, density, through = np.mean(found, axis=0)
            print(
                f"| {kind} | {width:g} | {flow:.2f} | {flow / width:.2f} | {density:.2f} | {100 * through:.0f} % "
                f"| {weidmann(density):.2f} |", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent.parent))
    main()
