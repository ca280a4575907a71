"""Lines, letters and plain faces of the ground in colours of animals: outlines of walls, paths, words on a film."""

from __future__ import annotations

import cv2
import numpy as np

STAYS = 0.8  # share of the pictures in which a patch of the ground has colours of animals
THICK = 0.55  # of a body's width: what is nowhere thicker is a line
FACE = 4.0  # bodies: a larger patch of the ground, as plain inside as `PLAIN`, is a face of a wall or of water
PLAIN = 4.0  # grey levels by which neighbouring pixels of it differ, the median of its inside
LEAST = 4  # pictures that are needed to tell what stays


def lines_and_faces(masks, pictures, size):
    """What has colours of animals, stays, and has no animal's shape.

    An animal that rests all the while is as thick as the others, and a crowd that rests shows its bodies.

    Parameters
    ----------
    masks : list of (h, w) uint8 ndarray
        1 where some pictures of a clip have colours of animals, laid over the first.
    pictures : list of (h, w, 3) uint8 ndarray
        One of them is enough.
    size : BodySize
        Of one animal in them.

    Returns
    -------
    (h, w) uint8 ndarray, or None where there is nothing of the kind.
    """
    if len(masks) < LEAST:
        return None
    stays = (np.mean(masks, axis=0) >= STAYS).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(stays, connectivity=8)
    if count < 2:
        return None
    # the distance to the nearest pixel outside is 1 on the rim: a line two pixels wide has 1 everywhere
    depth = cv2.distanceTransform(cv2.copyMakeBorder(stays, 1, 1, 1, 1, cv2.BORDER_CONSTANT), cv2.DIST_L2, 5)
    thickest = np.zeros(count)
    inside = labels > 0
    np.maximum.at(thickest, labels[inside], depth[1:-1, 1:-1][inside])
    ground = 2.0 * thickest - 0.5 < THICK * size.width
    for k in np.flatnonzero(~ground & (stats[:, cv2.CC_STAT_AREA] > FACE * size.area)):
        ground[k] = k > 0 and _is_plain(pictures[0], labels, stats[k], k, size)
    ground[0] = False
    return ground[labels].astype(np.uint8) if ground.any() else None


def _is_plain(picture, labels, box, k, size):
    """Whether the inside of a patch shows nothing of single bodies."""
    x, y, w, h, _ = box
    own = (labels[y : y + h, x : x + w] == k).astype(np.uint8)
    inside = cv2.erode(own, np.ones((3, 3), np.uint8)) > 0
    grey = cv2.cvtColor(picture[y : y + h, x : x + w], cv2.COLOR_BGR2GRAY)
    steps = cv2.morphologyEx(grey, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    return inside.sum() > size.area and float(np.quantile(steps[inside], 0.75)) < PLAIN


def without_lines(mask, lines):
    """The mask of a picture without lines; a body that crosses one stays whole."""
    rest = mask & ~cv2.dilate(lines, np.ones((3, 3), np.uint8)) & 1
    return rest | (cv2.morphologyEx(rest, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)) & mask)
