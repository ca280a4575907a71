"""Recovery of the unsaved changes of crashed sessions.

A session that runs has a folder of its own among the user's files: its recordings, the journals of its edits, and a
note that says of which level.  The folder goes when the session ends well.  One whose session runs no more was left by
a crash; `session_folders` says what may become of it.
"""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from flockbrush.behaviours.validation import validated
from flockbrush.engine import limits
from flockbrush.engine.files import clear_leftovers, write_bytes
from flockbrush.engine.locks import Lock
from flockbrush.engine.plain_json import json_lines
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError, open_recording
from flockbrush.runs import run as running
from flockbrush.studio import session_folders as folders
from flockbrush.studio.branches import Beginning, Branch, plain_name
from flockbrush.studio.session_folders import DAMAGED, LOCK, NOTE, TRASH, state_folder
from flockbrush.studio.timeline import KEYFRAME_BYTES


class RecoveryFolder:
    """The folder of a running session, from which it can be recovered after a crash.

    Parameters
    ----------
    level : path
        The level that is open; the attribute ``recording`` is the recording that it was unpacked from, if it was.
    root : path, optional
        Where the folders of all sessions are; `state_folder` by default.

    Raises
    ------
    OSError
        When it cannot be made.
    """

    def __init__(self, level, root=None):
        self.level = Path(os.path.abspath(level))
        self.recording: Path | None = None
        root = state_folder() if root is None else Path(root)
        root.mkdir(parents=True, exist_ok=True)
        stem = f"{plain_name(self.level.stem)}-{os.getpid()}"
        for number in range(1, 1000):
            self.folder = root / f"{stem}-{number}"
            with contextlib.suppress(FileExistsError):
                self.folder.mkdir()
                break
        self._lock = Lock(self.folder / LOCK)

    def note(self, current, branches, brushes=(), programs=()):
        """Say which branches there are, where their files lie, and which changed brushes and programs are in no file.

        Parameters
        ----------
        current : str
        branches : dict of str to dict
            ``recording`` and ``journal`` (paths or None), ``parent`` and ``left``.
        brushes, programs : sequence of str
        """
        entries = {"level": str(self.level), "current": current, "branches": branches}
        entries["recording"] = self.recording and os.path.abspath(self.recording)
        entries |= {"brushes": list(brushes), "programs": list(programs)}
        write_bytes(self.folder / NOTE, json.dumps(entries, default=str, indent=1).encode())

    def close(self, keep=False, unsaved=False):
        """The session has ended.

        Parameters
        ----------
        keep : bool
            Keep what it leaves for next time.
        unsaved : bool
            There is unsaved work, which goes to the trash instead of being removed.
        """
        if not keep and not unsaved:
            folders.remove(self.folder, self._lock)
            return
        self._lock.release()
        if not keep:
            with contextlib.suppress(OSError):
                folders.set_aside(self.folder, TRASH)


class Damaged(Exception):
    """A `session.json` that cannot be read."""


class BranchFiles(BaseModel):
    """The entry of a branch in `session.json`."""

    model_config = ConfigDict(extra="ignore", strict=True)

    recording: str | None
    journal: str | None
    parent: str = ""
    left: int = 0


class SessionNote(BaseModel):
    """The contents of `session.json`."""

    model_config = ConfigDict(extra="ignore", strict=True)

    level: str
    current: str
    branches: dict[str, BranchFiles]
    recording: str | None = None
    brushes: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()


@dataclass(frozen=True)
class Leftover:
    """A session that a crash ended."""

    folder: Path
    level: Path
    current: str
    branches: dict[str, BranchFiles]
    time: float  # s since 1970, of the last thing written
    recording: Path | None = None  # that was open
    # that were changed, which no saved level holds
    brushes: tuple[str, ...] = ()
    programs: tuple[str, ...] = ()

    def __str__(self):
        when = datetime.datetime.fromtimestamp(self.time).strftime("%d %B, %H:%M")
        return f"{(self.recording or self.level).name}, {when}"

    @property
    def unsaved(self):
        """Whether something was done in it that no file has; who only looked on has lost nothing."""
        journals = {Path(files.journal) for files in self.branches.values() if files.journal}
        journals |= set(self.folder.glob("*.journal"))
        return bool(self.brushes or self.programs) or any(map(_is_unsaved, journals))

    def discard(self):
        """Move it to the trash."""
        with contextlib.suppress(OSError):
            Lock(self.folder / LOCK).release()  # earlier versions left it without our marker
            folders.set_aside(self.folder, TRASH)


