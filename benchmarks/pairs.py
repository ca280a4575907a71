"""The matrix of pairs: every brush with every kind of event, and the invariants that must always hold.

    python benchmarks/pairs.py                       all pairs
    python benchmarks/pairs.py --brush geese march   the pairs of two brushes
    python benchmarks/pairs.py --seconds 60          a random sample (--seed), as in the test suite

The brushes are those that ship, and some of kinds that only `flockbrush learn` makes.  A pair is a small level with
twelve animals of one brush, run for ten seconds, and one event ("thing") after two seconds.  After every tick and at
the end, violated invariants are reported (`InvariantWatch`).
"""

from __future__ import annotations

import argparse
import csv
import json
import random
import shutil
import sys
import tempfile
import time
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import BrushBinding, Destination, Position
from flockbrush.engine.commands import Commands
from flockbrush.engine.recording import first_difference, open_recording, resume
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.sketch import LevelSketch
from flockbrush.levels.tile_pictures import png
from flockbrush.levels.tiled import project_files
from flockbrush.systems.commands import AddAnimals, AddObstacle, RemoveAnimals, SwitchBrush
from flockbrush.systems.edits import DrawGuide, Paint, PlaceExit, PlaceGoal
from flockbrush.systems.gusts import Gust
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import Appoint, Steer
from flockbrush.systems.life import Nursery
from flockbrush.systems.mark_commands import DrawZone
from flockbrush.systems.palette import Palette
from flockbrush.systems.program_commands import Event, GiveProgram, UseProgram
from flockbrush.systems.undo import MixBrush, UseBrush

from flockbrush.output.export import Exports
from flockbrush.runs.run import open_level, rebuild, record, start
from flockbrush.studio.branches import Beginning
from flockbrush.studio.timeline import Timeline

try:
    from learned_brushes import learned
    from pairs_watch import InvariantWatch
except ModuleNotFoundError:  # imported by the suite
    from benchmarks.learned_brushes import learned
    from benchmarks.pairs_watch import InvariantWatch

CELLS = 40  # along a side of the map
SECONDS, AT = 10.0, 2.0  # s of a pair; when the event happens
HERD = 12
PROGRAM = """
schema = "flockbrush.program/1"
start = "calm"
[state.calm]
brush = "%s"
[state.other]
brush = "%s"
for = "1..2 s"
then = "calm"
[[trigger]]
from = ["calm"]
to = "other"
when = { any = [ { event = "go" }, { rate = "1 /s" } ] }
"""


@dataclass
class Pair:
    """One small world: its brush and event, the species of its animals and its size in metres."""

    brush: str
    thing: str
    seed: int
    folder: Path
    species: str = ""
    side: float = 0.0
    zone: int = 904  # id of its zone of half weight
    worst: dict[str, float] = field(default_factory=dict)

    @property
    def name(self):
        return f"{self.brush} x {self.thing}"

    @property
    def middle(self):
        return self.side / 2

    def wrong(self, message, times=0.0):
        """Record a fault and its largest factor above the limit."""
        self.worst[message] = max(self.worst.get(message, 0.0), times)

    @property
    def faults(self):
        """Return the faults as messages."""
        return [f"{told} ({times:.2f} times)" if times else told for told, times in self.worst.items()]


# the level ---------------------------------------------------------------------------------


@cache
def library():
    """Return the brushes of the matrix."""
    return BrushLibrary(shipped().folders, learned())


@cache
def tiles():
    """Return {file: content} of what every level has beside it."""
    return project_files(library()) | {f"brushes/{name}": content for name, content in learned().items()}


