"""Layers that overlays keep: what they cover of a frame, and where words in them go."""

from __future__ import annotations

from dataclasses import is_dataclass

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.strokes import (
    part_colours,
    part_mask,
)
from flockbrush.render.style import mix


def layer(camera, clip, draw):
    """(top, alpha, ink) of what `draw(canvas)` draws: its rows of the picture, ready to be laid over frames.

    Drawn once over black and once over white: what black shows is ink, and the difference is how much shines through.
    """
    width, height = camera.size
    black, white = np.zeros((height, width, 3), np.uint8), np.full((height, width, 3), 255, np.uint8)
    for picture in (black, white):
        draw(Canvas(picture, clip))
    some = np.zeros(height, np.bool_)
    part_colours(black, white, some)
    rows = np.flatnonzero(some)
    part = slice(rows[0], rows[-1] + 1) if len(rows) else slice(0, 0)
    return int(part.start), white[part], black[part]


def full_width(picture, camera):
    """(top, alpha, ink), as `layer` gives them, of a picture (h, w, 4) of opacity and ink that fills the view."""
    left, top, _, _ = camera.view
    rows = np.flatnonzero(picture[..., 0].any(axis=1))
    part = picture[rows[0] : rows[-1] + 1] if len(rows) else picture[:0]
    alpha, ink = np.zeros((2, len(part), camera.size[0], 3), np.uint8)
    part_mask(part, left, alpha, ink)
    return int(top + (rows[0] if len(rows) else 0)), alpha, ink


def lattice(camera, step):
    """Pixels (k, 2) all over the view, `step` apart, that stay where they are on the ground while it is dragged."""
    left, top, right, bottom = camera.view
    x0, y0 = camera.pixels((0, 0)) % step
    columns, rows = (
        np.arange(left - left % step + x0 - step, right + step, step),
        np.arange(top - top % step + y0 - step, bottom + step, step),
    )
    return np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def is_same(one, other):
    """Whether two tuples are alike: arrays and plain values by what they are, fields only when they are one."""
    for a, b in zip(one, other, strict=True):
        if isinstance(a, np.ndarray):
            if a.shape != b.shape or not np.array_equal(a, b):
                return False
        elif a is not b and (is_dataclass(a) or a != b):
            return False
    return True


def hearts(cells):
    """(iy, ix) of the cell farthest from the edge of each of the four largest pieces of a region."""
    import cv2

    count, pieces, stats, _ = cv2.connectedComponentsWithStats(cells.astype(np.uint8), connectivity=8)
    largest = 1 + np.argsort(-stats[1:, cv2.CC_STAT_AREA], kind="stable")[:4]
    for piece in largest:
        deep = cv2.distanceTransform(np.pad(pieces == piece, 1).astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1]
        heart = np.argwhere(deep > 0.95 * deep.max())
        yield heart[np.argmin(np.abs(heart - heart.mean(axis=0)).sum(axis=1))]


def box_of(left, top, right, bottom):
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]], float)


def strong(colour, theme):
    """A brush's colour, light enough for dark ground."""
    return mix(colour, (255, 255, 255), theme.lift)
