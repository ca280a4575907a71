"""Tilesets of a map, in it or in files of their own, and what their tiles mean."""

from __future__ import annotations

import posixpath
from copy import copy
from dataclasses import dataclass

from flockbrush.engine import limits, picture_decoding
from flockbrush.levels import geometry
from flockbrush.levels.checked_nodes import class_of, parsed, text, tiles_by_id, whole
from flockbrush.levels.json_lines import Node
from flockbrush.levels.level_files import FileRefused
from flockbrush.levels.properties import FilePlace, Values, read_properties, shown
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.terrain_kinds import TerrainKind
from flockbrush.levels.tmx import count_tiles


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
    count: int  # of the ids that it takes: a collection of pictures may have gaps in them
    name: str
    alignment: str
    tiles: dict[int, Tile]
    node: Node
    folder: str


class TilesetReader:
    """Reads the tilesets of one map; tells every problem to the report of its place.

    Parameters
    ----------
    files : files of `flockbrush.levels.level_files`
        Where tilesets and their pictures lie.
    place : FilePlace
        The map.
    """

    def __init__(self, files, place):
        self.files, self.place = files, place
        self.tilesets: list[Tileset] = []  # by firstgid
        self.lost = False  # one could not be read: tiles without a tileset are its

    def read(self, doc):
        entries = doc.get("tilesets", [])
        if not isinstance(entries, list):
            self.place.say("'tilesets' must be a list", doc.line)
            return
        for entry in entries:
            if not isinstance(entry, Node):
                self.place.say("each tileset must be an object", doc.line)
                continue
            place = self.place.at(entry, "tileset")
            firstgid = whole(entry, "firstgid", place, 1, 2**28)
            if firstgid is not None:
                self._read(entry, firstgid, place)

    def _read(self, entry, firstgid, place):
        folder = ""
        if "source" in entry:
            source = text(entry, "source", place)
            entry, place = self._external(source, place)
            if entry is None:
                self.lost = True
                return
            folder = posixpath.dirname(source.replace("\\", "/"))
        if "tilecount" not in entry and entry.get("image"):
            entry = self._measured(entry, folder, place)
        count = whole(entry, "tilecount", place, 0, limits.TILES)
        if count is None:
            return
        name = text(entry, "name", place) or "tileset"
        alignment = entry.get("objectalignment", "unspecified")
        if alignment not in geometry.ALIGNMENTS:
            place.say(f"'objectalignment' must be one of {', '.join(geometry.ALIGNMENTS)}, got {shown(alignment)}")
            alignment = "unspecified"
        if any(t.firstgid == firstgid for t in self.tilesets):
            self.place.say(f"two tilesets begin at tile id {firstgid}, one of them {name[:60]!r}")
        if not entry.get("columns"):
            count = max([count, *(number + 1 for number in tiles_by_id(entry) if number < limits.TILES)])
        tiles = self._read_tiles(entry, count, name, folder, place)
        self.tilesets.append(Tileset(firstgid, count, name, alignment, tiles, entry, folder))
        self.tilesets.sort(key=lambda t: t.firstgid)

    def _measured(self, entry, folder, place):
        """A tileset of an old file with the size of its image and its number of tiles, which it leaves out.

        The document stays as it is: it may be shared, and the image may be another one when it is read again.
        """
        name = text(entry, "image", place)
        try:
            size = picture_decoding.picture_size(self.files.read(posixpath.join(folder, name)))
        except FileRefused as error:
            place.say(f"picture {name[:200]!r}: {error}")
            size = 1, 1
        if size is None:
            place.say(f"picture {name[:200]!r} is no PNG, JPEG, WebP or BMP")
            size = 1, 1
        measured = copy(entry)
        measured["imagewidth"], measured["imageheight"] = size
        count_tiles(measured)
        return measured

    def kinds(self):
        """{name: TerrainKind} of all terrain tiles; of two with one name the first."""
        kinds = {}
        for tileset in self.tilesets:
            for tile in tileset.tiles.values():
                if tile.cls == "Terrain" and tile.values is not None:
                    values = {**tile.values, "name": tile.values["name"] or tile.label}
                    kinds.setdefault(values["name"], TerrainKind.of(values))
        return kinds

    def of(self, gid):
        """The tileset of a global tile id, as Tiled finds it: the last that begins at or before it; None beyond it."""
        tileset = next((t for t in reversed(self.tilesets) if t.firstgid <= gid), None)
        return tileset if tileset and gid - tileset.firstgid < tileset.count else None

    def origin(self, gid):
        """(x, y), where on its picture the place of an object of this tile is: shares of width and height."""
        tileset = self.of(gid)
        return geometry.ALIGNMENTS[tileset.alignment if tileset else "unspecified"]

    def _external(self, source, place):
        """(document, place) of a tileset in a file of its own."""
        try:
            data = self.files.read(source)
        except FileRefused as error:
            place.say(f"tileset {source[:200]!r}: {error}")
            return None, place
        there = FilePlace(self.place.report, self.files.shown(source), 1)
        return parsed(data, there, "tileset"), there

    def _read_tiles(self, entry, count, name, folder, place):
        """{local id: Tile} of those that say something."""
        nodes, tiles = entry.get("tiles", []), {}
        if not isinstance(nodes, list):
            place.say("'tiles' must be a list")
            return tiles
        for node in nodes:
            if not isinstance(node, Node):
                place.say("each of the 'tiles' must be an object")
                continue
            number = whole(node, "id", place.at(node, f"tileset {name!r}"), 0, max(count - 1, 0))
            if number is not None:
                label = f"tile {number} of tileset {name!r}"
                tiles[number] = self._read_tile(node, label, folder, place.at(node, label))
        return tiles

    def _read_tile(self, node, label, folder, place):
        cls = class_of(node, place)
        known = CLASSES.get(cls)
        if known is None or known.use != "tile":
            return Tile(cls, None, label, place)
        values = read_properties(node, known, place)
        if cls == "Brush":
            values["asset"] = (values["asset"], folder)
        return Tile(cls, values, label, place)
