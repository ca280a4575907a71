"""Shapes of bodies in a picture: outlines, capsules, and moments of pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

STRIDE = 0.3  # lengths: how far a body goes from frame to frame at most
SHAPES = np.linspace(0.0, 6.0, 241)  # half axis over radius of a capsule


def _spreads():
    """Variances along and across of capsules of radius 1 and half axis SHAPES, over their areas: (2, k)."""
    a = SHAPES
    area = np.pi + 4 * a
    across = (np.pi / 4 + 4 * a / 3) / area
    along = (4 * a**3 / 3 + np.pi / 4 + np.pi * a**2 + 8 * a / 3) / area
    return along / area, across / area


_ALONG, _ACROSS = _spreads()


@dataclass(frozen=True)
class Outlines:
    """The animals of a picture."""

    xy: np.ndarray  # (k, 2); middles, px
    axis: np.ndarray  # (k, 2); unit vectors along the body; which end is the head is not known
    # length, width, area: (k,); px, px, px²
    length: np.ndarray
    width: np.ndarray
    area: np.ndarray
    alone: np.ndarray  # (k,) bool; whether it touches no other body
    # (k, m); by how much the picture at the end that the axis points to differs from that at the other (see `_ends`);
    # turned about, a body has the same numbers with the other sign. m is 0 where no picture was given.
    ends: np.ndarray = None  # type: ignore[assignment]  # nothing known

    def __post_init__(self):
        if self.ends is None:
            object.__setattr__(self, "ends", np.zeros((len(self.xy), 0)))

    def __len__(self):
        return len(self.xy)

    @staticmethod
    def none() -> Outlines:
        """An empty set of outlines."""
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
        """A subset of the outlines."""
        return Outlines(*(values[chosen] for values in vars(self).values()))


def gone_on(bodies: Outlines, before: Outlines | None, length: float) -> Outlines:
    """The bodies where they will be in the next frame: they move on as since the frame before, in the same pixels."""
    if before is None or not len(before) or not len(bodies):
        return bodies
    away, nearest = cKDTree(before.xy).query(bodies.xy)
    step = np.where((away < STRIDE * length)[:, None], bodies.xy - before.xy[nearest], 0.0)
    return replace(bodies, xy=bodies.xy + step)


def joined(*parts: Outlines) -> Outlines:
    """All bodies of several sets; of sets without features of the ends, none are kept."""
    parts = tuple(replace(part, ends=np.zeros((len(part), 0))) for part in parts)
    return Outlines(*(np.concatenate(values) for values in zip(*(vars(part).values() for part in parts), strict=True)))


def capsule(area, along, across):
    """Length and width of the capsule with this area and ratio of variances along and across its axis."""
    ratio = np.asarray(along) / np.maximum(across, 1e-9)
    shape = np.interp(ratio, _ALONG / _ACROSS, SHAPES)
    radius = np.sqrt(area / (np.pi + 4 * shape))
    return 2 * radius * (1 + shape), 2 * radius


def of_moments(sums, alone):
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
def moments_of(labels, share, sums):
    """Sums of 1, x, y, xx, yy, xy over the pixels of each label, each pixel counted by its share."""
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            k = labels[y, x]
            if k > 0:
                v = share[y, x]
                sums[k, 0] += v
                sums[k, 1] += v * x
                sums[k, 2] += v * y
                sums[k, 3] += v * x * x
                sums[k, 4] += v * y * y
                sums[k, 5] += v * x * y
