"""Sweep files: which runs, with which parameters and seeds, and what is expected of them.

A sweep is a file ``NAME.sweep.toml``::

    schema = "flockbrush.sweep/1"
    experiment = "level"                # or "v_rules"
    measures = ["polarization", "nnd"]  # all there are by default

    [seeds]
    count = 20                          # 0 to 19

    [grid]                              # every combination of these
    agents = [50, 100]
    brush.march.sensitivity = [5, 10]

    [fixed]
    level = "meadow"
    seconds = 60
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

import flockbrush
from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.tomlfile import Key, TomlFile, parse_toml, read_bytes
from flockbrush.behaviours.validation import shown, validated
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.studies.experiments import Experiment, Mistakes, Ready, experiments

SCHEMA = "flockbrush.sweep/1"
SUFFIX = ".sweep.toml"
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Spec(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Seeds(_Spec):
    """Seeds in a row, or one by one."""

    first: int = Field(0, ge=0, le=2**62, description="the first seed")
    count: int | None = Field(None, ge=1, le=int(limits.SEEDS), description="number of consecutive seeds")
    list: tuple[Annotated[int, Field(ge=0, le=2**63 - 1)], ...] = Field((), description="list of seeds")

    @model_validator(mode="after")
    def _either(self):
        if (self.count is None) == (not self.list):
            raise ValueError("must have either count (and first) or list")
        if len(set(self.list)) < len(self.list):
            raise ValueError("contains a seed twice")
        return self

    @property
    def all(self) -> Sequence[int]:
        return self.list or range(self.first, self.first + (self.count or 0))


class Expectation(_Spec):
    """What the mean of a measure must be."""

    measure: str = Field(description="name of a measure; NAME=WORD is the share of a word among the results")
    where: dict[str, Any] = Field({}, description="check only scenarios with these parameters")
    mean: tuple[Finite, Finite] | None = Field(None, description="lowest and highest allowed mean")
    more_than: dict[str, Any] | None = Field(
        None, description="the mean must be larger than with these parameters, all others being equal"
    )

    @model_validator(mode="after")
    def _one(self):
        if (self.mean is None) == (self.more_than is None):
            raise ValueError("must have either mean or more_than")
        if self.mean is not None and self.mean[0] > self.mean[1]:
            raise ValueError("mean must be [lowest, highest]")
        return self

    def is_about(self, parameters) -> bool:
        """Whether the scenario with these parameters is checked: where they fit and, with more_than, are changed."""
        fits = all(parameters.get(name) == value for name, value in self.where.items())
        return fits and (self.more_than is None or parameters | self.more_than != parameters)


class Plot(_Spec):
    """How means are drawn."""

    across: str | None = Field(None, description="parameter on the horizontal axis; default: the longest of the grid")
    lines: str | None = Field(None, description="parameter with one line per value")
    measures: tuple[str, ...] = Field((), description="measures; default: all")


class _Document(_Spec):
    title: str = Field("", max_length=200, description="title of the sweep")
    experiment: str = Field("level", description="kind of experiment")
    measures: tuple[str, ...] = Field((), description="measures to store; default: all")
    seeds: Seeds = Field(description="random seeds of the runs")
    expect: tuple[Expectation, ...] = Field((), description="expected results")
    plot: Plot = Field(default_factory=lambda: Plot.model_validate({}), description="plot of the means")


def document_schema() -> dict[str, Any]:
    """JSON schema of a sweep file without its grid, fixed values and cases."""
    return _Document.model_json_schema()


@dataclass(frozen=True)
class Scenario:
    """One combination of parameters, with everything a worker needs to run it."""

    hash: str  # of experiment, parameters, files and version: what a row is known by, with its seed
    varied: dict[str, Any]  # what the file varies, as it writes it
    parameters: dict[str, Any]
    files: dict[str, bytes] = field(repr=False)
    measures: tuple[str, ...]


@dataclass(frozen=True)
class Sweep:
    """A sweep that has been checked whole."""

    name: str
    title: str
    experiment: Experiment
    scenarios: tuple[Scenario, ...]
    seeds: Sequence[int]
    expect: tuple[Expectation, ...]
    plot: Plot

    @property
    def runs(self):
        return len(self.scenarios) * len(self.seeds)

    @property
    def varied(self) -> dict[str, list]:
        """The values of everything that varies, in the order of the file."""
        names = dict.fromkeys(name for scenario in self.scenarios for name in scenario.varied)
        return {n: list(dict.fromkeys(s.varied[n] for s in self.scenarios if n in s.varied)) for n in names}

    @property
    def measures(self):
        return list(dict.fromkeys(name for scenario in self.scenarios for name in scenario.measures))


def read_sweep(path) -> Sweep:
    """Read a sweep and check all of it, the levels it names too.

    Raises
    ------
    ProblemsError
        With everything that is wrong, each with its line.
    """
    return parse_sweep(read_bytes(path), str(path), Path(path).parent)


def rehearse(path):
    """Read a sweep and begin a small run of its first scenario, to find the kernels that it calls."""
    sweep = read_sweep(path)
    first = sweep.scenarios[0]
    with sweep.experiment.blaming():
        sweep.experiment.rehearse(first.parameters, first.files)


def parse_sweep(data: bytes, name: str, folder=Path()) -> Sweep:
    """The sweep whose file has these bytes; paths in it start from the folder."""
    toml = parse_toml(data, name)
    check_schema(toml, SCHEMA)
    tables, problems = _parameter_tables(toml)
    fields = _Document.model_fields
    problems += toml.unknown_names((), toml.data, ("schema", "grid", "fixed", "case", *fields))
    document, mistakes = validated(_Document, {key: value for key, value in toml.data.items() if key in fields})
    problems += [toml.problem(path, message) for path, message in mistakes]
    kind = toml.data.get("experiment", "level")
    if isinstance(kind, str) and kind not in experiments():
        problems.append(
            toml.problem(("experiment",), f"there is no experiment {shown(kind)}{did_you_mean(kind, experiments())}")
        )
    if problems or document is None:
        raise ProblemsError(_in_order(problems))
    experiment = experiments()[document.experiment]()
    scenarios = _scenarios(toml, tables, experiment, Path(folder), document.measures)
    sweep = Sweep(
        Path(name).name.removesuffix(SUFFIX), document.title, experiment, scenarios, document.seeds.all,
        document.expect, document.plot,
    )  # fmt: skip
    problems = _loose_ends(toml, sweep)
    if problems:
        raise ProblemsError(_in_order(problems))
    return sweep


def _in_order(problems):
    return sorted(dict.fromkeys(problems), key=lambda problem: problem.line or 0)


# parameters ------------------------------------------------------------------------------


def _parameter_tables(toml: TomlFile):
    """({name: (path, values)} of the grid, {name: (path, value)} that are fixed, the cases) and what is wrong."""
    problems = []
    for table in ("grid", "fixed"):
        if not isinstance(toml.data.get(table, {}), dict):
            problems.append(toml.problem((table,), f"must be a table, got {shown(toml.data[table])}"))
    cases = toml.data.get("case", [])
    if not (isinstance(cases, list) and all(isinstance(case, dict) for case in cases)):
        problems.append(toml.problem(("case",), "cases are written [[case]], one table per case"))
    if problems:
        return None, problems
    grid = dict(_flat(toml.data.get("grid", {}), ("grid",)))
    fixed = dict(_flat(toml.data.get("fixed", {}), ("fixed",)))
    for name, (path, values) in grid.items():
        if not isinstance(values, list) or not values:
            problems.append(
                toml.problem(path, f"a grid must have an array of values, got {shown(values)}; or put it in [fixed]")
            )
        elif len(set(map(_same, values))) < len(values):
            problems.append(toml.problem(path, "contains a value twice"))
        if name in fixed:
            problems.append(toml.problem(fixed[name][0], "is in [grid] as well"))
    listed = [dict(_flat(case, ("case", k))) for k, case in enumerate(cases)]
    problems += [
        toml.problem(path, "is in [grid] as well")
        for case in listed for name, (path, _) in case.items() if name in grid
    ]  # fmt: skip
    titles = [case.get("title", (None, None))[1] for case in listed]
    for k, title in enumerate(titles):
        if not isinstance(title, str):
            problems.append(toml.problem(("case", k), "a case needs a title"))
        elif titles.index(title) < k:
            problems.append(toml.problem(("case", k, "title"), "two cases have this title"))
    return (grid, fixed, listed), problems


def _same(value):
    """What is equal for equal values: 5 and 5.0 are, 1 and true are not."""
    plain = isinstance(value, int | float | str)
    return (isinstance(value, bool), value) if plain else json.dumps(value, default=str)


def _flat(table: dict, path: Key):
    """(dotted name, (path in the file, value)) of nested tables; an empty one is a value, which is refused."""
    for name, value in table.items():
        if isinstance(value, dict) and value:
            yield from ((f"{name}.{inner}", leaf) for inner, leaf in _flat(value, (*path, name)))
        else:
            yield name, ((*path, name), value)


def _scenarios(toml, tables, experiment, folder, measures):
    grid, fixed, cases = tables
    count = len(cases or [0])
    for _, values in grid.values():
        count *= len(values)
    if count > limits.SCENARIOS:
        message = f"the sweep has {count:,} scenarios; the maximum is {limits.SCENARIOS:,}"
        raise ProblemsError([toml.problem(("grid",), message)])
    scenarios, problems = [], []
    for case in cases or [{}]:
        for values in itertools.product(*(values for _, values in grid.values())):
            varied = dict(zip(grid, values, strict=True))
            paths = {name: path for source in (fixed, grid, case) for name, (path, _) in source.items()}
            parameters = {name: value for name, (_, value) in fixed.items()} | varied
            parameters |= {name: value for name, (_, value) in case.items() if name != "title"}
            if case:
                varied = {"case": case["title"][1]} | varied
            try:
                ready = _ready(experiment, parameters, folder)
            except Mistakes as error:
                for name, message in error.found:
                    path = paths.get(name) or paths.get(name.split(".")[0]) or ("fixed",)
                    if message.startswith("must"):
                        path = _element(toml, path, parameters.get(name))
                    problems.append(toml.problem(path, message))
                continue
            unknown = [name for name in measures if name not in ready.measures]
            problems += [
                toml.problem(("measures",), f"there is no measure {shown(name)}{did_you_mean(name, ready.measures)}")
                for name in unknown
            ]
            measured = tuple(measures or ready.measures)
            with experiment.blaming():
                hashed = _hash(experiment.name, ready)
            scenarios.append(Scenario(hashed, varied, ready.parameters, ready.files, measured))
    if problems:
        raise ProblemsError(_in_order(problems))
    return tuple(scenarios)


def _ready(experiment, parameters, folder):
    with experiment.blaming():
        ready = experiment.ready(parameters, folder)
        if not isinstance(ready, Ready):
            raise TypeError(f"experiment {experiment.name!r}: ready must return Ready, got {type(ready).__name__}")
        return ready


def _element(toml, path, value):
    """The path of the one value of a grid's array that is to blame."""
    values = toml.data
    for part in path:
        values = values[part] if not isinstance(values, dict) or part in values else None
        if values is None:
            return path
    return (*path, values.index(value)) if path[0] == "grid" and isinstance(values, list) and value in values else path


