"""Writing and replaying recordings: the seed, the commands, hashes and snapshots of a run.

A recording is a beginning and then records, each with a checksum, appended as the run goes on
(`flockbrush.engine.recording_format`); `flockbrush.engine.recording_reader` opens it.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from flockbrush.engine import limits
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands, to_json
from flockbrush.engine.files import hold, make_backup
from flockbrush.engine.fingerprint import package_versions
from flockbrush.engine.keyframe_spacing import KeyframeSpacing
from flockbrush.engine.recording_format import (
    ASSET,
    COMMAND,
    END,
    FORMAT,
    HASH,
    HEADER,
    KEYFRAME,
    TRAIL,
    CommandRoom,
    RecordingError,
    failed,
    file_header,
    record,
    record_of,
)
from flockbrush.engine.recording_header import is_plain
from flockbrush.engine.recording_reader import RecordedRun, open_recording
from flockbrush.engine.state import StateError, check_beginning, restore, snapshot, snapshot_parts, state_hash
from flockbrush.engine.trail import Trail

__all__ = [
    "Divergence", "RecordedRun", "Recorder", "Recording", "RecordingError", "StateError",
    "first_difference", "open_recording", "restore", "resume", "snapshot", "state_hash",
]  # fmt: skip

ROOM = 7 / 8  # of the room for commands, for those asked for: the rest is for taking them back where one fails
MANY = 20_000  # animals; from there on a snapshot takes so long that there is none at both ends of a recording


class Recording:
    """A recording being written.  Make one with `create`; close it, or use it in a ``with``."""

    def __init__(self, path, file, work, earlier=None):
        self.path, self._file, self._work = Path(path), file, work
        self.earlier = earlier  # where the file is kept that had this name, or None
        self.last_tick, self._room = 0, CommandRoom(path)

    def __repr__(self):
        return f"<Recording {self.path}: {self.last_tick} ticks written>"

    @classmethod
    def create(cls, path, header, assets):
        """Begin a recording.

        Parameters
        ----------
        path : path-like
            A file there is kept as ``NAME.bak``.
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
            When the header or the assets cannot be kept, the file cannot be written, or somebody else is writing it.
        """
        path = Path(path)
        head = _encoded_header(path, header, assets)
        work = None
        try:
            work = hold(path)
            with open(work.new, "wb") as file:
                file.write(file_header(FORMAT))
                file.write(record(HEADER, 0, head))
                file.writelines(record(ASSET, 0, name.encode() + b"\0" + assets[name]) for name in sorted(assets))
            earlier = make_backup(path)
            work.publish()
            return cls(path, open(path, "ab"), work, earlier)
        except OSError as error:
            if work is not None:
                work.close()
            raise failed(path, "cannot be written", error) from None

    def command(self, tick, cmd):
        """Keep a command that was applied at the start of this tick."""
        text = to_json(cmd).encode()
        self._room.take(text)
        self._append(COMMAND, tick, text)

    def hash(self, tick, digest):
        """Keep a `state_hash` after this many ticks."""
        self._append(HASH, tick, bytes.fromhex(digest))

    def trail(self, tick, sums):
        """Keep a record of a `flockbrush.engine.trail.Trail` after this many ticks."""
        self._append(TRAIL, tick, sums)

    def note(self, tick):
        """The recording now speaks of this tick."""
        self.last_tick = max(self.last_tick, int(tick))

    def put(self, packed):
        """Keep a record that `flockbrush.engine.recording_format` has packed."""
        self._guarded(lambda: self._file.write(packed))

    def flush(self):
        """Hand everything to the operating system: a crash of this program cannot take it back."""
        self._guarded(self._file.flush)

    def close(self, tick=None):
        """End in good order, after this many ticks (the last one that was spoken of, if not given)."""
        if self._file.closed:
            return
        try:
            self._append(END, self.last_tick if tick is None else tick, b"")
            self._guarded(self._file.flush)
            self._guarded(lambda: os.fsync(self._file.fileno()))
            self._guarded(self._file.close)
        finally:
            self._work.close()

    def abandon(self):
        """Let go of the file without an end: it opens as one that was cut off."""
        try:
            self._guarded(self._file.close)
        finally:
            self._work.close()

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            self.close()
        else:
            self.abandon()

    def _append(self, kind, tick, data):
        self.note(tick)
        self._guarded(lambda: self._file.write(record(kind, int(tick), data)))

    def _guarded(self, write):
        try:
            return write()
        except (OSError, ValueError) as error:
            raise failed(self.path, "cannot be written any further", error) from None


class Recorder:
    """Writes a running world into a recording: call `take` after every tick.

    Until it is closed, the world refuses commands for which the recording has no room.

    Parameters
    ----------
    world : World
        With `Clock` and `Commands`.
    hash_every : int
        Ticks between state hashes, at most `limits.SILENT_TICKS`; 1 lets a replay name the very tick that differs.
    keyframes : int or KeyframeSpacing
        Ticks between snapshots, or what says which ticks have one; 0 for none.
    """

    def __init__(self, recording, world, hash_every=1, keyframes=0):
        self.recording, self.world = recording, world
        self.hash_every = min(max(1, int(hash_every)), limits.SILENT_TICKS)
        self.keyframes = keyframes if isinstance(keyframes, KeyframeSpacing) else KeyframeSpacing(int(keyframes))
        clock = world.resource(Clock)
        self._written = self._counted = len(world.resource(Commands).log)
        self._room = CommandRoom(recording.path)  # of commands as they are applied, before they are written
        world.resource(Commands).refusal = self._refusal
        self._flushed, self._first, self._kept, self._taken = clock.now, clock.tick, -1, clock.tick
        self._trail = Trail()
        self._keep_hash(clock.tick)  # a level that is built differently shows before the first tick
        self._keep_ends(clock.tick)

    def take(self):
        """Keep what is new since the last time; flushed at least once in a simulated second."""
        clock, log = self.world.resource(Clock), self.world.resource(Commands).log
        for tick, cmd in log[self._written :]:
            self.recording.command(tick, cmd)
        before, self._written, self._taken = self._written, len(log), clock.tick
        if clock.tick % self.hash_every == 0:
            self._keep_hash(clock.tick)
        if self.keyframes.passed(len(self.world.agents)):
            self._keep_state(clock.tick)
        elif clock.tick == self._first + 1:  # where other code shows, as a rule
            self._keep_ends(clock.tick)
        if clock.now - self._flushed >= 1 or before != self._written:
            self.recording.flush()
            self._flushed = clock.now

    def close(self, in_tick=False):
        """End the recording in good order, after the last commands and a hash of the last state.

        With ``in_tick`` the world may stand in the middle of a tick that failed: the recording ends before it.
        """
        clock = self.world.resource(Clock)
        self.world.resource(Commands).refusal = None
        if in_tick:
            self.recording.close(self._taken)
            return
        if clock.tick != self._taken:
            self.take()
        if clock.tick % self.hash_every:
            self._keep_hash(clock.tick)
        self._keep_ends(clock.tick)
        self.recording.close(clock.tick)

    def abandon(self):
        """Let go of the file without an end."""
        self.world.resource(Commands).refusal = None
        self.recording.abandon()

    def _refusal(self, cmd):
        """Why a command that is about to be applied cannot be kept, or ""."""
        log = self.world.resource(Commands).log
        for _, applied in log[self._counted :]:
            self._room.take(to_json(applied).encode())
        self._counted = max(self._counted, len(log))
        refusal = self._room.refusal(to_json(cmd).encode(), ROOM)
        return refusal and f"the recording has no room for it: {refusal}"

    def _keep_hash(self, tick):
        marks: dict[str, bytes] = {}
        self.recording.hash(tick, state_hash(self.world, marks))
        self.recording.trail(tick, self._trail.record(self.world, marks))

    def _keep_ends(self, tick):
        """A snapshot at the beginning, after the first tick and at the end, where it is small."""
        if self.keyframes.ticks and self._kept != tick and len(self.world.agents) <= MANY:
            self._keep_state(tick)

    def _keep_state(self, tick):
        self._kept = tick
        self.recording.note(tick)
        self.recording.put(record_of(KEYFRAME, int(tick), snapshot_parts(self.world)))

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close(in_tick=kind is not None)


@dataclass(frozen=True)
class Divergence:
    """The first tick at which a replay differs from its recording."""

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
            restore(world, run.keyframes.read(start, partial(check_beginning, world)))
        except StateError as error:
            raise RecordingError(f"{run.path}: the snapshot of tick {start}: {error}") from None
    now, queue = world.resource(Clock).tick, world.resource(Commands)
    queue.source = str(run.path)
    known = max([run.last_tick - 1, *(when for when, _ in run.commands)])  # what came later, the level's script knows
    later = [entry for entry in queue.waiting if entry[0] > known]
    queue.replace([(when, cmd) for when, cmd in run.commands if when >= now] + later)
    queue.lived = known


def first_difference(run, world, step, to_tick=None, progress=None):
    """Replay a recording and compare every tick.

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


def _encoded_header(path, header, assets):
    missing = [name for name in ("seed", "dt") if name not in header]
    if missing:
        raise RecordingError(f"{path}: the header of a recording needs {' and '.join(missing)}")
    for name in assets:
        if not is_plain(name):
            raise RecordingError(f"{path}: {name!r} is not a path relative to the level")
    if sum(map(len, assets.values())) > limits.RECORDING_ASSETS_BYTES:
        raise RecordingError(f"{path}: the level's files are more than {limits.RECORDING_ASSETS_BYTES.text}")
    table = {name: {"sha256": hashlib.sha256(data).hexdigest(), "bytes": len(data)} for name, data in assets.items()}
    whole = {**header, "format": FORMAT, "packages": package_versions(), "assets": table}
    try:
        return json.dumps(whole, allow_nan=False, sort_keys=True).encode()
    except (TypeError, ValueError) as error:
        raise RecordingError(f"{path}: the header cannot be written as JSON: {error}") from None
