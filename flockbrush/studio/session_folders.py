"""Folders of sessions: finding, moving and removing them.

    flockbrush/sessions/LEVEL-PROCESS-N/    a session that runs, or one that a crash ended
    flockbrush/sessions/damaged/            what could not be read; never removed
    flockbrush/sessions/trash/              what a person discarded, or what had no unsaved work; removed after 30 days

Only a folder that has such a name and a lock file of ours is ever touched.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import time
from pathlib import Path

from flockbrush.engine.files import clear_leftovers
from flockbrush.engine.locks import abandoned, is_held, is_marked
from flockbrush.studio.settings import user_folder

NOTE, LOCK = "session.json", "lock"
RECORDED = "recorded"  # the files of a recording that is open, unpacked; a session owns all that is in it
TRASH, DAMAGED = "trash", "damaged"
KEPT = 30 * 86400  # s that a folder stays in the trash
LARGEST_TRASH = 2 << 30  # bytes; beyond, the oldest folders go sooner
OURS = (".flock", ".journal")  # endings of the files that a session writes, besides the note and the lock
_NAME = re.compile(r".+-\d+-\d+")


def state_folder() -> Path:
    """The folder for the sessions of this user, as the operating system wishes it; it need not be there yet."""
    own = os.environ.get("FLOCKBRUSH_STATE")
    base = Path(own) / "flockbrush" if own else user_folder("LOCALAPPDATA", "XDG_STATE_HOME", ".local/state")
    return base / "sessions"


def early_sessions() -> list[Path]:
    """Folders of sessions of an early version, which lie in $FLOCKBRUSH_STATE itself and are not looked at there."""
    own = os.environ.get("FLOCKBRUSH_STATE")
    try:
        folders = _folders_in(own) if own else []
    except OSError:
        return []
    return [folder for folder in folders if _NAME.fullmatch(folder.name) and (folder / NOTE).is_file()]


def _folders_in(root):
    return sorted(Path(entry.path) for entry in os.scandir(root) if entry.is_dir(follow_symlinks=False))


def session_folders(root):
    """Folders whose name is that of a session, and in which no session runs; OSError when they cannot be listed."""
    if not Path(root).is_dir():
        return []
    return [folder for folder in _folders_in(root) if _NAME.fullmatch(folder.name) and not is_held(folder / LOCK)]


def is_ours(folder) -> bool:
    """Whether this folder was made by a session."""
    folder = Path(folder)
    real = folder.is_dir() and not folder.is_symlink()
    return real and bool(_NAME.fullmatch(folder.name)) and is_marked(folder / LOCK)


def set_aside(folder, name) -> Path | None:
    """Move the folder of an ended session into `TRASH` or `DAMAGED` beside it; its new place, None if it stays.

    Raises
    ------
    OSError
        When it cannot be moved.
    """
    folder = Path(folder)
    lock = abandoned(folder / LOCK) if is_ours(folder) else None
    if lock is None:
        return None
    os.utime(folder)  # since when it lies there
    lock.release()
    place = folder.parent / name
    place.mkdir(exist_ok=True)
    stem, number = folder.name.rsplit("-", 1)
    for k in range(int(number), int(number) + 10_000):
        to = place / f"{stem}-{k}"
        if not to.exists():
            os.rename(folder, to)
            return to
    return None


def remove(folder, lock):
    """Remove what a session wrote, its lock, which must be ours, last, and its folder if nothing else is in it."""
    folder = Path(folder)
    if not is_ours(folder):
        return
    clear_leftovers(folder)
    shutil.rmtree(folder / RECORDED, ignore_errors=True)  # no links are followed
    for entry in _written_by_us(folder):
        with contextlib.suppress(OSError):
            os.unlink(entry.path)
    if (folder / RECORDED).is_dir() or _written_by_us(folder):
        lock.release()  # next time
    else:
        lock.remove()
    with contextlib.suppress(OSError):
        folder.rmdir()


def _written_by_us(folder):
    """The files in a session's folder that a session wrote, besides the lock."""
    files = (entry for entry in os.scandir(folder) if entry.is_file(follow_symlinks=False))
    return [entry for entry in files if entry.name == NOTE or entry.name.endswith(OURS)]


def _size(folder):
    """Bytes of all files in a folder and below it."""
    return sum(os.lstat(os.path.join(where, name)).st_size for where, _, names in os.walk(folder) for name in names)


def empty_trash(root):
    """Remove what has been in the trash for `KEPT` seconds, and the oldest of what is too much."""
    try:
        folders = [folder for folder in session_folders(Path(root) / TRASH) if is_ours(folder)]
        aged = sorted(((folder.stat().st_mtime, folder) for folder in folders), reverse=True)
        room = LARGEST_TRASH
        for when, folder in aged:
            room -= _size(folder)
            if room < 0 or when < time.time() - KEPT:
                lock = abandoned(folder / LOCK)
                if lock is not None:
                    remove(folder, lock)
    except OSError:
        return  # next time
