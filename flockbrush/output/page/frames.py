"""Frames of animals packed as small integers, which the page unpacks.

A chunk is the moments of some seconds: little-endian ``frames, animals`` (uint32), the box of the positions (low, size:
6 float32), ``ids`` (animals, uint32), body lengths and widths (animals, float32 each), then for each of `COLUMNS` and
labels the numbers [animal][frame] as differences from frame to frame modulo 2^16, low bytes before high bytes.  Then
zlib.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

import numpy as np

from flockbrush.output.attitude import angles_of

FRAMES = 64  # in a chunk
COLUMNS = ("present", "x", "y", "z", "yaw", "pitch", "roll", "clip", "phase", "species", "brush", "leader")
FULL = 65535
TURN = 65536 / (2 * np.pi)


class FrameRow(NamedTuple):
    """One moment, ready to be packed."""

    ids: np.ndarray
    xyz: np.ndarray
    columns: dict  # by name, (n,) int


def row_of(moment, attitude, clip, phase) -> FrameRow:
    """A moment with its attitude (forward, up) and gait as whole numbers."""
    yaw, pitch, roll = angles_of(*attitude)
    angles = {"yaw": yaw, "pitch": pitch, "roll": roll}
    columns = {name: np.round(angle * TURN).astype(np.int64) for name, angle in angles.items()}
    columns |= {"clip": clip, "phase": np.round(phase * FULL).astype(np.int64)}
    columns |= {"species": moment.species, "brush": moment.brush, "leader": moment.leader.astype(np.int64)}
    return FrameRow(moment.ids, moment.xyz, columns | moment.labels)


def packed(rows: list[FrameRow], sizes: dict, labels) -> bytes:
    """A chunk.

    Parameters
    ----------
    sizes : dict of int to (length, width)
        Of every animal's body, m.
    labels : sequence of str
        Names of the columns behind `COLUMNS`.
    """
    ids = np.unique(np.concatenate([row.ids for row in rows]))
    places = [np.searchsorted(ids, row.ids) for row in rows]
    everywhere = np.concatenate([row.xyz for row in rows])
    low = everywhere.min(axis=0) if len(everywhere) else np.zeros(3)
    size = np.maximum(everywhere.max(axis=0) - low, 1e-6) if len(everywhere) else np.ones(3)
    head = struct.pack("<II6f", len(rows), len(ids), *low, *size)
    bodies = np.array([sizes[animal] for animal in ids.tolist()], "<f4").reshape(-1, 2)
    parts = [head, ids.astype("<u4").tobytes(), bodies[:, 0].tobytes(), bodies[:, 1].tobytes()]
    for name in (*COLUMNS, *labels):
        table = _table(rows, places, len(ids), name, low, size)
        change = np.diff(table, axis=1, prepend=0).astype(np.uint16)
        parts += [(change & 255).astype(np.uint8).tobytes(), (change >> 8).astype(np.uint8).tobytes()]
    return zlib.compress(b"".join(parts), 9)


def _table(rows, places, count, name, low, size):
    """(animals, frames) whole numbers of one column; who is absent keeps its last, which costs nothing."""
    table = np.zeros((count, len(rows)), np.int64)
    for k, (row, place) in enumerate(zip(rows, places, strict=True)):
        if name == "present":
            table[place, k] = 1
            continue
        if k:
            table[:, k] = table[:, k - 1]
        if name in "xyz":
            axis = "xyz".index(name)
            table[place, k] = np.round((row.xyz[:, axis] - low[axis]) / size[axis] * FULL)
        else:
            table[place, k] = row.columns[name]
    return table
