"""Two states of one world side by side: which parts differ, in whom, and by how much."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
from flockbrush.engine.state import StateError, column_of, parts_of

SHOWN = 10  # animals of which values are kept
EXCERPT = 60  # bytes shown of a part that is no column


@dataclass(frozen=True)
class Difference:
    """One part of the state that is not the same in two states of a world."""

    part: str  # "Position.xyz", "resource Landscape", "ids" for animals that live in one state only
    count: int | None  # animals; None for what is no column
    ids: list  # of some of these animals, the largest difference first
    one: list  # their values in the first state
    other: list  # and in the second
    largest: float | None  # largest difference of two numbers; None where there are no numbers


def compare(world, one, other):
    """What differs between two snapshots, of what a state hash is made of.

    Parameters
    ----------
    world : World
        A world of the kind the snapshots are of; it is not changed.
    one, other : bytes
        From `flockbrush.engine.state.snapshot`.

    Returns
    -------
    list of Difference
        Columns by name, then the rest.

    Raises
    ------
    StateError
        When one of them is no snapshot of such a world.
    """
    first, second = parts_of(world, one), parts_of(world, other)
    ids = _ids(first.pop("ids")), _ids(second.pop("ids"))
    differences = list(_who_lives(*ids))
    common = np.intersect1d(*ids)
    rows = [np.searchsorted(who, common) for who in ids]
    for name, field in world.agents.fields.items():
        pair = [column_of(field, part.pop(name), len(who)) for part, who in ((first, ids[0]), (second, ids[1]))]
        differences += _in_column(name, common, pair[0][rows[0]], pair[1][rows[1]])
    aside = {f"resource {type(r).__name__}" for r in world.resources() if not getattr(r, "hashed", True)}
    for name in sorted({*first, *second} - aside):
        if first.get(name) != second.get(name):
            differences.append(Difference(name, None, [], *_excerpts(first.get(name), second.get(name)), None))
    return differences


def _ids(data):
    if len(data) % 8:
        raise StateError("the snapshot is damaged: its agents cannot be read")
    return np.frombuffer(data, np.int64)


def _who_lives(one, other):
    """Animals that live in one state only."""
    lonely = np.setxor1d(one, other)
    if len(lonely):
        some = lonely[:SHOWN].tolist()
        lives = [["lives" if who in set(ids.tolist()) else "not alive" for who in some] for ids in (one, other)]
        yield Difference("ids", len(lonely), some, *lives, None)


def _in_column(name, ids, one, other):
    """The difference of two columns with the same animals, bit for bit."""
    n = len(ids)
    apart = (_bits(one) != _bits(other)).any(axis=1) if n else np.zeros(0, bool)
    if apart.any():
        sizes = _sizes(one[apart].reshape(apart.sum(), -1), other[apart].reshape(apart.sum(), -1))
        order = np.argsort(-sizes, kind="stable")[:SHOWN]
        some = np.flatnonzero(apart)[order]
        values = one[some].tolist(), other[some].tolist()
        yield Difference(name, int(apart.sum()), ids[some].tolist(), *values, float(sizes.max()))


def _bits(column):
    flat = np.ascontiguousarray(column).reshape(len(column), -1)
    return flat.view(f"u{flat.dtype.itemsize}")


def _sizes(one, other):
    """(n,) the largest difference of the numbers of each row; infinite where one of them is not finite."""
    with np.errstate(invalid="ignore", over="ignore"):
        sizes = np.abs(one.astype(float) - other.astype(float)).max(axis=1)
    return np.where(np.isnan(sizes), np.inf, sizes)


def _excerpts(one, other):
    """What stands where two texts begin to differ."""
    first, second = one or b"", other or b""
    same = min(len(first), len(second))
    pair = np.frombuffer(first[:same], np.uint8) != np.frombuffer(second[:same], np.uint8)
    at = max(0, (int(pair.argmax()) if pair.any() else same) - EXCERPT // 3)
    return [_text(first[at : at + EXCERPT])], [_text(second[at : at + EXCERPT])]


def _text(data):
    text = data.decode("utf-8", "backslashreplace")
    return text if text.isprintable() else json.dumps(text)
