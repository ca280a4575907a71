"""Files we write: whole or not at all, and refused before the work begins rather than after."""

from __future__ import annotations

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path

from behaviours.problems import Problem, ProblemsError


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
    problems, seen = [], {}
    read = {os.path.realpath(path): path for path in inputs}
    for path in map(Path, paths):
        real = os.path.realpath(path)
        message = _obstacle(path)
        if message is None and real in read:
            message = "is what is read from; choose another name"
        if message is None and real in seen:
            message = "is named twice; each output needs its own file"
        seen[real] = path
        if message:
            problems.append(Problem(str(path), None, None, message))
    return problems


def _obstacle(path):
    """Why nothing can be written here, or None."""
    folder = path.parent
    if path.is_dir():
        return "this is a folder; name a file"
    if not folder.is_dir():
        return f"there is no folder {str(folder)!r}"
    if path.exists() and not path.is_file():
        return "is not an ordinary file"
    if not os.access(folder, os.W_OK):
        return f"the folder {str(folder)!r} may not be written to"
    return None


@contextmanager
def whole(path):
    """A temporary name beside ``path``, with its ending, that takes the name's place when all went well.

    When the body raises, the temporary file is removed and what was at ``path`` stays.
    """
    path = Path(path)
    temporary = temporary_beside(path)
    try:
        yield temporary
        publish(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def temporary_beside(path) -> Path:
    """A new empty file in the same folder with the same ending."""
    path = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.stem[:40]}.", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise refused(path, f"cannot be written: {error.strerror or error}") from None
    os.close(handle)
    return Path(name)


def publish(temporary, path):
    """Give a finished temporary file its name, and the rights a new file would have."""
    if os.name == "posix":
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
    os.replace(temporary, path)


def write_text(path, text: str):
    """Write a text file, whole or not at all."""
    with whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
