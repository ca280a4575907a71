"""Stones: patches of ground in the colours of animals that contrast less with the ground than animals do."""

from __future__ import annotations

import cv2
import numpy as np

LARGEST = 4.0  # bodies; larger patches of the ground in animals' colours are crowds that hardly move
BRIGHT = 0.75  # quantile of the contrast of its pixels by which a stone or an animal is judged
MOVING = 0.3  # share of what has animals' colours that must be away from where the ground has them
FAINT = 0.75  # of the way from the ground's colour to an animal's: what is nearer to the ground is a stone


def faint_patches(ground, coloured, body, area):
    """Patches of at most `LARGEST` bodies that differ less from the ground around them than an animal does.

    Parameters
    ----------
    ground : (h, w, 3) ndarray
        Median of the stabilised pictures, BGR.
    coloured : (h, w) uint8 ndarray
        1 where the ground has colours of animals.
    body : (3,) ndarray
        Colour of the brightest or darkest part of an animal, as from `bright_colour`: blue, green, red.
    area : float
        Area of an animal, px of `ground`.

    Returns
    -------
    (h, w) uint8 ndarray
        1 on stones.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(coloured, connectivity=8)
    faint = np.zeros_like(coloured)
    for k in range(1, count):
        x, y, w, h, size = stats[k]
        if size > LARGEST * area:
            continue
        margin = 2 + int(np.sqrt(size))
        window = slice(max(0, y - margin), y + h + margin), slice(max(0, x - margin), x + w + margin)
        mine, bare = labels[window] == k, labels[window] == 0
        if bare.any():
            around = np.median(ground[window][bare], axis=0)
            full = body - around
            away = np.quantile((ground[window][mine] - around) @ full, BRIGHT)
            faint[window][mine] = away < FAINT * (full @ full)
    return faint


def bright_colour(pictures, ground, coloured, still):
    """The colour of the part of moving animals that differs most from the ground.

    Parameters
    ----------
    pictures : (m, h, w, 3) uint8 ndarray
        Stabilised pictures, BGR.
    ground : (h, w, 3) uint8 ndarray
    coloured : (m, h, w) bool ndarray
        Pixels in colours of animals.
    still : (h, w) uint8 ndarray
        1 where the ground has colours of animals.

    Returns
    -------
    (int, int, int) or None
        Red, green, blue; None if less than `MOVING` of the coloured pixels move.
    """
    chosen = coloured & ~(cv2.dilate(still, np.ones((5, 5), np.uint8)) > 0)
    if chosen.sum() < MOVING * max(coloured.sum(), 1):
        return None
    here, under = pictures[chosen], np.broadcast_to(ground, pictures.shape)[chosen]
    away = np.linalg.norm(here.astype(float) - under, axis=1)
    b, g, r = np.median(here[away >= np.quantile(away, BRIGHT)], axis=0)
    return int(r), int(g), int(b)
