"""Sweeps: the same thing run many times, on every core or on many machines.

`run_jobs` takes any ``concurrent.futures.Executor``.  What comes back is written to a journal at once, a line for each
run, so whatever dies, nothing that was done is lost: ``--resume`` goes on where it stopped.  A worker that dies takes
nothing with it either: what it was doing is done again, alone, to find out which run it is that kills.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import re
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import typer

import flockbrush
from behaviours.problems import Problem, ProblemsError, did_you_mean
from flockbrush import terminal
from flockbrush.experiments import perform
from flockbrush.files import refused
from flockbrush.sweep_file import SUFFIX, Scenario, Sweep, read_sweep
from flockbrush.terminal import Stopped, finite, print_json, say

JOURNAL = "runs.jsonl"
ATTEMPTS = 3  # how often a worker may die of the same run before it is listed as failed
ADDRESS = re.compile(r"(?:(?:tcp|tls|ucx|wss?)://)?(?:\[[0-9a-fA-F:]+\]|[\w.-]+):\d{1,5}")
ANSWERS = "10s"  # a scheduler that says nothing for so long is not there
BEAT = 0.2  # s between looks at the keyboard


@dataclass(frozen=True)
class Job:
    """Some runs of one scenario, done by one worker in one go."""

    experiment: str
    scenario: Scenario
    seeds: tuple[int, ...]
    deaths: int = 0  # workers that died while they had it

    def submit(self, executor: Executor) -> Future:
        s = self.scenario
        return executor.submit(perform, self.experiment, s.parameters, s.files, self.seeds, s.measures)

    def rows(self, entries):
        """Rows for the journal of what `perform` gave."""
        for seed, values, error, seconds in entries:
            status = "ok" if error is None else "failed"
            yield {
                "scenario": self.scenario.hash,
                "seed": seed,
                "status": status,
                "seconds": round(seconds, 6),
                **({"measures": values} if error is None else {"error": error}),
            }


class ClusterGone(ProblemsError):
    """Nobody is left to do the work."""


# the engine --------------------------------------------------------------------------------


def run_jobs(
    jobs: Iterable[Job], open_executor: Callable[[], Executor], width: int, look=lambda: None
) -> Iterator[dict]:
    """Do all jobs; yields the rows as they come, in any order.

    Parameters
    ----------
    jobs : iterable of Job
    open_executor : callable
        Makes a ``concurrent.futures.Executor``; called again when one breaks because a worker died.
    width : int
        How many workers there are; twice as many jobs are under way.
    look : callable
        Called several times a second; what it raises ends the work.
    """
    waiting: Iterator[Job] = iter(jobs)
    suspects: deque[Job] = deque()
    running: dict[Future, Job] = {}
    executor = open_executor()
    try:
        while True:
            whole = _fill(executor, running, waiting, suspects, 2 * width)
            if whole and not running:
                return
            done, _ = wait(running, timeout=BEAT, return_when=FIRST_COMPLETED)
            died: list[tuple[Job, Exception]] = []
            for future in done:
                job = running.pop(future)
                try:
                    rows = list(job.rows(future.result()))
                except CancelledError:
                    raise ClusterGone([Problem("workers", None, None, "nobody is left to do the work")]) from None
                except Exception as error:  # noqa: BLE001  `perform` raises nothing: the worker died, or could not begin
                    died.append((job, error))
                else:
                    yield from rows
            if not whole or any(isinstance(error, BrokenExecutor) for _, error in died):
                died += [(job, died[0][1] if died else BrokenExecutor()) for job in running.values()]
                running.clear()
                _let_go(executor)
                executor = open_executor()
            for job, reason in died:
                guilty = len(died) == 1 or not isinstance(reason, BrokenExecutor)
                yield from _blame(replace(job, deaths=job.deaths + guilty), reason, suspects)
            look()
    finally:
        _let_go(executor)


def _let_go(executor):
    """Ask for nothing more; those of clusters know no ``cancel_futures``."""
    try:
        executor.shutdown(wait=False, cancel_futures=True)
    except TypeError:
        executor.shutdown(wait=False)


def _fill(executor, running, waiting, suspects, width):
    """Hand out work, and say whether the executor took it.

    Jobs at which a worker died are done one at a time, so that the next death tells which of them it was.
    """
    while len(running) < (1 if suspects else width):
        job = suspects.popleft() if suspects else next(waiting, None)
        if job is None:
            return True
        try:
            running[job.submit(executor)] = job
        except BrokenExecutor:
            suspects.appendleft(job)
            return False
        if suspects or job.deaths:
            return True
    return True


def _blame(job, error, suspects):
    """What becomes of a job whose worker died; yields its rows when it is given up."""
    if job.deaths < ATTEMPTS:
        suspects.append(job)
    elif len(job.seeds) > 1:  # one of them is to blame: the others shall not suffer for it
        suspects.extend(replace(job, seeds=(seed,), deaths=ATTEMPTS - 1) for seed in job.seeds)
    else:
        reason = f"the worker died {job.deaths} times ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        yield from job.rows([(job.seeds[0], None, reason, 0.0)])


def _begin_worker():
    """A worker leaves Ctrl-C to its master and other cores to other workers, and does not outlive its master."""
    from engine.parallel import set_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(1)
    threading.Thread(target=_end_with_master, daemon=True).start()


def _end_with_master():
    master = multiprocessing.parent_process()
    if master is not None:
        master.join()
        os._exit(1)


def processes(count) -> Executor:
    """Spawned processes on this machine."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker)


