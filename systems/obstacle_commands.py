"""Commands that put obstacles down, move them and take them away."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from flockbrush.components import Body, Heading, Position
from flockbrush.components.level_things import Obstacle
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.problems import did_you_mean
from flockbrush.engine.seam import images
from flockbrush.engine.solids import polyhedron
from flockbrush.systems.ground_edges import solid_images
from flockbrush.systems.landscape import SHAPES, Glide, Landscape
from flockbrush.systems.level_lists import KINDS, ThingKind, TouchedThings
from flockbrush.systems.room import in_the_air, move_to_free_places
from flockbrush.systems.spawning import inside_polygon, touching
from flockbrush.systems.undo import need

CORNERS = 2_000  # of one obstacle, as many as a level may have
MOST_CORNERS = 32  # of a hull


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

    as_it_stands = ({"points": None}, {"z_min": None, "z_max": None}, {"shape": None, "corners": None})
    name: str
    points: list | None  # None: as the one with its id stands
    solid: bool = True
    blocks_view: bool = True
    id: int = 0  # of the object in the level file; 0: it is in none
    margin: float = 0.0  # m, kept free around it by animals that follow a field
    at: int = -1  # where in the order of obstacles; -1: behind all others
    z_min: float | None = None  # m above the ground; animals on the ground pass below what begins higher
    z_max: float | None = None  # m above the ground
    shape: str | None = None  # how it stands up from its outline: box, cylinder, sphere, plane or hull
    corners: list | None = None  # of a hull: [east, north, up] in m from the middle of its foot

    def check(self, world):
        land = world.resource(Landscape)
        polygon = self.polygon(land)
        on_the_map(land, polygon)
        for glide in self.ways(land):
            on_the_map(land, polygon + glide.by[:2])
        need(self.id >= 0, f"id must be at least 0, got {self.id}")
        need(0 <= self.margin <= 1000, f"margin must be 0 to 1000 m, got {self.margin:g}")
        low, high, shape, corners = self.stand(land)
        need(shape in SHAPES, f"shape must be one of {', '.join(SHAPES)}{did_you_mean(shape, SHAPES)}")
        need(low < high, f"z_min must be below z_max, got {low:g} and {high:g} m")
        need(shape != "hull" or corners is not None, "a hull needs corners, [[east, north, up], ...] in m")
        check_corners(corners)

    def stand(self, land):
        """(z_min, z_max, shape, corners); what is not told is as it was, or from the ground up."""
        index, usual = by_id(land.obstacles, self.id), (0.0, 1000.0, "box", None)
        if index is not None:
            existing = land.obstacles[index]
            usual = existing.z_min, existing.z_max, existing.shape, existing.corners
        given = self.z_min, self.z_max, self.shape, self.corners
        return tuple(b if a is None else a for a, b in zip(given, usual, strict=True))

    def polygon(self, land):
        """(k, 2) m, counter-clockwise; ValueError when the points are none."""
        if self.points is not None:
            return polygon_of(self.points, "an obstacle")
        index = by_id(land.obstacles, self.id)
        need(index is not None, f"obstacle {self.name!r} needs points: there is no obstacle {self.id} in this world")
        return land.obstacles[index].polygon

    def name_before(self, land):
        """What the one with its id is called; its own name where there is none."""
        index = by_id(land.obstacles, self.id)
        return self.name if index is None else land.obstacles[index].name

    def ways(self, land):
        """The glides that it follows: those of its name or, if no obstacle has that name yet, of its former name."""
        name = self.name if land.find(self.name) else self.name_before(land)
        return [glide for glide in land.glides if glide.name == name]

    def ground_box(self, world):
        land = world.resource(Landscape)
        return box_of_thing(land, land.obstacles, self.id, self.polygon(land))

    def touches(self, world):
        land = world.resource(Landscape)
        joins = self.name_before(land) != self.name and land.find(self.name)
        return [TouchedThings("obstacle"), *(halted(land, [by_id(land.obstacles, self.id)]) if joins else [])]

    def foresee(self, world):
        """The obstacle, put among the others."""
        land = world.resource(Landscape)
        *stands, corners = self.stand(land)
        corners = np.array(corners, float) if stands[-1] == "hull" else None
        stops = self.polygon(land), self.solid, self.blocks_view, self.margin
        barrier = Obstacle(self.id, self.name, *stops, *stands, corners)
        put_thing(land.obstacles, barrier, self.at)
        return barrier

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        things, before, name_before = land.obstacles, list(land.obstacles), self.name_before(land)
        ways = [replace(glide, name=self.name) for glide in self.ways(land)]
        barrier = self.foresee(world)
        land.rebuild(navigation=False)
        try:
            if self.solid and barrier.on_the_ground:
                evict(world, barrier)
        except ValueError:
            things[:] = before
            land.rebuild(navigation=False)
            raise
        gone = {self.name} | ({name_before} if not land.find(name_before) else set())
        land.glides = [glide for glide in land.glides if glide.name not in gone]
        _set_off(land, ways)
        land.navigate_later(world.resource(Clock).tick)


def on_the_map(land, polygon):
    """ValueError unless a part of a polygon (k, 2) m is on the map."""
    west, south, east, north = box_of(polygon)
    off = east < 0 or north < 0 or west > land.width or south > land.height
    need(not off, f"the obstacle is not on the map, which is {land.width:g} x {land.height:g} m")


def check_corners(corners):
    """ValueError unless these are the corners of a solid, (k, 3), or None."""
    if corners is None:
        return
    rows = np.array(corners, object)
    fits = rows.ndim == 2 and rows.shape[1] == 3 and all(_is_number(value) for value in rows.ravel())
    need(fits, "corners must be [[east, north, up], ...] in m")
    need(len(rows) <= MOST_CORNERS, f"a hull has at most {MOST_CORNERS} corners, got {len(rows)}")
    polyhedron(rows.astype(float))


def box_of(points):
    """(west, south, east, north) m, around points (k, 2)."""
    return (*points.min(0).tolist(), *points.max(0).tolist())


def box_drawn(land, *polygons):
    """Where polygons (k, 2) m are drawn: the box around them, or "all" where one goes on at another border."""
    over = any(len(images(polygon, land.wrap)) > 1 for polygon in polygons)
    return "all" if over else box_of(np.concatenate(polygons))


def box_of_thing(land, things, number, polygon):
    """Where a thing is drawn that gets an outline, and where the one that has its id is."""
    index = by_id(things, number)
    return box_drawn(land, polygon, *([] if index is None else [things[index].polygon]))


def by_id(things, number):
    """Index of the thing with this id of the level file, or None; 0 is no id."""
    return next((k for k, thing in enumerate(things) if thing.id == number), None) if number else None


def put_thing(things, thing, at):
    """Put a thing in the place of the one with its id, or where it belongs in the order."""
    index = by_id(things, thing.id)
    if index is not None:
        things[index] = thing
    else:
        things.insert(at if 0 <= at < len(things) else len(things), thing)


def _put(b, at):
    corners = None if b.corners is None else b.corners.tolist()
    stands = b.solid, b.blocks_view, b.id, b.margin, at, b.z_min, b.z_max, b.shape, corners
    return AddObstacle(b.name, b.polygon.tolist(), *stands)


@command
class RemoveObstacle:
    """Take an obstacle away by its id, or all of a name."""

    name: str = ""
    id: int = 0
    at: int = -1  # of several of a name only the one at this place in the order
    overhead: bool = False  # in recordings of before there was one order of all; no longer of use

    def check(self, world):
        self.gone(world)

    def gone(self, world):
        """Indices of the obstacles that go; ValueError when there are none."""
        things = world.resource(Landscape).obstacles
        if self.id:
            need(by_id(things, self.id) is not None, f"there is no obstacle {self.id} in this world")
            return [by_id(things, self.id)]
        names = [b.name for b in things]
        need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        rows = [k for k, name in enumerate(names) if name == self.name]
        return [self.at] if self.at in rows else rows

    def ground_box(self, world):
        land = world.resource(Landscape)
        return box_drawn(land, *(land.obstacles[k].polygon for k in self.gone(world)))

    def touches(self, world):
        return [TouchedThings("obstacle"), *halted(world.resource(Landscape), self.gone(world))]

    def foresee(self, world):
        land, gone = world.resource(Landscape), self.gone(world)
        land.obstacles[:] = [b for k, b in enumerate(land.obstacles) if k not in gone]

    def apply(self, world):
        land = world.resource(Landscape)
        self.foresee(world)
        land.rebuild(navigation=False)
        land.navigate_later(world.resource(Clock).tick)


KINDS["obstacle"] = ThingKind(("obstacles",), _put, lambda b, at, n: RemoveObstacle(b.name, b.id, at))


class TouchedStand(NamedTuple):
    """Where the obstacles of a name stand, and on what ways they are."""

    name: str

    def taken(self, world):
        land = world.resource(Landscape)
        stand = [[b.polygon.tolist(), b.z_min, b.z_max] for b in land.find(self.name)]
        return StandObstacle(self.name, stand, [[g.by.tolist(), g.left] for g in land.glides if g.name == self.name])

    def back(self, world, taken):
        return [] if self.taken(world) == taken else [taken]


def halted(land, gone):
    """`TouchedStand` of the glides that end when the obstacles of these indices no longer have their names."""
    names = {land.obstacles[k].name for k in gone} - {b.name for k, b in enumerate(land.obstacles) if k not in gone}
    return [TouchedStand(name) for name in sorted({glide.name for glide in land.glides} & names)]


@command
class MoveObstacle:
    """Move an obstacle, by its name: its middle to (x, y), and up by ``rise``; evenly within ``seconds``, or at once.

    Animals on the ground step aside; one on the ground waits while they cannot.  Those in the air are pushed.  When it
    has left the ground animals pass below it; when it comes down it bars their way.
    """

    name: str
    x: float
    y: float
    rise: float = 0.0  # m
    seconds: float = 0.0

    def check(self, world):
        land = world.resource(Landscape)
        names = [b.name for b in land.obstacles]
        need(self.name in names, f"there is no obstacle {self.name!r}{did_you_mean(self.name, names)}")
        need(self.seconds >= 0, f"seconds must be at least 0, got {self.seconds:g}")
        by = self._way(land)
        for b in land.find(self.name):
            on_the_map(land, b.polygon + by[:2])

    def touches(self, world):
        return [TouchedStand(self.name)]

    def ground_box(self, world):
        return "all"

    def apply(self, world):
        self.check(world)
        land = world.resource(Landscape)
        by = self._way(land)
        land.glides = [glide for glide in land.glides if glide.name != self.name]
        _set_off(land, [Glide(self.name, by, self.seconds)])
        land.changed()

    def _way(self, land):
        """(3,) m"""
        middle = land.find(self.name)[0].polygon.mean(0)
        return np.array([self.x - middle[0], self.y - middle[1], self.rise])


@command
class StandObstacle:
    """Put the obstacles of a name exactly here, as they were before they were moved."""

    name: str
    stand: list  # of each: its points, z_min and z_max
    glides: list  # of each glide that goes on: (3,) m still to go, s left

    def check(self, world):
        count = len(world.resource(Landscape).find(self.name))
        need(count, f"there is no obstacle {self.name!r}")
        need(
            count == len(self.stand),
            f"there are {count} obstacles {self.name!r}, but stand has {len(self.stand)} entries",
        )
        try:
            for points, low, high in self.stand:
                polygon_of(points, "an obstacle")
                need(float(low) < float(high), "z_min must be below z_max")
            valid = [(np.array(by, float).shape == (3,) and float(left) >= 0) for by, left in self.glides]
        except TypeError:
            valid = [False]
        need(all(valid), "stand must be a list of [points, z_min, z_max], glides a list of [[x, y, z], seconds]")

    def touches(self, world):
        return [TouchedStand(self.name)]

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
                if b.solid and b.on_the_ground:
                    evict(world, b)
        except ValueError:
            for b, (points, low, high) in zip(barriers, before, strict=True):
                b.polygon, b.z_min, b.z_max = points, low, high
            land.rebuild(navigation=False)
            raise
        land.glides = [glide for glide in land.glides if glide.name != self.name]
        _set_off(land, [Glide(self.name, np.array(by, float), left) for by, left in self.glides])
        land.changed()
        land.navigate_later(world.resource(Clock).tick)


def _set_off(land, glides):
    """Add glides, in the order of names: undo brings them back to the same place."""
    land.glides = sorted([*land.glides, *glides], key=lambda glide: glide.name)


def advance(world, land, glide, clock):
    """One tick of an obstacle on its way."""
    barriers = land.find(glide.name)
    met = any(b.on_the_ground for b in barriers)
    share = 1.0 if glide.left <= clock.dt else clock.dt / glide.left
    step = share * glide.by
    for b in barriers:
        land.shift(b, step)
    try:
        for b in barriers:
            if b.solid and b.on_the_ground:
                evict(world, b)
    except ValueError:  # an animal there has no room to step aside: wait
        for b in barriers:
            land.shift(b, -step)
        return
    glide.by, glide.left = glide.by - step, glide.left - clock.dt
    if share == 1.0 or not barriers:
        land.glides.remove(glide)
    land.changed()
    if met or any(b.on_the_ground for b in barriers):
        land.navigate_later(clock.tick)


def evict(world, obstacle):
    """Move animals whose bodies touch a new obstacle to the nearest free place.

    Raises
    ------
    ValueError
        When there is none nearby.  Nobody has moved then.
    """
    agents, wrap = world.agents, world.resource(Landscape).wrap
    xyz, polygons = agents[Position.xyz], [image.polygon for image in solid_images([obstacle], wrap)]
    trapped = np.zeros(len(agents), bool)
    for corners in polygons:
        edges = np.hstack([corners, np.roll(corners, -1, axis=0)])
        trapped |= touching(xyz, agents[Heading.forward], agents[Body.axis], agents[Body.radius], edges)
        trapped |= inside_polygon(xyz, corners)
    move_to_free_places(world, trapped & ~in_the_air(world))


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= 1e6
