"""Tracks of animals from the bodies of all frames: position, heading, speed and rate of turning.

1. Bodies are matched from frame to frame near their predicted positions (`flockbrush.film.body_matching`). A new body
   is predicted from the optical flow, or from the motion of its neighbours.
2. The head end of each body is chosen: of all assignments of heads along a track, the one with the least turning and
   the most forward motion (Viterbi algorithm [2]_). For animals that stand, the end that looks like the heads of
   walking animals is chosen (`flockbrush.film.heads`).
3. Heading and rate of turning come from local polynomials through the body *axes* [1]_. Axes are more accurate than
   positions: an error of .02 body lengths (BL) in positions gives an error of some tenths of a radian per second in the
   rate of turning of a walking animal, an error of 1.5° in axes only a few hundredths.

References
----------
.. [1] Savitzky, A. & Golay, M. J. E. (1964). Smoothing and differentiation of data by simplified least squares
   procedures. Analytical Chemistry 36(8), 1627-1639.
.. [2] Forney, G. D. (1973). The Viterbi algorithm. Proceedings of the IEEE 61(3), 268-278.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from flockbrush.film.body_matching import follow
from flockbrush.film.heads import by_looks
from flockbrush.film.local_fits import fitted_along
from flockbrush.film.observations import Sightings
from flockbrush.film.path_smoothing import SightSmoothing

SHORTEST = 4  # sights: a shorter track is no animal
HALF = 0.08  # s to each side over which a track is smoothed, at least
LONGEST = 0.32  # s, at most
TURN_NOISE = 0.25  # rad/s: where the turning is less certain, a longer stretch is smoothed
UNSURE = 2.5  # times as noisy as usual: at the ends of tracks no turning is told
SMALL = 0.75  # of the usual area
WALKED, SURE_WAY = 0.3, 8.0  # BL, and times the noise of a place: so far gone, the way tells how a body lies
ACROSS = 0.8  # cosine of the angle between body and way: below, the axis seen is not the body's
PUSHED, BESIDE = 6, 0.87  # times as long, and cosine: along that way lies who was pushed aside by others for a moment
TOUCHES = 0.5  # weight of the axis of a body that touches others
AROUND, PARALLEL = 5, 0.8  # bodies that touch no other, and how alike they lie, to tell how those beside them lie
STILL = 0.25  # BL: an animal that moved less in all has a head at one end or the other


@dataclass(frozen=True)
class SightingNoise:
    """Standard deviations of the errors of the sightings of a clip, estimated from the tracks themselves.

    Errors that last longer than a few frames are not included, for example those of a mask without the heads, or of a
    drift in the stabilised picture.
    """

    xy: float  # BL, of a body before smoothing
    axis: float  # rad, of a body before smoothing
    place: float  # BL, of `Sightings.xy`, along each direction
    heading: float  # rad, of `Sightings.forward`
    speed: float  # BL/s
    turn: float  # rad/s, the rate over `half` seconds to each side
    half: float  # s to each side that heading and turning are smoothed over

    def smoothing(self, fps) -> SightSmoothing | None:
        """The smoother of the sightings; None if unknown."""
        if not np.isfinite((self.xy, self.axis, self.half)).all():
            return None
        return SightSmoothing(round(self.half * fps), self.xy, self.axis)

    def speed_errors(self, fps) -> np.ndarray:
        """(k,) covariances of the errors of an animal's speeds so many frames apart, BL²/s²; empty if unknown.

        Speeds are slopes of lines through the places of ``2 half`` s.
        """
        if not np.isfinite((self.speed, self.half)).all():
            return np.zeros(0)
        weight = np.arange(-round(self.half * fps), round(self.half * fps) + 1.0)
        return self.speed**2 * np.correlate(weight, weight, "full")[len(weight) - 1 :] / (weight @ weight)


UNKNOWN = SightingNoise(*[float("nan")] * 7)


def sightings_of(frames, fps, to_bl, flow=None) -> tuple[Sightings, SightingNoise]:
    """Sightings of the animals of a clip, from the bodies of its frames.

    Parameters
    ----------
    frames : list of Bodies
        One per frame, in pixels of the reference picture (see `Bodies.moved`).
    fps : float
        Frames per second.
    to_bl : (2, 3) ndarray
        Map from pixels of the reference picture to BL, y up.
    flow : list of (k, 2) ndarray, optional
        For each frame, the motion of each of its bodies to the next frame, px; NaN where unknown.

    Returns
    -------
    Sightings
        Position (BL), heading (unit vectors), speed (BL/s) and rate of turning (rad/s) of each animal in each frame.
        Of a single frame only positions and axes are known; the other values are NaN.
    SightingNoise
        `UNKNOWN` for a single frame, or where there are no tracks.
    """
    m = np.asarray(to_bl, float)
    scale = float(np.sqrt(abs(np.linalg.det(m[:, :2]))))
    xy = [b.xy @ m[:, :2].T + m[:, 2] for b in frames]
    axis = [b.axis @ m[:, :2].T / scale for b in frames]
    if len(frames) == 1:
        return _at_rest(xy[0], _along_others(xy[0], axis[0], frames[0].alone)), UNKNOWN
    moves = None if flow is None else [np.asarray(f, float) @ m[:, :2].T for f in flow]
    names = _without_specks(follow(xy, axis, moves), xy, [b.area for b in frames], [b.alone for b in frames])
    ends = np.concatenate([b.ends for b in frames]) if _alike([b.ends for b in frames if len(b)]) else None
    weight = np.where(np.concatenate([b.alone for b in frames]), 1.0, TOUCHES)
    return _animals(xy, axis, weight, ends, names, float(fps))


def _without_specks(names, xy, area, alone):
    """The track numbers (list of (k,) int), with -1 for specks of the ground.

    A speck is smaller than `SMALL` of the median area, touches no other body and never moves, while the herd moves.
    """
    name = np.concatenate([*names, np.zeros(0, int)])
    if not len(name):
        return names
    at, area, alone = np.concatenate(xy), np.concatenate(area), np.concatenate(alone)
    count = np.bincount(name)
    small = np.bincount(name, area < SMALL * np.median(area)) > 0.8 * count
    lonely = np.bincount(name, alone) > 0.8 * count
    low, high = np.full((len(count), 2), np.inf), np.full((len(count), 2), -np.inf)
    np.minimum.at(low, name, at)
    np.maximum.at(high, name, at)
    extent = np.hypot(*(high - low).T)
    speck = small & lonely & (extent < STILL)
    herd = extent[(count >= SHORTEST) & ~speck]
    if not len(herd) or np.median(herd) < STILL:  # a herd that rests: lambs rest as well
        return names
    return [np.where(speck[n], -1, n) for n in names]


def _alike(ends):
    """Whether the same number of features is known of the ends of all bodies."""
    return len({e.shape[1] for e in ends}) == 1


# what they do -------------------------------------------------------------------------------------------------------


def _animals(xy, axis, weight, ends, names, fps):
    """Sightings and their noise, from bodies with track numbers."""
    count = len(xy)
    name = np.concatenate([*names, np.zeros(0, int)])
    frame = np.repeat(np.arange(count), [len(p) for p in xy])
    if not len(name):
        return _nobody(count), UNKNOWN
    at, along = np.concatenate(xy), np.concatenate(axis)
    order = np.lexsort((frame, name))
    name, frame, at, along = name[order], frame[order], at[order], along[order]
    weight = weight[order]
    begin = np.concatenate([[0], np.flatnonzero(np.diff(name)) + 1, [len(name)]])
    long = (np.diff(begin) >= SHORTEST) & (name[begin[:-1]] >= 0)
    keep = np.repeat(long, np.diff(begin))
    begin = np.concatenate([[0], np.cumsum(np.diff(begin)[long])])
    ends = np.zeros((len(order), 0)) if ends is None else ends[order]
    return _smoothed(frame[keep], at[keep], along[keep], weight[keep], ends[keep], begin, count, fps)


def _at_rest(xy, axis):
    """Sightings of a single picture; heads and motion are unknown (NaN)."""
    n, unknown = len(xy), np.full(len(xy), np.nan)
    return Sightings(np.array([0, n]), xy, axis, unknown, unknown.copy(), np.arange(n))


def _along_others(xy, axis, alone):
    """The axes of the bodies of a single picture; of one across parallel bodies that it touches, theirs.

    Parallel bodies side by side fill the same pixels as bodies across them; those that touch no other tell which.
    """
    if alone.sum() < AROUND or alone.all():
        return axis
    lone = np.exp(2j * np.arctan2(axis[alone, 1], axis[alone, 0]))
    around = lone[cKDTree(xy[alone]).query(xy, k=AROUND)[1]].mean(1)
    common = np.column_stack([np.cos(0.5 * np.angle(around)), np.sin(0.5 * np.angle(around))])
    across = ~alone & (np.abs(around) > PARALLEL) & (np.abs((common * axis).sum(1)) < ACROSS)
    return np.where(across[:, None], common, axis)


def _nobody(count):
    return Sightings(np.zeros(count + 1, int), *np.zeros((2, 0, 2)), *np.zeros((2, 0)), np.zeros(0, int))


def _smoothed(frame, at, along, weight, ends, begin, count, fps):
    """Sightings and their noise, from tracks stored one after the other.

    Parameters
    ----------
    frame : (k,) ndarray of int
    at, along : (k, 2) ndarray
        Positions (BL) and axes (unit vectors).
    weight : (k,) ndarray
        How much the axis counts.
    ends : (k, m) ndarray
        Features of the ends, see `Bodies.ends`.
    begin : (tracks + 1,) ndarray
        First row of each track, and the number of rows.
    count : int
        Frames of the clip.
    fps : float
    """
    if not len(frame):
        return _nobody(count), UNKNOWN
    noise_xy = max(_third(at[:, 0], frame, begin), _third(at[:, 1], frame, begin))
    angle = np.empty(len(frame))
    firm = max(noise_xy, 0.005)
    along, aside = _along_the_way(frame, at, along, begin, max(2, round(HALF * fps)), firm)
    weight = np.where(aside, 0.5 * weight, weight)
    _heads(at, along, begin, firm, np.zeros(len(frame)), angle)
    looks = by_looks(ends, along, np.column_stack([np.cos(angle), np.sin(angle)]), at, begin, firm, fps)
    if looks.any():
        _heads(at, along, begin, firm, looks, angle)
    noise_axis = max(_third(angle, frame, begin), 1e-3)
    half = _half(noise_axis, fps)
    out_frame, out_track = _present(frame, begin)
    out = np.full((len(out_frame), 8), np.nan)
    first = np.concatenate([[0], np.cumsum(np.bincount(out_track, minlength=len(begin) - 1))])
    fitted_along(frame.astype(np.float64), at, angle, weight, begin, float(half), 4 * noise_axis, out_frame, first, out)
    place, v = out[:, 0:2], out[:, 2:4] * fps
    forward = np.column_stack([np.cos(out[:, 4]), np.sin(out[:, 4])])
    spread_turn, spread_v = out[:, 6], out[:, 7]
    turn = np.where(spread_turn < UNSURE * np.median(spread_turn), out[:, 5] * fps, np.nan)
    order = np.lexsort((out_track, out_frame))
    size = np.bincount(out_frame, minlength=count)
    speed = np.maximum((v * forward).sum(1), 0.0)
    sightings = Sightings(
        np.concatenate([[0], np.cumsum(size)]), place[order], forward[order], speed[order], turn[order],
        out_track[order],
    )  # fmt: skip
    n = 2 * half + 1
    typical = np.nanmedian(spread_turn), np.nanmedian(spread_v)
    noise = SightingNoise(
        noise_xy, noise_axis, noise_xy * np.sqrt(2.25 / n), noise_axis * np.sqrt(2.25 / n),
        noise_xy * fps * float(typical[1]), noise_axis * fps * float(typical[0]), half / fps,
    )  # fmt: skip
    return sightings, noise


def _half(noise_axis, fps):
    """Half-width of the smoothing window, frames: the least at which the error of turning is below `TURN_NOISE`."""
    least, most = max(2, round(HALF * fps)), max(2, round(LONGEST * fps))
    for half in range(least, most):
        n = 2 * half + 1
        if noise_axis * fps * np.sqrt(12 / (n * (n * n - 1))) < TURN_NOISE:
            return half
    return most


def _third(values, frame, begin):
    """Standard deviation of the noise of values along tracks, from their third differences; NaN without any.

    Third differences of smooth motion are almost 0; the factor sqrt(20) is the norm of (1, -3, 3, -1).
    """
    d = values[3:] - 3 * values[2:-1] + 3 * values[1:-2] - values[:-3]
    together = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
    ok = (together[3:] == together[:-3]) & (frame[3:] - frame[:-3] == 3)
    return float(1.4826 * np.median(np.abs(d[ok])) / np.sqrt(20)) if ok.any() else np.nan


def _present(frame, begin):
    """Frames and track numbers of all sightings, including those between two observations of a track."""
    frames = [np.arange(frame[a], frame[b - 1] + 1) for a, b in zip(begin[:-1], begin[1:], strict=True)]
    return np.concatenate(frames), np.repeat(np.arange(len(begin) - 1), [len(f) for f in frames])


def _along_the_way(frame, at, along, begin, half, noise):
    """Axes, replaced by the direction of motion where a fast animal seems to lie across it.

    A fast animal moves along its body. An axis across the motion comes from two bodies that touch, or from a round
    body. Who was pushed aside for a moment lies along the way it goes in the long run. Also returns where they were
    replaced (bool).
    """
    way, distance, seen = _way(frame, at, begin, half)
    fast = (distance > WALKED) & (distance > SURE_WAY * noise) & (seen <= 2 * half)
    in_the_long_run = _way(frame, at, begin, PUSHED * half)[0]
    aside = fast & (np.abs((way * along).sum(1)) < ACROSS) & (np.abs((in_the_long_run * along).sum(1)) < BESIDE)
    return np.where(aside[:, None], way, along), aside


def _way(frame, at, begin, half):
    """Direction (k, 2), length (k,) and frames of the way from `half` rows before each row to `half` rows after it."""
    track, row = np.repeat(np.arange(len(begin) - 1), np.diff(begin)), np.arange(len(frame))
    low, high = np.maximum(row - half, begin[:-1][track]), np.minimum(row + half, begin[1:][track] - 1)
    way = at[high] - at[low]
    distance = np.hypot(*way.T)
    return way / np.maximum(distance, 1e-12)[:, None], distance, frame[high] - frame[low]


@njit(cache=True, nogil=True)
def _heads(at, along, begin, noise, looks, angle):
    """Write the heading (rad, unwrapped) of each body into `angle`.

    Viterbi algorithm over the two possible heads of each body: the cost is 8 (1 - cos) for a turn between frames, minus
    the normalised forward motion, minus half of `looks`, the log odds that the axis points to the head.
    """
    for track in range(len(begin) - 1):
        a, b = begin[track], begin[track + 1]
        back = np.zeros((b - a, 2), np.int64)
        cost = np.zeros(2)
        for k in range(a, b):
            lo, hi = max(a, k - 3), min(b - 1, k + 3)
            dx, dy = at[hi, 0] - at[lo, 0], at[hi, 1] - at[lo, 1]
            forwards = (dx * along[k, 0] + dy * along[k, 1]) / (2.5 * noise + 0.02)
            forwards = min(max(forwards, -4.0), 4.0)
            new = np.zeros(2)
            for s in range(2):
                if k > a:
                    same = along[k, 0] * along[k - 1, 0] + along[k, 1] * along[k - 1, 1]
                    best = cost[0] + 8.0 * (1.0 - (same if s == 0 else -same))
                    other = cost[1] + 8.0 * (1.0 - (-same if s == 0 else same))
                    back[k - a, s] = 0 if best <= other else 1
                    new[s] = min(best, other)
                ahead = forwards + 0.5 * looks[k]
                new[s] += -ahead if s == 0 else ahead
            cost[:] = new
        s = 0 if cost[0] <= cost[1] else 1
        for k in range(b - 1, a - 1, -1):
            sign = 1.0 if s == 0 else -1.0
            angle[k] = np.arctan2(sign * along[k, 1], sign * along[k, 0])
            s = back[k - a, s]
        for k in range(a + 1, b):
            angle[k] -= 2 * np.pi * np.round((angle[k] - angle[k - 1]) / (2 * np.pi))
