"""Reading a level: from a .tmj file to a `Level`, or to everything that is wrong with it.

An object's class decides what it is, whatever the layer; classless objects take the class of a layer named after one.
Hidden layers count: the eye in Tiled is for the designer's view.  Layers called ``notes...`` or ``decor...`` are the
designer's own.
"""

from __future__ import annotations

import posixpath
import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from flockbrush.behaviours.program import Program, ProgramLibrary, shipped_programs
from flockbrush.engine import limits, pictures
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.engine.raster import Raster
from flockbrush.levels import geometry, schema
from flockbrush.levels.art_reader import ArtReader
from flockbrush.levels.checks import check_level
from flockbrush.levels.files import DiskFiles, FileRefused, MemoryFiles, UnsavedFiles, project_folder
from flockbrush.levels.hints import layer_hints, level_hints, mixing_hints, paint_hints
from flockbrush.levels.json_lines import JsonError, Node, parse
from flockbrush.levels.objects import ObjectReader, bounds_of
from flockbrush.levels.properties import FilePlace, Report, Values, is_number, read_properties, shown
from flockbrush.levels.schema import CLASSES, BrushLayer, Level
from flockbrush.levels.terrain_kinds import Terrain, TerrainKind
from flockbrush.levels.tile_data import decode, unpack
from flockbrush.levels.tmx import count_tiles, is_xml, read_xml

AS_STORED = -1  # cv2.IMREAD_UNCHANGED
_FAR = 10_000_000  # px or tiles; nothing real is farther out


def parsed_document(data):
    """The document in a file of Tiled's, JSON or XML; JsonError."""
    return read_xml(data) if is_xml(data) else parse(data, limits.JSON_DEPTH)


_parsed_once = lru_cache(maxsize=8)(
    parsed_document
)  # levels of a folder share their tilesets; nobody changes what was parsed


def read_level(path, library=None, commands=None) -> Level:
    """The level in a TMJ file.

    Parameters
    ----------
    path : path-like
        A ``.tmj`` (or ``.json``) file saved by Tiled.
    library : BrushLibrary, optional
        Which brushes there are; the shipped ones, and those in a folder ``brushes`` beside the level or the project,
        when left out.
    commands : dict of str to dataclass, optional
        Which commands a script may give; `flockbrush.engine.commands.COMMANDS` when left out, unchecked when that is
        empty.

    Raises
    ------
    ProblemsError
        With every problem of the level and the files it names.
    """
    path = Path(path)
    return _read(DiskFiles(path), library if library is not None else brush_library(path), commands)


def read_level_files(files: dict[str, bytes], library=None, commands=None) -> Level:
    """The level whose files a recording has embedded (`Level.files`), the level itself first.

    Raises
    ------
    ProblemsError
        As `read_level`.
    """
    return _read(MemoryFiles(files), library if library is not None else recorded_library(files), commands)


def read_level_text(text: bytes, path, library=None, kept=None) -> Level:
    """The level that a file would hold with this in it.

    Parameters
    ----------
    text : bytes
    path : path-like
        The file; the others it names are read beside it.
    library : BrushLibrary, optional
        As `read_level`.
    kept : dict of str to bytes, optional
        Those other files, for when the disk has them no more.

    Raises
    ------
    ProblemsError
    """
    files = UnsavedFiles(Path(path), text, kept or {})
    return _read(files, library if library is not None else brush_library(path), None)


def _read(files, library, commands):
    report = Report()
    level = LevelReader(files, report, library, commands, program_library(files)).level()
    if report.problems or level is None:
        raise ProblemsError(sorted(report.problems, key=lambda p: (p.file, p.line or 0)))
    return level


@dataclass
class Tile:
    """A tile that a tileset gives a meaning."""

    cls: str
    values: Values | None
    label: str  # "tile 3 of tileset 'terrain'"
    place: FilePlace


