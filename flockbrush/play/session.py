"""A level that is played: its world in time, its document, and what a designer does to both.

Nothing here draws.  The window asks for `Session.view` and hands in what the designer does with `Session.do`; whatever
goes wrong becomes a `Notice`, never a traceback.
"""

from __future__ import annotations

import math
import os
import time
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from behaviours.problems import ProblemsError
from components import BrushBinding, Heading, Position, Velocity
from engine.commands import CommandError
from engine.recording import RecordingError
from flockbrush import run as running
from flockbrush.files import output_problems, refused
from flockbrush.moments import between, moment_of, names_of
from flockbrush.play.recovery import Shelter, leftovers, recovered_branches
from flockbrush.play.timeline import Beginning, Timeline, WentWrong
from levels.reader import brush_library
from systems.landscape import Landscape
from systems.measures import compute_milling, compute_polarization, compute_unwrapped

RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of simulated to real time
SAMPLE_TICKS = 4  # between two points of the charts: 8 a second
CHART_POINTS = 1500  # at most, of one chart
PROFILE_TICKS = 64  # over which the time of a system is averaged
PACE_SECONDS = 1.0  # s of real time over which the pace is averaged
_SOON = 1e-9  # of a tick; rounding of what real time adds up to


@dataclass(frozen=True)
class Notice:
    """Something the designer should know."""

    kind: str  # "info", "warning" or "error"
    text: str


@dataclass(frozen=True)
class Sample:
    """What the charts show of one moment."""

    tick: int
    time: float  # s
    polarization: float
    milling: float
    speed: float  # m/s, mean
    counts: dict[str, int]  # animals by name of brush


