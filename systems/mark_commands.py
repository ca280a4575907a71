"""What a designer does to zones, counts and script keys of a living level; `RemoveThing` takes them away."""

from __future__ import annotations

from contextlib import suppress
from operator import itemgetter

import numpy as np
from flockbrush.components.level_things import ZONE
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import command, commands, from_record, place_fields, tick_at
from flockbrush.engine.problems import did_you_mean
from flockbrush.systems.binding import MEDIA
from flockbrush.systems.edits import OfOutline, OfThing, check_id, check_on_map, removal_of
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.level_lists import KINDS, ThingKind, rehearsal, rehearse
from flockbrush.systems.marks import NO_LIMIT, Area, Key, Line, Zone
from flockbrush.systems.obstacle_commands import line_of, polygon_of, put_thing
from flockbrush.systems.paint_commands import off_the_map
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.undo import need


@command
class DrawZone(OfThing):
    """Draw a zone, which applies to animals while they are inside, or change the one with this id.

    It needs a brush, a top speed, a factor or an event.
    """

    kind = "zone"
    id: int
    name: str
    points: list
    brush: str = ""
    max_speed: float = 0.0  # m/s; 0: no cap
    factor: float = 1.0  # multiplies speed
    blend: float = 0.5  # s to take the brush up
    event: str = ""  # raised when an animal enters
    event_reach: float = 0.0  # m; 0: the animal that entered hears it; -1: all do
    species: str = ""  # names or tags that its brush binds, with commas; "": those it is made for
    medium: str = "brush"
    z_min: float = -NO_LIMIT  # m above the ground
    z_max: float = NO_LIMIT  # m above the ground
    strength: float = 1.0
    edge: float = 0.0  # m
    share: bool = False
    at: int = -1  # where in the order of zones; -1: above all others

    def check(self, world):
        check_id(self)
        check_on_map(world.resource(Landscape), polygon_of(self.points, "a zone"), "the zone")
        does = self.brush or self.max_speed or self.factor != 1.0 or self.event
        need(does, "the zone does nothing; give it a brush, a max_speed, a factor or an event")
        for known in ZONE:
            if known.kind == "number":
                known.refuse(getattr(self, known.name))
        need(self.z_min < self.z_max, f"z_min must be below z_max, got {self.z_min:g} and {self.z_max:g} m")
        need(self.medium in MEDIA, f"medium must be one of {', '.join(MEDIA)}{did_you_mean(self.medium, list(MEDIA))}")
        zone = self.zone()
        _check_species(world.resource(SpeciesList), zone.bounds.species)
        if self.brush:
            _check_brush(world.resource(Palette), zone)

    def zone(self):
        """The zone as the landscape keeps it; ValueError when the points are no outline."""
        properties = {known.name: getattr(self, known.name) for known in ZONE}
        return Zone.of(self.id, self.name, polygon_of(self.points, "a zone"), properties)

    def ground_box(self, world):
        return "all"

    def foresee(self, world):
        put_thing(world.resource(Landscape).marks.zones, self.zone(), self.at)

    def apply(self, world):
        land = world.resource(Landscape)
        self.foresee(world)
        land.marks.names = world.resource(Palette).names
        land.marks.lay(land)


def _check_species(fauna, names):
    library = fauna.library
    known = {*library.names(), *fauna.names, *(tag for name in library.names() for tag in library.get(name).tags)}
    for name in names:
        need(name in known, f"species: there is no species or tag {name!r}{did_you_mean(name, sorted(known))}")


def _check_brush(palette, zone):
    palette.named(zone.brush, own=True)
    mixes = zone.bounds.blend != "mix" or zone.brush in palette.over
    need(
        mixes,
        f"edge and strength mix {zone.brush!r} with other brushes, but this world has no mixtures of it; give the "
        f"command MixBrush first, or set share to yes (then that share of the animals takes the brush)",
    )


class _Counting(OfOutline):
    """Something that counts animals by its own name."""

    def check(self, world):
        super().check(world)
        _check_free(world.resource(Landscape), self)


