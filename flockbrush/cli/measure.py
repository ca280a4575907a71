"""The command ``flockbrush measure`` for recordings: measures over time as a table, JSON or chart."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from flockbrush.cli.level_commands import check_plot, meaning_of, opened, stepping, use_threads, warn_if_unlike
from flockbrush.engine.parallel import threads
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.level_counts import Counts
from flockbrush.runs.terminal import number, print_json, print_line, show, table
from flockbrush.runs.v_measures import v_indicators


def series_of(run, simulation, every, step=lambda: None):
    """Replay a recording and return its measures over time.

    Parameters
    ----------
    run : RecordedRun
    simulation : Simulation
        As `flockbrush.runs.run.rebuild` gives it.
    every : float
        Seconds between two moments; the last tick is measured too.
    step : callable
        Called after every tick.

    Returns
    -------
    dict of str to list
        ``time`` in seconds, then one list for each measure; NaN where it has no meaning.
    """
    counts, moments = Counts(simulation), []
    gap = max(1, round(every / simulation.clock.dt))

    def take():
        formation = v_indicators(simulation)
        formation.pop("shape", None)
        moments.append({"time": simulation.clock.now, **simulation.measures(), **counts.values(), **formation})

    take()
    while simulation.clock.tick < run.last_tick:
        simulation.tick()
        counts.take()
        if simulation.clock.tick % gap == 0 or simulation.clock.tick == run.last_tick:
            take()
        step()
    return as_series(moments)


def as_series(moments):
    """{measure: its values over time} of one dict for each moment; NaN where a moment does not have the measure."""
    names = dict.fromkeys(name for moment in moments for name in moment)
    return {name: [moment.get(name, math.nan) for moment in moments] for name in names}


def measure_recording(path, plot, every, thread_count, json):
    """Measure a recording, print the measures and draw them."""
    if not math.isfinite(every):
        every = 3600.0
    if plot is not None:
        check_plot(plot, [path])
    run = opened(path)
    use_threads(thread_count)
    with terminal.Interrupts() as interrupts, compiling_ahead(path):
        simulation = running.rebuild(run)
        with stepping(Path(path).name, simulation, run.last_tick, interrupts) as step:
            series = series_of(run, simulation, every, step)
        warn_if_unlike(run, simulation)
    if plot is not None:
        from flockbrush.output.figures import draw_series

        draw_series(plot, series, f"{simulation.level.name}, seed {run.header['seed']}")
    if json:
        level, seed = simulation.level.name, simulation.origin["seed"]
        about = {"recording": str(path), "level": level, "seed": seed, "ticks": run.last_tick, "threads": threads()}
        states = {"states": simulation.states(), "transitions": simulation.transitions()}
        print_json(about | series_as_json(series, simulation.parts() | states, plot))
    else:
        title = f"{simulation.level.name}: {len(series['time'])} moments of {simulation.clock.now:g} s"
        show_series(title, series, plot)


def series_as_json(series, parts, plot):
    """Measures over time, their last and their mean values, and the parts of the last moment, as plain data."""
    numbers = {name: values for name, values in series.items() if name != "time"}
    last = {name: values[-1] for name, values in numbers.items()}
    means = {name: mean_of(values) for name, values in numbers.items()}
    return {"measures": last, "mean": means, "series": series, **parts, "plot": str(plot) if plot else None}


def mean_of(values):
    """Mean of the values that are not NaN."""
    numbers = [value for value in values if value == value]
    return sum(numbers) / len(numbers) if numbers else math.nan


def show_series(title, series, plot=None, unit="m"):
    """Print measures over time, with lengths in a unit, as a table with sparklines."""
    right = ("start", "mean", "end")
    measures = table("measure", "start", "mean", "end", "over time", "meaning", title=title, right=right)
    for name, values in series.items():
        if name != "time":
            cells = (number(values[0]), number(mean_of(values)), number(values[-1]))
            measures.add_row(name, *cells, sparkline(values), meaning_of(name, unit))
    show(measures)
    if plot:
        print_line(f"wrote {plot}")


def sparkline(values):
    """A plot in characters, from lowest to highest value; a space where the value is NaN."""
    marks = "▁▂▃▄▅▆▇█"
    values = np.array(values, float)
    at = np.unique(np.linspace(0, len(values) - 1, min(24, len(values))).astype(int))
    shown = values[at]
    known = shown[np.isfinite(shown)]
    if not len(known):
        return ""
    low, span = known.min(), np.ptp(known)
    return "".join(
        " " if not np.isfinite(v) else marks[int(7.999 * (v - low) / span)] if span > 0 else marks[0] for v in shown
    )
