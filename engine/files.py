"""Files are written whole or not at all, by one program at a time, and refused before the work begins, not after it.

A file that is being written lies in a hidden work folder beside its name, with a lock (`engine.locks`) that ends with
the program.  Whoever writes into the same folder next can therefore tell work that goes on from what a killed program
left, and removes the latter.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from contextlib import ExitStack, contextmanager
from pathlib import Path

from flockbrush.engine.locks import InUse, Lock, abandoned, holder_of, is_held, is_marked
from flockbrush.engine.problems import Problem, ProblemsError

LOCK = "lock"
LONGEST_NAME = 200  # bytes of a file name that a work folder repeats; systems allow 255
TAKEN = "already exists; choose another name or allow overwriting"
FOREIGN = "would be replaced, but was not written by Flockbrush; move or rename it, or choose another folder"
WAIT = "wait until it has ended, or choose another file"
_OF_DISKS = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
_WORK = re.compile(r"\..+\.flockbrush", re.DOTALL)
_cleared: set[str] = set()  # folders in which this process has removed leftovers


class NotWritten(ProblemsError, OSError):
    """A file that cannot be written; ``errno`` and ``filename`` as of any `OSError`."""

    def __init__(self, path, message, number=None):
        super().__init__([Problem(str(path), None, None, message)])
        self.errno, self.strerror, self.filename = number, message, str(path)


def refused(path, message) -> ProblemsError:
    """The error that says one thing about one file."""
    return ProblemsError([Problem(str(path), None, None, message)])


def output_problems(paths, inputs=()):
    """What keeps files from being written, known before a long run begins.

    Parameters
    ----------
    paths : iterable of path
        What will be written.
    inputs : iterable of path
        What is read meanwhile: writing there would destroy it.

    Returns
    -------
    list of Problem
    """
    problems, first_use = [], {}
    read = {os.path.realpath(path): path for path in inputs}
    for path in map(Path, paths):
        real = os.path.realpath(path)
        message = _obstacle(path)
        if message is None and real in read:
            message = "is also an input file; choose another name"
        if message is None and real in first_use:
            message = "would be written twice; each output needs its own name"
        first_use[real] = path
        if message:
            problems.append(Problem(str(path), None, None, message))
    return problems


def _obstacle(path):
    """Why nothing can be written here, or None."""
    folder = path.parent
    if path.is_dir():
        return "is a folder; give a file name"
    if not folder.is_dir():
        return f"there is no folder {str(folder)!r}"
    if path.exists() and not path.is_file():
        return "is not a regular file"
    if not os.access(folder, os.W_OK):
        return f"the folder {str(folder)!r} is not writable"
    busy = holder(path)
    return f"{busy}; {WAIT}" if busy else None


def refuse_foreign(paths, is_ours):
    """Refuse to write generated files over those of somebody else, before the first is written.

    Parameters
    ----------
    paths : iterable of path
        What will be written, under names that nobody chose for it.
    is_ours : function (path) -> bool
        Whether a file that is there is recognisably one that was generated before.

    Raises
    ------
    ProblemsError
        With every file that is not.
    """
    if problems := foreign_problems(path for path in map(Path, paths) if not is_ours(path)):
        raise ProblemsError(problems)


def foreign_problems(paths) -> list[Problem]:
    """A problem for each of these paths that is taken, by a file that is not ours."""
    return [Problem(str(path), None, None, FOREIGN) for path in paths if os.path.lexists(path)]


class Work:
    """A hidden folder in which a file is written before it takes its name.

    Parameters
    ----------
    path : path
        The name that the file will have.
    alone : bool
        Nobody else may do the same until `close`.

    Raises
    ------
    NotWritten
        When nothing can be written there, or when it should be alone and another program writes this file.
    """

    def __init__(self, path, alone=False):
        self.path = Path(path)
        with _refusing(self.path):
            if not self.path.parent.is_dir():
                raise FileNotFoundError(errno.ENOENT, f"there is no folder {str(self.path.parent)!r}")
            _clear_once(self.path.parent, again=alone)
            self.folder = work_folder(self.path, "" if alone else secrets.token_hex(4))
            self._lock = self._begin()
        self.new = self.folder / f"new{self.path.suffix}"  # where to write, with the ending of ``path``

    def _begin(self):
        while True:
            self.folder.mkdir(mode=0o700, exist_ok=True)
            try:
                return Lock(self.folder / LOCK)
            except FileNotFoundError:  # just removed by its former owner
                continue
            except OSError:
                with contextlib.suppress(OSError):
                    self.folder.rmdir()
                raise

    def naming(self):
        """A context in which errors of this work name the file that was asked for: NotWritten."""
        return _refusing(self.path, self.folder)

    def publish(self, overwrite=True):
        """Give the finished file its name, for good: it survives a power cut too.

        Raises
        ------
        NotWritten
            When it cannot have the name, or the name is taken and must not be overwritten; what has it keeps it.
        """
        with _refusing(self.path):
            with open(self.new, "r+b") as file:
                os.fsync(file.fileno())
            if overwrite:
                with contextlib.suppress(FileNotFoundError):
                    os.chmod(self.new, stat.S_IMODE(os.stat(self.path).st_mode) & 0o777)
                os.replace(self.new, self.path)
            else:
                _claim(self.new, self.path)
            _sync_folder(self.path.parent)

    def close(self):
        """Remove the work folder, and what was not published."""
        if not self._lock.file.closed:
            _remove(self.folder, self._lock)


def hold(path) -> Work:
    """Keep others from writing a file until `Work.close`; see `Work`."""
    return Work(path, alone=True)


@contextmanager
def held(*paths):
    """Keep others from writing these files meanwhile; NotWritten when somebody does."""
    with ExitStack() as stack:
        for path in paths:
            stack.callback(hold(path).close)
        yield


def need_ending(path, *endings):
    """Refuse the name of an output that does not say what is in it; None is fine."""
    if path is not None and not str(path).lower().endswith(endings):
        raise refused(path, f"its name must end in {' or '.join(endings)}")


@contextmanager
def claimed(outputs, inputs=()):
    """Refuse outputs that cannot be written (see `output_problems`), then keep others from writing them meanwhile.

    For work that ends in `whole` or `write_text`: what holds its own file (recordings, films) needs no claim.
    """
    if problems := output_problems(outputs, inputs):
        raise ProblemsError(problems)
    with held(*outputs):
        yield


def holder(path) -> str:
    """A clause that says who is writing a file; "" when nobody is."""
    lock = work_folder(path) / LOCK
    return holder_of(lock) if is_marked(lock) and is_held(lock) else ""


@contextmanager
def whole(path, overwrite=True):
    """A path to write to, with the ending of ``path``, that takes its place when the body ends well.

    When the body raises, what was at ``path`` stays.

    Raises
    ------
    NotWritten
        When it cannot be written, or the name is taken and must not be overwritten.
    """
    work = Work(path)
    try:
        with work.naming():
            yield work.new
        work.publish(overwrite)
    finally:
        work.close()


def write_bytes(path, data, overwrite=True) -> Path:
    """Write a file, whole or not at all; NotWritten as `whole`."""
    with whole(path, overwrite) as new:
        new.write_bytes(data)
    return Path(path)


def write_text(path, text: str) -> Path:
    """Write a text file, whole or not at all; NotWritten as `whole`."""
    return write_bytes(path, text.encode())


def make_backup(path) -> Path | None:
    """Keep a file that is about to be replaced as ``NAME.bak``, too; where that is, None if there is no such file."""
    path = Path(path)
    if not path.is_file():
        return None
    beside = path.with_name(path.name + ".bak")
    with whole(beside) as new:
        try:
            os.link(path, new)
        except OSError:  # a disk without hard links, or another name for a file elsewhere
            shutil.copyfile(path, new)
    return beside


def free_path(path) -> Path:
    """The path, or the next one with a number in its name, at which there is no file."""
    path = Path(path)
    candidate, n = path, 2
    while candidate.exists():
        candidate, n = path.with_name(f"{path.stem}-{n}{path.suffix}"), n + 1
    return candidate


def sha256_of(path) -> str:
    """SHA-256 of a file, in hex."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def work_folder(path, token="") -> Path:
    """The hidden folder in which a file is written; without a token the one of its only writer."""
    path = Path(path)
    name = path.name
    if len(os.fsencode(name)) > LONGEST_NAME:
        name = hashlib.sha256(os.fsencode(name)).hexdigest()[:32]
    return path.with_name(".".join(["", name, *([token] if token else []), "flockbrush"]))


