"""Decode pictures without terminal output; the caller reports errors."""

from __future__ import annotations

import struct

import numpy as np


def decoded(data: bytes, flags: int) -> np.ndarray | None:
    """The picture in the bytes of a file as OpenCV decodes it, None where it is damaged.

    Its size must have been checked before: OpenCV takes the memory that the file claims.
    """
    import cv2

    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None
    finally:
        cv2.utils.logging.setLogLevel(before)


def picture_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) that a PNG, JPEG, WebP or BMP claims to have; None for anything else."""
    for begins, size in _SIZES:
        if data.startswith(begins):
            try:
                width, height = size(data)
            except (struct.error, IndexError, TypeError):
                return None
            return (width, height) if width > 0 and height > 0 else None
    return None


def _size_of_png(data):
    return struct.unpack(">II", data[16:24]) if data[12:16] == b"IHDR" else None


def _size_of_jpeg(data):
    at = 2
    while True:
        at = data.index(b"\xff", at) if b"\xff" in data[at : at + 65536] else len(data)
        while data[at] == 0xFF:
            at += 1
        marker, at = data[at], at + 1
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # start of frame
            height, width = struct.unpack(">HH", data[at + 3 : at + 7])
            return width, height
        if marker in (0xD9, 0xDA):  # end, or pixels before any frame
            return None
        if not (0xD0 <= marker <= 0xD8 or marker <= 1):
            at += struct.unpack(">H", data[at : at + 2])[0]


def _size_of_webp(data):
    kind = data[12:16]
    if data[8:12] != b"WEBP":
        return None
    if kind == b"VP8X":
        return tuple(1 + int.from_bytes(data[k : k + 3], "little") for k in (24, 27))
    if kind == b"VP8L":
        bits = struct.unpack("<I", data[21:25])[0]
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack("<HH", data[26:30])
    return (width & 0x3FFF, height & 0x3FFF) if kind == b"VP8 " else None


def _size_of_bmp(data):
    if struct.unpack("<I", data[14:18])[0] == 12:
        return struct.unpack("<HH", data[18:22])
    width, height = struct.unpack("<ii", data[18:26])
    return width, abs(height)


_SIZES = (
    (b"\x89PNG\r\n\x1a\n", _size_of_png),
    (b"\xff\xd8", _size_of_jpeg),
    (b"RIFF", _size_of_webp),
    (b"BM", _size_of_bmp),
)
