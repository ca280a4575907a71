"""Error reports about files: all problems at once, each with file, line and key."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable

from flockbrush.engine.plain_text import one_line

SHOWN = 50  # problems printed at once; a file with more has one cause, not fifty
LONGEST = 1200  # letters of each part of a problem
LISTED = 12  # names listed when none is near


@dataclasses.dataclass(frozen=True)
class Problem:
    """One error, with what would be right.

    Parameters
    ----------
    file : str
        The file as the user named it.
    line : int or None
        Counted from 1; None when no line is to blame.
    where : str or None
        The key, layer or object, for example ``speed.mean``.
    message : str
        What is wrong; what would be right.
    """

    file: str
    line: int | None
    where: str | None
    message: str

    def __str__(self):
        place = one_line(self.file) if self.line is None else f"{one_line(self.file)}:{self.line}"
        return ": ".join(_shortened(part) for part in (place, one_line(self.where or ""), self.message) if part)


def _shortened(text: str) -> str:
    """A text without its middle, where it is longer than anybody reads."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 2 :]}"


class ProblemsError(Exception):
    """All problems of an input; ``str()`` has one problem per line."""

    def __init__(self, problems: Iterable[Problem]):
        self.problems = list(dict.fromkeys(problems))  # each problem once
        super().__init__(self.problems)

    def __str__(self):
        lines = [str(problem) for problem in self.problems[:SHOWN]]
        more = len(self.problems) - SHOWN
        return "\n".join(lines + ([f"... and {more} more problems"] if more > 0 else []))


def did_you_mean(word: str, candidates: Iterable[str]) -> str:
    """The end of a sentence about an unknown name: the nearest name, or the names there are.

    Examples
    --------
    >>> did_you_mean("seperate", ["separate", "align"])
    "; did you mean 'separate'?"
    >>> did_you_mean("fly", ["walk", "swim"])
    '; available: swim, walk'
    """
    names = sorted(set(candidates))
    near = _nearest(word, names)
    if near:
        return f"; did you mean '{near}'?"
    if not names:
        return "; available: none"
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"; available: {', '.join(names[:LISTED])}{more}"


def _nearest(word: str, names: list[str]) -> str | None:
    if len(word) > 64:  # difflib takes quadratic time
        return None
    lowered = {name.lower().replace("_", "-"): name for name in names}
    near = difflib.get_close_matches(word.lower().replace("_", "-"), lowered, n=1, cutoff=0.7)
    return lowered[near[0]] if near else None
