"""Reading layers that are not ours: what is drawn of them, and what the map's rules make of their tiles."""

from __future__ import annotations

import posixpath

import numpy as np
from flockbrush.levels.art import Art, ArtLayer, ArtObject, TilePictures
from flockbrush.levels.checked_nodes import dicts, real, text, tiles_by_id, whole
from flockbrush.levels.ground_rules import GroundRules, facts_of
from flockbrush.levels.layer_reader import is_note
from flockbrush.levels.level_files import FileRefused
from flockbrush.levels.terrain_kinds import Terrain, TerrainKind
from flockbrush.levels.tile_data import FLIP_FLAGS

_NO_FLAGS = np.uint32(~FLIP_FLAGS & 0xFFFFFFFF)


class ArtReader:
    """Reads the layers of others into a level; leans on the level reader for structure and files."""

    def __init__(self, reader, frame, rules, place):
        self.reader, self.frame, self.place = reader, frame, place
        self.rules = GroundRules(rules, place.say, [tileset.node for tileset in reader.tiles.tilesets])
        self.kinds: dict[str, TerrainKind] = {}  # those that rules make, by name
        self._facts: dict[int, object] = {}
        self._numbers: dict[str, int] = {}

    def read(self, level, layers):
        """Read layers, the lowest first; ours come after them."""
        drawn_layers, used = [], set()
        for message in self.rules.unmatched([_last(one.name) for one in layers if one.kind == "tilelayer"]):
            self.place.warn(message)
        for layer in layers:
            layer.flags = True
            art = self._layer(layer)
            if art is None:
                continue
            if art.gids is not None and self.rules.rules:
                self._paint(level, art)
            if not layer.hidden and not is_note(layer.name):
                drawn_layers.append(art)
                used |= _tiles_of(art)
        if drawn_layers:
            self._keep(level, drawn_layers, used)

    def finish(self, level):
        """Tell the artwork where our own layers have painted ground over it."""
        if level.art is not None:
            level.art.painted = self.reader.painted

    # ------------------------------------------------------------ layers

    def _layer(self, layer):
        look = layer.name, layer.opacity, layer.dx, layer.dy, layer.tint
        shift = self.frame.left * self.frame.tile, self.frame.top * self.frame.tile
        if layer.kind == "tilelayer":
            (sx, dx), (sy, dy) = (divmod(shift, self.frame.tile) for shift in (layer.dx, layer.dy))
            gids = self.reader.layers.laid(layer, self.frame, int(sx), int(sy))  # with flip flags
            return ArtLayer(look[0], look[1], dx, dy, look[4], gids=gids)
        look = look[0], look[1], look[2] - shift[0], look[3] - shift[1], look[4]
        if layer.kind == "imagelayer":
            name = text(layer.node, "image", layer.place)
            colour = text(layer.node, "transparentcolor", layer.place)
            return ArtLayer(*look, image=name, transparent=colour) if self._read("", name, layer.place) else None
        things = [self._object(node, layer.place) for node in dicts(layer.node, "objects") if "gid" in node]
        things = [thing for thing in things if thing is not None]
        if layer.node.get("draworder") != "index":
            things.sort(key=lambda one: one.y)
        return ArtLayer(*look, objects=things) if things else None

    def _object(self, node, place):
        gid = whole(node, "gid", place, 1, 2**32 - 1)
        if gid is None or node.get("visible") is False:
            return None
        numbers = (real(node, key, place) for key in ("x", "y", "width", "height", "rotation"))
        return ArtObject(gid, *numbers, self.reader.tiles.origin(gid & int(_NO_FLAGS)))

    # ------------------------------------------------------------ pictures

    def _keep(self, level, layers, used):
        """Keep what is needed to draw: the pictures of the tilesets that are used, among the level's files."""
        tilesets = []
        for tileset in self.reader.tiles.tilesets:
            numbers = [gid - tileset.firstgid for gid in used if self.reader.tiles.of(gid) is tileset]
            pictures = TilePictures(tileset.node, tileset.folder, self.reader.files.got)
            if numbers:
                self._read_pictures(tileset, numbers)
            tilesets.append((tileset.firstgid, pictures))
        level.art = Art(layers, tilesets, (self.frame.ny, self.frame.nx), self.frame.tile, self.reader.files.got)

    def _read_pictures(self, tileset, numbers):
        place = self.reader.place.at(tileset.node, f"tileset {tileset.name!r}")
        if tileset.node.get("image"):
            self._read(tileset.folder, tileset.node["image"], place)
        gids = set(numbers)
        for number, tile in tiles_by_id(tileset.node).items():
            if number in gids and tile.get("image"):
                self._read(tileset.folder, tile["image"], place)

    def _read(self, folder, name, place):
        """Whether a picture could be read; one that is missing is a warning, for nothing depends on it."""
        try:
            self.reader.files.read(posixpath.join(folder, name))
        except (FileRefused, TypeError) as error:
            place.warn(f"picture {str(name)[:200]!r} cannot be drawn: {error}")
            return False
        return True

    # ------------------------------------------------------------ rules

    def _paint(self, level, art):
        """Give the cells of a layer the ground that the rules make of its tiles."""
        gids = (art.gids & _NO_FLAGS)[::-1]
        for gid in np.unique(gids[gids > 0]).tolist():
            values = self._ground(gid, art.name)
            if values is None:
                continue
            if level.terrain is None:
                level.terrain = Terrain.blank(gids.shape)
            name = values["name"]
            self._numbers[name] = level.terrain.put(gids == gid, values, self._numbers.get(name))
            self.kinds.setdefault(name, TerrainKind.of(values))

    def _ground(self, gid, layer):
        tileset = self.reader.tiles.of(gid)
        if tileset is None:
            return None
        if tileset.firstgid not in self._facts:
            self._facts[tileset.firstgid] = facts_of(tileset.node)
        facts = self._facts[tileset.firstgid](gid - tileset.firstgid)
        return self.rules.ground(_last(layer), facts)


def _last(name):
    """The name of a layer without those of its groups."""
    return name.rsplit("/", 1)[-1]


def _tiles_of(art):
    """Global tile ids, without flags, that a layer draws."""
    gids = {thing.gid & int(_NO_FLAGS) for thing in art.objects}
    return gids if art.gids is None else gids | set(np.unique(art.gids[art.gids > 0] & _NO_FLAGS).tolist())
