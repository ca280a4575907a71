"""The table of positions by frame and animal that every format of tracks is read into."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from flockbrush.engine import limits
from flockbrush.engine.file_formats import newer_format
from flockbrush.engine.files import refused

SCHEMA = "flockbrush.trajectory/1"  # of tables of runs
WRAPPED = (
    "the level of this run is wrapped: across its edges distances are too large; measure its recording, or its .csv "
    "or .parquet without options"
)
EARTH = 111_319.49079327358  # m of a degree at the equator
SAME_RATE = 0.01  # of a rate: what a person or another file says may be off from the file's by so much
UNEVEN, MOST = 0.25, 0.98  # of the usual interval: frames are evenly spaced if so many are, give or take so much
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
    stated: bool = False  # whether the file itself states its unit
    body_length: float | None = None  # m, usual of its animals, where the file states them


def line_word(path) -> str:
    """What the place of a sight in a file is called."""
    return "row" if Path(path).suffix.lower() == ".parquet" else "line"


def begun(times) -> float:
    """s, the first of some times; 0 where that is a date, from which times count."""
    known = np.asarray(times, float)[np.isfinite(times)]
    return float(known.min()) if len(known) and abs(known.min()) < LATEST else 0.0


def heights_left_out(z) -> list[str]:
    """The note on heights (any shape) that vary: tracks are those in plan; none where they do not."""
    known = z[np.isfinite(z)]
    if not known.size or known.min() == known.max():
        return []
    span = f"from {known.min():.4g} to {known.max():.4g}"
    return [
        f"heights, {span}, are left out: distances and speeds are those in plan; a run of Flockbrush is measured in "
        "space from its recording, or from its .csv or .parquet without options"
    ]


def unevenness(times, rounded=0.0) -> str:
    """What is wrong with the times (n,), s, of a row of frames that are not evenly spaced; "" of others.

    Of frames without a time (NaN) nothing is known.  A few frames may be missing, and times may be ``rounded`` to so
    many seconds.
    """
    steps = _steps(times)
    if not (steps > 0).any():
        return ""
    if rounded and _off_a_line(times) <= UNEVEN * steps.mean() + rounded:
        return ""
    usual, mean = float(np.median(steps)), float(steps.mean())
    if (np.abs(steps - usual) <= UNEVEN * usual).mean() > MOST and abs(mean - usual) <= UNEVEN * usual:
        return ""
    return f"its frames are not evenly spaced in time, {steps.min():.3g} to {steps.max():.3g} s apart"


def evened(times) -> str:
    """What to do where tracks need evenly spaced frames, and those of their film, at times (n,), s, are not."""
    steps = _steps(times)
    rate = 1.0 / float(np.quantile(steps[steps > 0], 0.9))
    return f"track an even copy of the film, as from ffmpeg -i FILM -vf fps={rate:.3g} EVEN.mp4"


def rounding(times) -> float:
    """s, the last decimal place that is used by times (n,); no finer than a microsecond."""
    known = np.asarray(times, float)[np.isfinite(times)]
    return next((10.0**-k for k in range(6) if (np.abs(known - known.round(k)) < 1e-9).all()), 1e-6)


def _off_a_line(times):
    """s, how far at most times are from those of evenly spaced frames that fit them best."""
    known = np.flatnonzero(np.isfinite(times))
    there = np.asarray(times, float)[known]
    return np.abs(there - np.polyval(np.polyfit(known, there, 1), known)).max()


def _steps(times):
    """Seconds from frame to frame, where they are known."""
    known = np.flatnonzero(np.isfinite(times))
    return np.diff(np.asarray(times, float)[known]) / np.diff(known)


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
    if twice := rows_twice(frames, column[animal]):
        one, row = twice
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


def metres(path, longitude, latitude, valid):
    """Metres east and north of the middle, by a plate carrée that is true there."""
    if not ((np.abs(latitude[valid]) <= 90).all() and (np.abs(longitude[valid]) <= 360).all()):
        raise refused(path, "location-lat must be -90 to 90 and location-long -360 to 360 degrees")
    middle = np.median(longitude[valid]), np.median(latitude[valid])
    return (longitude - middle[0]) * EARTH * np.cos(np.radians(middle[1])), (latitude - middle[1]) * EARTH


def rate_of(frames, times) -> float | None:
    """Frames a second of rows that have both numbers (k,); None where they do not tell, or there are no times."""
    if times is None:
        return None
    known = np.isfinite(times) & np.isfinite(frames)
    if not known.any() or np.ptp(frames[known]) < 1 or not np.ptp(times[known]) > 0:
        return None
    return float(np.ptp(frames[known]) / np.ptp(times[known]))


def check_rate(path, fps, frames, times):
    """ProblemsError where frames and times (k,) contradict the frame rate of the metadata beside a table."""
    rate = rate_of(frames, times)
    if rate is not None and abs(rate / fps - 1.0) > SAME_RATE + 0.5 / max(np.nanmax(frames) - np.nanmin(frames), 1.0):
        other = Path(path).name + ".json"
        message = (
            f"its times say {rate:.6g} frames per second, {other} beside it says {fps:g}: correct or remove {other}"
        )
        raise refused(path, message)


def rows_twice(frames, animals) -> tuple[int, int] | None:
    """The first two rows with the same frame and animal, of the first such frame; None where there are none."""
    order = np.lexsort((animals, frames))
    same = np.flatnonzero((np.diff(frames[order]) == 0) & (np.diff(animals[order]) == 0))
    return (int(order[same[0]]), int(order[same[0] + 1])) if len(same) else None


def about_file(path) -> Path:
    """Where the metadata of a table are."""
    return Path(f"{path}.json")


def beside(path) -> dict:
    """The metadata in ``NAME.json``, written by Flockbrush next to a table; {} if there is no such file.

    ProblemsError when they are of a newer version.
    """
    other = about_file(path)
    if not other.is_file() or other.stat().st_size > limits.MIB:
        return {}
    try:
        metadata = json.loads(other.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return known_format(other, metadata) if isinstance(metadata, dict) else {}


def known_format(path, about: dict) -> dict:
    """The metadata of a table, from a file; ProblemsError when they state a newer version of its format."""
    if told := newer_format(about.get("schema"), SCHEMA):
        raise refused(path, f"schema {told}")
    return about
