"""Reading recordings: whole, cut off or damaged.

Nothing in a file is executed or unpickled.  One that was cut off or damaged opens up to its last whole record and says
so; one whose header or assets are damaged does not open.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
import zlib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

from flockbrush.engine import limits
from flockbrush.engine.arguments import checked
from flockbrush.engine.commands import from_json
from flockbrush.engine.recording_format import (
    ASSET,
    BEGINNING,
    COMMAND,
    END,
    FORMAT,
    HASH,
    HEADER,
    KEYFRAME,
    LIMITS,
    MAGIC,
    RECORD,
    TRAIL,
    CommandRoom,
    RecordingError,
    failed,
)
from flockbrush.engine.recording_header import header_error
from flockbrush.engine.trail import TrailError, state_at

LITTLE = 1 << 10  # bytes that packing may add to what cannot be packed
PIECE = 1 << 20  # bytes of a snapshot that are unpacked at a time


class RecordedRun:
    """A recording that was opened.

    Attributes
    ----------
    path : Path
    header : dict
        ``seed``, ``dt``, ``format``, ``packages``, ``assets`` and whatever the writer added.
    assets : dict of str to bytes
        The files embedded, each as its SHA-256 promises.
    hashes : dict of int to str
        State hash after so many ticks.
    keyframes : mapping of int to bytes
        Snapshot after so many ticks, read from the file when asked for.
    last_tick : int
        How many ticks are known to have passed.
    truncated : bool
        The run was not closed in good order: it crashed, was killed, goes on, or the file is damaged.
    notice : str
        What is wrong, in a sentence; "" when all is well.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.header: dict = {}
        self.assets: dict[str, bytes] = {}
        self.hashes: dict[int, str] = {}
        self.keyframes: Mapping[int, bytes] = _Kept(self.path, "snapshot")
        self._trail = _Kept(self.path, "sums")
        self.last_tick = 0
        self.truncated = True
        self.notice = ""
        self._commands: list[tuple[int, bytes]] = []
        self._room = CommandRoom(self.path)

    def __repr__(self):
        level, dt, seed = (self.header.get(name) for name in ("level", "dt", "seed"))
        cut = ", truncated" if self.truncated else ""
        return (
            f"<RecordedRun {self.path}: {level}, {self.last_tick} ticks ({self.last_tick * (dt or 0):g} s), "
            f"seed {seed}, {len(self._commands)} commands{cut}>"
        )

    @cached_property
    def commands(self):
        """[(tick, command)] as applied.

        The modules that define the commands must have been imported.

        Raises
        ------
        RecordingError
            When one is unknown or does not fit its definition.
        """
        for tick, text in self._commands:  # look at all first: one that is wrong ends it before the rest is held
            self._command(tick, text)
        return [(tick, self._command(tick, text)) for tick, text in self._commands]

    def _command(self, tick, text):
        try:
            return from_json(text)
        except ValueError as error:
            raise RecordingError(f"{self.path}: the command in tick {tick} cannot be applied: {error}") from None

    def sums(self, tick):
        """{name: value} of the state after this many ticks (see `flockbrush.engine.trail`); {} where none were kept.

        Raises
        ------
        RecordingError
            When they are damaged.
        """
        if tick not in self._trail:
            return {}
        try:
            return state_at(self._trail[t] for t in sorted(self._trail) if t <= tick)
        except TrailError as error:
            raise RecordingError(f"{self.path}: {error}") from None

    def keyframe_before(self, tick):
        """The last tick up to this one that has a snapshot, or None."""
        return max((t for t in self.keyframes if t <= tick), default=None)


@checked()
def open_recording(path: str | os.PathLike) -> RecordedRun:
    """Open a recording.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    RecordingError
        When it is missing, no recording, of a newer format, or damaged in its header or assets.
    """
    run = RecordedRun(path)
    try:
        with open(path, "rb") as file:
            _check_beginning(run.path, file.read(BEGINNING.size))
            _read_all(run, file, os.fstat(file.fileno()).st_size)
    except IsADirectoryError:
        raise RecordingError(f"{path}: this is a folder, not a recording") from None
    except FileNotFoundError:
        raise RecordingError(f"{path}: there is no such file") from None
    except OSError as error:
        if os.path.isdir(path):  # Windows says "permission denied"
            raise RecordingError(f"{path}: this is a folder, not a recording") from None
        raise failed(path, "cannot be read", error) from None
    return run


def _check_beginning(path, start):
    if not start:
        raise RecordingError(f"{path}: the file is empty")
    if start[: len(MAGIC)] != MAGIC[: len(start)]:
        raise RecordingError(f"{path}: this is not a recording of flockbrush")
    if len(start) < BEGINNING.size:
        raise RecordingError(f"{path}: the recording was cut off in its header")
    _, version, _, checksum = BEGINNING.unpack(start)
    if zlib.crc32(start[:-4]) != checksum:
        raise RecordingError(f"{path}: the recording's header is damaged")
    if version > FORMAT:
        raise RecordingError(
            f"{path}: recorded in format {version} by a newer Flockbrush; this version reads formats up to {FORMAT}"
        )


def _read_all(run, file, size):
    """Fill a run from a file that stands behind its beginning."""
    for kind, tick, data, at in _records(run, file, size):
        if not run.header:
            _take_header(run, kind, data)
        elif kind == ASSET:
            _take_asset(run, data)
        elif len(run.assets) < len(run.header["assets"]):
            break
        else:
            _take(run, kind, tick, data, at)
        if not run.truncated:
            break
    if not run.header:
        raise RecordingError(f"{run.path}: the recording's header is damaged or was cut off")
    missing = sorted(set(run.header["assets"]) - set(run.assets))
    if missing:
        raise RecordingError(f"{run.path}: the recording is damaged or was cut off in its copy of {missing[0]}")
    _note_damage(run, file, size)


