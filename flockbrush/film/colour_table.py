"""A table of colours, 1 for those of animals: looked up for every pixel, and counted together from pictures."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from scipy.ndimage import gaussian_filter

LEVELS, SHIFT = 32, 3  # of red, green and blue in the table; bits of 256 levels that it forgets
AT_HOME = 3.0, 10.0  # times as common among what moves as elsewhere: an animal's colour, least and most


@njit(cache=True, nogil=True)
def index_of(picture):
    """Row of the table for every pixel of a picture, (h, w, 3) -> (h, w)."""
    h, w = picture.shape[:2]
    rows = np.empty((h, w), np.int32)
    for y in range(h):
        for x in range(w):
            b, g, r = picture[y, x, 0], picture[y, x, 1], picture[y, x, 2]
            rows[y, x] = ((b >> SHIFT) * LEVELS + (g >> SHIFT)) * LEVELS + (r >> SHIFT)
    return rows


@njit(cache=True, nogil=True)
def looked_up(picture, table):
    """What the table says of every pixel, (h, w, 3) -> (h, w) uint8."""
    h, w = picture.shape[:2]
    table_values = np.empty((h, w), np.uint8)
    for y in range(h):
        for x in range(w):
            b, g, r = picture[y, x, 0], picture[y, x, 1], picture[y, x, 2]
            table_values[y, x] = table[((b >> SHIFT) * LEVELS + (g >> SHIFT)) * LEVELS + (r >> SHIFT)]
    return table_values


def valley(away, counts):
    """Otsu's limit between near and far colours, by distance."""
    weight, edges = np.histogram(away, bins=128, range=(0, 256), weights=counts)
    share = np.cumsum(weight) / max(weight.sum(), 1)
    middle = (edges[:-1] + edges[1:]) / 2
    mean = np.cumsum(weight * middle) / max(weight.sum(), 1)
    between = (mean[-1] * share - mean) ** 2 / np.maximum(share * (1 - share), 1e-9)
    return edges[1 + int(np.argmax(between))]


def lab_of_table():
    """(LEVELS ** 3, 3) the middle of each colour of the table, Lab in grey levels."""
    step = 256 // LEVELS
    levels = np.arange(LEVELS, dtype=np.uint8) * step + step // 2
    bgr = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), -1).reshape(-1, 1, 3)
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2LAB).reshape(-1, 3).astype(np.float32)


def colours_at_home(index, bodies, elsewhere):
    """The table of colours that are more common among bodies than elsewhere."""
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
    """The limit between colours that animals have and those they share with the ground: the valley of their ratios."""
    low, high = AT_HOME
    at = np.clip(np.log(np.maximum(ratio, 1e-6)), -3.0, 9.0)
    return float(np.clip(np.exp(valley((at + 3.0) * (256 / 12.0), bodies) * 12.0 / 256 - 3.0), low, high))
