"""How a custom class of Tiled is described: its properties with their kinds, units and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

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


@dataclass(frozen=True)
class ObjectClass:
    """One custom class: what may carry it, which shapes it takes, and its properties."""

    name: str
    use: str  # "map", "tile", "layer" or "object"
    home: str  # name of the layer its objects are drawn on
    colour: str
    meaning: str
    properties: Sequence[Property] = ()
    shapes: tuple[str, ...] = ()  # "area", "line", "point"
    open: bool = False  # takes further properties (the arguments of a command)

    def property(self, name) -> Property | None:
        """The property of this name."""
        return next((p for p in self.properties if p.name == name), None)
