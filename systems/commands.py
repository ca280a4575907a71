"""Everything that may be done to a running world from outside: mouse, level script, tests and replay submit these."""

from __future__ import annotations

import numpy as np

from behaviours.problems import ProblemsError, did_you_mean
from components import Body, BrushBinding, Destination, Heading, Position, Species
from engine.clock import Clock
from engine.columns import Component
from engine.commands import Commands, command
from engine.maths import sincos_
from engine.schedule import Stage, System
from systems.landscape import BARE, NATIVE, Barrier, Landscape
from systems.painting import cells_of, check_runs, runs_of
from systems.palette import Palette
from systems.population import SpeciesList, give_birth
from systems.spawning import inside_polygon, touching
from systems.taking_back import (
    RemoveEntities,
    UseBrush,
    bring_back,
    brushes_of,
    cell_under,
    goal_index,
    goals_of,
    make_room,
    need,
    on_map,
    place_of,
)
from systems.terrain import NO_BRUSH


class ApplyCommands(System):
    """Apply what is due."""

    stage, reads, writes = Stage.COMMANDS, (Clock,), (Commands, Landscape, Palette, Component)

    def process(self, world):
        world.resource(Commands).apply(world)
        if world.has(Landscape):
            world.resource(Landscape).settle(world.resource(Clock).tick)


MOST = 1_000_000  # animals, as many as a level may have
CORNERS = 2_000  # of one obstacle, as many as a level may have


def disc(x, y, radius, sides=32):
    """A round brush stroke as a polygon, (sides, 2) m."""
    turned = np.array([sincos_(2.0 * np.pi * k / sides) for k in range(sides)])
    return np.column_stack([x + radius * turned[:, 1], y + radius * turned[:, 0]])


def _check_circle(command):
    need(command.radius >= 0, f"radius must be at least 0 m, got {command.radius:g}")


def _check_brush(world, name):
    world.resource(Palette).named(name)


def _cells_within(land, x, y, radius):
    """(iy, ix) of the cells whose centres lie in a circle."""
    c = land.cell
    ny, nx = land.brush.shape
    x0, x1 = max(0, int((x - radius) / c)), min(nx, int((x + radius) / c) + 1)
    y0, y1 = max(0, int((y - radius) / c)), min(ny, int((y + radius) / c) + 1)
    cx, cy = (np.arange(x0, x1) + 0.5) * c - x, (np.arange(y0, y1) + 0.5) * c - y
    iy, ix = np.nonzero(cy[:, None] ** 2 + cx**2 <= radius**2)
    return iy + y0, ix + x0


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


LAYERS = ("brush", "cap", "surface")
FASTEST = 1000.0  # m/s, as much as a level's cap may be
NATIVE_NAME = None  # of a surface: as the level was read


def painted(land, layer):
    """The raster of what is painted in a layer."""
    return {"brush": land.painted.brush, "cap": land.painted.cap, "surface": land.painted.ground}[layer]


def number_of(world, layer, value):
    """What a layer keeps for a value of a command; ValueError or LookupError with what there is."""
    need(layer in LAYERS, f"there is no layer {layer!r}{did_you_mean(str(layer), LAYERS)}")
    if layer == "cap":
        need(isinstance(value, (int, float)) and not isinstance(value, bool), f"a cap is a number, got {value!r}")
        need(value <= FASTEST, f"a cap is at most {FASTEST:g} m/s, got {value:g}")
        return float(value) if value > 0 else np.inf
    if layer == "surface" and value is NATIVE_NAME:
        return NATIVE
    need(isinstance(value, str), f"a {layer} is painted by its name, got {value!r}")
    if layer == "brush":
        return world.resource(Palette).named(value) if value else NO_BRUSH
    names = [kind.name for kind in world.resource(Landscape).kinds]
    need(not value or value in names, f"there is no ground called {value!r}{did_you_mean(value, names)}")
    return names.index(value) if value else BARE


def value_of(world, layer, number):
    """The value of a command for what a layer keeps."""
    if layer == "cap":
        return 0.0 if np.isinf(number) else float(number)
    if number < 0:
        return NATIVE_NAME if layer == "surface" and number == NATIVE else ""
    named = world.resource(Palette).brushes if layer == "brush" else world.resource(Landscape).kinds
    return named[number].name


