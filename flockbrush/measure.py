"""Measuring recordings: the measures over time as a table, as JSON, as a picture."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from components import Position
from engine.parallel import threads
from engine.recording import resume
from flockbrush import run as running
from flockbrush import terminal
from flockbrush.commands import MEANINGS, check_png, opened, stepping, use_threads
from flockbrush.files import whole
from flockbrush.terminal import number, print_json, show, table
from flockbrush.v_measures import v_indicators
from levels.geometry import inside
from systems.measures import compute_crossings

PLOTTED = ("polarization", "milling", "speed_mean", "nnd", "group_spread", "largest_part")


class Counts:
    """What the level itself asks to be measured: crossings of its lines, animals in its areas.

    Crossings add up from tick to tick, each animal by its id; who crosses the seam of a periodic map crosses no line.
    """

    def __init__(self, simulation):
        self.simulation, self.level = simulation, simulation.level
        self.crossed = {line.name or f"line {line.id}": [0, 0] for line in self.level.lines}
        self._ids, self._xy = self._now()

    def _now(self):
        agents = self.simulation.agents
        return agents.ids.copy(), agents[Position.xyz][:, :2].copy()

    def take(self):
        """Count what was crossed since the last time: call it after every tick."""
        if not self.crossed:
            return
        ids, xy = self._now()
        _, old, new = np.intersect1d(self._ids, ids, assume_unique=True, return_indices=True)
        before, after = self._xy[old], xy[new]
        near = np.abs(after - before).max(1, initial=0) < 0.5 * min(self.level.width, self.level.height)
        for (_, total), line in zip(self.crossed.items(), self.level.lines, strict=True):
            left, right = compute_crossings(before[near], after[near], line.points)
            total[0] += left
            total[1] += right
        self._ids, self._xy = ids, xy

    def values(self):
        """{"line NAME, to its left": so far, "area NAME": animals in it now}."""
        found = {}
        for name, (left, right) in self.crossed.items():
            found |= {f"crossed {name} to its left": left, f"crossed {name} to its right": right}
        _, xy = self._now()
        for area in self.level.areas:
            found[f"in {area.name or f'area {area.id}'}"] = int(np.sum(inside(xy, area.polygon)))
        return found


def series_of(run, simulation, every, step=lambda: None):
    """Live a recording and measure it.

    Parameters
    ----------
    run : RecordedRun
    simulation : Simulation
        After `engine.recording.resume`.
    every : float
        Seconds between two moments; the last tick is measured too.
    step : callable
        Called after every tick.

    Returns
    -------
    dict of str to list
        ``time`` in seconds, then one list for each measure; NaN where it has no meaning.
    """
    counts, series = Counts(simulation), {}
    gap = max(1, round(every / simulation.clock.dt))

    def take():
        formation = v_indicators(simulation)
        formation.pop("shape", None)
        for name, value in {
            "time": simulation.clock.now,
            **simulation.measures(),
            **counts.values(),
            **formation,
        }.items():
            series.setdefault(name, []).append(value)

    take()
    while simulation.clock.tick < run.last_tick:
        simulation.tick()
        counts.take()
        if simulation.clock.tick % gap == 0 or simulation.clock.tick == run.last_tick:
            take()
        step()
    return series


def measure_recording(path, plot, every, thread_count, json):
    """Measure a recording; print it and draw it."""
    if not math.isfinite(every):
        every = 3600.0
    if plot is not None:
        check_png(plot, [path], hint="--plot")
    run = opened(path)
    use_threads(thread_count)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = running.rebuild(run)
        resume(run, simulation.world)
        with stepping(Path(path).name, simulation, run.last_tick, interrupts) as step:
            series = series_of(run, simulation, every, step)
    if plot is not None:
        from flockbrush.plot import draw_series

        with whole(plot) as temporary:
            draw_series(temporary, series, f"{simulation.level.name}, seed {run.header['seed']}", PLOTTED)
    if json:
        print_json(
            {
                "recording": str(path),
                "level": simulation.level.name,
                "seed": simulation.origin["seed"],
                "ticks": run.last_tick,
                "threads": threads(),
                "measures": {name: values[-1] for name, values in series.items() if name != "time"},
                "mean": {name: _mean(values) for name, values in series.items() if name != "time"},
                "series": series,
                "plot": str(plot) if plot else None,
            }
        )
    else:
        _show(simulation, series, plot)


def _mean(values):
    """Mean of the numbers that have a meaning."""
    numbers = [value for value in values if value == value]
    return sum(numbers) / len(numbers) if numbers else math.nan


def _show(simulation, series, plot):
    title = f"{simulation.level.name}: {len(series['time'])} moments of {simulation.clock.now:g} s"
    right = ("start", "mean", "end")
    made = table("measure", "start", "mean", "end", "over time", "meaning", title=title, right=right)
    for name, values in series.items():
        if name != "time":
            cells = (number(values[0]), number(_mean(values)), number(values[-1]))
            made.add_row(name, *cells, sparkline(values), MEANINGS.get(name, ""))
    show(made)
    if plot:
        print(f"wrote {plot}")


def sparkline(values, width=24):
    """A tiny plot in characters, lowest to highest value; a space where there is none."""
    marks = "▁▂▃▄▅▆▇█"
    values = np.array(values, float)
    at = np.unique(np.linspace(0, len(values) - 1, min(width, len(values))).astype(int))
    shown = values[at]
    known = shown[np.isfinite(shown)]
    if not len(known):
        return ""
    low, span = known.min(), np.ptp(known)
    return "".join(
        " " if not np.isfinite(v) else marks[int(7.999 * (v - low) / span)] if span > 0 else marks[0] for v in shown
    )
