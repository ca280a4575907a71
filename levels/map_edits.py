"""What a designer's commands do to a level's document: tiles, objects, layers, and the way back.

The document is changed by two small steps only, a key set and tiles put, and each is noted, so that undoing is those
steps backwards: to the byte.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import singledispatchmethod
from typing import Any

import numpy as np
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.levels import geometry
from flockbrush.levels.files import DiskFiles
from flockbrush.levels.json_lines import parse
from flockbrush.levels.layer_reader import kind_of
from flockbrush.levels.properties import FilePlace, Report
from flockbrush.levels.reader import LevelReader
from flockbrush.levels.schema import CLASSES, GROUP
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tile_data import FLIP_FLAGS, TileGrid
from flockbrush.levels.tiled import _member, _tile
from flockbrush.levels.tileset_reader import TilesetReader
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS
from flockbrush.levels.writer import dump
from flockbrush.systems.commands import AddObstacle, MoveGoal, PaintBrush, PaintCap, PaintCells, RemoveObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, PlaceGoal, RemoveThing
from flockbrush.systems.painting import blended, cells_of

PLAYGROUND = "playground"  # name of the tileset that holds what the level's own tilesets lack
NAMES = {"brush": "Brush", "cap": "SpeedCap", "surface": "Terrain"}  # class of a layer's tiles
HOME = {"brush": "brush", "cap": "speed", "surface": "terrain"}  # where they are painted
OPACITY = {"brush": 0.4, "cap": 0.5, "surface": 1}
_MISSING: Any = object()
_ANY_FLAG = np.uint32(~FLIP_FLAGS & 0xFFFFFFFF)
_SAME = 1e-6  # m


class EditError(ValueError):
    """The level's file cannot take this edit; the text says why."""


@dataclass
class KeySet:
    """A key of a node was set, or taken out."""

    node: dict
    key: str
    before: Any
    after: Any

    def back(self):
        """As it was."""
        _put(self.node, self.key, self.before)

    def again(self):
        """As it became."""
        _put(self.node, self.key, self.after)


def _put(node, key, value):
    if value is _MISSING:
        node.pop(key, None)
    else:
        node[key] = value


@dataclass
class TilesPut:
    """Tiles of a layer were set."""

    grid: TileGrid
    rows: np.ndarray
    columns: np.ndarray
    before: np.ndarray
    after: np.ndarray

    def back(self):
        """As they were."""
        self.grid.put(self.rows, self.columns, self.before)

    def again(self):
        """As they became."""
        self.grid.put(self.rows, self.columns, self.after)


@dataclass
class TileLayer:
    """A tile layer of ours, out of its groups."""

    grid: TileGrid
    left: int  # cells from the west edge of the map to that of the layer
    top: int  # rows from the north edge
    weight: float
    covers: bool  # the whole map

    def at(self, iy, ix, ny):
        """(rows, columns, inside) of cells, south row first, in this layer."""
        rows, columns = ny - 1 - iy - self.top, ix - self.left
        inside = (rows >= 0) & (rows < self.grid.height) & (columns >= 0) & (columns < self.grid.width)
        return rows, columns, inside


