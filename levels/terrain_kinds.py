"""Kinds of ground: what a tile of class Terrain may say, and the kinds of the shipped tileset.

A property of the ground is declared here once (`terrain_property`).  Then Tiled, the level reader, painting, undo, the
JSON schemas and the tables of the documentation know it, and systems ask for it with `Landscape.ground_at`.  Installed
packages declare theirs in modules under the entry point group ``flockbrush.terrain``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from flockbrush.engine.plugins import load_entry_points
from flockbrush.levels.level_class import Property

PROPERTIES: list[Property] = [
    Property("name", "text", "", "name of the ground"),
    Property("colour", "colour", "#b8c49a", "colour in pictures"),
]


def terrain_property(
    name: str, default: bool | float, meaning: str, unit: str = "", low: float | None = None, high: float | None = None
) -> None:
    """Give every kind of ground a further property; a second call with the same name replaces the first.

    Parameters
    ----------
    name : str
        As Tiled shows it, and as systems ask for it.
    default : bool or float
        What a tile without it has, and ground on which nothing is painted.
    meaning, unit : str
        For people.
    low, high : float, optional
        Inclusive bounds of a number.

    Raises
    ------
    ValueError
        When the default is no number or outside the bounds, or of another kind than that of a property replaced.
    """
    number = isinstance(default, (int, float))
    if not number or (low is not None and default < low) or (high is not None and default > high):
        raise ValueError(
            f"terrain property {name!r}: its default must be a bool or a number within bounds: {default!r}"
        )
    kind = "bool" if isinstance(default, bool) else "number"
    before = next((p for p in PROPERTIES if p.name == name), None)
    if before is not None and before.kind != kind:
        raise ValueError(f"terrain property {name!r} is a {before.kind}; its default must be one, got {default!r}")
    PROPERTIES[:] = [p for p in PROPERTIES if p.name != name]
    PROPERTIES.append(Property(name, kind, default, meaning, unit, low, high))


terrain_property("walkable", True, "false: animals cannot walk on it")
terrain_property("speed_factor", 1.0, "factor on the speed; smaller is slower", low=0.01, high=10)
terrain_property(
    "cost", 1.0, "cost per metre of the way to a goal; larger values are avoided more", low=0.01, high=1000
)
terrain_property("blocks_view", False, "true: animals cannot see through it")
load_entry_points("flockbrush.terrain")  # before the first level is read


def default_terrain() -> dict[str, Any]:
    """The values of ground on which nothing is painted."""
    return {p.name: p.default for p in PROPERTIES if p.name not in ("name", "colour")}


@dataclass
class TerrainKind:
    """A kind of ground that a tileset has, painted or not; its properties are attributes."""

    name: str
    colour: str  # "#rrggbb"
    values: dict[str, Any] = field(default_factory=default_terrain)

    def __getattr__(self, name):
        return _value(self, name)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> TerrainKind:
        """The kind that a tile of class Terrain describes."""
        more = {name: values.get(name, default) for name, default in default_terrain().items()}
        return cls(values["name"], values["colour"], more)


@dataclass
class Terrain:
    """The ground, cell by cell; arrays are [iy, ix] with iy = 0 at the south edge; properties are attributes."""

    values: dict[str, np.ndarray]  # (ny, nx) of each property
    index: np.ndarray  # int16, into names; -1 where nothing is painted
    names: list[str]  # of the kinds, "grass"
    colours: list[str]  # of the kinds, "#rrggbb"

    def __getattr__(self, name):
        return _value(self, name)

    @classmethod
    def blank(cls, shape: tuple[int, int]) -> Terrain:
        """Ground on which nothing is painted."""
        values = {name: np.full(shape, default) for name, default in default_terrain().items()}
        return cls(values, np.full(shape, -1, np.int16), [], [])

    def put(self, cells: np.ndarray, kind: Mapping[str, Any], number: int | None = None) -> int:
        """Make cells a kind of ground, by its values of class Terrain; its number among the kinds."""
        for name, values in self.values.items():
            values[cells] = kind[name]
        if number is None:
            number = len(self.names)
            self.names.append(kind["name"])
            self.colours.append(kind["colour"])
        self.index[cells] = number
        return number

    def padded(self, pad: tuple[tuple[int, int], tuple[int, int]]) -> Terrain:
        """The same ground with blank cells around it, as `numpy.pad` counts them."""
        blank = default_terrain()
        values = {name: np.pad(grid, pad, constant_values=blank[name]) for name, grid in self.values.items()}
        return Terrain(values, np.pad(self.index, pad, constant_values=-1), self.names, self.colours)


def _value(thing, name):
    values = thing.__dict__.get("values", {})  # none yet while a copy is being made
    if name not in values:
        raise AttributeError(f"{type(thing).__name__} has no {name!r}")
    return values[name]


def _ground(name, colour, **values):
    return {"name": name, "colour": colour, **default_terrain(), **values}


# The kinds of the shipped tileset.  The order is the tile ids that saved levels use: add at the end only.
# speed factors and costs by eye
TERRAINS = [
    _ground("grass", "#9cb86a"),
    _ground("meadow", "#aac476"),
    _ground("dry grass", "#c9bb7c"),
    _ground("dirt", "#b08d62"),
    _ground("road", "#cbb993", speed_factor=1.1, cost=0.7),
    _ground("sand", "#e0d2a0", speed_factor=0.85, cost=1.3),
    _ground("gravel", "#b3ada0", speed_factor=0.9, cost=1.2),
    _ground("mud", "#83705a", speed_factor=0.5, cost=3.0),
    _ground("rock", "#928d86", speed_factor=0.7, cost=2.5),
    _ground("cliff", "#5f5a55", walkable=False, cost=1.0, blocks_view=True),
    _ground("deep water", "#4f86b5", walkable=False),
    _ground("water", "#6ea6cc", speed_factor=0.8, cost=1.5),
    _ground("shallows", "#9cc8dc", speed_factor=0.6, cost=2.0),
    _ground("snow", "#eef1f4", speed_factor=0.75, cost=1.5),
    _ground("forest floor", "#6f8f52", speed_factor=0.85, cost=1.4),
    _ground("thicket", "#47683c", speed_factor=0.4, cost=5.0, blocks_view=True),
]
