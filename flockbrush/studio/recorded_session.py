"""A session opened from a recording: its level is unpacked, and its run is known from the first to the last tick."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from flockbrush.engine.files import refused, write_bytes
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError, open_recording
from flockbrush.levels.editor import EditError
from flockbrush.levels.schema import PROJECT_FILE
from flockbrush.runs import run as running
from flockbrush.runs.run_edits import EXACT
from flockbrush.studio.branches import Beginning, Branch
from flockbrush.studio.gauges import sample_of
from flockbrush.studio.recording_edits import edits_of_recording
from flockbrush.studio.recovery import RecoveryFolder
from flockbrush.studio.session import Session
from flockbrush.studio.session_files import LevelFile, SessionNotice
from flockbrush.studio.session_folders import RECORDED
from flockbrush.studio.timeline import KEYFRAME_BYTES, Timeline, WentWrong

SUFFIX = ".flock"
MAIN = "main"  # the branch that is the recording
NAMED = 3  # of the changes that a level cannot hold


class RecordedSession(Session):
    """A session of a recording: its level was unpacked into its own folder, and what is shown of it are its edits.

    Attributes
    ----------
    recorded : float
        Seconds that the recording lasts: edits hold on its own branch up to there.
    """

    recorded = 0.0
    _stops = False  # whether playing pauses at the end of the recording

    @classmethod
    def recover(cls, left, state_folder=None):
        """As `Session.recover`; the level is unpacked again.  ProblemsError when there is no place for it."""
        session = super().recover(left, state_folder)
        session.lent = left.folder in left.level.parents
        try:
            session.show_edits(open_recording(session.recording))
        except (RecordingError, OSError) as error:
            session._say("warning", f"the edits of this recording are not shown: {error}")
        return session

    @staticmethod
    def _level_of(left, recovery, assets):
        if left.folder not in left.level.parents:  # it was saved elsewhere
            return left.level
        if recovery is None:
            raise refused(left.level, "there is no place to unpack the level of the recording again")
        unpack(assets, recovery.folder / RECORDED, left.folder)
        return recovery.folder / left.level.relative_to(left.folder)

    def show_edits(self, run):
        """Show the edits of the recording, up to its end."""
        self.recorded = run.last_tick * run.header["dt"]
        self.edits, why = edits_of_recording(self.recording)
        if why:
            self._say("warning", why)

    def _recovered_editor(self, name, journal, path=None):
        return super()._recovered_editor(name, journal, self.path)

    def take_into_level(self, done):
        """Do to the level's document what was done in the recorded run: (tick, command) each."""
        left_out = []
        for tick, cmd in done:
            try:
                self.editor.recorded([cmd], tick)
            except (EditError, LookupError) as error:
                left_out.append(f"{type(cmd).__name__} at {tick * self.clock.dt:g} s ({error})")
        if left_out:
            more = f", and {len(left_out) - NAMED} more" if len(left_out) > NAMED else ""
            text = f"a saved level will lack what it cannot hold of this run: {', '.join(left_out[:NAMED])}{more}"
            self._say("warning", text)

    def view(self):
        """As `Session.view`, with the edits of the recording."""
        moment = super().view()
        return self.edits.shown(self.scene, moment) if self._edits_hold(moment.time) else moment

    def _edits_hold(self, time):
        """Whether edits of the recording are shown at a time of the branch that one is on."""
        return self.edits is not None and self._timeline.current.name == MAIN and time <= self.recorded + EXACT

    @property
    def edition(self):
        """As `Session.edition`."""
        return self.edits.edition if self._edits_hold(self._after.time) else -1

    def play(self):
        """As `Session.play`; what is recorded is played to its end, where time stands still once."""
        super().play()
        self._stops = self._after.time < self.recorded - EXACT

    def set_off(self, budget_s):
        """As `Session.set_off`, but not over the end of the recording."""
        if self.playing and self._stops and not self.ticking and self._timeline.current.name == MAIN:
            left = round((self.recorded - self._after.time) / self.scene.clock.dt)
            if left <= 0:
                self._stops = False
                self.pause()
                self._say("info", "end of the recording: edits end here; play again to simulate beyond it")
            self._owed = min(self._owed, max(left, 0))
        super().set_off(budget_s)

    def edit(self, kind, **values):
        """Make an edit of the selected animals of the recording; its sentence.  ValueError, ProblemsError."""
        if not self._edits_hold(self.clock.now):
            raise ValueError(
                f"only the recording can be edited: go to the branch {MAIN}, at most to {self.recorded:g} s"
            )
        return self.edits.add(kind, self.clock.now, **values)

    def undo(self):
        """As `Session.undo`; on the recording itself, the last edit of it."""
        if super().undo_label is None and self._edits_hold(self.clock.now):
            return self._edit_again(self.edits.undo)
        return super().undo()

    def redo(self):
        """As `Session.redo`; on the recording itself, the last edit of it that was undone."""
        if super().redo_label is None and self._edits_hold(self.clock.now):
            return self._edit_again(self.edits.redo)
        return super().redo()

    def _edit_again(self, step):
        try:
            return step() is not None
        except ProblemsError as error:
            self._say("error", str(error))
            return False

    @property
    def undo_label(self):
        """As `Session.undo_label`; on the recording itself, of the last edit of it."""
        hold = self._edits_hold(self._after.time)
        return super().undo_label or (self.edits.undo_label if hold else None)

    @property
    def redo_label(self):
        """As `Session.redo_label`; on the recording itself, of the last edit of it that was undone."""
        hold = self._edits_hold(self._after.time)
        return super().redo_label or (self.edits.redo_label if hold else None)

    def close(self, keep=False):
        """As `Session.close`."""
        if self.edits is not None:
            self.edits.close()
        return super().close(keep)


