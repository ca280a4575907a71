"""Everything that may be done to a running world from outside: mouse, level script, tests and replay submit these."""

from __future__ import annotations

import numpy as np

from components import BrushBinding, Destination, Position, Species
from engine.columns import Component
from engine.commands import Commands, command
from engine.schedule import Stage, System
from systems.landscape import Barrier, Landscape
from systems.life import inside_polygon
from systems.palette import Palette
from systems.population import SpeciesList, give_birth


class ApplyCommands(System):
    """Apply what is due."""

    stage, writes = Stage.COMMANDS, (Commands, Landscape, Palette, Component)

    def process(self, world):
        world.resource(Commands).apply(world)


def disc(x, y, radius, sides=32):
    """A round brush stroke as a polygon, (sides, 2) m."""
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


def _cells_within(land, x, y, radius):
    """(slice, slice, mask) of the cells whose centres lie in a circle."""
    c = land.cell
    ny, nx = land.brush.shape
    x0, x1 = max(0, int((x - radius) / c)), min(nx, int((x + radius) / c) + 1)
    y0, y1 = max(0, int((y - radius) / c)), min(ny, int((y + radius) / c) + 1)
    cx, cy = (np.arange(x0, x1) + 0.5) * c - x, (np.arange(y0, y1) + 0.5) * c - y
    return slice(y0, y1), slice(x0, x1), cy[:, None] ** 2 + cx**2 <= radius**2


def _selected(world, x, y, radius, species):
    """(n,) bool: animals of a species ("" for all) in a circle (radius 0: everywhere)."""
    xyz = world.agents[Position.xyz]
    chosen = np.ones(len(xyz), bool)
    if radius > 0:
        chosen &= (xyz[:, 0] - x) ** 2 + (xyz[:, 1] - y) ** 2 <= radius**2
    if species:
        names = world.resource(SpeciesList).names
        chosen &= world.agents[Species.index] == (names.index(species) if species in names else -1)
    return chosen


@command
class SwitchBrush:
    """Give animals another brush of their own: all, one species, or those in a circle."""

    brush: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def apply(self, world):
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        world.agents[BrushBinding.home][chosen] = world.resource(Palette).named(self.brush)


@command
class PaintBrush:
    """Paint behaviour on the ground; an empty name erases."""

    brush: str
    x: float
    y: float
    radius: float

    def apply(self, world):
        land = world.resource(Landscape)
        index = world.resource(Palette).named(self.brush) if self.brush else -1
        rows, columns, mask = _cells_within(land, self.x, self.y, self.radius)
        land.brush[rows, columns][mask] = index


@command
class PaintCap:
    """Paint a maximum speed on the ground, metres per second; 0 or less erases."""

    max_speed: float
    x: float
    y: float
    radius: float

    def apply(self, world):
        land = world.resource(Landscape)
        rows, columns, mask = _cells_within(land, self.x, self.y, self.radius)
        land.surface[rows, columns, 1][mask] = self.max_speed if self.max_speed > 0 else np.inf


@command
class AddObstacle:
    """Put an obstacle down; animals on the spot are moved to its edge."""

    name: str
    points: list
    solid: bool = True
    blocks_view: bool = True

    def apply(self, world):
        land = world.resource(Landscape)
        polygon = np.array(self.points, float)
        x, y = polygon.T
        if np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0:
            polygon = polygon[::-1]
        land.barriers.append(Barrier(np.ascontiguousarray(polygon), self.solid, self.blocks_view, self.name))
        land.rebuild()
        if self.solid:
            evict(world, polygon)


@command
class RemoveObstacle:
    """Take an obstacle away by its name."""

    name: str

    def apply(self, world):
        land = world.resource(Landscape)
        land.barriers = [b for b in land.barriers if b.name != self.name]
        land.rebuild()


@command
class MoveGoal:
    """Move a goal, by its name, to another place."""

    goal: str
    x: float
    y: float

    def apply(self, world):
        land = world.resource(Landscape)
        for goal in land.goals:
            if goal.name == self.goal:
                shift = np.array([self.x, self.y]) - goal.xy
                goal.xy = goal.xy + shift
                if goal.polygon is not None:
                    goal.polygon = goal.polygon + shift
        land.rebuild()


@command
class SendTo:
    """Bind animals to a goal by its name; an empty name sets them free."""

    goal: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0

    def apply(self, world):
        names = [goal.name for goal in world.resource(Landscape).goals]
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        world.agents[Destination.goal][chosen] = names.index(self.goal) if self.goal in names else -1


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

    def apply(self, world):
        stream = f"add {self.x!r} {self.y!r}"
        give_birth(world, disc(self.x, self.y, self.radius), self.count, self.brush, self.species, self.heading, stream=stream)


@command
class RemoveAnimals:
    """Take the animals in a circle away: all, or one species."""

    x: float
    y: float
    radius: float
    species: str = ""

    def apply(self, world):
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        for entity in world.agents.ids[chosen].tolist():
            world.delete_entity(entity)
        world.flush()


@command
class SetParameter:
    """Change one number of a brush in the running world, such as ``cohesion_weight``."""

    brush: str
    name: str
    value: float

    def apply(self, world):
        palette = world.resource(Palette)
        brush = palette.brushes[palette.named(self.brush)]
        palette.add(brush.with_parameters(**{self.name: self.value}))


def evict(world, polygon):
    """Move animals that stand in a polygon to the nearest place outside of it."""
    agents = world.agents
    xyz = agents[Position.xyz]
    for row in np.flatnonzero(inside_polygon(xyz, polygon)):
        a, b = polygon, np.roll(polygon, -1, axis=0)
        along = b - a
        t = np.clip(((xyz[row, :2] - a) * along).sum(1) / np.maximum((along**2).sum(1), 1e-12), 0, 1)
        nearest = a + t[:, None] * along
        k = np.argmin(((nearest - xyz[row, :2]) ** 2).sum(1))
        outward = np.array([along[k, 1], -along[k, 0]]) / max(np.sqrt((along[k] ** 2).sum()), 1e-12)
        xyz[row, :2] = nearest[k] + outward * 0.5
