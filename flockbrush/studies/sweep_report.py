"""What came of a sweep: means, expectations, tables and plots."""

from __future__ import annotations

import csv
import importlib.util
import json
import math
from pathlib import Path

import numpy as np
from scipy.special import stdtrit
from scipy.stats import binomtest

import flockbrush
from flockbrush.engine.files import whole
from flockbrush.output.figures import MARKERS, ChartCurve, CurveChart, drawing_problems, figure_of, write_figure
from flockbrush.render.style import PALETTE
from flockbrush.runs.terminal import number, print_line, styled, table
from flockbrush.runs.terminal import show as print_table
from flockbrush.studies.sweep import Journal
from flockbrush.studies.sweep_file import Sweep
from flockbrush.systems.measures import measures

SCHEMA = "flockbrush.runs/1"
SHOWN_FAILURES = 10
NOTE = "marks: means over seeds; bars: standard error of the mean in each direction"
MOST_CURVES = 8
WIDE = 160  # characters of a table; more stands in the files


# in numbers ------------------------------------------------------------------------------


def rows_of(sweep: Sweep, journal: Journal):
    """(scenario, row) of every run of the sweep that the journal has, scenario by scenario, seed by seed."""
    for scenario in sweep.scenarios:
        for seed in sweep.seeds:
            row = journal.rows.get((scenario.hash, seed))
            if row is not None:
                yield scenario, row


def summarise(sweep: Sweep, journal: Journal, wall=math.nan, workers=1) -> dict:
    """Everything that is printed: means by scenario, failures, expectations, speed."""
    by_scenario: list[dict] = []
    good, failed, seconds = 0, [], 0.0
    for scenario in sweep.scenarios:
        keys = ((scenario.hash, seed) for seed in sweep.seeds)
        rows = [journal.rows[key] for key in keys if key in journal.rows]
        fine = [row for row in rows if row["status"] == "ok"]
        failed += [
            {**scenario.varied, "seed": row["seed"], "error": row["error"]} for row in rows if row["status"] != "ok"
        ]
        means, shares, intervals = {}, {}, {}
        for name in scenario.measures:
            values = [row["measures"].get(name) for row in fine]
            if any(isinstance(value, str) for value in values):
                shares[name] = _shares(values)
                intervals[name] = {word: _interval_of(share, len(values)) for word, share in shares[name].items()}
            else:
                means[name] = _moments(values, sweep.experiment.units.get(name) == "share")
        spent = sum(row["seconds"] for row in fine)
        usual = float(np.median([row["seconds"] for row in fine])) if fine else math.nan  # kernels load in the first
        rate = 1.0 / usual if usual > 0 else math.nan
        by_scenario.append(
            {
                "parameters": scenario.varied,
                "runs": len(fine),
                "means": means,
                "shares": shares,
                "share_intervals": intervals,
                "runs_per_core_second": rate,
            }
        )
        good, seconds = good + len(fine), seconds + spent
    return {
        "schema": SCHEMA,
        "sweep": sweep.name,
        "title": sweep.title,
        "version": flockbrush.__version__,
        "build": {name: journal.build.get(name) for name in ("code", "packages", "cpu")},
        "runs": sweep.runs,
        "done": good,
        "failed": len(failed),
        "failures": failed[:1000],
        "wall_seconds": wall,
        "core_seconds": seconds,
        "workers": workers,
        "scenarios": by_scenario,
        "expected": [line for expectation in sweep.expect for line in _kept(expectation, by_scenario)],
    }


def _moments(values, share=False):
    """Runs in which a measure is a number, mean and standard deviation over them, standard error of the mean.

    And its 95 % interval: Student's t; of what is yes or no in every run (True or False, or 0 or 1 of the unit "share")
    that of `_interval_of`.
    """
    known = [value for value in values if value is not None and math.isfinite(value)]
    n, unknown = len(known), math.nan
    if not n:
        return {"n": 0, "mean": unknown, "std": unknown, "error": unknown, "low": unknown, "high": unknown}
    mean, spread = float(np.mean(known)), float(np.std(known, ddof=1)) if n > 1 else unknown
    error = spread / math.sqrt(n)
    wide = error * float(stdtrit(n - 1, 0.975)) if n > 1 else unknown
    interval = {"low": mean - wide, "high": mean + wide}
    if all(isinstance(value, bool) or (share and value in (0, 1)) for value in known):
        interval = _interval_of(mean, n)
    return {"n": n, "mean": mean, "std": spread, "error": error, **interval}


