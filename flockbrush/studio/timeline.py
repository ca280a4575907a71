"""A run with branches that can go back in time: snapshots, and replay of the ticks between them.

The world is always at one tick of one branch.  At the branch's end a tick is new: it is hashed, kept and recorded.
Before the end a tick is lived again from what was done then, compared with the hash that was kept, and changes
nothing.  The state *at* a tick is the one after all that was done there while the run stood still.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.recording import RecordingError
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.runs import run as running
from flockbrush.studio.branch_recorder import HASH_BYTES, SELDOM, BranchRecorder
from flockbrush.studio.branches import Branch, Keyframes, between, plain_name

KEYFRAME_SECONDS = 2.0  # s between two kept moments
KEYFRAME_BYTES = 384 << 20  # of all kept moments together: beside a window and numba they fit into 1 GB
NEAR, NEAR_TICKS = 16, 8  # moments kept where one looks at the past, and the ticks between them


class WentWrong(Exception):
    """A tick failed; the world is as it was before it.  ``str()`` is the reason."""


class Timeline:
    """The branches of a run, and the world at one tick of one of them.

    Parameters
    ----------
    name : str
        Of the first branch; the others are called after it.
    folder : path, optional
        Where each branch is recorded, in a file of its name.
    measure : callable, optional
        ``measure(simulation)``: what is charted of this moment, with its ``tick``; None when none is due.
    tell : callable, optional
        Told sentences for the designer: differences, files that can no longer be written.
    budget : int
        Bytes of kept moments.

    Attributes
    ----------
    simulation : Simulation
        Another object after a switch to a branch with another beginning.
    current : Branch
    moved : list
        Boxes of ground that look different since somebody emptied it.
    """

    def __init__(self, beginning, name="main", folder=None, measure=None, tell=None, budget=KEYFRAME_BYTES):
        self._prepare(name, folder, measure, tell, budget)
        self.simulation = beginning.build()
        self._begin(beginning, name)

    @classmethod
    def resumed(cls, branches, current, folder, measure, at=None):
        """The timeline of branches that were known before, at the end of one of them, or at a tick of it.

        Parameters
        ----------
        branches : dict of str to Branch
        current : str
        at : int, optional

        Raises
        ------
        WentWrong
            When its end cannot be reached.
        """
        timeline = cls.__new__(cls)
        timeline._prepare(next(iter(branches)), folder, measure, None, KEYFRAME_BYTES)
        timeline.branches = dict(branches)
        timeline.simulation = branches[current].beginning.build()
        for branch in [*branches.values(), branches[current]]:
            timeline.current = branch
            timeline._pace_of_keeping()
            if branch.recorder is None:
                timeline._record()
        at = timeline.current.last_tick if at is None else at
        timeline._stand(timeline.current.keyframes.before(at))
        timeline.go_to(at)
        return timeline

    def _prepare(self, name, folder, measure, tell, budget):
        self.measure: Callable = measure or (lambda simulation: None)
        self.tell: Callable = tell or (lambda text: None)
        self.folder = None if folder is None else Path(folder)
        self.budget, self._first = budget, name
        self._near, self._near_of = Keyframes(), None  # moments on the way of the last look back, and of which branch
        self.branches: dict[str, Branch] = {}
        self.moved: list = []

    @property
    def tick(self):
        """Ticks since the beginning."""
        return self.simulation.clock.tick

    @property
    def at_end(self):
        """Whether nothing is known of what comes next."""
        return self.tick >= self.current.last_tick

    @property
    def queue(self):
        """The world's commands."""
        return self.simulation.world.resource(Commands)

    def changes_within(self, ticks):
        """Whether a command will be done in the next so many ticks."""
        now, branch = self.tick, self.current
        waiting = self.queue.waiting if self.at_end else branch.waiting
        again = [] if self.at_end else between(branch.commands, now, now + ticks)
        return bool(again) or any(entry[0] < now + ticks for entry in waiting)

    # living ----------------------------------------------------------------------

    def step(self):
        """One tick: new at the branch's end, lived again before it.

        Raises
        ------
        CommandError
            When a command that was due cannot be done.  It is dropped, and no tick has passed.
        WentWrong
            When a model or a system failed.  The world is as it was before the tick, or, should the way there fail
            as well, at the last kept moment.
        """
        if self.at_end:
            self._live()
        else:
            self._live_again()

    def perform(self, commands):
        """Do these at this tick, all or none; what takes them back.  CommandError, and nothing was done."""
        if not self.at_end:
            raise ValueError("the past cannot be changed; start a new branch first")
        self._mark_ground(commands)
        try:
            return self.queue.perform(self.simulation.world, commands)
        except PluginError as error:  # the world may be half changed
            self.queue.log.clear()
            self._put_back(self.tick)
            raise CommandError(self.tick, None, error) from error
        finally:
            self._take_log()

    def _live(self):
        now = self.tick
        self._mark_ground(cmd for when, cmd in self.queue.pending if when <= now)
        try:
            self.simulation.tick()
        except CommandError:
            self._take_log()
            raise
        except Exception as error:  # a model is anybody's, and may fail in any way
            self._take_log()
            self._put_back(now)
            raise WentWrong(_in_words(error)) from error
        self._take_log()
        self.current.last_tick = self.tick
        self._keep()

    def _live_again(self):
        now, branch = self.tick, self.current
        self._do_again()
        self.moved += [box for _, box in between(branch.changes, now, now)]
        try:
            self.simulation.tick()
        except Exception as error:
            self._stand(branch.keyframes.before(now))
            raise WentWrong(_in_words(error)) from error
        self.queue.log.clear()
        self._compare()
        if self.at_end:
            self._arrive()

    def _do_again(self):
        """Hand in what was done at this tick, once."""
        if self._done != self.tick:
            for cmd in self.current.done_at(self.tick):
                self.queue.submit(cmd, self.tick)
            self._done = self.tick

    def settle(self):
        """Have done in the past what was done at this tick."""
        if not self.at_end:
            self._do_again()
            self.queue.apply(self.simulation.world)
            self.queue.log.clear()

    def _arrive(self):
        """At the branch's end: do what was done there, then wait for what waited."""
        self._do_again()
        self.queue.apply(self.simulation.world)
        self.queue.log.clear()
        self._wait(self.current.waiting)

    def _wait(self, waiting):
        """Live on from here, with this of the script still to come."""
        self.queue.replace(waiting)
        self.queue.lived = -1

    def _compare(self):
        branch, now = self.current, self.tick
        known = branch.hashes.get(now)
        if known is not None and branch.differs is None and state_hash(self.simulation.world) != known:
            branch.differs = now
            self.tell(
                f"tick {now} of {branch.name} gave another state than the known one: what follows is another motion; "
                "if no other version recorded it, please report this bug"
            )

    # going -----------------------------------------------------------------------

    def go_to(self, tick, deadline=math.inf):
        """Bring the world to a tick that is known, as far as time allows.

        Parameters
        ----------
        tick : int
            From 0 to the branch's end; beyond, the nearest of them.
        deadline : float
            `time.perf_counter` after which it may stop half-way.

        Returns
        -------
        bool
            Whether it is there.

        Raises
        ------
        WentWrong
            When a tick of the past cannot be lived again; the world is at the last kept moment before it.
        """
        tick, now = min(max(int(tick), 0), self.current.last_tick), self.tick
        start = self._nearest(tick)
        if not now <= tick or start > now:
            self._leave()
            self._stand(start)
            self.moved += [box for _, box in between(self.current.changes, min(now, start), max(now, start))]
        while self.tick < tick:
            if time.perf_counter() > deadline:
                self.settle()
                return False
            self._live_again()
            self._keep_near()
        self.settle()
        return True

    def _nearest(self, tick):
        """The last tick up to this one that can be restored."""
        near = self._near.before(tick) if self._near_of is self.current else None
        return max(self.current.keyframes.before(tick), -1 if near is None else near)

    def _keep_near(self):
        """Who looks at the past looks at what is near next: keep some moments on the way."""
        if self._near_of is not self.current:
            self._near_of, self._near = self.current, Keyframes()
        if self.tick % NEAR_TICKS == 0 and self.current.keyframes.cut(self.tick) is None and not self.at_end:
            self._near.keep(self.tick, snapshot(self.simulation.world))
            self._near.let_go(NEAR)

    def _leave(self):
        """Before the world stands elsewhere: remember what waits at the branch's end."""
        self.flush()
        if self.at_end:
            self.current.waiting = self.queue.waiting

    def _stand(self, tick):
        """Put a kept moment of the current branch into the world."""
        snapshots = self.current.keyframes if self.current.keyframes.cut(tick) is not None else self._near
        restore(self.simulation.world, snapshots[tick])
        self.queue.replace([])
        self.queue.lived = math.inf  # what the script does is among what was done
        self.queue.log.clear()
        self._done = -1
        if self.at_end:
            self._arrive()

    def _put_back(self, tick):
        """Out of the middle of a tick that failed at the branch's end, to before it."""
        self.current.waiting = self.queue.waiting
        self._stand(self.current.keyframes.before(tick))
        while self.tick < tick:
            self._live_again()

    # branches --------------------------------------------------------------------

    def fork(self, name=None):
        """Leave the branch here: what follows is another course of events, and the old one stays."""
        self.settle()
        self._leave()
        new = self.current.until(self.tick, self.free_name(name))
        if self.at_end:
            new.waiting = list(self.current.waiting)
        self._wait(new.waiting)
        self.branches[new.name] = self.current = new
        self._record()
        return new

    def give_up(self):
        """Undo the last `fork`: the branch goes, and the world stands again where it left its parent."""
        branch = self.branches.pop(self.current.name)
        if branch.recorder is not None:
            branch.recorder.discard()
        self.current = self.branches[branch.parent]
        self._stand(self.current.keyframes.before(branch.left))
        self.go_to(branch.left)

    def switch(self, name):
        """Stand at the end of another branch; LookupError."""
        if name not in self.branches:
            raise LookupError(f"there is no branch {name!r}; available: {', '.join(self.branches)}")
        self._leave()
        branch = self.branches[name]
        if branch.beginning is not self.current.beginning:
            self.simulation.close()
            self.simulation = branch.beginning.build()
        self.current = branch
        self._pace_of_keeping()
        self._stand(branch.keyframes.before(branch.last_tick))
        self.go_to(branch.last_tick)
        self.moved = ["all"]

    def begin(self, beginning, name=None):
        """A new branch with a beginning of its own, at tick 0; ProblemsError, and nothing has changed then."""
        simulation = beginning.build()
        self._leave()
        self.simulation.close()
        self.simulation, self.moved = simulation, ["all"]
        return self._begin(beginning, self.free_name(name))

    def _begin(self, beginning, name):
        self.current = self.branches[name] = Branch.begun(name, beginning, self.simulation)
        self._done = -1
        self._pace_of_keeping()
        self._keep()
        self._record()
        return self.current

    def _pace_of_keeping(self):
        """How often to hash and to keep a moment."""
        dt, size = self.simulation.clock.dt, len(self.current.keyframes[0])
        self._keep_every = round(KEYFRAME_SECONDS / dt)
        self._hash_every = SELDOM if size > HASH_BYTES else 1

    def free_name(self, name=None):
        """A name that no branch and no file has: the given one, or with the next number."""
        stem = name or self._first
        names = (stem if number == 1 else f"{stem}-{number}" for number in range(1, 10**6))
        return next(name for name in names if name not in self.branches and not self._file_of(name, True))

    # keeping ---------------------------------------------------------------------

    def _take_log(self):
        """What was just applied goes from the queue's log into the branch."""
        self.current.commands += self.queue.log
        self.queue.log.clear()
        self._write()

    def _keep(self):
        """Hash, snapshot and measures of a new tick."""
        branch, world, now = self.current, self.simulation.world, self.tick
        if now % self._hash_every == 0:
            branch.hashes[now] = state_hash(world)
        filed = branch.recorder is not None and branch.recorder.spacing.passed(len(world.agents))
        if filed or now % self._keep_every == 0:
            branch.keyframes.keep(now, snapshot(world))
            if filed:
                branch.recorder.file(now)
            self._thin()
        sample = self.measure(self.simulation)
        if sample is not None:
            branch.samples.append(sample)
        self._write()

    def memory(self):
        """Bytes of all kept moments."""
        held: dict[int, bytes] = {}
        for branch in self.branches.values():
            held |= branch.keyframes.parts()
        return sum(map(len, held.values()))

    def _thin(self):
        """Forget kept moments until they fit the budget: those that stand closest to others, the oldest first."""
        while self.memory() > self.budget:
            gaps = [(gap, tick, branch) for branch in self.branches.values() for gap, tick in branch.keyframes.gaps()]
            if not gaps:
                return
            _, tick, branch = min(gaps, key=lambda entry: entry[:2])
            cut = branch.keyframes.cut(tick)
            for other in self.branches.values():  # branches hold in common what they have in common
                if other.keyframes.cut(tick) is cut:
                    other.keyframes.drop(tick)

    def _mark_ground(self, commands):
        """Note where commands about to be applied change the ground."""
        for cmd in commands:
            box = _ground_box(cmd, self.simulation.world)
            if box is not None:
                self.moved.append(box)
                self.current.changes.append((self.tick, box))

    # recording -------------------------------------------------------------------

    def _file_of(self, name, taken=False):
        """The file of a branch; with ``taken`` only if there is one already."""
        path = None if self.folder is None else self.folder / f"{plain_name(name)}.flock"
        return path if path is not None and (not taken or path.exists()) else None

    def _record(self):
        """Begin the file of the current branch."""
        path = self._file_of(self.current.name)
        if path is not None:
            self._guarded(lambda: setattr(self.current, "recorder", self._recorder_of(path)))

    def _recorder_of(self, path):
        """What records the current branch, with as many snapshots as any recording."""
        spacing = running.usual_keyframes(self.simulation)
        return BranchRecorder(path, self.current, spacing, len(self.simulation.agents))

    def _write(self):
        """Hand what is new to the branch's file."""
        if self.current.recorder is not None:
            self._guarded(lambda: self.current.recorder.take())

    def flush(self):
        """Hand everything to the operating system: a crash of this program cannot take it back."""
        if self.current.recorder is not None:
            self._guarded(self.current.recorder.flush)

    def _guarded(self, write):
        """A file that cannot be written is given up, with one message; the run goes on."""
        try:
            write()
        except (RecordingError, OSError) as error:
            self.current.recorder = None
            self.tell(f"the run continues, but is not recorded any more: {error}")

    def export(self, path):
        """Write a recording of the current branch, whole or not at all; RecordingError, OSError."""
        branch = self.current
        self._recorder_of(path).close(branch.last_tick)

    def close(self):
        """End the files in good order, and forget the world."""
        for branch in self.branches.values():
            if branch.recorder is not None:
                self.current = branch
                self._guarded(lambda: self.current.recorder.close(self.current.last_tick))
            branch.recorder, branch.keyframes = None, Keyframes()
        self._near = Keyframes()
        self.simulation.close()


def _ground_box(cmd, world):
    """Where a command changes the ground: (west, south, east, north) in metres, "all", or None for nowhere."""
    try:
        return cmd.ground_box(world) if hasattr(cmd, "ground_box") else None
    except (ValueError, LookupError, TypeError):
        return None  # it cannot be done, and says so when it is


def _in_words(error):
    """The message of a failed tick."""
    text = str(error) or "no reason given"
    return text if isinstance(error, PluginError) else f"{type(error).__name__}: {text}"
