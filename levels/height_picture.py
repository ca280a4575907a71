"""The picture of heights that a level names."""

from __future__ import annotations

import struct

import numpy as np
from flockbrush.engine import limits, picture_decoding

AS_STORED = -1  # cv2.IMREAD_UNCHANGED


def read_grey(data: bytes) -> np.ndarray:
    """A grey PNG of 8 or 16 bit, (ny, nx), north row first; ValueError."""
    if data[:8] != b"\x89PNG\r\n\x1a\n" or len(data) < 33 or data[12:16] != b"IHDR":
        raise ValueError("this is not a PNG picture")
    width, height, depth, colour = struct.unpack(">IIBB", data[16:26])
    if colour != 0 or depth not in (8, 16):
        raise ValueError("the picture must be grey, 8 or 16 bit, without colour or transparency")
    if not 0 < width * height <= limits.HEIGHT_PIXELS:
        raise ValueError(f"the picture has {width} x {height} pixels; there may be at most {limits.HEIGHT_PIXELS}")
    grey = picture_decoding.decoded(data, AS_STORED)
    if grey is None or grey.ndim != 2:
        raise ValueError("the picture is damaged")
    return grey
