"""The experiments of sweeps: runs of levels, and flocks that fly by the V rules.

An experiment is a class that registers itself (`experiment`); third parties name the module that has theirs under the
entry point group ``flockbrush.experiments``.  `Experiment.run` happens in another process, perhaps on another machine:
it gets plain numbers and the bytes of files, and nothing else.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from flockbrush.behaviours.behaviour import Parameters, quantity
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.v_rules.flights import fly, starts
from flockbrush.behaviours.v_rules.indicators import CLUTTERED, GROUPS, OTHER, SHAPES, indicators
from flockbrush.behaviours.validation import validated
from flockbrush.engine.plugins import blaming, load_entry_points
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.levels.build import DT, plane
from flockbrush.levels.libraries import put_brush
from flockbrush.runs.kernel_helper import FEW, TICKS
from flockbrush.runs.v_measures import v_indicators
from flockbrush.studies.flock_parameters import FlockParameters
from flockbrush.systems.measures import measures
from flockbrush.systems.palette import Palette

Row = dict[str, Any]  # what one run gave, by name of measure


class Mistakes(Exception):
    """Errors in parameters: [(name, message)]."""

    def __init__(self, found):
        self.found = list(found)
        super().__init__("; ".join(f"{name}: {message}" for name, message in self.found))


class Ready(NamedTuple):
    """A scenario that can be run: all parameters, and the files it needs."""

    parameters: dict[str, Any]
    files: dict[str, bytes]
    measures: list[str]  # those it can give


class Experiment:
    """One kind of run; each reading of a sweep makes its own, so that what `ready` remembers holds for that alone."""

    name: ClassVar[str]
    batch: ClassVar[int] = 1  # runs handed to a worker at once
    units: Mapping[str, str] = {}  # of measures, for plots and tables
    settings: ClassVar[type[Parameters] | None] = None  # what a sweep may set, with units
    drawn: ClassVar[tuple[str, ...]] = ()  # names of the files of `pictures`

    def blaming(self):
        """A context in which errors name this experiment (`flockbrush.engine.plugins.blaming`)."""
        return blaming("experiment", self.name, type(self).__module__, (Mistakes,))

    def unit_of(self, parameter: str) -> str:
        """Unit of a parameter, "" where there is none."""
        field = self.settings.model_fields.get(parameter) if self.settings else None
        extra = field.json_schema_extra if field is not None else None
        return str(extra.get("unit", "")) if isinstance(extra, dict) else ""

    def ready(self, parameters: dict[str, Any], folder: Path) -> Ready:
        """Check parameters as a file gives them, by dotted name; `Mistakes`."""
        raise NotImplementedError

    def run(self, parameters, files, seeds) -> list[Row]:
        """One row for each seed."""
        raise NotImplementedError

    def rehearse(self, parameters, files):
        """Call the kernels of a run with few animals and few ticks; nothing where compiling takes no time."""

    def pictures(self, sweep, rows, folder, theme) -> list[Path]:
        """Pictures beyond the plots that every sweep gets."""
        return []


_registry: dict[str, type[Experiment]] = {}


def experiment(kind: type[Experiment]) -> type[Experiment]:
    """Register a class of `Experiment`; ValueError where it has no name, or that of another one.

    In a script or notebook (module ``__main__``) a new class replaces the old one of its name.
    """
    if not (isinstance(kind, type) and issubclass(kind, Experiment) and isinstance(getattr(kind, "name", None), str)):
        raise ValueError(f"an experiment must be a class of Experiment with a name, got {kind!r}")
    known = _registry.get(kind.name, kind)
    if (known.__module__, known.__name__) != (kind.__module__, kind.__name__):
        raise ValueError(f"experiment {kind.name!r} is already in {known.__module__}")
    _registry[kind.name] = kind
    return kind


@cache
def _load_experiments_of_others():
    for found in load_entry_points("flockbrush.experiments"):
        if isinstance(found, type):  # an entry point may be the class itself
            experiment(found)


def experiments() -> dict[str, type[Experiment]]:
    """All experiments by name, ours first."""
    _load_experiments_of_others()
    return dict(_registry)


# levels ----------------------------------------------------------------------------------


PLANE_AGENTS = 60  # of a herd on a plane when nobody says


class LevelParameters(Parameters):
    """What a sweep may set of a level, beside ``brush.NAME.PARAMETER``."""

    level: str | None = Field(None, description="a .tmj file beside the sweep, or the name of a shipped level")
    plane: str | None = Field(
        None, description="instead of a level: brush of one herd on an endless plane, a name or a file"
    )
    density: float = quantity(0.7, "animals/BL²", "with plane: density of the animals at the start", 0.001, 10)
    seconds: float = quantity(30.0, "s", "duration of a run", 0, 1e6)
    agents: int | None = Field(None, ge=1, description="number of animals; default: the counts of the level")
    every: float | None = Field(None, gt=0, description="s; also store means over samples at this interval")
    settle: float = quantity(0.0, "s", "with every: time after the start that means leave out", 0, 1e6)

    @model_validator(mode="after")
    def _one_world(self):
        if (self.level is None) == (self.plane is None):
            raise ValueError("must have either level or plane")
        if self.settle and (self.every is None or self.settle >= self.seconds):
            raise ValueError("settle needs every, and must be shorter than seconds")
        if self.every is not None and self.every > self.seconds:
            raise ValueError(f"every must be at most seconds, {self.seconds:g} s: means need samples on the way")
        return self


@experiment
class LevelRuns(Experiment):
    """Runs a level and takes the measures of its last tick."""

    name = "level"
    settings = LevelParameters

    def __init__(self):
        self._opened = cache(_opened)  # scenarios share a level; read again, it may be another one

    @property
    def units(self):
        """Units of measures by name, and of their means over time."""
        units = {name: measure.unit for name, measure in measures().items() if measure.unit}
        return units | {f"mean {name}": unit for name, unit in units.items()}

    def ready(self, parameters, folder):
        plain = {name: value for name, value in parameters.items() if not name.startswith("brush.")}
        spec, mistakes = validated(LevelParameters, plain)
        if spec is None:
            raise Mistakes((".".join(map(str, path)), message) for path, message in mistakes)
        given, brushes, names = self._opened(spec.level, spec.plane, str(folder))
        files, changed = dict(given), {}
        for name, value in parameters.items():
            if name.startswith("brush."):
                brush, field = _brush_of(name, brushes)
                changed[brush] = _changed(changed.get(brush, brushes[brush]), name, field, value)
        for brush, asset in changed.items():
            put_brush(files, brush, asset.source)
        measures = names + (["mean " + name for name in names] if spec.every else [])
        others = {name: value for name, value in parameters.items() if name.startswith("brush.")}
        return Ready(spec.model_dump() | others, files, measures)

    def run(self, parameters, files, seeds):
        return [self._one(parameters, files, seed) for seed in seeds]

    def rehearse(self, parameters, files):
        self._one(parameters | {"agents": FEW, "seconds": TICKS * DT, "every": None, "settle": 0.0}, files, 0)

    @staticmethod
    def _one(parameters, files, seed) -> Row:
        from flockbrush.runs import run as running

        if parameters["plane"] is None:
            simulation = running.from_files(files, seed, parameters["agents"])
        else:
            ((name, source),) = files.items()
            herd = load_brush(source, name), parameters["agents"] or PLANE_AGENTS
            simulation = plane(*herd, density=parameters["density"], seed=seed)
        ticks = round(parameters["seconds"] / simulation.clock.dt)
        gap = max(1, round(parameters["every"] / simulation.clock.dt)) if parameters["every"] else 0
        settled = round(parameters["settle"] / simulation.clock.dt)
        watch = _LevelMeasures(simulation)
        series: dict[str, list] = {}
        try:
            for tick in range(ticks + 1):
                if tick:
                    simulation.tick()
                    watch.counts.take()
                if gap and tick >= settled and (tick % gap == 0 or tick == ticks):
                    for name, value in watch.values().items():
                        series.setdefault("mean " + name, []).append(value)
            return watch.values() | {name: _mean(values) for name, values in series.items()}
        finally:
            simulation.close()


class _LevelMeasures:
    """Everything that can be measured of a level at a moment; what a script takes away is no number then."""

    def __init__(self, simulation):
        from flockbrush.runs.level_counts import Counts

        self.simulation, self.counts = simulation, Counts(simulation)
        self._none: Row = {}
        self._none = dict.fromkeys(self.values(), math.nan)

    def values(self) -> Row:
        return {**self._none, **self.simulation.measures(), **self.counts.values(), **v_indicators(self.simulation)}


def _opened(level_name, plane_brush, folder):
    """(files, brushes by name, names of measures) of a level, or of a herd on a plane; `Mistakes`."""
    from flockbrush.runs import run as running

    beside = Path(folder, level_name or plane_brush)
    try:
        if level_name is not None:
            level, library = running.open_level(beside if beside.is_file() else level_name)
            simulation = running.build(level, library=library)
        else:
            simulation = plane(load_brush(beside) if beside.is_file() else shipped().get(plane_brush), 1)
    except ProblemsError as error:
        key = "level" if level_name is not None else "plane"
        raise Mistakes([(key, str(problem)) for problem in error.problems]) from None
    brushes = {brush.name: brush for brush in simulation.world.resource(Palette).own}
    files, names = simulation.assets(), list(_LevelMeasures(simulation).values())
    simulation.close()
    return files, brushes, names


def _brush_of(name, brushes):
    """("march", ("speed", "mean")) of "brush.march.speed.mean"."""
    _, brush, *field = name.split(".")
    if brush not in brushes:
        raise Mistakes([(name, f"the level does not use a brush '{brush}'{did_you_mean(brush, brushes)}")])
    if field[:1] == ["drives"]:
        raise Mistakes([(name, "numbers of drives cannot be varied, only those of the model, speed, body and vision")])
    if not field or len(field) > 2:
        raise Mistakes([(name, "what is varied is called brush.NAME.PARAMETER, or brush.NAME.speed.mean")])
    return brush, field


def _changed(brush, name, field, value):
    """A brush with one number changed."""
    try:
        if len(field) == 1:
            return brush.with_parameters(**{field[0]: value})
    except ProblemsError as error:
        raise Mistakes([(name, problem.message) for problem in error.problems]) from None
    table = getattr(brush, field[0]) if field[0] in ("speed", "body", "vision") else None
    if table is None:
        raise Mistakes(
            [(name, f"a brush has no table '{field[0]}'{did_you_mean(field[0], ('speed', 'body', 'vision'))}")]
        )
    made, mistakes = validated(type(table), table.model_dump() | {field[1]: value})
    if made is None:
        raise Mistakes((name, message) for _, message in mistakes)
    return brush.model_copy(update={field[0]: made})


def _mean(values):
    """Mean of the numbers that have a meaning; of words, none."""
    numbers = [value for value in values if isinstance(value, (int, float)) and value == value]
    return sum(numbers) / len(numbers) if numbers else math.nan


# V rules ----------------------------------------------------------------------------------


@experiment
class VRules(Experiment):
    """Flocks of Nathan & Barbosa 2008 without a world, many to a job."""

    name = "v_rules"
    batch = 50
    settings = FlockParameters
    drawn = "formations.png", "forming.png", "distance_over_time.png"
    units = {
        "time": "steps",
        "distance": "wingspans",
        "own_distance": "wingspans",
        "settled_distance": "wingspans",
        "persistence": "steps",
        "stabilised": "share",
        "v_like": "share of time",
    }
    plain = (
        "time",
        "stabilised",
        "leads",
        "groups",
        "segments",
        "distance",
        "own_distance",
        "settled_distance",
        "shape",
    )
    lasting = ("v_like", "persistence", "mean_leads", "mean_groups")

    def ready(self, parameters, folder):
        spec, mistakes = validated(FlockParameters, parameters)
        if spec is None:
            raise Mistakes((".".join(map(str, path)), message) for path, message in mistakes)
        flat = ("flatness",) if spec.layer else ()
        return Ready(spec.model_dump(), {}, [*self.plain, *flat, *(self.lasting if spec.every else ())])

    def run(self, parameters, files, seeds):
        spec = FlockParameters(**parameters)
        begin = starts(seeds, spec.birds, spec, spec.side, spec.start == "apart")
        flights = fly(begin, seeds, spec, spec.steps, spec.every)
        values = indicators(flights.xyz, spec)
        rows: list[Row] = [
            {
                "time": int(flights.steps[k]),
                "stabilised": int(flights.settled[k]),
                "leads": int(values.leads[k]),
                "groups": int(values.groups[k]),
                "segments": int(values.segments[k]),
                "distance": float(values.distance[k]),
                "own_distance": float(values.own_distance[k]),
                "settled_distance": float(values.own_distance[k]) if flights.settled[k] else math.nan,
                "shape": SHAPES[values.shape[k]],
            }
            for k in range(len(seeds))
        ]
        for row, xyz, series in zip(rows, flights.xyz, flights.series, strict=True):
            if spec.layer:
                row["flatness"] = flatness(xyz)
            if spec.every:
                row.update(lasting(series, spec, spec.every))
        return rows

    def pictures(self, sweep, rows, folder, theme):
        from flockbrush.studies.v_pictures import draw_sweep

        return draw_sweep(sweep, rows, folder, theme)


def flatness(xyz):
    """1 - height / spread: 1 when all fly at one height, 0 when they fill all directions alike."""
    deviations = np.asarray(xyz).std(0)
    return float(1.0 - deviations[2] / max(deviations[:2].max(), 1e-12))


def lasting(series, rules, every):
    """What a flock that never settles keeps up, over the second half of its moments (moments, birds, 3)."""
    values = indicators(series[len(series) // 2 :], rules)
    v_like = (values.shape != GROUPS) & (values.shape != CLUTTERED) & (values.shape != OTHER)
    changes = int(np.sum(values.shape[1:] != values.shape[:-1]))
    return {
        "v_like": float(v_like.mean()),
        "persistence": every * len(values.shape) / (changes + 1),  # steps that a shape lasts, on average
        "mean_leads": float(values.leads.mean()),
        "mean_groups": float(values.groups.mean()),
    }


def perform(name: str, parameters: dict, files: dict[str, bytes], seeds: tuple[int, ...], wanted: tuple[str, ...]):
    """What a worker does: [(seed, row or None, what went wrong or None, seconds of the processor)].

    A run that fails takes nobody with it: when a batch fails, its runs are tried one by one.
    """
    kind = experiments().get(name)
    if kind is None:
        return [(seed, None, _lacks(f"experiment {name!r}", "experiments"), 0.0) for seed in seeds]
    begin = time.process_time()
    try:
        made = kind()
        with made.blaming():
            rows = [_row_of(name, row) for row in made.run(parameters, files, seeds)]
            if len(rows) != len(seeds):
                raise TypeError(
                    f"experiment {name!r} must return a row for each of {len(seeds)} seeds, got {len(rows)}"
                )
    except Exception as error:  # noqa: BLE001  whatever a run raises is told in its row
        if len(seeds) > 1:
            return [entry for seed in seeds for entry in perform(name, parameters, files, (seed,), wanted)]
        return [(seeds[0], None, _in_words(error), time.process_time() - begin)]
    each = (time.process_time() - begin) / max(len(seeds), 1)
    return [(seed, *_wanted_of(row, wanted), each) for seed, row in zip(seeds, rows, strict=True)]


def _row_of(name, row):
    """A row of an experiment as a journal can keep it."""
    if not isinstance(row, dict):
        raise TypeError(f"experiment {name!r} must return rows that are dicts, got {type(row).__name__}")
    row = {key: value.item() if isinstance(value, np.generic) else value for key, value in row.items()}
    for key, value in row.items():
        if value is not None and not isinstance(value, (bool, int, float, str)):
            raise TypeError(f"experiment {name!r}: {key} must be a number, a text or None, got {type(value).__name__}")
    return row


def _wanted_of(row, wanted):
    """(the measures of a row that a sweep asks for, None), or (None, what went wrong)."""
    missing = [measure for measure in wanted if measure not in row]
    if not missing:
        return {measure: row[measure] for measure in wanted}, None
    return None, _lacks(f"measure {', '.join(map(repr, missing))}", "measures")


def _lacks(what, group):
    """The message for a worker that lacks what its program has registered."""
    where = f"in an installed package (entry point group flockbrush.{group})"
    script = "at the top of the script, outside `if __name__ == ...`"
    return f"this worker has no {what}; register it where workers do, too: {where} or {script}"


def _in_words(error):
    text = " ".join(str(error).split()) or "no reason given"
    return text if isinstance(error, ProblemsError) else f"{type(error).__name__}: {text}"