def leftovers(level=None, root=None, tell: Callable[[str], object] = lambda text: None) -> list[Leftover]:
    """What crashes left, of one level or recording or of all, the latest first.

    What has no unsaved work and no note goes to the trash; what is damaged is set aside, and ``tell`` is told.
    """
    if root is None and (early := folders.early_sessions()):
        names = ", ".join(folder.name for folder in early[:5])
        to = state_folder()
        tell(f"{early[0].parent} has sessions of an older version ({names}); to recover them, move them to {to}")
    root = state_folder() if root is None else Path(root)
    folders.empty_trash(root)
    try:
        ended = folders.session_folders(root)
    except OSError as error:
        tell(f"{root}: cannot be searched for unsaved changes: {error.strerror}")
        return []
    sessions = [left for folder in ended if (left := _leftover(folder, tell)) is not None]
    if level is not None:
        sessions = [left for left in sessions if Path(os.path.abspath(level)) in (left.level, left.recording)]
    return sorted(sessions, key=lambda left: left.time, reverse=True)


def _leftover(folder, tell):
    """The leftover in a folder, None when there is nothing in it that one could go on with."""
    try:
        left = _read_note(folder)
    except Damaged as error:
        return _keep_damaged(folder, error, tell)
    if left is None and any(map(_is_unsaved, folder.glob("*.journal"))):
        why = "names no existing file" if (folder / NOTE).exists() else "is missing"
        return _keep_damaged(folder, why, tell)
    if left is None:
        with contextlib.suppress(OSError):
            folders.set_aside(folder, TRASH)
    else:
        clear_leftovers(folder)
    return left


def _keep_damaged(folder, reason, tell):
    """Set a session aside whose note is no use; folders of others stay where they are."""
    if not folders.is_ours(folder):
        return
    with contextlib.suppress(OSError):
        to = folders.set_aside(folder, DAMAGED)
        if to is not None:
            tell(f"{folder / NOTE} {reason}; this session is kept in {to}: flockbrush replay opens its recordings")


def _read_note(folder):
    """The leftover in a folder; None when it has no note, or its files are gone.

    Raises
    ------
    Damaged
    """
    try:
        with open(folder / NOTE, "rb") as file:
            data = json.loads(file.read(limits.SESSION_BYTES))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise Damaged(f"cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise Damaged(f"is damaged (invalid JSON: {str(error)[:100]})") from None
    note, mistakes = validated(SessionNote, data) if isinstance(data, dict) else (None, [((), "must be a table")])
    if note is None:
        (key, message), *_ = mistakes
        raise Damaged(f"is damaged ({'.'.join(map(str, key)) or 'note'}: {message})")
    branches = {name: _with_places(files, folder) for name, files in note.branches.items()}
    times = [_written(path) for files in branches.values() for path in (files.recording, files.journal) if path]
    if not any(times):
        return None
    recording = None if note.recording is None else Path(note.recording)
    changed = note.brushes, note.programs
    return Leftover(folder, Path(note.level), note.current, branches, max(times), recording, *changed)


def _with_places(files, folder):
    """The files of a branch where they are now: the folder may have been moved."""
    places = {}
    for kind in ("recording", "journal"):
        path = getattr(files, kind)
        own_path = folder / Path(path).name if path else None
        places[kind] = str(own_path) if own_path is not None and not _written(path) and _written(own_path) else path
    return files.model_copy(update=places)


def _written(path):
    """When an ordinary file was last written, s since 1970; 0 when there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return 0.0
    return status.st_mtime if stat.S_ISREG(status.st_mode) else 0.0


def _is_unsaved(journal):
    """Whether a journal goes on after the last time the level was saved."""
    try:
        unsaved = False
        for line in json_lines(journal):
            event = str(line["event"])
            unsaved = event != "save" and (unsaved or event in ("do", "undo", "redo"))
    except FileNotFoundError:
        return False
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return True  # who knows
    return unsaved


def recovered_branches(left: Leftover):
    """{name: Branch} of all recordings that can be read, the current one among them.

    Raises
    ------
    RecordingError, ProblemsError
        When the current one cannot be.
    """
    branches: dict[str, Branch] = {}
    for name, files in left.branches.items():
        try:
            branches[name] = _branch_of(name, files, branches)
        except (RecordingError, ProblemsError):
            if name == left.current:
                raise
    if left.current not in branches:
        raise RecordingError(f"{left.folder}: {left.current} cannot be read any more")
    return branches


def _branch_of(name, files, known):
    """A branch as its recording has it."""
    if files.recording is None:
        edits = f"; its edits are in {files.journal}" if files.journal else ""
        raise RecordingError(f"there is no recording of {name}{edits}")
    run = open_recording(files.recording)
    beginning = next((b.beginning for b in known.values() if _same_beginning(b, run)), None)
    if beginning is None:
        level, library = running.embedded_level(run)
        beginning = Beginning(level, library, run.header["seed"], run.header.get("agents"))
    simulation = running.begin_again(run)
    try:
        branch = Branch.begun(name, beginning, simulation)
        branch.take_over(run, simulation.world, KEYFRAME_BYTES // 2)
    finally:
        simulation.close()
    branch.header, branch.assets = run.header, run.assets
    branch.parent, branch.left = files.parent, files.left
    return branch


def _same_beginning(branch, run):
    names = ("seed", "agents", "level")
    return branch.assets == run.assets and all(branch.header.get(n) == run.header.get(n) for n in names)
