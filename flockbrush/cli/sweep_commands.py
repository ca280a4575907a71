"""Implementation of ``flockbrush sweep``."""

from __future__ import annotations

import time
from contextlib import contextmanager
from pathlib import Path

import typer

from flockbrush import levels
from flockbrush.engine.files import refused
from flockbrush.engine.problems import did_you_mean
from flockbrush.output.figures import drawing_problems
from flockbrush.runs import terminal
from flockbrush.runs.cluster import ClusterGone, MixedCode, cluster, let_go
from flockbrush.runs.compile_ahead import compiling_for
from flockbrush.runs.terminal import Stopped, print_json, say
from flockbrush.studies import sweep_report as report
from flockbrush.studies.sweep import processes, sweep_to
from flockbrush.studies.sweep_file import SUFFIX, read_sweep


def run_sweep(path, out, jobs, workers, resume, json_wanted, theme):
    """The command ``flockbrush sweep``."""
    file = find_sweep(path)
    with compiling_for("flockbrush.studies.sweep_file:rehearse", path=file):  # reading builds the levels
        sweep = read_sweep(file)
    out = Path(out)
    if out.exists() and not out.is_dir():
        raise refused(out, "is a file; --out must be a folder")
    begin, name = time.perf_counter(), workers[0] if workers else "workers"
    with terminal.Interrupts() as interrupts, _workers(jobs, workers) as (open_executor, width):

        def look():
            interrupts.gently()
            interrupts.check()

        try:
            with terminal.progress(sweep.title or sweep.name, sweep.runs) as bar:
                journal = sweep_to(sweep, out, open_executor, width, resume, look, bar)
        except Stopped:
            say(f"stopped; finished runs are in {out}; continue with --resume")
            raise
        except (ClusterGone, MixedCode) as error:
            why = error.problems[0].message if isinstance(error, MixedCode) else "cannot be reached any more"
            raise refused(name, f"{why}; finished runs are in {out}; continue with --resume") from None
    summary = report.summarise(sweep, journal, time.perf_counter() - begin, width)
    summary["files"] = [str(file) for file in report.write_files(sweep, journal, summary, out, theme)]
    for problem in drawing_problems(out):
        say(f"{out}: means.png was not drawn; {problem.message}")
    print_json(summary) if json_wanted else report.show(sweep, summary)
    if summary["failed"] or not all(line["kept"] for line in summary["expected"]):
        raise typer.Exit(terminal.PROBLEM)


def find_sweep(name) -> Path:
    """The file of a sweep given as a path, or as the name of a shipped one.

    Raises
    ------
    ProblemsError
        When there is neither.
    """

    home, path = Path(levels.__path__[0]), Path(name)
    shipped = {file.name.removesuffix(SUFFIX): file for file in home.glob(f"*{SUFFIX}")}
    if path.exists() or path.suffix or path.name != str(name):
        return path  # reading it says what is wrong with it
    if str(name) not in shipped:
        hint = did_you_mean(str(name), shipped)
        raise refused(name, f"there is no such file and no shipped sweep of this name{hint}")
    return shipped[str(name)]


@contextmanager
def _workers(width, elsewhere):
    """Context manager: (function that opens an executor, number of workers), local or on a cluster."""
    if elsewhere is not None:
        with cluster(*elsewhere) as workers:
            yield workers.open, workers.width
        return
    opened = []

    def open_executor():
        opened.append(processes(width))
        return opened[-1]

    try:
        yield open_executor, width
    finally:
        for executor in opened:
            let_go(executor)
