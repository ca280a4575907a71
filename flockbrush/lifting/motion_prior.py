"""How the birds of a flock move about its middle, read off one camera's picture.

Across the line of sight a bird's way about the middle of its flock is seen, up to the scale of the picture.  It is
taken for a stationary wandering whose probability falls with ``|acceleration|^2 + alignment |velocity|^2 + cohesion
|place|^2``; the two weights are those under which what is seen is likeliest.  Along the line of sight, where nothing is
seen, birds are then taken to move in the same manner (`flockbrush.lifting.lift_solver`).

Alignment comes out too low, by up to two thirds, for birds whose accelerations have no memory at all: second
differences over a lag are then correlated.

The middle itself accelerates, too: by the mean of its birds' own wandering where each flies as it likes, by far more
where a flock turns as one.  How much is seen in the picture as well, once what a straight flight towards or away from
the camera shows is taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.optimize import minimize

LAG = 0.25  # s between the places compared: what is faster is smoothed noise
USUAL = (2.0, 0.3)  # 1/s^2, 1/s^4: defaults if too little is seen; those of boids at a polarization of .99
BOUNDS = ((1e-3, 100.0), (1e-6, 1000.0))  # of the two weights
TURNING = (1e-3, 1.0)  # the bounds of the third


@dataclass(frozen=True)
class Manner:
    """Weights against that of acceleration."""

    alignment: float  # 1/s^2. Its root is how soon a bird gives up a velocity of its own.
    cohesion: float  # 1/s^4
    # of the middle's own acceleration, for each bird: 1 where it is no more than the mean of theirs, less for a flock
    # that turns as one
    turning: float = 1.0


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
    alignment, cohesion = np.exp(np.clip(best.x, *bounds.T)).tolist()
    return Manner(alignment, cohesion, _turning(rays, there, lag, spread[2]))


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


def _turning(rays, there, lag, spread):
    """Weight of the centre's acceleration, from its motion across the line of sight.

    Of a straight flight at even speed a camera sees an acceleration along its way alone: minus twice the relative speed
    away, times the speed across.  That is taken out, the relative speed as a line in time.
    """
    before, now, after = rays[: -2 * lag], rays[lag:-lag], rays[2 * lag :]
    both = there[: -2 * lag] & there[lag:-lag] & there[2 * lag :]
    both &= (both.sum(1) > 1)[:, None]
    frames = both.any(1)
    if not frames.any():
        return 1.0
    count = both.sum(1)[frames, None]

    def middle(values):
        return np.where(both[..., None], values, 0.0).sum(1)[frames] / count

    sight, way, bend = (middle(v) for v in (now, 0.5 * (after - before), after - 2 * now + before))
    sight /= np.linalg.norm(sight, axis=-1, keepdims=True)
    way -= (way * sight).sum(-1, keepdims=True) * sight
    speed = np.linalg.norm(way, axis=-1)
    ahead = way / np.maximum(speed, 1e-12)[:, None]
    along, aside = (bend * ahead).sum(-1), (bend * np.cross(sight, ahead)).sum(-1)
    straight = np.column_stack([speed, speed * np.linspace(-1, 1, len(speed))])
    along = along - straight @ np.linalg.lstsq(straight, along, rcond=None)[0]
    seen = 0.5 * float((count[:, 0] * (along**2 + aside**2)).mean())
    return float(np.clip(spread / max(seen, 1e-300), *TURNING))


def _log_determinant(weights, length, step):
    """Log determinant of the matrix of the three terms along one path of given length."""
    alignment, cohesion, _ = weights
    bands = np.zeros((3, length))
    for weight, steps in ((cohesion, (1,)), (alignment / step**2, (-1, 1)), (1 / step**4, (1, -2, 1))):
        rows = length - len(steps) + 1
        for a, one in enumerate(steps):
            for b, other in enumerate(steps[a:], a):
                bands[2 - (b - a), b : b + rows] += weight * one * other
    return 2.0 * float(np.log(cholesky_banded(bands)[-1]).sum())
