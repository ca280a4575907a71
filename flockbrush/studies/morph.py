"""Paths between two brushes along which the measured behaviour changes evenly.

A herd is swept from one brush to the other and back, its numbers on the straight line between the two; where the
behaviour changes most the steps are made shortest.  Fresh herds at those points say where the steps of the path lie,
others what it is worth, beside the straight line.  A pair is bistable when herds differ on the way there and back and
fresh herds do not agree: no path of steps makes it even.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.mixture import BrushPath, mixed
from flockbrush.components import BrushBinding, Heading, Position
from flockbrush.levels.build import plane
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_milling, compute_polarization
from flockbrush.systems.palette import Palette

RATE = 32  # ticks a second
DENSITY = 0.6  # animals per square body length at the start
SWEPT, FINER = 17, 12  # points of the first sweep, steps of the second
SETTLED = 0.6  # of a run, which is left out
FIRST_SWEEP, FIRST_FRESH, FIRST_CHECK = 100, 300, 500  # seeds
MOST_STEP = MOST_DEVIATION = 0.15  # between two points, and between seeds
JUMP = 0.25  # there and back may differ by so much
NOISE = 0.03  # standard error that few seeds cannot show
KEEP_GOING = 0.15  # of the way along which nothing changes, in changes of behaviour


class Measured(NamedTuple):
    """What herds do at some points of a way: means and standard deviations between seeds, (points, 2) each.

    The columns are polarization and milling.
    """

    mean: np.ndarray
    deviation: np.ndarray
    seeds: int


@dataclass(frozen=True)
class Trial:
    """How herds are measured."""

    animals: int = 100
    seeds: int = 3
    steps: int = 8
    seconds: float = 20.0

    @property
    def dwell(self):
        """s at each point of a sweep; the second half is measured."""
        return self.seconds / 5


@dataclass(frozen=True)
class Morph:
    """A path, what was measured on it and on the straight line, and how far there and back are apart."""

    path: BrushPath
    on_path: Measured
    straight: Measured
    gap: float

    @property
    def bistable(self):
        """Whether herds do another thing on the way back, and fresh herds not always the same."""
        return self.gap > JUMP and bool(self.on_path.deviation.max() >= MOST_DEVIATION)


def morph(start: Brush, end: Brush, trial: Trial, detour: dict[str, float] | None = None, tell=lambda words: None):
    """Find a path between two brushes of one model.

    Parameters
    ----------
    detour : dict of str to float, optional
        What parameters have more of half-way; nothing at the ends.
    tell : callable
        Is told what is being done.

    Returns
    -------
    Morph
    """
    detour = detour or {}

    def at(along):
        return brush_at(start, end, along, detour)

    tell("sweeping there and back")
    points = np.linspace(0.0, 1.0, SWEPT)
    there, back = sweep(at, points, trial, FIRST_SWEEP)
    gap = float(np.abs(there - back)[1:-1].max())
    finer = evenly(points, 0.5 * (there + back), FINER)
    there, back = sweep(at, finer, trial, FIRST_SWEEP + 1)
    gap = max(gap, float(np.abs(there - back)[1:-1].max()))
    tell("measuring fresh herds where the behaviour changes")
    fresh = measured(at, finer, trial, FIRST_FRESH)
    along = evenly(finer, fresh.mean, trial.steps)
    steps = np.linspace(0.0, 1.0, trial.steps + 1)
    tell("measuring fresh herds on the path")
    on_path = measured(at, along, trial)
    tell("measuring fresh herds on the straight line")
    straight = measured(lambda share: brush_at(start, end, share, {}), steps, trial)
    bumps = {name: tuple(float(v) for v in _bump(along) * peak) for name, peak in detour.items()}
    path = BrushPath(
        start=start.name, end=end.name, along=tuple(map(float, along)), detour=bumps,
        even=not faults(on_path),
    )  # fmt: skip
    return Morph(path, on_path, straight, gap)


def _bump(along):
    """0 at both ends, 1 half-way."""
    return 4.0 * np.asarray(along) * (1.0 - np.asarray(along))


def brush_at(start, end, along, detour):
    """The brush so far along the straight line, with a detour."""
    bumps = {name: (0.0, float(_bump(along)) * peak, 0.0) for name, peak in detour.items()}
    path = BrushPath(start=start.name, end=end.name, along=(0.0, along, 1.0), detour=bumps)
    return mixed(start, end, 0.5, path)


def measures_of(simulation):
    """Polarization and milling of this moment."""
    agents = simulation.agents
    forward = agents[Heading.forward]
    return compute_polarization(forward), compute_milling(agents[Position.xyz][:, :2], forward)


def sweep(at, points, trial, seed):
    """One herd from the first point to the last and back: (2, points, 2) there and back, by point."""
    order = [*range(len(points)), *reversed(range(len(points)))]
    simulation = plane(at(points[0]), trial.animals, DENSITY, "scatter", seed)
    world, found = simulation.world, []
    palette, agents = world.resource(Palette), simulation.agents
    simulation.run(round(2 * trial.dwell * RATE))
    for k, point in enumerate(order):
        brush = at(points[point]).model_copy(update={"name": f"swept-{k % 2}"})
        agents[BrushBinding.home][:] = palette.add(brush)
        world.resource(Landscape).see_to(float(palette.view_range.max() * brush.body.length))
        simulation.run(round(0.5 * trial.dwell * RATE))
        moments = []
        for _ in range(max(1, round(trial.dwell))):
            simulation.run(RATE // 2)
            moments.append(measures_of(simulation))
        found.append(np.mean(moments, axis=0))
    simulation.close()
    n = len(points)
    return np.array([found[:n], found[n:][::-1]])


def evenly(points, values, steps):
    """``steps + 1`` points between which the behaviour changes as much, from the same points' values (n, 2).

    Where nothing changes the way still goes on, by a small share of its own length.
    """
    change = np.abs(np.diff(_one_way(np.asarray(values)), axis=0)).sum(1) + KEEP_GOING * np.diff(points)
    gone = np.concatenate([[0.0], np.cumsum(change)])
    found = np.interp(np.linspace(0.0, gone[-1], steps + 1), gone, points)
    found[0], found[-1] = 0.0, 1.0
    return found


def _one_way(values):
    """Values (n, k) without what goes back: half-way between the greatest before and the least after."""
    sign = np.where(values[-1] >= values[0], 1.0, -1.0)
    up = values * sign
    return 0.5 * (np.maximum.accumulate(up) + np.minimum.accumulate(up[::-1])[::-1])


def measured(at, points, trial, first_seed=FIRST_CHECK) -> Measured:
    """Fresh herds at every point."""
    means = np.array([[_run(at(p), trial, first_seed + k) for k in range(trial.seeds)] for p in points])
    return Measured(means.mean(1), means.std(1, ddof=min(1, trial.seeds - 1)), trial.seeds)


def _run(brush, trial, seed):
    simulation = plane(brush, trial.animals, DENSITY, "scatter", seed)
    simulation.run(round(SETTLED * trial.seconds * RATE))
    moments = []
    for _ in range(max(1, round(2 * (1.0 - SETTLED) * trial.seconds))):
        simulation.run(RATE // 2)
        moments.append(measures_of(simulation))
    simulation.close()
    return np.mean(moments, axis=0)


def faults(found: Measured) -> list[str]:
    """What keeps a way from being even, in words."""
    said = []
    error = np.maximum(found.deviation / np.sqrt(found.seeds), NOISE)
    for column, name in enumerate(("polarization", "milling")):
        mean = found.mean[:, column]
        rises = mean[-1] >= mean[0]
        step = np.diff(mean) * (1.0 if rises else -1.0)
        allowed = 2.0 * np.hypot(error[1:, column], error[:-1, column])
        if (step < -allowed).any():
            said.append(f"{name} goes back by {-step.min():.2f}")
        if np.abs(step).max() > MOST_STEP:
            said.append(f"{name} changes by {np.abs(step).max():.2f} in one step")
        if found.deviation[:, column].max() >= MOST_DEVIATION:
            said.append(f"{name} deviates by {found.deviation[:, column].max():.2f} between seeds")
    return said


def table(found: Morph) -> str:
    """Both ways side by side, and what they are worth."""
    steps = len(found.path.along) - 1
    lines = ["step   path: along  polarization      milling   straight: along  polarization      milling"]
    for k, along in enumerate(found.path.along):
        cells = [
            f"{m.mean[k, c]:.2f} ± {m.deviation[k, c]:.2f}" for m in (found.on_path, found.straight) for c in (0, 1)
        ]
        lines.append(
            f"{k:>2} / {steps}      {along:.3f}   {cells[0]}  {cells[1]}            "
            f"{k / steps:.3f}   {cells[2]}  {cells[3]}"
        )
    for name, way in (("path", found.on_path), ("straight line", found.straight)):
        said = faults(way)
        lines.append(f"{name}: {'; '.join(said) if said else 'even'}")
    back = "bistable: a herd does another thing on the way back, and fresh herds not always the same"
    if not found.bistable:
        back = "herds take longer to change than the sweep waited" if found.gap > JUMP else "no jump"
    lines.append(f"there and back differ by {found.gap:.2f}: {back}")
    return "\n".join(lines)
