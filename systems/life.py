"""LIVE: arrivals, exits, births.  Deaths are queued until the end of the tick."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from components import Destination, Position
from engine.clock import Clock
from engine.schedule import Stage, System
from systems.landscape import Landscape
from systems.population import NoRoom, give_birth
from systems.spawning import inside_polygon


@dataclass
class Nursery:
    """Spawns that still have animals to bring, and how many each has brought."""

    spawns: list = field(default_factory=list)
    born: list[int] = field(default_factory=list)

    def state(self):
        """What of it belongs to the state of the world (see `engine.state.state_hash`)."""
        return np.array(self.born, np.int64).tobytes()

    def set_state(self, data):
        """Put back what `state` gave."""
        self.born = np.frombuffer(data, np.int64).tolist()


class Live(System):
    """What happens at goals, exits, the edge of the map and spawns."""

    stage = Stage.LIVE
    reads = (Position, Landscape, Clock)
    writes = (Destination, Nursery)

    def process(self, world):
        gone = np.zeros(len(world.agents), bool)
        self._arrive(world, gone)
        self._leave(world, gone)
        for entity in world.agents.ids[gone].tolist():
            world.delete_entity(entity)
        self._bear(world)

    @staticmethod
    def _arrive(world, gone):
        land, xyz = world.resource(Landscape), world.agents[Position.xyz]
        bound = world.agents[Destination.goal]
        was = bound.copy()
        for k, goal in enumerate(land.goals):
            if goal.on_arrive == "stay":
                continue
            here = (was == k) & inside_goal(goal, xyz)
            if goal.on_arrive == "despawn":
                gone |= here
            elif goal.on_arrive == "next":
                bound[here] = goal.next_index
            else:  # disperse
                bound[here] = -1

    @staticmethod
    def _leave(world, gone):
        land, xyz = world.resource(Landscape), world.agents[Position.xyz]
        for exit in land.exits:
            gone |= inside_polygon(xyz, exit)
        if land.boundary == "despawn":
            gone |= (xyz[:, 0] < 0) | (xyz[:, 1] < 0) | (xyz[:, 0] > land.width) | (xyz[:, 1] > land.height)

    @staticmethod
    def _bear(world):
        nursery, clock = world.resource(Nursery), world.resource(Clock)
        for k, spawn in enumerate(nursery.spawns):
            due = births_due(spawn, (clock.tick + 1) * clock.dt) - nursery.born[k]
            if due <= 0:
                continue
            try:
                bear(world, spawn, due, f"spawn {spawn.id}")
            except NoRoom as full:  # the rest come when there is room
                due = full.fitted
                if due:
                    bear(world, spawn, due, f"spawn {spawn.id}")
            nursery.born[k] += due


def births_due(spawn, now):
    """How many animals a spawn has brought by this time, in seconds."""
    if now < spawn.start:
        return 0
    if not spawn.rate:
        return spawn.count
    due = int((now - spawn.start) * spawn.rate) + 1
    return min(due, spawn.count) if spawn.count else due


def bear(world, spawn, count, stream):
    """Births as one spawn of the level has them."""
    return give_birth(
        world, spawn.polygon, count, spawn.brush, spawn.species, spawn.heading, spawn.speed, spawn.altitude,
        spawn.formation, spawn.body_length, stream, spawn.depth,
    )  # fmt: skip


def inside_goal(goal, xyz):
    """(n,) bool, who stands in a goal."""
    if goal.polygon is not None:
        return inside_polygon(xyz, goal.polygon)
    off = xyz[:, :2] - goal.xy
    return off[:, 0] ** 2 + off[:, 1] ** 2 <= goal.radius**2
