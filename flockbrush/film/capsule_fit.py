"""Capsules that touch, moved and turned until together they cover what a picture shows of animals (least squares).

A mask is wider than the bodies by up to a pixel, so that bodies that do not touch do so in a mask, and the moments of
the pixels that are nearest to a body depend on where its neighbours are: they turn its axis for as long as others are
near.  What the picture shows of animals, pixel by pixel, and what all bodies cover together does not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numba import njit

from flockbrush.film.body_shapes import Outlines, joined

ROUNDS = 8
SETTLED = 0.02  # px that a body or its end still moves in a round, below which it stays
SOFT = 0.5  # of a radius, at least a pixel: how wide the edge of a capsule is
STIFF = 0.02  # of a capsule's edge: what holds it where it is, so that hidden ones do not wander
FARTHEST, TURNED = 0.35, 0.25  # of a radius, and rad: in one round
CORE = 0.7  # of half a width from the edge: farther in is the colour of the body
THINNEST = 0.25  # least radius, of a width in the mask
NEAR = 2  # px around the animals that are no plain ground
LEAST_CONTRAST = 20.0  # grey levels
FEWER = 3  # of so many rows and columns, one is looked at for medians
COARSE = 4  # px: the ground is averaged over squares of that size


@dataclass(frozen=True)
class FittedBodies:
    """Bodies, and how much of each pixel they cover."""

    bodies: Outlines
    cover: np.ndarray  # (h, w) float32, by the one that covers most of it
    twice: np.ndarray  # (h, w) float32, by the next

    def missing(self, share) -> np.ndarray:
        """(h, w) how much of each pixel is animal and not covered."""
        return share - self.cover

    def costs(self, labels, share) -> np.ndarray:
        """(k,) how badly each blob is covered: what bodies miss or add, and where they lie on each other, squared."""
        at = np.nonzero(labels)
        return np.bincount(labels[at], self.missing(share)[at] ** 2 + self.twice[at] ** 2, labels.max() + 1)


def fitted(bodies: Outlines, share, size, margin) -> FittedBodies:
    """Bodies, of which those that touch are moved and turned until all cover what `share` (h, w) shows of animals.

    ``size`` is that of one animal in a mask that is wider than the bodies by ``margin`` px on each side.
    """
    at = np.column_stack([bodies.xy, np.arctan2(bodies.axis[:, 1], bodies.axis[:, 0])])
    cover, twice = np.zeros(share.shape, np.float32), np.zeros(share.shape, np.float32)
    radius = max(0.5 * size.width - margin, THINNEST * size.width)
    fit_capsules(share, at, bodies.alone.copy(), 0.5 * (size.length - size.width), radius, cover, twice)
    axis = np.column_stack([np.cos(at[:, 2]), np.sin(at[:, 2])])
    return FittedBodies(replace(bodies, xy=at[:, :2].copy(), axis=axis), cover, twice)


def better_crowds(labels, asked, share, one: FittedBodies, other: FittedBodies) -> FittedBodies:
    """The first fit, with the bodies of the other in those of the blobs ``asked`` for that it covers better.

    ``labels`` (h, w) int numbers the pixels of blobs, 0 elsewhere; ``asked`` (k,) bool.
    """
    better = asked & (other.costs(labels, share) < one.costs(labels, share))
    old, new = ~better[at_labels(labels, one.bodies)], better[at_labels(labels, other.bodies)]
    return replace(one, bodies=joined(one.bodies.of(old), other.bodies.of(new)))


def at_labels(crowds, bodies):
    """(k,) the numbers of the pixels in which bodies have their middles."""
    x, y = np.clip(bodies.xy.astype(int), 0, np.array(crowds.shape[::-1]) - 1).T
    return crowds[y, x]


def shown_share(picture, mask, size):
    """(h, w) float32, 0 to 1, how much of each pixel is animal: its colour between those of ground and bodies."""
    inner = cv2.distanceTransform(mask, cv2.DIST_L2, 3) >= CORE * 0.5 * size.width
    near = cv2.dilate(mask, np.ones((2 * NEAR + 1, 2 * NEAR + 1), np.uint8))
    colour, few = np.atleast_3d(picture), (slice(None, None, FEWER),) * 2
    body, ground = colour[few][inner[few]], colour[few][near[few] == 0]
    if not len(body) or not len(ground):
        return mask.astype(np.float32)
    contrast = np.median(body, 0) - np.median(ground, 0)
    strength = float(contrast @ contrast)
    if strength < LEAST_CONTRAST**2:
        return mask.astype(np.float32)
    level = cv2.transform(colour.astype(np.float32), (contrast / strength)[None].astype(np.float32))
    above = level - _ground(level, near, size)
    top = float(np.median(above[inner]))
    return np.clip(above / max(top, 0.3), 0.0, 1.0) * near


def _ground(level, near, size):
    """(h, w) float32, the level of the ground around each pixel, from where no animal is near."""
    h, w = level.shape
    small = -(-w // COARSE), -(-h // COARSE)
    free = 1.0 - near.astype(np.float32)
    around = (2 * int(size.length / COARSE) + 1,) * 2
    sums, known = (cv2.blur(cv2.resize(a, small, interpolation=cv2.INTER_AREA), around) for a in (level * free, free))
    usual = float(sums.sum() / known.sum())
    return cv2.resize(np.where(known > 0.05, sums / np.maximum(known, 0.05), usual).astype(np.float32), (w, h))


@njit(cache=True, nogil=True)
def fit_capsules(share, at, settled, half, radius, first, second):
    """Move capsules (k, 3), x, y (px) and angle (rad), each of this half axis and radius, in place.

    Those that are `settled` (k,) bool stay.  By the method of Gauss and Newton, capsule by capsule, with what the
    others cover as it is.  Where two capsules cover a pixel, the one that covers more of it counts: `first` (h, w),
    zero before, becomes that, `second` the next.
    """
    soft, reach = max(1.0, SOFT * radius), half + radius + 2.0
    owner = np.full(share.shape, -1, np.int32)
    for _ in range(ROUNDS):
        _covered(at, half, radius, soft, reach, first, second, owner)
        for k in range(len(at)):
            if not settled[k]:
                settled[k] = _moved(share, at[k], half, radius, soft, reach, first, second, owner, k) < SETTLED
        for k in range(len(at)):
            y0, y1, x0, x1 = _window(share, at[k], reach + FARTHEST * radius + 1.0)  # where it was before, too
            first[y0:y1, x0:x1], second[y0:y1, x0:x1], owner[y0:y1, x0:x1] = 0.0, 0.0, -1
        if settled.all():
            break
    _covered(at, half, radius, soft, reach, first, second, owner)


@njit(cache=True, nogil=True)
def _covered(at, half, radius, soft, reach, first, second, owner):
    """Write what capsules cover of each pixel: most and next, and by which one most."""
    for k in range(len(at)):
        c, s = np.cos(at[k, 2]), np.sin(at[k, 2])
        y0, y1, x0, x1 = _window(first, at[k], reach)
        for y in range(y0, y1):
            for x in range(x0, x1):
                d = _from_axis(x + 0.5 - at[k, 0], y + 0.5 - at[k, 1], c, s, half)[0]
                cover = min(0.5 + (radius - d) / soft, 1.0)
                if cover > first[y, x]:
                    first[y, x], second[y, x], owner[y, x] = cover, first[y, x], k
                elif cover > second[y, x]:
                    second[y, x] = cover


@njit(cache=True, nogil=True)
def _moved(share, own, half, radius, soft, reach, first, second, owner, k):
    """Take one step with one capsule; how far it and its ends moved, px."""
    c, s = np.cos(own[2]), np.sin(own[2])
    normal, right, slope = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    y0, y1, x0, x1 = _window(share, own, reach)
    for y in range(y0, y1):
        for x in range(x0, x1):
            d, along, nx, ny = _from_axis(x + 0.5 - own[0], y + 0.5 - own[1], c, s, half)
            cover = 0.5 + (radius - d) / soft
            if cover <= 0.0 or cover >= 1.0 or cover < (second[y, x] if owner[y, x] == k else first[y, x]):
                continue
            # by how much more of the pixel is covered if the capsule moves right or down by 1 px, or turns by 1 rad
            slope[0], slope[1], slope[2] = nx / soft, ny / soft, along * (c * ny - s * nx) / soft
            off = share[y, x] - cover
            for a in range(3):
                right[a] += slope[a] * off
                for b in range(3):
                    normal[a, b] += slope[a] * slope[b]
    edge = STIFF * 2.0 * (np.pi * radius + 2.0 * half) / soft
    normal[0, 0] += edge
    normal[1, 1] += edge
    normal[2, 2] += edge * half * half + 1e-9
    step = np.linalg.solve(normal, right)
    step[:2] /= max(1.0, np.hypot(step[0], step[1]) / (FARTHEST * radius))
    step[2] = min(max(step[2], -TURNED), TURNED)
    own += step
    return np.hypot(step[0], step[1]) + np.abs(step[2]) * half


@njit(cache=True, nogil=True)
def _window(image, own, reach):
    """First and last row and column, the last not included, within a distance of a capsule's middle."""
    h, w = image.shape
    y0, y1 = max(0, int(own[1] - reach)), min(h, int(own[1] + reach) + 1)
    x0, x1 = max(0, int(own[0] - reach)), min(w, int(own[0] + reach) + 1)
    return y0, y1, x0, x1


@njit(cache=True, nogil=True)
def _from_axis(dx, dy, c, s, half):
    """Distance of a place from the axis of a capsule, where on the axis it is nearest, and the direction to it."""
    along = min(max(c * dx + s * dy, -half), half)
    ox, oy = dx - along * c, dy - along * s
    d = np.sqrt(ox * ox + oy * oy)
    if d < 1e-9:
        return d, along, 0.0, 0.0
    return d, along, ox / d, oy / d