@dataclass
class Tileset:
    """Which global ids it takes, and how big its tiles are."""

    firstgid: int
    count: int
    name: str
    alignment: str
    tiles: dict[int, Tile]
    node: Node
    folder: str


@dataclass
class ReadLayer:
    """A layer out of its groups, with what they add up to."""

    node: Node
    kind: str
    name: str
    dx: float  # px
    dy: float
    opacity: float
    place: FilePlace
    hidden: bool = False  # it or a group around it
    pieces: list | None = None  # its unpacked tile data
    flags: bool = False  # whether flip flags of tiles are kept


@dataclass
class MapFrame:
    """From pixels to metres, and the other way round for cells."""

    tile: int  # px
    metres: float  # of a tile
    left: int  # tiles; where the map begins (an infinite one begins anywhere)
    top: int
    nx: int
    ny: int

    def to_metres(self, points):
        """(n, 2) px, y down -> m, y up."""
        scale = self.metres / self.tile
        x = points[:, 0] * scale - self.left * self.metres
        y = (self.top + self.ny) * self.metres - points[:, 1] * scale
        return np.column_stack([x, y])


class LevelReader:
    """Walks through one document; tells every problem to the report and goes on as long as it makes sense."""

    def __init__(self, files, report, library, commands=None, programs=None):
        self.files, self.report = files, report
        self.library = library
        self.programs = programs or shipped_programs()
        self.named_programs: dict[str, Program] = {}
        self.commands = commands
        self._names: list[str] | None = None
        self.tilesets: list[Tileset] = []  # by firstgid
        self.lost_tilesets = False  # one could not be read: tiles without a tileset are its
        self.cells = 0  # tiles decoded so far, against the cap
        self.layers = 0

    # ------------------------------------------------------------ the document

    def level(self):
        """The level, or None with problems reported."""
        doc = self.document()
        if doc is None:
            return None
        place = self.place.at(doc, "map")
        values = read_properties(doc, CLASSES["FlockbrushLevel"], place)
        self.check_map(doc, values, place)
        self.read_tilesets(doc)
        layers, others = split(list(self.walk(doc.get("layers"), place)))
        frame = self.frame(doc, layers, values["metres_per_tile"], place)
        if frame is None:
            return None
        level = Level(
            name=self.files.level.stem,
            path=self.files.level,
            width=frame.nx * frame.metres,
            height=frame.ny * frame.metres,
            cell=frame.metres,
            boundary=values["boundary"],
            seed=values["seed"],
        )
        artist = ArtReader(self, frame, values["ground_rules"], place)
        artist.read(level, others)
        self.fill(level, layers, frame)
        artist.finish(level)
        level.kinds = list({**self.kinds(), **artist.kinds}.values())
        level.files = self.files.got
        level.programs = self.named_programs
        check_level(level, self.objects, self.library, self.commands)
        if not self.report.problems:
            layer_hints(layer for layer in layers if not plain_name(layer.name).startswith(schema.IGNORED))
            level_hints(level, self.objects.places)
            for zone in level.zones:
                paint_hints(zone, self.objects.places[zone.id], self.library)
            mixing_hints(level, self.objects.places, self.library, place)
        level.warnings = sorted(self.report.warnings, key=lambda p: (p.file, p.line or 0))
        return level

    def document(self):
        """The parsed map; None when it is none."""
        self.file = str(self.files.level)
        self.place = FilePlace(self.report, self.file, None)
        try:
            data = self.files.first()
        except FileRefused as error:
            self.place.say(str(error))
            return None
        return self.parsed(data, self.place, "map")

    def parsed(self, data, place, kind):
        """The JSON object in these bytes, if it is a `kind`."""
        try:
            doc = (parsed_document if kind == "map" else _parsed_once)(data)
        except JsonError as error:
            place.say(str(error), error.line)
            return None
        if not isinstance(doc, Node):
            place.say(f"this is not a Tiled {kind}: expected an object, got {shown(doc)}", 1)
            return None
        if doc.get("type") == "world":
            place.say(f"a world is several maps, which are opened one by one{_maps_of(doc)}", doc.line)
            return None
        if doc.get("type", kind) != kind:
            place.say(f"this is not a Tiled {kind}: its type is {shown(doc.get('type'))}", doc.line)
            return None
        return doc

    def check_map(self, doc, values, place):
        if "schema" in values.given and values["schema"] != schema.SCHEMA:
            place.say(f"schema must be '{schema.SCHEMA}', got {values['schema']!r}", values.lines["schema"])
        if doc.get("orientation", "orthogonal") != "orthogonal":
            place.say(
                f"the orientation must be orthogonal, got {shown(doc['orientation'])}: tiles are squares of the ground,"
                " seen from above, on which animals walk in metres"
            )

    # ------------------------------------------------------------ structure, checked

    def whole(self, node, key, place, low, high, default=None):
        """A structural whole number; None with a problem."""
        value = node.get(key, default)
        if is_number(value) and value == int(value) and low <= value <= high:
            return int(value)
        place.say(f"'{key}' must be a whole number from {low} to {high}, got {shown(value)}")
        return None

    def real(self, node, key, place, default=0.0, limit=_FAR):
        """A structural number; the default with a problem."""
        value = node.get(key, default)
        if is_number(value) and abs(value) <= limit:
            return float(value)
        place.say(f"'{key}' must be a number up to {limit:g}, got {shown(value)}")
        return float(default or 0)

    def text(self, node, key, place, default=""):
        """A structural text."""
        value = node.get(key, default)
        if isinstance(value, str):
            return value
        place.say(f"'{key}' must be a text, got {shown(value)}")
        return default

    def class_of(self, node, place):
        """Tiled 1.8 and 1.10 say ``type``, 1.9 says ``class``."""
        return self.text(node, "class", place) or self.text(node, "type", place)

    # ------------------------------------------------------------ tilesets

    def read_tilesets(self, doc):
        entries = doc.get("tilesets", [])
        if not isinstance(entries, list):
            self.place.say("'tilesets' must be a list", doc.line)
            return
        for entry in entries:
            if not isinstance(entry, Node):
                self.place.say("each tileset must be an object", doc.line)
                continue
            place = self.place.at(entry, "tileset")
            firstgid = self.whole(entry, "firstgid", place, 1, 2**28)
            if firstgid is not None:
                self.read_tileset(entry, firstgid, place)

    def read_tileset(self, entry, firstgid, place):
        folder = ""
        if "source" in entry:
            source = self.text(entry, "source", place)
            entry, place = self.external(source, place)
            if entry is None:
                self.lost_tilesets = True
                return
            folder = posixpath.dirname(source.replace("\\", "/"))
        if "tilecount" not in entry and entry.get("image"):
            self.measure_image(entry, folder, place)
        count = self.whole(entry, "tilecount", place, 0, limits.TILES)
        if count is None:
            return
        name = self.text(entry, "name", place) or "tileset"
        alignment = entry.get("objectalignment", "unspecified")
        if alignment not in geometry.ALIGNMENTS:
            place.say(f"'objectalignment' must be one of {', '.join(geometry.ALIGNMENTS)}, got {shown(alignment)}")
            alignment = "unspecified"
        if any(t.firstgid == firstgid for t in self.tilesets):
            place.say(f"two tilesets begin at tile id {firstgid}")
        tiles = self.read_tiles(entry, count, name, folder, place)
        self.tilesets.append(Tileset(firstgid, count, name, alignment, tiles, entry, folder))
        self.tilesets.sort(key=lambda t: t.firstgid)

    def measure_image(self, entry, folder, place):
        """Count the tiles of a tileset's image in old files, which leave that out."""
        name = self.text(entry, "image", place)
        try:
            size = pictures.picture_size(self.files.read(posixpath.join(folder, name)))
        except FileRefused as error:
            place.say(f"picture {name[:200]!r}: {error}")
            size = 1, 1
        if size is None:
            place.say(f"picture {name[:200]!r} is no PNG, JPEG, WebP or BMP")
            size = 1, 1
        entry["imagewidth"], entry["imageheight"] = size
        count_tiles(entry)

    def kinds(self):
        """{name: TerrainKind} of all terrain tiles; of two with one name the first."""
        found = {}
        for tileset in self.tilesets:
            for tile in tileset.tiles.values():
                if tile.cls == "Terrain" and tile.values is not None:
                    told = {**tile.values, "name": tile.values["name"] or tile.label}
                    found.setdefault(told["name"], TerrainKind.of(told))
        return found

    def tileset_of(self, gid):
        """The tileset of a global tile id, as Tiled finds it: the last that begins at or before it; None beyond it."""
        found = next((t for t in reversed(self.tilesets) if t.firstgid <= gid), None)
        return found if found and gid - found.firstgid < found.count else None

    def external(self, source, place):
        """(document, place) of a tileset in a file of its own."""
        try:
            data = self.files.read(source)
        except FileRefused as error:
            place.say(f"tileset {source[:200]!r}: {error}")
            return None, place
        there = FilePlace(self.report, self.files.shown(source), 1)
        return self.parsed(data, there, "tileset"), there

    def read_tiles(self, entry, count, name, folder, place):
        """{local id: Tile} of those that say something."""
        nodes, tiles = entry.get("tiles", []), {}
        if not isinstance(nodes, list):
            place.say("'tiles' must be a list")
            return tiles
        for node in nodes:
            if not isinstance(node, Node):
                place.say("each of the 'tiles' must be an object")
                continue
            number = self.whole(node, "id", place.at(node, f"tileset {name!r}"), 0, max(count - 1, 0))
            if number is not None:
                label = f"tile {number} of tileset {name!r}"
                tiles[number] = self.read_tile(node, label, folder, place.at(node, label))
        return tiles

    def read_tile(self, node, label, folder, place):
        cls = self.class_of(node, place)
        known = CLASSES.get(cls)
        if known is None or known.use != "tile":
            return Tile(cls, None, label, place)
        values = read_properties(node, known, place)
        if cls == "Brush":
            values["asset"] = (values["asset"], folder)
        return Tile(cls, values, label, place)

    # ------------------------------------------------------------ layers

    def walk(self, nodes, place, dx=0.0, dy=0.0, opacity=1.0, prefix="", hidden=False):
        """Every layer, out of its groups, offsets and opacities added up."""
        if not isinstance(nodes, list):
            place.say("'layers' must be a list")
            return
        for node in nodes:
            if not isinstance(node, Node):
                place.say("each layer must be an object")
                continue
            name = prefix + self.text(node, "name", place)
            here = self.place.at(node, f"layer {name[:80]!r}")
            x, y = dx + self.real(node, "offsetx", here), dy + self.real(node, "offsety", here)
            strength = opacity * min(max(self.real(node, "opacity", here, 1.0), 0.0), 1.0)
            kind = self.text(node, "type", here)
            unseen = hidden or node.get("visible") is False
            if kind == "group":
                yield from self.walk(node.get("layers"), here, x, y, strength, name + "/", unseen)
            elif kind in ("tilelayer", "objectgroup", "imagelayer"):
                self.layers += 1
                if self.layers > limits.LAYERS:
                    if self.layers == limits.LAYERS + 1:
                        here.say(f"there are more than {limits.LAYERS} layers")
                    return
                yield ReadLayer(node, kind, name, x, y, strength, here, unseen)
            else:
                here.say(f"the layer's type is {shown(kind)}; there are tilelayer, objectgroup, imagelayer, group")

    def frame(self, doc, layers, metres, place):
        """The size of the map; None with a problem."""
        tile = self.whole(doc, "tilewidth", place, 1, 4096)
        high = self.whole(doc, "tileheight", place, 1, 4096)
        if tile is None or high is None:
            return None
        if tile != high:
            place.say(f"tiles must be square, got {tile} x {high} pixels")
            return None
        infinite = doc.get("infinite", False)
        if type(infinite) is not bool:
            place.say(f"'infinite' must be true or false, got {shown(infinite)}")
            return None
        if infinite:
            return self.infinite_frame(layers, tile, metres, place)
        nx, ny = self.whole(doc, "width", place, 1, 1_000_000), self.whole(doc, "height", place, 1, 1_000_000)
        if nx is None or ny is None or not self.fits(nx, ny, place):
            return None
        return MapFrame(tile, metres, 0, 0, nx, ny)

    def fits(self, nx, ny, place):
        if nx * ny <= limits.LAYER_CELLS:
            return True
        place.say(f"the map has {nx} x {ny} tiles; there may be at most {limits.LAYER_CELLS}")
        return False

    def infinite_frame(self, layers, tile, metres, place):
        """An infinite map is as large as what is painted."""
        boxes = [
            box
            for layer in layers
            if layer.kind == "tilelayer" and kind_of(layer.name)
            for box in self.painted(layer, tile)
        ]
        if not boxes:
            place.say("an infinite map is as large as what is painted, and nothing is; paint terrain or fix the size")
            return None
        left, top, right, bottom = np.array(boxes).T
        x0, y0, x1, y1 = int(left.min()), int(top.min()), int(right.max()), int(bottom.max())
        if not self.fits(x1 - x0, y1 - y0, place):
            return None
        return MapFrame(tile, metres, x0, y0, x1 - x0, y1 - y0)

    def painted(self, layer, tile):
        """(left, top, right, bottom) of the painted part of each chunk, in tiles."""
        sx, sy = self.shift(layer, tile)
        for x, y, gids in self.chunks(layer):
            rows, columns = np.nonzero(gids)
            if len(rows):
                yield (
                    x + sx + columns.min(),
                    y + sy + rows.min(),
                    x + sx + columns.max() + 1,
                    y + sy + rows.max() + 1,
                )

    def shift(self, layer, tile):
        """A layer's offset in whole tiles."""
        x, y = layer.dx / tile, layer.dy / tile
        if x != round(x) or y != round(y):
            layer.place.say(
                f"a tile layer may be offset by whole tiles of {tile} px only, got {layer.dx:g}, {layer.dy:g}"
            )
        return round(x), round(y)

    def chunks(self, layer):
        """(x, y, gids) of each piece of a tile layer; the data is unpacked once."""
        if layer.pieces is None:
            layer.pieces = list(self.unpack(layer))
        return layer.pieces

    def unpack(self, layer):
        node, place = layer.node, layer.place
        chunks = node.get("chunks", [node])
        if not isinstance(chunks, list) or not all(isinstance(c, Node) for c in chunks):
            place.say("'chunks' must be a list of objects")
            return
        encoding, compression = self.text(node, "encoding", place), self.text(node, "compression", place)
        for chunk in chunks:
            width, height = (self.whole(chunk, k, place, 1, limits.LAYER_CELLS) for k in ("width", "height"))
            x, y = (self.whole(chunk, k, place, -_FAR, _FAR, 0) for k in "xy")
            if None in (width, height, x, y):
                continue
            self.cells += width * height
            if width * height > limits.LAYER_CELLS or self.cells > limits.LEVEL_CELLS:
                place.say(
                    f"{width} x {height} tiles are too many; a layer may have {limits.LAYER_CELLS}, "
                    "all together four times that"
                )
                return
            try:
                read = unpack if layer.flags else decode
                yield x, y, read(chunk.get("data"), encoding, compression, width, height)
            except ValueError as error:
                place.say(str(error))

    # ------------------------------------------------------------ what the layers say

    def fill(self, level, layers, frame):
        """Read every layer into the level."""
        objects = self.objects = ObjectReader(self, frame, level)
        self.known = {}  # terrain kinds by tile id
        self.painted = None  # cells of terrain layers
        for layer in layers:
            kind = kind_of(layer.name)
            if kind is None and layer.kind != "objectgroup":
                layer.place.say(
                    f"no such layer{did_you_mean(plain_name(layer.name), schema.LAYER_NAMES)}"
                    f" (a layer of your own begins with {' or '.join(schema.IGNORED)})"
                )
            elif layer.kind == "tilelayer":
                self.tile_layer(level, layer, kind, frame)
            elif layer.kind == "imagelayer":
                self.image_layer(level, layer, kind, frame)
            else:
                objects.layer(layer, kind)
        objects.finish()

    def tile_layer(self, level, layer, kind, frame):
        cls = {c.home: c.name for c in CLASSES.values() if c.use == "tile"}.get(kind)
        if cls is None:
            layer.place.say(
                f"this must be {'an image' if kind == 'height' else 'an object'} layer, and is a tile layer"
            )
            return
        gids = self.gids(layer, frame)
        used = self.used_tiles(gids, cls, layer)
        if cls == "Terrain":
            self.paint_terrain(level, gids, used, layer)
        elif cls == "Brush":
            level.brush_layers.append(self.brush_layer(gids, used, layer))
        else:
            self.paint_speed(level, gids, used, frame)

    def gids(self, layer, frame):
        """The layer's global tile ids, (ny, nx), south row first."""
        whole = np.zeros((frame.ny, frame.nx), np.uint32)
        sx, sy = self.shift(layer, frame.tile)
        for x, y, piece in self.chunks(layer):
            left, top = x + sx - frame.left, y + sy - frame.top
            cut_x, cut_y = max(0, -left), max(0, -top)
            part = piece[cut_y : max(frame.ny - top, 0), cut_x : max(frame.nx - left, 0)]
            if part.size:
                into = whole[top + cut_y : top + cut_y + part.shape[0], left + cut_x : left + cut_x + part.shape[1]]
                into[part > 0] = part[part > 0]
        layer.pieces = []
        return whole[::-1]

    def used_tiles(self, gids, cls, layer):
        """{gid: Tile} of the tiles painted here; those of another class are problems."""
        used = {}
        for gid in map(int, np.unique(gids)):
            if gid == 0:
                continue
            tileset = self.tileset_of(gid)
            tile = tileset.tiles.get(gid - tileset.firstgid) if tileset else None
            if tile is not None and tile.cls == cls:
                used[gid] = tile
                continue
            if tileset is None and self.lost_tilesets:
                continue
            iy, ix = (int(k[0]) for k in np.nonzero(gids == gid))
            found = (
                f"it is a {tile.cls} tile"
                if tile and tile.cls
                else "it has no class"
                if tileset
                else "no tileset has it"
            )
            where = f"column {ix}, row {len(gids) - 1 - iy}"
            layer.place.say(f"tile id {gid} at {where} must be a {cls} tile, and {found}")
        return used

    def paint_terrain(self, level, gids, used, layer):
        if level.terrain is None:
            level.terrain = Terrain.blank(gids.shape)
        self.painted = gids > 0 if self.painted is None else self.painted | (gids > 0)
        for gid, tile in used.items():
            values = {**tile.values, "name": tile.values["name"] or tile.label}
            self.known[gid] = level.terrain.put(gids == gid, values, self.known.get(gid))

    def brush_layer(self, gids, used, layer):
        names = {gid: self.tile_brush(tile) for gid, tile in used.items()}
        assets = sorted(set(names.values()))
        index = np.full(gids.shape, -1, np.int16)
        for gid, name in names.items():
            index[gids == gid] = assets.index(name)
        values = read_properties(layer.node, CLASSES["BrushLayer"], layer.place)
        made = BrushLayer(layer.name, layer.opacity, assets, index, bounds_of(values))
        if not self.report.problems:
            paint_hints(made, layer.place, self.library)
        return made

    def tile_brush(self, tile):
        """The brush of a painted tile; looked up only now, since a tileset may know brushes that are gone."""
        if isinstance(tile.values["asset"], tuple):
            name, folder = tile.values["asset"]
            line = tile.values.lines.get("asset")
            tile.values["asset"] = self.brush(name, folder, tile.place, line, "asset") if line else name
        return tile.values["asset"]

    def paint_speed(self, level, gids, used, frame):
        """Several layers: the lowest cap, the product of factors."""
        for gid, tile in used.items():
            here = gids == gid
            if tile.values["max_speed"] > 0:
                if level.cap is None:
                    level.cap = Raster(frame.metres, np.full(gids.shape, np.inf))
                values = level.cap.values
                values[here] = np.minimum(values[here], tile.values["max_speed"])
            if tile.values["factor"] != 1:
                if level.factor is None:
                    level.factor = Raster(frame.metres, np.ones(gids.shape))
                level.factor.values[here] *= tile.values["factor"]

    def image_layer(self, level, layer, kind, frame):
        place = layer.place
        if kind != "height":
            place.say(
                f"this must be {'a tile' if kind in ('terrain', 'brush', 'speed') else 'an object'} layer, "
                "and is an image layer"
            )
            return
        if level.height_map is not None:
            place.say("there may be one height layer only")
            return
        values = read_properties(layer.node, CLASSES["Height"], place)
        source = self.text(layer.node, "image", place)
        try:
            grey = read_grey(self.files.read(source))
        except (FileRefused, ValueError) as error:
            place.say(f"height picture {source[:200]!r}: {error}")
            return
        ny, nx = grey.shape
        if abs(nx * frame.ny / (ny * frame.nx) - 1) > 0.01:
            place.say(
                f"the height picture is stretched over the map and must have its proportions,"
                f" {frame.nx} : {frame.ny}, got {nx} x {ny} pixels"
            )
            return
        level.height_map = Raster(level.width / nx, grey[::-1].astype(float) * values["metres_per_level"])

    # ------------------------------------------------------------ brushes

    def brush(self, name, folder, place, line, key):
        """The name of a brush that exists, files named relative to the level."""
        if not name:
            place.say(f"{key} must name a brush{did_you_mean(name, self.brush_names())}", line)
            return name
        if name.endswith(".toml"):
            return self.brush_file(name, folder, place, line, key)
        if name not in self.brush_names():
            place.say(f"{key}: there is no brush {name[:60]!r}{did_you_mean(name, self.brush_names())}", line)
        return name

    def program(self, name, place, line):
        """The name of a program, which is read; one that is wrong is told with its own lines."""
        if name and name not in self.named_programs:
            try:
                self.named_programs[name] = self.programs.get(name)
            except ProblemsError as error:
                if name in self.programs.names():
                    self.report.problems.extend(error.problems)
                else:
                    place.say(f"program: {error.problems[0].message}", line)
        return name

    def brush_names(self):
        if self._names is None:
            self._names = self.library.names()
        return self._names

    def brush_file(self, name, folder, place, line, key):
        from flockbrush.behaviours.brush import load_brush

        try:
            data = self.files.read(posixpath.join(folder, name))
        except FileRefused as error:
            place.say(f"{key}: {error}", line)
            return name
        relative = posixpath.normpath(posixpath.join(folder, name).replace("\\", "/"))
        try:
            return load_brush(data, file=self.files.shown(relative)).name
        except ProblemsError as error:
            self.report.problems.extend(error.problems)
            return name


