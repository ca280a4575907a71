"""Kernels over ranges of rows, on as many threads as pay.

A kernel is ``kernel(lo, hi, *args)``, compiled with ``nogil=True``, and writes
only rows ``lo`` to ``hi``: so the result is the same bits on any number of
threads.  Plain threads, because numba's own pools spin or block one another
on busy cores, where a 0.3 ms tick then takes 25 ms.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

SMALL = 2048  # rows; below this a second thread costs more than it brings

_threads = max(1, int(os.environ.get("FLOCKBRUSH_THREADS", 0)) or len(os.sched_getaffinity(0)))
_pool: ThreadPoolExecutor | None = None


def set_threads(count):
    """Use at most this many threads from now on; returns the number before."""
    global _threads, _pool
    before, _threads = _threads, max(1, int(count))
    if _pool is not None and before != _threads:
        _pool.shutdown()
        _pool = None
    return before


def threads():
    """How many threads large herds use."""
    return _threads


def over_rows(kernel, count, *args, chunk=2048):
    """Run ``kernel(lo, hi, *args)`` over ``count`` rows."""
    if _threads == 1 or count <= SMALL:
        kernel(0, count, *args)
        return
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(_threads, thread_name_prefix="herd")
    starts = range(0, count, chunk)
    for done in [_pool.submit(kernel, lo, min(lo + chunk, count), *args) for lo in starts]:
        done.result()
