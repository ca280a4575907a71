"""Recordings: what happened to a world, small enough to keep and enough to live it again.

A recording is a beginning and then records, each with a checksum, appended as the run goes on:

    beginning   8 bytes that name the format, its version, a checksum
    header      JSON: seed, dt, versions of packages, SHA-256 and size of every asset
    assets      the level and all files it needs, whole
    then        commands as applied, a state hash every few ticks, a snapshot now and then
    end         the last tick, when the run was closed in good order

Nothing in it is executed or unpickled.  A file that was cut off or damaged opens up to its last
whole record and says so; one whose header or assets are damaged does not open.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import struct
import tempfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path, PurePosixPath

from engine.clock import Clock
from engine.commands import Commands, from_record, to_json
from engine.state import StateError, restore, snapshot, state_hash

__all__ = [
    "Divergence", "RecordedRun", "Recorder", "Recording", "RecordingError", "StateError",
    "first_difference", "open_recording", "restore", "resume", "snapshot", "state_hash",
]  # fmt: skip

FORMAT = 1
MAGIC = b"\x89FBRUSH\n"
PACKAGES = ("esper", "numpy", "numba", "scipy")  # what may change the bits of a run

_BEGINNING = struct.Struct("<8sHHI")  # magic, version, reserved, checksum
_RECORD = struct.Struct("<cBHIIqI")  # kind, packed, reserved, stored bytes, unpacked bytes, tick, checksum
_HEADER, _ASSET, _COMMAND, _HASH, _KEYFRAME, _END = b"H", b"A", b"C", b"S", b"K", b"E"
_TEXT_LIMIT = 16 << 20  # bytes of a header or a command, unpacked
_ASSETS_LIMIT = 512 << 20  # bytes of all assets together, unpacked
_KEYFRAME_LIMIT = 2 << 30  # bytes of one snapshot, unpacked
_LIMITS = {_ASSET: _ASSETS_LIMIT, _KEYFRAME: _KEYFRAME_LIMIT}


class RecordingError(Exception):
    """A recording that cannot be written, read or lived again, in a sentence for whoever asked."""


class Recording:
    """A recording being written.  Make one with `create`; close it, or use it in a ``with``."""

    def __init__(self, path, file):
        self.path, self._file = Path(path), file
        self.last_tick = 0

    @classmethod
    def create(cls, path, header, assets):
        """Begin a recording.

        Parameters
        ----------
        path : path-like
            A file there is replaced, but only once the new beginning is whole.
        header : dict
            As JSON; must have ``seed`` and ``dt``.  Format and package versions are added.
        assets : dict of str to bytes
            Every file that the run needs, by path relative to the level.

        Returns
        -------
        Recording

        Raises
        ------
        RecordingError
            When the header or the assets cannot be kept, or the file cannot be written.
        """
        path = Path(path)
        head = _encoded_header(path, header, assets)
        try:
            handle, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        except OSError as error:
            raise _failed(path, "cannot be written", error) from None
        try:
            with open(handle, "wb") as file:
                file.write(_beginning(FORMAT))
                file.write(_record(_HEADER, 0, head))
                file.writelines(_record(_ASSET, 0, name.encode() + b"\0" + assets[name]) for name in sorted(assets))
                file.flush()
                os.fsync(file.fileno())
            os.chmod(temporary, 0o644)
            os.replace(temporary, path)
            return cls(path, open(path, "ab"))
        except OSError as error:
            Path(temporary).unlink(missing_ok=True)
            raise _failed(path, "cannot be written", error) from None

    def command(self, tick, cmd):
        """Keep a command that was applied at the start of this tick."""
        self._append(_COMMAND, tick, to_json(cmd).encode())

    def hash(self, tick, digest):
        """Keep a `state_hash` after this many ticks."""
        self._append(_HASH, tick, bytes.fromhex(digest))

    def keyframe(self, tick, state):
        """Keep a `snapshot` after this many ticks."""
        self._append(_KEYFRAME, tick, state)

    def put(self, packed):
        """Keep what `packed_keyframe` gave."""
        self._guarded(lambda: self._file.write(packed))

    def flush(self):
        """Hand everything to the operating system: a crash of this program cannot take it back."""
        self._guarded(self._file.flush)

    def close(self, tick=None):
        """End in good order, after this many ticks (the last one that was spoken of, if not given)."""
        if self._file.closed:
            return
        self._append(_END, self.last_tick if tick is None else tick, b"")
        self._guarded(self._file.flush)
        self._guarded(lambda: os.fsync(self._file.fileno()))
        self._guarded(self._file.close)

    def abandon(self):
        """Let go of the file without an end: it opens as one that was cut off."""
        self._guarded(self._file.close)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            self.close()
        else:
            self.abandon()

    def _append(self, kind, tick, data):
        self.last_tick = max(self.last_tick, int(tick))
        self._guarded(lambda: self._file.write(_record(kind, int(tick), data)))

    def _guarded(self, write):
        try:
            return write()
        except (OSError, ValueError) as error:
            raise _failed(self.path, "cannot be written any further", error) from None


class Recorder:
    """Writes a running world into a recording: call `take` after every tick.

    Parameters
    ----------
    recording : Recording
    world : World
        With `Clock` and `Commands`.
    hash_every : int
        Ticks between state hashes; 1 lets a replay name the very tick that differs.
    keyframe_every : int
        Ticks between snapshots; 0 for none.
    """

    def __init__(self, recording, world, hash_every=1, keyframe_every=0):
        self.recording, self.world = recording, world
        self.hash_every, self.keyframe_every = max(1, int(hash_every)), int(keyframe_every)
        clock = world.resource(Clock)
        self._told = len(world.resource(Commands).log)
        self._flushed = clock.now
        recording.hash(clock.tick, state_hash(world))  # a level that is built differently shows before the first tick

    def take(self):
        """Keep what is new since the last time; flushed at least once in a simulated second."""
        clock, log = self.world.resource(Clock), self.world.resource(Commands).log
        for tick, cmd in log[self._told :]:
            self.recording.command(tick, cmd)
        told, self._told = self._told, len(log)
        if clock.tick % self.hash_every == 0:
            self.recording.hash(clock.tick, state_hash(self.world))
        if self.keyframe_every and clock.tick % self.keyframe_every == 0:
            self.recording.keyframe(clock.tick, snapshot(self.world))
        if clock.now - self._flushed >= 1 or told != self._told:
            self.recording.flush()
            self._flushed = clock.now

    def close(self):
        """End the recording in good order, after a hash of the last state."""
        clock = self.world.resource(Clock)
        if clock.tick % self.hash_every:
            self.recording.hash(clock.tick, state_hash(self.world))
        self.recording.close(clock.tick)


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
        self.keyframes: Mapping[int, bytes] = _Keyframes(self.path)
        self.last_tick = 0
        self.truncated = True
        self.notice = ""
        self._commands: list[tuple[int, str]] = []

    @cached_property
    def commands(self):
        """[(tick, command)] as applied.

        The modules that define the commands must have been imported.

        Raises
        ------
        RecordingError
            When one is unknown or does not fit its definition.
        """
        found = []
        for tick, text in self._commands:
            try:
                name, values = json.loads(text)
                found.append((tick, from_record(name, dict(values))))
            except (ValueError, TypeError, RecursionError) as error:
                raise RecordingError(f"{self.path}: the command in tick {tick} cannot be applied: {error}") from None
        return found

    def keyframe_before(self, tick):
        """The last tick up to this one that has a snapshot, or None."""
        return max((t for t in self.keyframes if t <= tick), default=None)

    def differing_packages(self):
        """["numpy 2.1 (here 2.4)", ...]: versions that were others when this was recorded."""
        here, there = package_versions(), self.header.get("packages", {})
        return [
            f"{name} {there[name]} (here {here.get(name)})" for name in sorted(there) if there[name] != here.get(name)
        ]


def open_recording(path):
    """Open a recording.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    RecordedRun

    Raises
    ------
    RecordingError
        When it is missing, no recording, of a newer format, or damaged in its header or assets.
    """
    run = RecordedRun(path)
    try:
        with open(path, "rb") as file:
            _check_beginning(run.path, file.read(_BEGINNING.size))
            _read_all(run, file, os.fstat(file.fileno()).st_size)
    except IsADirectoryError:
        raise RecordingError(f"{path}: this is a folder, not a recording") from None
    except FileNotFoundError:
        raise RecordingError(f"{path}: there is no such file") from None
    except OSError as error:
        if os.path.isdir(path):  # Windows says "permission denied"
            raise RecordingError(f"{path}: this is a folder, not a recording") from None
        raise _failed(path, "cannot be read", error) from None
    return run


@dataclass(frozen=True)
class Divergence:
    """Where a replay leaves the recording."""

    tick: int  # the first hash that differs is after this many ticks
    same_until: int  # the last hash that was the same
    recorded: str
    replayed: str

    def __str__(self):
        if self.tick == 0:
            return f"the replay differs before its first tick: recorded {self.recorded}, replayed {self.replayed}"
        exact = self.tick == self.same_until + 1
        where = f"in tick {self.tick}" if exact else f"between ticks {self.same_until} and {self.tick}"
        return f"the replay differs {where}: recorded {self.recorded}, replayed {self.replayed}"


def resume(run, world, tick=None):
    """Give a world the commands of a recording, and its last snapshot up to a tick.

    Parameters
    ----------
    run : RecordedRun
    world : World
        Built from the recording's assets and seed, no tick run yet.
    tick : int, optional
        Where one wants to go: the nearest snapshot before is restored.  None: from the start.

    Raises
    ------
    RecordingError
        When the snapshot does not fit the world.
    """
    start = None if tick is None else run.keyframe_before(tick)
    if start is not None:
        try:
            restore(world, run.keyframes[start])
        except StateError as error:
            raise RecordingError(f"{run.path}: the snapshot of tick {start}: {error}") from None
    now, queue = world.resource(Clock).tick, world.resource(Commands)
    known = max([run.last_tick - 1, *(when for when, _ in run.commands)])  # what came later, the level's script knows
    later = [(when, cmd) for when, cmd in queue.pending if when > known]
    queue.replace([(when, cmd) for when, cmd in run.commands if when >= now] + later)


def first_difference(run, world, step, to_tick=None, progress=None):
    """Live a recording again and compare.

    Parameters
    ----------
    run : RecordedRun
    world : World
        After `resume`.
    step : callable
        Runs one tick of this world.
    to_tick : int, optional
        Where to stop; None: at the recording's end.
    progress : callable, optional
        Told the tick after each.

    Returns
    -------
    Divergence or None
        None when every hash on the way is the same.
    """
    clock = world.resource(Clock)
    same = clock.tick
    end = run.last_tick if to_tick is None else min(to_tick, run.last_tick)
    while True:
        recorded = run.hashes.get(clock.tick)
        if recorded is not None:
            replayed = state_hash(world)
            if replayed != recorded:
                return Divergence(clock.tick, min(same, clock.tick - 1), recorded, replayed)
            same = clock.tick
        if clock.tick >= end:
            return None
        step()
        if progress is not None:
            progress(clock.tick)


def package_versions():
    """{name: version} of Python and of the packages that may change the bits of a run."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


