"""Identities of birds after they merge in the picture and separate, from their motion before and after.

Within one frame two birds of one blob cannot be told apart.  The whole track gives more evidence: each track is
cut into stretches in which its bird is alone in its blob and runs in which it shares one.  Runs of birds that share a
blob at the same time are one crossing.  A bird of which the place and velocity at the end of the stretch before are
known goes on as that stretch after the crossing which is the likeliest under a random walk of its velocity [1]_, by
its size as well.  Identities change only if that is likelier by a margin than the tracked ones.

.. [1] Bar-Shalom, Y., Li, X. R., Kirubarajan, T. (2001). Estimation with Applications to Tracking and Navigation,
   sections 5.2 (filter) and 6.2 (continuous white noise acceleration).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

WINDOW = 15  # frames of a stretch from which place and velocity are estimated
APART = 3  # frames alone; fewer do not separate two runs
LAG = 8  # frames, over which the random walk of velocities is measured
TAILS = 4.0  # degrees of freedom: likelihoods have the tails of a Student's t
MARGIN = 6.0  # twice the log likelihood by which another assignment must be better
BEATS = 6.0  # frames of wing beats, in which sizes are one sample
JUMP = 60.0  # variances of where a bird should be: farther off it is another
LONGEST = 60  # frames of a crossing; after longer ones a bird may be anywhere
NEVER = 1e6


class Crossed(NamedTuple):
    """Tracks before crossings are resolved.

    Attributes
    ----------
    px : (F, N, 2) ndarray
        NaN where a bird was not seen.
    blob : (F, N) ndarray of int
        Number of the blob of this frame that a bird shares with others; -1 where it is alone or not seen.
    area : (F, N) ndarray
        px², of the blobs of birds that are alone, else NaN.
    fixed : (F, N) bool ndarray
        Where the identity was set by hand.
    """

    px: np.ndarray
    blob: np.ndarray
    area: np.ndarray
    fixed: np.ndarray


@dataclass
class _Run:
    """Frames in which a track is not alone."""

    track: int
    first: int
    last: int
    before: _State | None = None
    after: _State | None = None


class _State(NamedTuple):
    """State of a bird at an end of a stretch."""

    frame: int
    mean: np.ndarray  # (2, 2): place, velocity by x, y; px, px a frame
    cov: np.ndarray  # (2, 2) of place and velocity, the same for x and y
    size: float  # mean logarithm of its area
    size_var: float


@dataclass(frozen=True)
class _Walk:
    """The random walk of velocities (px²/frame³), and the noise of positions (px²)."""

    q: float
    r: float
    drift: np.ndarray  # (2,) mean velocity
    spread: float  # its variance between birds
    beat: float  # variance of the logarithm of the area of one bird

    @classmethod
    def of(cls, px, area):
        """Estimate both from the variances of second differences over 1 and `LAG` frames: 2/3 q m³ + 6 r."""
        wide, fine = (_variance(px[2 * m :] - 2 * px[m:-m] + px[: -2 * m]) for m in (LAG, 1))
        q = max((wide - fine) / (2 / 3 * (LAG**3 - 1)), 1e-6)
        velocity = np.diff(px, axis=0)
        drift = np.nanmedian(velocity, axis=(0, 1))
        size = np.log(area)
        off = size - _middle(size)
        return cls(q, max((fine - 2 / 3 * q) / 6, 0.01), drift, max(_variance(velocity - drift), q), _variance(off))

    def noise(self, gap):
        return self.q * np.array([[gap**3 / 3, gap**2 / 2], [gap**2 / 2, gap]])

    def state(self, frames, px, size, back=False):
        """Position and velocity at the last of the frames by a Kalman filter; at the first with `back`."""
        order = slice(None, None, -1) if back else slice(None)
        frames, px = frames[order], px[order]
        sign = -1.0 if back else 1.0
        mean, cov = np.array([px[0], sign * self.drift]), np.diag([self.r, self.spread])
        for k in range(1, len(frames)):
            mean, cov = self.ahead(mean, cov, abs(int(frames[k]) - int(frames[k - 1])))
            off, var = px[k] - mean[0], cov[0, 0] + self.r
            if off @ off > JUMP * var:  # set by hand: this is another bird
                mean, cov = np.array([px[k], sign * self.drift]), np.diag([self.r, self.spread])
                continue
            gain = cov[:, 0] / var
            mean = mean + gain[:, None] * off
            cov = cov - np.outer(gain, cov[0])
        known = size[np.isfinite(size)]
        mean = mean * [[1.0], [sign]]
        cov = cov * [[1.0, sign], [sign, 1.0]]
        beats = max(len(known) / BEATS, 1.0)
        return _State(int(frames[-1]), mean, cov, float(known.mean()) if len(known) else np.nan, self.beat / beats)

    def ahead(self, mean, cov, gap):
        step = np.array([[1.0, gap], [0.0, 1.0]])
        return step @ mean, step @ cov @ step.T + self.noise(gap)

    def cost(self, before, after):
        """Minus twice the log likelihood that a bird in the state `before` continues as `after`."""
        gap = after.frame - before.frame
        if not 0 < gap <= LONGEST:
            return NEVER
        mean, cov = self.ahead(before.mean, before.cov, gap)
        cov, off = cov + after.cov, after.mean - mean
        far = float((off * np.linalg.solve(cov, off)).sum())
        cost = (TAILS + 4) * np.log1p(far / TAILS) + 2 * np.log(np.linalg.det(cov))
        if np.isfinite(before.size + after.size):
            var = before.size_var + after.size_var + 1e-4
            cost += (TAILS + 1) * np.log1p((after.size - before.size) ** 2 / var / TAILS)
        return float(cost)


def _variance(values):
    """Variance of one coordinate, from the median absolute deviation."""
    known = np.abs(values[np.isfinite(values)])
    return float((1.4826 * np.median(known)) ** 2) if len(known) else 0.0


def _middle(values):
    """Means of columns; 0 where nothing is known."""
    known = np.isfinite(values)
    return np.where(known, values, 0).sum(0) / np.maximum(known.sum(0), 1)


def renamed(seen: Crossed) -> np.ndarray:
    """The track to which each observed position belongs, after crossings are resolved.

    An identity set by hand is kept, and so is what follows; a crossing that contains one is left unchanged.

    Parameters
    ----------
    seen : Crossed

    Returns
    -------
    (F, N) ndarray of int
        Columns of ``seen.px``; each frame contains each number once.
    """
    frames, tracks = seen.blob.shape
    names = np.tile(np.arange(tracks), (frames, 1))
    there = np.isfinite(seen.px[..., 0])
    alone = there & (seen.blob < 0)
    lone = np.where(alone[..., None], seen.px, np.nan)
    if frames <= 2 * LAG or not np.isfinite(np.diff(lone, axis=0)).any():
        return names
    walk = _Walk.of(lone, seen.area)
    for runs in _crossings(seen, alone, there):
        for run in runs:
            _ends(run, seen, alone, walk)
        _name(runs, names, seen, walk)
    return names


def _crossings(seen, alone, there):
    """Lists of runs of birds that share blobs, in order of time."""
    runs = [run for track in range(alone.shape[1]) for run in _runs(track, alone[:, track], there[:, track])]
    shared: dict[tuple[int, int], int] = {}  # by frame and blob the first run in it
    meet = [np.zeros((0, 2), int)]
    for k, run in enumerate(runs):
        for f in range(run.first, run.last + 1):
            blob = int(seen.blob[f, run.track])
            if blob >= 0:
                meet.append([[k, shared.setdefault((f, blob), k)]])
    parts: dict[int, dict[int, list[_Run]]] = {}
    one, other = np.concatenate(meet).T
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(runs), len(runs)))
    for run, group in zip(runs, connected_components(graph, directed=False)[1].tolist(), strict=True):
        parts.setdefault(group, {}).setdefault(run.track, []).append(run)
    several = [
        [_Run(track, mine[0].first, mine[-1].last) for track, mine in part.items()]
        for part in parts.values()
        if len(part) > 1
    ]
    return sorted(several, key=lambda part: min(run.first for run in part))


def _runs(track, alone, there):
    rows = np.flatnonzero(there)
    if not len(rows):
        return
    busy = np.flatnonzero(~alone[rows[0] : rows[-1] + 1]) + rows[0]
    for part in np.split(busy, np.flatnonzero(np.diff(busy) > APART) + 1):
        if len(part):
            yield _Run(track, int(part[0]), int(part[-1]))


def _ends(run, seen, alone, walk):
    """Fill in the states of a bird before and after a run."""
    rows = np.flatnonzero(alone[:, run.track])
    for name, back in (("before", False), ("after", True)):
        side = rows[rows > run.last][:WINDOW] if back else rows[rows < run.first][-WINDOW:]
        if len(side):
            size = np.log(seen.area[side, run.track])
            setattr(run, name, walk.state(side, seen.px[side, run.track], size, back))


def _name(runs, names, seen, walk):
    """Reassign the birds of a crossing if that is likelier."""
    come, go = [run for run in runs if run.before], [run for run in runs if run.after]
    cost = np.array([[walk.cost(a.before, b.after) for b in go] for a in come]).reshape(len(come), len(go))
    rows, columns = linear_sum_assignment(cost)
    same = np.array([[a is b for b in go] for a in come], bool).reshape(cost.shape)
    if len(rows) == 0 or cost[rows, columns].max() >= NEVER or same.sum() != len(rows):
        return
    if cost[same].sum() - cost[rows, columns].sum() < MARGIN:
        return
    moved = [(come[i], go[j]) for i, j in zip(rows, columns, strict=True) if come[i] is not go[j]]
    tracks = sorted({run.track for pair in moved for run in pair})
    first = min(a.before.frame for a, _ in moved) + 1
    stop = _until(tracks, names, seen, first)
    last = min(stop, max(b.after.frame for _, b in moved))
    if seen.fixed[first : last + 1, tracks].any():  # the identities after it were set by hand
        return
    for f in range(first, last):
        names[f, tracks] = _shared(f, moved, tracks, names[first - 1], seen, walk)
    if last < stop:
        names[last:stop, tracks] = _shared(last, moved, tracks, names[first - 1], seen, walk)


def _until(tracks, names, seen, first):
    """The first frame whose identities were set by hand and are not reassigned."""
    who = sorted({*tracks, *names[first, tracks].tolist()})
    fixed = np.flatnonzero(seen.fixed[first:, who].any(1))
    turns = np.flatnonzero((names[first:, tracks] != names[first, tracks]).any(1))
    return first + min([*fixed[:1].tolist(), *turns[:1].tolist(), len(names) - first])


def _shared(f, moved, tracks, old, seen, walk):
    """The numbers of these tracks in a frame: of a bird within the crossing by where it should be."""
    left = dict.fromkeys(tracks)
    within = []
    for a, b in moved:
        if f >= b.after.frame:
            left[b.track] = old[a.track]
        elif f <= a.before.frame:
            left[a.track] = old[a.track]
        else:
            within.append((old[a.track], _between(a.before, b.after, f)))
    free = [track for track in tracks if left[track] is None]
    if within and free:
        gaps = np.linalg.norm(np.array([at for _, at in within])[:, None] - seen.px[f, free][None], axis=-1)
        for i, j in zip(*linear_sum_assignment(np.where(np.isfinite(gaps), gaps, NEVER)), strict=True):
            left[free[j]] = within[i][0]
    unused = iter(sorted(set(old[tracks].tolist()) - set(left.values())))
    return [next(unused) if left[track] is None else left[track] for track in tracks]


def _between(before, after, f):
    """(2,) place on the cubic that joins two states."""
    gap = after.frame - before.frame
    t = (f - before.frame) / gap
    p, v, q, w = before.mean[0], before.mean[1] * gap, after.mean[0], after.mean[1] * gap
    return (1 + 2 * t) * (1 - t) ** 2 * p + t * (1 - t) ** 2 * v + t * t * (3 - 2 * t) * q + t * t * (t - 1) * w