def lay(world, layer, iy, ix, numbers):
    """Paint numbers on cells; animals that can no longer stand there step aside, and nobody is left in a wall.

    Raises
    ------
    ValueError
        When somebody has no room to step aside.  The world is as it was then.
    """
    land = world.resource(Landscape)
    if layer == "brush":
        land.lay_brush(iy, ix, numbers)
    elif layer == "cap":
        land.lay_cap(iy, ix, numbers)
    else:
        _lay_ground(world, land, iy, ix, numbers)


def _lay_ground(world, land, iy, ix, kinds):
    before = [a[iy, ix].copy() for a in (land.painted.ground, land.walkable, land.blind, land.cost)]
    land.lay_ground(iy, ix, kinds)
    walls = (land.walkable[iy, ix] != before[1]).any()
    if walls or (land.blind[iy, ix] != before[2]).any():
        land.rebuild(navigation=False)
    if (before[1] & ~land.walkable[iy, ix]).any():
        try:
            make_room(world, in_walls(world))
        except ValueError:
            land.lay_ground(iy, ix, before[0])
            land.rebuild(navigation=False)
            raise
    if walls or (land.cost[iy, ix] != before[3]).any() or land.stale is not None:
        land.navigate_later(world.resource(Clock).tick)


def in_walls(world):
    """(n,) bool, whose body is on ground that nobody can walk, or touches an edge of something solid."""
    agents, land = world.agents, world.resource(Landscape)
    xyz = agents[Position.xyz]
    iy, ix = cell_under(land, xyz)
    inside = ~land.walkable[iy, ix] & on_map(land, xyz)
    half, radius = agents[Body.axis], agents[Body.radius]
    thin = np.maximum(radius - TOUCHING, 0.0)
    return inside | touching(xyz, agents[Heading.forward], half, thin, np.ascontiguousarray(land.solid.ends))


TOUCHING = 1e-6  # m: who leans on a wall is not in it


@command
class PaintCells:
    """Paint exactly these cells: a region filled, or a stroke taken back.

    ``runs`` are ``[row, column, length, index in names]``, row 0 in the south; ``names`` are brushes ("" unpainted),
    caps in m/s (0 none) or kinds of ground ("" bare, null as the level was read).
    """

    layer: str
    names: list
    runs: list

    def check(self, world):
        for value in self.names:
            number_of(world, self.layer, value)
        need(self.layer in LAYERS, f"there is no layer {self.layer!r}{did_you_mean(self.layer, LAYERS)}")
        check_runs(self.runs, self.names, world.resource(Landscape).brush.shape)

    def ground_box(self, world):
        return box_of_cells(world.resource(Landscape), *cells_of(self.runs)[:2])

    def inverse(self, world):
        self.check(world)
        iy, ix, _ = cells_of(self.runs)
        return cells_now(world, self.layer, iy, ix)

    def apply(self, world):
        self.check(world)
        iy, ix, index = cells_of(self.runs)
        numbers = np.array([number_of(world, self.layer, value) for value in self.names] or [0])
        lay(world, self.layer, iy, ix, numbers[index])


def cells_now(world, layer, iy, ix):
    """The command that paints cells as they are now, in a list; none for no cells."""
    if not len(iy):
        return []
    land = world.resource(Landscape)
    now = land.ground_of(iy, ix) if layer == "surface" else painted(land, layer)[iy, ix]
    numbers, index = np.unique(now, return_inverse=True)
    names = [value_of(world, layer, number) for number in numbers.tolist()]
    return [PaintCells(layer, names, runs_of(iy, ix, index.ravel()))]


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

    def inverse(self, world):
        _check_circle(self)
        return brushes_of(world, np.flatnonzero(_selected(world, self.x, self.y, self.radius, self.species)))

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

    def ground_box(self, world):
        return self.x - self.radius, self.y - self.radius, self.x + self.radius, self.y + self.radius

    def inverse(self, world):
        self.check(world)
        return cells_now(world, "brush", *_cells_within(world.resource(Landscape), self.x, self.y, self.radius))

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        index = world.resource(Palette).named(self.brush) if self.brush else NO_BRUSH
        land.lay_brush(*_cells_within(land, self.x, self.y, self.radius), index)