def _hash(experiment, ready):
    """What a scenario is known by: the same in every process and on every machine."""
    files = {name: hashlib.sha256(data).hexdigest() for name, data in ready.files.items()}
    text = json.dumps([flockbrush.__version__, experiment, ready.parameters, files], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _loose_ends(toml, sweep):
    """Names in expectations and plots that the sweep does not have."""
    problems = []
    measures, varied = sweep.measures, sweep.varied
    for k, expectation in enumerate(sweep.expect):
        known = len(problems)
        if expectation.measure.split("=")[0] not in measures:
            hint = did_you_mean(expectation.measure, measures)
            problems.append(
                toml.problem(("expect", k, "measure"), f"there is no measure {shown(expectation.measure)}{hint}")
            )
        for table in ("where", "more_than"):
            for name, value in (getattr(expectation, table) or {}).items():
                path = ("expect", k, table, name)
                if name not in varied:
                    problems.append(toml.problem(path, f"the sweep does not vary '{name}'{did_you_mean(name, varied)}"))
                elif value not in varied[name]:
                    problems.append(
                        toml.problem(path, f"is never {shown(value)}; it is {', '.join(map(str, varied[name]))}")
                    )
        if len(problems) == known and not any(expectation.is_about(scenario.varied) for scenario in sweep.scenarios):
            message = "compares scenarios with themselves alone; it must have a value that they do not have already"
            problems.append(toml.problem(("expect", k, "more_than"), message))
    for key in ("across", "lines"):
        name = getattr(sweep.plot, key)
        if name is not None and name not in varied:
            problems.append(
                toml.problem(("plot", key), f"the sweep does not vary '{name}'{did_you_mean(name, varied)}")
            )
    for name in sweep.plot.measures:
        if name not in measures:
            problems.append(
                toml.problem(("plot", "measures"), f"there is no measure {shown(name)}{did_you_mean(name, measures)}")
            )
    return problems
