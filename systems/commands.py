"""Everything that may be done to a running world from outside: mouse, level script, tests and replay submit these."""

from __future__ import annotations

import numpy as np

from behaviours.problems import ProblemsError, did_you_mean
from components import Body, BrushBinding, Destination, Heading, Migration, Position, Species
from components.agent import DIRECTION, NOWHERE, POINT
from engine.clock import Clock
from engine.columns import Component
from engine.commands import Commands, command
from engine.maths import sincos_
from engine.schedule import Stage, System
from systems.landscape import BRUSHES_OWN, Barrier, Glide, Landscape
from systems.palette import Palette
from systems.population import SpeciesList, give_birth
from systems.spawning import inside_polygon, nearest_free, outlines, touching
from systems.terrain import NO_BRUSH


class ApplyCommands(System):
    """Apply what is due."""

    stage, reads, writes = Stage.COMMANDS, (Clock,), (Commands, Landscape, Palette, Component)

    def process(self, world):
        world.resource(Commands).apply(world)
        land = world.resource(Landscape)
        for glide in list(land.glides):
            _advance(world, land, glide, world.resource(Clock).dt)


MOST = 1_000_000  # animals, as many as a level may have
CORNERS = 2_000  # of one obstacle, as many as a level may have


def disc(x, y, radius, sides=32):
    """A round brush stroke as a polygon, (sides, 2) m."""
    turned = np.array([sincos_(2.0 * np.pi * k / sides) for k in range(sides)])
    return np.column_stack([x + radius * turned[:, 1], y + radius * turned[:, 0]])


def _need(fine, message):
    if not fine:
        raise ValueError(message)


def _goal_index(land, name):
    """Index of the goal of this name; LookupError with what there is."""
    names = [goal.name for goal in land.goals]
    if name not in names:
        raise LookupError(f"there is no goal {name!r}{did_you_mean(name, names)}")
    return names.index(name)


def _check_circle(command):
    _need(command.radius >= 0, f"radius must be at least 0 m, got {command.radius:g}")


def _check_brush(world, name):
    world.resource(Palette).named(name)


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
        if species not in names:
            raise LookupError(f"there is no species {species!r}{did_you_mean(species, names)}")
        chosen &= world.agents[Species.index] == names.index(species)
    return chosen


@command
class SwitchBrush:
    """Give animals another brush of their own: all, one species, or those in a circle."""

    brush: str
    species: str = ""
    x: float = 0.0
    y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        _check_brush(world, self.brush)
        _check_circle(self)

    def apply(self, world):
        self.check(world)
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        world.agents[BrushBinding.home][chosen] = world.resource(Palette).named(self.brush)


@command
class PaintBrush:
    """Paint behaviour on the ground; an empty name erases."""

    brush: str
    x: float
    y: float
    radius: float

    def check(self, world):
        if self.brush:
            _check_brush(world, self.brush)
        _check_circle(self)

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        index = world.resource(Palette).named(self.brush) if self.brush else NO_BRUSH
        rows, columns, mask = _cells_within(land, self.x, self.y, self.radius)
        land.brush[rows, columns][mask] = index
        land.transition[rows, columns][mask] = BRUSHES_OWN


@command
class PaintCap:
    """Paint a maximum speed on the ground, metres per second; 0 or less erases."""

    max_speed: float
    x: float
    y: float
    radius: float

    def check(self, world):
        _check_circle(self)

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        rows, columns, mask = _cells_within(land, self.x, self.y, self.radius)
        land.surface[rows, columns, 1][mask] = self.max_speed if self.max_speed > 0 else np.inf


@command
class AddObstacle:
    """Put an obstacle down; animals on the spot are moved to the nearest free place."""

    name: str
    points: list
    solid: bool = True
    blocks_view: bool = True

    def check(self, world):
        self.polygon()

    def polygon(self):
        """(k, 2) m, counter-clockwise; ValueError when the points are none."""
        rows = [p for p in self.points if isinstance(p, list) and len(p) == 2 and all(map(_is_number, p))]
        _need(len(rows) == len(self.points), "points must be pairs of numbers, [[x, y], [x, y], ...]")
        _need(3 <= len(rows) <= CORNERS, f"an obstacle has 3 to {CORNERS} points, got {len(rows)}")
        polygon = np.array(rows, float)
        x, y = polygon.T
        area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        _need(area != 0, "the points lie in one line")
        return polygon if area > 0 else np.ascontiguousarray(polygon[::-1])

    def apply(self, world):
        land = world.resource(Landscape)
        barrier = Barrier(self.polygon(), self.solid, self.blocks_view, self.name)
        land.barriers.append(barrier)
        land.rebuild()
        try:
            if self.solid:
                evict(world, barrier.polygon)
        except ValueError:
            land.barriers.pop()
            land.rebuild()
            raise


@command
class RemoveObstacle:
    """Take an obstacle away by its name."""

    name: str

    def apply(self, world):
        land = world.resource(Landscape)
        names = [b.name for b in (*land.barriers, *land.overhead)]
        _need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        land.barriers = [b for b in land.barriers if b.name != self.name]
        land.moved |= any(b.name == self.name for b in land.overhead)
        land.overhead = [b for b in land.overhead if b.name != self.name]
        land.rebuild()


@command
class MoveObstacle:
    """Move an obstacle, by its name: its middle to (x, y), and up by ``rise``; evenly within ``seconds``, or at once.

    Animals on the ground step aside; one on the ground waits while they cannot.  Those in the air are pushed.
    """

    name: str
    x: float
    y: float
    rise: float = 0.0  # m
    seconds: float = 0.0

    def check(self, world):
        land = world.resource(Landscape)
        names = [b.name for b in (*land.barriers, *land.overhead)]
        _need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        _need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        middle = land.find(self.name)[0].polygon.mean(0)
        by = np.array([self.x - middle[0], self.y - middle[1], self.rise])
        land.glides = [glide for glide in land.glides if glide.name != self.name]
        land.glides.append(Glide(self.name, by, self.seconds))


