"""Maps that go on at the opposite border: places there are as far apart as the short way, over the seam or not.

``wrap`` is the size of such a map, (width, height) in m.  Kernels take (0, 0) for a map that ends at its borders.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from flockbrush.engine.maths import kernel_function


def short_way(offset, wrap):
    """Offsets (..., 2) m, over the seam where that is shorter; ``wrap`` None or (0, 0): the map ends there."""
    if wrap is None or not wrap[0]:
        return offset
    return offset - np.multiply(wrap, np.floor(offset / np.array(wrap) + 0.5))


def wrap_of(level):
    """The size (width, height) m of a level, or of what is drawn as one, that goes on at its borders; else None."""
    return (level.width, level.height) if getattr(level, "boundary", "open") == "wrap" else None


_WAYS = np.array([(0, 0), *((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)])


def images(points, wrap, reach=0.0):
    """(k, 2) m: ways to move a thing to wherever on the map it lies, first none at all.

    The thing is within ``reach`` m of points (n, 2); nothing reaches farther than to the next border.
    """
    if wrap is None or not wrap[0]:
        return np.zeros((1, 2))
    ways, points = _WAYS * np.array(wrap), np.asarray(points, float)
    here = ((points.min(0) - reach + ways < wrap) & (points.max(0) + reach + ways > 0)).all(axis=1)
    here[0] = True
    return ways[here]


def with_images(things, wrap, outline="polygon", reach=None):
    """[(thing, way)] of dataclass objects, and of their copies on the other sides of the map that reach into it.

    A copy is moved by its way, (x, y) m, that of the thing itself is (0, 0).  ``outline`` and ``reach`` name the fields
    with the points (n, 2) and with how far beyond them it reaches, m.
    """
    ways = ((one, way) for one in things for way in images(getattr(one, outline), wrap, getattr(one, reach or "", 0.0)))
    return [
        (replace(one, **{outline: getattr(one, outline) + way}) if any(way) else one, tuple(way)) for one, way in ways
    ]


@kernel_function
def short_way_(x, y, wrap):
    """`short_way` of one offset, for kernels."""
    if wrap[0] > 0.0:
        x, y = x - wrap[0] * np.floor(x / wrap[0] + 0.5), y - wrap[1] * np.floor(y / wrap[1] + 0.5)
    return x, y


@kernel_function
def on_the_map_(x, y, wrap):
    """Where on the map a place beyond its borders is."""
    if wrap[0] > 0.0:
        x, y = x - wrap[0] * np.floor(x / wrap[0]), y - wrap[1] * np.floor(y / wrap[1])
    return x, y
