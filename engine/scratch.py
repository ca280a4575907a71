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
        kept = self._arrays.get(name)
        if kept is None or len(kept) < size or kept.dtype != dtype:
            kept = self._arrays[name] = np.empty(size + size // 4, dtype)
        return kept[:size].reshape(shape)
