"""Tile layers as Tiled packs them: lists, base64, zlib, gzip, flip flags."""

from __future__ import annotations

import base64
import binascii
import zlib

import numpy as np

FLIP_FLAGS = 0xF0000000  # mirrored, rotated: the top four bits of a global tile id
_WINDOW = {"zlib": 15, "gzip": 31}


def decode(data, encoding, compression, width, height) -> np.ndarray:
    """Global tile ids without their flip flags, (height, width) uint32, north row first.

    Raises
    ------
    ValueError
        In words for the designer: wrong amount, wrong kind, or a compression that is not read.
    """
    encoding, compression = encoding or "csv", compression or ""
    if encoding not in ("csv", "base64"):
        raise ValueError(f"unknown tile data encoding {encoding!r}; available: csv, base64")
    if compression == "zstd":
        raise ValueError(
            "tile data compressed with zstd is not supported; set Map > Tile Layer Format to CSV or Base64 (zlib)"
        )
    if compression and compression not in _WINDOW:
        raise ValueError(f"unknown tile data compression {compression!r}; available: zlib, gzip")
    gids = _from_list(data, width * height) if encoding == "csv" else _from_base64(data, compression, width * height)
    return (gids & np.uint32(~FLIP_FLAGS & 0xFFFFFFFF)).reshape(height, width)


def _from_list(data, count):
    if not isinstance(data, list):
        raise ValueError("tile data must be a list of numbers, or name its encoding")
    if len(data) != count:
        raise ValueError(f"tile data must have {count} tiles, got {len(data)}")
    if set(map(type, data)) - {int} or (data and not 0 <= min(data) <= max(data) < 2**32):
        raise ValueError("tile data must be whole numbers from 0 to 4294967295")
    return np.array(data, np.uint32)


def _from_base64(data, compression, count):
    if not isinstance(data, str):
        raise ValueError("base64 tile data must be a string")
    try:
        packed = base64.b64decode("".join(data.split()), validate=True)
    except (binascii.Error, ValueError):
        raise ValueError("tile data is not valid base64") from None
    if compression:
        packed = _inflate(packed, _WINDOW[compression], 4 * count, compression)
    if len(packed) != 4 * count:
        raise ValueError(f"tile data must have {4 * count} bytes ({count} tiles), got {len(packed)}")
    return np.frombuffer(packed, "<u4").astype(np.uint32)


def _inflate(packed, window, size, compression):
    """At most one byte more than expected is ever unpacked: a bomb stays shut."""
    stream = zlib.decompressobj(window)
    try:
        unpacked = stream.decompress(packed, size + 1)
    except zlib.error:
        raise ValueError(f"tile data is not valid {compression}") from None
    if len(unpacked) > size:
        raise ValueError(f"tile data unpacks to more than {size} bytes ({size // 4} tiles)")
    return unpacked


# unpacked for editing -----------------------------------------------------------


def unpack(data, encoding, compression, width, height) -> np.ndarray:
    """As `decode`, with the flip flags left on."""
    encoding, compression = encoding or "csv", compression or ""
    gids = decode(data, encoding, compression, width, height)
    if encoding == "csv":
        whole = np.array(data, np.uint32)
    else:
        packed = base64.b64decode("".join(data.split()))
        packed = _inflate(packed, _WINDOW[compression], 4 * width * height, compression) if compression else packed
        whole = np.frombuffer(packed, "<u4").astype(np.uint32)
    return gids | (whole.reshape(height, width) & np.uint32(FLIP_FLAGS))


def pack(gids, encoding, compression):
    """Tile data as Tiled writes it with this encoding: a list, or a text of base64."""
    if (encoding or "csv") == "csv":
        return gids.ravel().tolist()
    packed = gids.astype("<u4").tobytes()
    if compression:
        stream = zlib.compressobj(6, zlib.DEFLATED, _WINDOW[compression])
        packed = stream.compress(packed) + stream.flush()
    return base64.b64encode(packed).decode()


class TileGrid:
    """The tiles of one layer, unpacked; `settle` packs them again, the way the layer had them."""

    def __init__(self, node):
        self.node = node
        self.width, self.height = node["width"], node["height"]
        self.packing = node.get("encoding"), node.get("compression")
        # (height, width) uint32; with their flip flags, north row first
        self.gids = unpack(node["data"], *self.packing, self.width, self.height)
        self._read = self.gids.copy(), node["data"]
        self.dirty = False

    def put(self, rows, columns, gids):
        """Set tiles."""
        self.gids[rows, columns] = gids
        self.dirty = True

    def settle(self):
        """Write the tiles into the layer; what is as it was read is written as it was read."""
        if self.dirty:
            same = np.array_equal(self.gids, self._read[0])
            self.node["data"] = self._read[1] if same else pack(self.gids, *self.packing)
            self.dirty = False
