"""Numbers, times and frame numbers in the cells of tables of tracks."""

from __future__ import annotations

from array import array
from datetime import datetime

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError

FARTHEST = 1e12  # of places, in their unit
TOLD = 20  # problems of one file that are reported


def number_grid(path, rows, columns):
    """(T, len(columns)) numbers of rows (line, cells), NaN where there is none; ProblemsError."""
    values = array("d")
    problems: list[Problem] = []
    for line, row in rows:
        values.extend(number_of(path, line, f"column {at + 1}", row, at, problems) for at in columns)
        if len(values) > limits.TRACK_NUMBERS:
            raise refused(path, f"has more than {limits.TRACK_NUMBERS.text}; split it into parts")
        if len(problems) >= TOLD:
            break
    if problems:
        raise ProblemsError(problems)
    if not values:
        raise refused(path, "has no rows")
    return np.frombuffer(values).reshape(-1, len(columns))


def whole_frames(path, frames):
    """Frame numbers as integers; ProblemsError where one is none."""
    frames = np.asarray(frames, float)
    if not ((np.abs(frames) <= 1e9) & (frames == np.floor(frames))).all():
        raise refused(path, "a frame must be a whole number, at most 1e9")
    return frames.astype(np.int64)


_ABSENT = "", "nan", "na", "null", "none"


def number_of(path, line, column, row, at, problems):
    cell = row[at].strip() if at < len(row) else ""
    if cell.lower() in _ABSENT:
        if column == "frame":
            problems.append(Problem(str(path), line, column, "must be a whole number, got nothing"))
        return np.nan
    try:
        value = float(cell)
    except ValueError:
        problems.append(Problem(str(path), line, column, f"must be a number, got {cell[:40]!r}"))
        return np.nan
    if not abs(value) < FARTHEST:
        problems.append(Problem(str(path), line, column, f"must be a number below 1e12, got {cell[:40]!r}"))
        return np.nan
    if column == "frame" and not (abs(value) <= 1e9 and value == int(value)):
        problems.append(Problem(str(path), line, column, f"must be a whole number, at most 1e9, got {cell[:40]!r}"))
        return np.nan
    return value


def moment_of(path, line, row, at, problems):
    """Seconds of a cell that holds a number or a date with a time."""
    cell = row[at].strip() if at < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        try:
            moment = datetime.fromisoformat(cell)
            value = moment.timestamp() if moment.tzinfo else (moment - datetime(2000, 1, 1)).total_seconds()
        except ValueError:
            value = np.nan
    if not abs(value) < 1e12:
        problems.append(Problem(str(path), line, "time", f"must be seconds or a date and time, got {cell[:40]!r}"))
        return np.nan
    return value