def brush_library(path, files=None):
    """Every brush and species a level can name: its own files, ``brushes`` and ``species`` beside it, the shipped.

    Parameters
    ----------
    path : path-like
        The level.
    files : dict of str to bytes, optional
        `Level.files`, for brushes the level names as files.
    """
    from flockbrush.behaviours.brush import SUFFIX, BrushLibrary, shipped
    from flockbrush.behaviours.species import SpeciesLibrary, shipped_species

    path = Path(path)
    around = list(dict.fromkeys((path.parent.resolve(), project_folder(path))))
    own = [folder / "brushes" for folder in around]
    embedded = {name: data for name, data in (files or {}).items() if name.endswith(SUFFIX)}
    species = SpeciesLibrary([*(folder / "species" for folder in around), *shipped_species().folders])
    return BrushLibrary([*(f for f in own if f.is_dir()), *shipped().folders], embedded, species=species)


def program_library(files):
    """The programs a level can name: of its own folders ``programs`` and the shipped, or those of a recording."""
    embedded = {name: data for name, data in getattr(files, "files", {}).items() if name.endswith(".program.toml")}
    folders = [] if isinstance(files, MemoryFiles) else program_folders(files.level)
    return ProgramLibrary([*folders, *shipped_programs().folders], embedded)


def program_folders(path):
    """Folders ``programs`` beside a level and in its project."""
    path = Path(path)
    own = [folder / "programs" for folder in dict.fromkeys((path.parent.resolve(), project_folder(path)))]
    return [folder for folder in own if folder.is_dir()]


