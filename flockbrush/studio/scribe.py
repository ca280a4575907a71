"""Writes a branch into a recording's file while it goes on."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from flockbrush.engine.recording import Recording, packed_keyframe

FILED_SECONDS = 30.0  # s between two snapshots in a recording's file: packing one takes longer than a frame
HASH_BYTES = 3 << 20  # a state larger than this is hashed less often
SELDOM = 8  # ticks between two hashes of a large state
_beside = ThreadPoolExecutor(1, "packing")


class Scribe:
    """The recording of one branch in a file, from its beginning on."""

    def __init__(self, path, branch):
        self.path = Path(path)
        self.recording = Recording.create(path, branch.header, branch.assets)
        self._commands, self._hashed, self._filed = 0, -1, -1
        self._packing: Future | None = None
        self.take(branch, 1)

    def take(self, branch, keyframe_every):
        """Write what is new: hashes and commands in the order of time, and a snapshot now and then."""
        events = [(tick, 0, digest) for tick, digest in self._new_hashes(branch)]
        events += [(tick, 1, cmd) for tick, cmd in branch.commands[self._commands :]]
        self._commands = len(branch.commands)
        for tick, kind, what in sorted(events, key=lambda event: event[:2]):
            (self.recording.command if kind else self.recording.hash)(tick, what)
        self._file_keyframe(branch, keyframe_every)

    def _new_hashes(self, branch):
        new = []
        for tick in reversed(branch.hashes):  # in order of tick, and few are new
            if tick <= self._hashed:
                break
            new.append((tick, branch.hashes[tick]))
        self._hashed = max([self._hashed, *(tick for tick, _ in new)])
        return new

    def _file_keyframe(self, branch, every):
        """A snapshot now and then, packed beside the run: packing one takes longer than a frame."""
        if self._packing is not None and self._packing.done():
            self.recording.put(self._packing.result())
            self._packing = None
        newest = branch.keyframes.before(branch.last_tick)
        if self._packing is None and newest >= max(self._filed, 0) + every:
            self._filed = newest
            self._packing = _beside.submit(packed_keyframe, newest, branch.keyframes[newest])

    def flush(self):
        """Hand what was written to the operating system."""
        self.recording.flush()

    def close(self, tick):
        """End the file in good order."""
        if self._packing is not None:
            self.recording.put(self._packing.result())
        self.recording.close(tick)

    def discard(self):
        """Take the file away again."""
        self.recording.abandon()
        self.path.unlink(missing_ok=True)
