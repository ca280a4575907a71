"""What numba compiles for seconds when it is written as one would: slices assigned, and sorting by keys."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.maths import kernel_function
from numba import njit


@kernel_function
def write_(target, source):
    """``target[:] = source`` in one dimension, without a word on sizes that differ."""
    for k in range(len(target)):
        target[k] = source[k]


@njit(cache=True, nogil=True)
def order_(keys, n):
    """``np.argsort(keys[:n], kind="stable")``, by merging."""
    order, other = np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n):
        order[k] = k
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            a, b, end = start, min(start + width, n), min(start + 2 * width, n)
            middle = b
            for at in range(start, end):
                if b == end or (a < middle and keys[order[a]] <= keys[order[b]]):
                    other[at], a = order[a], a + 1
                else:
                    other[at], b = order[b], b + 1
        order, other = other, order
        width *= 2
    return order
