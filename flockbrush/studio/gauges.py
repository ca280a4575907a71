"""Measurements of a running session: charts, time per system, playback speed."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from flockbrush.components import BrushBinding, Heading, Position, Species, Velocity
from flockbrush.runs.snapshots import names_of
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_milling, compute_polarization, compute_unwrapped
from flockbrush.systems.program_reports import state_codes, state_names

SAMPLE_TICKS = 4  # between two points of the charts: 8 a second
CHART_POINTS = 600  # at most, of one chart
PROFILE_TICKS = 64  # over which the time of a system is averaged
PACE_SECONDS = 1.0  # s of real time over which the pace is averaged


@dataclass(frozen=True)
class MeasureSample:
    """The values of the charts at one time."""

    tick: int
    time: float  # s
    polarization: float
    milling: float
    speed: float  # m/s, mean
    counts: dict[str, int]  # animals by name of brush
    states: dict[str, int] = field(default_factory=dict)  # animals by state of their programs
    species: dict[str, int] = field(default_factory=dict)  # animals by species
    ever: int = 0  # animals that there have been


@dataclass(frozen=True)
class MeasureHistory:
    """Measures over time, as arrays of one length."""

    time: np.ndarray  # (n,); seconds
    values: dict[str, np.ndarray]  # str to (n,); "polarization", "milling" and "speed" (m/s, mean)
    counts: dict[str, np.ndarray]  # str to (n,); animals by name of brush
    # str to (n,); animals by state of their programs; empty in a world without programs
    states: dict[str, np.ndarray] = field(default_factory=dict)
    species: dict[str, np.ndarray] = field(default_factory=dict)  # str to (n,); animals by species
    ever: np.ndarray = field(default_factory=lambda: np.zeros(0))  # (n,); animals that there have been


def chart_of(samples):
    """Samples as a chart; of a long run, one for each pixel at most."""
    every = -(-len(samples) // CHART_POINTS) or 1
    few = samples[::every] + (samples[-1:] if (len(samples) - 1) % every else [])
    brushes = sorted({name for sample in few for name in sample.counts})
    states = list(dict.fromkeys(name for sample in few for name in sample.states))
    species = sorted({name for sample in few for name in sample.species})
    return MeasureHistory(
        np.array([sample.time for sample in few]),
        {name: np.array([getattr(sample, name) for sample in few]) for name in ("polarization", "milling", "speed")},
        {name: np.array([sample.counts.get(name, 0) for sample in few]) for name in brushes},
        {name: np.array([sample.states.get(name, 0) for sample in few]) for name in states},
        {name: np.array([sample.species.get(name, 0) for sample in few]) for name in species},
        np.array([sample.ever for sample in few]),
    )


class Pacemaker:
    """Measures the real playback speed."""

    def __init__(self):
        self.restart()

    def restart(self):
        """Forget what was."""
        self._spans: deque = deque()
        self.pace = 0.0

    def passed(self, wall, simulated):
        """So much real and simulated time has passed, in seconds; ticks that took no time of their own come last."""
        if self._spans and not wall:
            wall, before = self._spans.pop()
            simulated += before
        self._spans.append((wall, simulated))
        while sum(span[0] for span in self._spans) - self._spans[0][0] > PACE_SECONDS:
            self._spans.popleft()
        total = sum(span[0] for span in self._spans)
        self.pace = sum(span[1] for span in self._spans) / total if total > 0 else 0.0


def sample_of(simulation):
    """What the charts show of this moment, or None between two samples."""
    if simulation.clock.tick % SAMPLE_TICKS:
        return None
    agents, land = simulation.agents, simulation.world.resource(Landscape)
    forward, velocity = agents[Heading.forward], agents[Velocity.xyz]
    species, brushes = names_of(simulation)
    return MeasureSample(
        simulation.clock.tick,
        simulation.clock.now,
        compute_polarization(forward),
        compute_milling(compute_unwrapped(agents[Position.xyz], land.wrap), forward),
        float(np.linalg.norm(velocity, axis=1).mean()) if len(agents) else math.nan,
        _tally(brushes, agents[BrushBinding.brush]),
        _states(simulation.world),
        _tally(species, agents[Species.index]),
        simulation.world.next_entity - 1,
    )


def _tally(names, codes):
    """{name: how many have its code} of those that there are."""
    counts = np.bincount(codes, minlength=len(names)).tolist()
    return {name: count for name, count in zip(names, counts, strict=True) if count}


def _states(world):
    """{state: animals in it} of all programs."""
    names = state_names(world)
    tally = _tally(names, state_codes(world)) if names else {}
    return {name: count for name, count in tally.items() if name}


class Profile:
    """Milliseconds a tick of each system, as a recent mean."""

    def __init__(self):
        self.milliseconds: dict[str, float] = {}
        self._lived, self._before = 0, None

    def passed(self, schedule):
        """A tick of this schedule has passed."""
        self._lived += 1
        if self._lived % PROFILE_TICKS != 1:
            return
        now = dict(schedule.nanoseconds)
        if self._before is not None and self._before[0] is schedule:
            before = self._before[1]
            self.milliseconds = {name: (now[name] - before[name]) / 1e6 / PROFILE_TICKS for name in now}
        self._before = schedule, now
