"""Everything that may be done to a running world from outside: mouse, level script, tests and replay submit these."""

from __future__ import annotations

import numpy as np
from flockbrush.components import Body, BrushBinding, Destination, Heading, Migration, Position, Species
from flockbrush.components.agent import DIRECTION, NOWHERE, POINT
from flockbrush.engine.clock import Clock
from flockbrush.engine.columns import Component
from flockbrush.engine.commands import Commands, command
from flockbrush.engine.maths import sincos_
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.solids import polyhedron
from flockbrush.systems.binding import can_do, cannot
from flockbrush.systems.landscape import BARE, NATIVE, SHAPES, Barrier, Glide, Landscape
from flockbrush.systems.painting import cells_of, check_runs, runs_of
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList, give_birth
from flockbrush.systems.programs import Programs, born_into
from flockbrush.systems.spawning import inside_polygon, touching
from flockbrush.systems.terrain import NO_BRUSH
from flockbrush.systems.undo import (
    RemoveEntities,
    UseBrush,
    bring_back,
    brushes_of,
    cell_under,
    columns_now,
    goal_index,
    goals_of,
    make_room,
    need,
    on_map,
    place_of,
)


class ApplyCommands(System):
    """Apply what is due."""

    stage, reads, writes = Stage.COMMANDS, (Clock,), (Commands, Landscape, Palette, Component)

    def process(self, world):
        world.resource(Commands).apply(world)
        if world.has(Landscape):
            land, clock = world.resource(Landscape), world.resource(Clock)
            for glide in list(land.glides):
                _advance(world, land, glide, clock)
            land.settle(clock.tick)


MOST = 1_000_000  # animals, as many as a level may have
CORNERS = 2_000  # of one obstacle, as many as a level may have
MOST_CORNERS = 32  # of a hull


def disc(x, y, radius, sides=32):
    """A round brush stroke as a polygon, (sides, 2) m."""
    turned = np.array([sincos_(2.0 * np.pi * k / sides) for k in range(sides)])
    return np.column_stack([x + radius * turned[:, 1], y + radius * turned[:, 0]])


def _check_circle(command):
    need(command.radius >= 0, f"radius must be at least 0 m, got {command.radius:g}")


def _check_species(world, name):
    names = world.resource(SpeciesList).names
    if name and name not in names:
        raise LookupError(f"there is no species {name!r}{did_you_mean(name, names)}")


def _check_brush(world, name):
    world.resource(Palette).named(name)


def _check_can(world, brush, species):
    """ValueError when a species is named that cannot move as a brush does."""
    why = cannot(world.resource(Palette), world.resource(SpeciesList), brush, species)
    need(not why, why)


def species_of(world, row):
    """Name of the species of one animal."""
    return world.resource(SpeciesList).names[int(world.agents[Species.index][row])]


