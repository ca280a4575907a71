"""What a designer's commands do to a level's document: tiles, objects, layers, and the way back.

The document is changed by two small steps only, a key set and tiles put, and each is noted, so that undoing is those
steps backwards: to the byte.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import singledispatchmethod

import numpy as np
from flockbrush.components.level_things import degrees_text
from flockbrush.engine.commands import commands, default_values
from flockbrush.engine.problems import did_you_mean
from flockbrush.levels import geometry
from flockbrush.levels.document_changes import MISSING, EditError, KeySet, TilesPut, put
from flockbrush.levels.document_nodes import binds_some, brush_files, every_layer, values_of
from flockbrush.levels.layer_reader import kind_of
from flockbrush.levels.level_files import DiskFiles
from flockbrush.levels.map_objects import TYPES, MapObjects
from flockbrush.levels.playground_tiles import PlaygroundTiles
from flockbrush.levels.schema import CLASSES, GROUP
from flockbrush.levels.tile_data import FLIP_FLAGS, TileGrid
from flockbrush.systems.commands import AddObstacle, MoveGoal, PaintBrush, PaintCap, PaintCells, RemoveObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, PlaceGoal, RemoveThing
from flockbrush.systems.mark_commands import DrawArea, DrawLine, DrawZone, PlaceKey
from flockbrush.systems.obstacle_commands import polygon_of
from flockbrush.systems.painting import blended, cells_of

HOME = {"brush": "brush", "cap": "speed", "surface": "terrain"}  # where they are painted
OPACITY = {"brush": 0.4, "cap": 0.5, "surface": 1}
_ANY_FLAG = np.uint32(~FLIP_FLAGS & 0xFFFFFFFF)


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


class EditedMap(MapObjects):
    """A document that commands can change.

    Parameters
    ----------
    library : BrushLibrary
        Knows which brush a tile means that names a file.
    files : DiskFiles or MemoryFiles, optional
        Where the tilesets are read from; beside the level by default.

    Raises
    ------
    ProblemsError
        When a tileset cannot be read.
    """

    def __init__(self, document, library, files=None):
        super().__init__()
        self.document, self.data = document, document.data
        self.files = DiskFiles(document.path) if files is None else files
        self.changes: list = []
        self.brush_files = brush_files(self.data)  # stay known when nothing names them any more
        self.ny, self.nx = self.data["height"], self.data["width"]
        self._grids: dict[int, TileGrid] = {}
        self.tiles = PlaygroundTiles(self, library)

    # ------------------------------------------------------------ the two small steps

    def set(self, node, key, value):
        """Set a key of a node of the document."""
        before = node.get(key, MISSING)
        if before is MISSING or value is MISSING or before is not value:
            self.changes.append(KeySet(node, key, before, value))
            put(node, key, value)

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
        return self.files, MISSING, self.tiles.tilesets

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
        layers = []
        for node, dx, dy, weight in self.layers():
            if node.get("type") != "tilelayer" or kind_of(node.get("name", "")) != HOME[layer]:
                continue
            if layer == "brush" and (weight <= 0 or binds_some(node)):
                continue
            left, top = round(dx / tile) + node.get("x", 0), round(dy / tile) + node.get("y", 0)
            grid = self.grid(node)
            covers = left <= 0 and top <= 0 and left + grid.width >= self.nx and top + grid.height >= self.ny
            layers.append(TileLayer(grid, left, top, weight, covers))
        return layers

    def grid(self, node):
        """The unpacked tiles of a layer."""
        if id(node) not in self._grids:
            self._grids[id(node)] = TileGrid(node)
        return self._grids[id(node)]

    def winning(self, layer, layers):
        """The layer that shows when all are painted, added if there is none, and those of the others above it."""
        weights = [k.weight if layer == "brush" else 0.0 for k in layers]
        order = sorted(range(len(layers)), key=lambda k: (weights[k], k))
        covering = [k for k in order if layers[k].covers]
        if not covering:
            grid = self.grid(self.add_tile_layer(layer))
            return TileLayer(grid, 0, 0, OPACITY[layer], True), layers
        return layers[covering[-1]], [layers[k] for k in order[order.index(covering[-1]) + 1 :]]

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

    def add_object_layer(self, cls):
        """A new layer for the objects of a class, above all others."""
        node = {
            "color": CLASSES[cls].colour, "draworder": "topdown", "id": self._next("nextlayerid"),
            "name": CLASSES[cls].home, "objects": [], "opacity": 1, "type": "objectgroup", "visible": True,
            "x": 0, "y": 0,
        }  # fmt: skip
        self._insert_layer(node, len(self.home["layers"]))
        return node

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
        nodes = list(every_layer(self.data["layers"]))
        ids = [n.get("id", 0) for n in (nodes if layers else [o for n in nodes for o in n.get("objects", [])])]
        return max(int(self.data.get(key, 1)), max(ids, default=0) + 1)

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
        wraps = values_of(self.data, CLASSES["FlockbrushLevel"]).get("boundary") == "wrap"
        iy, ix, weight = command.cells((self.ny, self.nx), 1 / self.document.scale * self.data["tilewidth"], wraps)
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
            raise EditError("the level file has no earlier state of the ground to restore")
        layers = self.tile_layers(layer)
        if layer == "cap":
            self._paint_cap(layers, iy, ix, float(value), weight)
        elif not value:
            for each in layers:
                self.put(each, iy, ix, 0)
        else:
            target, above = self.winning(layer, layers)
            self.put(target, iy, ix, self.tiles.gid((layer, value)))
            for each in above:
                self.put(each, iy, ix, 0)

    def _paint_cap(self, layers, iy, ix, value, weight):
        speeds_by_layer = [self._speeds(each, iy, ix) for each in layers]  # (k, 2) each: cap, factor
        before = np.min([np.full(len(iy), np.inf), *(t[:, 0] for t in speeds_by_layer)], axis=0)
        after = blended(before, value if value > 0 else np.inf, weight)
        new = after != before
        if not new.any():
            return
        target = self.winning("cap", layers)[0] if np.isfinite(after[new]).any() else None
        for each, speeds in zip(layers, speeds_by_layer, strict=True):
            if target is None or each.grid is not target.grid:
                self._put_speeds(each, iy[new], ix[new], np.inf, speeds[new, 1])
        if target is not None:
            factor = next(
                (t[:, 1] for e, t in zip(layers, speeds_by_layer, strict=True) if e.grid is target.grid), None
            )
            self._put_speeds(target, iy[new], ix[new], after[new], 1.0 if factor is None else factor[new])

    def _speeds(self, layer, iy, ix):
        """(k, 2) cap (m/s, infinite for none) and factor that a layer's tiles say."""
        rows, columns, inside = layer.at(iy, ix, self.ny)
        gids = np.zeros(len(iy), np.uint32)
        gids[inside] = layer.grid.gids[rows[inside], columns[inside]] & _ANY_FLAG
        kinds, which = np.unique(gids, return_inverse=True)
        meanings = self.tiles.meanings()
        pairs = [meanings.get(gid, ("", (0.0, 1.0)))[1] for gid in kinds.tolist()]
        return np.array([(cap or np.inf, factor) for cap, factor in pairs])[which.ravel()]

    def _put_speeds(self, layer, iy, ix, cap, factor):
        pairs = np.column_stack([np.broadcast_to(cap, iy.shape), np.broadcast_to(factor, iy.shape)])
        kinds, which = np.unique(pairs, axis=0, return_inverse=True)
        gids = [
            0 if math.isinf(c) and f == 1 else self.tiles.gid(("cap", (0.0 if math.isinf(c) else c, f)))
            for c, f in kinds
        ]
        self.put(layer, iy, ix, np.array(gids, np.uint32)[which.ravel()])

    @do.register
    def _(self, command: AddObstacle):
        names = "solid", "blocks_view", "margin", "z_min", "z_max", "shape"
        properties = {name: value for name in names if (value := getattr(command, name)) is not None}
        if command.corners is not None:
            properties["corners"] = "; ".join(
                " ".join(f"{float(v):.12g}" for v in corner) for corner in command.corners
            )
        points = None if command.points is None else polygon_of(command.points, "an obstacle")
        self.draw(command.id, "Obstacle", command.name, "area", points, properties, command.at)

    @do.register
    def _(self, command: RemoveObstacle):
        if command.id:
            self.drop(command.id, "Obstacle")
            return
        for thing, node, _, _ in list(self.objects()):
            if thing.get("name") == command.name and self.class_of(thing, node) == "Obstacle":
                self.drop(thing["id"], "Obstacle")

    @do.register
    def _(self, command: DrawGuide):
        properties = {name: getattr(command, name) for name in ("strength", "radius", "decay", "goal", "loop")}
        self.draw(command.id, "Guide", command.name, "line", command.points, properties, command.at)

    @do.register
    def _(self, command: PlaceGoal):
        properties = {"radius": command.radius, "on_arrive": command.on_arrive, "next": command.next}
        existing = self.find(command.id, "Goal")
        shape, points = "point", None if command.x is None else np.array([(command.x, command.y)])
        if existing is not None and existing[0].get("name") != command.name:
            self.need_unnamed(existing[0].get("name"))
        if existing is not None:
            before, outline = self.outline(existing[0], *existing[2:])
            middle = geometry.centroid(outline) if before == "area" else outline[0]
            points = middle[None] if points is None else points
            if before == "area" and command.points is not None:
                shape, points = before, outline + (points[0] - middle)
        if command.points:
            shape, points = "area", np.array(command.points, float)
        self.draw(command.id, "Goal", command.name, shape, points, properties, command.at)

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
        self.draw(command.id, "Exit", command.name, "area", np.array(command.points, float), {}, command.at)

    @do.register
    def _(self, command: DrawZone):
        properties = {p.name: getattr(command, p.name) for p in CLASSES["Zone"].properties}
        self.draw(command.id, "Zone", command.name, "area", np.array(command.points, float), properties, command.at)

    @do.register
    def _(self, command: DrawLine):
        self.draw(command.id, "Line", command.name, "line", command.points, {}, command.at)

    @do.register
    def _(self, command: DrawArea):
        self.draw(command.id, "Area", command.name, "area", np.array(command.points, float), {}, command.at)

    @do.register
    def _(self, command: PlaceKey):
        existing, xy = self.known(command.id, "Key"), np.array([(command.x, command.y)])
        shape, points = "point", xy
        if existing is not None:
            shape, outline = self.outline(existing[0], *existing[2:])
            points = outline + (xy - (geometry.centroid(outline) if shape == "area" else outline[0]))
        properties = _properties_of_key(command, points)
        self.draw(command.id, "Key", command.name, shape, points, properties, command.at)

    @do.register
    def _(self, command: MarkSpawn):
        properties = {
            "species": command.species, "brush": command.brush, "count": command.count,
            "heading": "random" if command.heading is None else degrees_text(command.heading),
            "speed": command.speed or 0.0, "altitude": command.altitude, "start": command.start,
            "rate": command.rate, "formation": command.formation, "body_length": command.body_length or 0.0,
            "depth": command.depth, "program": command.program,
            "family_size": command.family_size,
        }  # fmt: skip
        existing = self.known(command.id, "Spawn")
        if existing is not None and "density" in values_of(existing[0], CLASSES["Spawn"]):
            properties["density"] = 0.0
        self.draw(command.id, "Spawn", command.name, "area", np.array(command.points, float), properties, command.at)

    @do.register
    def _(self, command: RemoveThing):
        cls = command.kind.capitalize()
        if cls == "Goal":
            existing = self.find(command.id, cls)
            self.need_unnamed(existing[0].get("name") if existing else "")
        if cls == "Spawn":
            self.need_another_spawn(command.id)
        self.drop(command.id, cls)


def _properties_of_key(key, outline):
    """The properties of a key's object, which has this outline (k, 2) m; EditError for what none can hold."""
    known = commands()
    if key.command not in known:
        raise EditError(f"there is no command {key.command!r}{did_you_mean(key.command, known)}")
    own, usual, properties = {"at": key.when, "command": key.command}, default_values(known[key.command]), {}
    for name, value in key.args.items():
        drawn = name == "points" and np.shape(value) == outline.shape and np.allclose(value, outline, atol=1e-6)
        plain = type(value) in TYPES and name not in own
        if plain:
            properties[name] = value
        elif not drawn and (name not in usual or value != usual[name]):
            why = f"a key has its own {name}" if name in own else "it must be a number, a text, true or false"
            raise EditError(f"no key of a level can hold {name} = {str(value)[:60]} of {key.command}: {why}")
    return properties | own
