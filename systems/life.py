"""LIVE: arrivals, exits, births.  Deaths are queued until the end of the tick."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np
from flockbrush.components import Body, BrushBinding, Destination, Position, Species
from flockbrush.components.level_things import Spawn
from flockbrush.engine.clock import Clock
from flockbrush.engine.columns import Component
from flockbrush.engine.noise import Noise
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.families import make_families
from flockbrush.systems.fauna import HUNT, SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.named_regions import in_goal
from flockbrush.systems.noticing import Noticed
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import NoRoom, give_birth
from flockbrush.systems.programs import Programs, enrol_newborns
from flockbrush.systems.spawning import inside_polygon


@dataclass
class Nursery:
    """The spawns of the world, and how many animals each has brought."""

    spawns: list[Spawn] = field(default_factory=list)
    born: list[int] = field(default_factory=list)
    _cached: tuple = ([], b"[]")  # the spawns once put into words, for it is asked for in every tick

    def put(self, spawn, born=0, at=None):
        """Add a spawn that has brought so many already, behind the others by default where."""
        at = len(self.spawns) if at is None else at
        self.spawns.insert(at, spawn)
        self.born.insert(at, born)

    def find(self, number):
        """Index of the spawn with this id, or None."""
        return next((k for k, spawn in enumerate(self.spawns) if spawn.id == number), None)

    def state(self):
        """What of it belongs to the state of the world (see `flockbrush.engine.state.state_hash`)."""
        known = self._cached[0]
        if len(known) != len(self.spawns) or any(a is not b for a, b in zip(known, self.spawns, strict=True)):
            plain = [_plain(spawn) for spawn in self.spawns]
            self._cached = list(self.spawns), json.dumps(plain).encode()
        return np.array([len(self.born), *self.born], np.int64).tobytes() + self._cached[1]

    def set_state(self, data):
        """Put back what `state` gave."""
        count = int(np.frombuffer(data[:8], np.int64)[0])
        end = 8 + 8 * count
        self.born = np.frombuffer(data[8:end], np.int64).tolist()
        self.state()
        if bytes(data[end:]) != self._cached[1]:
            spawns = [{**spawn, "polygon": np.array(spawn["polygon"], float)} for spawn in json.loads(data[end:])]
            self.spawns = [Spawn(**spawn) for spawn in spawns]


_ORDER = (  # of fields in the state: its hash depends on it
    "id", "name", "polygon", "species", "brush", "count", "heading", "speed", "altitude", "start", "rate", "formation",
    "body_length", "depth", "since", "program", "family_size",
)  # fmt: skip
_ADDED = ("program", "family_size")  # to the state since it was first hashed: left out where they are not used


def _plain(spawn):
    """A spawn as JSON has it."""
    names = (name for name in _ORDER if name not in _ADDED or getattr(spawn, name))
    return {name: getattr(spawn, name) for name in names} | {"polygon": spawn.polygon.tolist()}


REACH = 0.25  # body lengths from body to body: so near a hunter catches its prey


def caught(world):
    """(n,) bool, who is caught by an animal that hunts, and whose species takes its prey out of the world."""
    agents, lists = world.agents, world.resource(Noticed).lists if world.has(Noticed) else None
    leaves = np.zeros(len(agents), bool)
    if lists is None:
        return leaves
    removes = world.resource(SpeciesList).relations.removes
    hunts = np.flatnonzero(lists.verb == HUNT)
    if not len(hunts) or not removes.any():
        return leaves
    hunter, prey = np.searchsorted(lists.first, hunts, side="right") - 1, lists.near[hunts]
    species, size = agents[Species.index], agents[Body.axis] + agents[Body.radius]
    near = np.sqrt((lists.offset[hunts] ** 2).sum(axis=1)) - size[hunter] - size[prey]
    fatal = removes[species[hunter], species[prey]] & (near <= REACH * agents[Body.length][hunter])
    fatal &= world.resource(Palette).hunts[agents[BrushBinding.brush][hunter]]
    leaves[prey[fatal]] = True
    return leaves


class Live(System):
    """What happens at goals, exits, the edge of the map and spawns."""

    stage = Stage.LIVE
    reads = (
        Component,
        Noticed,
        SpeciesList,
        Landscape,
        Palette,
        Programs,
        Clock,
        Noise,
    )  # all that a birth needs
    writes = (Destination, Nursery)

    def process(self, world):
        leaves = np.zeros(len(world.agents), bool)
        self._arrive(world, leaves)
        self._leave(world, leaves)
        leaves |= caught(world)
        for entity in world.agents.ids[leaves].tolist():
            world.delete_entity(entity)
        self._bear(world)

    @staticmethod
    def _arrive(world, leaves):
        land, xyz = world.resource(Landscape), world.agents[Position.xyz]
        bound = world.agents[Destination.goal]
        was = bound.copy()
        for k, goal in enumerate(land.goals):
            if goal.on_arrive == "stay":
                continue
            arrived = (was == k) & in_goal(goal, xyz, land.wrap)
            if goal.on_arrive == "despawn":
                leaves |= arrived
            elif goal.on_arrive == "next":
                bound[arrived] = goal.next_index
            else:  # disperse
                bound[arrived] = -1

    @staticmethod
    def _leave(world, leaves):
        land, xyz = world.resource(Landscape), world.agents[Position.xyz]
        for exit in land.exits:
            leaves |= inside_polygon(xyz, exit.polygon, land.wrap)
        if land.boundary == "despawn":
            leaves |= (xyz[:, 0] < 0) | (xyz[:, 1] < 0) | (xyz[:, 0] > land.width) | (xyz[:, 1] > land.height)

    @staticmethod
    def _bear(world):
        nursery, clock = world.resource(Nursery), world.resource(Clock)
        for k, spawn in enumerate(nursery.spawns):
            due = births_due(spawn, (clock.tick + 1) * clock.dt - spawn.since) - nursery.born[k]
            if due <= 0:
                continue
            try:
                spawn_animals(world, spawn, due, f"spawn {spawn.id}")
            except NoRoom as full:  # the rest come when there is room
                due = full.fitted
                if due:
                    spawn_animals(world, spawn, due, f"spawn {spawn.id}")
            nursery.born[k] += due


def births_due(spawn, now):
    """How many animals a spawn has brought by this time, in seconds."""
    if now < spawn.start:
        return 0
    if not spawn.rate:
        return spawn.count
    due = int((now - spawn.start) * spawn.rate) + 1
    return min(due, spawn.count) if spawn.count else due


def spawn_animals(world, spawn, count, stream):
    """Births as one spawn of the level has them."""
    born = give_birth(world, spawn, count, stream)
    enrol_newborns(world, born, spawn.program)
    if spawn.family_size:
        make_families(world, born, spawn.family_size)
    return born