def is_recording(path) -> bool:
    """Whether a file is a recording, by its name."""
    return str(path).lower().endswith(SUFFIX)


def open_recorded(path, state_folder=None) -> Session:
    """Open a recording at its first tick: what it knows can be scrubbed, what is done then begins a branch.

    The level is unpacked into the session's own folder; it is saved under another name.  The recording is only read.

    Raises
    ------
    RecordingError, ProblemsError
        When it cannot be read, or is not of a level.
    OSError
        When there is no place for its level.
    """
    run = open_recording(path)
    simulation = running.begin_again(run)
    unlike = running.unlike_recorded(run, simulation)
    recovery = None
    try:
        level, library = running.embedded_level(run)
        recovery = RecoveryFolder(Path(path).with_suffix(".tmj"), state_folder)
        unpack(run.assets, recovery.folder / RECORDED, run.path)
        branch = Branch.begun(MAIN, Beginning(level, library, run.header["seed"], run.header.get("agents")), simulation)
        branch.header, branch.assets = run.header, run.assets
        branch.take_over(run, simulation.world, KEYFRAME_BYTES // 2)
        branch.differs = 0 if unlike else None
        timeline = Timeline.resumed({MAIN: branch}, MAIN, recovery.folder, sample_of, at=0)
    except WentWrong as error:
        if recovery is not None:
            recovery.close()
        raise RecordingError(f"{path}: {error}") from None
    except BaseException:
        if recovery is not None:
            recovery.close()
        raise
    finally:
        simulation.close()
    home = recovery.folder / RECORDED / run.header["level"]
    session = RecordedSession(home, timeline, recovery, [SessionNotice("info", _opening_notice(run))])
    session.lent, session.library, session.recording = True, library, Path(path)
    session._file = LevelFile(home, level.files[level.path.name])
    session._edit()
    session.take_into_level(branch.done_by_hand())
    session.show_edits(run)
    if unlike:
        session._say("warning", unlike)
    return session


def recovered(left, state_folder=None) -> Session:
    """Go on where a crash ended a session, of a level or of a recording, as `Session.recover`."""
    kind = Session if left.recording is None else RecordedSession
    return kind.recover(left, state_folder)


def unpack(assets, folder, source):
    """Write the files that a recording embeds below a folder, which becomes a project of its own.

    Raises
    ------
    RecordingError
        When a name leads out of the folder.
    """
    for name, data in assets.items():
        parts = PurePosixPath(name).parts
        if not parts or name.startswith("/") or ".." in parts or "\\" in name or ":" in name or "\0" in name:
            raise RecordingError(f"{source}: contains a file {name!r} outside its folder")
        to = folder.joinpath(*parts)
        to.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(to, data)
    if not (folder / PROJECT_FILE).exists():  # levels may use what lies above their own folder
        write_bytes(folder / PROJECT_FILE, b"{}")


def _opening_notice(run):
    seconds = run.last_tick * run.header["dt"]
    text = f"recording {Path(run.path).name}: {seconds:g} s. Drag in the time bar"
    text = f"{text}; a change before its end starts a branch. Press D to edit recorded animals for exports"
    return f"{text}. {run.notice}" if run.notice else text
