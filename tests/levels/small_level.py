"""The smallest level there is, to be spoiled by tests: ten by ten tiles of 16 px and 2 m, four kinds, a herd."""

import copy
import json
import math
import time
from dataclasses import dataclass
from types import SimpleNamespace

import cv2
import pytest
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.reader import read_level_files
from flockbrush.levels.schema import Level

GRASS, WALL, MARCH, SLOW, PLAIN = 1, 2, 3, 4, 5


class Shelf:
    """A library of two brushes whose animals are 1 m long."""

    brushes = ("march", "graze")

    def names(self):
        return list(self.brushes)

    def get(self, name):
        if name not in self.brushes:
            raise ProblemsError([])
        body = SimpleNamespace(length=1.0, radius=0.2)
        return SimpleNamespace(name=name, model="herd", body=body, has_own_body=True)

    def with_files(self, files):
        assert not files
        return self


@dataclass(frozen=True)
class Gust:
    """A command for scripts."""

    strength: float
    x: float
    y: float
    radius: float = 1.0
    brush: str = ""


def properties(**values):
    """As Tiled writes them."""
    kinds = {bool: "bool", int: "int", float: "float", str: "string"}
    return [{"name": k, "type": kinds[type(v)], "value": v} for k, v in values.items()]


def thing(number, cls, x, y, width=0, height=0, name="", extra=None, **values):
    """An object; x, y, width, height in px, y down."""
    made = {"id": number, "name": name, "type": cls, "x": x, "y": y, "width": width, "height": height, "rotation": 0}
    return {**made, "visible": True, "properties": properties(**values), **(extra or {})}


def polyline(*points):
    """The shape of a line object."""
    return {"polyline": [{"x": x, "y": y} for x, y in points]}


def polygon(*points):
    """The shape of a polygon object."""
    return {"polygon": [{"x": x, "y": y} for x, y in points]}


def png(picture):
    """An array as a PNG file."""
    return cv2.imencode(".png", picture)[1].tobytes()


def herd(**values):
    """A spawn of 16 x 12 m with its corner at (4, 4) m from the north-west."""
    return thing(1, "Spawn", 32, 32, 128, 96, "herd A", **{"brush": "march", "count": 12, **values})


def tiles(name="terrain", gids=None, **more):
    """A tile layer of ten by ten."""
    return {
        "type": "tilelayer",
        "name": name,
        "width": 10,
        "height": 10,
        "x": 0,
        "y": 0,
        "opacity": 1,
        "data": [GRASS] * 100 if gids is None else gids,
        **more,
    }


def objects(name, *things, **more):
    """An object layer."""
    return {"type": "objectgroup", "name": name, "objects": list(things), "opacity": 1, **more}


def tileset():
    """Grass, wall, a brush, a speed, and a tile that says nothing."""
    meanings = [
        {"id": 0, "type": "Terrain", "properties": properties(name="grass")},
        {"id": 1, "type": "Terrain", "properties": properties(name="wall", walkable=False, blocks_view=True)},
        {"id": 2, "type": "Brush", "properties": properties(asset="march")},
        {"id": 3, "type": "SpeedCap", "properties": properties(max_speed=1.5, factor=0.5)},
    ]
    return {"name": "kinds", "tilecount": 5, "tilewidth": 16, "tileheight": 16, "columns": 5, "tiles": meanings}


def level(*layers, **more):
    """The document; with no layers, grass and a herd."""
    document = {
        "type": "map",
        "orientation": "orthogonal",
        "infinite": False,
        "width": 10,
        "height": 10,
        "tilewidth": 16,
        "tileheight": 16,
        "properties": properties(schema="flockbrush-level/1", metres_per_tile=2.0),
        "tilesets": [{"firstgid": 1, **tileset()}],
        "layers": list(layers) or [tiles(), objects("spawns", herd())],
        **more,
    }
    return copy.deepcopy(document)


def with_objects(layer, *things, **more):
    """The small level with one more object layer."""
    return level(tiles(), objects("spawns", herd()), objects(layer, *things, **more))


def read(document, files=None, indent=1):
    """The `Level` of a document, or of its text."""
    text = document if isinstance(document, str | bytes) else json.dumps(document, indent=indent)
    data = text if isinstance(text, bytes) else text.encode()
    return read_level_files({"small.tmj": data, **(files or {})}, library=Shelf(), commands={"Gust": Gust})


def problems(document, files=None, indent=1):
    """Everything that is wrong, a list of lines."""
    with pytest.raises(ProblemsError) as caught:
        read(document, files, indent)
    return [str(p) for p in caught.value.problems]


def problem(document, files=None, indent=1):
    """The one thing that is wrong."""
    found = problems(document, files, indent)
    assert len(found) == 1, found
    return found[0]


def rich():
    """A level with one of everything, and its tileset: {name: document}."""
    point = {"point": True}
    layers = [
        tiles(),
        {"type": "group", "name": "g", "layers": [tiles("brush", [MARCH] * 100, opacity=0.5)], "offsetx": 16},
        tiles("speed", [SLOW] * 100),
        objects("spawns", herd()),
        objects(
            "obstacles",
            thing(2, "Obstacle", 16, 16, 16, 16, extra={"rotation": 30, "ellipse": True}, margin=0.5),
            thing(3, "Obstacle", 140, 16, extra=polygon((0, 0), (10, 0), (10, 10))),
            thing(4, "", 16, 160, 8, 8, extra={"gid": 1}),
        ),
        objects("guides", thing(5, "Guide", 16, 144, extra=polyline((0, 0), (128, -64)), goal="fold")),
        objects("goals", thing(6, "Goal", 80, 80, name="fold", extra=point, on_arrive="stay")),
        objects("zones", thing(7, "Zone", 0, 0, 50, 50, brush="graze", factor=0.5)),
        objects("script", thing(8, "Key", 0, 0, extra=point, at=1.0, command="Gust", strength=2.0)),
        objects("measure", thing(9, "Line", 0, 0, extra=polyline((0, 0), (9, 9))), thing(10, "Area", 0, 0, 9, 9)),
        objects("exits", thing(11, "Exit", 0, 0, 9, 9)),
    ]
    document = level(*layers, tilesets=[{"firstgid": 1, "source": "kinds.tsj"}])
    return {"small.tmj": document, "kinds.tsj": tileset()}


def survives(files, seconds=60.0):
    """A level as it is read, or None with problems of one line each; in good time, also on a busy machine."""
    start = time.perf_counter()
    try:
        result = read_level_files(files, library=Shelf(), commands={"Gust": Gust})
    except ProblemsError as error:
        assert error.problems
        assert all("\n" not in str(p) and len(str(p)) < 2000 for p in error.problems)
        result = None
    else:
        assert isinstance(result, Level)
        assert all(math.isfinite(v) for s in result.spawns for v in s.polygon.ravel())
    assert time.perf_counter() - start < seconds
    return result
