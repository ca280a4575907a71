"""How sure it is which of two birds of a lifted flock is nearer.

The depths of a flight are the likeliest ones of a quadratic cost (`flockbrush.lifting.lift_solver`): its curvature says
how far they could be off, by Laplace's approximation [1]_.  Of each pair of birds the difference of the depths over its
deviation becomes a probability that the order is right.  The deviations are too small, since accelerations of birds are
alike from frame to frame; by how much is known from simulated flocks (`SHARPNESS`).

.. [1] Tierney, L. & Kadane, J. B. (1986). Accurate approximations for posterior moments and marginal densities. Journal
   of the American Statistical Association 81(393), 82-86.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.special import ndtr

SHARPNESS = 0.22  # of the probabilities.  By trial on 24 tight flocks of 5 and 10 birds of `benchmarks/lift.py depth`
MOMENTS = 3  # frames in which pairs are looked at
BIRDS = 12  # in a frame
MOST = 40_000_000  # numbers in the banded system, above which it is not computed


def order_confidence(bands, depth, number, there) -> float:
    """Share of the pairs of birds whose order in depth is expected to be right, .5 to 1; NaN if unknown.

    Parameters
    ----------
    bands : (n, wide) ndarray
        Upper half of the curvature of the cost at these depths, as in `flockbrush.lifting.banded`.
    depth, number, there : (F, N) ndarray
        Depths, rows of the system, and which birds are present.
    """
    if bands.size > MOST or not there.sum(1).max(initial=0) > 1:
        return float("nan")
    frames = [f for f in np.linspace(0, len(there) - 1, MOMENTS + 2).round().astype(int)[1:-1] if there[f].sum() > 1]
    chosen = [_some(np.flatnonzero(there[f])) for f in frames]
    if not chosen:
        return float("nan")
    rows = np.concatenate([number[f, birds] for f, birds in zip(frames, chosen, strict=True)])
    side = np.zeros((len(bands), len(rows)))
    side[rows, np.arange(len(rows))] = 1.0
    covariance = cho_solve_banded((cholesky_banded(bands.T, lower=True), True), side)[rows]
    values, begin = depth[there], 0
    shares = []
    for birds in chosen:
        part = slice(begin, begin + len(birds))
        own, begin = covariance[part, part], part.stop
        i, j = np.triu_indices(len(birds), 1)
        gap = values[rows[part]][i] - values[rows[part]][j]
        deviation = np.sqrt(own[i, i] + own[j, j] - 2 * own[i, j])
        shares.append(ndtr(SHARPNESS * np.abs(gap) / np.maximum(deviation, 1e-12)))
    return float(np.mean(np.concatenate(shares)))


def _some(birds):
    """At most `BIRDS` of them, evenly."""
    return birds[np.unique(np.linspace(0, len(birds) - 1, min(BIRDS, len(birds))).round().astype(int))]
