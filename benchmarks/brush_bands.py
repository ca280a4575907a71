"""Measure whether each shipped herd brush does what its name says, and every change from one brush to another.

Run from the repository's root::

    python benchmarks/brush_bands.py                 the whole study: about ten minutes on one core
    python benchmarks/brush_bands.py march lanes     some brushes
    python benchmarks/brush_bands.py --switches      only the changes of brush
    python benchmarks/brush_bands.py --write         store the measurements in behaviours/brushes/bands.json

``bands.json`` states for each brush its scene (start, duration and start of the measurement), the bands of its
measures and the herd sizes for which they are promised.  This command never changes these.  A measure is the mean over
a run, sampled every half second.

Measures: ``polarization``, ``milling``, ``aspect`` (width over length), ``spacing`` (mean distance to the nearest
neighbour, body lengths), ``together`` (share in the largest part, links of 4 body lengths), ``going`` (actual over
intended distance: low in a jam), ``middle`` (share of animals closer to the centre than .35 of the mean radius: .054
in a disc), ``in file`` (share whose nearest neighbour is within 30° of straight ahead or behind; .33 when directions
are random).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np
from flockbrush.behaviours import brush as brushes
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Body, BrushBinding, Heading, Position, Speed, Velocity
from flockbrush.engine.state import restore, snapshot
from flockbrush.levels.build import plane
from flockbrush.systems.measures import (
    compute_aspect_ratio,
    compute_largest_part,
    compute_milling,
    compute_nn_bearing,
    compute_nnd,
    compute_polarization,
    compute_speed,
    compute_turning_angle,
)
from flockbrush.systems.palette import Palette

BANDS = Path(brushes.__file__).parent / "brushes" / "bands.json"
RATE = 32  # ticks a second
SEEDS = {50: 5, 200: 5, 800: 2}  # new seeds: the searches used seeds below 1000
FIRST_SEED = 1000
MEASURES = ("polarization", "milling", "aspect", "spacing", "together", "going", "middle", "in file")
MOST = 20.0  # degrees that a change of brush may add to the largest turn of an animal in a tick


def stated():
    """Return the contents of `bands.json`, by brush."""
    return json.loads(BANDS.read_text(encoding="utf-8"))


def measures_of(simulation):
    """Return the measures of one moment, by name; lengths in body lengths."""
    agents = simulation.agents
    xy = agents[Position.xyz][:, :2] / agents[Body.length].mean()
    forward = agents[Heading.forward]
    radius = np.linalg.norm(xy - xy.mean(0), axis=1)
    ahead = np.abs(np.cos(compute_nn_bearing(xy, forward)))
    return {
        "polarization": compute_polarization(forward),
        "milling": compute_milling(xy, forward),
        "aspect": compute_aspect_ratio(xy, forward),
        "spacing": float(compute_nnd(xy).mean()),
        "together": compute_largest_part(xy, 4.0),
        "going": float(compute_speed(agents[Velocity.xyz]).mean() / agents[Speed.target].mean()),
        "middle": float((radius < 0.35 * radius.mean()).mean()),
        "in file": float((ahead > np.cos(np.radians(30))).mean()),
    }


def watch(brush, scene, count, seed, seconds=None, since=None):
    """Run one herd and return the mean of each measure.

    Parameters
    ----------
    brush : Brush
    scene : dict
        ``start``, ``density`` (per square body length), ``heading`` (radians, or None: random), ``seconds``,
        ``since``.
    count, seed : int
    seconds, since : float, optional
        Instead of the scene's.
    """
    seconds = scene["seconds"] if seconds is None else seconds
    since = scene["since"] if since is None else since
    simulation = plane(brush, count, scene["density"], scene["start"], seed, scene["heading"])
    simulation.run(round(since * RATE))
    moments = []
    for _ in range(round(2 * (seconds - since))):
        simulation.run(RATE // 2)
        moments.append(measures_of(simulation))
    simulation.close()
    return {name: float(np.mean([m[name] for m in moments])) for name in MEASURES}


def outside(measured, bands):
    """Return the names of the measures outside their band."""
    return [name for name, (low, high) in bands.items() if not low <= measured[name] <= high]


def largest_turns(simulation, ticks):
    """Return the largest turn of each animal in one of the next ticks, (n,) degrees."""
    agents = simulation.agents
    most = np.zeros(len(agents))
    for _ in range(ticks):
        was = agents[Heading.forward].copy()
        simulation.tick()
        most = np.maximum(most, np.abs(compute_turning_angle(was, agents[Heading.forward])))
    return np.degrees(most)


def switch(old, news, scene, count=150, seed=0, settle=6.0, before=1.0, after=2.0):
    """Return, for each new brush, how many degrees the change adds to the largest turn of an animal in a tick, at most.

    This is the largest turn in the ``after`` seconds after the change, less that in the ``before`` seconds before it.
    One herd settles with the old brush and is restored to the moment of the change for each new one.
    """
    simulation = plane(old, count, scene["density"], scene["start"], seed, scene["heading"])
    indices = [simulation.world.resource(Palette).add(new) for new in news]
    simulation.run(round(settle * RATE))
    usual = largest_turns(simulation, round(before * RATE))
    moment, worst = snapshot(simulation.world), []
    for index in indices:
        restore(simulation.world, moment)
        simulation.agents[BrushBinding.home][:] = index
        worst.append(float((largest_turns(simulation, round(after * RATE)) - usual).max()))
    simulation.close()
    return worst


# the study -------------------------------------------------------------------


def study(names, library, say):
    """Return measured ranges by brush and herd size, and the table as lines of Markdown."""
    plan, measured = stated(), {}
    lines = [
        "| brush | animals | " + " | ".join(MEASURES) + " | runs in band |",
        "|---" * (len(MEASURES) + 3) + "|",
    ]
    for name in names:
        scene, bands = plan[name]["scene"], plan[name]["bands"]
        measured[name] = {}
        for count, seeds in SEEDS.items():
            start = time.perf_counter()
            runs = [watch(library.get(name), scene, count, FIRST_SEED + k) for k in range(seeds)]
            fine = sum(not outside(run, bands) for run in runs)
            spread = {m: [round(min(r[m] for r in runs), 3), round(max(r[m] for r in runs), 3)] for m in MEASURES}
            measured[name][str(count)] = spread | {"runs": seeds, "in band": fine}
            promised = "" if count in plan[name]["promised"] else " (not promised)"
            cells = [_range(*spread[m]) for m in MEASURES]
            lines.append(f"| {name} | {count} | " + " | ".join(cells) + f" | {fine} of {seeds}{promised} |")
            say(lines[-1] + f"  {time.perf_counter() - start:.0f} s")
    return measured, lines


def _range(low, high):
    return f"{low:.2f}" if f"{low:.2f}" == f"{high:.2f}" else f"{low:.2f}-{high:.2f}"


def switches(names, library, count=150, seed=FIRST_SEED, **times):
    """Return the degrees added to the largest turn in a tick, by old and new brush."""
    plan, matrix = stated(), {}
    for old in names:
        news = [new for new in names if new != old]
        worst = switch(library.get(old), map(library.get, news), plan[old]["scene"], count, seed, **times)
        matrix[old] = {new: round(degrees, 1) for new, degrees in zip(news, worst, strict=True)}
    return matrix


def switch_table(matrix):
    """Return lines of Markdown: a row for each old brush, a column for each new one."""
    names = list(matrix)
    lines = ["| from \\ to | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for old in names:
        lines.append(
            f"| {old} | " + " | ".join("" if new == old else f"{matrix[old][new]:.0f}" for new in names) + " |"
        )
    return lines


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("brush", nargs="*", help="brushes to study; default: all")
    parser.add_argument("--switches", action="store_true", help="only the changes of brush")
    parser.add_argument("--no-switches", action="store_true", help="without the changes of brush")
    parser.add_argument("--write", action="store_true", help="store the measurements in bands.json")
    parser.add_argument("--json", action="store_true", help="print one object instead of tables")
    options = parser.parse_args(arguments)
    plan, library = stated(), shipped()
    names = options.brush or [name for name in plan if name != "switches"]
    if unknown := [name for name in names if name not in plan]:
        parser.error(f"bands.json does not have {', '.join(unknown)}; it has {', '.join(plan)}")

    def say(line):
        if not options.json:
            print(line, flush=True)

    measured, matrix = {}, {}
    if not options.switches:
        measured, _ = study(names, library, say)
        if options.write:
            store(plan, measured)
    if not options.no_switches:
        matrix = switches(names, library)
        say("\n" + "\n".join(switch_table(matrix)))
        if steps := [(d, old, new) for old, row in matrix.items() for new, d in row.items()]:  # of two brushes or more
            worst = max(steps)
            say(f"\nlargest increase per tick: {worst[0]:.1f}°, from {worst[1]} to {worst[2]}; limit {MOST:.0f}°")
    if options.json:
        print(json.dumps({"measured": measured, "switches": matrix}))
    return 0


def store(plan, measured):
    """Store the measurements in `bands.json`."""
    for name, sizes in measured.items():
        plan[name]["measured"] = sizes
    BANDS.write_text(json.dumps(plan, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
