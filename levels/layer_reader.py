"""Layers of a map out of their groups, the size of the map, and the tiles of its layers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flockbrush.engine import limits
from flockbrush.engine.problems import did_you_mean
from flockbrush.levels import schema
from flockbrush.levels.checked_nodes import FAR, real, text, whole
from flockbrush.levels.json_lines import Node
from flockbrush.levels.properties import FilePlace, shown
from flockbrush.levels.tile_data import decode, unpack

WHITE = (1.0, 1.0, 1.0)  # a tint that changes nothing


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
    tint: tuple[float, ...] = WHITE
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


class LayerReader:
    """Walks through the layers of one map and unpacks their tiles, within `flockbrush.engine.limits`."""

    def __init__(self, place):
        self.place = place  # the map
        self.cells = 0  # tiles decoded so far, against the cap
        self.layers = 0

    def walk(self, nodes, place, dx=0.0, dy=0.0, opacity=1.0, prefix="", hidden=False, tint=WHITE):
        """Every layer, out of its groups, offsets, opacities and tints added up."""
        if not isinstance(nodes, list):
            place.say("'layers' must be a list")
            return
        for node in nodes:
            if not isinstance(node, Node):
                place.say("each layer must be an object")
                continue
            name = prefix + text(node, "name", place)
            layer_place = self.place.at(node, f"layer {name[:80]!r}")
            x, y = dx + real(node, "offsetx", layer_place), dy + real(node, "offsety", layer_place)
            strength = opacity * min(max(real(node, "opacity", layer_place, 1.0), 0.0), 1.0)
            kind = text(node, "type", layer_place)
            unseen = hidden or node.get("visible") is False
            colour = tuple(a * b for a, b in zip(tint, _tint(node.get("tintcolor")), strict=True))
            if kind == "group":
                yield from self.walk(node.get("layers"), layer_place, x, y, strength, name + "/", unseen, colour)
            elif kind in ("tilelayer", "objectgroup", "imagelayer"):
                self.layers += 1
                if self.layers > limits.LAYERS:
                    if self.layers == limits.LAYERS + 1:
                        layer_place.say(f"there are more than {limits.LAYERS} layers")
                    return
                yield ReadLayer(node, kind, name, x, y, strength, layer_place, unseen, colour)
            else:
                layer_place.say(
                    f"the layer's type is {shown(kind)}; there are tilelayer, objectgroup, imagelayer, group"
                )

    def frame(self, doc, layers, metres, place):
        """The size of the map; None with a problem."""
        tile = whole(doc, "tilewidth", place, 1, 4096)
        high = whole(doc, "tileheight", place, 1, 4096)
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
            return self._infinite_frame(layers, tile, metres, place)
        nx, ny = whole(doc, "width", place, 1, 1_000_000), whole(doc, "height", place, 1, 1_000_000)
        if nx is None or ny is None or not self._fits(nx, ny, place):
            return None
        return MapFrame(tile, metres, 0, 0, nx, ny)

    def _fits(self, nx, ny, place):
        if nx * ny <= limits.LAYER_CELLS:
            return True
        place.say(f"the map has {nx} x {ny} tiles; there may be at most {limits.LAYER_CELLS}")
        return False

    def _infinite_frame(self, layers, tile, metres, place):
        """An infinite map is as large as what is painted."""
        boxes = [
            box
            for layer in layers
            if layer.kind == "tilelayer" and kind_of(layer.name)
            for box in self._painted(layer, tile)
        ]
        if not boxes:
            place.say(
                "an infinite map is as large as its painted area, but nothing is painted; paint terrain or fix its size"
            )
            return None
        left, top, right, bottom = np.array(boxes).T
        x0, y0, x1, y1 = int(left.min()), int(top.min()), int(right.max()), int(bottom.max())
        if not self._fits(x1 - x0, y1 - y0, place):
            return None
        return MapFrame(tile, metres, x0, y0, x1 - x0, y1 - y0)

    def _painted(self, layer, tile):
        """(left, top, right, bottom) of the painted part of each chunk, in tiles."""
        sx, sy = self._shift(layer, tile)
        for x, y, gids in self.chunks(layer):
            rows, columns = np.nonzero(gids)
            if len(rows):
                yield (
                    x + sx + columns.min(),
                    y + sy + rows.min(),
                    x + sx + columns.max() + 1,
                    y + sy + rows.max() + 1,
                )

    def _shift(self, layer, tile):
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
            layer.pieces = list(self._unpacked(layer))
        return layer.pieces

    def _unpacked(self, layer):
        node, place = layer.node, layer.place
        chunks = node.get("chunks", [node])
        if not isinstance(chunks, list) or not all(isinstance(c, Node) for c in chunks):
            place.say("'chunks' must be a list of objects")
            return
        encoding, compression = text(node, "encoding", place), text(node, "compression", place)
        for chunk in chunks:
            width, height = (whole(chunk, k, place, 1, limits.LAYER_CELLS) for k in ("width", "height"))
            x, y = (whole(chunk, k, place, -FAR, FAR, 0) for k in "xy")
            if None in (width, height, x, y):
                continue
            self.cells += width * height
            if width * height > limits.LAYER_CELLS or self.cells > limits.LEVEL_CELLS:
                place.say(
                    f"{width} x {height} tiles are too many; a layer may have {limits.LAYER_CELLS}, "
                    "all layers together four times that"
                )
                return
            try:
                read = unpack if layer.flags else decode
                yield x, y, read(chunk.get("data"), encoding, compression, width, height)
            except ValueError as error:
                place.say(str(error))

    def gids(self, layer, frame):
        """The layer's global tile ids, (ny, nx), south row first."""
        return self.laid(layer, frame, *self._shift(layer, frame.tile))[::-1]

    def laid(self, layer, frame, sx, sy):
        """The layer's tiles, so many further east and south, (ny, nx), north row first; its data are let go."""
        whole = np.zeros((frame.ny, frame.nx), np.uint32)
        for x, y, piece in self.chunks(layer):
            left, top = x + sx - frame.left, y + sy - frame.top
            cut_x, cut_y = max(0, -left), max(0, -top)
            part = piece[cut_y : max(frame.ny - top, 0), cut_x : max(frame.nx - left, 0)]
            if part.size:
                into = whole[top + cut_y : top + cut_y + part.shape[0], left + cut_x : left + cut_x + part.shape[1]]
                into[part > 0] = part[part > 0]
        layer.pieces = []
        return whole