@cache
def species_for(brush):
    """Return the first suitable species of a brush; else a sheep or a starling."""
    asset, kinds = library().get(brush), shipped_species()
    flies = asset.model in ("boids", "raptor", "line_formation", "v_rules") and brush != "boids-herd"
    named = [n for n in kinds.names() if n in asset.made_for]
    tagged = [n for n in kinds.names() if not {*kinds.get(n).tags}.isdisjoint(asset.made_for)]
    others = ["ant"] if brush.startswith("ants") else ["starling" if flies else "sheep"]
    tagged.sort(key=lambda n: n not in others)
    for name in (*named, *tagged, *others):
        if kinds.get(name).can("fly") if flies else kinds.get(name).can("walk") or kinds.get(name).can("swim"):
            return name
    raise LookupError(f"no species can use {brush}")


def brush_for(species):
    """Return a shipped brush made for a species."""
    asset, brushes = shipped_species().get(species), shipped()
    mine = {species, *asset.tags}
    fits = [n for n in brushes.names() if not mine.isdisjoint(brushes.get(n).made_for) and asset.media != ["swim"]]
    fits.sort(key=lambda n: (brushes.get(n).has_own_body, species not in brushes.get(n).made_for))
    return fits[0] if fits else "march"


def draw_level(pair):
    """Write the level of a pair and return its path."""
    asset = library().get(pair.brush)
    pair.species = species_for(pair.brush)
    body = shipped_species().get(pair.species)
    flies = body.can("fly") and pair.species not in ("sheep",) and asset.model not in ("herd", "flee", "hunt")
    pair.side = CELLS * (2.5 if flies else 1.0) * body.body.length * (4.0 if flies else 1.0)
    sketch = LevelSketch(CELLS, CELLS, pair.side / CELLS, "tilesets", "wall", pair.seed)
    sketch.ground("grass")
    if pair.thing in ("slope", "cliff", "mixed slope under birds"):
        draw_height(pair, sketch, body.body.length)
    if "mixed" in pair.thing:  # there from the start, and moved by the event
        zone = half_zone(pair, 0.3 * pair.side)
        words = {"brush": zone.brush, "strength": zone.strength, "edge": zone.edge, "species": zone.species}
        pair.zone = sketch.draw("Zone", zone.points, zone.name, closed=True, **words)
    high = body.fly.height if flies else 0.0
    about = 0.3 * pair.side
    sketch.box(
        "Spawn", pair.middle, pair.middle, about, about, "herd", species=pair.species, brush=pair.brush, count=HERD,
        altitude=high, heading="east",
    )  # fmt: skip
    for file, content in tiles().items():
        if not (pair.folder / file).exists():
            (pair.folder / file).parent.mkdir(parents=True, exist_ok=True)
            (pair.folder / file).write_bytes(content)
    return sketch.save(pair.folder / "pair.tmj")


def draw_height(pair, sketch, length):
    """Draw a ramp of one in two from the centre to the east, or a step of 30 body lengths."""
    x = np.linspace(0.0, 1.0, 161)
    rise = np.clip(x - 0.6, 0.0, 1.0) if pair.thing != "cliff" else 0.4 * (x > 0.7)
    grey = np.round(rise / 0.4 * 250).astype(np.uint8)
    (pair.folder / "height.png").write_bytes(png(np.repeat(grey[None, :], 161, 0)))
    top = 0.2 * pair.side if pair.thing != "cliff" else 30.0 * length
    sketch.picture("height", "height.png", metres_per_level=top / 250)


# things ------------------------------------------------------------------------------------


