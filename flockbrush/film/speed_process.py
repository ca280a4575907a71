"""The random process of the speeds of animals: mean, variances, and how soon a speed is forgotten.

The herd model draws speeds from an Ornstein-Uhlenbeck process (paper eq. 6): a deviation from the usual speed is
forgotten at the rate θ, so that the covariance of an animal's speeds at two times falls as exp(-θ τ).  It is measured
on the tracks of a clip, and falls to a rest that does not fall further where animals differ for as long as they are
seen.  Errors of single sights do not last: covariances at lags longer than the smoothing of the tracks are free of
them; where the errors are known, theirs are subtracted at every lag.

What the whole herd does at a time (it speeds up, it slows down) is not of single animals.  The mean of the animals in
each frame tells its variance and how long it lasts, less what chance leaves in a mean of so many.

References
----------
.. [1] Uhlenbeck, G. E. & Ornstein, L. S. (1930). On the theory of the Brownian motion. Physical Review 36, 823-841.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.wander import half_wave_correlation

PAIRS = 200  # pairs of sights of one animal that a covariance needs
TRACKS = 8  # animals that are needed, and groups of them that are left out in turn to tell the error
MANY = 10  # animals at a time whose mean tells what the herd does
FAR = 3.5  # robust deviations: who is slower or faster still is held up or pushed by others, or mistaken for another
CERTAIN = 0.6  # of the rate itself: a greater error and it is not told
CLEARLY = 2.0  # standard errors by which animals differ, and times the chance in a mean by which the herd changes
RATES = np.geomspace(0.05, 10.0, 240)  # 1/s that are tried
USUAL = int(np.argmin(np.abs(RATES - 1.0)))  # row of the rate that is taken where the tracks do not tell one
SMOOTHED = 0.25  # s over which speeds are averages by default
CLEAR = 1.5  # times as long as the average are lags at which errors have gone: at the ends of tracks it is longer
POINTS = 15  # into which such an average is cut
AHEAD = 1.25  # of how fast animals leave the herd's middle: more than so much they do not differ for life
LASTING = 4.0  # s of a clip that tells what a herd does together
TIMES = np.geomspace(0.3, 60.0, 80)  # s that are tried, how long that lasts


@dataclass(frozen=True)
class SpeedProcess:
    """An Ornstein-Uhlenbeck process of speeds about a usual speed of the animal and the moment."""

    mean: float  # BL/s
    # standard deviation of the speeds of an animal in time, without the errors of sighting, BL/s (with them, where the
    # tracks are too short to part the two)
    spread: float
    reversion: float | None  # θ, 1/s; None where the tracks are too short or too few to tell
    error: float  # standard error of the reversion, 1/s, by leaving out groups of animals; NaN unknown
    likely: float = 1.0  # 1/s, what to take for it, told or not
    individual: float = 0.0  # standard deviation of the usual speeds of animals, BL/s
    common: float = 0.0  # standard deviation of the usual speed of the herd in time, BL/s
    common_time: float = 3.0  # s for which that lasts (`flockbrush.behaviours.wander.half_wave_correlation`)

    @property
    def deviation(self) -> float | None:
        """σ of eq. 6, BL/s per √s: what a brush calls the deviation."""
        return None if self.reversion is None else float(self.spread * np.sqrt(2 * self.reversion))


def speed_process(sightings, fps, smoothed=SMOOTHED, errors=None) -> SpeedProcess | None:
    """The process behind the speeds of a clip; None when no speeds are known.

    Parameters
    ----------
    fps : float
    smoothed : float
        s over which the speeds are averages, which is accounted for.
    errors : (k,) array_like, optional
        Covariances of the errors of an animal's speeds so many frames apart, BL²/s², 0 from k on.  Without them, lags
        shorter than ``smoothed`` are not used.
    """
    table, blind = _table(sightings, sightings.speed), errors is None or not len(errors)
    if table is None:
        return None
    own, herd, mean = _own(table)
    if not np.isfinite(own).any():  # nobody has a speed
        return None
    first = max(1, int(np.ceil(CLEAR * smoothed * fps))) if blind else 1
    lags = np.unique(np.round(np.geomspace(first, max(first + 1, 0.6 * len(own)), 16)).astype(int))
    lags = np.concatenate([[] if blind else [0], lags[lags < len(own)]]).astype(int)
    sums = _products(own, lags)  # (lags, animals, 2)
    if not blind:
        wrong = np.zeros(len(own))
        wrong[: len(errors)] = errors[: len(own)]
        sums[..., 0] -= wrong[lags, None] * sums[..., 1]
    shapes = _averaged(lags / fps, smoothed), _averaged([0.0], smoothed)[:, 0]
    most = float(np.nanmean(own**2))
    fastest = min(RATES[-2], 1.5 / smoothed) if blind else np.inf
    own_fit, told, error = _own_process(sums, (*shapes, most, min(most, AHEAD * _leaving(sightings))), fastest)
    common, lasting = _common(herd, fps, int(np.ceil(CLEAR * smoothed * fps)) if blind else 0, own_fit, mean)
    rate = float(RATES[own_fit.row])
    return SpeedProcess(
        mean, float(np.sqrt(own_fit.variance)), rate if told else None, error, rate,
        float(np.sqrt(own_fit.between)), common, lasting,
    )  # fmt: skip


class _Fit(NamedTuple):
    row: int  # of the rate
    variance: float  # of an animal in time, BL²/s²
    between: float  # animals, BL²/s²


def _own_process(sums, seen, fastest):
    """(_Fit, whether its rate is told, the standard error of the rate); ``seen``: what `_fitted` asks for.

    A rate that is not told is between the best one and the usual one, the nearer to this the less certain it is.
    """

    def fitted(chosen, differ, rates=slice(None)):
        shapes, at_once, *most = seen
        return _fitted(sums[:, chosen].sum(1), shapes[rates], at_once[rates], *most, differ)

    def at(row, differ):
        found = fitted(slice(None), differ, [row])
        return _Fit(row, seen[2], 0.0) if found is None else found._replace(row=row)

    if sums.shape[1] < TRACKS:
        return at(USUAL, False), False, np.nan
    group = np.arange(sums.shape[1]) % TRACKS
    for differ in (True, False):
        whole, parts = fitted(slice(None), differ), [fitted(group != g, differ) for g in range(TRACKS)]
        if whole is None or any(part is None for part in parts):
            return at(USUAL, False), False, np.nan
        if whole.between > CLEARLY * np.sqrt((TRACKS - 1) * np.var([part.between for part in parts])):
            break
    rate, rates = RATES[whole.row], RATES[[part.row for part in parts]]
    error = float(np.sqrt((TRACKS - 1) * rates.var()))
    if error < CERTAIN * rate and RATES[1] < rate < fastest:
        return whole, True, error
    row = round(USUAL + (whole.row - USUAL) / (1.0 + (error / rate) ** 2))
    return at(min(row, int(np.searchsorted(RATES, fastest)) - 1), differ), False, error


def _table(sightings, values):
    """Values of sights as frames x animals, NaN without a speed; None without animals."""
    known = (sightings.track >= 0) & np.isfinite(sightings.speed)
    if not known.any():
        return None
    _, who = np.unique(sightings.track[known], return_inverse=True)
    table = np.full((len(sightings), who.max() + 1), np.nan)
    table[sightings.frame[known], who] = values[known]
    return table


def _own(table):
    """(T, n) speeds of animals beyond the herd's at the time; (T, 2) the herd's, and of how many; the mean."""
    known = np.isfinite(table)
    count, mean = known.sum(1), float(np.nanmean(table))
    at_the_time = np.nansum(table, 1) / np.maximum(count, 1)
    common = np.where(count >= MANY, at_the_time, mean)
    own = (table - common[:, None]) * np.sqrt(count / np.maximum(count - 1, 1))[:, None]
    own -= np.nanmedian(own)
    usual = 1.4826 * np.nanmedian(np.abs(own))
    herd = np.column_stack([np.where(count >= MANY, at_the_time, np.nan), count])
    return np.where(np.abs(own) < FAR * usual, own, np.nan), herd, mean


def _leaving(sightings):
    """Mean square of the velocities at which animals leave the middle of the herd, BL²/s².

    Who is faster than others for life gets ahead of them: usual speeds differ no more in a herd that goes one way.
    """
    square = 0.0
    for k in range(2):
        table = _table(sightings, sightings.forward[:, k] * sightings.speed)
        known = np.isfinite(table)
        away = table - (np.nansum(table, 1) / np.maximum(known.sum(1), 1))[:, None]
        seen = known.sum(0)
        square += float(np.average((np.nansum(away, 0) / np.maximum(seen, 1)) ** 2, weights=seen))
    return square


def _products(own, lags):
    """Sum and number of products of speeds so many frames apart, (lags, animals, 2)."""
    filled, known = np.nan_to_num(own), np.isfinite(own).astype(float)
    n = len(own)
    sums = [np.stack([(each[: n - k] * each[k:]).sum(0) for each in (filled, known)], -1) for k in lags]
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


def _fitted(sums, shapes, at_once, most, between_most, differ) -> _Fit | None:
    """The process nearest to the covariances, about usual speeds that ``differ`` or not; None where too few pairs tell.

    Covariances weigh as many as their pairs.  No process varies more than the speeds that were seen, errors and all:
    ``most``, of which ``at_once`` (rates,) is left by the averaging; usual speeds differ by ``between_most`` at most.
    """
    enough = sums[:, 1] >= PAIRS
    if enough.sum() < 3:
        return None
    covariance, weight, shape = sums[enough, 0] / sums[enough, 1], sums[enough, 1], shapes[:, enough]
    weight = weight / weight.sum()
    own, both = shape @ (weight * covariance), (shape**2 * weight).sum(1)
    between = np.zeros(len(shape))
    if differ:
        middle, level = shape @ weight, weight @ covariance
        left = both - middle**2
        between = np.clip((both * level - middle * own) / np.where(left > 1e-9, left, np.inf), 0.0, between_most)
    variance = np.minimum((own - between * (shape @ weight)) / both, (most - between) / at_once)
    off = ((covariance - variance[:, None] * shape - between[:, None]) ** 2 * weight).sum(1)
    off = np.where(variance > 0, off, np.inf)
    best = int(np.argmin(off))
    return _Fit(best, float(variance[best]), float(between[best])) if np.isfinite(off[best]) else None


def _common(herd, fps, first, own, mean):
    """(standard deviation, s) of the usual speed of the herd in time, and how long it lasts; (0, 3) if not told.

    Animals follow it at the rate at which they return to their usual speed, and it lasts longer than they need.
    Lags from ``first`` on are used.
    """
    unsaid = 0.0, SpeedProcess.common_time
    known = np.isfinite(herd[:, 0])
    seconds = len(herd) / fps
    if known.mean() < 0.8 or seconds < LASTING:
        return unsaid
    lags = np.arange(first, len(herd) // 2)
    lags = lags[:: max(1, len(lags) // 60)]
    rate = RATES[own.row]
    chance = own.variance * np.exp(-rate * lags / fps) * float(np.mean(1.0 / herd[known, 1]))
    sums = _products(herd[:, :1] - herd[known, 0].mean(), lags)[:, 0]
    covariance = sums[:, 0] / np.maximum(sums[:, 1], 1) - chance
    every = np.arange(len(herd))
    times = TIMES[(seconds / 3 > TIMES) & (max(first / fps, 1.0 / rate) < TIMES)]
    if not len(times):
        return unsaid
    alike = np.array([_followed(every / fps, time, rate) for time in times])
    lost = (alike * (1.0 - every / len(herd)) * np.where(every > 0, 2.0, 1.0)).sum(1) / len(herd)  # with the mean
    shape = alike[:, lags] - lost[:, None]
    variance = np.maximum((shape * covariance).sum(1) / (shape**2).sum(1), 0.0)
    best = int(np.argmin(((covariance - variance[:, None] * shape) ** 2).sum(1)))
    of_usual = float(covariance[0] / shape[best, 0])
    if of_usual * alike[best, 0] < max(CLEARLY * chance[0], (0.05 * mean) ** 2):
        return unsaid
    return float(np.sqrt(of_usual)), float(times[best])


def _followed(lags, time, rate):
    """Covariance of a speed that follows, at a rate, one of variance 1 that lasts (`half_wave_correlation`)."""
    if rate * time > 50.0:  # at once
        return half_wave_correlation(lags / time)
    u = np.linspace(-2.0, 2.0, 2001) * time
    follows = 0.5 * rate * np.exp(-rate * np.abs(lags[:, None] - u))
    return np.trapezoid(follows * half_wave_correlation(u / time), u, axis=1)
