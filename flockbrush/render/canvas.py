"""Lines, areas and words laid over a picture: what is drawn once and kept, or small enough to be drawn every frame."""

from __future__ import annotations

import numpy as np

from flockbrush.render import text as texts
from flockbrush.render.shapes import blend, cover_polygon, cover_segments, ink_of
from flockbrush.render.style import Colour


class Canvas:
    """A picture to draw on, in pixel coordinates.

    Parameters
    ----------
    image : (h, w, 3) uint8
        Drawn on in place.
    clip : (left, top, right, bottom), optional
        Nothing is drawn outside.
    """

    def __init__(self, image: np.ndarray, clip=None):
        self.image = image
        self.clip = tuple(int(side) for side in (clip or (0, 0, image.shape[1], image.shape[0])))

    def box(self, low, high) -> tuple[int, int, int, int] | None:
        """Left, top, width and height of the part of the clip between two corners; None if there is none."""
        low = np.clip(np.floor(low), -1e6, 1e6).astype(int)
        high = np.clip(np.ceil(high), -1e6, 1e6).astype(int)
        left, top = max(low[0], self.clip[0]), max(low[1], self.clip[1])
        width, height = min(high[0], self.clip[2]) - left, min(high[1], self.clip[3]) - top
        return (left, top, width, height) if width > 0 and height > 0 else None

    def blend(self, mask, left, top, colour: Colour, alpha=1.0):
        """Lay a colour over the pixels that a mask covers, which lies inside the picture."""
        blend(self.image, mask, left, top, ink_of(colour), float(alpha))

    def cover(self, colour: Colour, mask, alpha=1.0):
        """Lay a colour over everything a mask of the picture's size covers, inside the clip."""
        left, top, right, bottom = self.clip
        self.blend(np.ascontiguousarray(mask[top:bottom, left:right], np.float32), left, top, colour, alpha)

    def area_mask(self, points) -> tuple[np.ndarray, int, int] | None:
        """Coverage of a polygon, with the left and top of its box; None outside the clip."""
        points = np.ascontiguousarray(points, np.float64)
        box = self.box(points.min(axis=0), points.max(axis=0)) if len(points) > 2 else None
        return None if box is None else (cover_polygon(points, *box), box[0], box[1])

    def area(self, points, colour: Colour, alpha=1.0):
        """Fill a polygon (k, 2)."""
        mask = self.area_mask(points)
        if mask is not None:
            self.blend(*mask, colour, alpha)

    def segments(self, segments, width, colour: Colour, alpha=1.0):
        """Draw line segments (m, 4) as one stroke: where they cross it does not get darker."""
        segments = np.ascontiguousarray(segments, np.float64).reshape(-1, 4)
        if not len(segments):
            return
        ends = segments.reshape(-1, 2)
        box = self.box(ends.min(axis=0) - width, ends.max(axis=0) + width)
        if box is not None:
            self.blend(cover_segments(segments, width / 2, *box), box[0], box[1], colour, alpha)

    def line(self, points, width, colour: Colour, alpha=1.0, closed=False, dash=None):
        """Draw a line through points (k, 2); `dash` is (drawn, left out) in pixels."""
        points = np.asarray(points, float)
        if closed:
            points = np.vstack([points, points[:1]])
        if len(points) < 2:
            return
        parts = np.hstack([points[:-1], points[1:]]) if dash is None else dashes(points, *dash)
        self.segments(parts, width, colour, alpha)

    def ring(self, centre, radius, width, colour: Colour, alpha=1.0, dash=None):
        """Draw a circle."""
        self.line(circle(centre, radius), width, colour, alpha, closed=True, dash=dash)

    def disc(self, centre, radius, colour: Colour, alpha=1.0):
        """Fill a circle."""
        self.segments([[*centre, *centre]], 2 * radius, colour, alpha)

    def arrowhead(self, tip, direction, size, colour: Colour, alpha=1.0):
        """Fill an arrowhead whose tip points along a direction."""
        along = np.asarray(direction, float) / max(float(np.hypot(*direction)), 1e-9)
        aside = np.array([-along[1], along[0]])
        tip = np.asarray(tip, float)
        back = tip - along * size
        barb = back - along * size * 0.15
        self.area(
            [tip, barb + aside * size * 0.55, back + along * size * 0.15, barb - aside * size * 0.55], colour, alpha
        )

    def words(self, text, at, height, colour: Colour, alpha=1.0, anchor=(0, 0), halo: Colour | None = None):
        """Write; `at` is the point of the text's box at `anchor` (0 to 1 across, 0 to 1 down). Returns the width."""
        mask = texts.words(str(text), int(height))
        tall, wide = mask.shape
        left, top = round(at[0] - anchor[0] * wide), round(at[1] - anchor[1] * tall)
        if halo is not None and wide:
            self._paste(texts.halo(str(text), int(height)), left - texts.HALO, top - texts.HALO, halo, 0.8)
        self._paste(mask, left, top, colour, alpha)
        return wide

    def scale_bar(self, end, pixels, text, theme, room=np.inf, up=0):
        """Draw a bar of so many pixels and its text, which ends at a point; higher up where it needs more room."""
        (x, y), wide = end, texts.width_of(text, 13)
        if wide + 8 + pixels > room:
            y -= up
        self.words(text, (x, y), 13, theme.muted, anchor=(1, 0.5))
        right = x - wide - 8
        left = right - pixels
        ends = [[left, y, right, y], [left, y - 4, left, y + 4], [right, y - 4, right, y + 4]]
        self.segments(ends, 1.6, theme.ink, 0.9)

    def _paste(self, mask, left, top, colour, alpha):
        box = self.box((left, top), (left + mask.shape[1], top + mask.shape[0]))
        if box is None:
            return
        x, y, width, height = box
        part = mask[y - top : y - top + height, x - left : x - left + width]
        self.blend(np.ascontiguousarray(part), x, y, colour, alpha)


