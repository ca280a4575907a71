"""The table of places by frame and animal that every format of tracks gives, and how rows become one."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.files import refused

SURE = 0.6  # confidence of a body part, below which it is taken as not seen


@dataclass
class TrackTable:
    """What a format gives: places by frame and animal."""

    xy: np.ndarray  # (T, N, 2)
    ids: list[str]
    frames: np.ndarray  # (T,)
    fps: float | None = None
    unit: str | None = None
    down: bool | None = None  # whether y points down; as is usual for pixels by default
    heading: np.ndarray | None = None
    notes: list[str] = field(default_factory=list)


# rows to places -------------------------------------------------------------------------------


def placed(path, frames, names, animal, xy, heading=None):
    """(xy (T, N, 2), ids, frame numbers (T,), heading) from a row for each animal in each frame.

    Parameters
    ----------
    frames : (k,) int ndarray
    names : sequence of str
    animal : (k,) int ndarray
        Of the names, whose row it is.
    xy : (k, 2) ndarray
    heading : (k,) ndarray, optional

    Raises
    ------
    ProblemsError
        When an animal is twice in a frame, or the table would be larger than fits.
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
        row = order[twice[0] + 1]
        raise refused(path, f"animal {names[animal[row]][:80]} is in frame {frames[row]} twice (row {row + 2})")
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
    """ProblemsError unless so many frames of so many animals fit."""
    if frames > limits.TRACK_FRAMES or animals > limits.TRACK_ANIMALS or frames * animals > limits.TRACK_CELLS:
        raise refused(path, f"{frames:,} frames of {animals:,} animals are too many; split the file into parts")


def middle_of_parts(places, weights):
    """(T, 2) mean of body parts (k, T, 2) that are sure; NaN where none is."""
    good = (weights >= SURE) & np.isfinite(places).all(-1)
    count = good.sum(0)
    total = np.where(good[..., None], np.nan_to_num(places), 0.0).sum(0)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def beside(path) -> dict:
    """The metadata that Flockbrush writes in ``NAME.json`` beside a table; {} where there is none."""
    other = Path(f"{path}.json")
    if not other.is_file() or other.stat().st_size > limits.MIB:
        return {}
    try:
        metadata = json.loads(other.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return metadata if isinstance(metadata, dict) else {}