class Session:
    """A level that is open in the playground.  Make one with `open`.

    Attributes
    ----------
    timeline : Timeline
    path : Path
        The level's file.
    library : BrushLibrary
        The brushes there are.
    playing : bool
    """

    def __init__(self, path, timeline, shelter, notices):
        self.path, self.timeline, self._shelter = Path(path), timeline, shelter
        self._notices: list[Notice] = notices
        self.timeline.tell = self._warn
        self.library = timeline.current.beginning.library
        self.playing = False
        self._rate = 1.0
        self._owed = 0.0  # ticks of real time that have not been simulated yet
        self._goal: int | None = None  # the tick we are scrubbing to
        self._cost = 0.0  # s of a tick, recent mean
        self._pace = Pacemaker()
        self._profile: deque = deque(maxlen=2)
        self._ticks = 0  # lived, for the profile
        self._charted: tuple = (None, None)
        self._flushed = time.monotonic()
        self._look()
        self._note()

    @classmethod
    def open(cls, name, seed=None, agents=None, record=None, state_folder=None) -> Session:
        """Open a level.

        Parameters
        ----------
        name : str or path
            A file, or the name of a shipped level.
        seed, agents : int, optional
            As `flockbrush.run.start`.
        record : path, optional
            Record the run there, and each branch in a file of its own beside it.
        state_folder : path, optional
            Where what a crash must not take is kept; `recovery.state_folder` unless told.

        Raises
        ------
        ProblemsError
            With everything that is wrong with the level, or when the recording cannot be written.
        """
        level, library = running.open_level(name)
        record = None if record is None else Path(record)
        problems = output_problems([record] if record else [], [level.path])
        if problems:
            raise ProblemsError(problems)
        notices: list[Notice] = []
        with _sheltered(level.path, state_folder, notices) as shelter:
            folder = shelter and shelter.folder if record is None else record.parent
            beginning = Beginning(level, library, seed, agents)
            timeline = Timeline(beginning, record.stem if record else level.name, folder, sample_of)
        return cls(level.path, timeline, shelter, notices)

    @classmethod
    def recover(cls, left, state_folder=None) -> Session:
        """Go on where a crash ended a session, with all that it knew.

        Parameters
        ----------
        left : recovery.Leftover

        Raises
        ------
        RecordingError, ProblemsError
            When too little is left of it; nothing is thrown away then.
        """
        branches = recovered_branches(left)
        notices: list[Notice] = []
        with _sheltered(left.level, state_folder, notices) as shelter:
            try:
                timeline = Timeline.resumed(branches, left.current, shelter and shelter.folder, sample_of)
            except WentWrong as error:
                raise RecordingError(f"{left.level}: {error}") from None
        session = cls(left.level, timeline, shelter, notices)
        left.discard()
        return session

    @staticmethod
    def recoverable(name=None, state_folder=None):
        """What crashes left of a level, or of all: `recovery.Leftover`, the latest first."""
        return leftovers(None if name is None else running.find_level(name), state_folder)

    # what there is ----------------------------------------------------------------

    @property
    def simulation(self):
        """The world that is shown.  Another object after a restart or a switch: ask again rather than keep it."""
        return self.timeline.simulation

    @property
    def level(self):
        """The level as it was when this run began."""
        return self.simulation.level

    @property
    def clock(self):
        return self.simulation.clock

    @property
    def tick(self):
        """Ticks since the beginning."""
        return self.timeline.tick

    @property
    def last_tick(self):
        """The end of what is known of this branch."""
        return self.timeline.current.last_tick

    @property
    def in_past(self):
        """Whether what comes next is known."""
        return not self.timeline.at_end

    @property
    def wrap(self):
        """(width, height) of a periodic map, m, or None."""
        return self.simulation.world.resource(Landscape).wrap

    def names(self):
        """(species, brushes): names by index, as they are now."""
        return names_of(self.simulation)

    @property
    def moment(self):
        """The animals as they exactly are."""
        return self._after

    def view(self):
        """The animals for drawing, between the last two ticks while time goes on."""
        if not self.playing or self._before is None:
            return self._after
        start, end = self._before.time, self._after.time
        return between(self._before, self._after, start + min(self._owed, 1.0) * (end - start), self.wrap)

    def notices(self):
        """What the designer should know, each once."""
        told, self._notices = self._notices, []
        return told

    def ground_changes(self):
        """Where the ground looks different now: boxes (west, south, east, north) in metres, or "all"; each once."""
        boxes, self.timeline.moved = self.timeline.moved, []
        return ["all"] if "all" in boxes else list(dict.fromkeys(boxes))

    # time -----------------------------------------------------------------------------

    @property
    def rate(self):
        """Simulated seconds per real second that are wished for, 1/4 to 8."""
        return self._rate

    @rate.setter
    def rate(self, rate):
        self._rate = min(max(float(rate), RATES[0]), RATES[-1])
        self._pace.restart()

    @property
    def pace(self):
        """Simulated seconds per real second as it goes; below `rate` when the machine is too slow."""
        return self._pace.pace if self.playing else 0.0

    def play(self):
        """Let time go on.  In the past, what was recorded is watched again, up to its end, and then goes on."""
        self.playing, self._owed = True, 0.0
        self._finish()
        self._pace.restart()

    def pause(self):
        """Stand still."""
        self.playing = False
        self.timeline.settle()
        self._look()

    def step(self, n=1):
        """So many single ticks; negative ones go back."""
        self.playing = False
        self._finish()
        if n < 0:
            self.scrub(self.tick + n)
            return
        for _ in range(n):
            if not self._tick():
                break
        self.timeline.settle()
        self._look()

    def scrub(self, tick, budget_s=None):
        """Go to a tick that is known; whether it is there already.

        With a budget in seconds, the rest of a long way is gone in the next calls of `advance`.  The past stays as it
        was; whatever is done there begins a branch.
        """
        self.playing, self._goal = False, int(tick)
        return self._go(budget_s)

    def restart(self):
        """Begin anew with the level as it is now; the run so far stays as a branch."""
        self.playing, self._goal = False, None
        self.timeline.begin(self.timeline.current.beginning)
        self._look()
        self._note()

    def advance(self, wall_seconds, budget_s):
        """Simulate what real time asks for, as far as the budget allows.

        At least one tick, if one is due, and never one that is not expected to fit; what could not be done is
        forgotten, so a slow machine plays slower and never falls behind.

        Parameters
        ----------
        wall_seconds : float
            Real time since the last call.
        budget_s : float
            Seconds this may take.

        Returns
        -------
        int
            Ticks that have passed.
        """
        if self._goal is not None:
            self._go(budget_s)
            return 0
        if not self.playing:
            return 0
        asked = wall_seconds * self._rate / self.clock.dt
        self._owed += asked
        done = self._live(time.perf_counter() + budget_s)
        self._owed %= 1.0  # what is more than a tick is forgotten
        self._pace.passed(wall_seconds, done * self.clock.dt)
        return done

    def _live(self, deadline):
        done = 0
        while self._owed > 1.0 - _SOON and self.playing:
            begin = time.perf_counter()
            if done and begin + self._cost > deadline:
                break
            if not self._tick():
                break
            done += 1
            self._owed = max(self._owed - 1.0, 0.0)
            self._cost += 0.2 * (time.perf_counter() - begin - self._cost)
        return done

    def _tick(self):
        """One tick, or a notice and a pause."""
        try:
            self.timeline.step()
        except (CommandError, WentWrong) as error:
            self._stop(str(error))
            return False
        self._before, self._after = self._after, moment_of(self.simulation)
        self._note_profile()
        return True

    def _stop(self, text):
        self.playing, self._owed = False, 0.0
        self._notices.append(Notice("error", text))
        self._look()

    def _go(self, budget_s):
        deadline = math.inf if budget_s is None else time.perf_counter() + budget_s
        try:
            there = self.timeline.go_to(self._goal, deadline)
        except WentWrong as error:
            self._stop(str(error))
            there = True  # as near as one can come
        if there:
            self._goal = None
        self._look()
        return there

    def _finish(self):
        """Be where a scrub wanted to be."""
        if self._goal is not None:
            self._go(None)

    def _look(self):
        """The world was changed from outside of its ticks: there is nothing before it to draw from."""
        self._before, self._after = None, moment_of(self.simulation)

    # branches -----------------------------------------------------------------------------

    @property
    def branches(self):
        """The courses of events there are, by name (`timeline.Branch`)."""
        return self.timeline.branches

    @property
    def branch_name(self):
        """The branch we are on."""
        return self.timeline.current.name

    def branch(self, name=None):
        """Begin another course of events here; its name.  The old one stays in `branches`."""
        self._finish()
        new = self.timeline.fork(name)
        self._look()
        self._note()
        return new.name

    def switch(self, name):
        """Go to the end of another branch."""
        self.playing, self._goal = False, None
        try:
            self.timeline.switch(name)
        except LookupError as error:
            self._warn(str(error.args[0]))
        self._look()
        self._note()

    # doing ----------------------------------------------------------------------------------

    def do(self, label, commands, join=None):
        """Do something to the world now, all of it or nothing; whether it was done.

        In the past this begins a branch.

        Parameters
        ----------
        label : str
            What undo is to call it.
        commands : sequence of command
        join : hashable, optional
            Steps with the same key, one after the other, are undone as one: the pieces of a stroke.
        """
        self._finish()
        forked = self.in_past and self.timeline.fork()
        try:
            self.timeline.perform(commands)
        except (CommandError, TypeError) as error:
            self._notices.append(Notice("error", _reason(error)))
            if forked:
                self.timeline.give_up()
            return False
        finally:
            self._after = moment_of(self.simulation)  # what was before it stays: drawing goes on smoothly
        if forked:
            self._note()
        self.timeline.flush()
        return True

    # numbers --------------------------------------------------------------------------------

    @property
    def chart(self):
        """Measures over the whole branch (`Chart`), as far as it is known."""
        samples = self.timeline.current.samples
        known = self.branch_name, samples[-1].tick if samples else -1
        if self._charted[0] != known:
            self._charted = known, chart_of(samples)
        return self._charted[1]

    def profile(self):
        """Milliseconds a tick of each system, recent mean."""
        if len(self._profile) < 2:
            return {}
        (ticks, before), (now, after) = self._profile
        return {name: (after[name] - before[name]) / 1e6 / max(now - ticks, 1) for name in after if name in before}

    def _note_profile(self):
        self._ticks += 1
        if self._ticks % PROFILE_TICKS == 1:
            self._profile.append((self._ticks, dict(self.simulation.schedule.nanoseconds)))

    # files ------------------------------------------------------------------------------------

    def export_recording(self, path):
        """Write the current branch as a recording that ``flockbrush replay --verify`` accepts; whether it worked."""
        try:
            self.timeline.export(path)
        except (RecordingError, OSError) as error:
            self._notices.append(Notice("error", str(error)))
            return False
        self._notices.append(Notice("info", f"wrote {path}"))
        return True

    def close(self):
        """End the recordings in good order; nothing is left to recover."""
        self.timeline.close()
        if self._shelter is not None:
            self._shelter.close()

    def brush_folder(self):
        """The folder for brushes of one's own, beside the level, made if it is not there; ProblemsError."""
        folder = self.path.parent / "brushes"
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise refused(folder, f"cannot be made: {error.strerror}") from None
        self.library = brush_library(self.path, self.level.files)
        return folder

    def autosave(self):
        """Once a second: hand what happened to the operating system, so that a crash cannot take it."""
        if time.monotonic() - self._flushed >= 1.0:
            self._flushed = time.monotonic()
            self.timeline.flush()

    def _note(self):
        """Tell those who may have to recover which branches there are."""
        if self._shelter is None:
            return
        branches = {
            name: {
                "recording": branch.scribe and os.path.abspath(branch.scribe.path),
                "journal": None,
                "parent": branch.parent,
                "left": branch.left,
            }
            for name, branch in self.branches.items()
        }
        self.timeline.flush()
        try:
            self._shelter.note(self.branch_name, branches)
        except ProblemsError as error:
            self._warn(f"a crash would now lose what is new: {error}")

    def _warn(self, text):
        self._notices.append(Notice("warning", text))