def _interval_of(share, n):
    """Wilson's 95 % interval of a share of n runs."""
    interval = binomtest(round(share * n), n).proportion_ci(method="wilson")
    return {"low": float(interval.low), "high": float(interval.high)}


def _shares(values):
    words = sorted({str(value) for value in values})
    return {word: sum(str(value) == word for value in values) / len(values) for word in words}


def mean_of(scenario, measure):
    """The mean of a measure in one scenario of a summary; of ``NAME=WORD``, how often it was that word."""
    name, _, word = measure.partition("=")
    if word:
        return scenario["shares"].get(name, {}).get(word, 0.0 if name in scenario["shares"] else math.nan)
    return scenario["means"].get(name, {}).get("mean", math.nan)


def _fits(parameters, where):
    return all(parameters.get(name) == value for name, value in where.items())


def _kept(expectation, scenarios):
    """One line for each scenario that an expectation speaks of."""
    for scenario in scenarios:
        parameters = scenario["parameters"]
        if not expectation.is_about(parameters):
            continue
        mean = mean_of(scenario, expectation.measure)
        line = {"measure": expectation.measure, "parameters": parameters, "mean": mean}
        if expectation.mean is not None:
            low, high = expectation.mean
            yield line | {"expected": f"{low:g} to {high:g}", "kept": bool(low <= mean <= high)}
            continue
        other = parameters | expectation.more_than
        least = mean_of(next(s for s in scenarios if s["parameters"] == other), expectation.measure)
        changed = ", ".join(f"{name} {_plain(value)}" for name, value in expectation.more_than.items())
        yield line | {"expected": f"more than {least:.4g} ({changed})", "kept": bool(mean > least)}


# for people ------------------------------------------------------------------------------


def show(sweep: Sweep, summary):
    """Print the summary."""
    names = list(sweep.varied)
    worded = [name for name in sweep.measures if any(name in s["shares"] for s in summary["scenarios"])]
    numbers = [name for name in sweep.measures if name not in worded]
    plotted = [name for name in sweep.plot.measures if name in numbers] or numbers
    fewer = [(plotted[:count], False) for count in range(len(plotted) - 1, 0, -1)]
    as_much_as_fits = (numbers, True), (numbers, False), (plotted, True), (plotted, False), *fewer
    for shown, spread in as_much_as_fits:
        columns = [*names, "runs", "runs/s/core", *shown]
        rows = [
            [
                *_cells(scenario, names),
                number(scenario["runs"]),
                number(scenario["runs_per_core_second"]),
                *(_cell(scenario, name, spread) for name in shown),
            ]
            for scenario in summary["scenarios"]
        ]
        widths = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
        if sum(widths) + 3 * len(widths) <= WIDE:
            break
    right = [name for name in columns if name != "case"]
    title = f"{summary['title'] or summary['sweep']}: means{' ± standard deviations' if spread else ''} over seeds"
    means = table(*columns, rows=rows, title=title, right=right)
    for column in means.columns:
        column.no_wrap = column.justify == "right"
    print_table(means)
    if len(shown) < len(plotted):
        missing = len(plotted) - len(shown)
        print_line(f"the table has no room for {missing} of {len(plotted)} measures; they are in summary.json")
    for name in worded:
        _show_shares(summary, names, name)
    if summary["expected"]:
        means = table("", "measure", *names, "mean", "expected", title="expected", right=["mean", *names])
        for line in summary["expected"]:
            cells = _cells(line, names)
            means.add_row(
                "kept" if line["kept"] else styled("[bold]MISSED[/]"),
                line["measure"],
                *cells,
                number(line["mean"]),
                line["expected"],
            )
        print_table(means)
    for failure in summary["failures"][:SHOWN_FAILURES]:
        where = ", ".join(f"{name} {_plain(value)}" for name, value in failure.items() if name != "error")
        print_line(f"failed: {where}: {failure['error']}")
    if summary["failed"] > SHOWN_FAILURES:
        print_line(f"... and {summary['failed'] - SHOWN_FAILURES} more failed runs; see runs.csv")
    rate = summary["done"] / summary["core_seconds"] if summary["core_seconds"] > 0 else math.nan
    print_line(
        f"{summary['done']:,} of {summary['runs']:,} runs, {number(summary['core_seconds'])} s of processor time: "
        f"{number(rate)} runs per second and core"
    )
    for file in summary["files"]:
        print_line(f"wrote {file}")