# writing --------------------------------------------------------------------


def _encoded_header(path, header, assets):
    missing = [name for name in ("seed", "dt") if name not in header]
    if missing:
        raise RecordingError(f"{path}: the header of a recording needs {' and '.join(missing)}")
    for name in assets:
        if not _is_plain(name):
            raise RecordingError(f"{path}: {name!r} is no path relative to the level")
    if sum(map(len, assets.values())) > _ASSETS_LIMIT:
        raise RecordingError(f"{path}: the level's files are more than {_ASSETS_LIMIT >> 20} MiB")
    table = {name: {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)} for name, data in assets.items()}
    whole = {**header, "format": FORMAT, "packages": package_versions(), "assets": table}
    try:
        return json.dumps(whole, allow_nan=False, sort_keys=True).encode()
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{path}: the header cannot be written as JSON: {error}") from None


def _is_plain(name):
    """A path that stays below the folder it is put into, on every system."""
    if not isinstance(name, str) or not name or "\0" in name or "\\" in name or ":" in name:
        return False
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts


def _beginning(version):
    start = _BEGINNING.pack(MAGIC, version, 0, 0)[:-4]
    return start + struct.pack("<I", zlib.crc32(start))


def packed_keyframe(tick, state):
    """A `snapshot` as `Recording.put` takes it: the slow part of `Recording.keyframe`, which a thread may do."""
    return _record(_KEYFRAME, int(tick), state)