def able(world, brush):
    """(n,) bool: the animals that can move as a brush does."""
    palette, fauna = world.resource(Palette), world.resource(SpeciesList)
    return can_do(palette, fauna.table)[palette.named(brush)][world.agents[Species.index]]


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
        _check_species(world, species)
        chosen &= world.agents[Species.index] == world.resource(SpeciesList).names.index(species)
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
        _check_can(world, self.brush, self.species)
        _check_circle(self)

    def inverse(self, world):
        _check_circle(self)
        return brushes_of(world, np.flatnonzero(_selected(world, self.x, self.y, self.radius, self.species)))

    def apply(self, world):
        self.check(world)
        chosen = _selected(world, self.x, self.y, self.radius, self.species)
        can = able(world, self.brush)
        if chosen.any() and not (chosen & can).any():
            _check_can(world, self.brush, species_of(world, int(np.flatnonzero(chosen)[0])))
        chosen &= can
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
    z_min: float | None = None  # m above the ground; animals on the ground pass below what begins higher
    z_max: float | None = None  # m above the ground
    shape: str | None = None  # how it stands up from its outline: box, cylinder, sphere, plane or hull
    corners: list | None = None  # of a hull: [east, north, up] in m from the middle of its foot

    def check(self, world):
        land, (west, south, east, north) = world.resource(Landscape), box_of(self.polygon())
        off = east < 0 or north < 0 or west > land.width or south > land.height
        need(not off, f"the obstacle is not on the map, which is {land.width:g} x {land.height:g} m")
        need(self.id >= 0, f"id must be at least 0, got {self.id}")
        need(0 <= self.margin <= 1000, f"margin must be 0 to 1000 m, got {self.margin:g}")
        low, high, shape, corners = self.stand(land)
        others = land.barriers if low > 0 else land.overhead
        need(by_id(others, self.id) is None, "an obstacle is raised or set down by MoveObstacle")
        need(shape in SHAPES, f"shape must be one of {', '.join(SHAPES)}{did_you_mean(shape, SHAPES)}")
        need(low < high, f"z_min must be below z_max, got {low:g} and {high:g} m")
        need(shape != "hull" or corners is not None, "a hull needs corners, [[east, north, up], ...] in m")
        check_corners(corners)

    def stand(self, land):
        """(z_min, z_max, shape, corners); what is not told is as it was, or from the ground up."""
        there = next((b for b in (*land.barriers, *land.overhead) if self.id and b.id == self.id), None)
        usual = (0.0, 1000.0, "box", None)
        if there is not None:
            usual = there.z_min, there.z_max, there.shape, there.corners
        told = self.z_min, self.z_max, self.shape, self.corners
        return tuple(b if a is None else a for a, b in zip(told, usual, strict=True))

    def polygon(self):
        """(k, 2) m, counter-clockwise; ValueError when the points are none."""
        return polygon_of(self.points, "an obstacle")

    def ground_box(self, world):
        things, mine = self._things(world.resource(Landscape)), box_of(self.polygon())
        there = by_id(things, self.id)
        return mine if there is None else around(mine, box_of(things[there].polygon))

    def inverse(self, world):
        things = self._things(world.resource(Landscape))
        there = by_id(things, self.id)
        if there is not None:
            return [again(things[there], there)]
        at = self.at if 0 <= self.at < len(things) else len(things)
        return [RemoveObstacle(self.name, self.id, at, things is world.resource(Landscape).overhead)]

    def _things(self, land):
        """The list of obstacles that it belongs to."""
        return land.overhead if self.stand(land)[0] > 0 else land.barriers

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        *heights, shape, corners = self.stand(land)
        corners = np.array(corners, float) if shape == "hull" else None
        stands = self.name, self.margin, self.id, *heights, shape, corners
        barrier = Barrier(self.polygon(), self.solid, self.blocks_view, *stands)
        things = self._things(land)
        before, there = list(things), by_id(things, self.id)
        if there is not None:
            things[there] = barrier
        else:
            things.insert(self.at if 0 <= self.at < len(things) else len(things), barrier)
        land.rebuild(navigation=False)
        try:
            if self.solid and land.on_the_ground(barrier):
                evict(world, barrier.polygon)
        except ValueError:
            things[:] = before
            land.rebuild(navigation=False)
            raise
        land.navigate_later(world.resource(Clock).tick)


def check_corners(corners):
    """ValueError unless these are the corners of a solid, (k, 3), or None."""
    if corners is None:
        return
    told = np.array(corners, object)
    fits = told.ndim == 2 and told.shape[1] == 3 and all(_is_number(value) for value in told.ravel())
    need(fits, "corners must be [[east, north, up], ...] in m")
    need(len(told) <= MOST_CORNERS, f"a hull has at most {MOST_CORNERS} corners, got {len(told)}")
    polyhedron(told.astype(float))


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


def again(b, at):
    """The command that puts an obstacle down as it stands now, at this place in the order."""
    corners = None if b.corners is None else b.corners.tolist()
    stands = b.solid, b.blocks_view, b.id, b.margin, at, b.z_min, b.z_max, b.shape, corners
    return AddObstacle(b.name, b.polygon.tolist(), *stands)


@command
class RemoveObstacle:
    """Take an obstacle away by its id, or all of a name."""

    name: str = ""
    id: int = 0
    at: int = -1  # of several of a name only the one at this place in the order
    overhead: bool = False  # `at` counts those above the ground

    def gone(self, world):
        """(those on the ground, those above it), indices of the obstacles that go; ValueError when there are none."""
        land = world.resource(Landscape)
        lists = land.barriers, land.overhead
        if self.id:
            found = [[k for k, b in enumerate(things) if b.id == self.id][:1] for things in lists]
            need(any(found), f"there is no obstacle {self.id} in this world")
            return found
        names = [b.name for things in lists for b in things]
        need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        found = [[k for k, b in enumerate(things) if b.name == self.name] for things in lists]
        if self.at in found[self.overhead]:
            found = [[], [self.at]] if self.overhead else [[self.at], []]
        return found

    def ground_box(self, world):
        return around(*(box_of(things[k].polygon) for things, k in self._pairs(world)))

    def inverse(self, world):
        return [again(things[k], k) for things, k in self._pairs(world)]

    def _pairs(self, world):
        land = world.resource(Landscape)
        lists = zip((land.barriers, land.overhead), self.gone(world), strict=True)
        return [(things, k) for things, gone in lists for k in gone]

    def apply(self, world):
        land = world.resource(Landscape)
        ground, above = self.gone(world)
        land.barriers = [b for k, b in enumerate(land.barriers) if k not in ground]
        land.overhead = [b for k, b in enumerate(land.overhead) if k not in above]
        land.rebuild(navigation=False)
        land.navigate_later(world.resource(Clock).tick)


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
        need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")

    def inverse(self, world):
        self.check(world)
        land = world.resource(Landscape)
        stand = [[b.polygon.tolist(), b.z_min, b.z_max] for b in land.find(self.name)]
        return [StandObstacle(self.name, stand, [[g.by.tolist(), g.left] for g in land.glides if g.name == self.name])]

    def ground_box(self, world):
        return "all"

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        middle = land.find(self.name)[0].polygon.mean(0)
        by = np.array([self.x - middle[0], self.y - middle[1], self.rise])
        land.glides = [glide for glide in land.glides if glide.name != self.name]
        land.glides.append(Glide(self.name, by, self.seconds))
        land.changed()


