"""The state of a world as a hash and as a snapshot.

The state is the ids and columns of all agents, the plain entities, the id of the next birth,
and every resource or plain component that keeps this protocol:

    state() -> bytes            everything in it that may change while the world runs
    set_state(data: bytes)      restore it; later ticks must then give the same bits

A resource without the two counts as a constant of the level, or is recomputed in every tick.  A
resource that keeps constants in its state leaves them out of ``hashed_state() -> bytes``.  A
resource that a snapshot must restore, but that is not part of the state of the herd, sets
``hashed = False``: the queue of commands, which a replay fills differently.
"""

from __future__ import annotations

import hashlib
import json
import struct

import numpy as np
from flockbrush.engine import limits
from numba import njit

MAGIC = b"FBSTATE1"
_LENGTH = struct.Struct("<Q")
_LARGE = 1 << 14  # bytes; above, reducing them first is faster


class StateError(ValueError):
    """A snapshot that this world cannot load: damaged, or of another kind of world."""


def state_hash(world, marks=None):
    """16 hexadecimal digits that are the same for the same state.

    Parameters
    ----------
    marks : dict, optional
        Filled with a digest of each part of the state, by name.

    Returns
    -------
    str
        A hash of the next entity id, the agents' ids and columns in order of name, and the
        states of resources and plain components.  Optional columns that are not in use are left out.
    """
    digest = hashlib.blake2b(digest_size=8)
    for name, data in _parts(world, hashed=True):
        mark = _mark(data)
        digest.update(name.encode())
        digest.update(mark)
        if marks is not None:
            marks[name] = mark
    return digest.hexdigest()


def digest_of(arrays):
    """8 bytes for the values of some arrays."""
    digest = hashlib.blake2b(digest_size=8)
    for array in arrays:
        data = _bytes(array)
        digest.update(data if len(data) < _LARGE else _mark(data))
    return digest.digest()


def _mark(data):
    """The length of bytes, four words of them, and the rest behind the last whole word."""
    array = np.frombuffer(data, np.uint8)
    array.flags.writeable = False  # like those of bytes: one kernel for all
    whole = len(array) & ~7
    return _LENGTH.pack(len(array)) + _reduced(array[:whole].view(np.uint64)).tobytes() + array[whole:].tobytes()


@njit(cache=True, nogil=True)
def _reduced(words):
    """Reduce many words to four, faster than memory is read.

    Each step is one to one, so columns that differ in a single word give different words; BLAKE2b
    does the rest.  The hash need not resist attacks.
    """
    lanes = np.array([1, 2, 3, 4], np.uint64)
    a, b, c, d = lanes[0], lanes[1], lanes[2], lanes[3]
    end = len(words) & ~3
    for i in range(0, end, 4):
        a, b = _stir(a, words[i]), _stir(b, words[i + 1])
        c, d = _stir(c, words[i + 2]), _stir(d, words[i + 3])
    for i in range(end, len(words)):
        a = _stir(a, words[i])
    lanes[0], lanes[1], lanes[2], lanes[3] = a, b, c, d
    return lanes


@njit(cache=True, inline="always")
def _stir(lane, word):
    lane = (lane ^ word) * np.uint64(0x9E3779B97F4A7C15)
    return (lane << np.uint64(29)) | (lane >> np.uint64(35))


def snapshot(world):
    """The whole state of a world as bytes for `restore`.

    Taken between two ticks.  Animals marked for deletion are still in it; call ``flush`` first.
    """
    return b"".join(snapshot_parts(world))


def snapshot_parts(world):
    """The pieces of a `snapshot`, [bytes-like, ...]; columns are not copied, so use them before the next tick."""
    world.flush()
    parts = list(_parts(world, hashed=False))
    head = {
        "columns": {repr(f): [f.default.dtype.str, list(f.default.shape)] for f in _fields(world)},
        "parts": [[name, memoryview(data).nbytes] for name, data in parts],
    }
    encoded = json.dumps(head, separators=(",", ":")).encode()
    return [MAGIC, _LENGTH.pack(len(encoded)), encoded, *(data for _, data in parts)]


def pieces(data):
    """A snapshot cut into its parts, [bytes, ...]; joined, they are the snapshot.

    Two snapshots of one run have the same number of pieces, and most columns do not change: equal ones are kept once.
    """
    start = len(MAGIC) + _LENGTH.size
    at = start + _LENGTH.unpack(data[len(MAGIC) : start])[0]
    cut = [data[:at]]
    for _, size in json.loads(data[start:at])["parts"]:
        cut.append(data[at : at + size])
        at += size
    return cut


def restore(world, data):
    """Load a snapshot into a world of the same kind; later ticks give the same bits.

    Parameters
    ----------
    world : World
        Built from the same level as the one the snapshot is of.
    data : bytes
        From `snapshot`.

    Raises
    ------
    StateError
        When the bytes are not a snapshot or do not fit this world, which is then unchanged.
    """
    parts = parts_of(world, data)
    next_entity, plain = _plain_of(world, parts.pop("entities"))
    ids = np.frombuffer(parts.pop("ids"), np.int64)
    columns = {f: column_of(f, parts.pop(repr(f)), len(ids)) for f in _fields(world)}
    if len(ids) and ((np.diff(ids) <= 0).any() or ids[0] < 1 or ids[-1] >= next_entity):
        raise StateError("the snapshot is damaged: its agents are out of order")
    owners = dict(_owners(world))
    stray = sorted(set(parts) ^ {name for name, _ in _owners(world, plain)})
    if stray:
        raise StateError(f"the snapshot is of another world: {stray[0]} is only in one of them")
    before = {name: owners[name].state() for name in parts}
    try:
        for name, state in parts.items():
            owners[name].set_state(state)
    except Exception as error:
        for name, state in before.items():
            owners[name].set_state(state)
        raise StateError(f"the snapshot does not fit this world: {name}: {error}") from error
    world.become(ids, columns, plain, next_entity)


