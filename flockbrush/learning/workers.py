"""Work that is shared among processes, remembered, and the same however many do it.

A task is a function of this package, named by module and name, and its arguments as JSON.  What a task returned is kept
under a name made of both; with a file it survives the program, and whoever does the same work again gets it at once.
"""

from __future__ import annotations

import copy
import hashlib
import importlib
import json
import time
import uuid
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

from flockbrush.engine.files import refused, write_bytes
from flockbrush.engine.plain_json import read_json
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.learning.helpers import HelperGone, Helpers
from flockbrush.runs.builds import build_of_worker
from flockbrush.runs.cluster import OtherCode, let_go, work_as

KEEP_EVERY = 5.0  # s of work that a program which is killed, or a machine that goes down, may lose
_shared: dict[str, object] = {}  # on a cluster, what all tasks are given, by name: the last one


class WorkStopped(Exception):
    """The work was stopped; what was done is kept."""


def _work_beside(given, module, name, arguments):
    """A task for a process beside this one, with what all tasks are given: `Common`."""
    return getattr(importlib.import_module(module), name)(given.value, **arguments)


def _work_elsewhere(given_as, given, module, name, arguments):
    """The same on a cluster worker; arrays that came over the network are read-only."""
    if given_as not in _shared:
        _shared.clear()
        _shared[given_as] = copy.deepcopy(given)
    return getattr(importlib.import_module(module), name)(_shared[given_as], **arguments)


class Workers:
    """Processes that do tasks.

    Parameters
    ----------
    given : object
        What every task gets as its first argument.
    jobs : int or Helpers
        Processes, this one among them.
    signature : str
        Of everything the results depend on besides the tasks' arguments.
    path : path, optional
        Where results are kept.
    stop : callable, optional
        Asked between tasks; True ends the work.
    cluster : Cluster, optional
        Its workers do the tasks, instead of processes.

    Raises
    ------
    ProblemsError
        When the file keeps the results of other work: they would be lost.
    """

    def __init__(self, given, jobs=1, signature="", path=None, stop=None, cluster=None):
        self.given, self.signature, self.stop, self.cluster = given, signature, stop, cluster
        self.own = not isinstance(jobs, Helpers)
        self.helpers: Helpers = Helpers(jobs) if self.own else jobs
        self.common = self.helpers.common(given)
        self.path = Path(path) if path else None
        self.pool: Executor | None = None
        self.known, self.kept = self._read(), time.monotonic()

    def _read(self):
        if self.path is None or not self.path.is_file():
            return {}
        try:
            kept = read_json(self.path)
            signature, done = kept["signature"], dict(kept["done"])
        except (ValueError, KeyError, TypeError):
            raise self._refused("is damaged and cannot be continued") from None
        if signature != self.signature:
            raise self._refused("belongs to another clip, other options or another version; use the same ones")
        return done

    def _refused(self, what):
        """The error that keeps what lies in the file from being written over."""
        return ProblemsError([Problem(str(self.path), None, None, f"{what}, or start again without --resume")])

    def __enter__(self):
        return self

    def __exit__(self, *error):
        if self.pool is not None:
            let_go(self.pool)
        if self.own:
            self.helpers.__exit__(*error)

    def map(self, function, tasks, done=None):
        """Results of ``function(given, **task)``, in the order of the tasks.

        Parameters
        ----------
        function : callable
            On the top level of a module.
        tasks : list of dict
            Arguments that JSON can hold.
        done : callable, optional
            Told how many are done, after each.

        Raises
        ------
        WorkStopped
        ProblemsError
            When the cluster is gone, kills its workers, or runs other code.
        """
        keys = [_key(function, task) for task in tasks]
        fresh = [k for k, key in enumerate(keys) if key not in self.known]
        results = (self._here if self.cluster is None else self._there)(function, tasks, fresh)
        count = len(tasks) - len(fresh)
        try:
            for k, result in results:
                self.known[keys[k]] = result
                count += 1
                if time.monotonic() - self.kept > KEEP_EVERY:
                    self._keep()
                if done:
                    done(count)
        except HelperGone as error:
            if self.path is None:
                raise
            what, how = error.problems[0].file, f"{error.problems[0].message}; finished work is kept"
            raise refused(what, f"{how}; continue with --resume") from None
        finally:
            self._keep()
        return [self.known[key] for key in keys]

    def _asked_to_stop(self):
        if self.stop is not None and self.stop():
            raise WorkStopped

    def _here(self, function, tasks, fresh):
        if self.helpers.jobs == 1 or len(fresh) < 2:
            for k in fresh:
                self._asked_to_stop()
                yield k, function(self.given, **tasks[k])
            return
        todo = [(self.common, function.__module__, function.__name__, tasks[k]) for k in fresh]
        for k, result in self.helpers.run(_work_beside, todo, self._asked_to_stop):
            yield fresh[k], result

    def _there(self, function, tasks, fresh):
        if not fresh:
            return
        if self.pool is None:
            self._open()
        futures = [self.submit(function.__module__, function.__name__, tasks[k]) for k in fresh]
        for k, future in zip(fresh, futures, strict=True):
            while True:
                self._asked_to_stop()
                try:
                    yield k, future.result(timeout=0.5)
                    break
                except TimeoutError:
                    continue
                except self.gone as error:
                    reason = str(error) if isinstance(error, OtherCode) else "is not running any more"
                    raise refused(self.name, f"{reason}; finished work is kept; continue with --resume") from None

    def _open(self):
        shared = self.cluster.share(self.given)
        self.pool, code = self.cluster.open(), build_of_worker().code
        self.submit = partial(self.pool.submit, work_as, code, _work_elsewhere, uuid.uuid4().hex, shared)
        self.name, self.gone = self.cluster.address, (*self.cluster.gone, OtherCode)

    def _keep(self):
        self.kept = time.monotonic()
        if self.path is not None:
            text = json.dumps({"signature": self.signature, "done": self.known})
            write_bytes(self.path, text.encode())


def _key(function, task):
    text = json.dumps([function.__module__, function.__name__, task], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]