def recorded_library(files):
    """The brushes a recording has embedded, and the shipped for what it has not."""
    from flockbrush.behaviours.brush import PATH_SUFFIX, SUFFIX, BrushLibrary, shipped
    from flockbrush.behaviours.species import SpeciesLibrary, shipped_species

    species = SpeciesLibrary(shipped_species().folders, files)
    brushes = {name: data for name, data in files.items() if name.endswith((SUFFIX, PATH_SUFFIX))}
    return BrushLibrary(shipped().folders, brushes, species=species)


def split(layers):
    """(layers that are ours, the others).

    Where there is a group `schema.GROUP`, ours are those in it.  Otherwise those with our names are, and every object
    layer; a tile or image layer with another name is artwork, unless it has a name like ours.
    """
    if any(layer.name.startswith(schema.GROUP + "/") for layer in layers):
        return _parted(layers, lambda layer: layer.name.startswith(schema.GROUP + "/"))
    return _parted(layers, lambda layer: layer.kind == "objectgroup" or _is_ours(layer.name))


def _parted(layers, ours):
    return [layer for layer in layers if ours(layer)], [layer for layer in layers if not ours(layer)]


def _is_ours(name):
    """Whether a layer has one of our names, or one so near that it must be meant."""
    if plain_name(name).startswith(schema.IGNORED):
        return False
    return kind_of(name) is not None or "did you mean" in did_you_mean(plain_name(name), schema.LAYER_NAMES)


