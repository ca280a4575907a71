"""Commands to animals: what brush they follow, where they go, who comes and leaves."""

from __future__ import annotations

import numpy as np
from flockbrush.components import BrushBinding, Destination, Migration
from flockbrush.components.agent import DIRECTION, NOWHERE, POINT
from flockbrush.components.level_things import Spawn
from flockbrush.engine import limits
from flockbrush.engine.commands import command
from flockbrush.engine.maths import sincos_
from flockbrush.engine.problems import did_you_mean
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import spawn_animals
from flockbrush.systems.palette import Palette
from flockbrush.systems.selection import (
    OfAnimals,
    can_use_brush,
    check_brush,
    check_can,
    check_can_come,
    species_of,
)
from flockbrush.systems.undo import TouchedAnimals, goal_index, need, remove

MOST = int(limits.ANIMALS)  # as many as a level may have


@command
class SwitchBrush(OfAnimals):
    """Give animals another brush of their own: all, one species, or those in a circle."""

    changes = (BrushBinding.home,)
    brush: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        super().check(world)
        check_brush(world, self.brush)
        check_can(world, self.brush, self.species)

    def apply(self, world):
        chosen = self.chosen(world)
        can = can_use_brush(world, self.brush)
        if chosen.any() and not (chosen & can).any():
            check_can(world, self.brush, species_of(world, int(np.flatnonzero(chosen)[0])))
        chosen &= can
        world.agents[BrushBinding.home][chosen] = world.resource(Palette).named(self.brush)


@command
class Migrate(OfAnimals):
    """Send a flock: to a point or in a direction (``kind``), evenly from where it is bound now within ``seconds``.

    ``kind = "none"`` sets it free.  All, one species, or those within ``radius`` of (at_x, at_y).
    """

    place_kinds = ("point",)
    changes = (Migration.kind, Migration.target, Migration.next, Migration.left)
    x: float
    y: float
    z: float
    kind: str = "point"
    seconds: float = 0.0
    species: str = ""
    at_x: float = 0.0
    at_y: float = 0.0
    radius: float = 0.0

    def check(self, world):
        kinds = list(_BOUND)
        need(self.kind in kinds, f"kind must be one of {', '.join(kinds)}{did_you_mean(self.kind, kinds)}")
        need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")
        need(self.kind != "direction" or self.x or self.y or self.z, "a direction must not be (0, 0, 0)")
        super().check(world)

    def apply(self, world):
        agents, chosen = world.agents, self.chosen(world)
        target = np.array([self.x, self.y, self.z])
        # animals with another goal, or none, turn at once
        glides = chosen & (agents[Migration.kind] == _BOUND[self.kind]) & (self.seconds > 0)
        jumps = chosen & ~glides
        agents[Migration.kind][chosen] = _BOUND[self.kind]
        agents[Migration.target][jumps] = target if self.kind != "none" else 0.0
        agents[Migration.next][chosen] = target if self.kind != "none" else 0.0
        agents[Migration.left][chosen] = 0.0
        agents[Migration.left][glides] = self.seconds


_BOUND = {"none": NOWHERE, "direction": DIRECTION, "point": POINT}


@command
class SendTo(OfAnimals):
    """Bind animals to a goal by its name; an empty name sets them free."""

    changes = (Destination.goal,)
    goal: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0

    def check(self, world):
        if self.goal:
            goal_index(world.resource(Landscape), self.goal)
        super().check(world)

    def apply(self, world):
        goal = goal_index(world.resource(Landscape), self.goal) if self.goal else -1
        world.agents[Destination.goal][self.chosen(world)] = goal


def disc(x, y, radius, sides=32):
    """A round brush stroke as a polygon, (sides, 2) m."""
    turned = np.array([sincos_(2.0 * np.pi * k / sides) for k in range(sides)])
    return np.column_stack([x + radius * turned[:, 1], y + radius * turned[:, 0]])


@command
class AddAnimals:
    """Put animals down in a circle."""

    brush: str
    x: float
    y: float
    radius: float
    count: int = 1
    species: str = "animal"
    heading: float | None = None  # rad; None: each its own
    program: str = ""  # that they follow; "": none

    def check(self, world):
        check_brush(world, self.brush)
        check_can_come(world, self.species, self.brush, self.program)
        need(self.radius > 0, f"radius must be above 0 m, got {self.radius:g}")
        need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")

    def foresee(self, world):
        world.resource(SpeciesList).index(self.species)

    def touches(self, world):
        return [TouchedAnimals()]

    def apply(self, world):
        total = len(world.agents) + self.count
        need(total <= MOST, f"there may be at most {MOST} animals, and this would make {total}")
        where, stream = disc(self.x, self.y, self.radius), f"add {world.next_entity}"  # two strokes in one tick are two
        spawn = Spawn(0, "", where, self.species, self.brush, heading=self.heading, program=self.program)
        spawn_animals(world, spawn, self.count, stream)


@command
class RemoveAnimals(OfAnimals):
    """Take animals away: all, one species, or those in a circle."""

    x: float
    y: float
    radius: float  # m; 0: everywhere
    species: str = ""

    def touches(self, world):
        return [TouchedAnimals(self.rows(world))]

    def apply(self, world):
        remove(world, world.agents.ids[self.chosen(world)])
