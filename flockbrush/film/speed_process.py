"""The random process of the speeds of single animals: mean, variance, and rate of reversion.

The herd model draws speeds from an Ornstein-Uhlenbeck process (paper eq. 6): a deviation from the mean is forgotten at
the rate θ, so that the covariance of an animal's speeds at two times falls as exp(-θ τ).  It is measured on the tracks
of a clip.  Errors of single sights do not last: covariances at lags longer than the smoothing of the tracks are free of
them, and the process goes through those at the rate that fits, but varies no more than the speeds that are seen.  What
the whole herd does at a time (it speeds up, it slows down) is not of single animals and is removed.

References
----------
.. [1] Uhlenbeck, G. E. & Ornstein, L. S. (1930). On the theory of the Brownian motion. Physical Review 36, 823-841.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

PAIRS = 200  # pairs of sights of one animal that a covariance needs
TRACKS = 8  # animals that are needed, and groups of them that are left out in turn to tell the error
FAR = 3.5  # robust deviations: who is slower or faster still is held up or pushed by others, or mistaken for another
CERTAIN = 0.6  # of the rate itself: a greater error and it is not told
RATES = np.geomspace(0.05, 20.0, 240)  # 1/s that are tried
USUAL = int(np.argmin(np.abs(RATES - 1.0)))  # row of the rate that is taken where the tracks do not tell one
SMOOTHED = 0.25  # s over which speeds are averages by default
CLEAR = 1.5  # times as long as the average are lags at which errors have gone: at the ends of tracks it is longer
POINTS = 15  # into which such an average is cut


@dataclass(frozen=True)
class SpeedProcess:
    """An Ornstein-Uhlenbeck process of speeds."""

    mean: float  # BL/s
    # standard deviation of the speeds of animals at a time, without the errors of sighting, BL/s (with them, where the
    # tracks are too short to part the two)
    spread: float
    reversion: float | None  # θ, 1/s; None where the tracks are too short or too few to tell
    error: float  # standard error of the reversion, 1/s, by leaving out groups of animals; NaN unknown

    @property
    def deviation(self) -> float | None:
        """σ of eq. 6, BL/s per √s: what a brush calls the deviation."""
        return None if self.reversion is None else float(self.spread * np.sqrt(2 * self.reversion))


def speed_process(sightings, fps, smoothed=SMOOTHED) -> SpeedProcess | None:
    """The process behind the speeds of a clip; None when no speeds are known.

    Parameters
    ----------
    fps : float
    smoothed : float
        s over which the speeds are averages (twice `Noise.half`): shorter lags are not used, and the averaging is
        accounted for.
    """
    table = _table(sightings)
    if table is None:
        return None
    mean, own = _own(table)
    if not np.isfinite(own).any():  # nobody has a speed
        return None
    first = max(1, int(np.ceil(CLEAR * smoothed * fps)))
    lags = np.unique(np.round(np.geomspace(first, max(first + 1, 0.6 * len(own)), 16)).astype(int))
    lags = lags[lags < len(own)]
    sums = _products(own, lags)  # (lags, animals, 2)
    shapes, most = _averaged(lags / fps, smoothed), float(np.nanmean(own**2)) / _averaged([0.0], smoothed)[:, 0]
    whole = _fitted(sums.sum(1), shapes, most)
    spread_now = float(np.sqrt(np.nanmean(own**2)))
    if whole is None:
        return SpeedProcess(mean, spread_now, None, np.nan)
    usual = _fitted(sums.sum(1), *(each[[USUAL]] for each in (shapes, most)))
    unsaid = SpeedProcess(mean, spread_now if usual is None else float(np.sqrt(usual[1])), None, np.nan)
    if own.shape[1] < TRACKS:
        return unsaid
    group = np.arange(own.shape[1]) % TRACKS
    parts = [_fitted(sums[:, group != g].sum(1), shapes, most) for g in range(TRACKS)]
    if any(part is None for part in parts):
        return unsaid
    rates = RATES[[row for row, _ in parts]]
    error = float(np.sqrt((TRACKS - 1) * rates.var()))
    row, variance = whole
    if error < CERTAIN * RATES[row] and RATES[1] < RATES[row] < min(RATES[-2], 1.5 / smoothed):
        return SpeedProcess(mean, float(np.sqrt(variance)), float(RATES[row]), error)
    return replace(unsaid, error=error)


def _table(sightings):
    """Speeds as frames x animals, NaN unknown; None without animals."""
    known = (sightings.track >= 0) & np.isfinite(sightings.speed)
    if not known.any():
        return None
    _, who = np.unique(sightings.track[known], return_inverse=True)
    table = np.full((len(sightings), who.max() + 1), np.nan)
    table[sightings.frame[known], who] = sightings.speed[known]
    return table


def _own(table):
    """The mean, and the difference of each animal's speed from the herd's at the time."""
    known = np.isfinite(table)
    count = known.sum(1)
    mean = np.nansum(table, 1) / np.maximum(count, 1)
    common = np.where(count >= 10, mean, np.nanmean(table))
    own = (table - common[:, None]) * np.sqrt(count / np.maximum(count - 1, 1))[:, None]
    own -= np.nanmedian(own)
    usual = 1.4826 * np.nanmedian(np.abs(own))
    return float(np.nanmean(table)), np.where(np.abs(own) < FAR * usual, own, np.nan)


def _products(own, lags):
    """Sum and number of products of speeds so many frames apart, (lags, animals, 2)."""
    filled, known = np.nan_to_num(own), np.isfinite(own).astype(float)
    sums = [np.stack([(filled[:-k] * filled[k:]).sum(0), (known[:-k] * known[k:]).sum(0)], -1) for k in lags]
    return np.array(sums).reshape(len(lags), own.shape[1], 2)


def _averaged(seconds, smoothed):
    """(rates, lags) the covariances of a process of variance 1 whose speeds are slopes of places over ``smoothed`` s.

    The slope of a line through places is the mean of the speeds under a parabola.
    """
    at = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    weight = 1 - 4 * at**2
    weight /= weight.sum()
    apart, pairs = smoothed * (at[:, None] - at).ravel(), np.outer(weight, weight).ravel()
    lags = np.abs(np.asarray(seconds, float)[:, None] + apart)
    return np.array([np.exp(-rate * lags) @ pairs for rate in RATES])


def _fitted(sums, shapes, most):
    """(row of the rate, variance) of the process nearest to the covariances; None where too few pairs tell of them.

    Covariances weigh as many as their pairs.  No process varies more than the speeds that were seen, errors and all.
    """
    enough = sums[:, 1] >= PAIRS
    if enough.sum() < 3:
        return None
    covariance, weight, shape = sums[enough, 0] / sums[enough, 1], sums[enough, 1], shapes[:, enough]
    variance = np.minimum((shape * weight * covariance).sum(1) / (shape**2 * weight).sum(1), most)
    off = ((covariance - variance[:, None] * shape) ** 2 * weight).sum(1)
    off = np.where(variance > 0, off, np.inf)
    best = int(np.argmin(off))
    return (best, float(variance[best])) if np.isfinite(off[best]) else None