def _claim(new, path):
    """Put a file under a name that must be free."""
    try:
        os.link(new, path)  # fails when the name is taken, also by somebody just now
    except FileExistsError:
        raise NotWritten(path, TAKEN, errno.EEXIST) from None
    except OSError:  # a disk without hard links
        if path.exists():
            raise NotWritten(path, TAKEN, errno.EEXIST) from None
        os.replace(new, path)


def _sync_folder(folder):
    """The new name, too, is on the disk; folders cannot be opened everywhere."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def _refusing(path, of=None):
    """Errors of the system name the file that was asked for; with ``of``, only those of this work folder do."""
    try:
        yield
    except NotWritten as error:
        if of is None or not _is_of(error, of):
            raise
        raise NotWritten(path, error.strerror, error.errno) from error  # written inside the work folder
    except InUse as error:
        raise NotWritten(path, f"{error.strerror}; {WAIT}", error.errno) from None
    except OSError as error:
        if of is not None and not _is_of(error, of):
            raise
        known = error.errno in _OF_DISKS  # libraries have words of their own for these
        reason = os.strerror(error.errno) if known else error.strerror or " ".join(str(error).split())
        raise NotWritten(path, f"cannot be written: {reason}", error.errno) from error


def _is_of(error, folder):
    """Whether an error is about a file in this folder, or about a disk and no file at all."""
    if error.filename is None:
        return error.errno in _OF_DISKS
    return isinstance(error.filename, (str, os.PathLike)) and Path(error.filename).is_relative_to(folder)


def cache_folder() -> Path:
    """The user's folder for what can be made again: pictures of brushes, compiled kernels of an installed package."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home()) / "flockbrush"
    if sys.platform == "darwin":
        return home() / "Library" / "Caches" / "flockbrush"
    return Path(os.environ.get("XDG_CACHE_HOME") or home() / ".cache") / "flockbrush"