class EditedMap:
    """A document that commands can change.

    Parameters
    ----------
    document : Document
    library : BrushLibrary
        Knows which brush a tile means that names a file.
    files : DiskFiles or MemoryFiles, optional
        Where the tilesets are read from; beside the level unless told.

    Raises
    ------
    ProblemsError
        When a tileset cannot be read.
    """

    def __init__(self, document, library, files=None):
        self.document, self.data = document, document.data
        self.files = DiskFiles(document.path) if files is None else files
        self.changes: list = []
        self.ny, self.nx = self.data["height"], self.data["width"]
        self._grids: dict[int, TileGrid] = {}
        self._fresh: tuple = (None, {})
        self._read_tilesets(library)

    def _read_tilesets(self, library):
        report = Report()
        reader = LevelReader(self.files, report, library)
        tiles = TilesetReader(self.files, FilePlace(report, str(self.document.path), None))
        tiles.read(parse(dump(self.data).encode(), limits.JSON_DEPTH))
        if report.problems:
            raise ProblemsError(report.problems)
        self.meaning: dict[int, tuple] = {}  # of a global tile id: ("brush", name), ("cap", (max_speed, factor)), ...
        self.ends = {t.firstgid: t.firstgid + t.count for t in tiles.tilesets}
        for tileset in tiles.tilesets:
            if not tileset.name.startswith(PLAYGROUND):
                for number, tile in tileset.tiles.items():
                    meaning = _meaning(reader, tile)
                    if meaning is not None:
                        self.meaning[tileset.firstgid + number] = meaning

    # ------------------------------------------------------------ the two small steps

    def set(self, node, key, value):
        """Set a key of a node of the document."""
        before = node.get(key, _MISSING)
        if before is _MISSING or value is _MISSING or before is not value:
            self.changes.append(KeySet(node, key, before, value))
            _put(node, key, value)

    def put(self, layer, iy, ix, gids):
        """Set tiles of a layer; cells outside of it are left out."""
        rows, columns, inside = layer.at(iy, ix, self.ny)
        rows, columns, gids = rows[inside], columns[inside], np.broadcast_to(gids, iy.shape)[inside]
        before = layer.grid.gids[rows, columns]
        new = (before & _ANY_FLAG) != gids
        if new.any():
            change = TilesPut(layer.grid, rows[new], columns[new], before[new], gids[new].astype(np.uint32))
            change.again()
            self.changes.append(change)

    def settle(self):
        """Write all tiles into the document."""
        for grid in self._grids.values():
            grid.settle()

    def constants(self):
        """What copies of this have in common."""
        return self.files, _MISSING

    def find_grids(self):
        """In a copy: know the layers again, which are other objects now."""
        self._grids = {id(grid.node): grid for grid in self._grids.values()}

    def taken(self):
        """The steps since the last call."""
        changes, self.changes = self.changes, []
        return changes

    # ------------------------------------------------------------ layers

    @property
    def home(self):
        """The document, or the group in it, whose layers are ours."""
        groups = (node for node in self.data["layers"] if node.get("type") == "group")
        return next((node for node in groups if node.get("name") == GROUP), self.data)

    def layers(self, nodes=None, dx=0.0, dy=0.0, opacity=1.0):
        """(node, dx, dy, opacity) of every layer of ours out of its groups, px."""
        if nodes is None:
            nodes = self.data["layers"] if self.home is self.data else [self.home]
        for node in nodes:
            x, y = dx + node.get("offsetx", 0), dy + node.get("offsety", 0)
            weight = opacity * min(max(node.get("opacity", 1), 0.0), 1.0)
            if node.get("type") == "group":
                yield from self.layers(node["layers"], x, y, weight)
            else:
                yield node, x, y, weight

    def tile_layers(self, layer):
        """The tile layers of a kind that count, in order."""
        tile = self.data["tilewidth"]
        found = []
        for node, dx, dy, weight in self.layers():
            if node.get("type") != "tilelayer" or kind_of(node.get("name", "")) != HOME[layer]:
                continue
            if layer == "brush" and (weight <= 0 or _binds_some(node)):
                continue
            left, top = round(dx / tile) + node.get("x", 0), round(dy / tile) + node.get("y", 0)
            grid = self.grid(node)
            covers = left <= 0 and top <= 0 and left + grid.width >= self.nx and top + grid.height >= self.ny
            found.append(TileLayer(grid, left, top, weight, covers))
        return found

    def grid(self, node):
        """The unpacked tiles of a layer."""
        if id(node) not in self._grids:
            self._grids[id(node)] = TileGrid(node)
        return self._grids[id(node)]

    def winning(self, layer, found):
        """The layer that shows when all are painted, added if there is none, and those of the others above it."""
        weights = [k.weight if layer == "brush" else 0.0 for k in found]
        order = sorted(range(len(found)), key=lambda k: (weights[k], k))
        covering = [k for k in order if found[k].covers]
        if not covering:
            grid = self.grid(self.add_tile_layer(layer))
            return TileLayer(grid, 0, 0, OPACITY[layer], True), found
        return found[covering[-1]], [found[k] for k in order[order.index(covering[-1]) + 1 :]]

    def add_tile_layer(self, layer):
        """A new layer for a kind of tiles, ground below all, the others above the last tile layer."""
        node = {
            "data": [0] * (self.nx * self.ny), "height": self.ny, "id": self._next("nextlayerid"),
            "name": self._free_name(HOME[layer]), "opacity": OPACITY[layer], "type": "tilelayer", "visible": True,
            "width": self.nx, "x": 0, "y": 0,
        }  # fmt: skip
        nodes = self.home["layers"]
        last = max((k for k, n in enumerate(nodes) if n.get("type") == "tilelayer"), default=-1)
        self._insert_layer(node, 0 if layer == "surface" else last + 1)
        return node

    def object_layer(self, cls):
        """(layer, dx, dy) where objects of a class are at home; added if there is none."""
        home = CLASSES[cls].home
        for node, dx, dy, _ in self.layers():
            if node.get("type") == "objectgroup" and kind_of(node.get("name", "")) == home:
                return node, dx, dy
        node = {
            "color": CLASSES[cls].colour, "draworder": "topdown", "id": self._next("nextlayerid"), "name": home,
            "objects": [], "opacity": 1, "type": "objectgroup", "visible": True, "x": 0, "y": 0,
        }  # fmt: skip
        self._insert_layer(node, len(self.home["layers"]))
        return node, 0.0, 0.0

    def _insert_layer(self, node, at):
        nodes = self.home["layers"]
        self.set(self.home, "layers", [*nodes[:at], node, *nodes[at:]])

    def _free_name(self, name):
        names = {node.get("name") for node, *_ in self.layers()}
        return next(n for n in (f"{name} {k}".removesuffix(" 1") for k in itertools.count(1)) if n not in names)

    def _next(self, key):
        """The next free id of layers or objects, which is then taken."""
        number = self.next_free(key)
        self.set(self.data, key, number + 1)
        return number

    def next_free(self, key):
        """The next free id of layers or objects."""
        layers = key == "nextlayerid"
        nodes = list(_nodes(self.data["layers"]))
        ids = [n.get("id", 0) for n in (nodes if layers else [o for n in nodes for o in n.get("objects", [])])]
        return max(int(self.data.get(key, 1)), max(ids, default=0) + 1)

    # ------------------------------------------------------------ tiles

    def meanings(self):
        """{gid: meaning} of every tile there is now."""
        tilesets = self.data.get("tilesets", [])
        if tilesets is not self._fresh[0]:
            fresh = {}
            for entry in tilesets:
                if "source" not in entry and str(entry.get("name", "")).startswith(PLAYGROUND):
                    fresh |= {entry["firstgid"] + tile["id"]: _told(tile) for tile in entry.get("tiles", [])}
            self._fresh = tilesets, self.meaning | fresh
        return self._fresh[1]

    def gid(self, meaning):
        """The tile of this meaning, added to the tileset "playground" if no tileset has it."""
        found = min((gid for gid, other in self.meanings().items() if other == meaning), default=None)
        return self._new_tile(meaning) if found is None else found

    def _new_tile(self, meaning):
        cls, values = _values(meaning)
        entry = self._roomy()
        used = [tile["id"] for tile in entry["tiles"]]
        number = max(used, default=-1) + 1
        rows = number // COLUMNS + 1
        tile = self.data["tilewidth"]
        made = entry | {
            "imageheight": rows * tile, "tilecount": rows * COLUMNS,
            "tiles": [*entry["tiles"], _tile(number, cls, values)],
        }  # fmt: skip
        others = [e for e in self.data.get("tilesets", []) if e["firstgid"] != entry["firstgid"]]
        self.set(self.data, "tilesets", [*others, made])
        return entry["firstgid"] + number

    def _roomy(self):
        """The tileset "playground" with room for one more tile, perhaps a new one."""
        tilesets = self.data.get("tilesets", [])
        last = max(tilesets, key=lambda e: e["firstgid"], default=None)
        if last is not None and str(last.get("name", "")).startswith(PLAYGROUND) and "source" not in last:
            return {"tiles": [], **last}
        ends = [self.ends.get(e["firstgid"], e["firstgid"] + e.get("tilecount", 0)) for e in tilesets]
        tile, count = self.data["tilewidth"], sum(str(e.get("name", "")).startswith(PLAYGROUND) for e in tilesets)
        return {
            "columns": COLUMNS, "firstgid": max(ends, default=1), "image": self.picture_name(count),
            "imagewidth": COLUMNS * tile, "margin": 0, "name": PLAYGROUND + (f" {count + 1}" if count else ""),
            "spacing": 0, "tileheight": tile, "tiles": [], "tilewidth": tile,
        }  # fmt: skip

    def picture_name(self, count=0):
        """The file beside the level that shows the tiles of "playground" in Tiled."""
        return f"{self.document.path.stem}-{PLAYGROUND}{count + 1 if count else ''}.png"

    def playgrounds(self):
        """[(tileset, [meaning or None of each place])] of what was added here."""
        found = []
        for entry in self.data.get("tilesets", []):
            if "source" not in entry and str(entry.get("name", "")).startswith(PLAYGROUND) and "image" in entry:
                tiles = {tile["id"]: _told(tile) for tile in entry.get("tiles", [])}
                found.append((entry, [tiles.get(k) for k in range(entry["tilecount"])]))
        return found

    # ------------------------------------------------------------ objects

    def objects(self):
        """(object, layer, dx, dy) of all."""
        for node, dx, dy, _ in self.layers():
            for thing in node.get("objects", []):
                yield thing, node, dx, dy

    def find(self, number, cls):
        """(object, layer, dx, dy) of the object with this id, or None; EditError when it is something else."""
        found = next((o for o in self.objects() if o[0].get("id") == number), None)
        if found is not None and self.class_of(found[0], found[1]) != cls:
            what = self.class_of(found[0], found[1]) or "nothing of ours"
            raise EditError(f"object {number} of the level is {what}, not {cls}")
        return found

    def class_of(self, thing, node):
        """The class of an object, its own or its layer's."""
        home = kind_of(node.get("name", ""))
        own = thing.get("class") or thing.get("type")
        return own or next((c.name for c in CLASSES.values() if c.use == "object" and c.home == home), "")

    def outline(self, thing, dx, dy):
        """("area" | "line" | "point", (k, 2) m) of an object."""
        kind, points = _drawn(thing)
        points = geometry.turn(points, thing.get("rotation", 0)) + (thing.get("x", 0) + dx, thing.get("y", 0) + dy)
        scale = self.document.scale
        points = np.column_stack([points[:, 0] / scale, (self.document.top - points[:, 1]) / scale])
        points = geometry.without_repeats(points, kind == "area")
        return kind, geometry.counter_clockwise(points) if kind == "area" else points

    def draw(self, number, cls, name, shape, points, told):
        """Add an object, or change the one with this id: its outline only if it is another."""
        found = self.find(number, cls)
        if found is None:
            node, dx, dy = self.object_layer(cls)
            version = str(self.data.get("version", ""))
            thing: dict = {"class" if version == "1.9" else "type": cls}
            thing |= {"height": 0, "id": number, "name": name, "rotation": 0, "visible": True, "width": 0}
            self._shape(thing, shape, points, dx, dy)
        else:
            old, node, dx, dy = found
            thing = {**old, "name": name}
            self._reshape(thing, shape, points, dx, dy)
        self._tell(thing, CLASSES[cls], told)
        self._replace(node, number, thing)
        if number >= self.data.get("nextobjectid", 0):
            self.set(self.data, "nextobjectid", number + 1)

    def _reshape(self, thing, shape, points, dx, dy):
        kind, before = self.outline(thing, dx, dy)
        points = np.asarray(points, float).reshape(-1, 2)
        if kind == shape and len(before) == len(points):
            shift = points - before
            if np.abs(shift).max() < _SAME:
                return
            if np.abs(shift - shift[0]).max() < _SAME:
                scale = self.document.scale
                thing["x"] = round(thing.get("x", 0) + float(shift[0, 0]) * scale, 6)
                thing["y"] = round(thing.get("y", 0) - float(shift[0, 1]) * scale, 6)
                return
        for key in ("polygon", "polyline", "point", "ellipse", "capsule", "gid"):
            thing.pop(key, None)
        thing |= {"height": 0, "rotation": 0, "width": 0}
        self._shape(thing, shape, points, dx, dy)

    def _shape(self, thing, shape, points, dx, dy):
        px = self.document.pixels(points) - (dx, dy)
        thing["x"], thing["y"] = (round(float(v), 6) for v in px[0])
        if shape == "point":
            thing["point"] = True
            return
        start = thing["x"], thing["y"]
        corners = [{"x": round(float(x) - start[0], 6), "y": round(float(y) - start[1], 6)} for x, y in px]
        thing["polygon" if shape == "area" else "polyline"] = corners

    def _tell(self, thing, cls, told):
        """Properties: those that are there change, others are added when they are not the default."""
        entries = [dict(entry) for entry in thing.get("properties", [])]
        whole = next((e for e in entries if isinstance(e["value"], dict) and _is_class(e, cls)), None)
        members = {} if whole is None else dict(whole["value"])
        for name, value in told.items():
            p = cls.property(name)
            entry = next((e for e in entries if e["name"] == name), None)
            if name in members:
                members[name] = value
            elif entry is None:
                if value != p.default or p.required:
                    entries.append({**_member(p, "propertytype"), "value": value})
            elif not (p.kind == "goal" and type(entry["value"]) is int and self._goal(entry["value"]) == value):
                entry |= {"value": value, "type": "string"} if p.kind == "goal" else {"value": value}
        if whole is not None:
            whole["value"] = members
        if entries:
            thing["properties"] = sorted(entries, key=lambda e: e["name"])

    def _goal(self, number):
        """The name of the goal with this id."""
        return next((o.get("name") or f"goal {number}" for o, *_ in self.objects() if o.get("id") == number), "")

    def _replace(self, node, number, thing):
        """Put an object in the place of the one with its id, behind all others when there is none; None: nothing."""
        objects = node.get("objects", [])
        new = [] if thing is None else [thing]
        at = next((k for k, o in enumerate(objects) if o.get("id") == number), len(objects))
        self.set(node, "objects", [*objects[:at], *new, *objects[at + 1 :]])

    def drop(self, number, cls):
        """Take an object out."""
        found = self.find(number, cls)
        if found is None:
            raise EditError(f"the level has no {cls} with id {number}")
        self._replace(found[1], number, None)

    def need_another_spawn(self, number):
        """EditError where this is the level's only spawn: a level without animals is none, and could not be opened."""
        others = [t for t, node, _, _ in self.objects() if t["id"] != number and self.class_of(t, node) == "Spawn"]
        if not others:
            raise EditError("this is the level's only spawn area; draw another first")

    def need_unnamed(self, name):
        """EditError while the level's script names this goal."""
        for thing, node, _, _ in self.objects():
            if self.class_of(thing, node) == "Key":
                told = {p["name"]: p["value"] for p in thing.get("properties", [])}
                if told.get("goal") == name:
                    raise EditError(f"the script names goal {name!r} in object {thing['id']}; change that first")

    # ------------------------------------------------------------ commands

    @singledispatchmethod
    def do(self, command):
        """Change the document as a command changes the world; those that only concern animals change nothing.

        Raises
        ------
        EditError
            When a level's file cannot say this.
        """

    @do.register(PaintBrush)
    @do.register(PaintCap)
    def _(self, command):
        raise EditError(f"{type(command).__name__} belongs to scripts; paint with Paint")

    @do.register
    def _(self, command: Paint):
        iy, ix, weight = command.cells((self.ny, self.nx), 1 / self.document.scale * self.data["tilewidth"])
        self.paint(command.layer, iy, ix, command.value, weight)

    @do.register
    def _(self, command: PaintCells):
        iy, ix, index = cells_of(command.runs)
        for k, value in enumerate(command.names):
            here = index == k
            self.paint(command.layer, iy[here], ix[here], value, np.ones(int(here.sum())))

    def paint(self, layer, iy, ix, value, weight):
        """Paint a value on cells, where ``weight`` is less than 1 a cap only in part."""
        if value is None:
            raise EditError("a level's file does not know how the ground was before")
        found = self.tile_layers(layer)
        if layer == "cap":
            self._paint_cap(found, iy, ix, float(value), weight)
        elif not value:
            for each in found:
                self.put(each, iy, ix, 0)
        else:
            target, above = self.winning(layer, found)
            self.put(target, iy, ix, self.gid((layer, value)))
            for each in above:
                self.put(each, iy, ix, 0)

    def _paint_cap(self, found, iy, ix, value, weight):
        told = [self._speeds(each, iy, ix) for each in found]  # (k, 2) each: cap, factor
        before = np.min([np.full(len(iy), np.inf), *(t[:, 0] for t in told)], axis=0)
        after = blended(before, value if value > 0 else np.inf, weight)
        new = after != before
        if not new.any():
            return
        target = self.winning("cap", found)[0] if np.isfinite(after[new]).any() else None
        for each, speeds in zip(found, told, strict=True):
            if target is None or each.grid is not target.grid:
                self._put_speeds(each, iy[new], ix[new], np.inf, speeds[new, 1])
        if target is not None:
            factor = next((t[:, 1] for e, t in zip(found, told, strict=True) if e.grid is target.grid), None)
            self._put_speeds(target, iy[new], ix[new], after[new], 1.0 if factor is None else factor[new])

    def _speeds(self, layer, iy, ix):
        """(k, 2) cap (m/s, infinite for none) and factor that a layer's tiles say."""
        rows, columns, inside = layer.at(iy, ix, self.ny)
        gids = np.zeros(len(iy), np.uint32)
        gids[inside] = layer.grid.gids[rows[inside], columns[inside]] & _ANY_FLAG
        kinds, which = np.unique(gids, return_inverse=True)
        meanings = self.meanings()
        told = [meanings.get(gid, ("", (0.0, 1.0)))[1] for gid in kinds.tolist()]
        return np.array([(cap or np.inf, factor) for cap, factor in told])[which.ravel()]

    def _put_speeds(self, layer, iy, ix, cap, factor):
        pairs = np.column_stack([np.broadcast_to(cap, iy.shape), np.broadcast_to(factor, iy.shape)])
        kinds, which = np.unique(pairs, axis=0, return_inverse=True)
        gids = [
            0 if math.isinf(c) and f == 1 else self.gid(("cap", (0.0 if math.isinf(c) else c, f))) for c, f in kinds
        ]
        self.put(layer, iy, ix, np.array(gids, np.uint32)[which.ravel()])

    @do.register
    def _(self, command: AddObstacle):
        if command.id:
            names = "solid", "blocks_view", "margin", "z_min", "z_max", "shape"
            told = {name: value for name in names if (value := getattr(command, name)) is not None}
            if command.corners is not None:
                told["corners"] = "; ".join(" ".join(f"{float(v):.12g}" for v in corner) for corner in command.corners)
            self.draw(command.id, "Obstacle", command.name, "area", command.polygon(), told)

    @do.register
    def _(self, command: RemoveObstacle):
        if command.id:
            self.drop(command.id, "Obstacle")
            return
        for thing, node, _, _ in list(self.objects()):
            if thing.get("name") == command.name and self.class_of(thing, node) == "Obstacle":
                self._replace(node, thing["id"], None)

    @do.register
    def _(self, command: DrawGuide):
        told = {name: getattr(command, name) for name in ("strength", "radius", "decay", "goal", "loop")}
        self.draw(command.id, "Guide", command.name, "line", command.points, told)

    @do.register
    def _(self, command: PlaceGoal):
        told = {"radius": command.radius, "on_arrive": command.on_arrive, "next": command.next}
        found = self.find(command.id, "Goal")
        shape, points = "point", np.array([(command.x, command.y)])
        if found is not None:
            if found[0].get("name") != command.name:
                self.need_unnamed(found[0].get("name"))
            before, outline = self.outline(found[0], *found[2:])
            if before == "area":
                shape, points = before, outline + (points[0] - geometry.centroid(outline))
        if command.points:
            shape, points = "area", np.array(command.points, float)
        self.draw(command.id, "Goal", command.name, shape, points, told)

    @do.register
    def _(self, command: MoveGoal):
        for thing, node, dx, dy in list(self.objects()):
            name = thing.get("name") or f"goal {thing.get('id')}"
            if name == command.goal and self.class_of(thing, node) == "Goal":
                shape, outline = self.outline(thing, dx, dy)
                middle = geometry.centroid(outline) if shape == "area" else outline[0]
                moved = outline + (np.array([command.x, command.y]) - middle)
                self.draw(thing["id"], "Goal", thing.get("name", ""), shape, moved, {})
                return
        raise EditError(f"the level has no goal {command.goal!r}")

    @do.register
    def _(self, command: PlaceExit):
        self.draw(command.id, "Exit", command.name, "area", np.array(command.points, float), {})

    @do.register
    def _(self, command: MarkSpawn):
        told = {
            "species": command.species, "brush": command.brush, "count": command.count,
            "heading": "random" if command.heading is None else f"{math.degrees(command.heading):.12g}",
            "speed": command.speed or 0.0, "altitude": command.altitude, "start": command.start,
            "rate": command.rate, "formation": command.formation, "body_length": command.body_length or 0.0,
            "depth": command.depth, "program": command.program,
        }  # fmt: skip
        found = self.find(command.id, "Spawn")
        given = {p["name"] for p in found[0].get("properties", [])} if found else set()
        if "density" in given:
            told["density"] = 0.0
        self.draw(command.id, "Spawn", command.name, "area", np.array(command.points, float), told)

    @do.register
    def _(self, command: RemoveThing):
        cls = command.kind.capitalize()
        if cls == "Goal":
            found = self.find(command.id, cls)
            self.need_unnamed(found[0].get("name") if found else "")
        if cls == "Spawn":
            self.need_another_spawn(command.id)
        self.drop(command.id, cls)


