"""The artwork of a map: layers that are not ours, with their own tiles, as one picture from above.

Tiles are laid as Tiled lays them: bottom left in their cell, flipped, shifted, tinted and faded; the picture is made
when it is first drawn, and smaller than the tiles where a map would be huge.
"""

from __future__ import annotations

import math
import posixpath
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from flockbrush.engine import limits, picture_decoding
from flockbrush.levels import geometry
from flockbrush.levels.checked_nodes import tiles_by_id
from flockbrush.levels.tile_data import FLIP_FLAGS

_ACROSS, _DOWN, _DIAGONAL = 0x80000000, 0x40000000, 0x20000000
_WITH_ALPHA = -1  # cv2.IMREAD_UNCHANGED
_TOGETHER = 4096  # tiles laid at once


@dataclass
class ArtObject:
    """A tile that stands as an object: px, degrees clockwise about its own place."""

    gid: int
    x: float
    y: float
    width: float
    height: float
    rotation: float
    origin: tuple[float, float]  # its place on its picture, shares of width and height


@dataclass
class ArtLayer:
    """A layer that is drawn and means nothing, unless a rule of the level gives its tiles a meaning."""

    name: str
    opacity: float
    dx: float  # px
    dy: float
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    gids: np.ndarray | None = None  # (ny, nx) uint32, optional; with their flip flags, north row first
    objects: list[ArtObject] = field(default_factory=list)  # the lowest first
    image: str = ""  # file of an image layer
    transparent: str = ""  # "#rrggbb" of the image that is not drawn


class TilePictures:
    """Pictures of a tileset's tiles, premultiplied BGRA.

    Parameters
    ----------
    node : Node
        Of the tileset.
    folder : str
        What its image names are relative to.
    files : dict of str to bytes
    """

    def __init__(self, node, folder, files):
        self.node, self.folder, self.files = node, folder, files
        self.tiles = tiles_by_id(node)
        shift = node.get("tileoffset") or {}
        self.shift = float(shift.get("x", 0)), float(shift.get("y", 0))

    @cached_property
    def _sheet(self):
        return self._read(self.node)

    def _read(self, node):
        name = node.get("image", "")
        data = self.files.get(posixpath.normpath(posixpath.join(self.folder, name))) if name else None
        return None if data is None else read_art(data, node.get("transparentcolor", ""))

    def tile(self, number):
        """(h, w, 4) uint8, or None where there is no picture."""
        own = self.tiles.get(number, {})
        frames = own.get("animation") or [{}]
        number = frames[0].get("tileid", number)
        if "image" in self.tiles.get(number, {}):
            return self._read(self.tiles[number])
        sheet, node = self._sheet, self.node
        columns = node.get("columns", 0)
        if sheet is None or not columns:
            return None
        wide, tall = node.get("tilewidth", 0), node.get("tileheight", 0)
        margin, spacing = node.get("margin", 0), node.get("spacing", 0)
        row, column = divmod(number, columns)
        y, x = margin + row * (tall + spacing), margin + column * (wide + spacing)
        cut = sheet[y : y + tall, x : x + wide]
        return cut if cut.size else None


