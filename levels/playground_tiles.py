"""What the tiles of a level mean, and the tileset "playground" of those that its own tilesets lack."""

from __future__ import annotations

from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.levels.document_changes import EditError
from flockbrush.levels.document_nodes import values_of
from flockbrush.levels.json_lines import parse
from flockbrush.levels.level_writer import dump
from flockbrush.levels.properties import FilePlace, Report
from flockbrush.levels.reader import LevelReader
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tile_data import FLIP_FLAGS
from flockbrush.levels.tiled import class_tile
from flockbrush.levels.tileset_reader import TilesetReader
from flockbrush.levels.tilesets_data import COLUMNS, SPEEDS

PLAYGROUND = "playground"  # name of the tileset that holds what the level's own tilesets lack


class PlaygroundTiles:
    """The tiles of an edited map by what they mean.

    Parameters
    ----------
    edited : EditedMap
    library : BrushLibrary
        Knows which brush a tile means that names a file.

    Raises
    ------
    ProblemsError
        When a tileset cannot be read.
    """

    def __init__(self, edited, library):
        self.map = edited
        self._fresh: tuple = (None, {})
        report = Report()
        reader = LevelReader(edited.files, report, library)
        tiles = self.tilesets = TilesetReader(edited.files, FilePlace(report, str(edited.document.path), None))
        tiles.read(parse(dump(edited.data).encode(), limits.JSON_DEPTH))
        if report.problems:
            raise ProblemsError(report.problems)
        self.meaning: dict[int, tuple] = {}  # of a global tile id: ("brush", name), ("cap", (max_speed, factor)), ...
        ours = {entry["firstgid"] for entry in edited.data.get("tilesets", []) if is_playground(entry)}
        for tileset in tiles.tilesets:
            if tileset.firstgid not in ours:
                for number, tile in tileset.tiles.items():
                    meaning = _meaning(reader, tile)
                    if meaning is not None:
                        self.meaning[tileset.firstgid + number] = meaning

    def origin(self, gid):
        """(x, y), where on its picture the place of an object of this tile is: shares of width and height."""
        return self.tilesets.origin(gid & ~FLIP_FLAGS)

    def meanings(self):
        """{gid: meaning} of every tile there is now."""
        tilesets = self.map.data.get("tilesets", [])
        if tilesets is not self._fresh[0]:
            fresh = {}
            for entry in tilesets:
                if is_playground(entry):
                    fresh |= {entry["firstgid"] + tile["id"]: _own_meaning(tile) for tile in entry.get("tiles", [])}
            self._fresh = tilesets, self.meaning | fresh
        return self._fresh[1]

    def gid(self, meaning):
        """The tile of this meaning, added to the tileset "playground" if no tileset has it."""
        known = min((gid for gid, other in self.meanings().items() if other == meaning), default=None)
        return self._new_tile(meaning) if known is None else known

    def _new_tile(self, meaning):
        cls, values = _values(meaning)
        entry = self._roomy()
        used = [tile["id"] for tile in entry["tiles"]]
        number = max(used, default=-1) + 1
        rows = number // COLUMNS + 1
        tile = self.map.data["tilewidth"]
        new_entry = entry | {
            "imageheight": rows * tile, "tilecount": rows * COLUMNS,
            "tiles": [*entry["tiles"], class_tile(number, cls, values)],
        }  # fmt: skip
        others = [e for e in self.map.data.get("tilesets", []) if e["firstgid"] != entry["firstgid"]]
        self.map.set(self.map.data, "tilesets", [*others, new_entry])
        return entry["firstgid"] + number

    def _roomy(self):
        """The tileset "playground" with room for one more tile, perhaps a new one."""
        tilesets = self.map.data.get("tilesets", [])
        last = max(tilesets, key=lambda e: e["firstgid"], default=None)
        if last is not None and is_playground(last):
            return last
        counts = {t.firstgid: t.count for t in self.tilesets.tilesets}
        ends = [e["firstgid"] + counts.get(e["firstgid"], e.get("tilecount", 0)) for e in tilesets]
        tile, count = self.map.data["tilewidth"], sum(str(e.get("name", "")).startswith(PLAYGROUND) for e in tilesets)
        return {
            "columns": COLUMNS, "firstgid": max(ends, default=1), "image": self.picture_name(count),
            "imagewidth": COLUMNS * tile, "margin": 0, "name": PLAYGROUND + (f" {count + 1}" if count else ""),
            "spacing": 0, "tileheight": tile, "tiles": [], "tilewidth": tile,
        }  # fmt: skip

    def picture_name(self, count=0):
        """The file beside the level that shows the tiles of "playground" in Tiled."""
        return f"{self.map.document.path.stem}-{PLAYGROUND}{count + 1 if count else ''}.png"

    def playgrounds(self):
        """[(tileset, [meaning or None of each place])] of what was added here."""
        tilesets = []
        for entry in self.map.data.get("tilesets", []):
            if is_playground(entry):
                tiles = {tile["id"]: _own_meaning(tile) for tile in entry.get("tiles", [])}
                tilesets.append((entry, [tiles.get(k) for k in range(entry["tilecount"])]))
        return tilesets


def is_playground(entry):
    """Whether a tileset of a map is one that was added here: each of its tiles means something to us."""
    named = "source" not in entry and "image" in entry and str(entry.get("name", "")).startswith(PLAYGROUND)
    return named and bool(entry.get("tiles")) and all(map(_own_meaning, entry["tiles"]))


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


def _own_meaning(tile):
    """What a tile of "playground" means, or None."""
    cls = tile.get("class") or tile.get("type")
    if cls not in ("Brush", "SpeedCap", "Terrain"):
        return None
    properties = values_of(tile, CLASSES[cls])
    if cls == "Brush":
        return "brush", properties.get("asset", "")
    if cls == "SpeedCap":
        return "cap", (float(properties.get("max_speed", 0)), float(properties.get("factor", 1)))
    return "surface", properties.get("name", "")


def _values(meaning):
    """(class, properties) of a new tile."""
    layer, what = meaning
    if layer == "brush":
        return "Brush", {"asset": what}
    if layer == "cap":
        return "SpeedCap", dict(zip(SPEEDS[0], what, strict=True))
    terrain = next((kind for kind in TERRAINS if kind["name"] == what), None)
    if terrain is None:
        raise EditError(f"no tileset has a ground {what!r}{did_you_mean(what, [k['name'] for k in TERRAINS])}")
    return "Terrain", terrain
