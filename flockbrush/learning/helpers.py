"""Processes that help with the work of learning; results do not depend on who did a task."""

from __future__ import annotations

import importlib
import signal
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from multiprocessing import get_context

from flockbrush.engine.files import refused
from flockbrush.engine.parallel import set_threads
from flockbrush.runs.cluster import let_go

ASKED = 0.5  # s between two questions whether to stop
MOST = 1024  # processes


def _begin():
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all; the parent hears it, and ends the work
    set_threads(1)


def _import(module):
    importlib.import_module(module)


class NotSent(Exception):
    """A task came to a process that never got what it has in common with others."""


class Common:
    """What many tasks have in common: it is sent with the first so many, and processes keep the last one."""

    def __init__(self, value, times: int = 0):
        self._value, self.times, self.name, self.sent = value, times, uuid.uuid4().hex, 0

    @property
    def value(self):
        """What it is; `NotSent` in a process that did not get it."""
        if self._value is None:
            raise NotSent
        return self._value

    def __reduce__(self):
        self.sent += 1
        return _common, (self.name, self._value if self.sent <= self.times else None)


_kept: dict[str, Common] = {}


def _common(name, value):
    if value is not None:
        _kept.clear()
        _kept[name] = Common(value)
    return _kept.get(name) or Common(None)


class Later:
    """A result that a helper works out, or this process when it is asked for."""

    def __init__(self, future: Future | None, function, args):
        self.future, self.function, self.args = future, function, args

    def result(self):
        """What the function returned; its error is raised."""
        if self.future is not None and not self.future.cancel():
            try:
                return self.future.result()
            except BrokenExecutor:  # the process was killed
                pass
        return self.function(*self.args)


class Helpers:
    """So many processes, this one among them; others start when there is work for them.

    Functions are those on the top level of a module, and their arguments can be pickled.
    """

    def __init__(self, jobs: int = 1):
        self.jobs = min(max(1, int(jobs)), MOST)
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if self._pool is not None:
            let_go(self._pool, wait=error[0] is None)
            self._pool = None

    def _submit(self, function, args) -> Future:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self.jobs - 1, get_context("spawn"), initializer=_begin)
        return self._pool.submit(function, *args)

    def begin(self, module: str):
        """Start a process already, which imports a module while this one does something else."""
        if self.jobs > 1:
            self._submit(_import, (module,))
        return self

    def common(self, value) -> Common:
        """What tasks of `run` have in common, for their first argument."""
        return Common(value, 2 * self.jobs)

    def later(self, function, *args) -> Later:
        """Begin something that is needed later."""
        return Later(None if self.jobs == 1 else self._submit(function, args), function, args)

    def run(self, function, tasks: Sequence[tuple], asked: Callable[[], None] | None = None) -> Iterator[tuple]:
        """(number of a task, its result) as they are done; ``asked`` is called now and then, and may raise.

        Raises
        ------
        ProblemsError
            When a process was killed.
        """
        asked = asked or (lambda: None)
        if self.jobs == 1 or len(tasks) < 2:
            for k, args in enumerate(tasks):
                asked()
                yield k, function(*args)
            return
        threads = set_threads(1)
        left: list[Future] = []
        try:
            left = [self._submit(function, args) for args in tasks]
            numbers = {future: k for k, future in enumerate(left)}
            while left:
                asked()
                mine = next((future for future in reversed(left) if future.cancel()), None)
                if mine is not None:  # nobody has begun it
                    left.remove(mine)
                    yield numbers[mine], function(*tasks[numbers[mine]])
                else:
                    wait(left, ASKED, FIRST_COMPLETED)
                done = [future for future in left if future.done()]
                for future in done:
                    left.remove(future)
                    k = numbers[future]
                    try:
                        result = future.result()
                    except NotSent:
                        tasks[k][0].sent = 0
                        left.append(self._submit(function, tasks[k]))
                        numbers[left[-1]] = k
                    else:
                        yield k, result
        except BrokenExecutor:
            raise refused(
                "a learning process", "is not running any more; finished work is kept; continue with --resume"
            ) from None
        finally:
            for future in left:
                future.cancel()
            set_threads(threads)
