"""What a level may not mean: names that name nothing, animals born in rock, arrows beyond the map."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import MISSING, fields

import numpy as np
from flockbrush.behaviours.brush import cannot_move, cannot_rise
from flockbrush.behaviours.species import shipped_species
from flockbrush.engine import limits
from flockbrush.engine.commands import commands, place_fields
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.levels import geometry
from flockbrush.levels.properties import is_number, shown
from flockbrush.systems.population import body_of

_PACKED = 0.6  # share of the ground that bodies may cover at the start


def check_level(level, objects, library, commands=None):
    """Tell every problem of meaning to the places of the objects concerned.

    Parameters
    ----------
    objects : ObjectReader
        Knows where each object stands in the file.
    library : BrushLibrary
        For the size of the animals.
    commands : dict of str to dataclass, optional
        By name; the registered ones when left out.
    """
    _Checks(level, objects, library, commands).all()


def registered():
    """The commands there are, by name."""
    import flockbrush.systems.commands
    import flockbrush.systems.gusts
    import flockbrush.systems.leaders
    import flockbrush.systems.mark_commands
    import flockbrush.systems.program_commands  # noqa: F401  these register them

    return commands()


class _Checks:
    def __init__(self, level, objects, library, commands):
        self.level, self.objects, self.library = level, objects, library
        self.fauna = getattr(library, "species", None) or shipped_species()
        self.commands = registered() if commands is None and level.script else commands
        self.place = objects.place

    def all(self):
        self.on_the_map()
        self.names()
        self.goals()
        self.spawns()
        self.bounds()
        for key in self.level.script:
            self.key(key)

    # ------------------------------------------------------------ where things are

    def on_the_map(self):
        level = self.level
        for things, shape in (
            (level.guides, "points"),
            (level.lines, "points"),
            (level.zones, "polygon"),
            (level.exits, "polygon"),
            (level.areas, "polygon"),
            (level.obstacles, "polygon"),
        ):
            for thing in things:
                if self.off(getattr(thing, shape)):
                    self.place(thing).say(f"is outside the map, {self.span(getattr(thing, shape))}")
        for goal in level.goals:
            if np.any(goal.xy < 0) or np.any(goal.xy > (level.width, level.height)):
                self.place(goal).say(f"is outside the map, {self.span(goal.xy[None])}")
        for spawn in level.spawns:
            edge = 1e-6 * level.cell
            if np.any(spawn.polygon < -edge) or np.any(spawn.polygon > np.array([level.width, level.height]) + edge):
                self.place(spawn).say(f"extends outside the map, {self.span(spawn.polygon)}")

    def off(self, points):
        """Wholly to one side of the map."""
        low, high = points.min(axis=0), points.max(axis=0)
        return bool(np.any(high < 0) or np.any(low > (self.level.width, self.level.height)))

    def span(self, points):
        (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
        return (
            f"which is {self.level.width:g} x {self.level.height:g} m:"
            f" x from {x0:.1f} to {x1:.1f}, y from {y0:.1f} to {y1:.1f}"
        )

    # ------------------------------------------------------------ names

    def names(self):
        """Goals are sent for by name; counts and densities are reported by name."""
        for what, things in (("goals", self.level.goals), ("measures", self.level.lines + self.level.areas)):
            places = defaultdict(list)
            for thing in things:
                places[thing.name].append(thing)
            for name, same in places.items():
                for thing in same[1:]:
                    self.place(thing).say(f"two {what} have the name {name[:60]!r}; the other is object {same[0].id}")

    def goals(self):
        names = [g.name for g in self.level.goals]
        for thing, key in [(g, "goal") for g in self.level.guides] + [(g, "next") for g in self.level.goals]:
            value = getattr(thing, key)
            if value and value not in names:
                self.place(thing).say(f"{key}: there is no goal {value[:60]!r}{did_you_mean(value, names)}")
        for goal in self.level.goals:
            if goal.on_arrive == "next" and not goal.next:
                self.place(goal).say("on_arrive is 'next', so next must name a goal")
            elif goal.next and goal.on_arrive != "next":
                self.place(goal).say(f"next is given, so on_arrive must be 'next', got '{goal.on_arrive}'")

    # ------------------------------------------------------------ spawns

    def spawns(self):
        if not self.level.spawns and not self.objects.reader.report.problems:
            self.objects.reader.place.say("no animals: draw an area on an object layer 'spawns', of class Spawn")
        for spawn in self.level.spawns:
            self.can_do(spawn)
            free = self.free(spawn)
            if free == 0:
                self.place(spawn).say("is completely inside obstacles or on ground that is not walkable; move it")
            else:
                self.room(spawn, free * geometry.signed_area(spawn.polygon))
        if self.level.agents > limits.ANIMALS and all(s.count <= limits.ANIMALS for s in self.level.spawns):
            self.place(self.level.spawns[-1]).say(
                f"the spawns have {self.level.agents} animals in total; the maximum is {limits.ANIMALS}"
            )

    def can_do(self, spawn):
        """Species move as their brush and programs do, and walkers are not born in the air."""
        try:
            brush, species = self.library.get(spawn.brush), self.fauna.find(spawn.species)
        except ProblemsError as error:
            if any(str(problem.file).endswith(".species.toml") for problem in error.problems):
                self.objects.reader.report.problems.extend(error.problems)
            return
        if species is None:
            return
        followed = self.objects.reader.named_programs.get(spawn.program)
        states = {} if followed is None else followed.states
        uses = [(f"program {spawn.program!r}, state {name!r}: ", state.brush) for name, state in states.items()]
        for where, name in [("", spawn.brush), *uses]:
            why = cannot_move(spawn.species, species, self.library.get(name)) if name in self.library.names() else ""
            if why:
                self.place(spawn).say(where + why)
                return
        why = cannot_rise(spawn, species, brush)
        if why:
            self.place(spawn).say(why)

    def bounds(self):
        """Whom zones and layers bind must be a species or a tag of one."""
        known = set(self.fauna.names()) | {spawn.species for spawn in self.level.spawns}
        known |= {tag for name in self.fauna.names() for tag in self.fauna.get(name).tags}
        painted = zip(self.level.brush_layers, self.objects.reader.paint_places, strict=True)
        for thing, place in [*((zone, self.place(zone)) for zone in self.level.zones), *painted]:
            for name in thing.bounds.species:
                if name not in known:
                    place.say(f"species: there is no species or tag {name!r}{did_you_mean(name, known)}")
            if thing.bounds.z_min >= thing.bounds.z_max:
                low, high = thing.bounds.z_min, thing.bounds.z_max
                place.say(f"z_min must be below z_max, got {low:g} and {high:g}")

    def free(self, spawn):
        """Share of the spawn's area where an animal can stand."""
        points = geometry.sample(spawn.polygon)
        open_ = np.ones(len(points), bool)
        low, high = spawn.polygon.min(axis=0), spawn.polygon.max(axis=0)
        for o in self.level.obstacles:
            near = np.all(o.polygon.max(axis=0) >= low) and np.all(o.polygon.min(axis=0) <= high)
            if o.solid and near and o.z_min <= spawn.altitude <= o.z_max:
                open_ &= ~geometry.inside(points, o.polygon)
        if self.level.terrain is not None and spawn.altitude == 0:
            ny, nx = self.level.terrain.walkable.shape
            ix = np.clip((points[:, 0] / self.level.cell).astype(int), 0, nx - 1)
            iy = np.clip((points[:, 1] / self.level.cell).astype(int), 0, ny - 1)
            open_ &= self.level.terrain.walkable[iy, ix]
        return float(open_.mean())

    def room(self, spawn, area):
        """Bodies must fit on the ground."""
        body = self.body(spawn)
        if body is None or spawn.rate:
            return
        length, radius = body
        covered = spawn.count * ((length - 2 * radius) * 2 * radius + np.pi * radius**2)
        if covered > _PACKED * area:
            fit = int(_PACKED * area * spawn.count / covered)
            self.place(spawn).say(
                f"{spawn.count} animals {length:g} m long do not fit on {area:.0f} m^2 of free ground;"
                f" at most {fit} fit"
            )

    def body(self, spawn):
        """(length, radius) m, if the brush says so."""
        try:
            body = body_of(self.library.get(spawn.brush), self.fauna.find(spawn.species))
        except ProblemsError:  # an unknown brush is reported already, a broken one by the check of brushes
            return None
        scale = (spawn.body_length or body.length) / body.length
        return body.length * scale, body.radius * scale

    # ------------------------------------------------------------ the script

    def key(self, key):
        place, lines = self.place(key), self.objects.key_lines[key.id]
        if not key.command or not self.commands:
            return
        if key.command not in self.commands:
            place.say(
                f"there is no command {key.command[:60]!r}{did_you_mean(key.command, self.commands)}",
                lines.get("command"),
            )
            return
        known = {f.name: f for f in fields(self.commands[key.command])}
        for name, value in key.args.items():
            if name not in known:
                place.say(f"{key.command} has no {name[:60]!r}{did_you_mean(name, known)}", lines.get(name))
            elif not _fits(value, _kind(known[name])):
                place.say(f"{name} must be {_WORDS[_kind(known[name])]}, got {shown(value)}", lines.get(name))
        self.named(key, place, lines)
        self.complete(key, known)
        for name, f in known.items():
            if f.default is MISSING and f.default_factory is MISSING and name not in key.args:
                drawn = name == "points"  # no property can say them
                place.say(f"{key.command} needs {'an area or a line' if drawn else f'the property {name!r}'}")

    def named(self, key, place, lines):
        """What a command names must exist."""
        goals = [*(goal.name for goal in self.level.goals), *self.brought("name", "PlaceGoal")]
        brushes = [*self.library.names(), *self.brought("name", "UseBrush")]
        for name, known in (("brush", brushes), ("goal", goals), ("species", self.species())):
            value = key.args.get(name)
            told = name == "brush" and isinstance(value, str) and value.endswith(".toml")  # where the file is read
            if isinstance(value, str) and value and value not in known and not told:
                place.say(f"{name}: there is no {name} {value[:60]!r}{did_you_mean(value, known)}", lines.get(name))

    def species(self):
        """The species that spawns and the script bring in."""
        come = [spawn.species for spawn in self.level.spawns]
        return list(dict.fromkeys([*come, *self.brought("species", "AddAnimals", "MarkSpawn")]))

    def brought(self, name, *givers):
        """What keys of the script bring in with these commands: the texts of an argument."""
        keys = [key for key in self.level.script if key.command in givers and key.command in self.commands]
        values = [key.args.get(name, getattr(self.commands[key.command], name, None)) for key in keys]
        return [value for value in values if isinstance(value, str)]

    def complete(self, key, known):
        """What a command wants and the properties leave out, the drawn object says: x, y, radius, points."""
        kind, points = self.objects.key_shapes[key.id]
        shape, area = {} if kind == "point" else {"points": points.tolist()}, kind == "area"
        for pair in place_fields(self.commands[key.command], key.args):
            if area or pair == ("x", "y"):
                shape |= dict(zip(pair, map(float, key.xy), strict=True))
        if area:
            shape["radius"] = math.sqrt(geometry.signed_area(points) / math.pi)
        for name in known:
            if name in shape and name not in key.args:
                key.args[name] = shape[name]


_WORDS = {"float": "a number", "int": "a whole number", "bool": "true or false", "str": "a string"}


def _kind(field):
    """The annotation of a field, whether it is kept as text or as a type."""
    return field.type if isinstance(field.type, str) else getattr(field.type, "__name__", "")


def _fits(value, kind):
    """Whether a property's value is what the command's annotation says; what we do not know may pass."""
    if kind == "float":
        return is_number(value)
    return {"int": type(value) is int, "bool": type(value) is bool, "str": isinstance(value, str)}.get(kind, True)