def _record(kind, tick, data):
    """One record, packed when that makes it smaller."""
    data = bytes(data)
    if len(data) > _LIMITS.get(kind, _TEXT_LIMIT):
        raise RecordingError(f"a record of {len(data)} bytes is too large for a recording")
    stored = zlib.compress(data, 1) if len(data) > 64 else data
    packed = len(stored) < len(data)
    if not packed:
        stored = data
    head = _RECORD.pack(kind, packed, 0, len(stored), len(data), tick, 0)[:-4]
    return head + struct.pack("<I", zlib.crc32(stored, zlib.crc32(head))) + stored


def _failed(path, what, error):
    return RecordingError(f"{path}: {what}: {getattr(error, 'strerror', None) or error}")


# reading --------------------------------------------------------------------


def _check_beginning(path, start):
    if not start:
        raise RecordingError(f"{path}: the file is empty")
    if start[: len(MAGIC)] != MAGIC[: len(start)]:
        raise RecordingError(f"{path}: this is not a recording of flockbrush")
    if len(start) < _BEGINNING.size:
        raise RecordingError(f"{path}: the recording was cut off in its header")
    _, version, _, checksum = _BEGINNING.unpack(start)
    if zlib.crc32(start[:-4]) != checksum:
        raise RecordingError(f"{path}: the recording's header is damaged")
    if version > FORMAT:
        raise RecordingError(
            f"{path}: recorded in format {version} by a newer flockbrush; this one reads up to {FORMAT}"
        )


