"""The folder of a report: whether it can be made, and making it."""

from __future__ import annotations

import os

from flockbrush.engine.files import WAIT, holder, refused


def folder_problems(folder) -> list:
    """What stands in the way of writing a report there."""
    busy = holder(folder)
    if busy:
        return refused(folder, f"{busy}; {WAIT}").problems
    if folder.is_dir():
        return []
    if folder.exists():
        return refused(folder, "is a file; a report needs a folder").problems
    if folder.parent.is_dir() and not os.access(folder.parent, os.W_OK):
        return refused(folder, f"the folder {str(folder.parent)!r} is not writable").problems
    if not folder.parent.is_dir():
        return refused(folder, f"there is no folder {str(folder.parent)!r} to create it in").problems
    return []


def make_folder(folder) -> None:
    """Make it; ProblemsError when that fails."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise refused(folder, f"cannot be created: {error.strerror}") from None
