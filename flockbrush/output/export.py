"""Exports of a run, written during the run and never held in memory as a whole.

`Exports` takes moments from a running simulation and hands them to one `Exporter` for each file; the ending of the
name says which.  A file gets its name when it is complete; one that was interrupted is complete up to there, and one
that failed is not there.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import CommandError
from flockbrush.engine.files import output_problems, refused
from flockbrush.engine.plugins import PluginError, blaming, is_ours
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.output.exporter import exporter_of, exporters
from flockbrush.runs.catalogue import LABELS
from flockbrush.runs.snapshots import Sampler
from flockbrush.runs.terminal import Stopped, say


def check_exports(paths, inputs=(), others=(), options=None):
    """Check before the run that all exports and other outputs can be written.

    Raises
    ------
    ProblemsError
        For unknown endings, packages that are not installed, and names that cannot be written.
    """
    problems, beside, inputs = [], [], [*inputs]
    for path in map(Path, paths):
        kind = exporter_of(path)
        if kind is None:
            got = f"{path.suffix!r}" if path.suffix else "none"
            message = f"the file extension of an export must be one of {', '.join(exporters())}; got {got}"
            problems.append(Problem(str(path), None, None, message))
            continue
        with _blaming(kind):
            messages = [*_lacking(kind), *kind.problems(path, options or {})]
            problems += [Problem(str(path), None, None, message) for message in messages]
            beside += kind.beside(path)
            inputs += kind.reads(options or {})
    problems += output_problems([*paths, *others], inputs)
    problems = problems or output_problems([*paths, *beside, *others], inputs)
    if problems:
        raise ProblemsError(problems)


def _lacking(kind):
    """Messages about packages that an exporter needs and that are not installed."""
    extra = "   (or: pip install flockbrush[export])" if is_ours(kind.__module__) else ""
    for module, package in kind.needs:
        parts = module.split(".")  # a part of a package that is not there cannot be looked for
        if not all(importlib.util.find_spec(".".join(parts[: k + 1])) for k in range(len(parts))):
            yield f"this needs the package {package}: pip install {package}{extra}"


def _blaming(kind):
    return blaming("exporter", kind.__name__, kind.__module__, (OSError,))


def check_rate(fps, simulation, name="fps"):
    """Raise `ProblemsError` if a run cannot be exported at so many moments per second; None is each file's own."""
    ticks = 1 / simulation.world.resource(Clock).dt
    if fps is not None and not 0 < fps <= ticks:
        raise refused(name, f"must be above 0 and at most {ticks:g} (ticks per second), got {fps:g}")


def exported(simulation, path, fps=None, last_tick=0, **options):
    """Write one export of a simulation that runs on to a tick; options as of `Exports`."""
    with Exports([path], simulation, fps, **options) as exports:
        exports.take()
        while simulation.clock.tick < last_tick:
            simulation.tick()
            exports.take()


class Exports:
    """The files a run writes: call `take` at the start and after every tick; use it in a ``with``.

    Parameters
    ----------
    paths : sequence of path
        After `check_exports`.
    fps : float, optional
        Moments per second; each kind of file has its own by default: every tick for tables and videos, 24 for USD.
    edits : EditedMoments, optional
        Edits that all files show.
    options
        For the exporters that know them (`Exporter.choices`); ``size`` of pictures.
    """

    def __init__(self, paths, simulation, fps=None, edits=None, **options):
        check_rate(fps, simulation)
        if problems := output_problems(paths, simulation.inputs(paths)):
            raise ProblemsError(problems)
        self._pairs, self._edits = [], edits
        self._begun, self._error = False, None
        try:
            for path in paths:
                kind = exporter_of(path)
                rate = kind.fps if fps is None else fps
                sampler = Sampler(simulation, rate, LABELS if kind.labels else ())
                with _blaming(kind):
                    self._pairs.append((kind(path, simulation, rate, **options), sampler))
                with self._pairs[-1][0].naming(), _blaming(kind):
                    self._pairs[-1][0].open()
        except BaseException:
            self.abandon()
            raise

    def take(self):
        """Write the frames that are due; a file that fails later than at the start is told, and the others go on.

        The error is raised where no file is left, else by `close`.
        """
        for exporter, sampler in [*self._pairs]:
            try:
                with exporter.naming():
                    for moment in sampler.due():
                        shown = moment if self._edits is None else self._edits.at(moment)
                        with _blaming(type(exporter)):
                            exporter.take(shown)
            except Exception as error:
                self._fail(exporter, error)
                if not (self._begun and self._pairs):
                    raise
                say(f"{exporter.path} is left out: {error}")
        self._begun = True

    def close(self):
        """Complete all files; then the first error is raised, if some have failed."""
        for exporter, _ in [*self._pairs]:
            try:
                with exporter.naming(), _blaming(type(exporter)):
                    exporter.close()
            except Exception as error:  # noqa: BLE001  it is raised below
                self._fail(exporter, error)
        self._pairs = []
        if self._error is not None:
            raise self._error

    def _fail(self, exporter, error):
        self.abandon([exporter])
        self._error = self._error or error

    def abandon(self, which=None):
        """Remove incomplete files: all, or some."""
        which = [exporter for exporter, _ in self._pairs] if which is None else which
        for exporter in which:
            exporter.abandon()
        self._pairs = [pair for pair in self._pairs if pair[0] not in which]

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        kept = isinstance(error, (Stopped, PluginError))
        kept |= isinstance(error, CommandError) and not error.source  # of no recording
        if kind is not None:  # a part of a run replaces no file
            left = [exporter for exporter, _ in self._pairs if not kept or exporter.replaces]
            for exporter in left if kept else ():
                say(f"{exporter.path} is still the earlier file: the new one is not complete")
            self.abandon(left)
        if kind is not None and not kept:
            return
        try:
            self.close()
        except BaseException:
            self.abandon()
            raise
