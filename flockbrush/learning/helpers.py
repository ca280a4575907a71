"""Processes that help with the work of learning; results do not depend on who did a task."""

from __future__ import annotations

import atexit
import gc
import importlib
import signal
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from contextlib import suppress

from flockbrush.engine.parallel import set_threads
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.runs.cluster import let_go
from flockbrush.runs.process_pool import ProcessPool

ASKED = 0.5  # s between two questions whether to stop
MOST = 1024  # processes


def _begin():
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to all; the parent hears it, and ends the work
    atexit.register(gc.freeze)  # ends at once: nobody waits while Python looks for cycles
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
    """A result computed by a helper, or by this process on request."""

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


class HelperGone(ProblemsError):
    """A process that did a part of the work was ended."""


class Helpers:
    """So many processes, this one among them; others start when there is work for them.

    Functions are those on the top level of a module, and their arguments can be pickled.
    """

    def __init__(self, jobs: int = 1):
        self.jobs = min(max(1, int(jobs)), MOST)
        self._pool: ProcessPool | None = None

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if self._pool is not None:
            let_go(self._pool)
            self._pool = None

    def _submit(self, function, args) -> Future:
        if self._pool is None:
            self._pool = ProcessPool(self.jobs - 1, _begin)
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
        HelperGone
            When a process was killed.
        """
        asked = asked or (lambda: None)
        if self.jobs == 1 or len(tasks) < 2:
            for k, args in enumerate(tasks):
                asked()
                yield k, function(*args)
            return
        todo, sent = deque(range(len(tasks))), {}  # numbers of tasks that nobody has; futures, with their numbers

        def send(k):
            future = self._submit(function, tasks[k])
            sent[future] = k
            future.add_done_callback(send_next)

        def send_next(_):  # in a thread of the pool
            with suppress(IndexError):  # nothing is left to do
                k = todo.popleft()
                try:
                    send(k)
                except RuntimeError:  # the pool is closed
                    todo.append(k)

        threads, missing = set_threads(1), len(tasks)
        try:
            for _ in range(self.jobs - 1):  # one task each: those that wait for a helper nobody else can do
                with suppress(IndexError):
                    send(todo.popleft())
            while missing:
                asked()
                try:
                    mine = todo.pop()
                except IndexError:
                    wait(list(sent), ASKED, FIRST_COMPLETED)
                else:
                    missing -= 1
                    yield mine, function(*tasks[mine])
                for future in [future for future in list(sent) if future.done()]:
                    k = sent.pop(future)
                    try:
                        result = future.result()
                    except NotSent:
                        tasks[k][0].sent = 0
                        send(k)
                    else:
                        missing -= 1
                        yield k, result
        except BrokenExecutor:
            raise HelperGone([Problem("a learning process", None, None, "is not running any more")]) from None
        finally:
            todo.clear()
            for future in list(sent):
                future.cancel()
            set_threads(threads)
