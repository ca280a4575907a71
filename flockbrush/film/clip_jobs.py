"""Work that goes on beside a window: how far it is, what it found, what went wrong."""

from __future__ import annotations

import threading
import time


class JobCancelled(Exception):
    """Nobody wants the work any more."""


class ClipJob:
    """One piece of work in a thread of its own.

    Parameters
    ----------
    name : str
        What is done, in words.
    do : callable
        Called with a function ``say(share)``, share from 0 to 1, which raises `JobCancelled` when the work is not
        wanted any more; what it returns is the result.
    then : callable
        Given the result, by `look`, in the thread that looks.
    after : ClipJob, optional
        Work that must have ended before this begins, since both need the same reader.
    """

    def __init__(self, name, do, then, after: ClipJob | None = None):
        self.name, self.share = name, 0.0  # share: how much is done
        self._do, self._then = do, then
        self._result, self._error = None, None
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(after,), name=f"flockbrush {name}", daemon=True)
        self._thread.start()

    def _run(self, after):
        try:
            if after is not None:
                after.is_over(None)
                self._say(0)
            self._result = self._do(self._say)
        except JobCancelled:
            pass
        except Exception as error:  # noqa: BLE001  told where somebody looks
            self._error = error

    def _say(self, share):
        self.share = float(share)
        if self._stopped.is_set():
            raise JobCancelled
        time.sleep(0)  # the window's turn

    def stop(self, wait=False):
        """The work is not wanted any more."""
        self._stopped.set()
        if wait:
            self.is_over(5.0)

    def is_over(self, wait: float | None = 0.0) -> bool:
        """Whether the work has ended, or does so within some seconds; None: however long it takes."""
        self._thread.join(wait)
        return not self._thread.is_alive()

    def look(self) -> bool:
        """Whether the work is over; its result is handed on, its mistake raised, in this thread, once."""
        if not self.is_over():
            return False
        then, self._then = self._then, None
        if then is not None and not self._stopped.is_set():
            if self._error is not None:
                raise self._error
            then(self._result)
        return True
