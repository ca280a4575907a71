"""Processes of which only the one that began them hears Ctrl-C."""

from __future__ import annotations

import signal
import threading
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context


@contextmanager
def no_interrupts():
    """Processes that begin here do not hear Ctrl-C, not even before they can say so themselves."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


class ProcessPool(ProcessPoolExecutor):
    """An executor of fresh processes, which begin with the first task."""

    def __init__(self, count, initializer):
        super().__init__(count, get_context("spawn"), initializer=initializer)

    def submit(self, *task, **more):
        """As every executor does."""
        with no_interrupts():
            return super().submit(*task, **more)