def _drawn(thing):
    """("area" | "line" | "point", (k, 2) px) of an object about its own origin."""
    w, h = thing.get("width", 0), thing.get("height", 0)
    if "polygon" in thing or "polyline" in thing:
        kind, key = ("area", "polygon") if "polygon" in thing else ("line", "polyline")
        return kind, np.array([(p["x"], p["y"]) for p in thing[key]], float).reshape(-1, 2)
    if thing.get("point"):
        return "point", np.zeros((1, 2))
    if thing.get("ellipse"):
        return "area", geometry.ellipse(w, h)
    if thing.get("capsule"):
        return "area", geometry.capsule(w, h)
    return "area", geometry.rectangle(w, h) - (0, h if "gid" in thing else 0)


def _is_class(entry, cls):
    """Whether a property holds all of a class as one value."""
    return (entry.get("propertytype") or entry["name"]).lower() == cls.name.lower()


def _binds_some(node):
    """Whether a brush layer says whom it binds or how strongly: what is painted by hand belongs to none of those."""
    cls, told = CLASSES["BrushLayer"], {}
    for entry in node.get("properties", []):
        told |= entry["value"] if _is_class(entry, cls) and isinstance(entry["value"], dict) else {
            entry["name"]: entry["value"]
        }  # fmt: skip
    return any(told.get(one.name, one.default) != one.default for one in cls.properties)


