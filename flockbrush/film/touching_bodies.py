"""Separate bodies that touch in a mask: capsules of the usual size are fitted to the pixels of a crowd.

1. A capsule is tried at every inner pixel and `ANGLES` directions; its score is the mean evidence inside, minus half of
   that in a ring around it, plus a bonus where a body was in the frame before.
2. Capsules are accepted from the best score down, if enough of their pixels belong to no other.
3. Like k-means, each pixel is assigned to the nearest capsule and each capsule is moved to its pixels, `ROUNDS` times.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numba import njit

from flockbrush.film.body_shapes import moments_of, of_moments

LEAST = 0.4  # of one animal's area: less is no animal
ANGLES = 16  # directions in which a capsule is tried, of half a turn
FINE = 11.0  # px: longer bodies are looked for in a smaller picture
FREE = 0.55  # share of a capsule that must belong to nobody else
FULL = 0.7  # share of a capsule that must be animal
ROUNDS = 5  # of k-means
AGAIN = 0.15  # of a perfect fit: what it is worth to lie as an animal lay in the frame before
WANDERS = 0.12  # of a length: how far it may have gone since for that to count


def parted_bodies(crowd, size, picture, before=None):
    """The bodies of a mask in which they touch.

    Parameters
    ----------
    crowd : (h, w) uint8 ndarray
        1 on the animals.
    size : BodySize
        Usual length, width (px) and area (px²) of a body.
    picture : (h, w) or (h, w, 3) ndarray, optional
        Its contrast shows the backs of animals and the seams between them.
    before : Bodies, optional
        Bodies of the frame before, in the same pixels.

    Returns
    -------
    Bodies
        In pixels of the mask; heads are unknown.
    """
    y0, x0, crowd = _cut(crowd, size)
    shrink = min(1.0, FINE / size.length)
    small = _resized(crowd.astype(np.float32), shrink)
    evidence = small.copy()
    if picture is not None:
        h, w = crowd.shape
        top, left = max(y0, 0), max(x0, 0)
        part = picture[top : y0 + h, left : x0 + w]
        pad = (top - y0, y0 + h - top - part.shape[0], left - x0, x0 + w - left - part.shape[1])
        grey = _contrast(part, crowd[pad[0] : h - pad[1], pad[2] : w - pad[3]], size)
        evidence *= _resized(cv2.copyMakeBorder(grey, *pad, cv2.BORDER_CONSTANT), shrink)
    long, wide = size.length * shrink, size.width * shrink
    likely = _likely(before, small.shape, shrink, (x0, y0), long)
    at = _placed(small, evidence, long, wide, likely)
    half, radius = 0.5 * (long - wide), 0.5 * wide
    sums = _settled(small, at, half, radius)
    keep = sums[:, 0] > LEAST * size.area * shrink**2
    if not keep.all() and keep.any():
        sums = _settled(small, at[keep], half, radius)
    bodies = of_moments(sums, np.zeros(len(sums), bool))
    bodies = bodies.of(bodies.area > 0.5 * LEAST * size.area * shrink**2)
    back = np.array([[1 / shrink, 0.0, float(x0)], [0.0, 1 / shrink, float(y0)]])
    return bodies.moved(back)


def _cut(mask, size):
    """The bounding box of a mask with a wide empty border: its top row, left column and pixels."""
    border = int(np.ceil(1.2 * size.length)) + 2
    x, y, w, h = cv2.boundingRect(mask)
    part = mask[y : y + h, x : x + w]
    return y - border, x - border, cv2.copyMakeBorder(part, *[border] * 4, cv2.BORDER_CONSTANT)


def _resized(image, by):
    if by >= 1.0:
        return image
    h, w = image.shape
    to = max(1, round(w * by)), max(1, round(h * by))
    return cv2.resize(image, to, interpolation=cv2.INTER_AREA)


def _contrast(picture, mask, size):
    """Evidence (h, w), 0 to 1, that a pixel is on the back of an animal and not on a seam between two of them."""
    grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    grey = grey.astype(np.float32)
    ring = cv2.dilate(mask, np.ones((5, 5), np.uint8)) > mask
    sign = 1.0 if grey[mask > 0].mean() > grey[ring].mean() else -1.0
    fine = cv2.GaussianBlur(grey, (0, 0), max(0.5, 0.12 * size.width))
    broad = cv2.GaussianBlur(grey, (0, 0), max(1.0, 0.45 * size.width))
    ridge = sign * (fine - broad)
    spread = float(ridge[mask > 0].std()) + 1e-6
    return np.clip(0.75 + 0.25 * ridge / spread, 0.0, 1.0).astype(np.float32)


def _likely(before, shape, shrink, corner, long):
    """Weight (h, w), 0 to 1, of a body where one was in the frame before, and the angle it had there (h, w), rad."""
    likely, angle = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    if before is None:
        return likely, angle
    for (x, y), (c, s) in zip((before.xy - corner) * shrink, before.axis, strict=True):
        reach = int(np.ceil(3 * WANDERS * long))
        rows = slice(max(0, int(y) - reach), max(0, int(y) + reach + 1))
        columns = slice(max(0, int(x) - reach), max(0, int(x) + reach + 1))
        probabilities = likely[rows, columns]
        if not probabilities.size:
            continue
        down = np.arange(rows.start, rows.start + probabilities.shape[0])[:, None] + 0.5 - y
        right = np.arange(columns.start, columns.start + probabilities.shape[1]) + 0.5 - x
        along, across = c * right + s * down, c * down - s * right
        own = np.exp(-0.5 * ((along / (WANDERS * long)) ** 2 + (across / (0.5 * WANDERS * long)) ** 2))
        angle[rows, columns] = np.where(own > probabilities, np.arctan2(s, c), angle[rows, columns])
        likely[rows, columns] = np.maximum(probabilities, own)
    return likely, angle


def _placed(solid, evidence, long, wide, likely):
    """Capsules that cover the animals without overlapping much, (k, 3): x, y (px) and angle (rad)."""
    inside, ring = _stamps(long, wide)
    depth = cv2.distanceTransform((solid > 0.5).astype(np.uint8), cv2.DIST_L2, 3)
    places = np.argwhere(depth >= 0.3 * wide).astype(np.int32)
    if not len(places):
        return np.zeros((0, 3))
    score, angle = np.empty(len(places), np.float32), np.empty(len(places), np.int32)
    across = evidence.shape[1]
    prior = (AGAIN * likely[0][*places.T]).astype(np.float32), likely[1][*places.T]
    _tried(evidence.ravel(), places @ (across, 1), inside @ (across, 1), ring @ (across, 1), *prior, score, angle)
    order = np.argsort(-score, kind="stable")
    taken = _chosen(solid, places[order], angle[order], inside, FREE, FULL)
    rows = order[taken]
    return np.column_stack([places[rows, 1] + 0.5, places[rows, 0] + 0.5, angle[rows] * np.pi / ANGLES])


@lru_cache(maxsize=16)
def _stamps(long, wide):
    """Pixel offsets (row, column) of a capsule and of the ring around it, (ANGLES, k, 2) int32 each."""
    reach = int(np.ceil(0.5 * long + 0.35 * wide)) + 1
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(float)
    inside, ring = [], []
    for k in range(ANGLES):
        c, s = np.cos(k * np.pi / ANGLES), np.sin(k * np.pi / ANGLES)
        along, across = c * x + s * y, c * y - s * x
        half = 0.5 * (long - wide)
        d = np.hypot(along - np.clip(along, -half, half), across).ravel()
        order = np.argsort(d, kind="stable")
        inside.append(order[: _number(long, wide, 0.0)])
        ring.append(order[_number(long, wide, 0.06) : _number(long, wide, 0.3)])
    cells = np.stack([y.ravel(), x.ravel()], -1).astype(np.int32)
    return cells[np.array(inside)], cells[np.array(ring)]


def _number(long, wide, more):
    """Number of pixels of a capsule, widened all around by `more` of its width."""
    r = 0.5 * wide + more * wide
    return max(1, round(np.pi * r * r + 2 * r * (long - wide)))


@njit(cache=True, nogil=True)
def _tried(evidence, places, inside, ring, likely, lay, score, angle):
    """Write the best score of a capsule at each place, and its angle, into `score` and `angle`.

    `likely` and `lay` are the weight and the angle of a body of the frame before. Places and offsets count the pixels
    of the flattened picture.
    """
    for i in range(len(places)):
        at = places[i]
        score[i] = -9.0
        for k in range(inside.shape[0]):
            full, rim = np.float32(0.0), np.float32(0.0)
            for q in range(inside.shape[1]):
                full += evidence[at + inside[k, q]]
            for q in range(ring.shape[1]):
                rim += evidence[at + ring[k, q]]
            s = full / inside.shape[1] - 0.5 * rim / ring.shape[1]
            if likely[i] > 0:
                s += likely[i] * np.cos(lay[i] - k * np.pi / inside.shape[0]) ** 2
            if s > score[i]:
                score[i], angle[i] = s, k


@njit(cache=True, nogil=True)
def _chosen(solid, places, angle, inside, free, full):
    """Which capsules (bool) are accepted, in order: enough pixels are animal (`full`) and not yet taken (`free`)."""
    taken = np.zeros(solid.shape, np.bool_)
    chosen = np.zeros(len(places), np.bool_)
    for i in range(len(places)):
        y, x, k = places[i, 0], places[i, 1], angle[i]
        own, animal = 0.0, 0.0
        for q in range(inside.shape[1]):
            v = solid[y + inside[k, q, 0], x + inside[k, q, 1]]
            animal += v
            if not taken[y + inside[k, q, 0], x + inside[k, q, 1]]:
                own += v
        if own < free * inside.shape[1] or animal < full * inside.shape[1]:
            continue
        chosen[i] = True
        for q in range(inside.shape[1]):
            taken[y + inside[k, q, 0], x + inside[k, q, 1]] = True
    return chosen


@njit(cache=True, nogil=True)
def _settled(solid, at, half, radius):
    """Move capsules to their nearest pixels, `ROUNDS` times (k-means).

    Returns
    -------
    (k, 6) ndarray
        Sums of weight, x, y, x², y² and xy of the pixels of each capsule.
    """
    n = len(at)
    h, w = solid.shape
    x, y, c, s = at[:, 0].copy(), at[:, 1].copy(), np.cos(at[:, 2]), np.sin(at[:, 2])
    sums = np.zeros((n + 1, 6))
    own = sums[1:]  # the first is of pixels of none
    owner = np.zeros((h, w), np.int32)
    nearest = np.empty((h, w), np.float32)
    reach = half + 2.0 * radius
    for turn in range(ROUNDS):
        owner[:], nearest[:] = 0, 1.8 * radius
        for k in range(n):
            for row in range(max(0, int(y[k] - reach)), min(h, int(y[k] + reach) + 1)):
                for column in range(max(0, int(x[k] - reach)), min(w, int(x[k] + reach) + 1)):
                    if solid[row, column] <= 0.0:
                        continue
                    dx, dy = column + 0.5 - x[k], row + 0.5 - y[k]
                    along, across = c[k] * dx + s[k] * dy, c[k] * dy - s[k] * dx
                    over = max(0.0, abs(along) - half)
                    d = np.sqrt(over * over + across * across)
                    if d < nearest[row, column]:
                        nearest[row, column], owner[row, column] = d, k + 1
        sums[:] = 0.0
        moments_of(owner, solid, sums)
        if turn == ROUNDS - 1:
            break
        for k in range(n):
            a = own[k, 0]
            if a < 3.0:
                continue
            mx, my = own[k, 1] / a, own[k, 2] / a
            x[k], y[k] = mx + 0.5, my + 0.5
            xx, yy, xy = own[k, 3] / a - mx * mx, own[k, 4] / a - my * my, own[k, 5] / a - mx * my
            angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
            c[k], s[k] = np.cos(angle), np.sin(angle)
    return own
