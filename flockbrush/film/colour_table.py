"""A table of colours that tells animals from the ground, with 32 levels each of blue, green and red.

The table has `LEVELS` ** 3 entries, 1 for colours of animals; a kernel looks up each pixel.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter

LEVELS, SHIFT = 32, 3  # of red, green and blue in the table; bits of 256 levels that it forgets
AT_HOME = 3.0, 10.0  # times as common among what moves as elsewhere: an animal's colour, least and most


@njit(cache=True, nogil=True)
def index_of(picture):
    """Entry of the table for each pixel of a picture: (h, w, 3) uint8 BGR to (h, w) int32."""
    h, w = picture.shape[:2]
    rows = np.empty((h, w), np.int32)
    for y in range(h):
        for x in range(w):
            b, g, r = picture[y, x, 0], picture[y, x, 1], picture[y, x, 2]
            rows[y, x] = ((b >> SHIFT) * LEVELS + (g >> SHIFT)) * LEVELS + (r >> SHIFT)
    return rows


@njit(cache=True, nogil=True)
def looked_up(picture, table):
    """Value of the table for each pixel of a picture: (h, w, 3) uint8 BGR to (h, w) uint8."""
    h, w = picture.shape[:2]
    table_values = np.empty((h, w), np.uint8)
    for y in range(h):
        for x in range(w):
            b, g, r = picture[y, x, 0], picture[y, x, 1], picture[y, x, 2]
            table_values[y, x] = table[((b >> SHIFT) * LEVELS + (g >> SHIFT)) * LEVELS + (r >> SHIFT)]
    return table_values


def valley(away, counts):
    """The threshold that separates two groups of distances best (Otsu [1]_).

    Parameters
    ----------
    away : (n,) ndarray
        Distances, 0 to 256 grey levels.
    counts : (n,) ndarray
        How often each occurs.

    References
    ----------
    .. [1] Otsu, N. (1979). A threshold selection method from gray-level histograms. IEEE Transactions on Systems, Man,
       and Cybernetics 9(1), 62-66.
    """
    weight, edges = np.histogram(away, bins=128, range=(0, 256), weights=counts)
    share = np.cumsum(weight) / max(weight.sum(), 1)
    middle = (edges[:-1] + edges[1:]) / 2
    mean = np.cumsum(weight * middle) / max(weight.sum(), 1)
    between = (mean[-1] * share - mean) ** 2 / np.maximum(share * (1 - share), 1e-9)
    return edges[1 + int(np.argmax(between))]


def lab_of_table():
    """Lab colour of the middle of each entry of the table, (LEVELS ** 3, 3) float32, as OpenCV scales it."""
    step = 256 // LEVELS
    levels = np.arange(LEVELS, dtype=np.uint8) * step + step // 2
    bgr = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), -1).reshape(-1, 1, 3)
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2LAB).reshape(-1, 3).astype(np.float32)


def colours_at_home(index, bodies, elsewhere):
    """The table of the colours that are more frequent among bodies than elsewhere.

    Parameters
    ----------
    index : (n,) int ndarray
        Entry of the table of each pixel, as from `index_of`.
    bodies, elsewhere : (n,) bool ndarray
        Pixels of moving bodies, and of the rest of the picture.

    Returns
    -------
    (LEVELS ** 3,) uint8 ndarray
        1 for colours of animals. Rare colours are judged together with similar ones.
    """
    a, b = (np.bincount(index[chosen], minlength=LEVELS**3).astype(float) for chosen in (bodies, elsewhere))
    ratio = np.zeros(LEVELS**3)
    known = np.zeros(LEVELS**3, bool)
    for width in (0.8, 2.0, 4.0):  # rare colours are judged with their neighbours
        fine, coarse = (gaussian_filter(c.reshape([LEVELS] * 3), width).ravel() for c in (a, b))
        enough = ~known & (fine + coarse > 0.5)
        ratio[enough] = ((fine / max(a.sum(), 1)) / np.maximum(coarse / max(b.sum(), 1), 1e-7))[enough]
        known |= enough
    return (ratio > _homely(ratio, a)).astype(np.uint8)


def _homely(ratio, bodies):
    """The frequency ratio above which a colour belongs to animals: the valley of all ratios, within `AT_HOME`."""
    low, high = AT_HOME
    at = np.clip(np.log(np.maximum(ratio, 1e-6)), -3.0, 9.0)
    return float(np.clip(np.exp(valley((at + 3.0) * (256 / 12.0), bodies) * 12.0 / 256 - 3.0), low, high))