@command
class StandObstacle:
    """Put the obstacles of a name exactly here, as they were before they were moved."""

    name: str
    stand: list  # of each: its points, z_min and z_max
    glides: list  # of each glide that goes on: (3,) m still to go, s left

    def check(self, world):
        count = len(world.resource(Landscape).find(self.name))
        need(count, f"there is no obstacle {self.name!r}")
        need(count == len(self.stand), f"there are {count} obstacles {self.name!r} now, and {len(self.stand)} are told")
        try:
            for points, low, high in self.stand:
                polygon_of(points, "an obstacle")
                need(float(low) < float(high), "z_min must be below z_max")
            told = [(np.array(by, float).shape == (3,) and float(left) >= 0) for by, left in self.glides]
        except TypeError:
            told = [False]
        need(all(told), "stand holds [points, z_min, z_max], glides [[x, y, z], seconds]")

    def inverse(self, world):
        return MoveObstacle(self.name, 0.0, 0.0).inverse(world)

    def ground_box(self, world):
        return "all"

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        barriers = land.find(self.name)
        before = [(b.polygon, b.z_min, b.z_max) for b in barriers]
        for b, (points, low, high) in zip(barriers, self.stand, strict=True):
            b.polygon, b.z_min, b.z_max = np.array(points, float), low, high
        land.rebuild(navigation=False)
        try:
            for b in barriers:
                if b.solid and land.on_the_ground(b):
                    evict(world, b.polygon)
        except ValueError:
            for b, (points, low, high) in zip(barriers, before, strict=True):
                b.polygon, b.z_min, b.z_max = points, low, high
            land.rebuild(navigation=False)
            raise
        land.glides = [glide for glide in land.glides if glide.name != self.name]
        land.glides += [Glide(self.name, np.array(by, float), left) for by, left in self.glides]
        land.changed()
        land.navigate_later(world.resource(Clock).tick)


def _advance(world, land, glide, clock):
    """One tick of an obstacle on its way."""
    barriers = land.find(glide.name)
    share = 1.0 if glide.left <= clock.dt else clock.dt / glide.left
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
    glide.by, glide.left = glide.by - step, glide.left - clock.dt
    if share == 1.0 or not barriers:
        land.glides.remove(glide)
    land.changed()
    if any(land.on_the_ground(b) for b in barriers):
        land.navigate_later(clock.tick)


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
        need(self.kind in kinds, f"kind must be one of {', '.join(kinds)}{did_you_mean(self.kind, kinds)}")
        need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")
        need(self.kind != "direction" or self.x or self.y or self.z, "a direction must not be (0, 0, 0)")
        _check_circle(self)
        _check_species(world, self.species)

    def _chosen(self, world):
        return _selected(world, self.at_x, self.at_y, self.radius, self.species)

    def inverse(self, world):
        self.check(world)
        columns = [Migration.kind, Migration.target, Migration.next, Migration.left]
        return columns_now(world, np.flatnonzero(self._chosen(world)), columns)

    def apply(self, world):
        self.check(world)
        agents, chosen = world.agents, self._chosen(world)
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
    program: str = ""  # that they follow; "": none

    def check(self, world):
        _check_brush(world, self.brush)
        if self.program:
            world.resource(Programs).named(self.program)
        fauna = world.resource(SpeciesList)
        named = SpeciesList([self.species], fauna.library)  # it may be new to this world
        why = cannot(world.resource(Palette), named, self.brush, self.species)
        need(not why, why)
        need(self.radius > 0, f"radius must be above 0 m, got {self.radius:g}")
        need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")

    def inverse(self, world):
        need(1 <= self.count <= MOST, f"count must be 1 to {MOST}, got {self.count}")
        return [RemoveEntities(list(range(world.next_entity, world.next_entity + self.count)))]

    def apply(self, world):
        self.check(world)
        total = len(world.agents) + self.count
        need(total <= MOST, f"there may be at most {MOST} animals, and this would make {total}")
        born = give_birth(
            world, disc(self.x, self.y, self.radius), self.count, self.brush, self.species, self.heading,
            stream=f"add {world.next_entity}",  # two strokes in one tick are two
        )  # fmt: skip
        born_into(world, born, self.program)


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
