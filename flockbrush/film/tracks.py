"""Tracks of birds in the image: read, checked, and smoothed through noise and gaps."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from scipy.linalg import solveh_banded

from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.noise import Noise
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean

COLUMNS = ("frame", "id", "x", "y")
_TOLD = 20  # problems of one file that are told
LEFT = 1e-3  # least share of the sights that a smooth path does not follow by itself


@dataclass
class Tracks:
    """Positions of birds in the picture, by frame."""

    px: np.ndarray  # (F, N, 2); pixels, y down; NaN where a bird was not seen
    ids: np.ndarray  # (N,) of int
    first: int = 0  # number of the first frame
    notes: list[str] = field(default_factory=list)  # what was noticed and mended
    times: np.ndarray | None = None  # (F,) s, NaN unknown; None of a film whose frames are evenly spaced, or may be

    @property
    def seen(self) -> np.ndarray:
        """Whether each bird was seen in each frame, (F, N) bool."""
        return np.isfinite(self.px).all(-1)

    @property
    def alive(self) -> np.ndarray:
        """Whether a frame is between the first and the last sight of each bird, gaps included, (F, N) bool."""
        seen = self.seen
        return np.maximum.accumulate(seen, 0) & np.maximum.accumulate(seen[::-1], 0)[::-1]


def read_tracks(path: str | Path, least: int = 3) -> Tracks:
    """Tracks from a CSV with ``frame,id,x,y``, pixels, and perhaps ``time``, s; further columns are ignored.

    Parameters
    ----------
    least : int
        Birds seen in fewer frames are left out, with a note; a flight needs three.

    Raises
    ------
    ProblemsError
        With file, line and column of what is wrong: up to twenty of them.
    """
    *rows, times = _rows(path, "time", _seconds)
    tracks = _assembled(str(path), *rows)
    tracks.times = np.full(len(tracks.px), np.nan)
    tracks.times[rows[0] - tracks.first] = times
    return _without_points(str(path), tracks, least)


def _rows(path, further, read):
    """(frames, ids, px, lines, more) of a table of tracks; ProblemsError.

    ``more`` has what ``read(path, line, cell, problems)`` makes of the cells of the column ``further``, "" without it.
    """
    name = str(path)
    rows = read_table(path, limits.TRACKS_BYTES, limits.TRACK_ROWS)
    header = [cell.strip().lower() for cell in next(rows, (1, []))[1]]
    missing = [column for column in COLUMNS if column not in header]
    if missing:
        hint = did_you_mean(missing[0], header)
        message = f"there is no such column{hint}; a file of tracks must have the columns {', '.join(COLUMNS)}"
        raise ProblemsError([Problem(name, 1, missing[0], message)])
    at = header.index(further) if further in header else None
    return _parsed(name, rows, [header.index(column) for column in COLUMNS], at, read)


def read_marks(path: str | Path) -> dict[int, list[tuple]]:
    """Birds as a person marked them, from a CSV as for `read_tracks`: {frame: [(id, x, y)]}.

    A further column ``gone`` may say with a 1 that what is there is no bird, from this frame on: (id, x, y, True).

    Raises
    ------
    ProblemsError
    """
    frames, ids, px, _, removed = _rows(path, "gone", _said_gone)
    marks: dict[int, list[tuple]] = {}
    for frame, bird, (x, y), no in zip(frames.tolist(), ids.tolist(), px.tolist(), removed, strict=True):
        marks.setdefault(frame, []).append((bird, x, y, True) if no else (bird, x, y))
    return marks


def _parsed(name, rows, where, further, read):
    """(frames, ids, px, lines, more) of the rows; ProblemsError."""
    problems: list[Problem] = []
    more = []
    frames, ids, px, lines = array("q"), array("q"), array("d"), array("q")
    for line, row in rows:
        values = [_number(name, line, column, row, at, problems) for column, at in zip(COLUMNS, where, strict=True)]
        if len(problems) >= _TOLD:
            break
        if None not in values:
            frames.append(int(values[0]))
            ids.append(int(values[1]))
            px.extend(values[2:])
            lines.append(line)
            cell = row[further].strip() if further is not None and further < len(row) else ""
            more.append(read(name, line, cell, problems))
    if problems:
        raise ProblemsError(problems)
    if not frames:
        raise refused(name, "has no birds")
    return np.array(frames), np.array(ids), np.array(px).reshape(-1, 2), np.array(lines), more


def _seconds(_name, _line, cell, _problems):
    """The time of a row; NaN where it has none, or none in seconds."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _said_gone(name, line, cell, problems):
    """Whether a row says that there is no bird."""
    if cell not in ("", "0", "1"):
        problems.append(Problem(name, line, "gone", f"must be 1 where there is no bird, else 0, got {cell!r}"))
    return cell == "1"