def _advance(world, land, glide, dt):
    """One tick of an obstacle on its way."""
    barriers = land.find(glide.name)
    share = 1.0 if glide.left <= dt else dt / glide.left
    step = share * glide.by
    for b in barriers:
        land.shift(b, step)
    try:
        for b in barriers:
            if b.solid and land.on_the_ground(b):
                evict(world, b.polygon)
    except ValueError:  # somebody stands there who has no room to step aside: wait
        for b in barriers:
            land.shift(b, -step)
        return
    glide.by, glide.left = glide.by - step, glide.left - dt
    if share == 1.0 or not barriers:
        land.glides.remove(glide)


@command
class Migrate:
    """Send a flock: to a point or in a direction (``kind``), evenly from where it is bound now within ``seconds``.

    ``kind = "none"`` sets it free.  All, one species, or those within ``radius`` of (at_x, at_y).
    """

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
        _need(self.kind in kinds, f"kind must be one of {', '.join(kinds)}{did_you_mean(self.kind, kinds)}")
        _need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")
        _need(self.kind != "direction" or self.x or self.y or self.z, "a direction must not be (0, 0, 0)")
        _check_circle(self)

    def apply(self, world):
        self.check(world)
        agents = world.agents
        chosen = _selected(world, self.at_x, self.at_y, self.radius, self.species)
        target = np.array([self.x, self.y, self.z])
        # who was bound elsewhere, or nowhere, turns at once
        glides = chosen & (agents[Migration.kind] == _BOUND[self.kind]) & (self.seconds > 0)
        jumps = chosen & ~glides
        agents[Migration.kind][chosen] = _BOUND[self.kind]
        agents[Migration.target][jumps] = target if self.kind != "none" else 0.0
        agents[Migration.next][chosen] = target if self.kind != "none" else 0.0
        agents[Migration.left][chosen] = 0.0
        agents[Migration.left][glides] = self.seconds


_BOUND = {"none": NOWHERE, "direction": DIRECTION, "point": POINT}


@command
class MoveGoal:
    """Move a goal, by its name, to another place."""

    goal: str
    x: float
    y: float

    def check(self, world):
        land = world.resource(Landscape)
        _goal_index(land, self.goal)
        inside = 0 <= self.x < land.width and 0 <= self.y < land.height
        _need(inside, f"({self.x:g}, {self.y:g}) is not on the map, which is {land.width:g} x {land.height:g} m")

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        goal = land.goals[_goal_index(land, self.goal)]
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

    def check(self, world):
        if self.goal:
            _goal_index(world.resource(Landscape), self.goal)
        _check_circle(self)

    def apply(self, world):
        self.check(world)
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        goal = _goal_index(world.resource(Landscape), self.goal) if self.goal else -1
        world.agents[Destination.goal][chosen] = goal


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

    def check(self, world):
        _check_brush(world, self.brush)
        _need(self.radius > 0, f"radius must be above 0 m, got {self.radius:g}")
        _need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")

    def apply(self, world):
        self.check(world)
        total = len(world.agents) + self.count
        _need(total <= MOST, f"there may be at most {MOST} animals, and this would make {total}")
        give_birth(
            world, disc(self.x, self.y, self.radius), self.count, self.brush, self.species, self.heading,
            stream=f"add {world.next_entity}",  # two strokes in one tick are two
        )  # fmt: skip


@command
class RemoveAnimals:
    """Take the animals in a circle away: all, or one species."""

    x: float
    y: float
    radius: float
    species: str = ""

    def check(self, world):
        _check_circle(self)

    def apply(self, world):
        self.check(world)
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

    def check(self, world):
        self.changed(world.resource(Palette))

    def changed(self, palette):
        """The brush with the number changed; ValueError when it has none of that name or it is out of bounds."""
        brush = palette.brushes[palette.named(self.brush)]
        try:
            return brush.with_parameters(**{self.name: self.value})
        except ProblemsError as error:
            raise ValueError(str(error)) from None

    def apply(self, world):
        palette = world.resource(Palette)
        palette.add(self.changed(palette))


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e6


def evict(world, polygon):
    """Move animals whose bodies touch a new obstacle to the nearest free place.

    Raises
    ------
    ValueError
        When there is none nearby.  Nobody has moved then.
    """
    agents, land = world.agents, world.resource(Landscape)
    xyz, forward = agents[Position.xyz], agents[Heading.forward]
    half, radius = agents[Body.axis], agents[Body.radius]
    edges = np.hstack([polygon, np.roll(polygon, -1, axis=0)])
    trapped = inside_polygon(xyz, polygon) | touching(xyz, forward, half, radius, edges)
    if not trapped.any():
        return
    x, y, fx, fy = (np.ascontiguousarray(c) for c in (*xyz[:, :2].T, *forward[:, :2].T))
    walls = land.walls_within(2.0 * float((half + radius).max()))
    stands = ~trapped
    for row in np.flatnonzero(trapped):
        others = (np.ascontiguousarray(c[stands]) for c in (x, y, fx, fy, half, radius))
        found, x[row], y[row] = nearest_free(
            x[row], y[row], fx[row], fy[row], half[row], radius[row], *walls, ~land.walkable, land.cell,
            *outlines(land.solids), *map(float, land.bounds), *others,
        )  # fmt: skip
        _need(found, f"animal {agents.ids[row]} stands there, and has no room to step aside")
        stands[row] = True
    xyz[:, 0], xyz[:, 1] = x, y
