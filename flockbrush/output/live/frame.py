"""Frames of the live link: the animals of one moment as bytes, little-endian.

A frame is a header of 32 bytes and one column after the other, each with a value for every animal.

| bytes | type | header |
|---|---|---|
| 4 | text | ``FLK1`` |
| 4 | uint32 | number of animals, n |
| 8 | uint64 | ticks since the start |
| 8 | float64 | simulated seconds since the start |
| 8 | float64 | when the newest tick in this frame was done: seconds since 1970 on the server's clock |
"""

from __future__ import annotations

import struct

import numpy as np

from flockbrush.output.attitude import angles_of

MAGIC = b"FLK1"
HEADER = struct.Struct("<4sIQdd")

# (name, type, values for each animal, meaning); the order is that of the bytes
COLUMNS = (
    ("id", "<u4", 1, "constant id of the animal"),
    ("xyz", "<f4", 3, "metres east, north and up of the south-west corner"),
    ("heading", "<f4", 1, "rad, counter-clockwise from east"),
    ("pitch", "<f4", 1, "rad, nose up"),
    ("bank", "<f4", 1, "rad, right wing down"),
    ("length", "<f4", 1, "m, nose to tail"),
    ("species", "<u2", 1, "index into the names of species"),
    ("brush", "<u2", 1, "index into the names of brushes"),
    ("state", "<u2", 1, "index into the names of states; 0 without programs"),
    ("flags", "<u2", 1, "1: a leader"),
)

LABELLED = ("state",)  # the labels of moments that are in frames


class FrameError(ValueError):
    """Bytes are not a frame; ``str()`` is the reason."""


def pack(moment, tick, made) -> bytes:
    """A moment as a frame.

    Parameters
    ----------
    moment : flockbrush.runs.snapshots.Moment
    tick : int
    made : float
        When the tick was done, s since 1970.
    """
    heading, pitch, bank = angles_of(moment.forward, moment.up)
    values = {
        "id": moment.ids,
        "xyz": moment.xyz,
        "heading": heading,
        "pitch": pitch,
        "bank": bank,
        "length": moment.length,
        "species": moment.species,
        "brush": moment.brush,
        "state": moment.labels.get("state", np.zeros(len(moment))),
        "flags": moment.leader,
    }
    columns = [np.asarray(values[name]).astype(kind).tobytes() for name, kind, _, _ in COLUMNS]
    return b"".join([HEADER.pack(MAGIC, len(moment), tick, moment.time, made), *columns])


def unpack(data: bytes) -> dict:
    """The columns of a frame by name, and ``tick``, ``time``, ``made``; FrameError."""
    if len(data) < HEADER.size:
        raise FrameError(f"a frame has at least {HEADER.size} bytes, got {len(data)}")
    magic, count, tick, time, made = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise FrameError(f"a frame begins with {MAGIC.decode()}, got {magic!r}")
    frame, at = {"tick": tick, "time": time, "made": made}, HEADER.size
    if len(data) != at + count * row_bytes():
        raise FrameError(f"a frame of {count} animals has {at + count * row_bytes()} bytes, got {len(data)}")
    for name, kind, width, _ in COLUMNS:
        column = np.frombuffer(data, kind, count * width, at)
        at += column.nbytes
        frame[name] = column.reshape(count, width) if width > 1 else column
    return frame


def row_bytes() -> int:
    """Bytes for each animal."""
    return sum(np.dtype(kind).itemsize * width for _, kind, width, _ in COLUMNS)
