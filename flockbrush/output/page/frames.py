"""Frames of animals packed as small integers, which the page unpacks.

A chunk is the moments of some seconds: little-endian ``frames, animals, bodies`` (uint32), the box of the positions
(low, size: 6 float32), ``ids`` and first bodies (animals, uint32 each), lengths and widths (bodies, float32 each), then
for each of `COLUMNS` and labels the numbers [animal][frame] as differences from frame to frame modulo 2^16, low bytes
before high bytes.  Then zlib.  The bodies of an animal follow its first one; the column ``body`` tells which it has.
"""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

import numpy as np

from flockbrush.output.attitude import angles_of

FRAMES = 64  # in a chunk
COLUMNS = ("present", "x", "y", "z", "yaw", "pitch", "roll", "clip", "phase", "species", "body", "brush", "leader",
           "marked")  # fmt: skip
FULL = 65535
TURN = 65536 / (2 * np.pi)


class FrameRow(NamedTuple):
    """One moment, ready to be packed."""

    ids: np.ndarray
    xyz: np.ndarray
    columns: dict  # by name, (n,) int


def row_of(moment, body, attitude, clip, phase, marked) -> FrameRow:
    """A moment with its bodies, attitude (forward, up), gait and the leaders that are `marked`, as whole numbers."""
    yaw, pitch, roll = angles_of(*attitude)
    angles = {"yaw": yaw, "pitch": pitch, "roll": roll}
    columns = {name: np.round(angle * TURN).astype(np.int64) for name, angle in angles.items()}
    columns |= {"clip": clip, "phase": np.round(phase * FULL).astype(np.int64)}
    columns |= {"species": moment.species, "body": body, "brush": moment.brush}
    columns |= {"leader": moment.leader.astype(np.int64), "marked": marked.astype(np.int64)}
    return FrameRow(moment.ids, moment.xyz, columns | moment.labels)


def packed(rows: list[FrameRow], bodies: dict, labels) -> bytes:
    """A chunk.

    Parameters
    ----------
    bodies : dict of int to list of AnimalBody
        Those that each animal has had, by id.
    labels : sequence of str
        Names of the columns behind `COLUMNS`.
    """
    ids = np.unique(np.concatenate([row.ids for row in rows]))
    places = [np.searchsorted(ids, row.ids) for row in rows]
    everywhere = np.concatenate([row.xyz for row in rows])
    low = everywhere.min(axis=0) if len(everywhere) else np.zeros(3)
    size = np.maximum(everywhere.max(axis=0) - low, 1e-6) if len(everywhere) else np.ones(3)
    had = [bodies[animal] for animal in ids.tolist()]
    first = np.cumsum([0, *map(len, had)])
    head = struct.pack("<III6f", len(rows), len(ids), first[-1], *low, *size)
    sizes = np.array([(body.length, body.width) for those in had for body in those], "<f4").reshape(-1, 2)
    numbers = [ids.astype("<u4"), first[:-1].astype("<u4"), sizes[:, 0], sizes[:, 1]]
    parts = [head, *(part.tobytes() for part in numbers)]
    for name in (*COLUMNS, *labels):
        table = _table(rows, places, len(ids), name, low, size)
        change = np.diff(table, axis=1, prepend=0).astype(np.uint16)
        parts += [(change & 255).astype(np.uint8).tobytes(), (change >> 8).astype(np.uint8).tobytes()]
    return zlib.compress(b"".join(parts), 9)


def _table(rows, places, count, name, low, size):
    """(animals, frames) whole numbers of one column; absent animals keep their last value, which costs no space."""
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