def _number(name, line, column, row, at, problems):
    cell = row[at].strip() if at < len(row) else ""
    try:
        value = float(cell)
    except ValueError:
        problems.append(Problem(name, line, column, f"must be a number, got {cell!r}"))
        return None
    whole = column in ("frame", "id")
    if not math.isfinite(value) or (whole and value != int(value)) or abs(value) > 1e9:
        kind = "a whole number" if whole else "a finite number of pixels, at most 1e9"
        hint = "" if whole else "; a bird that is not seen has no row"
        problems.append(Problem(name, line, column, f"must be {kind}, got {cell!r}{hint}"))
        return None
    return value


def _assembled(name, frames, ids, px, lines):
    first, last = int(frames.min()), int(frames.max())
    birds, column = np.unique(ids, return_inverse=True)
    length = last - first + 1
    if length > limits.TRACK_FRAMES or length * len(birds) > limits.TRACK_CELLS:
        message = f"frames {first} to {last} with {len(birds)} birds are too many; split the clip into parts"
        raise ProblemsError([Problem(name, None, "frame", message)])
    grid = np.full((length, len(birds), 2), np.nan)
    taken = np.zeros((length, len(birds)), np.int32)
    for row, (f, n) in enumerate(zip(frames - first, column, strict=True)):
        if taken[f, n]:
            message = f"bird {ids[row]} is in frame {frames[row]} twice, here and in line {taken[f, n]}"
            raise ProblemsError([Problem(name, int(lines[row]), "id", message)])
        taken[f, n] = lines[row]
        grid[f, n] = px[row]
    return Tracks(grid, birds, first)


def _without_points(name, tracks, least):
    """The tracks without birds that were seen in fewer frames."""
    sights = tracks.seen.sum(0)
    short = sights < least
    if short.all():
        most = int(sights.max())
        raise refused(
            name, f"no bird was seen in more than {most} frame{'s' if most > 1 else ''}; a flight needs three"
        )
    if short.any():
        who = ", ".join(map(str, tracks.ids[short][:10])) + (", ..." if short.sum() > 10 else "")
        tracks.notes.append(f"left out, visible in fewer than three frames: bird{'s' if short.sum() > 1 else ''} {who}")
        rows = np.flatnonzero(tracks.seen[:, ~short].any(1))
        span = slice(rows[0], rows[-1] + 1)
        first = tracks.first + int(rows[0])
        return Tracks(tracks.px[span, ~short], tracks.ids[~short], first, tracks.notes, tracks.times[span])
    return tracks


# smoothing ------------------------------------------------------------------------


@dataclass(frozen=True)
class Smoothed:
    """Tracks without noise and gaps."""

    px: np.ndarray  # (F, N, 2); NaN before a bird comes and after it has left
    stiffness: float  # the weight of smoothness that was used
    noise: float  # estimated deviation of what was measured from it, pixels
    longest_gap: int  # frames


def smoothed(tracks: Tracks, stiffness: float | None = None) -> Smoothed:
    """Smooth tracks and fill gaps, by penalising their third differences.

    Parameters
    ----------
    tracks : Tracks
    stiffness : float, optional
        Larger: smoother. By default found by generalised cross-validation over all birds together.

    Returns
    -------
    Smoothed

    Notes
    -----
    Whittaker's smoother [1]_ with weight 0 in gaps and one stiffness for all birds, found on a grid of decades and
    refined around the best. The trace of the smoother is estimated with fixed probes [2]_.

    References
    ----------
    .. [1] Eilers, P. H. C. (2003). A perfect smoother. Analytical Chemistry 75(14), 3631-3636.
    .. [2] Hutchinson, M. F. (1990). A stochastic estimator of the trace of the influence matrix. Communications in
       Statistics 19(2), 433-450.
    """
    spans = [_Span.of(tracks, n) for n in range(len(tracks.ids))]
    chosen = _best_stiffness(spans) if stiffness is None else float(stiffness)
    out = np.full(tracks.px.shape, np.nan)
    residual, freedom = 0.0, 0.0
    for n, span in enumerate(spans):
        fit, trace = span.fit(chosen)
        out[span.start : span.start + len(fit), n] = fit
        residual += float((span.weight[:, None] * (fit - span.y) ** 2).sum())
        freedom += 2 * max(span.weight.sum() - trace, 1e-9)
    return Smoothed(out, chosen, math.sqrt(residual / freedom), max(int(span.gaps.max()) for span in spans) - 1)