@command
class PaintCap:
    """Paint a maximum speed on the ground, metres per second; 0 or less erases."""

    max_speed: float
    x: float
    y: float
    radius: float

    def check(self, world):
        _check_circle(self)

    def ground_box(self, world):
        return self.x - self.radius, self.y - self.radius, self.x + self.radius, self.y + self.radius

    def inverse(self, world):
        self.check(world)
        return cells_now(world, "cap", *_cells_within(world.resource(Landscape), self.x, self.y, self.radius))

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        cells = _cells_within(land, self.x, self.y, self.radius)
        land.lay_cap(*cells, self.max_speed if self.max_speed > 0 else np.inf)


def polygon_of(points, what):
    """(k, 2) m, counter-clockwise; ValueError when the points are none."""
    corners = line_of(points)
    need(3 <= len(corners) <= CORNERS, f"{what} has 3 to {CORNERS} points, got {len(corners)}")
    x, y = corners.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    need(area != 0, "the points lie in one line")
    return corners if area > 0 else np.ascontiguousarray(corners[::-1])


def line_of(points):
    """(k, 2) m; ValueError when the points are no pairs of numbers."""
    rows = [p for p in points if isinstance(p, list) and len(p) == 2 and all(map(_is_number, p))]
    need(len(rows) == len(points), "points must be pairs of numbers, [[x, y], [x, y], ...]")
    return np.array(rows, float).reshape(-1, 2)


@command
class AddObstacle:
    """Put an obstacle down; animals on the spot are moved to the nearest free place.

    One with the ``id`` of an object in the level file takes the place of the one that has it.
    """

    name: str
    points: list
    solid: bool = True
    blocks_view: bool = True
    id: int = 0  # of the object in the level file; 0: it is in none
    margin: float = 0.0  # m, kept free around it by those who follow a field
    at: int = -1  # where in the order of obstacles; -1: behind all others

    def check(self, world):
        land, (west, south, east, north) = world.resource(Landscape), box_of(self.polygon())
        off = east < 0 or north < 0 or west > land.width or south > land.height
        need(not off, f"the obstacle is not on the map, which is {land.width:g} x {land.height:g} m")
        need(self.id >= 0, f"id must be at least 0, got {self.id}")
        need(0 <= self.margin <= 1000, f"margin must be 0 to 1000 m, got {self.margin:g}")

    def polygon(self):
        """(k, 2) m, counter-clockwise; ValueError when the points are none."""
        return polygon_of(self.points, "an obstacle")

    def ground_box(self, world):
        barriers, mine = world.resource(Landscape).barriers, box_of(self.polygon())
        there = by_id(barriers, self.id)
        return mine if there is None else around(mine, box_of(barriers[there].polygon))

    def inverse(self, world):
        barriers = world.resource(Landscape).barriers
        there = by_id(barriers, self.id)
        if there is not None:
            return [_again(barriers, there)]
        at = self.at if 0 <= self.at < len(barriers) else len(barriers)
        return [RemoveObstacle(self.name, self.id, at)]

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        barrier = Barrier(self.polygon(), self.solid, self.blocks_view, self.name, self.margin, self.id)
        before, there = list(land.barriers), by_id(land.barriers, self.id)
        if there is not None:
            land.barriers[there] = barrier
        else:
            land.barriers.insert(self.at if 0 <= self.at < len(land.barriers) else len(land.barriers), barrier)
        land.rebuild(navigation=False)
        try:
            if self.solid:
                evict(world, barrier.polygon)
        except ValueError:
            land.barriers = before
            land.rebuild(navigation=False)
            raise
        land.navigate_later(world.resource(Clock).tick)


def box_of(points):
    """(west, south, east, north) m, around points (k, 2)."""
    return (*points.min(0).tolist(), *points.max(0).tolist())


def around(*boxes):
    """The box around boxes."""
    sides = np.array(boxes)
    return (*sides[:, :2].min(0).tolist(), *sides[:, 2:].max(0).tolist())