def read_art(data, transparent=""):
    """The picture in a file as premultiplied BGRA, (h, w, 4) uint8; None for what is no picture or too large."""
    size = picture_decoding.picture_size(data)
    if size is None or size[0] * size[1] > limits.PICTURE_PIXELS:
        return None
    picture = picture_decoding.decoded(data, _WITH_ALPHA)
    if picture is None:
        return None
    if picture.dtype == np.uint16:
        picture = (picture >> 8).astype(np.uint8)
    if picture.ndim == 2:
        picture = np.repeat(picture[:, :, None], 3, axis=2)
    if picture.shape[2] == 3:
        alpha = np.full(picture.shape[:2], 255, np.uint8)
        if len(transparent) == 7:
            colour = [int(transparent[k : k + 2], 16) for k in (5, 3, 1)]
            alpha[(picture == colour).all(axis=2)] = 0
        picture = np.dstack([picture, alpha])
    picture[:, :, :3] = (picture[:, :, :3].astype(np.uint16) * picture[:, :, 3:] // 255).astype(np.uint8)
    return picture


@dataclass(eq=False)
class Art:
    """All artwork of a level."""

    layers: list[ArtLayer]  # the lowest first
    tilesets: list[tuple[int, TilePictures]]  # list of (firstgid, TilePictures); by firstgid
    shape: tuple[int, int]  # (ny, nx)
    tile: int  # px
    files: dict[str, bytes] = field(default_factory=dict, repr=False)
    # (ny, nx) bool, optional; cells of our own terrain layer, south row first: drawn over the artwork
    painted: np.ndarray | None = None

    def padded(self, pad: tuple[tuple[int, int], tuple[int, int]]) -> Art:
        """The same artwork on a larger map, ``pad`` cells around it: ((south, north), (west, east))."""
        (south, north), (west, east) = pad
        layers = []
        for layer in self.layers:
            if layer.gids is None:
                layers.append(replace(layer, dx=layer.dx + west * self.tile, dy=layer.dy + north * self.tile))
            else:
                layers.append(replace(layer, gids=np.pad(layer.gids, ((north, south), (west, east)))))
        shape = self.shape[0] + south + north, self.shape[1] + west + east
        painted = None if self.painted is None else np.pad(self.painted, pad)
        return replace(self, layers=layers, shape=shape, painted=painted)

    @cached_property
    def side(self):
        """Pixels of a tile in the picture: those of its file, fewer on a huge map."""
        ny, nx = self.shape
        return max(1, min(self.tile, math.isqrt(int(limits.ART_PIXELS) // (nx * ny))))

    @cached_property
    def picture(self):
        """From above, north row first: (ny * side, nx * side, 4) uint8, premultiplied BGRA."""
        ny, nx = self.shape
        self._known, self._single = {}, 0
        canvas = np.zeros((ny * self.side, nx * self.side, 4), np.uint8)
        for layer in self.layers:
            if layer.gids is not None:
                self._lay_tiles(canvas, layer)
            for thing in layer.objects:
                self._lay_object(canvas, layer, thing)
            if layer.image:
                self._lay_image(canvas, layer)
        del self._known
        return canvas

    def shrunk(self, times):
        """The picture at 1/2, 1/4, ... of its size: `times` halvings."""
        while len(self._smaller) <= times:
            import cv2

            last = self._smaller[-1]
            size = max(1, last.shape[1] // 2), max(1, last.shape[0] // 2)
            self._smaller.append(cv2.resize(last, size, interpolation=cv2.INTER_AREA))
        return self._smaller[times]

    @cached_property
    def _smaller(self):
        return [self.picture]

    # ------------------------------------------------------------ tiles

    def _tile(self, gid, layer):
        """(picture at the right scale, shift x, shift y in px of the map) of a global tile id with flags, or None."""
        key = gid, layer.opacity, layer.tint
        if key not in self._known:
            self._known[key] = self._cut(gid, layer)
        return self._known[key]

    def _cut(self, gid, layer):
        import cv2

        number = gid & ~FLIP_FLAGS & 0xFFFFFFFF
        first, tileset = next(((f, t) for f, t in reversed(self.tilesets) if f <= number), (0, None))
        picture = None if tileset is None else tileset.tile(number - first)
        if picture is None:
            return None
        if gid & _DIAGONAL:
            picture = picture.transpose(1, 0, 2)
        if gid & _ACROSS:
            picture = picture[:, ::-1]
        if gid & _DOWN:
            picture = picture[::-1]
        if self.side != self.tile:
            scale = self.side / self.tile
            size = [max(1, round(length * scale)) for length in (picture.shape[1], picture.shape[0])]
            picture = cv2.resize(np.ascontiguousarray(picture), size, interpolation=cv2.INTER_AREA)
        return faded(picture, layer), *tileset.shift

    def _lay_tiles(self, canvas, layer):
        gids, shift = layer.gids, (layer.dx, layer.dy)
        tiles = {gid: self._tile(gid, layer) for gid in np.unique(gids[gids > 0]).tolist()}
        tiles = {gid: tile for gid, tile in tiles.items() if tile is not None}
        side = self.side, self.side
        if all(tile[0].shape[:2] == side and tile[1] + shift[0] == tile[2] + shift[1] == 0 for tile in tiles.values()):
            for gid, tile in tiles.items():
                self._lay_in_cells(canvas, tile[0], *np.nonzero(gids == gid))
            return
        for row, column in np.argwhere(gids > 0).tolist():  # they overlap: in the order of rows
            tile = tiles.get(int(gids[row, column]))
            self._single += 1
            if tile is None or self._single > limits.ART_TILES:
                continue
            x, y = ((tile[k + 1] + shift[k]) * self.side / self.tile for k in (0, 1))
            top = (row + 1) * self.side - tile[0].shape[0] + y
            composite(canvas, tile[0], round(column * self.side + x), round(top))

    def _lay_in_cells(self, canvas, picture, rows, columns):
        """Lay a tile that fills its cell into many cells."""
        ny, nx = self.shape
        cells = canvas.reshape(ny, self.side, nx, self.side, 4)
        through = (255 - picture[:, :, 3:].astype(np.uint16))[None]
        for k in range(0, len(rows), _TOGETHER):
            some = slice(k, k + _TOGETHER)
            under = cells[rows[some], :, columns[some]].astype(np.uint16)
            cells[rows[some], :, columns[some]] = (picture + (under * through + 127) // 255).astype(np.uint8)

    def _lay_object(self, canvas, layer, thing):
        import cv2

        tile = self._tile(thing.gid, layer)
        self._single += 1
        if tile is None or self._single > limits.ART_TILES:
            return
        scale = self.side / self.tile
        wide, tall = thing.width * scale, thing.height * scale
        x, y = (thing.x + layer.dx) * scale, (thing.y + layer.dy) * scale
        picture, turned = tile[0], math.radians(thing.rotation)
        c, s = math.cos(turned), math.sin(turned)
        kx, ky = wide / picture.shape[1], tall / picture.shape[0]
        shift = np.array([tile[1] * kx, tile[2] * ky]) * scale - np.array(thing.origin) * (wide, tall)
        corners = (geometry.rectangle(wide, tall) + shift) @ np.array([[c, s], [-s, c]]) + (x, y)
        (left, top), (right, bottom) = np.floor(corners.min(0)), np.ceil(corners.max(0))
        size = int(right - left), int(bottom - top)
        if not (0 < size[0] <= canvas.shape[1] * 2 and 0 < size[1] <= canvas.shape[0] * 2):
            return
        matrix = np.array([[kx * c, -ky * s, corners[0, 0] - left], [kx * s, ky * c, corners[0, 1] - top]])
        composite(canvas, cv2.warpAffine(picture, matrix, size, flags=cv2.INTER_LINEAR), int(left), int(top))

    def _lay_image(self, canvas, layer):
        import cv2

        data = self.files.get(layer.image)
        picture = None if data is None else read_art(data, layer.transparent)
        if picture is None:
            return
        scale = self.side / self.tile
        if scale != 1:
            size = [max(1, round(length * scale)) for length in (picture.shape[1], picture.shape[0])]
            picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
        composite(canvas, faded(picture, layer), round(layer.dx * scale), round(layer.dy * scale))


def faded(picture, layer):
    """A premultiplied picture with the opacity and the tint of its layer."""
    red, green, blue = layer.tint
    factors = np.array([blue, green, red, 1.0]) * layer.opacity
    if (factors == 1).all():
        return np.ascontiguousarray(picture)
    return np.round(picture * factors).astype(np.uint8)


def composite(canvas, picture, left, top):
    """Lay a premultiplied picture over another, cut where it leaves it."""
    y0, x0 = max(0, -top), max(0, -left)
    y1, x1 = min(picture.shape[0], canvas.shape[0] - top), min(picture.shape[1], canvas.shape[1] - left)
    if y1 <= y0 or x1 <= x0:
        return
    part = canvas[top + y0 : top + y1, left + x0 : left + x1]
    over = picture[y0:y1, x0:x1]
    part[:] = (over + (part.astype(np.uint16) * (255 - over[:, :, 3:].astype(np.uint16)) + 127) // 255).astype(np.uint8)