def circle(centre, radius) -> np.ndarray:
    """Points of a circle, (k, 2), close enough to look round."""
    count = int(np.clip(radius * 2, 16, 256))
    turn = np.arange(count) * (2 * np.pi / count)
    return np.asarray(centre, float) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def dashes(points, drawn, left_out) -> np.ndarray:
    """Segments (m, 4) of a dashed line through points (k, 2), `drawn` and `left_out` pixels long."""
    step = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0], np.cumsum(step)])
    if not 0 < along[-1] < 1e5:
        return np.zeros((0, 4))
    starts = np.arange(0, along[-1], drawn + left_out)
    stops, corners = np.minimum(starts + drawn, along[-1]), along[1:-1]
    dash = np.searchsorted(starts, corners) - 1  # in which a corner may lie
    within = (dash >= 0) & (corners < stops[dash])
    whose = np.concatenate([np.arange(len(starts)), dash[within], np.arange(len(starts))])
    at = np.concatenate([starts, corners[within], stops])
    order = np.lexsort((at, whose))
    at, whose = at[order], whose[order]
    xy = np.stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])], axis=1)
    return np.hstack([xy[:-1], xy[1:]])[whose[:-1] == whose[1:]]


def smooth(points, closed=False, pieces=8) -> np.ndarray:
    """A curve through points (k, 2) without corners (Catmull-Rom), `pieces` steps between two of them."""
    points = np.asarray(points, float)
    if len(points) < 3:
        return points
    if closed:
        p = np.vstack([points[-1:], points, points[:2]])
    else:
        p = np.vstack([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    t = (np.arange(pieces) / pieces)[None, :, None]
    a, b, c, d = (p[k : len(p) - 3 + k][:, None, :] for k in range(4))
    curve = 0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
    curve = curve.reshape(-1, 2)
    return curve if closed else np.vstack([curve, points[-1:]])
