"""Fitting a line, a V or a parabola to birds of whom some are out of line (Klotsman & Tal, section 4, step 2).

The paper's RANSAC [1]_ tries random smallest samples; flocks are small enough to try all of them, which is exact and
repeats itself.  A curve is scored by MSAC [2]_: each bird costs the square of its distance from the curve, in
tolerances, and at most 1.

.. [1] Fischler, M. A. & Bolles, R. C. (1981). Random sample consensus. Comm. of the ACM 24(6), 381-395.
.. [2] Torr, P. H. S. & Zisserman, A. (2000). MLESAC. Computer Vision and Image Understanding 78(1), 138-156.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.formation.formation_shapes import MODELS, Curve, basis, slopes
from flockbrush.engine.noise import Noise
from numba import njit

TOLERANCE = 0.5  # wingspans from the curve: farther is out of line
PER_NUMBER = 0.5  # what each number of a curve beyond two costs, in birds
ALL_UP_TO = 100  # birds: more would take too long, and are sampled
LINE, V, PARABOLA = 0, 1, 2


class CurveFit(NamedTuple):
    """A curve, what it costs, and who is near it."""

    curve: Curve
    cost: float
    inlier: np.ndarray  # (n,) bool


def fit(model, x, y, tolerance=TOLERANCE, samples=None, seed=0, upside_down=False):
    """The best curve of a model through birds seen from the leader, or None when none fits.

    Parameters
    ----------
    model : str
        ``line``, ``v`` (its apex at x = 0) or ``parabola``.
    x, y : ndarray (n,)
        Wingspans to the right and ahead of the leader.
    tolerance : float
        Wingspans.
    samples : int, optional
        RANSAC with so many random samples; all samples by default.
    upside_down : bool
        Look for a V or a parabola that opens forward.

    Returns
    -------
    Fit or None
    """
    x, y = np.ascontiguousarray(x, float), np.ascontiguousarray(y, float)
    n, p = len(x), MODELS[model]
    if n <= p or (model == "v" and not ((x < 0).any() and (x > 0).any())):
        return None
    columns, tilts, code = basis(model, x), slopes(model, x), list(MODELS).index(model)
    sign = -1.0 if upside_down else 1.0
    if samples is None and n <= ALL_UP_TO:
        draws = np.zeros((0, 3), np.int64)
    else:
        draws = (Noise(seed).uniform("ransac", n, np.arange(samples or 4000), 3) * n).astype(np.int64)
    numbers, cost = _best(columns, tilts, y, tolerance, code, sign, draws)
    if not np.isfinite(cost):
        return None
    for _ in range(8):  # least squares through those near it, as long as that helps
        near = _distance(columns, tilts, y, numbers) <= tolerance
        if near.sum() < p:
            break
        weight = 1.0 / np.sqrt(1.0 + (tilts[near] @ numbers) ** 2)
        better = np.linalg.lstsq(columns[near] * weight[:, None], y[near] * weight, rcond=None)[0]
        less = _cost(columns, tilts, y, better, tolerance)
        if not less < cost or not _lawful(better, code, sign):
            break
        numbers, cost = better, less
    return CurveFit(
        Curve(model, tuple(map(float, numbers))), float(cost) + PER_NUMBER * (p - 2),
        _distance(columns, tilts, y, numbers) <= tolerance,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _lawful(numbers, code, sign):
    """A V and a parabola open backward; ``sign`` -1 turns that round."""
    if code == V:
        return sign * numbers[1] > 0.0 and sign * numbers[2] > 0.0
    if code == PARABOLA:
        return sign * numbers[2] < 0.0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _distance(columns, tilts, y, numbers):
    """Distance of each bird from the curve: its residual, at right angles to the slope there."""
    out = np.empty(len(y))
    for i in range(len(y)):
        at = tilt = 0.0
        for k in range(len(numbers)):
            at += columns[i, k] * numbers[k]
            tilt += tilts[i, k] * numbers[k]
        out[i] = abs(y[i] - at) / np.sqrt(1.0 + tilt * tilt)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _cost(columns, tilts, y, numbers, tolerance, stop=np.inf):
    total = 0.0
    for i in range(len(y)):
        at = tilt = 0.0
        for k in range(len(numbers)):
            at += columns[i, k] * numbers[k]
            tilt += tilts[i, k] * numbers[k]
        r2 = (y[i] - at) ** 2 / (1.0 + tilt * tilt) / (tolerance * tolerance)
        total += min(r2, 1.0)
        if total >= stop:
            break
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _through(columns, y, sample, p, numbers):
    """The curve through a smallest sample, by Cramer's rule; False when there is none."""
    a, b = sample[0], sample[1]
    if p == 2:
        det = columns[a, 0] * columns[b, 1] - columns[a, 1] * columns[b, 0]
        if abs(det) < 1e-9:
            return False
        numbers[0] = (y[a] * columns[b, 1] - columns[a, 1] * y[b]) / det
        numbers[1] = (columns[a, 0] * y[b] - y[a] * columns[b, 0]) / det
        return True
    # the first column is 1 everywhere
    c = sample[2]
    u1, u2, uy = columns[b, 1] - columns[a, 1], columns[b, 2] - columns[a, 2], y[b] - y[a]
    w1, w2, wy = columns[c, 1] - columns[a, 1], columns[c, 2] - columns[a, 2], y[c] - y[a]
    det = u1 * w2 - u2 * w1
    if abs(det) < 1e-9:
        return False
    numbers[1] = (uy * w2 - u2 * wy) / det
    numbers[2] = (u1 * wy - uy * w1) / det
    numbers[0] = y[a] - numbers[1] * columns[a, 1] - numbers[2] * columns[a, 2]
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _best(columns, tilts, y, tolerance, code, sign, draws):
    """The numbers of the cheapest lawful curve through a smallest sample; all samples where none are drawn."""
    n, p = columns.shape
    best, cost = np.zeros(p), np.inf
    numbers, sample = np.zeros(p), np.zeros(3, np.int64)
    if len(draws):
        for s in range(len(draws)):
            sample[:] = draws[s]
            if _through(columns, y, sample, p, numbers) and _lawful(numbers, code, sign):
                now = _cost(columns, tilts, y, numbers, tolerance, cost)
                if now < cost:
                    cost, best[:] = now, numbers
        return best, cost
    for a in range(n):
        for b in range(a + 1, n):
            for c in range(b + 1, n if p == 3 else b + 2):
                sample[0], sample[1], sample[2] = a, b, c
                if _through(columns, y, sample, p, numbers) and _lawful(numbers, code, sign):
                    now = _cost(columns, tilts, y, numbers, tolerance, cost)
                    if now < cost:
                        cost, best[:] = now, numbers
    return best, cost
