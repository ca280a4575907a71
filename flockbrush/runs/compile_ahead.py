"""Compiles missing kernels in several processes before some work begins.

A scout finds what will be called (`flockbrush.engine.kernel_calls`); this process and helpers compile it, each into
numba's cache, from where this process then loads what others have made.  What the scout did not find is compiled when
it is called, as without all this.
"""

from __future__ import annotations

import multiprocessing
import sys
import threading
import time
from contextlib import contextmanager, suppress

from flockbrush.engine.kernel_calls import is_cached, key_of, stored_kernels
from flockbrush.engine.parallel import threads
from flockbrush.runs import kernel_helper, terminal
from flockbrush.runs.process_pool import no_interrupts

FEW_STORED = 20  # kernels; with more, only some are to be compiled, and a scout would cost more than it brings
MOST_HELPERS = 7  # each holds some 200 MB
PATIENCE = 15.0  # s that a scout may find nothing while there is nothing else to do
LEVEL = "flockbrush.runs.kernel_helper:rehearse"
EVERY = 5.0  # s between lines where stderr is no terminal


def compiling_ahead(name, seed=None, agents=None, brush=None):
    """`compiling_for` what `run.start` of this will need; ``name`` may be a recording, too."""
    return compiling_for(LEVEL, name=name, seed=seed, agents=agents, brush=brush)


@contextmanager
def compiling_for(rehearsal, **work):
    """As `flockbrush.runs.terminal.compiling`; kernels that the work will need are compiled together.

    Parameters
    ----------
    rehearsal, work : str, dict
        See `CompileAhead`.
    """
    ahead = CompileAhead(work, rehearsal)
    try:
        with terminal.compiling(ahead.meet):
            yield
    finally:
        ahead.close()


class CompileAhead:
    """Helper processes that compile the kernels of some work together with this process.

    Parameters
    ----------
    work : dict
        Arguments of the rehearsal: numbers, words, paths (given as words) or None; by default those of
        `flockbrush.runs.run.start`: name (or path of a recording), seed, agents, brush.
    rehearsal : str
        ``module:function`` that does the same as the work with few animals and few ticks, for the scout.
    """

    def __init__(self, work, rehearsal=LEVEL):
        self.work = {name: value if isinstance(value, int | None) else str(value) for name, value in work.items()}
        self.rehearsal = rehearsal
        self.found = self.done = 0
        self._waiting: list = []
        self._known: set[str] = set()
        self._changed = threading.Condition()
        self._helpers: list = []  # processes
        self._scouting = self._begun = self._ended = False

    def meet(self, kernel, types):
        """Numba is about to compile a kernel for this process: the first time begin, the second time compile all."""
        self._known.add(key_of(kernel.py_func.__module__, kernel.py_func.__qualname__, types))
        if not self._begun:
            self._begun = True
            if threads() > 1 and is_cached(kernel) and stored_kernels() < FEW_STORED:
                self._begin()
        elif self._helpers and not self._ended:
            self._compile_found()

    def compile_now(self):
        """Compile all that the work will need, without doing it."""
        self._begun = True
        self._begin()
        self._compile_found()

    def _compile_found(self):
        self._ended = True
        try:
            self._compile_all()
        finally:
            self.close()

    def _begin(self):
        self._scouting = True
        self._start(self._listen, kernel_helper.scout, self.rehearsal, self.work)
        for _ in range(min(threads() - 1, MOST_HELPERS)):
            self._start(self._serve, kernel_helper.compile_calls)

    def _start(self, attend, task, *arguments):
        """Start a helper, and a thread that attends to it."""
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        helper = context.Process(target=task, args=(there, *arguments), daemon=True)
        try:
            with no_interrupts():
                helper.start()
        except OSError:  # this process does it alone
            here.close()
        else:
            self._helpers.append(helper)
        there.close()
        threading.Thread(target=attend, args=(here,), daemon=True).start()

    def _listen(self, scout):
        """Take in what the scout finds."""
        with suppress(EOFError, OSError):
            while True:
                call = scout.recv()
                with self._changed:
                    if call.key not in self._known:
                        self._known.add(call.key)
                        self._waiting.append(call)
                        self.found += 1
                        self._changed.notify_all()
        with self._changed:
            self._scouting = False
            self._changed.notify_all()

    def _serve(self, helper):
        """Give a helper one call after another."""
        call = None
        with suppress(EOFError, OSError):
            while True:
                helper.recv()
                self._count(call)
                call = self._next()
                helper.send(call)
                if call is None:
                    return
        self._count(call)  # it has died of it: whoever needs the kernel compiles it

    def _count(self, call):
        if call is not None:
            with self._changed:
                self.done += 1
                self._changed.notify_all()

    def _next(self, patience=None):
        """The call that takes longest of those that wait, as soon as there is one; None when there will be none."""
        with self._changed:
            while not self._waiting and self._scouting:
                if not self._changed.wait(patience) and patience:
                    return None
            if not self._waiting:
                return None
            call = max(self._waiting, key=lambda call: call.weight)
            self._waiting.remove(call)
            return call

    def _compile_all(self):
        """Compile together with the helpers until nothing is left."""
        with _shown(self):
            while (call := self._next(PATIENCE)) is not None:
                with suppress(Exception):  # whoever needs the kernel meets the error again
                    call.compile()
                self._count(call)
            with self._changed:
                while self.done < self.found and any(helper.is_alive() for helper in self._helpers):
                    self._changed.wait(1.0)

    def close(self):
        """End all helpers."""
        self._ended = True
        for helper in self._helpers:
            helper.kill()
            helper.join()
        with self._changed:
            self._waiting.clear()
            self.done = self.found
            self._scouting = False
            self._changed.notify_all()


class _shown:
    """Shows the progress of compiling: a bar, or lines if stderr is not a terminal."""

    def __init__(self, ahead):
        self.ahead, self._over = ahead, threading.Event()
        self._thread = threading.Thread(target=self._show, daemon=True)

    def __enter__(self):
        self._thread.start()

    def __exit__(self, *_):
        self._over.set()
        self._thread.join()

    def _show(self):
        if terminal.is_terminal(sys.stderr):
            with terminal.progress("compiling kernels (only at the first start)", 2) as bar:
                while not self._over.wait(0.2):
                    bar(self.ahead.done, total=max(self.ahead.found, 1))
            return
        last = time.monotonic()
        while not self._over.wait(0.2):
            if time.monotonic() - last >= EVERY:
                last = time.monotonic()
                terminal.say(f"{self.ahead.done} of {self.ahead.found} kernels compiled")
