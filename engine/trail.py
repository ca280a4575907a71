"""Sums of a state, tick by tick: enough to say later what differs and, of a single animal, which one and by how much.

A column of n rows with k words each is kept as k + 1 numbers: the sum of each word over the rows, modulo 2^64, and the
sum of all words, each weighted by its row and its place in the row.  When one row differs, the sums differ by the
difference of its words, and the weighted sum tells the row.  Of everything else a digest is kept.  A record holds
what has changed since the record before it.
"""

from __future__ import annotations

import hashlib
import math
import struct

import numpy as np
from flockbrush.engine.state import digest_of
from numba import njit

_ENTRY = struct.Struct("<HBI")  # number of the name, length of the name where it is new, length of the value
_ODD = 0x9E3779B97F4A7C15  # weights are odd, so that multiplying by one loses nothing


class TrailError(ValueError):
    """Records that are no trail."""


class Trail:
    """What is written tick by tick."""

    def __init__(self):
        self._numbers: dict[str, int] = {}
        self._marks: dict[str, bytes] = {}

    def record(self, world, marks):
        """What has changed since the last time, as bytes.

        Parameters
        ----------
        marks : dict of str to bytes
            As `flockbrush.engine.state.state_hash` fills it.
        """
        marks = marks | traces(world)
        changed = [name for name, mark in marks.items() if self._marks.get(name) != mark]
        removed = [name for name in self._marks if name not in marks]
        self._marks = marks
        values = values_of(world, {name: marks[name] for name in changed})
        return b"".join(self._entry(name, values.get(name, b"")) for name in (*changed, *removed))

    def _entry(self, name, value):
        known = name in self._numbers
        number = self._numbers.setdefault(name, len(self._numbers))
        text = b"" if known else name.encode()
        return _ENTRY.pack(number, len(text), len(value)) + text + value


def state_at(records):
    """{name: value} after these records of a trail, in order of tick; TrailError."""
    names: dict[int, str] = {}
    values: dict[str, bytes] = {}
    for record in records:
        data, at = bytes(record), 0
        while at < len(data):
            try:
                number, text, size = _ENTRY.unpack_from(data, at)
                at += _ENTRY.size
                if text:
                    names[number] = data[at : at + text].decode()
                values[names[number]] = data[at + text : at + text + size]
            except (struct.error, KeyError, UnicodeDecodeError) as error:
                raise TrailError(f"the sums are damaged: {error}") from None
            at += text + size
    return {name: value for name, value in values.items() if value}


def values_of(world, marks):
    """{name: value}: what a trail keeps of these parts of a state.

    Parameters
    ----------
    marks : dict of str to bytes
        As `flockbrush.engine.state.state_hash` fills it, and `traces`.
    """
    return {name: _value(column_named(world, name), mark) for name, mark in marks.items()}


def column_named(world, name):
    """The column of a part of the state, "ids" too; None for a part that is none."""
    if name == "ids":
        return world.agents.ids
    field = world.agents.fields.get(name)
    return None if field is None else world.agents[field]


def _value(column, mark):
    if column is None:
        return hashlib.blake2b(mark, digest_size=8).digest()
    return len(column).to_bytes(8, "little") + _sums(words_of(column)).tobytes()


def traces(world):
    """{name: digest} of what is made anew in every tick and is no part of the state: resources with a ``trace()``."""
    named_arrays = ((f"resource {type(r).__name__}", r.trace()) for r in world.resources() if hasattr(r, "trace"))
    return {name: digest_of(arrays) for name, arrays in named_arrays}


def words_of(column):
    """(n, k) uint64: the rows of a column, bit for bit."""
    flat = np.ascontiguousarray(column).reshape(len(column), math.prod(column.shape[1:]))
    return flat.view(f"u{flat.dtype.itemsize}").astype(np.uint64, copy=False)


@njit(cache=True, nogil=True)
def _sums(words):
    """The sum of each word over the rows, and the weighted sum of all."""
    n, k = words.shape
    sums = np.zeros(k + 1, np.uint64)
    for i in range(n):
        row = np.uint64(0)
        for c in range(k):
            sums[c] += words[i, c]
            row += words[i, c] * (np.uint64(2 * c + 1) * np.uint64(_ODD))
        sums[k] += np.uint64(2 * i + 1) * row
    return sums


def rows_in(value):
    """How many rows a column had whose value in a trail this is."""
    return int(np.frombuffer(value, np.uint64, 1)[0]) if len(value) >= 8 else 0


def column_sum(value):
    """The sum of the first words of a column, as a signed number."""
    return int(np.frombuffer(value, np.int64)[1]) if len(value) >= 16 else 0


def only_row(value, column):
    """(row, its words then) where one row of a column differs from a trail, and only one.

    Parameters
    ----------
    value : bytes
        Of the column in the trail.
    column : ndarray (n, ...)
        The column as it is here.

    Returns
    -------
    tuple of (int, ndarray) or None
        None where more than one row differs, rows have come or gone, or the sums do not tell.
    """
    words = words_of(column)
    n, k = words.shape
    if len(value) != 8 * (k + 2) or rows_in(value) != n:
        return None
    apart = np.frombuffer(value, np.uint64)[1:] - _sums(words)
    weights = (2 * np.arange(k, dtype=np.uint64) + np.uint64(1)) * np.uint64(_ODD)
    weighted = np.sum(weights * apart[:k], dtype=np.uint64)
    rows = np.flatnonzero((2 * np.arange(n, dtype=np.uint64) + np.uint64(1)) * weighted == apart[k])
    if len(rows) != 1 or not apart[:k].any():
        return None
    return int(rows[0]), words[rows[0]] + apart[:k]


def as_row(words, column):
    """One row of a column from its words."""
    size = column.dtype.itemsize
    return words.astype(f"u{size}").view(column.dtype).reshape(column.shape[1:])