def _maps_of(doc):
    maps = doc.get("maps")
    names = [one.get("fileName") for one in maps if isinstance(one, dict)] if isinstance(maps, list) else []
    return ": " + ", ".join(str(name)[:60] for name in names[:6]) if names else ""


def plain_name(name):
    """The layer's own name, lower case, without its groups."""
    return name.rsplit("/", 1)[-1].strip().lower()


def kind_of(name):
    """Which of our layers this is; None for another."""
    return next((k for k in schema.LAYER_NAMES if plain_name(name).startswith(k)), None)


def read_grey(data: bytes) -> np.ndarray:
    """A grey PNG of 8 or 16 bit, (ny, nx), north row first; ValueError."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 33 or data[12:16] != b"IHDR":
        raise ValueError("this is not a PNG picture")
    width, height, depth, colour = struct.unpack(">IIBB", data[16:26])
    if colour != 0 or depth not in (8, 16):
        raise ValueError("the picture must be grey, 8 or 16 bit, without colour or transparency")
    if not 0 < width * height <= limits.HEIGHT_PIXELS:
        raise ValueError(f"the picture has {width} x {height} pixels; there may be at most {limits.HEIGHT_PIXELS}")
    grey = pictures.decoded(data, AS_STORED)
    if grey is None or grey.ndim != 2:
        raise ValueError("the picture is damaged")
    return grey
