"""How much animals turn by chance, and how fast they turn at most, from sightings of them.

A heading that wanders by w rad/√s (`wander` of the herd model) has second differences θ(t+τ) - 2 θ(t) + θ(t-τ) of
variance 2 w² τ while the lag τ is short, and, where neighbours straighten the animal out at a rate k, of

    w² / (2 k) (6 - 8 exp(-k τ) + 2 exp(-2 k τ))

for any lag.  Turning that is meant is smooth, and adds a variance that rises with τ⁴ until the animal means something
else; errors of sighting add the same at every lag (less what smoothing took from the wandering).  All three are fitted
to the variances at several lags, a structure function as of a random walk that is seen through noise [1]_.

References
----------
.. [1] Codling, E. A., Plank, M. J. & Benhamou, S. (2008). Random walk models in biology. Journal of the Royal Society
   Interface 5(25), 813-834.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

LAGS = 9  # at most
LONGEST = 0.4  # s of the longest lag, unless smoothing asks for more
RATES = (0.01, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # 1/s, of straightening out, that are tried
MEANT = (0.03, 0.06, 0.12, 0.25, 1.0)  # s for which an animal means to turn as it does, that are tried
ENOUGH = 100  # second differences that a lag needs
FASTEST = 0.999  # of all turns are slower than the fastest that is told
PARTS = 6  # groups of animals that are left out in turn to tell the error
WORSE = 1.5  # as far off as the best fit: the slowest straightening out that is no worse is believed
HIDDEN = 0.7  # of a time of straightening out: a shortest lag that is longer hides most of the wandering


@dataclass(frozen=True)
class TurnNoise:
    """What sightings tell of how animals turn.

    Attributes
    ----------
    wander : float
        Chance in the heading, rad/√s.
    error : float
        Its standard error, by leaving out groups of animals, rad/√s.
    bound : bool
        Whether it is uncertain and may well be larger, for the herd straightens its animals out faster than is seen.
    fastest : float
        Rate of turning that one turn in a thousand exceeds, rad/s: a limit of turning is no lower.
    """

    wander: float
    error: float
    bound: bool
    fastest: float


def noise_of(sightings, fps, half=0.0) -> TurnNoise | None:
    """Chance in the turning of the animals of a clip; None where too few are followed for long enough.

    Parameters
    ----------
    sightings : Sightings
    fps : float
    half : float
        s to each side over which headings are smoothed (`sightings.Noise.half`); 0 for those that are exact.
    """
    angle = _headings(sightings)
    if angle is None:
        return None
    first = max(1, int(np.ceil(2 * half * fps)))
    last = max(first + 3, round(max(LONGEST, 5 * half) * fps))
    lags = np.unique(np.round(np.geomspace(first, last, LAGS)).astype(int))
    seconds = [_second(angle, lag) for lag in lags]
    whole = _fitted(seconds, lags / fps, np.ones(angle.shape[1], bool))
    if whole is None:
        return None
    group = np.arange(angle.shape[1]) % PARTS
    parts = [_fitted(seconds, lags / fps, group != g) for g in range(PARTS)]
    values = np.array([np.nan if part is None else part[0] for part in parts])
    error = float(np.sqrt((PARTS - 1) * np.nanvar(values)))
    return TurnNoise(whole[0], error, whole[1], _fastest(sightings))


def _headings(sightings):
    """Headings as frames x animals, unwrapped along each track, NaN unknown; None of nobody."""
    known = (sightings.track >= 0) & np.isfinite(sightings.forward[:, 0])
    if not known.any():
        return None
    names, who = np.unique(sightings.track[known], return_inverse=True)
    angle = np.full((len(sightings), len(names)), np.nan)
    forward = sightings.forward[known]
    angle[sightings.frame[known], who] = np.arctan2(forward[:, 1], forward[:, 0])
    return angle


def _second(angle, lag):
    """Second differences of the headings, frames x animals, rad."""
    if len(angle) <= 2 * lag:
        return np.full((0, angle.shape[1]), np.nan)
    before, now, after = angle[: -2 * lag], angle[lag:-lag], angle[2 * lag :]
    return _wrapped(after - now) - _wrapped(now - before)


def _wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _fitted(seconds, lags, who):
    """(wander, whether a lower bound) of some of the animals, or None."""
    rows = []
    for tau, second in zip(lags, seconds, strict=True):
        values = second[:, who]
        values = values[np.isfinite(values)]
        if len(values) >= ENOUGH:  # the middle of the distribution: mix-ups and bumps turn some animals far
            rows.append((tau, (1.4826 * np.median(np.abs(values))) ** 2))
    if len(rows) < 4:
        return None
    tau, variance = np.array(rows).T
    weight = 1 / np.maximum(variance, 1e-12)  # errors are a share of what is measured
    fits = []
    for rate in RATES:
        for meant in MEANT:
            shape = np.column_stack([np.ones(len(tau)), wandering(tau, rate), tau**4 / (1 + (tau / meant) ** 2)])
            size = np.abs(shape * weight[:, None]).max(0)
            fit = lsq_linear(shape * weight[:, None] / size, variance * weight, bounds=([-np.inf, 0, 0], np.inf))
            fits.append((fit.cost, rate, fit.x[1] / size[1]))
    least = min(cost for cost, _, _ in fits)
    _, rate, square = min((fit for fit in fits if fit[0] <= WORSE * least), key=lambda fit: (fit[1], fit[0]))
    return float(np.sqrt(square)), bool(rate * tau[0] > HIDDEN)


def wandering(tau, rate):
    """Variance of second differences at lags (s) of a heading that wanders by 1 rad/√s, straightened out at a rate."""
    return (6 - 8 * np.exp(-rate * tau) + 2 * np.exp(-2 * rate * tau)) / (2 * rate)


def _fastest(sightings):
    turn = np.abs(sightings.turn[np.isfinite(sightings.turn)])
    return float(np.quantile(turn, FASTEST)) if len(turn) else float("nan")