@contextmanager
def cluster(address):
    """(opener of executors, workers) of a Dask cluster.

    Raises
    ------
    ProblemsError
        When dask is not installed, nobody answers, or its workers are of another version.
    """
    try:
        from distributed import Client
    except ImportError:
        raise refused("--cluster", "dask is missing: pip install 'flockbrush[cluster]'") from None
    if not ADDRESS.fullmatch(address):
        raise refused("--cluster", f"an address is a host and a port, such as tcp://host:8786, got {address!r}")
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters of it is said in our own words
    try:
        client = Client(address, timeout=ANSWERS, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise refused(address, f"no Dask scheduler answers there: {error}") from None
    try:
        _same_version(client, address)
        workers = sum(client.nthreads().values())
        yield (lambda: client.get_executor(pure=False)), workers
    finally:
        client.close(timeout=2)


def _same_version(client, address):
    """Workers of another version would mix results that cannot be compared."""
    if not client.nthreads():
        client.wait_for_workers(1, timeout=30)
    found = client.run(_version)
    other = sorted({version for version in found.values() if version != flockbrush.__version__})
    if other:
        raise refused(address, f"workers have flockbrush {', '.join(other)}; here it is {flockbrush.__version__}")


def _version():
    return flockbrush.__version__


# the journal ---------------------------------------------------------------------------------


class Journal:
    """A line for every run that was done, written as soon as it was.

    A line that was cut off when the program died is left out, and the run is done again.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.rows: dict[tuple[str, int], dict] = {}
        self.cut = 0
        if self.path.is_file():
            self._read()

    def _read(self):
        good = 0
        with open(self.path, "rb") as file:
            for number, line in enumerate(file, 1):
                try:
                    row = json.loads(line)
                    key = row["scenario"], row["seed"]
                except (ValueError, KeyError, TypeError):
                    if line.endswith(b"\n"):
                        raise ProblemsError(
                            [
                                Problem(
                                    str(self.path), number, None, "is no row of a sweep; name another folder with --out"
                                )
                            ]
                        ) from None
                    self.cut = 1
                    break
                if not line.endswith(b"\n"):
                    self.cut = 1
                    break
                self.rows[key] = row
                good += len(line)
        if self.cut:
            with open(self.path, "r+b") as file:
                file.truncate(good)

    def done(self, scenario: Scenario, seed) -> bool:
        """Whether this run went well, and gave all that is asked for."""
        row = self.rows.get((scenario.hash, seed))
        return row is not None and row["status"] == "ok" and all(name in row["measures"] for name in scenario.measures)

    @contextmanager
    def writing(self):
        """A function that takes rows; each is in the file when it returns."""
        with open(self.path, "ab", buffering=0) as file:

            def add(row):
                line = json.dumps(finite(row), ensure_ascii=False, default=_plain)
                file.write(line.encode() + b"\n")
                self.rows[row["scenario"], row["seed"]] = json.loads(line)

            yield add


def _plain(value):
    """Nothing else may be in a row."""
    raise TypeError(f"a measure must be a number or a word, got {type(value).__name__}")


# a whole sweep ---------------------------------------------------------------------------------


def jobs_of(sweep: Sweep, journal: Journal) -> list[Job]:
    """What is left to do."""
    jobs = []
    for scenario in {s.hash: s for s in sweep.scenarios}.values():
        left = [seed for seed in sweep.seeds if not journal.done(scenario, seed)]
        for k in range(0, len(left), sweep.experiment.batch):
            jobs.append(Job(sweep.experiment.name, scenario, tuple(left[k : k + sweep.experiment.batch])))
    return jobs


def sweep_to(sweep: Sweep, folder, open_executor, width, resume=False, look=lambda: None, step=lambda done: None):
    """Do what is left of a sweep; its journal.

    Parameters
    ----------
    folder : path
        Where the journal is.
    resume : bool
        Go on with the journal that is there.
    look, step : callable
        See `run_jobs`; ``step(done)`` after every run.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    journal = Journal(folder / JOURNAL)
    if journal.rows and not resume:
        raise refused(
            journal.path, f"there are {len(journal.rows):,} runs already; go on with --resume, or name another --out"
        )
    jobs = jobs_of(sweep, journal)
    done = sweep.runs - sum(len(job.seeds) for job in jobs)
    with journal.writing() as add:
        for row in run_jobs(jobs, open_executor, width, look):
            add(row)
            done += 1
            step(done)
    return journal


def run_sweep(path, out, jobs=None, resume=False, address=None, json_wanted=False, theme="light"):
    """The command ``flockbrush sweep``."""
    from flockbrush import sweep_report as report

    sweep = read_sweep(find_sweep(path))
    out = Path(out)
    if out.exists() and not out.is_dir():
        raise refused(out, "is a file; --out names a folder")
    begin = time.perf_counter()
    with terminal.Interrupts() as interrupts, _workers(jobs, address) as (open_executor, width):

        def look():
            interrupts.gently()
            interrupts.check()

        try:
            with terminal.progress(sweep.title or sweep.name, sweep.runs) as bar:
                journal = sweep_to(sweep, out, open_executor, width, resume, look, bar)
        except Stopped:
            say(f"stopped; what was done is in {out}; go on with --resume")
            raise
        except ClusterGone:
            raise refused(address or "workers", f"is gone; what was done is in {out}; go on with --resume") from None
    found = report.summarise(sweep, journal, time.perf_counter() - begin, width)
    found["files"] = [str(file) for file in report.write_files(sweep, journal, found, out, theme)]
    print_json(found) if json_wanted else report.show(sweep, found)
    if found["failed"] or not all(line["kept"] for line in found["expected"]):
        raise typer.Exit(terminal.PROBLEM)


def find_sweep(name) -> Path:
    """The file of a sweep given as a path, or as the name of a shipped one.

    Raises
    ------
    ProblemsError
        When there is neither.
    """
    import levels

    home, path = Path(levels.__path__[0]), Path(name)
    shipped = {file.name.removesuffix(SUFFIX): file for file in home.glob(f"*{SUFFIX}")}
    if path.exists() or path.suffix or path.name != str(name):
        return path  # reading it says what is wrong with it
    if str(name) not in shipped:
        hint = did_you_mean(str(name), shipped)
        raise refused(name, f"there is no such file, and no shipped sweep of that name{hint}")
    return shipped[str(name)]


@contextmanager
def _workers(count, address):
    """(opener of executors, how many workers): processes here, or a cluster."""
    if address is not None:
        with cluster(address) as found:
            yield found
        return
    width = count or _cores()
    opened = []

    def open_executor():
        opened.append(processes(width))
        return opened[-1]

    try:
        yield open_executor, width
    except BaseException:  # do not wait for runs that nobody wants any more
        for executor in opened:
            for process in list((getattr(executor, "_processes", None) or {}).values()):
                process.terminate()
        raise
    finally:
        for executor in opened:
            executor.shutdown(wait=True, cancel_futures=True)


def _cores():
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


__all__ = ["Job", "Journal", "cluster", "jobs_of", "processes", "read_sweep", "run_jobs", "run_sweep", "sweep_to"]