def _records(run, file, size):
    """(kind, tick, data, position) of the whole records; snapshots and sums are left where they are."""
    at = file.tell()
    while size - at >= RECORD.size:
        head = file.read(RECORD.size)
        kind, packed, _, stored, unpacked, tick, checksum = RECORD.unpack(head)
        limit = LIMITS.get(kind, limits.RECORDING_TEXT_BYTES)
        if stored > min(size - at - RECORD.size, unpacked + LITTLE) or unpacked > limit or tick < 0:
            break
        checked = zlib.crc32(head[:-4])
        if kind == KEYFRAME:
            data = b""
            for piece in _stored_pieces(file, stored):
                checked = zlib.crc32(piece, checked)
        else:
            data = file.read(stored)
            checked = zlib.crc32(data, checked)
        data = _unpacked(data, packed, unpacked) if kind not in (KEYFRAME, TRAIL) else data
        if checked != checksum or data is None:
            break
        yield kind, tick, data, at
        at = file.tell()
    file.seek(at)


def _stored_pieces(file, size):
    """The next bytes of a file, some at a time."""
    while size > 0:
        piece = file.read(min(size, PIECE))
        if not piece:
            return
        size -= len(piece)
        yield piece


def _unpacked(data, packed, size):
    """The data of a record as long as it says it is, or None: a bomb is not let off."""
    if not packed:
        return data if len(data) == size else None
    inflate = zlib.decompressobj()
    try:
        out = inflate.decompress(data, size + 1)
    except zlib.error:
        return None
    return out if len(out) == size else None


def _take_header(run, kind, data):
    try:
        header = json.loads(data) if kind == HEADER else None
        mistake = header_error(header)
    except (ValueError, RecursionError):
        mistake = "it is not JSON"
    if mistake:
        raise RecordingError(f"{run.path}: the recording's header is damaged: {mistake}")
    run.header = header


def _take_asset(run, data):
    name, _, content = data.partition(b"\0")
    name = name.decode(errors="replace")
    promised = run.header["assets"].get(name, {}).get("sha256")
    if hashlib.sha256(content).hexdigest() != promised:
        raise RecordingError(f"{run.path}: the embedded copy of {name} does not match its hash in the header")
    run.assets[name] = content


def _take(run, kind, tick, data, at):
    """Put one record into a run; kinds that a later version may add are passed over."""
    if tick > min(run.last_tick + limits.SILENT_TICKS, limits.TICKS):
        raise RecordingError(
            f"{run.path}: a record of tick {tick:,} follows a record of tick {run.last_tick:,}; in a recording"
            f" two records are at most {limits.SILENT_TICKS:,} ticks apart"
        )
    if kind == COMMAND:
        run._room.take(data)
        run._commands.append((tick, data))
    elif kind == HASH:
        run.hashes[tick] = data.hex()
    elif kind == KEYFRAME:
        run.keyframes.places[tick] = at
    elif kind == TRAIL:
        run._trail.places[tick] = at
    elif kind == END:
        run.truncated = False
    run.last_tick = max(run.last_tick, tick)


def _note_damage(run, file, size):
    lost = size - file.tell() if run.truncated else 0
    if lost:
        run.notice = f"{run.path}: cut off or damaged after tick {run.last_tick}; the last {lost} bytes are ignored"
    elif run.truncated:
        run.notice = f"{run.path}: the recording was not closed; it ends at tick {run.last_tick}"


class _Kept(Mapping):
    """Records of one kind by tick, in the file until asked for."""

    def __init__(self, path, what):
        self.path, self.what, self.places = path, what, {}

    def __getitem__(self, tick):
        return self.read(tick)

    def read(self, tick, check=lambda beginning, size: None):
        """One snapshot; ``check(beginning, size)`` may refuse it by its beginning, before the rest is unpacked."""
        try:
            with open(self.path, "rb") as file:
                file.seek(self.places[tick])
                state = _snapshot_at(file, check)
        except (OSError, struct.error) as error:
            raise failed(self.path, f"the {self.what} of tick {tick} cannot be read", error) from None
        if state is None:
            raise RecordingError(f"{self.path}: the {self.what} of tick {tick} cannot be read: it is damaged")
        return state

    def __iter__(self):
        return iter(self.places)

    def __len__(self):
        return len(self.places)


def _snapshot_at(file, check):
    """The snapshot in the record that begins here, unpacked piece by piece; None when it is damaged."""
    head = file.read(RECORD.size)
    _, packed, _, stored, size, _, checksum = RECORD.unpack(head)
    inflate = zlib.decompressobj()
    state, at, checked = bytearray(size), 0, zlib.crc32(head[:-4])
    for piece in _stored_pieces(file, stored):
        checked = zlib.crc32(piece, checked)
        while piece:
            try:
                part = inflate.decompress(piece, PIECE) if packed else piece
            except zlib.error:
                return None
            if at + len(part) > size:
                return None
            state[at : at + len(part)] = part
            if at == 0 and part:
                check(memoryview(state)[: len(part)].toreadonly(), size)
            at, piece = at + len(part), inflate.unconsumed_tail if packed else b""
    return state if at == size and checked == checksum else None
