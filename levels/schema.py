"""What a level is made of: the dataclasses the rest of the program sees, and the table of what Tiled may say.

`CLASSES` is the one description of every custom class, property, default, unit and bound.  The reader checks
against it, the Tiled project is generated from it, and so are the tables in the documentation.  Everything read is in
metres, seconds and radians, x east, y north, polygons counter-clockwise; what a designer types is in the units below.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from flockbrush.components.level_things import (
    BRUSH,
    EDGE,
    PAINT_BOUNDS,
    ZONE,
    Exit,
    Goal,
    Guide,
    Obstacle,
    Spawn,
    properties_of,
)
from flockbrush.engine import limits
from flockbrush.engine.problems import Problem
from flockbrush.engine.raster import Raster
from flockbrush.levels.level_class import ObjectClass, Property
from flockbrush.levels.terrain_kinds import PROPERTIES, Terrain, TerrainKind
from flockbrush.systems.marks import Area, Key, Line, PaintBounds, Zone

SCHEMA = "flockbrush-level/1"
PROJECT_FILE = "flockbrush.tiled-project"

COMPASS = {
    "east": 0.0,
    "north-east": 45.0,
    "north": 90.0,
    "north-west": 135.0,
    "west": 180.0,
    "south-west": 225.0,
    "south": 270.0,
    "south-east": 315.0,
}


# ---------------------------------------------------------------- what the reader gives


@dataclass
class BrushLayer:
    """Behaviour painted on the ground: ``assets[index]`` where index >= 0."""

    name: str
    weight: float  # the layer's opacity, 0..1
    assets: list[str]
    index: np.ndarray  # int16
    bounds: PaintBounds = field(default_factory=PaintBounds)  # species that it binds

    @property
    def plain(self):
        """Whether it binds as what is painted by hand does."""
        return self.bounds == PaintBounds()


@dataclass
class Level:
    """One level, ready to be built into a world."""

    name: str
    path: Path
    width: float  # m
    height: float  # m
    cell: float  # m, one tile
    boundary: str  # wall | wrap | open | despawn
    seed: int
    terrain: Terrain | None = None
    height_map: Raster | None = None  # m
    brush_layers: list[BrushLayer] = field(default_factory=list)
    cap: Raster | None = None  # m/s, inf for none
    factor: Raster | None = None
    obstacles: list[Obstacle] = field(default_factory=list)
    guides: list[Guide] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    zones: list[Zone] = field(default_factory=list)
    spawns: list[Spawn] = field(default_factory=list)
    exits: list[Exit] = field(default_factory=list)
    script: list[Key] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    areas: list[Area] = field(default_factory=list)
    kinds: list[TerrainKind] = field(default_factory=list)  # of ground, in all tilesets, painted or not
    programs: dict[str, Any] = field(default_factory=dict)  # {name: Program}, all that the level names
    files: dict[str, bytes] = field(default_factory=dict, repr=False)  # all that was read; the level itself first
    paths: dict[str, bytes] = field(default_factory=dict, repr=False)  # measured paths that its world follows
    warnings: list[Problem] = field(default_factory=list)  # what may be and is rarely meant
    art: Any = None  # `flockbrush.levels.art.Art` of layers that are not ours

    @property
    def shape(self):
        """(ny, nx) cells."""
        return round(self.height / self.cell), round(self.width / self.cell)

    @property
    def agents(self) -> int:
        """Animals the level asks for, those with a rate and no count left out."""
        return sum(spawn.count for spawn in self.spawns)


# ---------------------------------------------------------------- what Tiled may say


def _spawn_properties() -> tuple[Property, ...]:
    """Those of a spawn, with the density from which the reader counts animals."""
    species, brush, count, *others = properties_of(Spawn)
    density = Property("density", "number", 0.0, "animals per square metre; or give count", "1/m^2", low=0, high=1000)
    return species, brush, count, density, *others


CLASSES: dict[str, ObjectClass] = {
    c.name: c
    for c in (
        ObjectClass(
            "FlockbrushLevel",
            "map",
            "",
            "#5a7d3a",
            "the map itself",
            (
                Property("schema", "text", SCHEMA, "version of the level format", required=True),
                Property("metres_per_tile", "number", 1.0, "size of a tile", "m", above=0, high=1000),
                Property(
                    "boundary",
                    "enum",
                    "wall",
                    "behaviour of the map edge; beyond an open one nothing is painted",
                    enum="Boundary",
                ),
                Property("seed", "int", 1, "random seed of the run", low=0, high=2**31 - 1),
                Property(
                    "ground_rules",
                    "text",
                    "",
                    "meaning of tiles in other layers, one rule per line",
                    longest=limits.GROUND_RULES * limits.PROPERTY_TEXT,
                ),
            ),
        ),
        ObjectClass(
            "Terrain",
            "tile",
            "terrain",
            "#7aa04a",
            "a kind of ground",
            PROPERTIES,
        ),
        ObjectClass(
            "Brush",
            "tile",
            "brush",
            "#c05a7a",
            "a brush painted on the ground; the opacity of the layer is its weight",
            (Property("asset", "brush", "", BRUSH, required=True),),
        ),
        ObjectClass(
            "SpeedCap",
            "tile",
            "speed",
            "#d08a2a",
            "a speed limit or factor painted on the ground",
            (
                Property("max_speed", "number", 0.0, "speed limit; 0: none", "m/s", low=0, high=1000),
                Property("factor", "number", 1.0, "factor on the speed", low=0.01, high=10),
            ),
        ),
        ObjectClass(
            "Height",
            "layer",
            "height",
            "#8a7a6a",
            "a grey-scale height picture stretched over the map; slopes slow animals and turn them",
            (Property("metres_per_level", "number", 0.1, "height of one grey level", "m", above=0, high=1000),),
        ),
        ObjectClass(
            "BrushLayer",
            "layer",
            "brush",
            "#c05a7a",
            "the species that a painted layer affects, and its weight",
            (
                *PAINT_BOUNDS,
                Property(
                    "blend",
                    "enum",
                    "cover",
                    "use of the layer's opacity: mix: weight of its brush in each animal; share: share of the "
                    "animals that take its brush; cover: ignored, all animals take its brush",
                    enum="Blend",
                ),
                EDGE,
            ),
        ),
        ObjectClass(
            "Obstacle",
            "object",
            "obstacles",
            "#6a5a4a",
            "a shape that animals cannot enter",
            (
                *properties_of(Obstacle),
                Property(
                    "corners",
                    "text",
                    "",
                    "corners of a hull, 'east north up; ...' in m from the centre of its base",
                ),
            ),
            shapes=("area",),
        ),
        ObjectClass(
            "Guide",
            "object",
            "guides",
            "#2a7ab8",
            "an arrow that leaders follow, from its first point to its last",
            properties_of(Guide),
            shapes=("line",),
        ),
        ObjectClass(
            "Goal",
            "object",
            "goals",
            "#2a9a5a",
            "a place that animals go to",
            properties_of(Goal),
            shapes=("point", "area"),
        ),
        ObjectClass(
            "Zone",
            "object",
            "zones",
            "#8a5ab8",
            "an area that affects animals inside it; give a brush, a max_speed, a factor or an event",
            ZONE,
            shapes=("area",),
        ),
        ObjectClass(
            "Spawn",
            "object",
            "spawns",
            "#d0a02a",
            "an area in which animals are created",
            _spawn_properties(),
            shapes=("area",),
        ),
        ObjectClass(
            "Exit", "object", "exits", "#b83a3a", "an area that removes the animals that enter it", shapes=("area",)
        ),
        ObjectClass(
            "Key",
            "object",
            "script",
            "#4a4a8a",
            "a timed command; its other properties are the command's arguments",
            (
                Property("at", "number", 0.0, "time after the start", "s", low=0, high=1e7),
                Property("command", "text", "", "name of the command", required=True),
            ),
            shapes=("point", "area", "line"),
            open=True,
        ),
        ObjectClass(
            "Line",
            "object",
            "measure",
            "#3a3a3a",
            "a line on which crossings are counted, reported by the object's name",
            shapes=("line",),
        ),
        ObjectClass(
            "Area",
            "object",
            "measure",
            "#5a5a5a",
            "an area in which density is measured, reported by the object's name",
            shapes=("area",),
        ),
    )
}

# Which classes an object layer's plain, classless objects take.
HOMES = {c.home: c.name for c in CLASSES.values() if c.use == "object" and c.home != "measure"}
LAYER_NAMES = ("terrain", "brush", "speed", "height", *HOMES, "measure")
IGNORED = ("notes", "decor")  # layers whose names begin so are the designer's own
GROUP = "flockbrush"  # where a map has a group of this name, our layers are those in it
