"""Records a branch to a file while it runs."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from flockbrush.engine.recording import Recording
from flockbrush.engine.recording_format import KEYFRAME, record

HASH_BYTES = 3 << 20  # a state larger than this is hashed less often
WAITING = 4  # snapshots of new ticks that may wait to be packed: then the run waits for the first
SELDOM = 8  # ticks between two hashes of a large state
_beside = ThreadPoolExecutor(1, "packing")


class BranchRecorder:
    """The recording of one branch in a file, from its beginning on.

    Parameters
    ----------
    path : path-like
    spacing : KeyframeSpacing
        Which of the moments that the branch keeps are in the file, too.
    animals : int
        How many there are now.
    """

    def __init__(self, path, branch, spacing, animals):
        self.path, self.branch, self.spacing = Path(path), branch, spacing
        self.recording = Recording.create(path, branch.header, branch.assets)
        self._commands, self._hashed = 0, -1
        self._packing: deque[Future] = deque()
        before = 0
        for tick in branch.keyframes:
            if tick > before and spacing.passed(animals, tick - before):
                self.file(tick)
            before = tick
        self._waiting = len(self._packing) + WAITING
        self.take()

    def file(self, tick):
        """Have a moment that the branch keeps in the file, too; packed beside the run, longer than a frame."""
        self._packing.append(_beside.submit(_packed, tick, self.branch.keyframes.cut(tick)))

    def take(self):
        """Write what is new: hashes and commands in the order of time, and snapshots as they are packed."""
        branch = self.branch
        events = [(tick, 0, digest) for tick, digest in self._new_hashes(branch)]
        events += [(tick, 1, cmd) for tick, cmd in branch.commands[self._commands :]]
        self._commands = len(branch.commands)
        for tick, kind, what in sorted(events, key=lambda event: event[:2]):
            (self.recording.command if kind else self.recording.hash)(tick, what)
        self._put_packed(self._waiting)

    def _new_hashes(self, branch):
        new = []
        for tick in reversed(branch.hashes):  # in order of tick, and few are new
            if tick <= self._hashed:
                break
            new.append((tick, branch.hashes[tick]))
        self._hashed = max([self._hashed, *(tick for tick, _ in new)])
        return new

    def _put_packed(self, waiting):
        """Write the snapshots that are packed, in their order; no more than so many go on waiting."""
        while self._packing and (self._packing[0].done() or len(self._packing) > waiting):
            self.recording.put(self._packing.popleft().result())

    def flush(self):
        """Hand what was written to the operating system."""
        self.recording.flush()

    def close(self, tick):
        """End the file in good order."""
        self._put_packed(0)
        self.recording.close(tick)

    def discard(self):
        """Take the file away again."""
        self.recording.abandon()
        self.path.unlink(missing_ok=True)


def _packed(tick, cut):
    return record(KEYFRAME, tick, b"".join(cut))
