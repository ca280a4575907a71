"""Read back the trajectory table of a run, with the names in it, and measure it as the run itself is measured."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.film.track_table import SCHEMA, beside, check_rate, rows_twice
from flockbrush.systems.groups import parts_of
from flockbrush.systems.measures import herd_measures

NUMBERS = "frame", "time", "id", "x", "y", "z", "vx", "vy", "vz", "heading"
NUMBERED = "group", "family"  # 0 where the cell is empty
LATER = "pitch", "length"
WORDS = "species", "brush", "state"
NOT_IN_ALL = {*LATER, "family", "state"}  # columns that older tables lack
WHOLE = "frame", "id", *NUMBERED
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class AboutRun(BaseModel):
    """What the metadata beside a table say of its run."""

    table: str = Field(alias="schema", pattern=f"^{SCHEMA}$")
    fps: Positive
    frames: Annotated[int, Field(ge=1, le=limits.TRACK_FRAMES)] | None = None  # also those without animals
    level: str
    width: float
    height: float
    boundary: str
    flying: list[str]  # brushes
    body_length: dict[str, Positive] = {}  # m, mean of a species, where the table has no lengths
    programs: dict[str, dict[str, str]]  # their states, and what they are called in the table


@dataclass(frozen=True)
class RunTable:
    """The rows of a table in order of frame; ``first[f]:first[f + 1]`` are those of a frame."""

    about: AboutRun
    first: np.ndarray  # (frames + 1,)
    numbers: dict[str, np.ndarray]
    words: dict[str, np.ndarray]

    def __len__(self):
        return len(self.first) - 1

    def time(self, frame):
        """Seconds of a frame."""
        return float(self.numbers["time"][0] + (frame - self.numbers["frame"][0]) / self.about.fps)

    @property
    def empty(self) -> int:
        """How many frames have no rows."""
        return int((np.diff(self.first) == 0).sum())

    def rows(self, frame):
        """The rows of a frame, which may be counted from the last one."""
        frame %= len(self)
        return np.arange(self.first[frame], self.first[frame + 1])

    def measures(self, rows):
        """The measures of these rows, of one frame (`flockbrush.systems.measures`)."""
        about, (x, y, z, u, v, w, heading) = self.about, (self.numbers[name][rows] for name in NUMBERS[3:])
        aloft, speed = np.isin(self.words["brush"][rows], about.flying), np.sqrt(u * u + v * v + w * w)
        rise = np.where(aloft, w / np.maximum(speed, 1e-9), 0.0)
        if "pitch" in self.numbers:
            rise = np.sin(self.numbers["pitch"][rows])
        level = np.sqrt(1.0 - rise * rise)
        forward = np.column_stack([level * np.cos(heading), level * np.sin(heading), rise])
        if "length" in self.numbers:
            length = self.numbers["length"][rows]
        else:
            length = np.array([about.body_length.get(name, 1.0) for name in self.words["species"][rows].tolist()])
        wrap = (about.width, about.height) if about.boundary == "wrap" else None
        xyz, velocity = np.column_stack([x, y, z]), np.column_stack([u, v, w])
        mean = float(length.mean()) if len(rows) else 1.0
        return herd_measures(xyz, velocity, forward, mean, wrap, bool(aloft.any()))

    def parts(self):
        """Counts and measures in the last frame, by species, brush and group (`flockbrush.systems.groups`)."""
        rows = self.rows(-1)
        none = np.zeros(len(rows), np.int64)
        group, family = (
            self.numbers[name][rows].astype(np.int64) if name in self.numbers else none for name in NUMBERED
        )
        named = self.words["species"][rows], self.words["brush"][rows]
        return parts_of(lambda some: self.measures(rows[some]), *named, group, family)

    def states(self):
        """{program: {state: how many animals are in it in the last frame}}."""
        now = self.words["state"][self.rows(-1)] if "state" in self.words else np.zeros(0, str)
        return {
            program: {state: int((now == word).sum()) for state, word in states.items()}
            for program, states in self.about.programs.items()
        }

    def transitions(self):
        """{program: {from: {to: how often animals went so from one frame to the next}}}.

        A table does not show that a state begins anew.
        """
        known = {word: (program, state) for program, states in self.about.programs.items()
                 for state, word in states.items()}  # fmt: skip
        counted: dict[str, dict[str, dict[str, int]]] = {program: {} for program in self.about.programs}
        if "state" not in self.words:
            return counted
        order = np.lexsort((self.numbers["frame"], self.numbers["id"]))
        word, who = self.words["state"][order], self.numbers["id"][order]
        for k in np.flatnonzero((word[1:] != word[:-1]) & (who[1:] == who[:-1])):
            before, after = known.get(word[k]), known.get(word[k + 1])
            if before and after and before[0] == after[0]:
                to = counted[before[0]].setdefault(before[1], {})
                to[after[1]] = to.get(after[1], 0) + 1
        return counted


def read_run_table(path) -> RunTable | None:
    """The table of a run with the metadata beside it (``NAME.csv.json``); None for any other file.

    Raises
    ------
    ProblemsError
        With the first cell that is wrong.
    """
    try:
        about = AboutRun.model_validate(beside(path))
    except ValidationError:
        return None
    table = read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)
    header: list[str] = next(table, (1, []))[1]
    needed = {*NUMBERS, *NUMBERED, *WORDS} - NOT_IN_ALL
    if not needed <= set(header) or not (about.body_length or "length" in header):
        return None
    known = [name for name in (*NUMBERS, *NUMBERED, *LATER) if name in header]
    at = [header.index(name) for name in known]
    words = {name: header.index(name) for name in WORDS if name in header}
    values, lines, texts = array("d"), array("q"), {name: array("q") for name in words}
    codes: dict[str, int] = {}
    for line, row in table:
        if len(row) != len(header):
            raise ProblemsError([Problem(str(path), line, None, f"has {len(row)} cells, not {len(header)}")])
        lines.append(line)
        for name, column in zip(known, at, strict=True):
            values.append(_number(path, line, name, row[column]))
        for name, column in words.items():
            texts[name].append(codes.setdefault(row[column], len(codes)))
    numbers = np.frombuffer(values).reshape(-1, len(known))
    order, names = np.argsort(numbers[:, 0], kind="stable"), np.array(list(codes) or [""])
    if not len(order):
        return None
    if twice := rows_twice(numbers[:, 0], numbers[:, 2]):
        before, again = twice
        frame, who = int(numbers[again, 0]), int(numbers[again, 2])
        message = f"animal {who} is in frame {frame} twice, here and in line {lines[before]}"
        raise ProblemsError([Problem(str(path), lines[again], None, message)])
    numbers = numbers[order]
    check_rate(path, about.fps, numbers[:, 0], numbers[:, 1])
    count = max(int(numbers[-1, 0]) + 1, about.frames or 0)
    if not 0 <= numbers[0, 0] <= count <= limits.TRACK_FRAMES:
        raise ProblemsError([Problem(str(path), None, "frame", f"must be 0 to {limits.TRACK_FRAMES:g}")])
    first = np.searchsorted(numbers[:, 0], np.arange(count + 1))
    named = {name: names[np.frombuffer(text, np.int64)[order]] for name, text in texts.items()}
    return RunTable(about, first, dict(zip(known, numbers.T.copy(), strict=True)), named)


def _number(path, line, name, cell):
    try:
        value = float(cell or "0") if name in NUMBERED else float(cell)
    except ValueError:
        value = np.nan
    if name in WHOLE and not value.is_integer():
        raise ProblemsError([Problem(str(path), line, name, f"must be a whole number, got {cell[:40]!r}")])
    if not abs(value) < 1e12:
        raise ProblemsError([Problem(str(path), line, name, f"must be a finite number, got {cell[:40]!r}")])
    return value