def _fields(world):
    """The columns of a world in order of name."""
    return world.agents.fields.values()


def _owners(world, plain=None):
    """(name, object) of everything with a state of its own, in a fixed order."""
    for resource in world.resources():
        if hasattr(resource, "state"):
            yield f"resource {type(resource).__name__}", resource
    for entity in world.plain_entities() if plain is None else sorted(plain):
        for kind, component in sorted(world.components_of(entity).items(), key=lambda item: item[0].__name__):
            if hasattr(component, "state"):
                yield f"entity {entity} {kind.__name__}", component


def _parts(world, hashed):
    """(name, bytes-like) of the whole state."""
    agents = world.agents
    kinds = {e: sorted(kind.__name__ for kind in world.components_of(e)) for e in world.plain_entities()}
    yield "entities", json.dumps([world.next_entity, list(kinds.items())], separators=(",", ":")).encode()
    yield "ids", _bytes(agents.ids)
    for name, field in agents.fields.items():
        if not (hashed and field.owner.optional and (agents[field] == field.default).all()):
            yield name, _bytes(agents[field])
    for name, owner in _owners(world):
        if not hashed or getattr(owner, "hashed", True):
            yield name, (getattr(owner, "hashed_state", owner.state) if hashed else owner.state)()


def _bytes(array):
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8)


def check_beginning(world, beginning, size):
    """Check, before all of it is in memory, that a snapshot belongs to a world like this.

    Parameters
    ----------
    beginning : bytes-like
        Its first bytes, with the table of contents.
    size : int
        How many bytes it has.

    Raises
    ------
    StateError
    """
    columns, sizes, end = _contents(beginning)
    expected = {repr(f): [f.default.dtype.str, list(f.default.shape)] for f in _fields(world)}
    if columns != expected:
        odd = sorted(name for name in {**columns, **expected} if columns.get(name) != expected.get(name))
        raise StateError(f"the snapshot is of another kind of world: column {odd[0]} differs")
    if min(sizes.values(), default=0) < 0 or end + sum(sizes.values()) != size:
        raise StateError("the snapshot is damaged: it is not as long as it says")
    if {"entities", "ids", *expected} - set(sizes) or sizes["ids"] % 8:
        raise StateError("the snapshot is damaged: something is missing in it")
    others = sum(sizes.values()) - sum(sizes[name] for name in ("ids", *expected))
    if sizes["ids"] > 8 * limits.ANIMALS or others > limits.SNAPSHOT_OTHERS_BYTES:
        raise StateError(f"the snapshot is damaged: it has more than {limits.ANIMALS.text}, or too much beside them")
    for field in _fields(world):
        if sizes[repr(field)] != sizes["ids"] // 8 * field.default.nbytes:
            raise StateError(f"the snapshot is damaged: column {field!r} has not one row for each agent")


def _contents(data):
    """(columns, {part: bytes}, offset of the parts) from the beginning of a snapshot."""
    data, start = memoryview(data), len(MAGIC) + _LENGTH.size
    if bytes(data[: len(MAGIC)]) != MAGIC or len(data) < start:
        raise StateError("this is no snapshot of a world")
    end = start + _LENGTH.unpack(data[len(MAGIC) : start])[0]
    try:
        head = json.loads(bytes(data[start:end]))
        return dict(head["columns"]), {str(name): int(size) for name, size in head["parts"]}, end
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        raise StateError("the snapshot is damaged: its table of contents cannot be read") from None


def parts_of(world, data):
    """{name: bytes-like} of a snapshot whose columns are this world's; StateError."""
    check_beginning(world, data, len(data))
    _, sizes, at = _contents(data)
    data, columns, parts = memoryview(data).toreadonly(), {repr(f) for f in _fields(world)}, {}
    for name, size in sizes.items():
        part = data[at : at + size]
        parts[name], at = part if name in columns else bytes(part), at + size
    return parts


def _plain_of(world, encoded):
    """(next entity id, plain entities), which must be among those of this world."""
    try:
        next_entity, pairs = json.loads(encoded)
        plain, next_entity = {int(entity): list(kinds) for entity, kinds in pairs}, int(next_entity)
    except (ValueError, TypeError, RecursionError):
        raise StateError("the snapshot is damaged: its entities cannot be read") from None
    existing = set(world.plain_entities())
    for entity, kinds in plain.items():
        if entity not in existing:
            raise StateError(
                f"the snapshot is of another world: entity {entity} ({', '.join(kinds)}) is not in this one"
            )
    return next_entity, set(plain)


def column_of(field, data, count):
    """The rows of a column from the bytes of a snapshot."""
    return np.frombuffer(data, field.default.dtype).reshape(count, *field.default.shape)
