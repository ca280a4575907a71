"""The table of positions by frame and animal that every format of tracks is read into."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.files import refused

WRAPPED = "the level of this run is wrapped: across its edges distances are too large; measure its CSV or recording"
SURE = 0.6  # confidence of a body part, below which it is taken as not seen


LATEST = 1e7  # s: later times are dates, which count from the first frame


@dataclass
class TrackTable:
    """Positions by frame and animal, as read from a file."""

    xy: np.ndarray  # (T, N, 2)
    ids: list[str]
    frames: np.ndarray  # (T,)
    fps: float | None = None
    unit: str | None = None
    down: bool | None = None  # whether y points down; as is usual for pixels by default
    heading: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)
    start: float = 0.0  # s, time of the first frame


def line_word(path) -> str:
    """What the place of a sight in a file is called."""
    return "row" if Path(path).suffix.lower() == ".parquet" else "line"


def begun(times) -> float:
    """s, the first of some times; 0 where that is a date, from which times count."""
    known = np.asarray(times, float)[np.isfinite(times)]
    return float(known.min()) if len(known) and abs(known.min()) < LATEST else 0.0


# rows to places -------------------------------------------------------------------------------


def placed(path, frames, names, animal, xy, heading=None, lines=None):
    """Positions on a grid of frames and animals, from one row for each animal in each frame.

    Parameters
    ----------
    path : path
        For messages.
    frames : (k,) int ndarray
    names : sequence of str
    animal : (k,) int ndarray
        Index into `names` of each row.
    xy : (k, 2) ndarray
    heading : (k,) ndarray, optional
    lines : (k,) int ndarray, optional
        Where the rows are in the file, for messages.

    Returns
    -------
    xy : (T, N, 2) ndarray
        NaN where there is no row.
    ids : list of str
        Names of the animals that have rows, sorted.
    frames : (T,) ndarray
        Consecutive frame numbers.
    heading : (T, N) ndarray or None

    Raises
    ------
    ProblemsError
        When an animal is in a frame twice, or the grid would be larger than `limits.TRACK_CELLS`.
    """
    frames = np.asarray(frames, np.int64)
    present = sorted(np.unique(animal).tolist(), key=lambda n: names[n])
    column = np.zeros(len(names), np.int64)
    column[present] = np.arange(len(present))
    first, length = int(frames.min()), int(frames.max()) - int(frames.min()) + 1
    check_size(path, length, len(present))
    flat = (frames - first) * len(present) + column[animal]
    order = np.argsort(flat, kind="stable")
    twice = np.flatnonzero(np.diff(flat[order]) == 0)
    if len(twice):
        one, row = order[twice[0]], order[twice[0] + 1]
        where = "" if lines is None else f" ({line_word(path)}s {lines[one]} and {lines[row]})"
        raise refused(path, f"animal {names[animal[row]][:80]} is in frame {frames[row]} twice{where}")
    grid = np.full((length * len(present), 2), np.nan)
    grid[flat] = xy
    turned = None
    if heading is not None:
        headings = np.full(length * len(present), np.nan)
        headings[flat] = heading
        turned = headings.reshape(length, -1)
    shown = [names[n] for n in present]
    return grid.reshape(length, len(present), 2), shown, np.arange(first, first + length), turned


def check_size(path, frames, animals):
    """Raise ProblemsError if there are more frames, animals, or frames times animals than the limits allow."""
    if frames > limits.TRACK_FRAMES or animals > limits.TRACK_ANIMALS or frames * animals > limits.TRACK_CELLS:
        raise refused(path, f"{frames:,} frames of {animals:,} animals are too many; split the file into parts")


def part_middle(places, weights):
    """Mean position of the body parts with a confidence of at least `SURE`.

    Parameters
    ----------
    places : (k, T, 2) ndarray
    weights : (k, T) ndarray
        Confidence, 0 to 1.

    Returns
    -------
    (T, 2) ndarray
        NaN where no part is sure.
    """
    good = (weights >= SURE) & np.isfinite(places).all(-1)
    count = good.sum(0)
    total = np.where(good[..., None], np.nan_to_num(places), 0.0).sum(0)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def beside(path) -> dict:
    """The metadata in ``NAME.json``, written by Flockbrush next to a table; {} if there is no such file."""
    other = Path(f"{path}.json")
    if not other.is_file() or other.stat().st_size > limits.MIB:
        return {}
    try:
        metadata = json.loads(other.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return metadata if isinstance(metadata, dict) else {}
