"""Maps that go on at the opposite border: places there are as far apart as the short way, over the seam or not.

``wrap`` is the size of such a map, (width, height) in m.  Kernels take (0, 0) for a map that ends at its borders.
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.maths import kernel_function


def short_way(offset, wrap):
    """Offsets (..., 2) m, over the seam where that is shorter; ``wrap`` None or (0, 0): the map ends there."""
    if wrap is None or not wrap[0]:
        return offset
    return offset - np.multiply(wrap, np.floor(offset / np.array(wrap) + 0.5))


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
