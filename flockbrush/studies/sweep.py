"""Parameter sweeps: many runs of an experiment, on all cores or on a cluster.

`run_jobs` takes any ``concurrent.futures.Executor``.  What comes back is written to a journal at once, a line for each
run, so whatever dies, nothing that was done is lost: ``--resume`` goes on where it stopped.  A worker that dies takes
nothing with it either: what it was doing is done again, alone, to find out which run it is that kills.
"""

from __future__ import annotations

import itertools
import json
import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from flockbrush.engine import limits
from flockbrush.engine.files import held, refuse_foreign, refused
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.runs.builds import build_of_sweep, build_of_worker, differences
from flockbrush.runs.cluster import ClusterGone, MixedCode, OtherCode, let_go, work_as
from flockbrush.runs.process_pool import ProcessPool
from flockbrush.runs.terminal import finite, say
from flockbrush.studies.experiments import perform
from flockbrush.studies.sweep_file import Scenario, Sweep, read_sweep

JOURNAL = "runs.jsonl"
RESULTS = "runs.csv", "summary.json", "runs.parquet", "means.png"  # what `sweep_report` writes beside it
ATTEMPTS = 3  # how often a worker may die of the same run before it is listed as failed
BEAT = 0.2  # s between looks at the keyboard


@dataclass(frozen=True)
class SweepJob:
    """Some runs of one scenario, executed by one worker."""

    experiment: str
    scenario: Scenario
    seeds: tuple[int, ...]
    deaths: int = 0  # workers that died while they had it

    def submit(self, executor: Executor) -> Future:
        s = self.scenario
        code = build_of_worker().code
        return executor.submit(work_as, code, perform, self.experiment, s.parameters, s.files, self.seeds, s.measures)

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


# the engine --------------------------------------------------------------------------------


