"""Flights that come from a table: frame, id, x, y, z."""

from __future__ import annotations

import math
from array import array

import numpy as np

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.film.track_table import rows_twice
from flockbrush.lifting.lift_solver import LiftedFlight

PLACES = ("frame", "id", "x", "y", "z")  # of a table of flights
FARTHEST = 1e12  # m, s, frames, ids


def table_header(path):
    """The names of the columns of a table, in small letters."""
    return {cell.strip().lower() for cell in next(_rows(path), (1, []))[1]}


def _rows(path):
    return read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)


def read_flight(path) -> LiftedFlight:
    """The flight of a trajectory table: ``frame, id, x, y, z`` in metres, and ``time`` in seconds if there is one.

    Birds are numbered if their ids are no whole numbers but names.

    Raises
    ------
    ProblemsError
        With file, line and column of what is wrong.
    """
    name = str(path)
    rows = _rows(path)
    header = [cell.strip().lower() for cell in next(rows, (1, []))[1]]
    wanted = [*PLACES, "time"] if "time" in header else list(PLACES)
    missing = [column for column in wanted if column not in header]
    if missing:
        raise ProblemsError([Problem(name, 1, missing[0], "there is no such column")])
    lines, names = array("q"), dict[str, int]()
    rows = _numbered(rows, header.index("id"), names)
    values = _values(name, rows, wanted, [header.index(column) for column in wanted], lines)
    return _gridded(name, values, np.frombuffer(lines, np.int64), "time" in header, list(names))


def _numbered(rows, at, names):
    """The rows with the number of a name among all ``names``, to which new ones are added, in place of it."""
    for line, row in rows:
        if at < len(row) and row[at].strip():
            row[at] = str(names.setdefault(row[at].strip(), len(names)))
        yield line, row


def whole_numbers(names) -> np.ndarray | None:
    """The whole numbers that some names are, (n,); None if one is none."""
    numbers = np.array([_float(name) for name in names])
    whole = (np.abs(numbers) < FARTHEST).all() and (numbers == np.round(numbers)).all()
    return numbers.astype(np.int64) if whole else None


def wingspan_of(path) -> float | None:
    """The wingspan of birds whose places are in wingspans (``x_b``) as well as in metres; None where they are not."""
    rows = _rows(path)
    header = [cell.strip().lower() for cell in next(rows, (1, []))[1]]
    if not {"x", "x_b"} <= set(header):
        return None
    metres, spans = _values(str(path), rows, ("x", "x_b"), [header.index("x"), header.index("x_b")]).T
    square = float(spans @ spans)
    return float(metres @ spans) / square if square > 0.0 and metres @ spans > 0.0 else None


def _values(name, rows, columns, at, lines=None):
    """(rows, columns) of numbers and their ``lines``; ProblemsError names the first cell that is no number."""
    values = array("d")
    for line, row in rows:
        if lines is not None:
            lines.append(line)
        for column, k in zip(columns, at, strict=True):
            cell = row[k].strip() if k < len(row) else ""
            values.append(_float(cell))
            if not abs(values[-1]) < FARTHEST:
                message = f"must be a finite number, at most {FARTHEST:g}, got {cell[:40]!r}"
                raise ProblemsError([Problem(name, line, column, message)])
    if not values:
        raise refused(name, "has no birds")
    return np.frombuffer(values).reshape(-1, len(columns))


def _float(cell):
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _gridded(name, values, lines, timed, names):
    if (broken := values[:, 0] != np.round(values[:, 0])).any():
        message = f"must be a whole number, got {values[broken, 0][0]:g}"
        raise ProblemsError([Problem(name, int(lines[broken][0]), "frame", message)])
    frames, ids, numbers = values[:, 0].astype(np.int64), values[:, 1].astype(np.int64), whole_numbers(names)
    ids = ids if numbers is None else numbers[ids]
    if twice := rows_twice(frames, ids):
        one, row = twice
        message = f"bird {names[int(values[row, 1])]} is in frame {frames[row]} twice, here and in line {lines[one]}"
        raise ProblemsError([Problem(name, int(lines[row]), None, message)])
    first, last = int(frames.min()), int(frames.max())
    birds, column = np.unique(ids, return_inverse=True)
    if last == first:
        raise refused(name, "has only one frame; a flight needs at least two")
    if last - first >= limits.TRACK_FRAMES or (last - first + 1) * len(birds) > limits.TRACK_CELLS:
        raise refused(name, f"frames {first} to {last} with {len(birds)} birds are too many; split it into parts")
    fps, begin = 30.0, math.nan
    if timed:
        begin, end = values[frames == first, 5].min(), values[frames == last, 5].max()
        if not end > begin:
            raise refused(name, "the time does not increase from the first frame to the last")
        fps = (last - first) / (end - begin)
    xyz = np.full((last - first + 1, len(birds), 3), np.nan)
    xyz[frames - first, column] = values[:, 2:5]
    fps = float(f"{fps:.7g}")  # as far as times are written: 30, not 30.0000015
    called = tuple(names[bird] for bird in birds) if numbers is None else ()
    depth, frames = np.linalg.norm(xyz, axis=-1), np.arange(first, last + 1)
    return LiftedFlight(xyz, depth, birds, frames, fps, start=float(begin), names=called)
