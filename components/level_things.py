"""Things of a level, each declared once: as the reader gives them, a designer sees them and the world keeps them.

A field that a designer may set is a `prop`: its kind, default, meaning, unit and bounds make the custom class in Tiled,
the reader's checks, the tables of the documentation, the tips of forms and the checks of commands.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

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
    """One custom property as a designer sees it.

    Parameters
    ----------
    kind : {"number", "int", "bool", "text", "colour", "enum", "heading", "brush", "program", "goal"}
        ``heading`` is "random", a compass point or degrees counter-clockwise from east; ``brush``, ``program`` and
        ``goal`` are names that must exist.
    default
        What an absent property means.  Tiled does not write defaults, so this is the only place they are.
    low, high : float
        Inclusive bounds.
    above : float
        Exclusive lower bound.
    """

    name: str
    kind: str
    default: Any
    meaning: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    above: float | None = None
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


def prop(kind, default, meaning, unit="", **bounds) -> Any:
    """A field of a thing that a designer may set, a `Property` by the name of the field."""
    return field(default=default, metadata={"property": Property("", kind, default, meaning, unit, **bounds)})


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
