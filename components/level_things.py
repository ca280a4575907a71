"""Things of a level, each declared once: as the reader gives them, a designer sees them and the world keeps them.

A field that a designer may set is a `prop`: its kind, default, meaning, unit and bounds make the custom class in Tiled,
the reader's checks, the tables of the documentation, the tips of forms and the checks of commands.
"""

from __future__ import annotations

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
    told = Property("", kind, default, meaning, unit, **bounds)
    return field(default=default if kept is ... else kept, metadata={"property": told})


def properties_of(thing) -> tuple[Property, ...]:
    """What a designer may set of a thing, or of a kind of things."""
    return tuple(replace(f.metadata["property"], name=f.name) for f in fields(thing) if f.metadata)


@dataclass
class Guide:
    """An arrow that leaders follow, from its first point to its last."""

    id: int
    name: str
    points: np.ndarray  # (k, 2) m; a loop does not repeat its first point
    strength: float = prop("number", 1.0, "more pulls harder against other guides and goals", low=0, high=100)
    radius: float = prop("number", 10.0, "full strength this far to both sides", "m", low=0, high=FAR)
    decay: float = prop("number", 10.0, "then falls to 1/e over this length", "m", low=0, high=FAR)
    goal: str = prop("goal", "", "name of the goal it leads to")
    loop: bool = prop("bool", False, "the last point leads back to the first")


@dataclass
class Goal:
    """Where the way leads, and what happens to animals that arrive."""

    id: int
    name: str
    xy: np.ndarray  # (2,) m
    radius: float = prop("number", 5.0, "closer than this is there", "m", above=0, high=FAR)
    on_arrive: str = prop("enum", "stay", "what happens to animals that arrive", enum="OnArrive")
    next: str = prop("goal", "", "name of the goal after this one")
    polygon: np.ndarray | None = None  # (k, 2) m, the area if one was drawn instead of a point
    next_index: int = -1  # of `next` among the goals of a running world


@dataclass
class Exit:
    """Animals that come here leave the world."""

    id: int
    name: str
    polygon: np.ndarray  # (k, 2) m


@dataclass
class Obstacle:
    """What animals walk around: it stops bodies, sight, or both."""

    id: int  # of the object in the level file; 0: it is in none
    name: str
    polygon: np.ndarray  # (k, 2) m, counter-clockwise
    solid: bool = prop("bool", True, "keeps bodies out")
    blocks_view: bool = prop("bool", True, "hides animals behind it")
    margin: float = prop("number", 0.0, "room kept free around it", "m", low=0, high=1000)
    z_min: float = prop("number", 0.0, "where it begins above the ground", "m", low=-FAR, high=FAR)
    z_max: float = prop("number", 1000.0, "where it ends above the ground", "m", low=-FAR, high=FAR)
    shape: str = prop("enum", "box", "how it stands up from its outline", enum="ObstacleShape")
    corners: np.ndarray | None = None  # (k, 3) m east, north, up of the middle of its foot: those of a hull


BRUSH = "a brush asset, by name, or a .brush.toml file relative to the level"
# whom paint and zones bind, and what zones do: a designer's view; the world keeps a `flockbrush.systems.marks.Zone`
PAINT_BOUNDS = (
    Property(
        "species",
        "text",
        "",
        "species that its brush binds, names or tags separated by commas; empty: those it is made for",
    ),
    Property("medium", "enum", "brush", "where they must be; brush: where the brush moves", enum="Medium"),
    Property("z_min", "number", -FAR, "it binds from so high above the ground", "m", low=-FAR, high=FAR),
    Property("z_max", "number", FAR, "it binds up to so high above the ground", "m", low=-FAR, high=FAR),
)
EDGE = Property("edge", "number", 0.0, "soft border: the weight grows to full over this length", "m", low=0, high=1000)
ZONE: tuple[Property, ...] = (
    Property("brush", "brush", "", BRUSH),
    Property("max_speed", "number", 0.0, "top speed here; 0: no cap", "m/s", low=0, high=1000),
    Property("factor", "number", 1.0, "multiplies speed", low=0.01, high=10),
    Property("blend", "number", 0.5, "time to take the brush up", "s", low=0, high=3600),
    Property("event", "text", "", "raised when an animal enters: programs listen for it"),
    Property(
        "event_reach",
        "number",
        0.0,
        "who hears it: 0 the animal that entered, -1 all, else all within this radius",
        "m",
        low=-1,
        high=FAR,
    ),
    *PAINT_BOUNDS,
    Property("strength", "number", 1.0, "how far animals go from what they would do to its brush", low=0, high=1),
    EDGE,
    Property("share", "bool", False, "strength is the share of animals that take its brush"),
)


@dataclass
class Spawn:
    """Where animals come into the world, and which."""

    id: int
    name: str
    polygon: np.ndarray  # (k, 2) m
    species: str = prop("text", "animal", "what they are, for statistics and export")
    brush: str = prop("brush", "", BRUSH, required=True)
    count: int = prop("int", 0, "how many; or give density", low=0, high=int(limits.ANIMALS))  # 0 with a rate: no end
    heading: float | None = prop(  # rad, counter-clockwise from east; None: each its own
        "heading", "random", "random, north-east, ..., or degrees from east", "deg", kept=None
    )
    speed: float | None = prop("number", 0.0, "at the start; 0: the brush's", "m/s", kept=None, low=0, high=1000)
    altitude: float = prop("number", 0.0, "above the ground", "m", low=0, high=FAR)
    depth: float = prop("number", 0.0, "from the lowest to the highest of a flock", "m", low=0, high=FAR)
    start: float = prop("number", 0.0, "when the first appear", "s", low=0, high=1e7)
    rate: float = prop("number", 0.0, "how many a second; 0: all at once", "1/s", low=0, high=1e5)
    formation: str = prop("enum", "scatter", "how they stand at first", enum="Formation")
    body_length: float | None = prop("number", 0.0, "nose to tail; 0: the brush's", "m", kept=None, low=0, high=100)
    program: str = prop("program", "", "a program, by name: states and triggers")
    since: float = 0.0  # s, when it was drawn: its start counts from there
