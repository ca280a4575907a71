"""Commands that paint the ground: brushes, caps and kinds of ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.components import Body, Heading, Position
from flockbrush.components.level_things import FAR
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.problems import did_you_mean
from flockbrush.systems.landscape import BARE, NATIVE, Landscape
from flockbrush.systems.painting import blended, cells_of, check_runs, connected, runs_of, stroke_cells, taken
from flockbrush.systems.palette import Palette
from flockbrush.systems.room import cell_under, move_to_free_places, on_map
from flockbrush.systems.selection import cells_within, check_brush, check_circle
from flockbrush.systems.spawning import touching
from flockbrush.systems.terrain import NO_BRUSH
from flockbrush.systems.undo import need

LAYERS = ("brush", "cap", "surface")
FASTEST = 1000.0  # m/s, as much as a level's cap may be
NATIVE_NAME = None  # of a surface: as the level was read
TOUCHING = 1e-6  # m: animals that lean on a wall are not in it


def painted(land, layer):
    """The raster of what is painted in a layer."""
    return {"brush": land.painted.brush, "cap": land.painted.cap, "surface": land.painted.ground}[layer]


def number_of(world, layer, value):
    """What a layer keeps for a value of a command; ValueError or LookupError with what there is."""
    need(layer in LAYERS, f"there is no layer {layer!r}{did_you_mean(str(layer), LAYERS)}")
    if layer == "cap":
        need(
            isinstance(value, (int, float)) and not isinstance(value, bool),
            f"a speed cap must be a number, got {value!r}",
        )
        need(value <= FASTEST, f"a speed cap must be at most {FASTEST:g} m/s, got {value:g}")
        return float(value) if value > 0 else np.inf
    if layer == "surface" and value is NATIVE_NAME:
        return NATIVE
    need(isinstance(value, str), f"a {layer} must be given by its name, got {value!r}")
    if layer == "brush":
        return world.resource(Palette).named(value, own=True) if value else NO_BRUSH
    names = [kind.name for kind in world.resource(Landscape).kinds]
    need(not value or value in names, f"there is no ground called {value!r}{did_you_mean(value, names)}")
    return names.index(value) if value else BARE


def value_of(world, layer, number):
    """The value of a command for what a layer keeps."""
    if layer == "cap":
        return 0.0 if np.isinf(number) else float(number)
    if number < 0:
        return NATIVE_NAME if layer == "surface" and number == NATIVE else ""
    assets = world.resource(Palette).brushes if layer == "brush" else world.resource(Landscape).kinds
    return assets[number].name


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
            move_to_free_places(world, in_walls(world))
        except ValueError:
            land.lay_ground(iy, ix, before[0])
            land.rebuild(navigation=False)
            raise
    if walls or (land.cost[iy, ix] != before[3]).any() or land.stale is not None:
        land.navigate_later(world.resource(Clock).tick)


def in_walls(world):
    """(n,) bool, animals with a body on impassable ground, or that touches a solid edge."""
    agents, land = world.agents, world.resource(Landscape)
    xyz = agents[Position.xyz]
    iy, ix = cell_under(land, xyz)
    inside = ~land.walkable[iy, ix] & on_map(land, xyz)
    half, radius = agents[Body.axis], agents[Body.radius]
    thin = np.maximum(radius - TOUCHING, 0.0)
    return inside | touching(xyz, agents[Heading.forward], half, thin, np.ascontiguousarray(land.solid.ends))


class TouchedCells(NamedTuple):
    """Cells of a painted layer."""

    layer: str
    iy: np.ndarray
    ix: np.ndarray

    def taken(self, world):
        land = world.resource(Landscape)
        now = painted(land, self.layer)
        return land.ground_of(self.iy, self.ix) if self.layer == "surface" else now[self.iy, self.ix]

    def back(self, world, taken):
        changed = self.taken(world) != taken
        if not changed.any():
            return []
        numbers, index = np.unique(taken[changed], return_inverse=True)
        names = [value_of(world, self.layer, number) for number in numbers.tolist()]
        return [PaintCells(self.layer, names, runs_of(self.iy[changed], self.ix[changed], index.ravel()))]


class OnCells:
    """A command that paints cells of a layer."""

    needs_fields = tuple[str, ...](["layer: str"])

    def where(self, world):
        """(iy, ix, ...) of the cells."""
        raise NotImplementedError

    def ground_box(self, world):
        return box_of_cells(world.resource(Landscape), *self.where(world)[:2])

    def touches(self, world):
        return [TouchedCells(self.layer, *self.where(world)[:2])]


@command
class PaintCells(OnCells):
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

    def where(self, world):
        return cells_of(self.runs)

    def apply(self, world):
        iy, ix, index = self.where(world)
        numbers = np.array([number_of(world, self.layer, value) for value in self.names] or [0])
        lay(world, self.layer, iy, ix, numbers[index])


class OnDisc(OnCells):
    """A command that paints the cells of a circle."""

    needs_fields = "layer: str", "x: float", "y: float", "radius: float"

    def check(self, world):
        check_circle(self)

    def where(self, world):
        return cells_within(world.resource(Landscape), self.x, self.y, self.radius)


@command
class PaintBrush(OnDisc):
    """Paint behaviour on the ground; an empty name erases."""

    layer = "brush"
    brush: str
    x: float
    y: float
    radius: float

    def check(self, world):
        if self.brush:
            check_brush(world, self.brush)
        check_circle(self)

    def apply(self, world):
        lay(world, self.layer, *self.where(world), number_of(world, self.layer, self.brush))


@command
class PaintCap(OnDisc):
    """Paint a maximum speed on the ground, metres per second; 0 or less erases."""

    layer = "cap"
    max_speed: float
    x: float
    y: float
    radius: float

    def apply(self, world):
        lay(world, self.layer, *self.where(world), self.max_speed if self.max_speed > 0 else np.inf)


def box_of_cells(land, iy, ix):
    """(west, south, east, north) m, around cells; None for no cells."""
    if not len(iy):
        return None
    low, high = (ix.min(), iy.min()), (ix.max() + 1, iy.max() + 1)
    return tuple(float(k * land.cell) for k in (*low, *high))


@command
class Paint(OnCells):
    """One piece of a stroke: all cells within a radius of the segment from (x, y) to (to_x, to_y).

    The layer is "brush" (the value a name, "" erases), "cap" (m/s, 0 erases) or "surface" (a kind of ground, ""
    bare).  Towards the rim a soft stroke takes fewer cells, the same ones however often it passes; caps blend.
    """

    layer: str
    value: str | float
    x: float
    y: float
    to_x: float
    to_y: float
    radius: float
    softness: float = 0.0

    def check(self, world):
        land = world.resource(Landscape)
        number_of(world, self.layer, self.value)
        need(0 <= self.radius <= FAR, f"radius must be 0 to {FAR:g} m, got {self.radius:g}")
        need(0 <= self.softness <= 1, f"softness must be 0 to 1, got {self.softness:g}")
        near = all(abs(v) <= FAR for v in (self.x, self.y, self.to_x, self.to_y))
        need(near and len(self.where(world)[0]), off_the_map(land, "the stroke"))

    def cells(self, shape, cell, wraps=False):
        """(iy, ix, weight) of the cells it changes, on a map of this shape."""
        ends = (self.x, self.y), (self.to_x, self.to_y)
        iy, ix, weight = stroke_cells(*ends, self.radius, self.softness, shape, cell, wraps)
        if self.layer == "cap":
            return iy, ix, weight
        if self.softness > 0:
            kept_cells = taken(iy, ix, weight)
            kept_cells |= len(kept_cells) == 1
            iy, ix, weight = iy[kept_cells], ix[kept_cells], weight[kept_cells]
        return iy, ix, weight

    def where(self, world):
        land = world.resource(Landscape)
        return self.cells(land.brush.shape, land.cell, land.wrap is not None)

    def apply(self, world):
        iy, ix, weight = self.where(world)
        number = number_of(world, self.layer, self.value)
        if self.layer == "cap":
            number = blended(world.resource(Landscape).painted.cap[iy, ix], number, weight)
        lay(world, self.layer, iy, ix, number)


def off_the_map(land, what):
    return f"{what} is not on the map, which is {land.width:g} x {land.height:g} m"


def pick(world, layer, x, y):
    """What is painted at a place: the value that `Paint` takes, "" or 0 for nothing and off the map."""
    land = world.resource(Landscape)
    ix, iy = int(np.floor(x / land.cell)), int(np.floor(y / land.cell))
    raster = land.kind_at if layer == "surface" else painted(land, layer)
    if not (0 <= iy < raster.shape[0] and 0 <= ix < raster.shape[1]):
        return 0.0 if layer == "cap" else ""
    return value_of(world, layer, raster[iy, ix].item())


def region(world, layer, x, y):
    """(ny, nx) bool: the connected cells that are painted as the one at this place; ValueError off the map."""
    land = world.resource(Landscape)
    number_of(world, layer, 0.0 if layer == "cap" else "")
    ix, iy = int(np.floor(x / land.cell)), int(np.floor(y / land.cell))
    inside = 0 <= iy < land.brush.shape[0] and 0 <= ix < land.brush.shape[1]
    need(inside, off_the_map(land, f"({x:g}, {y:g})"))
    return connected(land.kind_at if layer == "surface" else painted(land, layer), iy, ix, land.wrap is not None)


def fill(world, layer, x, y, value):
    """The command that paints the whole region around a place, also with a brush that the world does not know yet."""
    iy, ix = np.nonzero(region(world, layer, x, y))
    return PaintCells(layer, [value], runs_of(iy, ix, np.zeros(len(iy), int)))