def _plain(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cells(scenario, names):
    return [_plain(scenario["parameters"].get(name, "-")) for name in names]


def _cell(scenario, name, spread=True):
    """Mean and deviation, with the digits that the deviation leaves, and of how many runs, if not of all."""
    means = scenario["means"].get(name)
    if means is None or not math.isfinite(means["mean"]):
        return "-"
    some = f" ({means['n']:,} runs)" if means["n"] < scenario["runs"] else ""
    if not (spread and means["std"] > 0):
        return (f"{means['mean']:,.0f}" if abs(means["mean"]) >= 1000 else number(means["mean"], 3)) + some
    digits = max(0, 1 - math.floor(math.log10(means["std"])))
    return (f"{means['mean']:.{digits}f} ± {means['std']:.{digits}f}" if digits < 6 else number(means["mean"])) + some


def _show_shares(summary, names, name):
    """How often a measure that is a word was which."""
    totals: dict[str, float] = {}
    for scenario in summary["scenarios"]:
        for word, share in scenario["shares"].get(name, {}).items():
            totals[word] = totals.get(word, 0.0) + share
    words = sorted(totals, key=lambda word: -totals[word])
    made = table(
        *names, *words, title=f"{name}, share of the runs", right=[*(name for name in names if name != "case"), *words]
    )
    for scenario in summary["scenarios"]:
        shares = scenario["shares"].get(name, {})
        made.add_row(*_cells(scenario, names), *(f"{shares.get(word, 0.0):.3f}" for word in words))
    print_table(made)


# as files --------------------------------------------------------------------------------


def write_files(sweep: Sweep, journal: Journal, summary, folder, theme="light") -> list[Path]:
    """Tables, summary and pictures in a folder."""
    folder = Path(folder)
    rows = list(rows_of(sweep, journal))
    columns = _columns(sweep, rows)
    written = [folder / "runs.csv", folder / "summary.json"]
    with whole(written[0]) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*([_for_csv(value) for value in values] for values in columns.values()), strict=True))
    with whole(written[1]) as temporary:
        from flockbrush.runs.terminal import finite

        temporary.write_text(json.dumps(finite(summary), indent=1, ensure_ascii=False), encoding="utf-8")
    if importlib.util.find_spec("pyarrow"):
        written.append(_write_parquet(folder / "runs.parquet", sweep, columns))
    panels, left_out = panels_of(sweep, summary)
    if panels and not drawing_problems(folder):
        written.append(folder / "means.png")
        note = "\n".join(filter(None, [NOTE, left_out]))
        write_figure(written[-1], figure_of(panels, sweep.title or sweep.name, note, theme=theme))
    with sweep.experiment.blaming():
        return written + sweep.experiment.pictures(sweep, rows, folder, theme)


def _for_csv(value):
    return "" if value is None else value


def _columns(sweep, rows):
    """{column: values}: who it was, what was varied, everything else that was set, what was measured."""
    columns = {
        "scenario": [scenario.hash for scenario, _ in rows],
        "seed": [row["seed"] for _, row in rows],
        "status": [row["status"] for _, row in rows],
    }
    if any("case" in scenario.varied for scenario in sweep.scenarios):
        columns["case"] = [scenario.varied.get("case") for scenario, _ in rows]
    for name in dict.fromkeys(name for scenario in sweep.scenarios for name in scenario.parameters):
        if name != "density" or any(scenario.parameters.get("plane") for scenario in sweep.scenarios):
            columns[name] = [scenario.parameters.get(name) for scenario, _ in rows]
    for name in sweep.measures:
        columns[name if name not in columns else f"measured {name}"] = [
            row["measures"].get(name) if row["status"] == "ok" else None for _, row in rows
        ]
    columns["core_seconds"] = [row["seconds"] for _, row in rows]
    columns["error"] = [row.get("error") for _, row in rows]
    return columns