@dataclass(frozen=True)
class Chart:
    """Measures over time, as arrays of one length.

    Attributes
    ----------
    time : ndarray (n,)
        Seconds.
    values : dict of str to ndarray (n,)
        "polarization", "milling" and "speed" (m/s, mean).
    counts : dict of str to ndarray (n,)
        Animals by name of brush.
    """

    time: np.ndarray
    values: dict[str, np.ndarray]
    counts: dict[str, np.ndarray]


def chart_of(samples):
    """Samples as a chart; of a long run, as many as can be told apart."""
    every = -(-len(samples) // CHART_POINTS) or 1
    few = samples[(len(samples) - 1) % every :: every] if samples else []
    brushes = sorted({name for sample in few for name in sample.counts})
    return Chart(
        np.array([sample.time for sample in few]),
        {name: np.array([getattr(sample, name) for sample in few]) for name in ("polarization", "milling", "speed")},
        {name: np.array([sample.counts.get(name, 0) for sample in few]) for name in brushes},
    )


class Pacemaker:
    """How fast simulated time really goes."""

    def __init__(self):
        self.restart()

    def restart(self):
        """Forget what was."""
        self._spans: deque = deque()
        self.pace = 0.0

    def passed(self, wall, simulated):
        """So much real and simulated time has passed, in seconds."""
        self._spans.append((wall, simulated))
        while sum(span[0] for span in self._spans) - self._spans[0][0] > PACE_SECONDS:
            self._spans.popleft()
        total = sum(span[0] for span in self._spans)
        self.pace = sum(span[1] for span in self._spans) / total if total > 0 else 0.0


def sample_of(simulation):
    """What the charts show of this moment, or None between two samples."""
    if simulation.clock.tick % SAMPLE_TICKS:
        return None
    agents, land = simulation.agents, simulation.world.resource(Landscape)
    forward, velocity = agents[Heading.forward], agents[Velocity.xyz]
    names = names_of(simulation)[1]
    counts = np.bincount(agents[BrushBinding.brush], minlength=len(names)).tolist()
    return Sample(
        simulation.clock.tick,
        simulation.clock.now,
        compute_polarization(forward),
        compute_milling(compute_unwrapped(agents[Position.xyz], land.wrap), forward),
        float(np.linalg.norm(velocity, axis=1).mean()) if len(agents) else math.nan,
        {name: count for name, count in zip(names, counts, strict=True) if count},
    )


@contextmanager
def _sheltered(level, root, notices):
    """A folder for what a crash must not take, gone again when the body fails; None, and a notice, when none can be."""
    try:
        shelter = Shelter(level, root)
    except OSError as error:
        notices.append(Notice("warning", f"a crash would lose your work: {error.filename}: {error.strerror}"))
        shelter = None
    try:
        yield shelter
    except BaseException:
        if shelter is not None:
            shelter.close()
        raise


def _reason(error):
    """A sentence for the designer, without the command's own spelling."""
    return error.reason if isinstance(error, CommandError) else str(error)