def _read_all(run, file, size):
    """Fill a run from a file that stands behind its beginning."""
    for kind, tick, data, at in _records(run, file, size):
        if not run.header:
            _take_header(run, kind, data)
        elif kind == _ASSET:
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
    """(kind, tick, data, position) of the whole records; the data of a keyframe is left where it is."""
    at = file.tell()
    while size - at >= _RECORD.size:
        head = file.read(_RECORD.size)
        kind, packed, _, stored, unpacked, tick, checksum = _RECORD.unpack(head)
        limit = _LIMITS.get(kind, _TEXT_LIMIT)
        if stored > size - at - _RECORD.size or unpacked > limit or tick < 0:
            break
        data = file.read(stored)
        if zlib.crc32(data, zlib.crc32(head[:-4])) != checksum:
            break
        if kind != _KEYFRAME:
            data = _unpacked(data, packed, unpacked)
            if data is None:
                break
        yield kind, tick, data, at
        at = file.tell()
    file.seek(at)


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
        header = json.loads(data) if kind == _HEADER else None
        sizes = [int(entry["bytes"]) for entry in header["assets"].values()]
        fine = all(map(_is_plain, header["assets"])) and isinstance(header["seed"], int) and 0 < header["dt"] < 1e9
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        fine, sizes = False, []
    if not fine:
        raise RecordingError(f"{run.path}: the recording's header is damaged")
    if min(sizes, default=0) < 0 or sum(sizes) > _ASSETS_LIMIT:
        raise RecordingError(f"{run.path}: the recording claims files of more than {_ASSETS_LIMIT >> 20} MiB")
    run.header = header


def _take_asset(run, data):
    name, _, content = data.partition(b"\0")
    name = name.decode(errors="replace")
    promised = run.header["assets"].get(name, {}).get("sha256")
    if hashlib.sha256(content).hexdigest() != promised:
        raise RecordingError(f"{run.path}: its copy of {name} is not the file that the header promises")
    run.assets[name] = content


def _take(run, kind, tick, data, at):
    """Put one record into a run; kinds that a later version may add are passed over."""
    if kind == _COMMAND:
        run._commands.append((tick, data.decode(errors="replace")))
    elif kind == _HASH:
        run.hashes[tick] = data.hex()
    elif kind == _KEYFRAME:
        run.keyframes.places[tick] = at
    elif kind == _END:
        run.truncated = False
    run.last_tick = max(run.last_tick, tick)


def _note_damage(run, file, size):
    lost = size - file.tell() if run.truncated else 0
    if lost:
        run.notice = f"{run.path}: cut off or damaged after tick {run.last_tick}; the last {lost} bytes are left out"
    elif run.truncated:
        run.notice = f"{run.path}: the run was not closed; it is known up to tick {run.last_tick}"


class _Keyframes(Mapping):
    """Snapshots by tick, in the file until asked for."""

    def __init__(self, path):
        self.path, self.places = path, {}

    def __getitem__(self, tick):
        at = self.places[tick]
        try:
            with open(self.path, "rb") as file:
                file.seek(at)
                head = file.read(_RECORD.size)
                _, packed, _, stored, unpacked, _, checksum = _RECORD.unpack(head)
                data = file.read(stored)
        except (OSError, struct.error) as error:
            raise _failed(self.path, f"the snapshot of tick {tick} cannot be read", error) from None
        whole = zlib.crc32(data, zlib.crc32(head[:-4])) == checksum
        state = _unpacked(data, packed, unpacked) if whole else None
        if state is None:
            raise RecordingError(f"{self.path}: the snapshot of tick {tick} is damaged")
        return state

    def __iter__(self):
        return iter(self.places)

    def __len__(self):
        return len(self.places)
