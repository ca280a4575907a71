"""Read back the trajectory table of a run, with the names in it, and measure it as the run itself is measured."""

from __future__ import annotations

import importlib.util
import json
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import BaseModel, Field

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.film.track_formats import check_parquet
from flockbrush.film.track_table import SCHEMA, beside, check_rate, line_word, rows_twice
from flockbrush.systems.groups import parts_of
from flockbrush.systems.measures import herd_measures

NUMBERS = "frame", "time", "id", "x", "y", "z", "vx", "vy", "vz", "heading"
NUMBERED = "group", "family"  # 0 where the cell is empty
LATER = "pitch", "length"
WORDS = "species", "brush", "state"
NOT_IN_ALL = {*LATER, "family", "state"}  # columns that older tables lack
WHOLE = "frame", "id", *NUMBERED
FARTHEST = 1e12  # m, s, frames, ids
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


_ABOUT = {field.alias or name for name, field in AboutRun.model_fields.items()}


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
    """The table of a run with its metadata (``NAME.csv.json``, or in a ``.parquet``); None for any other file.

    Raises
    ------
    ProblemsError
        With the first cell that is wrong.
    """
    packed = str(path).lower().endswith(".parquet")
    try:
        about = AboutRun.model_validate(_about_parquet(path) if packed else beside(path))
    except (ValueError, RecursionError):
        return None
    rows = (_rows_of_parquet if packed else _rows_of_csv)(path, about)
    if rows is None or not len(rows.lines):
        return None
    numbers = rows.numbers
    if twice := rows_twice(numbers[:, 0], numbers[:, 2]):
        before, again = twice
        frame, who = int(numbers[again, 0]), int(numbers[again, 2])
        message = f"animal {who} is in frame {frame} twice, here and in {line_word(path)} {rows.lines[before]}"
        raise ProblemsError([Problem(str(path), int(rows.lines[again]), None, message)])
    if not packed:
        check_rate(path, about.fps, numbers[:, 0], numbers[:, 1])
    order = np.argsort(numbers[:, 0], kind="stable")
    numbers = numbers[order]
    count = max(int(numbers[-1, 0]) + 1, about.frames or 0)
    if not 0 <= numbers[0, 0] <= count <= limits.TRACK_FRAMES:
        raise ProblemsError([Problem(str(path), None, "frame", f"must be 0 to {limits.TRACK_FRAMES:g}")])
    first = np.searchsorted(numbers[:, 0], np.arange(count + 1))
    named = {name: words[order] for name, words in rows.words.items()}
    return RunTable(about, first, dict(zip(rows.known, numbers.T.copy(), strict=True)), named)


class _Rows(NamedTuple):
    known: list[str]  # columns of numbers
    numbers: np.ndarray  # (rows, columns)
    words: dict[str, np.ndarray]  # (rows,) str
    lines: Sequence[int]  # where they are in the file


def _known(header, about):
    """The columns of numbers in a table; None where it is not that of a run."""
    needed = {*NUMBERS, *NUMBERED, *WORDS} - NOT_IN_ALL
    if not needed <= set(header) or not (about.body_length or "length" in header):
        return None
    return [name for name in (*NUMBERS, *NUMBERED, *LATER) if name in header]


def _rows_of_csv(path, about):
    table = read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)
    header: list[str] = next(table, (1, []))[1]
    known = _known(header, about)
    if known is None:
        return None
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
    names = np.array(list(codes) or [""])
    named = {name: names[np.frombuffer(text, np.int64)] for name, text in texts.items()} if lines else {}
    return _Rows(known, np.frombuffer(values).reshape(-1, len(known)), named, lines)


def _about_parquet(path):
    """The metadata in a Parquet file of ours; {} where there are none, or it cannot be read."""
    if importlib.util.find_spec("pyarrow") is None:
        return {}
    import pyarrow
    import pyarrow.parquet as parquet

    try:
        with parquet.ParquetFile(path) as file:
            texts = file.metadata.metadata or {}
    except (OSError, pyarrow.ArrowException):
        return {}
    about = {name: texts[name.encode()].decode() for name in _ABOUT if name.encode() in texts}
    return about | {name: json.loads(about[name]) for name in ("flying", "programs") if name in about}


def _rows_of_parquet(path, about):
    import pyarrow
    import pyarrow.parquet as parquet

    try:
        with parquet.ParquetFile(path) as file:
            header = file.schema_arrow.names
            known = _known(header, about)
            if known is None:
                return None
            columns = [*known, *(name for name in WORDS if name in header)]
            check_parquet(path, file.metadata, set(columns))
            data = file.read(columns=columns)
        numbers = np.column_stack([_numbers(path, name, data[name]) for name in known])
        words = {name: _words(data[name]) for name in columns[len(known) :]}
    except (OSError, ValueError, pyarrow.ArrowException):
        return None  # whoever reads it as tracks says what is wrong
    good = (np.abs(numbers) < FARTHEST) & ((numbers == np.round(numbers)) | [name not in WHOLE for name in known])
    if not good.all():
        row, column = np.argwhere(~good)[0].tolist()
        _number(path, row + 1, known[column], str(numbers[row, column]))
    return _Rows(known, numbers, words, range(1, len(data) + 1))


def _numbers(path, name, values):
    """(rows,) of a column of numbers, or of words that are read as the cells of a CSV are."""
    import pyarrow

    if not (pyarrow.types.is_string(values.type) or pyarrow.types.is_dictionary(values.type)):
        values = values.fill_null(0) if name in NUMBERED else values
        return np.asarray(values.to_numpy(), float)
    words, first, at = np.unique(_words(values), return_index=True, return_inverse=True)
    found = [_number(path, row + 1, name, word) for word, row in zip(words.tolist(), first.tolist(), strict=True)]
    return np.array(found, float)[at]


def _words(values):
    """(rows,) str of a column."""
    import pyarrow

    coded = values.cast(pyarrow.string()).dictionary_encode().combine_chunks()
    names = np.array([*coded.dictionary.to_pylist(), ""])
    return names[coded.indices.fill_null(len(names) - 1).to_numpy(zero_copy_only=False)]


def _number(path, line, name, cell):
    try:
        value = float(cell or "0") if name in NUMBERED else float(cell)
    except ValueError:
        value = np.nan
    if name in WHOLE and not value.is_integer():
        raise ProblemsError([Problem(str(path), line, name, f"must be a whole number, got {cell[:40]!r}")])
    if not abs(value) < FARTHEST:
        raise ProblemsError([Problem(str(path), line, name, f"must be a finite number, got {cell[:40]!r}")])
    return value