def _nodes(nodes):
    """Every layer, groups too."""
    for node in nodes:
        yield node
        yield from _nodes(node.get("layers", []))


def _meaning(reader, tile):
    """What a tile of the level's own tilesets means to us, or None."""
    if tile.values is None:
        return None
    if tile.cls == "Terrain":
        return "surface", tile.values["name"] or tile.label
    if tile.cls == "SpeedCap":
        return "cap", (tile.values["max_speed"], tile.values["factor"])
    asset = tile.values["asset"]
    if isinstance(asset, tuple) and not asset[0].endswith(".toml"):
        return "brush", asset[0]
    return "brush", reader.tile_brush(tile)


def _told(tile):
    """What a tile of "playground" means, or None."""
    told = {p["name"]: p["value"] for p in tile.get("properties", [])}
    cls = tile.get("class") or tile.get("type")
    if cls == "Brush":
        return "brush", told.get("asset", "")
    if cls == "SpeedCap":
        return "cap", (float(told.get("max_speed", 0)), float(told.get("factor", 1)))
    return ("surface", told.get("name", "")) if cls == "Terrain" else None


def _values(meaning):
    """(class, properties) of a new tile."""
    layer, what = meaning
    if layer == "brush":
        return "Brush", {"asset": what}
    if layer == "cap":
        return "SpeedCap", dict(zip(SPEEDS[0], what, strict=True))
    found = next((kind for kind in TERRAINS if kind["name"] == what), None)
    if found is None:
        raise EditError(f"no tileset has a ground {what!r}{did_you_mean(what, [k['name'] for k in TERRAINS])}")
    return "Terrain", found
