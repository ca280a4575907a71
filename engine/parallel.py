"""Kernels over ranges of rows, on as many threads as pay.

A kernel is ``kernel(lo, hi, *args)``, compiled with ``nogil=True``, and writes
only rows ``lo`` to ``hi``: so the result is the same bits on any number of
threads.  Plain threads, because numba's own pools spin or block one another
on busy cores, where a 0.3 ms tick then takes 25 ms.
"""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections import deque
from concurrent.futures import ThreadPoolExecutor, wait

from flockbrush.engine.locks import Advice

SMALL = 512  # rows; below this a second thread costs more than it brings
PROBE = 128  # rows done alone the first time, to see how long the rest would take
WORTH = 400_000  # ns of work; waking a thread takes 100,000, on a loaded machine more
PIECES = 2  # at least, for each thread: a late thread leaves more to the others


def cores():
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _threads_at_start():
    setting = os.environ.get("FLOCKBRUSH_THREADS", "")
    if not setting:
        return cores()
    if setting.isdecimal() and int(setting):
        return int(setting)
    message = f"FLOCKBRUSH_THREADS must be a whole number of at least 1, got {setting!r}; using all cores"
    warnings.warn(Advice(message), stacklevel=2)
    return cores()


_threads = _threads_at_start()
_pool: ThreadPoolExecutor | None = None
_lock = threading.Lock()
_helper = threading.local()  # .busy in the threads of the pool
_pace: dict[object, float] = {}  # ns a row of each kernel took the last time


def set_threads(count):
    """Use at most this many threads from now on; returns the number before."""
    global _threads, _pool
    with _lock:
        before, _threads = _threads, max(1, int(count))
        old, _pool = (_pool, None) if before != _threads else (None, _pool)
    if old is not None:
        old.shutdown(wait=False)
    return before


def threads():
    """How many threads large herds use."""
    return _threads


def over_rows(kernel, count, *args, chunk=1024):
    """Run ``kernel(lo, hi, *args)`` over ``count`` rows.

    The calling thread begins, calls others when the work is worth it, and
    returns when every row is done.  Only who does a row depends on the time it
    takes, never what is written there.  When a kernel raises, no further chunk
    begins, those begun come to their end, and the error of the lowest rows is
    raised.  A kernel may call this again: the inner one then runs where it is.
    """
    if _threads == 1 or count <= SMALL or getattr(_helper, "busy", False):
        kernel(0, count, *args)
        return
    begun = 0 if kernel in _pace else PROBE
    if begun:
        _timed(kernel, 0, begun, args)
    if _pace[kernel] * (count - begun) < WORTH:
        _timed(kernel, begun, count, args)
    else:
        _share(kernel, begun, count, args, chunk)


def _timed(kernel, lo, hi, args):
    begin = time.perf_counter_ns()
    kernel(lo, hi, *args)
    _pace[kernel] = (time.perf_counter_ns() - begin) / (hi - lo)


def _share(kernel, begun, count, args, chunk):
    """All rows from ``begun`` on, by this thread and helpers."""
    chunk = min(chunk, -(-(count - begun) // (PIECES * _threads)))
    chunks = deque(range(begun, count, chunk))
    errors: list[tuple[int, BaseException]] = []

    def work():
        _helper.busy = True
        try:
            while chunks:
                lo = chunks.popleft()
                _attempt(kernel, lo, min(lo + chunk, count), args, chunks, errors)
        except IndexError:  # another thread took the last one
            pass
        finally:
            _helper.busy = False

    helpers = _submit(work, min(_threads, len(chunks)) - 1)
    work()
    for helper in helpers:
        helper.cancel()  # one that never got a core has nothing left to do
    wait(helpers)
    if errors:
        raise min(errors, key=lambda entry: entry[0])[1]


def _attempt(kernel, lo, hi, args, chunks, errors):
    try:
        _timed(kernel, lo, hi, args)
    except BaseException as error:  # noqa: BLE001  raised again when all have ended
        errors.append((lo, error))
        chunks.clear()


def _submit(work, count):
    """Futures of ``count`` helpers at the same work."""
    global _pool
    with _lock:
        if _pool is None:
            _pool = ThreadPoolExecutor(_threads, thread_name_prefix="herd")
        return [_pool.submit(work) for _ in range(count)]


def _after_fork():
    """A child process has none of its parent's threads."""
    global _pool, _lock
    _pool, _lock = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)
