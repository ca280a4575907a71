"""Single bodies in a mask of animals: position and orientation, also of animals that touch.

How large an animal is follows from blobs that hold one animal (`size_of_bodies`).  A blob of that size is a body; one
that is larger holds several (`bodies_of`): a capsule of the known size is tried at every place and angle, the best ones
that do not lie on each other are kept, and then every pixel goes to the nearest capsule and every capsule to its
pixels, several times (k-means with capsules for means).  Where the picture is given, seams between animals count as
well: the back of an animal differs more from the ground than its flanks.

Lengths are pixels; x right, y down, pixel (0, 0) has its middle at (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial.distance import cdist

from flockbrush.film.body_shapes import Outlines, capsule, joined, moments_of, of_moments
from flockbrush.film.capsule_fit import at_labels, better_crowds, fitted, shown_share
from flockbrush.film.touching_bodies import LEAST, parted_bodies

ALONE = 0.55, 1.45  # of one animal's area: a blob of one animal
SOLID = 0.88, 0.74  # share of its convex hull that a lone body fills; less where a dark head is cut out of it
LIKE = 0.35, 0.25, 0.25  # logarithms of area, length and width by which one animal may differ from the usual one
LEAST_AREA = 6  # px: less is a scrap
ENOUGH = 6  # lone bodies that are needed to tell the size of one
DOUBTFUL = 1.5  # times as badly covered as the usual lone body: such a crowd is parted afresh
MISSING = 0.5  # of a pixel that is animal and that no body covers, from which on another body is looked for there
PALE = 0.5  # share of a body in its mask that the picture must show, for it to tell how the body lies
ALONG, END = 6, 0.62  # positions from the middle of a body to each end, and the end of the last part, lengths


@dataclass(frozen=True)
class BodySize:
    """Size of one animal in pixels: the median of isolated animals."""

    length: float
    width: float
    area: float
    alone: int  # blobs it was measured on


# the size of one animal -----------------------------------------------------------------------------------------------


def size_of_bodies(masks) -> BodySize | None:
    """The size of one animal, from the blobs of some masks that hold one animal each.

    Blobs that fill their convex hull may be single animals; their most common size is that of one animal.  Fragments
    are smaller and of all sizes, groups larger and seldom convex.

    Parameters
    ----------
    masks : iterable of (h, w) ndarray
        Nonzero is animal.

    Returns
    -------
    BodySize or None
        None if too few animals are isolated.
    """
    area, long, wide, solid, inside = _blobs(masks)
    if len(area) < ENOUGH:
        return None
    for least in SOLID:
        chosen = (solid >= least) & (inside > 0) & (area >= LEAST_AREA)
        size = _of_those(area, long, wide, chosen)
        if size is not None:
            return size
    return None


def sizes_alone(masks) -> np.ndarray:
    """(2, k) area and length, in pixels, of the blobs of masks that fill their convex hull and are not cut."""
    area, long, _, solid, inside = _blobs(masks)
    return np.stack([area, long])[:, (solid >= SOLID[0]) & (inside > 0) & (area >= LEAST_AREA)]


def blobs_left(before, mask, share=1.0) -> np.ndarray:
    """(h, w) uint8, the blobs of ``before``, whole, of which a mask still has this share of the pixels."""
    _, blob = cv2.connectedComponents((before > 0).astype(np.uint8))
    had = np.bincount(blob.ravel())
    left = np.bincount(blob[mask > 0], minlength=len(had)) >= share * had
    left[0] = False
    return left[blob].astype(np.uint8)


def _of_those(area, long, wide, chosen):
    """The size of one animal from blobs that may be single; None if they are too few, or too small a part of all."""
    total = area.sum()
    if chosen.sum() < ENOUGH:
        return None
    shape = np.log(np.column_stack([area, long, wide]))
    usual = _usual(shape[chosen], area[chosen])
    alone = chosen & (np.abs(shape - usual) < LIKE).all(1)
    if alone.sum() < ENOUGH or area[alone].sum() < 0.02 * total:
        return None
    return BodySize(*(float(np.median(v[alone])) for v in (long, wide, area)), int(alone.sum()))


def _usual(shape, area):
    """The most common logarithms of area, length and width: pairs have many shapes, single animals one.

    Fragments are many; they have little weight.
    """
    some = np.random.default_rng(0).permutation(len(shape))[:1500]
    off = shape[some] / (0.4 * np.array(LIKE))
    near = np.exp(-0.5 * cdist(off, off, "sqeuclidean"))
    return shape[some][np.argmax(near @ np.sqrt(area[some]))]


def _blobs(masks):
    """(5, k) area, length, width, solidity, wholeness of the blobs of masks; a blob cut by the border is not whole."""
    rows = [row for mask in masks for row in _moments(_binary(mask))]
    area, xx, yy, xy, solid, whole = np.array(rows, float).reshape(-1, 6).T
    xx, yy, xy = xx / area + 1 / 12, yy / area + 1 / 12, xy / area
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return area, *capsule(area, mean + half, mean - half), solid, whole


def _moments(mask):
    """(area, its three second moments, solidity, wholeness) of each blob of four pixels or more."""
    h, w = mask.shape
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    for outline in outlines:
        x, y, wide, tall = cv2.boundingRect(outline)
        if wide * tall < 4:
            continue
        own = cv2.drawContours(np.zeros((tall, wide), np.uint8), [outline - (x, y)], -1, 1, cv2.FILLED)
        m = cv2.moments(own & mask[y : y + tall, x : x + wide], binaryImage=True)
        if m["m00"] < 4:
            continue
        # the hull runs through the middles of the outermost pixels: half a pixel is missing all around
        hull = cv2.convexHull(outline)
        around = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1
        whole = x > 0 and y > 0 and x + wide < w and y + tall < h
        yield m["m00"], m["mu20"], m["mu02"], m["mu11"], m["m00"] / around, whole


# bodies -------------------------------------------------------------------------------------------------------------


def bodies_of(mask, size: BodySize, picture=None, before: Outlines | None = None, margin: float = 0.0) -> Outlines:
    """The animals of a mask, (h, w), nonzero where an animal is.

    Parameters
    ----------
    size : BodySize
        Of one animal, in pixels of this mask.
    picture : (h, w, 3) or (h, w) uint8 ndarray, optional
        Helps to separate animals that touch.
    before : Bodies, optional
        Those of the frame before, in pixels of this one and where they will have gone: where animals touch, the search
        begins with them, so that animals do not jump to and fro.
    margin : float
        Pixels by which blur widens bodies in the mask, on each side.
    """
    mask = _binary(mask)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    animals = stats[:, cv2.CC_STAT_AREA] / size.area
    animals[0] = 0.0
    blobs = _Blobs(labels, animals, (animals >= LEAST) & (animals <= ALONE[1]), animals > ALONE[1])
    share = mask.astype(np.float32) if picture is None else shown_share(picture, mask, size)
    bodies = _measured(blobs, mask, share)
    if blobs.many.any():
        bodies = _with_crowds(bodies, blobs, share, size, picture, before, margin)
    return bodies if picture is None else replace(bodies, ends=_ends(bodies, mask, picture, size))


class _Blobs(NamedTuple):
    """The blobs of a mask; the first is the ground."""

    labels: np.ndarray  # (h, w) int32, number of the blob of each pixel
    animals: np.ndarray  # (k,) how many animals have its area
    lone: np.ndarray  # (k,) bool, whether it is one animal
    many: np.ndarray  # (k,) bool, whether it is several


def _with_crowds(lone, blobs, share, size, picture, before, margin):
    """The bodies that stand alone, and those in blobs of several animals.

    Crowds are first covered by the bodies that were there before, and by others where animals are not covered.  Those
    that are covered badly are parted afresh as well, and the better of the two counts.
    """
    crowd = blobs.many[blobs.labels].view(np.uint8)
    if before is None:
        return fitted(joined(lone, parted_bodies(crowd, size, picture)), share, size, margin).bodies
    lasting = before.of(blobs.many[at_labels(blobs.labels, before)])
    lasting = replace(lasting, alone=np.zeros(len(lasting), bool))
    found = fitted(joined(lone, lasting), share, size, margin)
    left = crowd & (found.missing(share) > MISSING).view(np.uint8)
    if left.sum() > LEAST * size.area and len(others := parted_bodies(left, size, picture)):
        found = fitted(joined(found.bodies, others), share, size, margin)
    costs = found.costs(blobs.labels, share) / np.maximum(blobs.animals, LEAST)
    usual = np.median(costs[blobs.lone]) if blobs.lone.any() else 0.0
    doubtful = blobs.many & (costs > DOUBTFUL * usual)
    if doubtful.any():
        sure = found.bodies.of(~doubtful[at_labels(blobs.labels, found.bodies)])
        afresh = parted_bodies(doubtful[blobs.labels].view(np.uint8), size, picture, before)
        again = fitted(joined(sure, afresh), share, size, margin)
        found = better_crowds(blobs.labels, doubtful, share, found, again)
    return found.bodies


def _ends(bodies, mask, picture, size):
    """(k, 2 ALONG) what a body looks like from its middle towards one end, less the same towards the other.

    First how light it is, in deviations of all that is animal, then how much of it is animal: heads are darker than
    backs, or narrower.
    """
    if not len(bodies):
        return np.zeros((0, 2 * ALONG))
    grey = (picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)).astype(np.float32)
    spread = float(grey[mask > 0].std()) + 1.0 if mask.any() else 1.0
    layers = [cv2.GaussianBlur(layer, (0, 0), 0.07 * size.length) for layer in (grey / spread, mask.astype(np.float32))]
    out = END * (np.arange(ALONG) + 0.5) / ALONG * size.length
    aside = np.array([-0.2, 0.0, 0.2]) * size.width
    axis, across = bodies.axis[:, None, None], np.column_stack([-bodies.axis[:, 1], bodies.axis[:, 0]])[:, None, None]
    along = out[:, None, None] * axis  # (k, ALONG, 1, 2)
    middle = bodies.xy[:, None, None] - 0.5 + aside[:, None] * across
    ends = [_looked_at(layer, middle + along) - _looked_at(layer, middle - along) for layer in layers]
    return np.concatenate(ends, axis=1)


def _looked_at(layer, places):
    """Means over the last number of a picture at places (k, a, b, 2) px, (k, a)."""
    k, a, b = places.shape[:3]
    x, y = np.moveaxis(places, -1, 0).reshape(2, k, a * b).astype(np.float32)
    sampled = cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return sampled.reshape(k, a, b).mean(-1).astype(float)


def _binary(mask):
    return (np.asarray(mask) > 0).astype(np.uint8)


def _measured(blobs, mask, share):
    """The bodies that stand alone: their sizes by the mask, their places and axes by what is animal."""
    by_mask, shown = np.zeros((2, len(blobs.animals), 6))
    moments_of(blobs.labels, mask.astype(np.float32), by_mask)
    moments_of(blobs.labels, share, shown)
    pale = shown[:, 0] < PALE * by_mask[:, 0]
    shown[pale] = by_mask[pale]
    alone = np.ones(blobs.lone.sum(), bool)
    placed = of_moments(shown[blobs.lone], alone)
    return replace(of_moments(by_mask[blobs.lone], alone), xy=placed.xy, axis=placed.axis)