def things():
    """Return {name: function of (pair, simulation) that gives the commands of the event}."""
    made = {}
    for other in library().names():
        made[f"paint {other}"] = lambda p, s, o=other: [
            UseBrush(o, library().get(o).source.decode()),
            Paint("brush", o, p.middle, p.middle, p.middle, p.middle, 0.4 * p.side),
        ]
    for kind in shipped_species().names():
        made[f"species {kind}"] = lambda p, s, k=kind: _meet(p, k)
    made |= {
        "goal": lambda p, s: [PlaceGoal(900, "there", 0.9 * p.side, 0.5 * p.side, 0.05 * p.side)],
        "guide": lambda p, s: [DrawGuide(901, "way", [[0.2 * p.side, 0.2 * p.side], [0.9 * p.side, 0.8 * p.side]],
                                         radius=0.2 * p.side, decay=0.2 * p.side)],
        "exit": lambda p, s: [PlaceExit(902, "out", [[0.7 * p.side, 0.0], [p.side, 0.0], [p.side, p.side]])],
        "slope": lambda p, s: [],
        "cliff": lambda p, s: [],
        "added": lambda p, s: [AddAnimals(p.brush, p.middle, 0.2 * p.side, 0.1 * p.side, 5, p.species)],
        "removed": lambda p, s: [RemoveAnimals(p.middle, p.middle, 0.12 * p.side)],
        "leader": _lead,
        "gust": lambda p, s: [Gust(3.0, 2.0, 0.5)],
        "program": lambda p, s: [UseProgram("pairs", PROGRAM % (p.brush, p.brush)), GiveProgram("pairs")],
        "event": lambda p, s: [UseProgram("pairs", PROGRAM % (p.brush, p.brush)), GiveProgram("pairs"), Event("go")],
    }  # fmt: skip
    made |= {
        "soft zone": _soft_zone,
        "leader on mixed paint": lambda p, s: [half_zone(p, 0.45 * p.side), *_lead(p, s)],
        "leader with a program": lambda p, s: [*_lead(p, s), *_two_states(p)],
        "mixed slope under birds": lambda p, s: [half_zone(p, 0.5 * p.side), *_birds_above(p)],
    }
    for shape in ("box", "cylinder", "sphere", "plane", "hull"):
        made[f"obstacle {shape}"] = lambda p, s, k=shape: [_obstacle(p, s, k)]
    for handling in ("undo", "scrub", "branch", "snapshot", "export"):
        made[handling] = lambda p, s: [
            UseBrush("swarm", library().get("swarm").source.decode()),
            Paint("brush", "swarm", p.middle, p.middle, p.middle, p.middle, 0.2 * p.side),
        ]
    return made


def _meet(pair, species):
    """Add one animal of another species to the herd, unless it is too large for the map."""
    brush, size = brush_for(species), shipped_species().get(species).body.length
    if size >= pair.side / 8:
        return []
    where, radius = pair.middle + 0.25 * pair.side, max(1.5 * size, 0.05 * pair.side)
    return [
        UseBrush(brush, library().get(brush).source.decode()),
        AddAnimals(brush, where, pair.middle, radius, 1, species),
    ]


def _lead(pair, simulation):
    """Make the first animal a leader and send it to a corner of the map."""
    first = [int(simulation.agents.ids[0])]
    return [Appoint(first), Steer(first, 0.1 * pair.side, 0.9 * pair.side, "place")]


@cache
def partner(brush):
    """Return another brush of the same model, preferably of the same species; else the brush itself."""
    brushes, model = library(), library().get(brush).model
    others = [n for n in brushes.names() if n != brush and brushes.get(n).model == model]
    return min(others, key=lambda n: species_for(n) != species_for(brush), default=brush)


def half_zone(pair, west):
    """Return the command for a zone of half weight with a soft edge, from `west` to the east."""
    east, south, north = west + 0.4 * pair.side, 0.2 * pair.side, 0.8 * pair.side
    points = [[west, south], [east, south], [east, north], [west, north]]
    edge = 0.1 * pair.side
    return DrawZone(pair.zone, "half", points, partner(pair.brush), strength=0.5, edge=edge, species=pair.species)


def _soft_zone(pair, simulation):
    """Bring the mixtures for a zone of half weight along."""
    brush = partner(pair.brush)
    use = UseBrush(brush, library().get(brush).source.decode())
    return [use, MixBrush(brush, {}), half_zone(pair, 0.45 * pair.side)]


def _two_states(pair):
    """Alternate the animals between two brushes of one model."""
    other = partner(pair.brush)
    program = PROGRAM % (pair.brush, other)
    return [UseBrush(other, library().get(other).source.decode()), UseProgram("pairs", program), GiveProgram("pairs")]