def box_of_cells(land, iy, ix):
    """(west, south, east, north) m, around cells; None for no cells."""
    if not len(iy):
        return None
    low, high = (ix.min(), iy.min()), (ix.max() + 1, iy.max() + 1)
    return tuple(float(k * land.cell) for k in (*low, *high))


def by_id(things, number):
    """Index of the thing with the id of an object in the level file, or None; 0 is nobody's."""
    return next((k for k, thing in enumerate(things) if thing.id == number), None) if number else None


def _again(barriers, at):
    """The command that puts this obstacle down as it stands now."""
    b = barriers[at]
    return AddObstacle(b.name, b.polygon.tolist(), b.solid, b.blocks_view, b.id, b.margin, at)


@command
class RemoveObstacle:
    """Take an obstacle away by its id, or all of a name."""

    name: str = ""
    id: int = 0
    at: int = -1  # of several of a name only the one at this place in the order

    def gone(self, world):
        """Indices of the obstacles that go; ValueError when there are none."""
        barriers = world.resource(Landscape).barriers
        if self.id:
            there = by_id(barriers, self.id)
            need(there is not None, f"there is no obstacle {self.id} in this world")
            return [there]
        names = [b.name for b in barriers]
        need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        found = [k for k, name in enumerate(names) if name == self.name]
        return [self.at] if self.at in found else found

    def ground_box(self, world):
        barriers = world.resource(Landscape).barriers
        return around(*(box_of(barriers[k].polygon) for k in self.gone(world)))

    def inverse(self, world):
        barriers = world.resource(Landscape).barriers
        return [_again(barriers, k) for k in self.gone(world)]

    def apply(self, world):
        land, gone = world.resource(Landscape), self.gone(world)
        land.barriers = [b for k, b in enumerate(land.barriers) if k not in gone]
        land.rebuild(navigation=False)
        land.navigate_later(world.resource(Clock).tick)


@command
class MoveGoal:
    """Move a goal, by its name, to another place."""

    goal: str
    x: float
    y: float

    def check(self, world):
        land = world.resource(Landscape)
        goal_index(land, self.goal)
        inside = 0 <= self.x < land.width and 0 <= self.y < land.height
        need(inside, f"({self.x:g}, {self.y:g}) is not on the map, which is {land.width:g} x {land.height:g} m")

    def inverse(self, world):
        return [place_of(world.resource(Landscape), self.goal)]

    def ground_box(self, world):
        return "all"

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        goal = land.goals[goal_index(land, self.goal)]
        shift = np.array([self.x, self.y]) - goal.xy
        goal.xy = goal.xy + shift
        if goal.polygon is not None:
            goal.polygon = goal.polygon + shift
        land.navigate()


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
            goal_index(world.resource(Landscape), self.goal)
        _check_circle(self)

    def inverse(self, world):
        _check_circle(self)
        return goals_of(world, np.flatnonzero(_selected(world, self.x, self.y, self.radius, self.species)))

    def apply(self, world):
        self.check(world)
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        goal = goal_index(world.resource(Landscape), self.goal) if self.goal else -1
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
        need(self.radius > 0, f"radius must be above 0 m, got {self.radius:g}")
        need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")

    def inverse(self, world):
        need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")
        return [RemoveEntities(list(range(world.next_entity, world.next_entity + self.count)))]

    def apply(self, world):
        self.check(world)
        total = len(world.agents) + self.count
        need(total <= MOST, f"there may be at most {MOST} animals, and this would make {total}")
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

    def inverse(self, world):
        _check_circle(self)
        return bring_back(world, world.agents.ids[_selected(world, self.x, self.y, self.radius, self.species)])

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

    def inverse(self, world):
        palette = world.resource(Palette)
        return [UseBrush(self.brush, palette.brushes[palette.named(self.brush)].source.decode())]

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
    agents = world.agents
    xyz = agents[Position.xyz]
    edges = np.hstack([polygon, np.roll(polygon, -1, axis=0)])
    touched = touching(xyz, agents[Heading.forward], agents[Body.axis], agents[Body.radius], edges)
    make_room(world, inside_polygon(xyz, polygon) | touched)
