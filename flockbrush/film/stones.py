"""Stones: patches of the ground that have colours of animals but stand out less than animals do."""

from __future__ import annotations

import cv2
import numpy as np

LARGEST = 4.0  # bodies; larger patches of the ground in animals' colours are crowds that hardly move
BRIGHT = 0.75  # quantile of the contrast of its pixels by which a stone or an animal is judged
MOVING = 0.3  # share of what has animals' colours that must be away from where the ground has them
FAINT = 0.75  # of the way from the ground's colour to an animal's: what is nearer to the ground is a stone


def faint_patches(ground, coloured, body, area):
    """Patches of at most `LARGEST` bodies that differ less from the ground around them than a body does.

    Parameters
    ----------
    ground : (h, w, 3) ndarray
        The median of the stabilised clip, BGR.
    coloured : (h, w) uint8 ndarray
        1 where it has colours of animals.
    body : (3,) ndarray
        Blue, green, red of what stands out most of an animal.
    area : float
        Of one animal, px of ``ground``.

    Returns
    -------
    (h, w) uint8 ndarray
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
    """Red, green, blue of what stands out most among animals that move away; None where hardly any does.

    Parameters
    ----------
    pictures : (m, h, w, 3) uint8 ndarray
        Pictures of the clip, laid on the ground, BGR.
    ground : (h, w, 3) uint8 ndarray
    coloured : (m, h, w) bool ndarray
        Where the pictures have colours of animals.
    still : (h, w) uint8 ndarray
        1 where the ground has them.
    """
    chosen = coloured & ~(cv2.dilate(still, np.ones((5, 5), np.uint8)) > 0)
    if chosen.sum() < MOVING * max(coloured.sum(), 1):
        return None
    here, under = pictures[chosen], np.broadcast_to(ground, pictures.shape)[chosen]
    away = np.linalg.norm(here.astype(float) - under, axis=1)
    b, g, r = np.median(here[away >= np.quantile(away, BRIGHT)], axis=0)
    return int(r), int(g), int(b)
