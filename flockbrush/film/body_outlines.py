"""Single bodies in a mask of animals: where they are and how they lie, also where they touch.

How large an animal is follows from blobs that hold one animal (`size_of_bodies`).  A blob of that size is a body; one
that is larger holds several (`bodies_of`): a capsule of the known size is tried at every place and angle, the best ones
that do not lie on each other are kept, and then every pixel goes to the nearest capsule and every capsule to its
pixels, some times over (k-means with capsules for means).  Where the picture is given, seams between animals count as
well: the back of an animal differs more from the ground than its flanks.

Lengths are pixels; x right, y down, pixel (0, 0) has its middle at (0.5, 0.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numba import njit

ALONE = 0.55, 1.45  # of one animal's area: a blob of one animal
LEAST = 0.4  # of one animal's area: less is no animal
SOLID = 0.88, 0.74  # share of its convex hull that a lone body fills; less where a dark head is cut out of it
LIKE = 0.35, 0.25, 0.25  # logarithms of area, length and width by which one animal may differ from the usual one
ENOUGH = 6  # lone bodies that are needed to tell the size of one
ANGLES = 16  # directions in which a capsule is tried, of half a turn
FINE = 11.0  # px: longer bodies are looked for in a smaller picture
FREE = 0.55  # share of a capsule that must belong to nobody else
FULL = 0.7  # share of a capsule that must be animal
ROUNDS = 5  # of k-means
ALONG, END = 6, 0.62  # places from the middle of a body to each end, and how far the last part goes, lengths
AGAIN = 0.15  # of a perfect fit: what it is worth to lie as an animal lay in the frame before
WANDERS = 0.12  # of a length: how far it may have gone since for that to count
SHAPES = np.linspace(0.0, 6.0, 241)  # half axis over radius of a capsule


@dataclass(frozen=True)
class BodySize:
    """One animal in pixels, the median of those alone."""

    length: float
    width: float
    area: float
    alone: int  # blobs it was measured on


@dataclass(frozen=True)
class Outlines:
    """The animals of a picture.

    Attributes
    ----------
    xy : (k, 2) ndarray
        Middles, px.
    axis : (k, 2) ndarray
        Unit vectors along the body; which end is the head is not known.
    length, width, area : (k,) ndarray
        px, px, px².
    alone : (k,) bool ndarray
        Whether nobody touches it.
    ends : (k, m) ndarray
        By how much the picture at the end that the axis points to differs from that at the other (see `_ends`); turned
        about, a body has the same numbers with the other sign.  m is 0 where no picture was given.
    """

    xy: np.ndarray
    axis: np.ndarray
    length: np.ndarray
    width: np.ndarray
    area: np.ndarray
    alone: np.ndarray
    ends: np.ndarray = None  # type: ignore[assignment]  # nothing known

    def __post_init__(self):
        if self.ends is None:
            object.__setattr__(self, "ends", np.zeros((len(self.xy), 0)))

    def __len__(self):
        return len(self.xy)

    @staticmethod
    def none() -> Outlines:
        """Nobody."""
        none = np.zeros(0)
        return Outlines(np.zeros((0, 2)), np.zeros((0, 2)), none, none, none, np.zeros(0, bool))

    def moved(self, transform) -> Outlines:
        """The same bodies in another picture: a similarity (2, 3) of pixels."""
        linear = np.asarray(transform)[:, :2]
        scale = float(np.sqrt(abs(np.linalg.det(linear))))
        return replace(
            self, xy=self.xy @ linear.T + np.asarray(transform)[:, 2], axis=self.axis @ linear.T / scale,
            length=self.length * scale, width=self.width * scale, area=self.area * scale**2,
        )  # fmt: skip

    def of(self, chosen) -> Outlines:
        """Some of them."""
        return Outlines(
            *(getattr(self, name)[chosen] for name in ("xy", "axis", "length", "width", "area", "alone", "ends"))
        )


# the size of one ----------------------------------------------------------------------------------------------------


def size_of_bodies(masks) -> BodySize | None:
    """How large one animal is, from the blobs of some masks that hold one each.

    Blobs that fill their convex hull may be single animals; the size that most of them share is one animal's.  Scraps
    are smaller and of all sizes, groups larger and seldom convex.

    Parameters
    ----------
    masks : iterable of (h, w) ndarray
        Nonzero is animal.

    Returns
    -------
    BodySize or None
        None when too few animals stand alone to tell.
    """
    found = [row for mask in masks for row in _blobs(mask)]
    if len(found) < ENOUGH:
        return None
    area, long, wide, solid, inside = np.array(found).T
    for least in SOLID:
        chosen = (solid >= least) & (inside > 0) & (area >= 6)
        size = _of_those(area, long, wide, chosen)
        if size is not None:
            return size
    return None


def _of_those(area, long, wide, chosen):
    """The size of one from blobs that may be single; None where they are too few, or too small a part of all."""
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
    """The logarithms of area, length and width that most blobs share: groups of two come in many shapes, one in one.

    Scraps are many; they weigh little.
    """
    some = np.random.default_rng(0).permutation(len(shape))[:1500]
    off = (shape[some, None] - shape[some]) / (0.4 * np.array(LIKE))
    near = np.exp(-0.5 * (off**2).sum(-1))
    return shape[some][np.argmax(near @ np.sqrt(area[some]))]


def _blobs(mask):
    """[(area, length, width, solidity, whole)] of the blobs of a mask; not whole are those that the border cuts."""
    mask = _binary(mask)
    h, w = mask.shape
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    rows = []
    for outline in outlines:
        x, y, wide, tall = cv2.boundingRect(outline)
        own = cv2.drawContours(np.zeros((tall, wide), np.uint8), [outline - (x, y)], -1, 1, cv2.FILLED)
        moments = cv2.moments(own & mask[y : y + tall, x : x + wide], binaryImage=True)
        area = moments["m00"]
        if area < 4:
            continue
        # the hull runs through the middles of the outermost pixels: half a pixel is missing all around
        hull = cv2.convexHull(outline)
        around = cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1
        _, _, long, across = _shape(moments)
        whole = x > 0 and y > 0 and x + wide < w and y + tall < h
        rows.append((area, long, across, area / around, whole))
    return rows


def _shape(m):
    """(x, y, length, width) and nothing of the angle, of a capsule with these moments."""
    area = m["m00"]
    xx, yy, xy = m["mu20"] / area + 1 / 12, m["mu02"] / area + 1 / 12, m["mu11"] / area
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    length, width = capsule(area, mean + half, mean - half)
    return m["m10"] / area + 0.5, m["m01"] / area + 0.5, length, width


def _spreads():
    """Variances along and across of capsules of radius 1 and half axis SHAPES, over their areas: (2, k)."""
    a = SHAPES
    area = np.pi + 4 * a
    across = (np.pi / 4 + 4 * a / 3) / area
    along = (4 * a**3 / 3 + np.pi / 4 + np.pi * a**2 + 8 * a / 3) / area
    return along / area, across / area


_ALONG, _ACROSS = _spreads()


def capsule(area, along, across):
    """Length and width of the capsule with this area and ratio of variances along and across its axis."""
    ratio = np.asarray(along) / np.maximum(across, 1e-9)
    shape = np.interp(ratio, _ALONG / _ACROSS, SHAPES)
    radius = np.sqrt(area / (np.pi + 4 * shape))
    return 2 * radius * (1 + shape), 2 * radius


# bodies -------------------------------------------------------------------------------------------------------------


def bodies_of(mask, size: BodySize, picture=None, before: Outlines | None = None) -> Outlines:
    """The animals of a mask, (h, w), nonzero where an animal is.

    Parameters
    ----------
    size : BodySize
        Of one animal, in pixels of this mask.
    picture : (h, w, 3) or (h, w) uint8 ndarray, optional
        Makes animals that touch easier to tell apart.
    before : Bodies, optional
        Those of the frame before, in pixels of this one: where animals touch, a way to part them that looks much as it
        did is preferred, so that they do not jump to and fro.
    """
    mask = _binary(mask)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    share = stats[:, cv2.CC_STAT_AREA] / size.area
    share[0] = 0.0
    lone = (share >= LEAST) & (share <= ALONE[1])
    many = share > ALONE[1]
    found = [_measured(labels, np.flatnonzero(lone), count, np.ones(lone.sum(), bool))]
    if many.any():
        crowd = many[labels].view(np.uint8)
        found.append(_parted(crowd, size, picture, before))
    bodies = Outlines(*(np.concatenate(v) for v in zip(*(vars(f).values() for f in found), strict=True)))
    return bodies if picture is None else replace(bodies, ends=_ends(bodies, mask, picture, size))


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
    seen = cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return seen.reshape(k, a, b).mean(-1).astype(float)


def _binary(mask):
    return (np.asarray(mask) > 0).astype(np.uint8)


def _measured(labels, chosen, count, alone):
    """The bodies that labelled pixels make up."""
    sums = np.zeros((count, 6))
    _moments(labels, sums)
    return _of_moments(sums[chosen], alone)


def _of_moments(sums, alone):
    """Bodies from (k, 6) sums of 1, x, y, xx, yy, xy."""
    area = np.maximum(sums[:, 0], 1)
    x, y = sums[:, 1] / area, sums[:, 2] / area
    xx, yy = sums[:, 3] / area - x * x + 1 / 12, sums[:, 4] / area - y * y + 1 / 12
    xy = sums[:, 5] / area - x * y
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    length, width = capsule(area, mean + half, np.maximum(mean - half, 1 / 12))
    axis = np.column_stack([np.cos(angle), np.sin(angle)])
    return Outlines(np.column_stack([x, y]) + 0.5, axis, length, width, sums[:, 0].copy(), alone)


@njit(cache=True, nogil=True)
def _moments(labels, sums):
    """Sums of 1, x, y, xx, yy, xy over the pixels of each label."""
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            k = labels[y, x]
            if k > 0:
                sums[k, 0] += 1.0
                sums[k, 1] += x
                sums[k, 2] += y
                sums[k, 3] += x * x
                sums[k, 4] += y * y
                sums[k, 5] += x * y


# those that touch ---------------------------------------------------------------------------------------------------


def _parted(crowd, size, picture, before=None):
    """The bodies of a mask in which they touch."""
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
    sums, owner = _settled(small, at, half, radius)
    keep = sums[:, 0] > LEAST * size.area * shrink**2
    if not keep.all() and keep.any():
        sums, owner = _settled(small, at[keep], half, radius)
    bodies = _of_moments(sums, np.zeros(len(sums), bool))
    bodies = bodies.of(bodies.area > 0.5 * LEAST * size.area * shrink**2)
    back = np.array([[1 / shrink, 0.0, float(x0)], [0.0, 1 / shrink, float(y0)]])
    return bodies.moved(back)


def _cut(mask, size):
    """The part of a mask that holds anything, with a border of nothing as wide as a body, and where it begins."""
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
    """How much like a back of an animal, and not like a seam, each pixel is, (h, w) float32 in 0 to 1."""
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
    """How likely a body lies where one lay before, (h, w) float32, 0 to 1, and its angle there, (h, w) float32 rad."""
    likely, angle = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    if before is None:
        return likely, angle
    for (x, y), (c, s) in zip((before.xy - corner) * shrink, before.axis, strict=True):
        reach = int(np.ceil(3 * WANDERS * long))
        rows = slice(max(0, int(y) - reach), max(0, int(y) + reach + 1))
        columns = slice(max(0, int(x) - reach), max(0, int(x) + reach + 1))
        here = likely[rows, columns]
        if not here.size:
            continue
        down, right = np.mgrid[rows.start : rows.start + here.shape[0], columns.start : columns.start + here.shape[1]]
        along, across = c * (right + 0.5 - x) + s * (down + 0.5 - y), c * (down + 0.5 - y) - s * (right + 0.5 - x)
        own = np.exp(-0.5 * ((along / (WANDERS * long)) ** 2 + (across / (0.5 * WANDERS * long)) ** 2))
        angle[rows, columns] = np.where(own > here, np.arctan2(s, c), angle[rows, columns])
        likely[rows, columns] = np.maximum(here, own)
    return likely, angle


def _placed(solid, evidence, long, wide, likely):
    """Capsules that cover the animals without lying on each other, (k, 3): x, y, angle."""
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
    """Pixels of a capsule and of the rim around it, rows and columns from its middle: (ANGLES, k, 2) each."""
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
    """Pixels of a capsule that is wider all around by so much of its width."""
    r = 0.5 * wide + more * wide
    return max(1, round(np.pi * r * r + 2 * r * (long - wide)))


@njit(cache=True, nogil=True)
def _tried(evidence, places, inside, ring, likely, lay, score, angle):
    """The best angle of a capsule at each place, and how well it fits: animal inside, ground around.

    Who lay there before, as likely and at the angle given, counts too.  Places and pixels of capsules are numbers of
    pixels of the picture, row after row.
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
    """Which capsules are kept, the best first, if enough of each is animal and not yet another's."""
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
    """Capsules moved to the pixels that are nearest to each, some times: their sums (k, 6), and whose each pixel is."""
    n = len(at)
    h, w = solid.shape
    x, y, c, s = at[:, 0].copy(), at[:, 1].copy(), np.cos(at[:, 2]), np.sin(at[:, 2])
    sums = np.zeros((n, 6))
    owner = np.full((h, w), -1, np.int32)
    nearest = np.empty((h, w), np.float32)
    reach = half + 2.0 * radius
    for turn in range(ROUNDS):
        owner[:], nearest[:] = -1, 1.8 * radius
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
                        nearest[row, column], owner[row, column] = d, k
        sums[:] = 0.0
        for row in range(h):
            for column in range(w):
                k = owner[row, column]
                if k >= 0:
                    v = solid[row, column]
                    sums[k, 0] += v
                    sums[k, 1] += v * column
                    sums[k, 2] += v * row
                    sums[k, 3] += v * column * column
                    sums[k, 4] += v * row * row
                    sums[k, 5] += v * row * column
        if turn == ROUNDS - 1:
            break
        for k in range(n):
            a = sums[k, 0]
            if a < 3.0:
                continue
            mx, my = sums[k, 1] / a, sums[k, 2] / a
            x[k], y[k] = mx + 0.5, my + 0.5
            xx, yy, xy = sums[k, 3] / a - mx * mx, sums[k, 4] / a - my * my, sums[k, 5] / a - mx * my
            angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
            c[k], s[k] = np.cos(angle), np.sin(angle)
    return sums, owner