def _birds_above(pair):
    """Add starlings above the herd, unless the map is too small for them."""
    if pair.side < 40.0:
        return []
    where = 0.5 * pair.side
    return [
        UseBrush("starlings", library().get("starlings").source.decode()),
        AddAnimals("starlings", where, where, 0.2 * pair.side, 5, "starling"),
    ]


def _obstacle(pair, simulation, shape):
    low, high = 0.55 * pair.side, 0.7 * pair.side
    points = [[low, low], [high, low], [high, high], [low, high]]
    top = 2.0 * float(simulation.agents[Position.xyz][:, 2].max()) + 0.1 * pair.side
    corners = None
    if shape == "hull":
        half = 0.07 * pair.side
        corners = [[x, y, z] for x in (-half, half) for y in (-half, half) for z in (0.0, top)]
    return AddObstacle("thing", points, id=903, shape=shape, z_max=top, corners=corners)


# a pair ------------------------------------------------------------------------------------


def designed(world):
    """Return everything that a designer can change, and the ids of the animals."""
    land, agents = world.resource(Landscape), world.agents
    land.settle(10**9)
    ground = land.state()
    head = 8 + int.from_bytes(ground[:8], "little")
    things = json.loads(ground[8:head])
    del things["reach"]  # the range of sorted edges, which never shrinks
    nursery, palette = world.resource(Nursery).state(), world.resource(Palette).state()
    own = agents[BrushBinding.home].tobytes(), agents[Destination.goal].tobytes()
    return [(things, ground[head:]), nursery, palette, agents.ids.tolist(), *own]


def _without_leftovers(now, before):
    """Ignore forgotten brushes at the end of the palette, kept while an animal still blends out (`ForgetBrush`)."""
    kept = json.loads(before[2])
    palette = json.loads(now[2])[: len(kept)]
    return [*now[:2], json.dumps(palette).encode(), *now[3:]]


def run_pair(brush, thing, seed, folder):
    """Return the faults of one pair, as messages."""
    pair = Pair(brush, thing, seed, Path(folder))
    path = draw_level(pair)
    if thing in ("scrub", "branch"):
        _with_timeline(pair, path)
        return pair.faults
    simulation = start(path)
    recording = pair.folder / "pair.flock"
    recorder = record(recording, simulation, keyframes=64)
    exports = Exports([pair.folder / "pair.csv"], simulation) if thing == "export" else None
    watch, last, drawn = InvariantWatch(simulation, pair.wrong), round(SECONDS * 32), []
    if exports:
        exports.take()
    while simulation.clock.tick < last:
        if simulation.clock.tick == round(AT * 32):
            _happen(pair, simulation)
            watch.forget()
        simulation.tick()
        recorder.take()
        if exports:
            exports.take()
            drawn.append((simulation.clock.now, simulation.agents.ids.copy(), simulation.agents[Position.xyz].copy()))
        watch.look()
    recorder.close()
    if exports:
        exports.close()
        _compare_table(pair, drawn)
    simulation.close()
    _replay(pair, recording)
    return pair.faults


def _happen(pair, simulation):
    """Perform, undo and redo the event; ``undo`` is undone in the middle of the change."""
    world = simulation.world
    commands, before = things()[pair.thing](pair, simulation), designed(world)
    if pair.thing == "snapshot":
        _back_and_forth(pair, simulation)
    perform = world.resource(Commands).perform
    undo = perform(world, commands)
    if pair.thing == "undo":
        simulation.run(4)
    redo = perform(world, undo)
    if _without_leftovers(designed(world), before) != before:
        pair.wrong("undo does not restore the previous state")
    if pair.thing != "undo":
        perform(world, redo)


def _back_and_forth(pair, simulation):
    """Check that a restored snapshot continues like the original."""
    data = snapshot(simulation.world)
    simulation.run(16)
    straight = state_hash(simulation.world)
    restore(simulation.world, data)
    simulation.run(16)
    if state_hash(simulation.world) != straight:
        pair.wrong("a restored snapshot continues differently")
    restore(simulation.world, data)


