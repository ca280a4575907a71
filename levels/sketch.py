"""A level drawn by a program: terrain from functions, objects in metres, saved as Tiled would save it."""

from __future__ import annotations

import posixpath

import numpy as np
from flockbrush.engine.files import write_bytes
from flockbrush.levels.level_writer import Document, dump
from flockbrush.levels.schema import CLASSES, IGNORED, SCHEMA
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS, TILE


def _rows(tiles):
    return -(-len(tiles) // COLUMNS) * COLUMNS


TERRAIN_GID = 1
SPEED_GID = TERRAIN_GID + _rows(TERRAINS)
BRUSH_GID = SPEED_GID + _rows(SPEEDS)


class LevelSketch:
    """A new level.

    Parameters
    ----------
    nx, ny : int
        Tiles.
    metres_per_tile : float
    tilesets : str
        Folder of the tilesets, as seen from the level.
    boundary, seed
        Of the map.
    """

    def __init__(self, nx, ny, metres_per_tile, tilesets, boundary="wall", seed=1):
        self.nx, self.ny, self.cell = nx, ny, metres_per_tile
        self.width, self.height = nx * metres_per_tile, ny * metres_per_tile
        self.x, self.y = np.meshgrid((np.arange(nx) + 0.5) * metres_per_tile, (np.arange(ny) + 0.5) * metres_per_tile)
        self.terrain = np.zeros((ny, nx), np.int64)
        data = {
            "compressionlevel": -1,
            "height": ny,
            "infinite": False,
            "layers": [],
            "nextlayerid": 1,
            "nextobjectid": 1,
            "orientation": "orthogonal",
            "properties": [
                {"name": "boundary", "propertytype": "Boundary", "type": "string", "value": boundary},
                {"name": "metres_per_tile", "type": "float", "value": metres_per_tile},
                {"name": "schema", "type": "string", "value": SCHEMA},
                {"name": "seed", "type": "int", "value": seed},
            ],
            "renderorder": "right-down",
            "tiledversion": "1.8.2",
            "tileheight": TILE,
            "tilesets": [
                {"firstgid": gid, "source": posixpath.normpath(f"{tilesets}/{name}")}
                for gid, name in ((TERRAIN_GID, "terrain.tsj"), (SPEED_GID, "speed.tsj"), (BRUSH_GID, "brushes.tsj"))
            ],
            "tilewidth": TILE,
            "type": "map",
            "version": "1.8",
            "width": nx,
        }
        self.document = Document(data, "sketch.tmj")
        self._add({"height": ny, "width": nx, "name": "terrain", "opacity": 1, "type": "tilelayer"})

    # ------------------------------------------------------------ ground

    def ground(self, kind, where=True):
        """Paint terrain where a mask (ny, nx), south row first, is true."""
        self.terrain[np.broadcast_to(where, self.terrain.shape)] = TERRAIN_GID + _terrain(kind)

    def _add(self, node):
        data = self.document.data
        data["layers"].append({**node, "id": data["nextlayerid"], "visible": True, "x": 0, "y": 0})
        data["nextlayerid"] += 1

    # ------------------------------------------------------------ objects

    def draw(self, cls, points, title="", /, closed=True, **properties) -> int:
        """A polygon, polyline or point of a class, on the layer where that class is at home."""
        properties = {k: _as_kind(cls, k, v) for k, v in properties.items()}
        return self.document.add_object(self._home(cls), cls, points, title, closed=closed, **properties)

    def box(self, cls, x, y, width, height, title="", /, turned=0.0, round_=False, **properties) -> int:
        """A rectangle or an ellipse by its centre, in metres, turned counter-clockwise by degrees."""
        number = self.draw(cls, [(x, y)], title, **properties)
        thing = self.document.object(number)[0]
        del thing["point"]
        a = np.deg2rad(turned)
        corner = (
            x - width / 2 * np.cos(a) - height / 2 * np.sin(a),
            y - width / 2 * np.sin(a) + height / 2 * np.cos(a),
        )
        self.document.move_object(number, corner)
        scale = self.document.scale
        thing.update(width=round(width * scale, 6), height=round(height * scale, 6), rotation=-turned)
        if round_:
            thing["ellipse"] = True
        return number

    def picture(self, name, image, **properties):
        """An image layer; its picture is a file beside the level."""
        entries = [{"name": k, "type": "float", "value": v} for k, v in sorted(properties.items())]
        self._add({"image": image, "name": name, "opacity": 0.3, "properties": entries, "type": "imagelayer"})

    def note(self, x, y, text, width=20.0, height=5.0):
        """A text for people, on the layer "notes", by its north-west corner, in metres."""
        data, scale = self.document.data, self.document.scale
        layer = next((node for node in data["layers"] if node["name"] == IGNORED[0]), None)
        if layer is None:
            self._add({"draworder": "topdown", "name": IGNORED[0], "objects": [], "opacity": 1, "type": "objectgroup"})
            layer = data["layers"][-1]
        number, data["nextobjectid"] = data["nextobjectid"], data["nextobjectid"] + 1
        layer["objects"].append({
            "height": height * scale, "id": number, "name": "", "rotation": 0,
            "text": {"text": text, "wrap": True}, "type": "", "visible": True, "width": width * scale,
            "x": x * scale, "y": (self.height - y) * scale,
        })  # fmt: skip

    def _home(self, cls):
        home = CLASSES[cls].home
        if all(node["name"] != home for node, _, _ in self.document.layers()):
            self._add({"draworder": "topdown", "name": home, "objects": [], "opacity": 1, "type": "objectgroup"})
            self.document.layer(home)[0]["color"] = CLASSES[cls].colour
        return home

    def save(self, path):
        """Write the level; the same bytes every time."""
        self.document.layer("terrain")[0]["data"] = self.terrain[::-1].ravel().tolist()
        return write_bytes(path, dump(self.document.data).encode())


def _terrain(kind):
    return [t["name"] for t in TERRAINS].index(kind)


def _as_kind(cls, name, value):
    p = CLASSES[cls].property(name)
    return float(value) if p is not None and p.kind == "number" else value
