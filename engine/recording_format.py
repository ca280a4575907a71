"""How a recording is laid out in its file.

    beginning   8 bytes that name the format, its version, a checksum
    header      JSON: seed, dt, what made it, SHA-256 and size of every asset
    assets      the level and all files it needs, whole
    then        commands as applied, a state hash and sums of the state every few ticks, a snapshot now and then
    end         the last tick, when the run was closed in good order

Everything behind the beginning is a record: a head with its checksum, and data, packed where that makes it smaller.
"""

from __future__ import annotations

import struct
import zlib

from flockbrush.engine import limits
from flockbrush.engine.files import NotWritten

FORMAT = 1
MAGIC = b"\x89FBRUSH\n"

BEGINNING = struct.Struct("<8sHHI")  # magic, version, reserved, checksum
RECORD = struct.Struct("<cBHIIqI")  # kind, packed, reserved, stored bytes, unpacked bytes, tick, checksum
HEADER, ASSET, COMMAND, HASH, TRAIL, KEYFRAME, END = b"H", b"A", b"C", b"S", b"T", b"K", b"E"
HASH_BYTES = 8
_LITTLE = 64  # bytes that are kept as they are
_SOME = 1 << 20  # bytes of a part from which its packed size is estimated
LIMITS = {
    ASSET: limits.RECORDING_ASSETS_BYTES + 2000, KEYFRAME: limits.SNAPSHOT_BYTES, HASH: HASH_BYTES,
    TRAIL: limits.RECORDING_SUMS_BYTES,
}  # fmt: skip


class RecordingError(Exception):
    """A recording cannot be written, read or replayed; ``str()`` says why."""


def file_header(version):
    """What a file begins with."""
    start = BEGINNING.pack(MAGIC, version, 0, 0)[:-4]
    return start + struct.pack("<I", zlib.crc32(start))


def record(kind, tick, data):
    """One record, packed when that makes it smaller."""
    return record_of(kind, tick, [data])


def record_of(kind, tick, parts):
    """The same record of data in parts (bytes-like), packed part by part: the data are never in memory twice."""
    size, stored = _bytes_of(parts), parts
    if size > LIMITS.get(kind, limits.RECORDING_TEXT_BYTES):
        raise RecordingError(f"a record of {size} bytes is too large for a recording")
    if size > _LITTLE:
        deflate = zlib.compressobj(1)
        stored = [*map(deflate.compress, parts), deflate.flush()]
    packed = _bytes_of(stored) < size
    if not packed:
        stored = parts
    head = RECORD.pack(kind, packed, 0, _bytes_of(stored), size, tick, 0)[:-4]
    checksum = zlib.crc32(head)
    for part in stored:
        checksum = zlib.crc32(part, checksum)
    return b"".join([head, struct.pack("<I", checksum), *stored])


def _bytes_of(parts):
    return sum(memoryview(part).nbytes for part in parts)


def packed_size(parts):
    """About how many bytes `record_of` makes of these parts; of long ones only the beginning is packed."""
    size = 0.0
    for part in map(memoryview, parts):
        some = part.cast("B")[:_SOME] if part.nbytes else part
        size += len(zlib.compress(some, 1)) * part.nbytes / max(len(some), 1)
    return round(size)


class CommandRoom:
    """How much the commands of a recording may still hold: they are in memory together when it is lived again."""

    def __init__(self, path):
        self.path, self._bytes, self._values = path, 0, 0

    def refusal(self, text: bytes, share=1.0):
        """Why one more command, as JSON, does not fit into this share of the room; "" where it does."""
        if len(text) > limits.RECORDING_TEXT_BYTES:
            return f"one of its commands is more than {limits.RECORDING_TEXT_BYTES.text}"
        kept = f" ({1 - share:.1%} of that is kept free for taking commands back)" if share < 1 else ""
        if self._bytes + len(text) > share * limits.RECORDING_COMMANDS_BYTES:
            return f"its commands are more than {limits.RECORDING_COMMANDS_BYTES.text}{kept}"
        if self._values + _values_in(text) > share * limits.RECORDING_VALUES:
            return f"its commands hold more than {limits.RECORDING_VALUES.text}{kept}"
        return ""

    def take(self, text: bytes):
        """Count one command, as JSON; RecordingError when it is one too many."""
        if refusal := self.refusal(text):
            raise RecordingError(f"{self.path}: {refusal}")
        self._bytes += len(text)
        self._values += _values_in(text)


def _values_in(text):
    return 1 + text.count(b",") + text.count(b"[") + text.count(b"{")


def failed(path, what, error):
    """The error for what the system does not allow."""
    if isinstance(error, NotWritten):
        return RecordingError(str(error))
    return RecordingError(f"{path}: {what}: {getattr(error, 'strerror', None) or error}")