def _write_parquet(path, sweep, columns):
    import pyarrow as pa
    import pyarrow.parquet as pq

    about = {
        "schema": SCHEMA,
        "sweep": sweep.name,
        "title": sweep.title,
        "version": flockbrush.__version__,
    }
    arrays = {name: pa.array(_of_one_kind(values)) for name, values in columns.items()}
    with whole(path) as temporary:
        pq.write_table(pa.table(arrays).replace_schema_metadata(about), temporary)
    return path


def _of_one_kind(values):
    """Whole numbers among floats as floats, anything among words as words."""
    kinds = {type(value) for value in values if value is not None}
    if len(kinds) <= 1:
        return values
    if kinds <= {int, float}:
        return [None if value is None else float(value) for value in values]
    return [None if value is None else str(value) for value in values]


# as plots --------------------------------------------------------------------------------


def panels_of(sweep: Sweep, summary) -> tuple[list[CurveChart], str]:
    """(panels, which scenarios are not drawn, in words): for each measure its mean over one parameter, and its error.

    There is a curve for each value of a second parameter; others have their first value.
    """
    varied = {name: values for name, values in sweep.varied.items() if len(values) > 1}
    if not varied:
        return [], ""
    across = sweep.plot.across or max(varied, key=lambda name: len(varied[name]))
    lines = sweep.plot.lines or next((name for name in varied if name != across), None)
    values = sweep.varied[across]
    words = (
        None
        if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
        else [str(v) for v in values]
    )
    fixed = {name: others[0] for name, others in varied.items() if name not in (across, lines)}
    groups = sweep.varied[lines][:MOST_CURVES] if lines else [None]
    panels = []
    for measure in sweep.plot.measures or sweep.measures:
        curves = []
        for k, group in enumerate(groups):
            points = [s for s in summary["scenarios"] if lines is None or s["parameters"].get(lines) == group]
            points = [s for s in points if across in s["parameters"] and measure in s["means"]]
            points = [s for s in points if _fits(s["parameters"], fixed)]
            if not points:
                continue
            x = np.array(
                [values.index(s["parameters"][across]) if words else s["parameters"][across] for s in points], float
            )
            order = np.argsort(x)
            y, e = (np.array([s["means"][measure][what] for s in points], float) for what in ("mean", "error"))
            name = "" if lines is None else f"{lines} {_with_unit(group, sweep.experiment.unit_of(lines))}"
            colour, marker = PALETTE[k % len(PALETTE)], MARKERS[k % len(MARKERS)]
            curves.append(ChartCurve(name, x[order], y[order], e[order], colour=colour, marker=marker))
        if curves:
            unit = sweep.experiment.unit_of(across)
            along = across + (f", {unit}" if unit else "")
            panels.append(CurveChart(_title_of(sweep, measure), along, curves, words))
    return panels, _left_out(sweep, fixed, lines)


def _left_out(sweep, fixed, lines):
    """A sentence that says which values are drawn, where they are not all; or ""."""
    varied, units = sweep.varied, {name: sweep.experiment.unit_of(name) for name in fixed}
    drawn = [f"{name} {_with_unit(fixed[name], units[name])}, of {len(varied[name])} values" for name in fixed]
    if lines and len(varied[lines]) > MOST_CURVES:
        drawn.append(f"the first {MOST_CURVES} of {len(varied[lines])} values of {lines}")
    return f"drawn: {'; '.join(drawn)}; all are in runs.csv and summary.json" if drawn else ""


def _with_unit(value, unit):
    """A value as a legend has it: 170°, 5 m."""
    return f"{_plain(value)}°" if unit == "degrees" else f"{_plain(value)} {unit}".strip()


def _title_of(sweep, measure):
    """A measure spelled out, with its unit."""
    plain = measure.removeprefix("mean ")
    known = measures().get(plain) if sweep.experiment.name == "level" else None
    if known is not None:
        return measure.removesuffix(plain) + known.axis()
    unit = sweep.experiment.units.get(measure)
    return measure.replace("_", " ") + (f", {unit}" if unit else "")