def smoothed_alike(px, stiffness: float) -> np.ndarray:
    """Paths (F, N, 2) smoothed as `smoothed` does with a known stiffness; NaN before and after an animal is there."""
    px, out = np.asarray(px, float), np.full(np.shape(px), np.nan)
    there = np.isfinite(px).all(-1)
    whole = there.all(0)
    if whole.any():  # they share the smoother
        y = px[:, whole].reshape(len(px), -1)
        centre = y.mean(0)
        solved = solveh_banded(_system(np.ones(len(y)), stiffness), y - centre, check_finite=False)
        out[:, whole] = (solved + centre).reshape(len(px), -1, 2)
    for n in np.flatnonzero(~whole & there.any(0)):
        span = _Span.of(Tracks(px, np.arange(px.shape[1])), n)
        fit, _ = span.fit(stiffness)
        out[span.start : span.start + len(fit), n] = fit
    return out


@dataclass
class _Span:
    """One bird from its first to its last sight."""

    start: int
    y: np.ndarray  # (F, 2), 0 in gaps
    weight: np.ndarray  # (F,), 0 in gaps
    gaps: np.ndarray  # frames from sight to sight, at least 1
    probes: np.ndarray  # (F, k) of +-1

    @classmethod
    def of(cls, tracks, n):
        seen = np.flatnonzero(tracks.seen[:, n])
        start, end = int(seen[0]), int(seen[-1]) + 1
        y = tracks.px[start:end, n]
        weight = np.isfinite(y).all(-1).astype(float)
        return cls(start, np.where(weight[:, None] > 0, y, 0.0), weight, np.diff(seen), _probes(end - start))

    def fit(self, stiffness):
        """The smooth path (F, 2), px, and the trace of the smoother."""
        bands = _system(self.weight, stiffness)
        centre = self.y[self.weight > 0].mean(0)
        sides = np.hstack([(self.y - centre) * self.weight[:, None], self.probes * self.weight[:, None]])
        solved = solveh_banded(bands, sides, check_finite=False)
        trace = float((self.probes * solved[:, 2:]).sum() / self.probes.shape[1])
        return solved[:, :2] + centre, min(trace, float(self.weight.sum()))


def _system(weight, stiffness):
    """The equations of the smoother in upper banded form, for weights (F,) of the sights."""
    bands = stiffness * _third_differences(len(weight))
    bands[-1] += weight
    bands[-1] += 1e-12 * (1 + stiffness)  # a path of three sights with a gap is not held by the rest
    return bands


@cache
def _third_differences(length):
    """D'D of third differences in upper banded form, (4, length), as `scipy.linalg.solveh_banded` takes it."""
    bands = np.zeros((min(4, length), length))
    step = np.array([-1.0, 3.0, -3.0, 1.0])
    for row in range(length - 3):
        for a in range(4):
            for b in range(a, 4):
                bands[len(bands) - 1 - (b - a), row + b] += step[a] * step[b]
    return bands


def _probes(length):
    """Fixed random signs, (length, 8), for the trace estimate."""
    return np.sign(Noise(0).uniform("probes", 0, np.arange(length), 8) - 0.5)


def _best_stiffness(spans):
    """The stiffness with the least generalised cross-validation score over all birds.

    Of birds that are seen every n-th frame the same path is as smooth at n^5 times the stiffness (n frames, each with a
    third difference of n^-3, squared, between two sights): the grid begins there, above paths through all sights.
    """
    usual = float(np.median([np.median(span.gaps) for span in spans]))
    decades = 10.0 ** np.arange(-2.0, 9.01, 1.0) * usual**5
    scores = [_score(spans, s) for s in decades]
    best = decades[int(np.argmin(scores))]
    fine = best * 10.0 ** np.linspace(-0.75, 0.75, 7)
    return float(fine[int(np.argmin([_score(spans, s) for s in fine]))])


def _score(spans, stiffness):
    residual, sights, trace = 0.0, 0.0, 0.0
    for span in spans:
        fit, own = span.fit(stiffness)
        residual += float((span.weight[:, None] * (fit - span.y) ** 2).sum())
        sights += span.weight.sum()
        trace += own
    left = 1.0 - trace / sights
    return residual / sights / left**2 if left > LEFT else np.inf  # a path through all sights tells nothing


def central_differences(values):
    """Differences per frame along the first axis, (F, ...): central where both neighbours are known, else one-sided."""
    ahead, behind = np.full(values.shape, np.nan), np.full(values.shape, np.nan)
    ahead[:-1] = values[1:] - values[:-1]
    behind[1:] = ahead[:-1]
    both = 0.5 * (ahead + behind)
    return np.where(np.isfinite(both), both, np.where(np.isfinite(ahead), ahead, behind))
