"""How a custom class of Tiled is described: its properties with their kinds, units and bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flockbrush.components.level_things import ENUMS, Property

__all__ = ["ENUMS", "ObjectClass", "Property"]


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
