"""The density of animals at some distance from a body: the pair correlation of the mask of bodies.

It tells how far animals keep from one another where they are too small to be separated, at the scale of a body and not
of a cell.  Of a mask it is the autocorrelation; of a herd whose places are known, a sum over pairs of points on bodies.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from scipy import fft

RING, RINGS = 0.25, 12  # BL; rings of distance
REACH = RING * RINGS
AREA = np.pi * RING**2 * (2 * np.arange(RINGS) + 1)  # BL², of each ring
ACROSS = 0.5 * np.array([-1.0, 1.0])  # of the half width: points on a body
ALONG = np.array([-0.8, -0.4, 0.0, 0.4, 0.8])  # of half the length
FINE = 24  # points along a body, by which its own part is known
NEAREST = 3  # ring from which on others are counted if pixels do not tell all nearer ones
WITHIN = np.array([3, 4, 5, 7, 11])  # rings up to which they are
FEW = 0.2  # others, below which shares mean nothing
KNOWN = 0.5  # of its frames a ring must be told in to count


def pairs_of_mask(mask, px, area) -> np.ndarray:
    """(RINGS,) animals per BL² by distance from a point of a body, which is itself counted; NaN without any.

    Parameters
    ----------
    mask : (h, w) ndarray
        Not 0 where bodies are.
    px : float
        Pixels in a BL; rings between the distances of pixels are NaN.
    area : float
        Pixels of one body.
    """
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    if not len(rows):
        return np.full(RINGS, np.nan)
    bodies = (mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] != 0).astype(np.float32)
    reach = int(np.ceil(REACH * px))
    shape = [fft.next_fast_len(side + reach + 1, real=True) for side in bodies.shape]
    alike = fft.irfft2(np.abs(fft.rfft2(bodies, shape)) ** 2, shape)
    lag = np.arange(-reach, reach + 1)
    ring = (np.hypot(lag[:, None], lag) / px / RING).astype(int)
    ring = np.minimum(ring, RINGS).ravel()
    pairs = np.bincount(ring, alike[np.ix_(lag, lag)].ravel(), RINGS + 1)[:RINGS]
    with np.errstate(invalid="ignore"):
        return pairs / np.bincount(ring, minlength=RINGS + 1)[:RINGS] / bodies.sum() * px**2 / area


def pairs_of_bodies(xy, forward, radius) -> np.ndarray:
    """(RINGS,) the same of animals at (n, 2) BL with (n, 2) unit headings: capsules of one BL."""
    if not len(xy):
        return np.full(RINGS, np.nan)
    along, across = np.meshgrid(0.5 * ALONG, radius * ACROSS)
    points = np.column_stack([along.ravel(), across.ravel()])
    pairs = np.zeros(RINGS)
    _count(np.ascontiguousarray(xy, float), np.ascontiguousarray(forward, float), points, pairs)
    return pairs / (len(xy) * len(points) ** 2) / AREA + _own(round(float(radius), 4))


def pairs_scaled(pairs, by) -> np.ndarray:
    """(T, RINGS) the same in a unit of length that is so many times shorter."""
    middle = np.arange(RINGS) + 0.5
    return np.stack([np.interp(middle / by, middle, row) / by**2 for row in np.asarray(pairs)])


def mean_pairs(rows) -> np.ndarray:
    """(RINGS,) means over frames, of the rings that most of them tell."""
    rows = np.asarray(rows)
    told = np.isfinite(rows).mean(0) >= KNOWN
    return np.where(told, np.nan_to_num(rows).sum(0) / np.maximum(np.isfinite(rows).sum(0), 1), np.nan)


def pairs_off(a, b) -> float:
    """How unlike the numbers of others within some distances of a body are, as shares: 0 the same, 2 nothing alike.

    A body adds 1 to what is nearer than its length, however its pixels blur it.
    """
    both = np.isfinite(a) & np.isfinite(b)
    whole = both[:NEAREST].all()
    both[:NEAREST] = whole
    one, other = (np.maximum(np.cumsum(np.where(both, n, 0.0) * AREA)[WITHIN] - whole, 0.0) for n in (a, b))
    return float(np.mean(2 * np.abs(one - other) / (one + other + FEW)))


@lru_cache(maxsize=64)
def _own(radius):
    """What a body itself adds."""
    side = (np.arange(FINE) + 0.5) / FINE - 0.5
    x, y = (v.ravel() for v in np.meshgrid(side, side))
    inside = np.hypot(np.maximum(np.abs(x) - (0.5 - radius), 0.0), y) <= radius
    points = np.column_stack([x, y])[inside]
    far = np.hypot(*(points[:, None] - points[None]).reshape(-1, 2).T)
    pairs = np.histogram(far, RING * np.arange(RINGS + 1))[0]
    return pairs / len(points) ** 2 / AREA


@njit(cache=True, nogil=True, error_model="numpy")
def _count(xy, forward, points, pairs):
    """Add the pairs of points on different bodies by distance, each as seen from both."""
    reach, far = REACH, (REACH + 1.0) ** 2
    for i in range(len(xy)):
        for j in range(i + 1, len(xy)):
            x, y = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            if x * x + y * y > far:
                continue
            for a in range(len(points)):
                ax = points[a, 0] * forward[i, 0] - points[a, 1] * forward[i, 1]
                ay = points[a, 0] * forward[i, 1] + points[a, 1] * forward[i, 0]
                for b in range(len(points)):
                    dx = x + points[b, 0] * forward[j, 0] - points[b, 1] * forward[j, 1] - ax
                    dy = y + points[b, 0] * forward[j, 1] + points[b, 1] * forward[j, 0] - ay
                    d = np.sqrt(dx * dx + dy * dy)
                    if d < reach:
                        pairs[int(d / RING)] += 2.0
