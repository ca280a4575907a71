"""A session opened from a recording: its level is unpacked, and its run is known from the first to the last tick."""

from __future__ import annotations

from pathlib import Path, PurePosixPath

from flockbrush.engine.files import write_bytes
from flockbrush.engine.recording import RecordingError, open_recording
from flockbrush.runs import run as running
from flockbrush.studio.branches import Beginning, Branch
from flockbrush.studio.gauges import sample_of
from flockbrush.studio.recovery import Shelter
from flockbrush.studio.session import Session
from flockbrush.studio.session_files import LevelFile, SessionNotice
from flockbrush.studio.timeline import KEYFRAME_BYTES, Timeline, WentWrong

SUFFIX = ".flock"
FOLDER = "recorded"  # in the folder of the session


class RecordedSession(Session):
    """A session whose level was unpacked into its own folder."""

    unpacked: tuple[Path, ...] = ()

    def close(self, keep=False):
        """As `Session.close`; the files that were unpacked go, unless unsaved work needs them."""
        if not keep and not self.dirty:
            for file in self.unpacked:
                file.unlink(missing_ok=True)
                remove_empty(file.parent, self._shelter.folder)
        return super().close(keep)


def remove_empty(folder, below):
    """Remove a folder and those around it, as long as they are empty and below another one."""
    while folder != below and below in folder.parents:
        try:
            folder.rmdir()
        except OSError:
            return
        folder = folder.parent


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
    simulation = running.rebuild(run)
    shelter = None
    try:
        level, library = running.embedded_level(run)
        shelter = Shelter(Path(path).with_suffix(".tmj"), state_folder)
        files = unpacked(run, shelter.folder / FOLDER)
        branch = Branch.begun(
            "main", Beginning(level, library, run.header["seed"], run.header.get("agents")), simulation
        )
        branch.header, branch.assets = run.header, run.assets
        branch.take_over(run, simulation.world, KEYFRAME_BYTES // 2)
        timeline = Timeline.resumed({"main": branch}, "main", shelter.folder, sample_of, at=0)
    except WentWrong as error:
        if shelter is not None:
            shelter.close()
        raise RecordingError(f"{path}: {error}") from None
    except BaseException:
        if shelter is not None:
            shelter.close()
        raise
    finally:
        simulation.close()
    home = shelter.folder / FOLDER / run.header["level"]
    session = RecordedSession(home, timeline, shelter, [SessionNotice("info", _told(run))])
    session.lent, session.library, session.unpacked = True, library, files
    session._file = LevelFile(home, level.files[level.path.name])
    session._edit()
    return session


def unpacked(run, folder) -> tuple[Path, ...]:
    """Write the files that a recording embeds below a folder; their paths.

    Raises
    ------
    RecordingError
        When a name leads out of the folder.
    """
    files = []
    for name, data in run.assets.items():
        parts = PurePosixPath(name).parts
        if not parts or name.startswith("/") or ".." in parts or "\\" in name or ":" in name or "\0" in name:
            raise RecordingError(f"{run.path}: contains a file {name!r} outside its folder")
        to = folder.joinpath(*parts)
        to.parent.mkdir(parents=True, exist_ok=True)
        files.append(write_bytes(to, data))
    return tuple(files)


def _told(run):
    seconds = run.last_tick * run.header["dt"]
    text = f"recording {Path(run.path).name}: {seconds:g} s. Drag in the time bar; a change starts a branch"
    return f"{text}. {run.notice}" if run.notice else text