def home() -> Path:
    """The user's home; in a container whose user has none, `private_folder`, or a place where nothing can be made."""
    try:
        return Path.home()
    except RuntimeError:
        return private_folder() or Path(os.devnull) / "no home"


def private_folder() -> Path | None:
    """A private folder below the system's temporary folder; None if there can be none."""
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        place = Path(tempfile.gettempdir()) / f"flockbrush-{user}"
        place.mkdir(mode=0o700, exist_ok=True)
        status = os.lstat(place)
    except OSError:
        return None
    private = os.name != "posix" or (status.st_uid, status.st_mode & 0o077) == (user, 0)
    return place if stat.S_ISDIR(status.st_mode) and private else None


# what killed programs left --------------------------------------------------------------


def clear_leftovers(folder):
    """Remove the work folders of killed programs; what is in use, and what is not ours, stays."""
    try:
        leftovers = [Path(entry.path) for entry in os.scandir(folder) if _WORK.fullmatch(entry.name)]
    except OSError:
        return
    for path in leftovers:
        _clear(path)


def _clear_once(folder, again=False):
    where = os.path.abspath(folder)
    if again or where not in _cleared:
        _cleared.add(where)
        clear_leftovers(where)


def _clear(folder):
    """Remove one work folder, unless somebody works there."""
    if not _is_own(folder):
        return
    lock = abandoned(folder / LOCK)
    if lock is not None:
        _remove(folder, lock)
    with contextlib.suppress(OSError):  # one that is empty: a program was killed before it had begun
        folder.rmdir()


def _remove(folder, lock):
    """Remove a work folder whose lock is ours; what others put into it stays, and the folder then too."""
    for entry in list(os.scandir(folder)):
        with contextlib.suppress(OSError):
            if entry.is_dir(follow_symlinks=False):
                _clear(Path(entry.path))
            elif entry.name != LOCK:
                os.unlink(entry.path)
    lock.remove()
    with contextlib.suppress(OSError):
        folder.rmdir()


def _is_own(folder):
    """Whether this is a real folder, and of this user where the system knows users."""
    try:
        status = os.lstat(folder)
    except OSError:
        return False
    own = getattr(os, "getuid", lambda: status.st_uid)()
    return stat.S_ISDIR(status.st_mode) and status.st_uid == own
