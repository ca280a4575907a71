"""Things of a level, each declared once: as the reader gives them, a designer sees them and the world keeps them.

A field that a designer may set is a `prop`: its kind, default, meaning, unit and bounds make the custom class in Tiled,
the reader's checks, the tables of the documentation, the tips of forms and the checks of commands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from flockbrush.engine import limits

FAR = 1e6  # m; no level is larger

ENUMS: dict[str, tuple[str, ...]] = {
    "Boundary": ("wall", "wrap", "open", "despawn"),
    "ObstacleShape": ("box", "cylinder", "sphere", "plane", "hull"),
    "OnArrive": ("stay", "despawn", "next", "disperse"),
    "Blend": ("cover", "mix", "share"),
    "Medium": ("brush", "ground", "air", "any"),
    "Formation": ("scatter", "grid", "ring", "mill", "line"),
}


@dataclass(frozen=True)
class Property:
    """One custom property as a designer sees it."""

    name: str
    # {"number", "int", "bool", "text", "colour", "enum", "heading", "brush", "program", "goal"}; ``heading`` is
    # "random", a compass point or degrees counter-clockwise from east; ``brush``, ``program`` and ``goal`` are names
    # that must exist
    kind: str
    default: Any  # what an absent property means. Tiled does not write defaults, so this is the only place they are.
    meaning: str
    unit: str = ""
    # low, high: inclusive bounds
    low: float | None = None
    high: float | None = None
    above: float | None = None  # exclusive lower bound
    enum: str = ""
    required: bool = False
    longest: int = limits.PROPERTY_TEXT  # characters of a text

    @property
    def values(self) -> tuple[str, ...]:
        """What an enum property may be."""
        return ENUMS[self.enum] if self.enum else ()

    def refuse(self, value):
        """ValueError when a number is out of its bounds, or a word none of its enum."""
        unit = f" {self.unit}" if self.unit else ""
        if self.enum and value not in self.values:
            raise ValueError(f"{self.name} must be one of {', '.join(self.values)}, got {value!r}")
        if self.above is not None and not self.above < value <= self.high:
            raise ValueError(f"{self.name} must be above {self.above:g} and at most {self.high:g}{unit}, got {value:g}")
        if self.low is not None and not self.low <= value <= self.high:
            raise ValueError(f"{self.name} must be {self.low:g} to {self.high:g}{unit}, got {value:g}")


def prop(kind, default, meaning, unit="", kept=..., **bounds) -> Any:
    """A field of a thing that a designer may set, a `Property` by the name of the field.

    The default is ``kept`` in the field, if that is given, and shown to a designer as ``default``.
    """
    described = Property("", kind, default, meaning, unit, **bounds)
    return field(default=default if kept is ... else kept, metadata={"property": described})


def properties_of(thing) -> tuple[Property, ...]:
    """What a designer may set of a thing, or of a kind of things."""
    return tuple(replace(f.metadata["property"], name=f.name) for f in fields(thing) if f.metadata)


@dataclass
class Guide:
    """An arrow that leaders follow, from its first point to its last."""

    id: int
    name: str
    points: np.ndarray  # (k, 2) m; a loop does not repeat its first point
    strength: float = prop("number", 1.0, "weight of the guide against other guides and goals", low=0, high=100)
    radius: float = prop("number", 10.0, "distance to both sides with full strength", "m", low=0, high=FAR)
    decay: float = prop(
        "number", 10.0, "distance beyond the radius at which the strength has fallen to 1/e", "m", low=0, high=FAR
    )
    goal: str = prop("goal", "", "name of the goal that the guide leads to")
    loop: bool = prop("bool", False, "the last point leads back to the first")


@dataclass
class Goal:
    """Where the way leads, and what happens to animals that arrive."""

    id: int
    name: str
    xy: np.ndarray  # (2,) m
    radius: float = prop("number", 5.0, "an animal has arrived when it is nearer than this", "m", above=0, high=FAR)
    on_arrive: str = prop("enum", "stay", "what happens to animals that arrive", enum="OnArrive")
    next: str = prop("goal", "", "name of the next goal")
    polygon: np.ndarray | None = None  # (k, 2) m, the area if one was drawn instead of a point
    next_index: int = -1  # of `next` among the goals of a running world


@dataclass
class Exit:
    """Animals that come here leave the world."""

    id: int
    name: str
    polygon: np.ndarray  # (k, 2) m


GROUNDED = 1e-6  # m; what begins lower stands on the ground: heights that are moved are rounded


@dataclass
class Obstacle:
    """What animals walk around: it stops bodies, sight, or both."""

    id: int  # of the object in the level file; 0: it is in none
    name: str
    polygon: np.ndarray  # (k, 2) m, counter-clockwise
    solid: bool = prop("bool", True, "whether bodies cannot enter it")
    blocks_view: bool = prop("bool", True, "whether it hides the animals behind it")
    margin: float = prop("number", 0.0, "free space kept around it", "m", low=0, high=1000)
    z_min: float = prop("number", 0.0, "height of its bottom above the ground", "m", low=-FAR, high=FAR)
    z_max: float = prop("number", 1000.0, "height of its top above the ground", "m", low=-FAR, high=FAR)
    shape: str = prop("enum", "box", "solid shape that is made from its outline", enum="ObstacleShape")
    corners: np.ndarray | None = None  # (k, 3) m east, north, up of the middle of its foot: those of a hull

    @property
    def on_the_ground(self):
        """Whether animals on the ground meet it; they pass below what begins higher."""
        return self.z_min <= GROUNDED


BRUSH = "a brush asset, by name, or a .brush.toml file relative to the level"
# what paint and zones bind, and what zones do: a designer's view; the world keeps a `flockbrush.systems.marks.Zone`
PAINT_BOUNDS = (
    Property(
        "species",
        "text",
        "",
        "species that the brush acts on, as names or tags separated by commas; empty: those the brush is made for",
    ),
    Property(
        "medium",
        "enum",
        "brush",
        "medium in which the brush acts; brush: the medium in which the brush moves animals",
        enum="Medium",
    ),
    Property(
        "z_min", "number", -FAR, "lowest height above the ground at which the brush acts", "m", low=-FAR, high=FAR
    ),
    Property(
        "z_max", "number", FAR, "greatest height above the ground at which the brush acts", "m", low=-FAR, high=FAR
    ),
)
EDGE = Property(
    "edge",
    "number",
    0.0,
    "width of the soft border, over which the weight grows to its full value",
    "m",
    low=0,
    high=1000,
)
ZONE: tuple[Property, ...] = (
    Property("brush", "brush", "", BRUSH),
    Property("max_speed", "number", 0.0, "speed cap of all animals inside; 0: no cap", "m/s", low=0, high=1000),
    Property("factor", "number", 1.0, "speed factor of all animals on the ground inside", low=0.01, high=10),
    Property("blend", "number", 0.5, "time over which animals blend into the brush", "s", low=0, high=3600),
    Property("event", "text", "", "event raised for programs when an animal enters"),
    Property(
        "event_reach",
        "number",
        0.0,
        "which animals hear the event; 0: the one that entered; -1: all; otherwise all within this radius",
        "m",
        low=-1,
        high=FAR,
    ),
    *PAINT_BOUNDS,
    Property(
        "strength", "number", 1.0, "weight of the brush against what the animals would do without it", low=0, high=1
    ),
    EDGE,
    Property("share", "bool", False, "whether strength is the share of animals that take the brush"),
)


@dataclass
class Spawn:
    """Where animals come into the world, and which."""

    id: int
    name: str
    polygon: np.ndarray  # (k, 2) m
    species: str = prop("text", "animal", "species of the animals")
    brush: str = prop("brush", "", BRUSH, required=True)
    count: int = prop(
        "int", 0, "number of animals; or give density", low=0, high=int(limits.ANIMALS)
    )  # 0 with a rate: no end
    heading: float | None = prop(  # rad, counter-clockwise from east; None: each its own
        "heading",
        "random",
        "initial heading: random, a compass point such as north-east, or degrees from east",
        "deg",
        kept=None,
    )
    speed: float | None = prop("number", 0.0, "initial speed; 0: that of the brush", "m/s", kept=None, low=0, high=1000)
    altitude: float = prop("number", 0.0, "height above the ground", "m", low=0, high=FAR)
    depth: float = prop(
        "number", 0.0, "vertical extent of a flock, from the lowest to the highest bird", "m", low=0, high=FAR
    )
    start: float = prop("number", 0.0, "time when the first animals appear", "s", low=0, high=1e7)
    rate: float = prop("number", 0.0, "number of animals per second; 0: all at once", "1/s", low=0, high=1e5)
    formation: str = prop("enum", "scatter", "initial arrangement", enum="Formation")
    body_length: float | None = prop(
        "number", 0.0, "length from nose to tail; 0: that of the brush", "m", kept=None, low=0, high=100
    )
    program: str = prop("program", "", "name of the program (states and triggers) that the animals follow")
    family_size: int = prop(
        "int", 0, "number of animals in a family; 0: no families; families need a rate of 0", low=0, high=10_000
    )
    since: float = 0.0  # s, when it was drawn: its start counts from there


def radians_of(degrees):
    """A heading (rad) from degrees counter-clockwise from east, as a level gives it."""
    return float(np.deg2rad(degrees % 360))


def degrees_text(heading):
    """The degrees of a heading (rad) that `radians_of` makes this heading of, or else the nearest one it can make."""
    turned = heading % math.tau
    degrees = math.degrees(turned)
    near = [degrees, math.nextafter(degrees, 0.0), math.nextafter(degrees, 360.0)]
    return min([f"{degrees:.12g}", *map(repr, near)], key=lambda text: abs(radians_of(float(text)) - turned))


def as_before(before, now):
    """The things there are now, as the objects that they were before: others may hold on to these."""
    known: dict[tuple, list] = {}
    for thing in before:
        known.setdefault((thing.id, thing.name), []).append(thing)
    same = []
    for thing in now:
        waiting = known.get((thing.id, thing.name))
        kept = waiting.pop(0) if waiting else thing
        vars(kept).update(vars(thing))
        same.append(kept)
    return same