def _tint(colour):
    """(red, green, blue), 0 to 1, of a tint such as #80ff0000."""
    digits = colour[-6:] if isinstance(colour, str) and len(colour) in (7, 9) else ""
    try:
        return tuple(int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4))
    except ValueError:
        return WHITE


def split(layers):
    """(layers that are ours, the others).

    Where there is a group `schema.GROUP`, ours are those in it.  Otherwise those with our names are, and every object
    layer; a tile or image layer with another name is artwork, unless it has a name like ours.  Those that are the
    designer's own by name are never ours.
    """
    grouped, ours, others = has_group(layers), [], []
    for layer in layers:
        meant = _in_group(layer) if grouped else layer.kind == "objectgroup" or _is_ours(layer.name)
        (ours if meant and not is_designer_layer(layer.name) else others).append(layer)
    return ours, others


def has_group(layers):
    """Whether our layers are those in a group `schema.GROUP`: all else is of somebody else's map."""
    return any(map(_in_group, layers))


def _in_group(layer):
    return layer.name.startswith(schema.GROUP + "/")


def is_designer_layer(name):
    """Whether a layer is the designer's own, by its name: notes, or decor that is drawn."""
    return plain_name(name).startswith(schema.IGNORED)


def is_note(name):
    """Whether a layer is not even drawn."""
    return plain_name(name).startswith(schema.IGNORED[0])


def _is_ours(name):
    """Whether a layer has one of our names, or one so near that it must be meant."""
    return kind_of(name) is not None or "did you mean" in did_you_mean(plain_name(name), schema.LAYER_NAMES)


def plain_name(name):
    """The layer's own name, lower case, without its groups."""
    return name.rsplit("/", 1)[-1].strip().lower()


def kind_of(name):
    """Which of our layers this is; None for another."""
    return next((k for k in schema.LAYER_NAMES if plain_name(name).startswith(k)), None)


def default_class(thing, kind):
    """The class of an object without one in a layer of this kind; None where the layer does not tell."""
    if kind == "measure":
        return "Line" if "polyline" in thing else "Area"
    return schema.HOMES.get(kind)