def _replay(pair, recording):
    run = open_recording(recording)
    again = rebuild(run)
    resume(run, again.world)
    difference = first_difference(run, again.world, again.tick)
    if difference is not None:
        pair.wrong(f"the replay differs: {difference}")
    again.close()


def _compare_table(pair, drawn):
    """Check that the exported table has the simulated positions."""
    with open(pair.folder / "pair.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    last = max(float(row["time"]) for row in rows)
    table = {int(row["id"]): [float(row[k]) for k in "xyz"] for row in rows if float(row["time"]) == last}
    now, ids, xyz = drawn[-1]
    if abs(now - last) > 1e-9 or sorted(table) != ids.tolist():
        pair.wrong("the table lacks the last moment or has other animals")
    elif np.abs(np.array([table[i] for i in ids.tolist()]) - xyz).max() > 1e-6:
        pair.wrong("the table has other positions than the simulation")


def _with_timeline(pair, path):
    """Check that scrubbing and branching do not change the past."""
    timeline = Timeline(Beginning(*open_level(path)), "pair")
    watch = InvariantWatch(timeline.simulation, pair.wrong)
    last, at, hashes = round(SECONDS * 32), round(AT * 32), {}
    while timeline.tick < last:
        if timeline.tick == at:
            timeline.perform(things()[pair.thing](pair, timeline.simulation))
            watch.forget()
        timeline.step()
        watch.look()
        hashes[timeline.tick] = state_hash(timeline.simulation.world)
    for tick in (at + 8, 5, last - 3, at - 1):
        timeline.go_to(tick)
        if state_hash(timeline.simulation.world) != hashes[tick]:
            pair.wrong(f"tick {tick} has changed")
    if pair.thing == "branch":
        timeline.go_to(at + 8)
        timeline.fork("other")
        timeline.perform([SwitchBrush(pair.brush)])
        for _ in range(32):
            timeline.step()
        timeline.switch("pair")
        timeline.go_to(last)
        if state_hash(timeline.simulation.world) != hashes[last]:
            pair.wrong("a branch changes the original run")
    timeline.close()


# many --------------------------------------------------------------------------------------


def all_pairs(brushes=None):
    """Return (brush, thing) of the whole matrix, in order."""
    return [(b, t) for b in (brushes or library().names()) for t in things() if t != f"paint {b}"]


def sample(pairs, seed, seconds, tell=lambda pair, faults: None):
    """Run pairs in random order for some seconds; return {(brush, thing): faults}.

    ``tell`` is called after each pair.
    """
    order, found, end = list(pairs), {}, time.monotonic() + seconds
    random.Random(seed).shuffle(order)
    for brush, thing in order:
        if time.monotonic() >= end:
            break
        found[brush, thing] = run_alone(brush, thing, seed)
        tell((brush, thing), found[brush, thing])
    return found


def run_alone(brush, thing, seed):
    """Call `run_pair` in a temporary folder; exceptions are returned as faults."""
    folder = tempfile.mkdtemp(prefix="pair-")
    try:
        return run_pair(brush, thing, seed, folder)
    except Exception as error:  # noqa: BLE001  any exception is a fault
        return [f"{type(error).__name__}: {error}"]
    finally:
        shutil.rmtree(folder)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--brush", nargs="*", help="run only pairs of these brushes")
    parser.add_argument("--thing", nargs="*", help="run only events whose names start like this")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after this time")
    options = parser.parse_args()
    pairs = [p for p in all_pairs(options.brush) if not options.thing or p[1].startswith(tuple(options.thing))]

    def tell(pair, faults):
        for fault in faults:
            print(f"{pair[0]} x {pair[1]}: {fault}", flush=True)

    found = sample(pairs, options.seed, options.seconds, tell)
    bad = sum(bool(faults) for faults in found.values())
    print(f"{len(found)} of {len(pairs)} pairs, {bad} with faults")
    return bad > 0


if __name__ == "__main__":
    sys.exit(main())
