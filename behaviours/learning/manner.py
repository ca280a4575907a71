"""How the birds of a flock move about its middle, read off one camera's picture.

Across the line of sight a bird's way about the middle of its flock is seen, up to the scale of the picture.  It is
taken for a stationary wandering whose probability falls with ``|acceleration|^2 + alignment |velocity|^2 + cohesion
|place|^2``; the two weights are those under which what is seen is likeliest.  Along the line of sight, where nothing is
seen, birds are then taken to move in the same manner (`behaviours.learning.lift`).

Alignment comes out too low, by up to two thirds, for birds whose accelerations have no memory at all: second
differences over a lag are then correlated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.optimize import minimize

LAG = 0.25  # s between the places compared: what is faster is smoothed noise
USUAL = (2.0, 0.3)  # 1/s^2, 1/s^4: where too little is seen to tell; those of boids at a polarization of .99
BOUNDS = ((1e-3, 100.0), (1e-6, 1000.0))  # of the two weights


@dataclass(frozen=True)
class Manner:
    """Weights against that of acceleration.

    Attributes
    ----------
    alignment : float
        1/s^2.  Its root is how soon a bird gives up a velocity of its own.
    cohesion : float
        1/s^4.
    """

    alignment: float
    cohesion: float


def compute_manner(rays, there, fps) -> Manner:
    """The manner of a flock.

    Parameters
    ----------
    rays : (F, N, 3) ndarray
        Unit vectors towards birds, smoothed.
    there : (F, N) ndarray of bool
    fps : float
    """
    life = int(np.median(there.sum(0)))
    lag = max(1, min(round(LAG * fps), (life - 1) // 3))
    spread = [_spread(rays, there, lag, steps) for steps in ((1.0,), (-1.0, 1.0), (1.0, -2.0, 1.0))]
    length = life // lag
    if not all(value > 0 for value in spread) or length < 4:
        return Manner(*USUAL)
    step = lag / fps
    seen = np.array([spread[0] * length, spread[1] * (length - 1) / step**2, spread[2] * (length - 2) / step**4])
    bounds = np.log(BOUNDS)

    def surprise(logs):
        """Minus the logarithm of the likelihood, for each path seen; the scale of the picture left free."""
        weights = np.append(np.exp(np.clip(logs, *bounds.T)), 1.0)
        return 0.5 * length * np.log(weights[[1, 0, 2]] @ seen) - 0.5 * _log_determinant(weights, length, step)

    best = minimize(surprise, np.log(USUAL), method="Nelder-Mead", options={"xatol": 0.01, "fatol": 1e-4})
    return Manner(*np.exp(np.clip(best.x, *bounds.T)).tolist())


def _spread(rays, there, lag, steps):
    """Mean square of a difference of places about the flock's middle, at depth 1."""
    reach = lag * (len(steps) - 1)
    parts = [slice(k * lag, len(rays) - reach + k * lag) for k in range(len(steps))]
    both = np.logical_and.reduce([there[part] for part in parts])
    change = sum(step * rays[part] for step, part in zip(steps, parts, strict=True))
    change = np.where(both[..., None], change, 0.0)
    count = both.sum(1)
    about = np.where(both[..., None], change - change.sum(1, keepdims=True) / np.maximum(count, 1)[:, None, None], 0.0)
    freedom = 2.0 * np.maximum(count - 1, 0).sum()
    return float((about**2).sum() / freedom) if freedom else 0.0


def _log_determinant(weights, length, step):
    """Of the matrix of the three terms along one path of so many places."""
    alignment, cohesion, _ = weights
    bands = np.zeros((3, length))
    for weight, steps in ((cohesion, (1,)), (alignment / step**2, (-1, 1)), (1 / step**4, (1, -2, 1))):
        rows = length - len(steps) + 1
        for a, one in enumerate(steps):
            for b, other in enumerate(steps[a:], a):
                bands[2 - (b - a), b : b + rows] += weight * one * other
    return 2.0 * float(np.log(cholesky_banded(bands)[-1]).sum())
