"""The folder of a report: what it holds, whether it can be made, and making it."""

from __future__ import annotations

import os

from flockbrush.engine.files import WAIT, foreign_problems, holder, refused
from flockbrush.learning.html_page import is_report

PAGE, FIGURES = "report.html", "figures.json"
OWN = "order", "errors", "crowd", "neighbours", "parameters", "loss"  # pictures of a report, besides its moments
MOMENTS = tuple(f"moment-{k}" for k in range(1, 10))


def folder_problems(folder, parts=()) -> list:
    """What stands in the way of writing a report there, and reports of its parts in folders of these names within."""
    busy = holder(folder)
    if busy:
        return refused(folder, f"{busy}; {WAIT}").problems
    if folder.is_dir():
        names = PAGE, FIGURES, *(f"{name}.png" for name in (*OWN, *MOMENTS))
        found = [] if is_report(folder / PAGE) else foreign_problems(folder / name for name in names)
        return found + [p for part in parts if (folder / part).exists() for p in folder_problems(folder / part)]
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
