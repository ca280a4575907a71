"""The size of one animal of a clip: given by a person, measured on isolated animals, or estimated from a crowd."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from flockbrush.film.body_outlines import ALONE, ENOUGH, BodySize, size_of_bodies
from flockbrush.film.camera_maps import zoom_of
from flockbrush.film.observations import CannotObserve

READABLE = 8.0  # px of the clip: shorter animals are hard to separate; a note says so
CAPSULE = 0.366  # area of a body of 1 x 0.4 with round ends, BL² [herd.md]
LONG = 2.5  # length of a body over its width, where neither is known [herd.md]
PARTLY = 0.6  # a mask may show so much less, or more, of a body's length than a person measures
CORE = 0.7  # of the largest distance to the edge: farther in is the colour of the body
AROUND, BLURRED = 5, 3  # px around a body that are looked at, and into which it is blurred at most
STRONGEST = 1.2  # times the contrast of the core with the ground: what differs more, such as heads, counts as this
LEAST_CONTRAST = 20.0  # grey levels


def size_in(clip, steady, masks, given):
    """(size of one animal in the masks and a body length, px of the first picture; whether animals separate; notes)."""
    levelled = [_zoomed(mask, zoom_of(steady.maps[k])) for k, mask in masks.items()]
    size = size_of_bodies(levelled)
    apart = size is not None
    length = None if given is None else float(given) * clip.scale
    if size is None and length is None:
        size = _guessed(clip, levelled)
        few = {0: "no animal", 1: "only one animal"}.get(size.alone, f"only {size.alone} animals")
        note = f"{few} without contact to others; body length assumed {size.length:.0f} pixels (set --body-length-px)"
        return size, size.length, size.alone > 0, [note]
    if length is None:
        return size, size.length, apart, []
    if size is None:
        return BodySize(length, length / LONG, CAPSULE * length**2, 0), length, False, []
    ratio = length / size.length
    warning = f"given body length {length:.0f} pixels, but animals without contact to others measure {size.length:.0f}"
    if abs(ratio - 1) > PARTLY:
        size = scaled(size, ratio)
    return size, length, apart, [warning] if abs(ratio - 1) > 0.25 else []


def blur_margin(pictures, masks, size: BodySize) -> float:
    """How far masks reach beyond the bodies, px: blur and compression make bodies look wider; 0 where nothing tells.

    Blur spreads a body, but its contrast with the ground, summed, stays: divided by the contrast of its middle it is
    the area of the body.  Of isolated bodies that, the area of the mask and its circumference give the margin.

    Parameters
    ----------
    pictures, masks : {int: ndarray}
        (h, w, 3) BGR, and (h, w), nonzero where animals are.
    """
    margins = [one for k, mask in masks.items() for one in _margins(pictures[k], mask, size)]
    return max(float(np.median(margins)), 0.0) if len(margins) >= ENOUGH else 0.0


def _margins(picture, mask, size):
    """The margin of each isolated body of a picture."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats((mask > 0).view(np.uint8), connectivity=8)
    h, w = mask.shape
    near = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * BLURRED + 1, 2 * BLURRED + 1))
    for blob in range(1, count):
        x, y, wide, tall, pixels = stats[blob]
        x0, y0, x1, y1 = x - AROUND, y - AROUND, x + wide + AROUND, y + tall + AROUND
        if not ALONE[0] * size.area <= pixels <= ALONE[1] * size.area or x0 < 0 or y0 < 0 or x1 > w or y1 > h:
            continue
        label = labels[y0:y1, x0:x1]
        own = (label == blob).view(np.uint8)
        if cv2.countNonZero(label) > pixels:  # others are near
            continue
        part, reached, away = picture[y0:y1, x0:x1].astype(float), cv2.dilate(own, near), _from_edge(own)
        ground, body = np.median(part[reached == 0], 0), np.median(part[away >= CORE * away.max()], 0)
        contrast = body - ground
        if contrast @ contrast < LEAST_CONTRAST**2:
            continue
        covered = np.minimum((part - ground) @ contrast / (contrast @ contrast), STRONGEST)
        outline = max(cv2.findContours(own, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
        around = cv2.arcLength(outline, True) + np.pi  # an outline runs through the middles of pixels
        beyond = pixels - covered[reached > 0].sum()  # around * margin - pi * margin²
        yield (around - np.sqrt(max(around**2 - 4 * np.pi * beyond, 0.0))) / (2 * np.pi)


def _from_edge(mask):
    return cv2.distanceTransform(mask, cv2.DIST_L2, 5)


def scaled(size: BodySize, ratio: float) -> BodySize:
    """The same size at another number of pixels."""
    return replace(size, length=size.length * ratio, width=size.width * ratio, area=size.area * ratio**2)


def _zoomed(mask, zoom):
    if abs(zoom - 1) < 0.02:
        return mask
    other = cv2.resize(mask * np.uint8(255), None, fx=zoom, fy=zoom, interpolation=cv2.INTER_LINEAR)
    return (other > 127).view(np.uint8)


def _guessed(clip, masks):
    """A size from the width of what looks like animals: twice the usual distance of its ridges to the ground."""
    ridges = []
    for mask in masks:
        away = _from_edge(mask)
        top = (away == cv2.dilate(away, np.ones((3, 3), np.uint8))) & (away > 1.0)
        ridges.append(away[top])
    lengths = np.concatenate(ridges) if ridges else np.empty(0)
    if not len(lengths):
        example = {"what looks like animals": masks[0] * np.uint8(255)} if masks else {}
        raise CannotObserve(
            clip.name,
            "no animals were detected; give their colour with --body-colour R,G,B, or choose other frames: "
            "--frames A:B",
            {"pictures": example},
        )  # fmt: skip
    width = 2.0 * float(np.quantile(lengths, 0.7))
    alone = [row for mask in masks for row in _lone(mask, width)]
    if alone:
        long, wide, area = np.median(alone, axis=0)
        return BodySize(float(long), float(wide), float(area), len(alone))
    return BodySize(LONG * width, width, CAPSULE * (LONG * width) ** 2, 0)


def _lone(mask, width):
    """[(length, width, area)] of patches that look like one body about as wide as given."""
    rows = []
    for outline in cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0]:
        x, y, w, h = cv2.boundingRect(outline)
        whole = x > 0 and y > 0 and x + w < mask.shape[1] and y + h < mask.shape[0]
        area, hull = cv2.contourArea(outline), cv2.contourArea(cv2.convexHull(outline))
        wide, long = sorted(side + 1.0 for side in cv2.minAreaRect(outline)[1])
        if whole and area > 0.85 * hull and 0.6 * width < wide < 1.7 * width and 1.3 * wide < long < 5.0 * wide:
            rows.append((long, wide, area + 0.5 * cv2.arcLength(outline, True)))
    return rows


def too_small(clip, size) -> list[str]:
    """A note if animals are too short to be separated."""
    length = size.length / clip.scale
    if length >= READABLE:
        return []
    return [
        f"animals are about {length:.0f} pixels long in the clip: too small to separate single animals well, at least "
        f"{READABLE:g} are needed; film from a shorter distance (an exported video: a larger --size)"
    ]
