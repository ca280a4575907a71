"""The table of places by frame and animal that every format of tracks gives, and how rows become one."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.files import refused


@dataclass
class TrackTable:
    """What a format gives: places by frame and animal."""

    xy: np.ndarray  # (T, N, 2)
    ids: list[str]
    frames: np.ndarray  # (T,)
    fps: float | None = None
    unit: str | None = None
    down: bool | None = None  # whether y points down; as is usual for pixels unless told
    heading: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)


# rows to places -------------------------------------------------------------------------------


def placed(path, frames, ids, xy, heading=None) -> tuple[np.ndarray, list[str], np.ndarray, np.ndarray | None]:
    """(xy (T, N, 2), ids, frame numbers (T,), heading) from a row for each animal in each frame.

    Raises
    ------
    ProblemsError
        When an animal is twice in a frame, or the table would be larger than fits.
    """
    frames = np.asarray(frames, np.int64)
    names, column = np.unique(np.asarray(ids).astype(str), return_inverse=True)
    first, length = int(frames.min()), int(np.ptp(frames)) + 1
    if length > limits.TRACK_FRAMES or length * len(names) > limits.TRACK_CELLS:
        raise refused(path, f"{length} frames of {len(names)} animals are more than fit; cut the file into parts")
    flat = (frames - first) * len(names) + column
    order = np.argsort(flat, kind="stable")
    twice = np.flatnonzero(np.diff(flat[order]) == 0)
    if len(twice):
        row = order[twice[0] + 1]
        raise refused(path, f"animal {names[column[row]]} is in frame {frames[row]} twice (row {row + 2})")
    grid = np.full((length * len(names), 2), np.nan)
    grid[flat] = xy
    turned = None
    if heading is not None:
        headings = np.full(length * len(names), np.nan)
        headings[flat] = heading
        turned = headings.reshape(length, -1)
    return grid.reshape(length, len(names), 2), names.tolist(), np.arange(first, first + length), turned


def beside(path) -> dict:
    """The metadata that Flockbrush writes in ``NAME.json`` beside a table; {} where there is none."""
    other = Path(f"{path}.json")
    if not other.is_file() or other.stat().st_size > limits.MIB:
        return {}
    try:
        found = json.loads(other.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}