def run_jobs(
    jobs: Iterable[SweepJob], open_executor: Callable[[], Executor], width: int, look=lambda: None
) -> Iterator[dict]:
    """Run all jobs; yields the rows as they are finished, in any order.

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
    waiting: Iterator[SweepJob] = iter(jobs)
    suspects: deque[SweepJob] = deque()
    running: dict[Future, SweepJob] = {}
    executor = open_executor()
    try:
        while True:
            whole = _fill(executor, running, waiting, suspects, 2 * width)
            if whole and not running:
                return
            finished, _ = wait(running, timeout=BEAT, return_when=FIRST_COMPLETED)
            died: list[tuple[SweepJob, Exception]] = []
            for future in finished:
                job = running.pop(future)
                try:
                    rows = list(job.rows(future.result()))
                except CancelledError:
                    raise ClusterGone([Problem("workers", None, None, "there are no workers any more")]) from None
                except OtherCode as error:
                    raise MixedCode([Problem("workers", None, None, str(error))]) from None
                except Exception as error:  # noqa: BLE001  `perform` raises nothing: the worker died, or could not begin
                    died.append((job, error))
                else:
                    yield from rows
            if not whole or any(isinstance(error, BrokenExecutor) for _, error in died):
                died += [(job, died[0][1] if died else BrokenExecutor()) for job in running.values()]
                running.clear()
                let_go(executor)
                executor = open_executor()
            for job, reason in died:
                guilty = len(died) == 1 or not isinstance(reason, BrokenExecutor)
                yield from _blame(replace(job, deaths=job.deaths + guilty), reason, suspects)
            look()
    finally:
        let_go(executor)


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
    """Repeat a job whose worker died; yields its rows when it is given up."""
    if job.deaths < ATTEMPTS:
        suspects.append(job)
    elif len(job.seeds) > 1:  # one of them is to blame: the others shall not suffer for it
        suspects.extend(replace(job, seeds=(seed,), deaths=ATTEMPTS - 1) for seed in job.seeds)
    else:
        reason = f"the worker died {job.deaths} times ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
        yield from job.rows([(job.seeds[0], None, reason, 0.0)])


def _begin_worker():
    """A worker leaves Ctrl-C to its master and other cores to other workers, and does not outlive its master."""
    from flockbrush.engine.parallel import set_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_threads(1)
    build_of_worker()  # what this process has loaded, whatever is edited later
    threading.Thread(target=_end_with_master, daemon=True).start()


def _end_with_master():
    master = multiprocessing.parent_process()
    if master is not None:
        master.join()
        os._exit(1)


def processes(count) -> Executor:
    """An executor of local processes."""
    return ProcessPool(count, _begin_worker)


# the journal ---------------------------------------------------------------------------------


class Journal:
    """The journal of a sweep: a line for each finished run, written at once, after a line with the build.

    A line that was cut off when the program died is left out, and the run is done again.
    """

    def __init__(self, path):
        self.path = Path(path)
        self.rows: dict[tuple[str, int], dict] = {}
        self.build: dict = {}  # the last one that went on with it, as `Build.as_json`
        self.cut = 0
        if self.path.is_file():
            self._read()

    def _read(self):
        good = 0
        with open(self.path, "rb") as file:
            for number in itertools.count(1):
                line = file.readline(limits.JOURNAL_LINE)
                if not line:
                    break
                if not line.endswith(b"\n") and len(line) < limits.JOURNAL_LINE:
                    self.cut = 1
                    break
                row = _row(line)
                if row is None:
                    message = "is not a row of a sweep; choose another folder"
                    raise ProblemsError([Problem(str(self.path), number, None, message)])
                if "build" in row:
                    self.build = row["build"]
                else:
                    self.rows[row["scenario"], row["seed"]] = row
                good += len(line)
        if self.cut:
            with open(self.path, "r+b") as file:
                file.truncate(good)

    def begin(self, build):
        """Note that this build goes on from here.

        Raises
        ------
        ProblemsError
            When the runs that are there were made by other code.
        """
        apart = differences(self.build, build)
        if self.rows and "code" in apart:
            raise refused(self.path, f"its {len(self.rows):,} runs were made by {apart['code']}; choose another folder")
        if self.rows and "libraries" in apart:
            say(f"{self.path}: begun with {apart['libraries']}: its runs may differ in the last bits")
        if apart:
            self.build = build.as_json()
            with open(self.path, "ab", buffering=0) as file:
                file.write(json.dumps({"build": self.build}, ensure_ascii=False).encode() + b"\n")

    def done(self, scenario: Scenario, seed) -> bool:
        """Whether this run succeeded and returned all requested measures."""
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


def _row(line):
    """The row of a line of the journal, or {"build": table}; None when it is neither."""
    try:
        row = json.loads(line, object_pairs_hook=_interned)
    except (ValueError, RecursionError):
        return None
    if isinstance(row, dict) and isinstance(row.get("build"), dict):
        return {"build": row["build"]}
    known = isinstance(row, dict) and isinstance(row.get("scenario"), str) and type(row.get("seed")) is int
    if not known or type(row.get("seconds")) not in (int, float):
        return None
    if row.get("status") == "failed":
        return row if isinstance(row.get("error"), str) else None
    values = row["measures"].values() if row.get("status") == "ok" and isinstance(row.get("measures"), dict) else [{}]
    return row if all(value is None or isinstance(value, (int, float, str)) for value in values) else None


def _interned(pairs):
    """An object whose names are kept once for all rows."""
    return {sys.intern(name): value for name, value in pairs}


def _plain(value):
    """Nothing else may be in a row."""
    raise TypeError(f"a measure must be a number or a string, got {type(value).__name__}")


# a whole sweep ---------------------------------------------------------------------------------


def jobs_of(sweep: Sweep, journal: Journal) -> Iterator[SweepJob]:
    """The remaining jobs, generated on demand."""
    for scenario in _different(sweep):
        left = (seed for seed in sweep.seeds if not journal.done(scenario, seed))
        while seeds := tuple(itertools.islice(left, sweep.experiment.batch)):
            yield SweepJob(sweep.experiment.name, scenario, seeds)


def runs_done(sweep: Sweep, journal: Journal) -> int:
    """The number of runs of a sweep that succeeded before."""
    return sum(journal.done(scenario, seed) for scenario, seed in _runs_of(sweep, journal))


def _runs_of(sweep, journal):
    """[(scenario, seed)] of the runs of a sweep that the journal has."""
    scenarios, seeds = {s.hash: s for s in _different(sweep)}, sweep.seeds
    listed = seeds if isinstance(seeds, range) else frozenset(seeds)
    return [(scenarios[known], seed) for known, seed in journal.rows if known in scenarios and seed in listed]


def _different(sweep):
    """The scenarios of a sweep, each once."""
    return {scenario.hash: scenario for scenario in sweep.scenarios}.values()


def sweep_to(
    sweep: Sweep, folder, open_executor, width, resume=False, look=lambda: None, step=lambda runs_done_before: None
):
    """Run the rest of a sweep; returns its journal.

    Parameters
    ----------
    folder : path
        Where the journal is.
    resume : bool
        Go on with the journal that is there.
    look, step : callable
        See `run_jobs`; ``step(done)`` after every run.

    Raises
    ------
    ProblemsError
        When there are runs already and it should not go on with them or they are all of another sweep, another program
        writes there, or files with the names of results are there that are of no sweep.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with held(folder / JOURNAL):
        journal = Journal(folder / JOURNAL)
        _check_runs(sweep, journal, resume)
        results = [folder / name for name in (*RESULTS, *sweep.experiment.drawn)]
        refuse_foreign(results, lambda path: bool(journal.build or journal.rows))
        journal.begin(build_of_sweep(type(sweep.experiment).__module__))
        runs_done_before = sweep.runs - len(_different(sweep)) * len(sweep.seeds) + runs_done(sweep, journal)
        with journal.writing() as add:
            for row in run_jobs(jobs_of(sweep, journal), open_executor, width, look):
                add(row)
                runs_done_before += 1
                step(runs_done_before)
    return journal


def _check_runs(sweep, journal, resume):
    """ProblemsError unless a sweep may continue with the runs of the journal; reports runs of other scenarios."""
    count, own = len(journal.rows), len(_runs_of(sweep, journal))
    others = count - own
    if count and not own:
        why = "another sweep, or of this one with other levels, brushes or fixed values, or by another version"
        raise refused(journal.path, f"its {count:,} runs are of {why}; choose another folder")
    if count and not resume:
        told = f" ({own:,} of them of this sweep)" if others else ""
        how = "continue with --resume (in Python resume=True), or choose another folder"
        raise refused(journal.path, f"the folder already has {count:,} runs{told}; {how}")
    if others:
        where = "they stay in this file, but not in the tables, the summary and the pictures"
        say(f"{journal.path}: {others:,} of its {count:,} runs are not of this sweep as it is now: {where}")


__all__ = ["SweepJob", "Journal", "jobs_of", "processes", "read_sweep", "run_jobs", "sweep_to"]
