"""What a crash leaves behind, and how to go on from there.

A session that runs has a folder of its own among the user's files: its recording, the journal of its edits, and a note
that says of which level.  It goes when the session ends well.  A folder whose session runs no more was left by a crash.
"""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from behaviours.brush_writer import write_atomically
from behaviours.problems import ProblemsError
from engine.recording import RecordingError, open_recording
from flockbrush import run as running
from flockbrush.play.timeline import Beginning, Branch, plain_name

NOTE, LOCK = "session.json", "lock"
YOUNG = 60  # s; a session that begins has said nothing yet
OLD = 60 * 86400  # s; what nobody wanted back for so long goes


def state_folder() -> Path:
    """The folder for what sessions keep of this user, as the operating system wishes it; it need not be there yet."""
    own = os.environ.get("FLOCKBRUSH_STATE")
    if own:
        return Path(own)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "flockbrush" / "sessions"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "flockbrush" / "sessions"
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "flockbrush" / "sessions"


class Shelter:
    """The folder of a running session.

    Parameters
    ----------
    level : path
        The level that is open.
    root : path, optional
        Where the folders of all sessions are; `state_folder` unless told.

    Raises
    ------
    OSError
        When it cannot be made.
    """

    def __init__(self, level, root=None):
        self.level = Path(os.path.abspath(level))
        root = state_folder() if root is None else Path(root)
        root.mkdir(parents=True, exist_ok=True)
        stem = f"{plain_name(self.level.stem)}-{os.getpid()}"
        for number in range(1, 1000):
            self.folder = root / f"{stem}-{number}"
            with contextlib.suppress(FileExistsError):
                self.folder.mkdir()
                break
        self._lock = open(self.folder / LOCK, "wb")
        _lock(self._lock)

    def note(self, current, branches):
        """Say which branches there are and where their files lie.

        Parameters
        ----------
        current : str
        branches : dict of str to dict
            ``recording`` and ``journal`` (paths or None), ``parent`` and ``left``.
        """
        said = {"level": str(self.level), "current": current, "branches": branches}
        write_atomically(self.folder / NOTE, json.dumps(said, default=str, indent=1).encode(), overwrite=True)

    def close(self, keep=False):
        """The session has ended; what it leaves goes, unless it is to be kept for next time."""
        self._lock.close()
        if not keep:
            shutil.rmtree(self.folder, ignore_errors=True)


@dataclass(frozen=True)
class Leftover:
    """A session that a crash ended."""

    folder: Path
    level: Path
    current: str
    branches: dict
    time: float  # s since 1970, of the last thing written

    def __str__(self):
        when = datetime.datetime.fromtimestamp(self.time).strftime("%d %B, %H:%M")
        return f"{self.level.name}, {when}"

    @property
    def unsaved(self):
        """Whether something was done in it that no level file has; who only looked on has lost nothing."""
        journals = [files.get("journal") for files in self.branches.values()]
        return any(_is_unsaved(journal) for journal in journals if journal)

    def discard(self):
        """Forget it for good."""
        shutil.rmtree(self.folder, ignore_errors=True)


def leftovers(level=None, root=None) -> list[Leftover]:
    """What crashes left, of one level or of all, the latest first.  What is very old, or of no use, is cleared away."""
    root = state_folder() if root is None else Path(root)
    found = []
    for folder in sorted(root.iterdir()) if root.is_dir() else []:
        if not folder.is_dir() or _is_running(folder):
            continue
        left = _read_note(folder)
        if left is None or left.time < time.time() - OLD:
            if folder.stat().st_mtime < time.time() - YOUNG:
                shutil.rmtree(folder, ignore_errors=True)
        elif level is None or left.level == Path(os.path.abspath(level)):
            found.append(left)
    return sorted(found, key=lambda left: left.time, reverse=True)


def _read_note(folder):
    """The leftover in a folder; None when there is nothing to recover in it."""
    try:
        said = json.loads((folder / NOTE).read_bytes())
        branches = {str(name): dict(files) for name, files in said["branches"].items()}
        paths = [path for files in branches.values() for path in (files["recording"], files["journal"]) if path]
        when = max(os.stat(path).st_mtime for path in paths if os.path.exists(path))
        return Leftover(folder, Path(said["level"]), str(said["current"]), branches, when)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _is_unsaved(journal):
    """Whether a journal goes on after the last time the level was saved."""
    try:
        lines = Path(journal).read_text(encoding="utf-8").split("\n")[:-1]
        events = [json.loads(line)["event"] for line in lines]
    except FileNotFoundError:
        return False
    except (OSError, ValueError, LookupError, TypeError):
        return True  # who knows
    after = events[len(events) - events[::-1].index("save") :] if "save" in events else events
    return bool({"do", "undo", "redo"} & set(after))


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
        except (RecordingError, ProblemsError, KeyError, TypeError):
            if name == left.current:
                raise
    if left.current not in branches:
        raise RecordingError(f"{left.folder}: nothing is left of {left.current}")
    return branches


def _branch_of(name, files, known):
    """A branch as its recording has it."""
    run = open_recording(files["recording"])
    beginning = next((b.beginning for b in known.values() if _same_beginning(b, run)), None)
    if beginning is None:
        level, library = running.embedded_level(run)
        beginning = Beginning(level, library, run.header["seed"], run.header.get("agents"))
    simulation = running.rebuild(run)
    try:
        branch = Branch.begun(name, beginning, simulation)
    finally:
        simulation.close()
    branch.header, branch.assets = run.header, run.assets
    branch.take_over(run)
    branch.parent, branch.left = str(files.get("parent") or ""), int(files.get("left") or 0)
    return branch


def _same_beginning(branch, run):
    names = ("seed", "agents", "level")
    return branch.assets == run.assets and all(branch.header.get(n) == run.header.get(n) for n in names)


# locks --------------------------------------------------------------------------


def _lock(file):
    """Hold a file as long as this process lives; OSError when another one does."""
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        return
    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_running(folder):
    """Whether a process holds the lock of this folder."""
    try:
        with open(folder / LOCK, "r+b") as file:
            _lock(file)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return False
