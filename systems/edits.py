"""What a designer does to a level while it lives: arrows, goals, exits, spawns; paint and obstacles have their files.

Each command also changes the level's document (`flockbrush.levels.map_edits`); ``id`` is the object's id in the level
file, and a command with the id of something that is there puts the new one in its place.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from flockbrush.behaviours.brush import cannot_rise
from flockbrush.components import Destination
from flockbrush.components.level_things import Exit, Goal, Guide, Spawn, degrees_text, properties_of, radians_of
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command
from flockbrush.engine.problems import did_you_mean
from flockbrush.systems.animal_commands import MOST
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.level_lists import KINDS, ThingKind, TouchedThings, lists_of
from flockbrush.systems.life import Nursery, spawn_animals
from flockbrush.systems.obstacle_commands import (
    AddObstacle,
    RemoveObstacle,
    box_drawn,
    box_of_thing,
    line_of,
    polygon_of,
    put_thing,
)
from flockbrush.systems.paint_commands import FAR, LAYERS, Paint, PaintCells, fill, off_the_map, pick, region
from flockbrush.systems.palette import Palette
from flockbrush.systems.selection import check_can_come
from flockbrush.systems.terrain import centroid
from flockbrush.systems.undo import TouchedAnimals, TouchedColumns, UseBrush, goal_index, need

__all__ = [
    "KINDS", "LAYERS", "AddObstacle", "DrawGuide", "MarkSpawn", "MoveGoal", "Paint", "PaintCells", "PlaceExit",
    "PlaceGoal", "RemoveObstacle", "RemoveThing", "UseBrush", "as_command", "fill", "pick", "region",
]  # fmt: skip


class OfThing:
    """A command for the thing of this ``kind`` with its id."""

    needs_fields = "kind: str", "id: int"

    def touches(self, world):
        return [TouchedThings(self.kind)]


@dataclass(frozen=True)
class OfOutline(OfThing):
    """A command that draws a thing by its name and outline alone: ``what`` of class ``makes``."""

    id: int
    name: str
    points: list
    at: int = -1
    what: ClassVar[str]
    makes: ClassVar[Any]

    def outline(self):
        """(k, 2) m; ValueError when the points are none."""
        return polygon_of(self.points, self.what)

    def check(self, world):
        check_id(self)
        check_on_map(world.resource(Landscape), self.outline(), f"the {self.kind}")

    def ground_box(self, world):
        return "all"

    def foresee(self, world):
        thing = self.makes(self.id, self.name, self.outline())
        put_thing(_things(world, self.kind, self.id), thing, self.at)

    def apply(self, world):
        self.foresee(world)
        world.resource(Landscape).changed()


@command
class DrawGuide(OfThing):
    """Draw an arrow for leaders to follow, or change the one with this id."""

    kind = "guide"
    id: int
    name: str
    points: list
    strength: float = 1.0
    radius: float = 10.0  # m
    decay: float = 10.0  # m
    goal: str = ""
    loop: bool = False
    at: int = -1  # where in the order of guides; -1: behind all others

    def check(self, world):
        land, points = world.resource(Landscape), line_of(self.points)
        check_id(self)
        apart = len(points) > 1 and (points != points[0]).any()
        need(apart, f"a guide needs at least two different points, got {len(points)}")
        need(len(points) <= 2000, f"a guide has at most 2000 points, got {len(points)}")
        check_bounds(self, Guide)
        if self.goal:
            goal_index(land, self.goal)
        check_on_map(land, points, "the guide")

    def ground_box(self, world):
        return "all"

    def foresee(self, world):
        guide = Guide(self.id, self.name, line_of(self.points), **settings_of(self, Guide))
        put_thing(world.resource(Landscape).guides, guide, self.at)

    def apply(self, world):
        self.foresee(world)
        world.resource(Landscape).navigate()


@command
class PlaceGoal(OfThing):
    """Place a goal, or change the one with this id.

    The first goal of a world binds everybody, as a level with a goal does; one that is placed before the others has the
    animals of the one that was first.  A goal that is an area moves with it.
    """

    kind = "goal"
    as_it_stands: ClassVar[tuple[dict, ...]] = ({"x": None, "y": None, "points": []},)
    id: int
    name: str
    x: float | None  # m; x and y None: the middle of the points, or as the one with its id stands
    y: float | None
    radius: float = 5.0  # m
    on_arrive: str = "stay"
    next: str = ""
    points: list | None = field(default_factory=list)  # the area, m; empty: as it had, moved along; None: a point
    at: int = -1  # where in the order of goals; -1: behind all others

    def check(self, world):
        land = world.resource(Landscape)
        check_id(self, zero=True)
        need(self.name, "a goal needs a name")
        index = self.there(land)
        others = [goal.name for k, goal in enumerate(land.goals) if k != index]
        need(self.name not in others, f"a goal named {self.name!r} already exists")
        check_bounds(self, Goal)
        x, y = self.place(land)
        need(0 <= x <= land.width and 0 <= y <= land.height, off_the_map(land, f"({x:g}, {y:g})"))
        names = [*others, self.name]
        if self.on_arrive == "next":
            need(self.next, "on_arrive is 'next', so next must name a goal")
            need(self.next in names, f"next: there is no goal {self.next!r}{did_you_mean(self.next, names)}")
        else:
            need(not self.next, f"next is given, so on_arrive must be 'next', got {self.on_arrive!r}")
        if index is not None and land.goals[index].name != self.name:
            _check_free(land, land.goals[index].name)
        if self.points:
            middle = centroid(polygon_of(self.points, "a goal"))
            near = np.abs(middle - (x, y)).max() <= 1e-3
            need(near, f"x and y must be the middle of the points, ({middle[0]:.12g}, {middle[1]:.12g}), or left out")

    def there(self, land):
        """Index of the goal it takes the place of, or None."""
        same = (goal.id == self.id and (self.id or goal.name == self.name) for goal in land.goals)
        return next((k for k, matches in enumerate(same) if matches), None)

    def place(self, land):
        """(2,) m; ValueError when it is not told and there is no such goal yet."""
        if self.x is not None and self.y is not None:
            return np.array([self.x, self.y])
        index = self.there(land)
        need(self.x is self.y is None and (self.points or index is not None), f"goal {self.name!r} needs x and y")
        return centroid(polygon_of(self.points, "a goal")) if self.points else land.goals[index].xy

    def ground_box(self, world):
        return "all"

    def foresee(self, world):
        land = world.resource(Landscape)
        index, xy = self.there(land), self.place(land)
        polygon = polygon_of(self.points, "a goal") if self.points else None
        if self.points == [] and index is not None and land.goals[index].polygon is not None:
            polygon = land.goals[index].polygon + (xy - land.goals[index].xy)
        goal = Goal(self.id, self.name, xy, **settings_of(self, Goal), polygon=polygon)
        if index is not None:
            land.goals[index] = goal
        else:
            land.goals.insert(self.at if 0 <= self.at < len(land.goals) else len(land.goals), goal)

    def apply(self, world):
        land, bound = world.resource(Landscape), world.agents[Destination.goal]
        first, new = not land.goals, self.there(land) is None
        self.foresee(world)
        if first:
            bound[:] = 0
        elif new:  # animals on the way to the first goal go to the new first one
            bound[bound >= max(self.there(land), 1)] += 1
        land.navigate()


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
        need(inside, off_the_map(land, f"({self.x:g}, {self.y:g})"))

    def ground_box(self, world):
        return "all"

    def touches(self, world):
        return [TouchedThings("goal")]

    def apply(self, world):
        land = world.resource(Landscape)
        index = goal_index(land, self.goal)
        goal = land.goals[index]
        shift = np.array([self.x, self.y]) - goal.xy
        polygon = None if goal.polygon is None else goal.polygon + shift
        land.goals[index] = replace(goal, xy=goal.xy + shift, polygon=polygon)
        land.navigate()


@command
class PlaceExit(OfOutline):
    """Draw an area where animals leave the world, or change the one with this id."""

    kind, what, makes = "exit", "an exit", Exit

    def ground_box(self, world):
        land = world.resource(Landscape)
        return box_of_thing(land, land.exits, self.id, self.outline())


@command
class MarkSpawn(OfThing):
    """Draw an area where animals are born, or change the one with this id.

    In a running world they are born at once, those with a start or a rate counted from now.  Of a spawn that is
    changed only those are born that it has more than before.
    """

    kind = "spawn"
    id: int
    name: str
    points: list
    brush: str
    species: str = "animal"
    count: int = 0
    heading: float | None = None  # rad; None: each its own
    speed: float | None = None  # m/s at the start; 0 or None: the brush's
    altitude: float = 0.0  # m above ground
    start: float = 0.0  # s
    rate: float = 0.0  # animals per second; 0: all at once
    formation: str = "scatter"
    body_length: float | None = None  # m; 0 or None: the brush's
    depth: float = 0.0  # m above `altitude` up to which they are born
    since: float | None = None  # s, when it was drawn; None: now
    born: int = -1  # how many it has brought already; -1: as it is
    at: int = -1
    program: str = ""  # that they follow; "": none
    family_size: int = 0  # animals of a family; 0: no families

    def check(self, world):
        land, palette = world.resource(Landscape), world.resource(Palette)
        check_id(self)
        brush = palette.brushes[palette.named(self.brush, own=True)]
        check_can_come(world, self.species, self.brush, self.program)
        why = cannot_rise(self, world.resource(SpeciesList).library.find(self.species), brush)
        need(not why, why)
        need(0 <= self.count <= MOST, f"count must be 0 to {MOST}, got {self.count}")
        need(self.count or self.rate, "count must be at least 1, got 0")
        check_bounds(self, Spawn, ("formation", "start", "rate", "altitude", "depth", "family_size"))
        need(not (self.rate and self.family_size), "families need a rate of 0: they appear at once")
        need(self.speed is None or 0 <= self.speed <= 1000, f"speed must be 0 to 1000 m/s, got {self.speed}")
        need(self.heading is None or abs(self.heading) <= FAR, f"heading is in radians, got {self.heading}")
        size = self.body_length
        need(size is None or 0 <= size <= 100, f"body_length must be 0 to 100 m, got {size}")
        polygon, edge = polygon_of(self.points, "a spawn"), 1e-6 * land.cell
        inside = (polygon >= -edge).all() and (polygon <= np.array([land.width, land.height]) + edge).all()
        need(inside, f"the spawn reaches off the map, which is {land.width:g} x {land.height:g} m")

    def ground_box(self, world):
        spawns = world.resource(Nursery).spawns
        return box_of_thing(world.resource(Landscape), spawns, self.id, polygon_of(self.points, "a spawn"))

    def due(self, nursery):
        """How many are born when it is drawn."""
        if self.rate or self.start:
            return 0
        return max(0, self.count - self.brought(nursery))

    def brought(self, nursery):
        """How many it has brought before it is drawn."""
        index = nursery.find(self.id)
        return self.born if self.born >= 0 else 0 if index is None else nursery.born[index]

    def touches(self, world):
        return [TouchedAnimals(), *super().touches(world)]

    def foresee(self, world):
        if self.due(world.resource(Nursery)):
            world.resource(SpeciesList).index(self.species)
        self.put(world, self.area(world))

    def apply(self, world):
        due, spawn = self.due(world.resource(Nursery)), self.area(world)
        total = len(world.agents) + due
        need(total <= MOST, f"there may be at most {MOST} animals, and this would make {total}")
        if due:
            spawn_animals(world, spawn, due, f"spawn {self.id} {world.next_entity}")
        self.put(world, spawn)

    def put(self, world, spawn):
        """Put the spawn among the others, with what it has brought."""
        nursery = world.resource(Nursery)
        born, index = self.due(nursery) + self.brought(nursery), nursery.find(self.id)
        if index is None:
            nursery.put(spawn, born, self.at if 0 <= self.at <= len(nursery.spawns) else None)
        else:
            nursery.spawns[index], nursery.born[index] = spawn, born

    def area(self, world):
        """The spawn as the world keeps it: as a level that has it is read."""
        nursery, now = world.resource(Nursery), world.resource(Clock).now
        index = nursery.find(self.id)
        before = None if index is None else nursery.spawns[index]
        since = self.since if self.since is not None else now if before is None else before.since
        settings = settings_of(self, Spawn) | {"speed": self.speed or None, "body_length": self.body_length or None}
        settings["heading"] = None if self.heading is None else radians_of(float(degrees_text(self.heading)))
        return Spawn(self.id, self.name, polygon_of(self.points, "a spawn"), **settings, since=since)


# taking things away -------------------------------------------------------------------


@command
class RemoveThing(OfThing):
    """Take a thing out of the level: an obstacle, guide, goal, exit, spawn, zone, line, area or script key.

    The animals of a spawn stay.  Those of the first goal go to the next one, those of another goal are free.
    """

    kind: str
    id: int
    name: str = ""  # of one whose id is 0, which is in no level file

    def check(self, world):
        need(self.kind in KINDS, f"there is no {self.kind!r} to remove{did_you_mean(self.kind, list(KINDS))}")
        index = self.there(world)
        need(index is not None, f"there is no {self.kind} {self.id} in this world")
        if self.kind == "goal":
            land = world.resource(Landscape)
            _check_free(land, land.goals[index].name)

    def rescript(self):
        """(key, s, None): the script no longer does what a key said; None for other things."""
        return (self.id, 0.0, None) if self.kind == "key" else None

    def there(self, world):
        """Index of the thing, or None."""
        things = _things(world, self.kind, self.id)
        same = (thing.id == self.id and self.name in ("", thing.name) for thing in things)
        return next((k for k, matches in enumerate(same) if matches), None)

    def ground_box(self, world):
        if self.kind not in ("obstacle", "exit", "spawn"):
            return "all"
        index = self.there(world)
        if index is None:
            return None
        return box_drawn(world.resource(Landscape), _things(world, self.kind, self.id)[index].polygon)

    def touches(self, world):
        if self.kind == "obstacle":
            return RemoveObstacle(self.name, self.id, self.there(world)).touches(world)
        if self.kind != "goal":
            return super().touches(world)
        rows, first = np.arange(len(world.agents)), self.there(world) == 0
        # a goal that becomes the first binds those of the one before, or everybody, so all have to be bound again
        return [*super().touches(world), TouchedColumns(rows, (Destination.goal,), later=first)]

    def foresee(self, world):
        index = self.there(world)
        del _things(world, self.kind, self.id)[index]
        if self.kind == "spawn":
            del world.resource(Nursery).born[index]

    def apply(self, world):
        land, index = world.resource(Landscape), self.there(world)
        if self.kind == "obstacle":
            RemoveObstacle(self.name, self.id, index).apply(world)
            return
        self.foresee(world)
        if self.kind == "zone":
            land.marks.lay(land)
        elif self.kind in ("exit", "line", "area", "key"):
            land.changed()
        elif self.kind == "goal":
            bound = world.agents[Destination.goal]
            if index or not land.goals:  # else they go to the one that is first now, as animals of a level do
                bound[bound == index] = -1
            bound[bound > index] -= 1
            land.navigate()
        elif self.kind == "guide":
            land.navigate()


def _things(world, kind, number):
    """The list of the things of a kind that the world keeps, with the one of this id if there is one."""
    lists = lists_of(world, kind)
    return next((things for things in lists if any(thing.id == number for thing in things)), lists[0])


def as_command(world, kind, number):
    """The command that puts the thing with this id where and how it is now; a spawn counts its births on."""
    things = _things(world, kind, number)
    index = next((k for k, thing in enumerate(things) if thing.id == number), None)
    return RemoveThing(kind, number) if index is None else KINDS[kind].put(things[index], index)


def removal_of(kind):
    """How a thing of a kind is taken away."""
    return lambda thing, at, n: RemoveThing(kind, thing.id, "" if thing.id else thing.name)


def _draw_guide(g, at):
    return DrawGuide(g.id, g.name, g.points.tolist(), **settings_of(g, Guide), at=at)


def _place_goal(g, at):
    points = None if g.polygon is None else g.polygon.tolist()
    return PlaceGoal(g.id, g.name, *g.xy.tolist(), **settings_of(g, Goal), points=points, at=at)


def _place_exit(e, at):
    return PlaceExit(e.id, e.name, e.polygon.tolist(), at)


def _mark_spawn(s, at):
    properties = {name: value for name, value in vars(s).items() if name != "polygon"}
    return MarkSpawn(**properties, points=s.polygon.tolist(), at=at)


KINDS |= {
    "guide": ThingKind(("guides",), _draw_guide, removal_of("guide")),
    "goal": ThingKind(("goals",), _place_goal, removal_of("goal")),
    "exit": ThingKind(("exits",), _place_exit, removal_of("exit")),
    "spawn": ThingKind(("spawns",), _mark_spawn, removal_of("spawn")),
}


def settings_of(thing, kind):
    """{name: value} of what a designer may set of this kind of thing, from a thing or a command."""
    return {known.name: getattr(thing, known.name) for known in properties_of(kind)}


def check_bounds(command, kind, names=None):
    """ValueError when something is out of the bounds that it has in a level; of these names alone, if told."""
    for known in properties_of(kind):
        if names is None or known.name in names:
            known.refuse(getattr(command, known.name))


def check_id(command, zero=False):
    need(command.id >= (0 if zero else 1), f"id must be at least 1, got {command.id}")


def check_on_map(land, points, what):
    low, high = points.min(0), points.max(0)
    off = (high < 0).any() or low[0] > land.width or low[1] > land.height
    need(not off, off_the_map(land, what))


def _check_free(land, name):
    """ValueError while somebody still names this goal."""
    for kind, things, key in (("goal", land.goals, "next"), ("guide", land.guides, "goal")):
        for thing in things:
            own = kind == "goal" and thing.name == name
            need(own or getattr(thing, key) != name, f"{kind} {thing.name!r} leads to goal {name!r}; change that first")
