"""Arrays that are used again in every tick: fresh memory costs more than many a kernel that fills it."""

from __future__ import annotations

import math

import numpy as np


class Scratch:
    """Memory by name; what is taken is good until the same name is taken again, and holds anything."""

    def __init__(self):
        self._arrays: dict[str, np.ndarray] = {}

    def take(self, name, shape, dtype=np.float64):
        """An array of this shape, not cleared."""
        size = math.prod(shape)
        array = self._arrays.get(name)
        if array is None or len(array) < size or array.dtype != dtype:
            array = self._arrays[name] = np.empty(size + size // 4, dtype)
        return array[:size].reshape(shape)
