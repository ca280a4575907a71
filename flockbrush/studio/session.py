"""A session of the playground: a level, its running world, its level document and the edits of both.

Nothing here draws.  The window asks for `Session.view` and hands in what the designer does with `Session.do`; whatever
goes wrong becomes a `Notice`, never a traceback.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

from flockbrush.engine.commands import CommandError
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from flockbrush.levels.editor import EditError, Editor, JournalError
from flockbrush.levels.libraries import brush_library
from flockbrush.runs import run as running
from flockbrush.runs.snapshots import moment_of
from flockbrush.studio.branches import Beginning, recording_problems
from flockbrush.studio.gauges import chart_of, sample_of
from flockbrush.studio.history import History
from flockbrush.studio.recovery import leftovers, recovered_branches
from flockbrush.studio.session_files import LevelFile, SessionFiles, SessionNotice, editor_of, recovery_folder
from flockbrush.studio.ticks_beside import TickRunner
from flockbrush.studio.timeline import Timeline, WentWrong
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.program_commands import UseProgram
from flockbrush.systems.undo import UseBrush

RATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of simulated to real time


class Session(TickRunner, SessionFiles):
    """A level that is open in the playground.  Make one with `open`.

    Attributes
    ----------
    timeline : Timeline
    path : Path
        The level's file.
    library : BrushLibrary
        The brushes there are.
    playing : bool
    lent : bool
        Whether the level's file is not the designer's: it comes with Flockbrush, or out of a recording.
    recording, edits : Path, RecordingEdits, or None
        The recording that was opened, and its edits after the run.
    """

    recording: Path | None = None
    edits: Any = None
    edition = 0  # another number whenever edits show the same run in another way

    def __init__(self, path, timeline, recovery, notices):
        self.path, self._timeline, self._recovery = Path(path), timeline, recovery
        self._stand_still()
        self._notices: list[SessionNotice] = notices
        self.timeline.tell = lambda text: self._say("warning", text)
        self.library = timeline.current.beginning.library
        self._file = LevelFile(self.path)
        self._saved_programs = {program.source for program in self.level.programs.values()}
        self.playing = False
        self.lent = self.path.resolve().parent == running.SHIPPED.resolve()
        self._goal: int | None = None  # the tick we are scrubbing to
        self._charted: tuple = (None, None)
        self._flushed = time.monotonic()
        self._look()

    @classmethod
    def open(cls, name, seed=None, agents=None, record=None, state_folder=None) -> Session:
        """Open a level.

        Parameters
        ----------
        name : str or path
            A file, or the name of a shipped level.
        seed, agents : int, optional
            As `flockbrush.runs.run.start`.
        record : path, optional
            Record the run there, and each branch in a file of its own beside it.
        state_folder : path, optional
            Where what a crash must not take is kept; `recovery.state_folder` by default.

        Raises
        ------
        ProblemsError
            With everything that is wrong with the level, or when the recording cannot be written.
        """
        level, library = running.open_level(name)
        record = None if record is None else Path(record)
        problems = recording_problems(record, [level.path])
        if problems:
            raise ProblemsError(problems)
        notices: list[SessionNotice] = []
        with recovery_folder(level.path, state_folder, notices) as recovery:
            folder = recovery and recovery.folder if record is None else record.parent
            beginning = Beginning(level, library, seed, agents)
            timeline = Timeline(beginning, record.stem if record else level.name, folder, sample_of)
        session = cls(level.path, timeline, recovery, notices)
        session._file = LevelFile(level.path, level.files[level.path.name])
        session._edit()
        if record is not None:
            session.tell_size(record)
        return session

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
        notices: list[SessionNotice] = []
        with recovery_folder(left.level, state_folder, notices) as recovery:
            path = cls._level_of(left, recovery, branches[left.current].assets)
            try:
                timeline = Timeline.resumed(branches, left.current, recovery and recovery.folder, sample_of)
            except WentWrong as error:
                raise RecordingError(f"{left.level}: {error}") from None
        session = cls(path, timeline, recovery, notices)
        session.recording = left.recording
        session.library = brush_library(session.path, session.level.files)
        for name, branch in timeline.branches.items():
            session._adopt(session._recovered_editor(name, left.branches[name].journal), branch)
        session._note()
        left.discard()
        return session

    def _recovered_editor(self, name, journal, path=None):
        """The editor whose journal a crash left."""
        try:
            if journal is None:
                raise JournalError("its journal is missing")
            return Editor.recover(journal, path=path)
        except (JournalError, ProblemsError) as error:
            self._say("warning", f"{name}: the changes of the level are lost: {error}")
            return History(self.path, "its edits were lost in a crash; open the level again to edit it")

    @staticmethod
    def recoverable(name=None, state_folder=None, tell=lambda text: None):
        """What crashes left unsaved of a level or recording, or of all: `recovery.Leftover`, the latest first.

        What they left of sessions without unsaved work goes to the trash.  ``tell`` is told what was set aside.
        """
        sessions = leftovers(None if name is None else running.find_level(name), state_folder, tell)
        unsaved = [left for left in sessions if left.unsaved]
        for left in sessions:
            if left not in unsaved:
                left.discard()
        return unsaved

    def _edit(self):
        """Begin to edit the level's file on a branch that has just begun."""
        editor, why = editor_of(self.path, self.simulation, self.timeline.current.beginning, self.library)
        if why:
            self._say("warning", why)
        self._adopt(editor)
        self._note()

    # what there is ----------------------------------------------------------------

    @property
    def timeline(self):
        """The run, between two ticks; waits for ticks that run in the background."""
        self._collect()
        return self._timeline

    @property
    def scene(self):
        """As `simulation`, without waiting for ticks that run beside: only for what ticks leave as it is."""
        return self._timeline.simulation

    @property
    def editor(self):
        """The document of the branch we are on (`flockbrush.levels.editor.Editor`, or `History` where it cannot be
        edited)."""
        return self.timeline.current.editor

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
        return self.scene.world.resource(Landscape).wrap

    def notices(self):
        """What the designer should know, each once."""
        return [self._notices.pop(0) for _ in range(len(self._notices))]  # a tick may have more to say meanwhile

    def ground_changes(self):
        """Where the ground looks different now: boxes (west, south, east, north) in metres, or "all"; each once."""
        if self._beside.busy:  # where commands are due, nobody draws before they are done
            return []
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
        self._finish()
        self.playing, self._owed, self._passed = True, 0.0, 0
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
        self._collect()
        self._have(self._live(n, math.inf))
        self._passed = 0
        self.timeline.settle()
        self._look()

    def scrub(self, tick, budget_s=None):
        """Go to a tick that is known; whether it is there already.

        With a budget in seconds, the rest of a long way is gone in the next calls of `catch_up`.  The past stays as it
        was; whatever is done there begins a branch.
        """
        self.playing, self._goal = False, int(tick)
        return self._go(budget_s)

    def restart(self):
        """Begin anew with the level and the brushes as they are now; the run so far stays as a branch."""
        now, editor, library = self.timeline.current.beginning, self.editor, self.library
        try:
            level, files = self._read_again()
            beginning = Beginning(level, self.brushes_known(), now.seed, now.agents)
            self._begin(beginning, editor.restarted(files.renewed), files.brushes, self.changed_programs())
            self._tell_changed(files)
        except ProblemsError as error:
            self.library = library
            self._say("error", f"{error}\nThe level cannot start with this change; the run continues.")

    def _begin(self, beginning, editor, brushes=(), programs=()):
        """A branch with a beginning of its own, these brushes and programs in it; ProblemsError: nothing changed."""
        playing, self.playing, self._goal = self.playing, False, None
        outdated = self.timeline.current.outdated and editor is not None
        self.timeline.begin(beginning)
        self.timeline.current.outdated = outdated
        known = {brush.name: brush for brush in self.palette.brushes}
        own = [UseBrush(brush.name, brush.source.decode()) for brush in brushes if known.get(brush.name) != brush]
        own += [UseProgram(program.name, program.source.decode()) for program in programs]
        try:
            self.timeline.perform(own)
        except CommandError as error:
            self._say("warning", f"changed brushes and programs are only in the branch before: {_reason(error)}")
        if editor is None:
            self._edit()
        else:
            self._adopt(editor)
            self._note()
        self._look()
        self.playing = playing

    def _stop(self, text):
        self.playing, self._owed = False, 0.0
        self._say("error", text)
        self._look()

    def _go(self, budget_s):
        deadline = math.inf if budget_s is None else time.perf_counter() + budget_s
        try:
            arrived = self.timeline.go_to(self._goal, deadline)
        except WentWrong as error:
            self._stop(str(error))
            arrived = True  # as near as one can come
        if arrived:
            self._goal = None
        self._look()
        return arrived

    def _finish(self):
        """Be where a scrub wanted to be."""
        if self._goal is not None:
            self._go(None)

    def _look(self):
        """The world was changed from outside of its ticks: there is nothing before it to draw from."""
        self._before, self._after = None, moment_of(self.simulation, labels=())

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
        self._fork(name)
        self._look()
        return self.branch_name

    def _fork(self, name=None):
        """Another branch from here, its document as it was at this tick."""
        editor, outdated = self.editor, self.timeline.current.outdated
        then = editor.at(self.tick, after=True)
        self.timeline.fork(name)
        self.timeline.current.outdated = outdated
        self._adopt(then)
        self._note()

    def switch(self, name):
        """Go to the end of another branch."""
        self.playing, self._goal = False, None
        try:
            self.timeline.switch(name)
        except (LookupError, WentWrong) as error:
            self._say("error", str(error.args[0]))
        self._look()
        self._note()

    # doing ----------------------------------------------------------------------------------

    def do(self, label, commands, join=None):
        """Do something to the world and to the level, all of it or nothing; whether it was done.

        In the past this begins a branch.

        Parameters
        ----------
        label : str
            What undo is to call it.
        commands : sequence of command
        join : str, optional
            Steps of one key that follow each other are undone as one: the pieces of a stroke.
        """
        commands = list(commands)
        forked = self._leave_past()
        try:
            self.editor.check(commands)
            back = self.timeline.perform(commands)
        except (CommandError, EditError, ValueError, LookupError, TypeError) as error:
            self._say("error", _reason(error))
            self._stay(forked)
            return False
        self.editor.do(label, commands, back, self.tick, join)
        self._done()
        return True

    def undo(self):
        """Take back the last step; whether there was one."""
        forked = self._leave_past()
        label, commands = self.editor.undo_label, self.editor.undo_commands
        if commands is None:
            self._stay(forked)
            return False
        try:
            again = self.timeline.perform(commands)
        except CommandError as error:
            self._say("warning", f"{label}: undone in the level, but not in the running herd: {_reason(error)}")
            again = None
        self.editor.undo(self.tick, again)
        self._done()
        return True

    def redo(self):
        """Do the step last taken back again; whether there was one, and it could be."""
        forked = self._leave_past()
        commands = self.editor.redo_commands
        try:
            if commands is None:
                raise LookupError
            back = self.timeline.perform(commands)
            self.editor.redo(self.tick, back)
        except (CommandError, EditError, LookupError) as error:
            if commands is not None:
                self._say("error", _reason(error))
            self._stay(forked)
            return False
        self._done()
        return True

    @property
    def undo_label(self):
        """What undo would take back, or None."""
        return self.editor.undo_label_at(self.tick)

    @property
    def redo_label(self):
        """What redo would do again, or None."""
        return self.editor.redo_label_at(self.tick)

    def _leave_past(self):
        """What is done in the past is another course of events; whether a branch was begun for it."""
        self._finish()
        forked = self.in_past
        if forked:
            self._fork()
        return forked

    def _stay(self, forked):
        """Nothing was done after all."""
        if forked:
            self.editor.close_journal()
            self.timeline.give_up()
            self._note()
        self._after = moment_of(self.simulation, labels=())

    def _done(self):
        """Something was done: what was before it is still drawn from, and a crash cannot take it."""
        self._after = moment_of(self.simulation, labels=())
        self.timeline.flush()

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
        return self._profile.milliseconds


def _reason(error):
    """A sentence for the designer, without the command's own spelling."""
    return error.reason if isinstance(error, CommandError) else str(error)