@command
class DrawLine(_Counting):
    """Draw a line whose crossings are counted, or change the one with this id."""

    kind, makes = "line", Line

    def outline(self):
        points = line_of(self.points)
        need(2 <= len(points) <= 2000, f"a line has 2 to 2000 points, got {len(points)}")
        need((points != points[0]).any(), "a line needs two different points")
        return points


@command
class DrawArea(_Counting):
    """Draw an area in which animals are counted, or change the one with this id."""

    kind, what, makes = "area", "an area", Area


@command
class PlaceKey(OfThing):
    """Put a timed command into the level's script, or change the one with this id.

    The script is followed at once: the command is given at its time, unless that has passed.
    """

    kind = "key"
    id: int
    name: str
    when: float  # s after the start
    command: str
    args: dict  # of the command, by name; x and y that are left out are those of the key
    x: float
    y: float
    at: int = -1

    def check_form(self, world):
        """Check all but whether the command can be given at its time."""
        check_id(self)
        land = world.resource(Landscape)
        need(0 <= self.when <= 1e7, f"when must be 0 to 1e7 s, got {self.when:g}")
        inside = 0 <= self.x <= land.width and 0 <= self.y <= land.height
        need(inside, off_the_map(land, f"({self.x:g}, {self.y:g})"))
        from_record(self.command, self.given())

    def check(self, world):
        self.check_form(world)
        clock, keys = world.resource(Clock), world.resource(Landscape).marks.keys
        due = tick_at(self.when, clock.dt)
        if self.at >= 0 or due < clock.tick:  # put back as it was, or never given
            return
        with rehearsal(world):
            self.foresee(world)
            waiting = ((tick_at(key.at, clock.dt), key) for key in list(keys))
            for _, key in sorted((entry for entry in waiting if clock.tick <= entry[0] <= due), key=itemgetter(0)):
                if key.id == self.id:
                    break
                with suppress(ValueError, LookupError):  # its mistakes are reported when it is due
                    rehearse(world, from_record(key.command, key.args))
            rehearse(world, from_record(self.command, self.given()))

    def foresee(self, world):
        key = Key(self.id, self.name, self.when, self.command, self.given(), np.array([self.x, self.y]))
        put_thing(world.resource(Landscape).marks.keys, key, self.at)

    def given(self):
        """The command's arguments, with the place where the key stands."""
        return default_place(self.command, self.args, (self.x, self.y)) | self.args

    def rescript(self):
        """(key, s, command): what the script does from now on."""
        return self.id, self.when, from_record(self.command, self.given())

    def ground_box(self, world):
        return None

    def apply(self, world):
        self.foresee(world)
        world.resource(Landscape).changed()


def default_place(command, args, xy):
    """The arguments that a key at (x, y) m may leave out of a command with these: those of its own place, if any."""
    known = commands().get(command)
    here = known is not None and ("x", "y") in place_fields(known, args)
    return dict(zip("xy", xy, strict=True)) if here else {}


def _check_free(land, mine):
    """ValueError if another line or area has this name: counts are reported by name."""
    need(mine.name, "a line or an area needs a name: its counts are reported by name")
    others = [thing.name for thing in (*land.marks.lines, *land.marks.areas) if thing.id != mine.id]
    need(mine.name not in others, f"there is a line or an area {mine.name!r} already")


def _draw_zone(zone, at):
    return DrawZone(zone.id, zone.name, zone.polygon.tolist(), **zone.properties(), at=at)


def _draw_line(line, at):
    return DrawLine(line.id, line.name, line.points.tolist(), at)


def _draw_area(area, at):
    return DrawArea(area.id, area.name, area.polygon.tolist(), at)


def _place_key(key, at):
    xy = key.xy.tolist()
    here = default_place(key.command, key.args, xy)
    args = {name: value for name, value in key.args.items() if name not in here or value != here[name]}
    return PlaceKey(key.id, key.name, float(key.at), key.command, args, *xy, at)


KINDS |= {
    "zone": ThingKind(("marks.zones",), _draw_zone, removal_of("zone")),
    "line": ThingKind(("marks.lines",), _draw_line, removal_of("line")),
    "area": ThingKind(("marks.areas",), _draw_area, removal_of("area")),
    "key": ThingKind(("marks.keys",), _place_key, removal_of("key")),
}
