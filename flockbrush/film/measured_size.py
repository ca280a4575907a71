"""The size of one animal of a clip: given by a person, measured on isolated animals, or estimated from a crowd."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from flockbrush.film.body_outlines import BodySize, size_of_bodies
from flockbrush.film.camera_maps import zoom_of
from flockbrush.film.observations import CannotObserve

READABLE = 8.0  # px of the clip: shorter animals are hard to separate; a note says so
CAPSULE = 0.366  # area of a body of 1 x 0.4 with round ends, BL² [herd.md]
LONG = 2.5  # length of a body over its width, where neither is known [herd.md]
PARTLY = 0.6  # a mask may show so much less, or more, of a body's length than a person measures


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
        away = cv2.distanceTransform(mask, cv2.DIST_L2, 5)
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
