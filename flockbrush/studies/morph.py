"""Paths between two brushes along which the measured behaviour changes evenly.

Fresh herds are measured along the straight line between the two brushes, and again half-way between points whose
herds differ by too much, until they do not or the points are next to one another: what herds do, not what their
numbers are, says where the steps of the path lie.  Herds of their own at the steps correct them, others say what the
path is worth, beside the straight line.  At last one herd is swept along the path and back.  A pair is bistable when
it differs on the way there and back and fresh herds do not agree: no path of steps makes it even.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.mixture import BrushPath, mixed
from flockbrush.components import BrushBinding, Heading, Position
from flockbrush.levels.build import herds_apart, plane
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_milling, compute_polarization
from flockbrush.systems.palette import Palette

RATE = 32  # ticks a second
DENSITY = 0.6  # animals per square body length at the start
COARSE = 8  # steps of the way that are measured first
MOST_POINTS = 48  # that are measured in all
RESOLUTION = 1 / 4096  # of the way; what changes within it jumps
ROUNDS = 2  # of herds at the steps themselves, after which the steps are laid anew
SETTLED = 0.6  # of a run, which is left out
FIRST_SWEEP, FIRST_FRESH, FIRST_CHECK = 100, 1_000_000, 2_000_000  # seeds
MOST_STEP = MOST_DEVIATION = 0.15  # between two points, and between seeds
FINE = 0.6 * MOST_STEP  # between two points that are measured in search of the path
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
    """A path, what was measured on it and on the straight line, how far there and back are apart, and where it jumps.

    A jump is where it is along the straight line, and by how much polarization or milling change there.
    """

    path: BrushPath
    on_path: Measured
    straight: Measured
    gap: float
    jumps: tuple[tuple[float, float], ...] = ()

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

    tell("measuring new herds where the behaviour changes")
    seen = response(at, trial)
    for k in range(ROUNDS):
        tell(f"measuring new herds on the path, round {k + 1}")
        along = seen.evenly(trial.steps)
        seen.add(along, measured(at, along, trial, FIRST_FRESH + (k + 1) * trial.seeds).mean)
    along, steps = seen.evenly(trial.steps), np.linspace(0.0, 1.0, trial.steps + 1)
    tell("measuring other herds on the path")
    on_path = measured(at, along, trial)
    tell("measuring the same herds on the straight line")
    straight = measured(lambda share: brush_at(start, end, share, {}), steps, trial)
    tell("sweeping from the first brush to the second and back")
    there, back = sweep(at, along, trial, FIRST_SWEEP)
    gap = float(np.abs(there - back)[1:-1].max())
    bumps = {name: tuple(float(v) for v in _bump(along) * peak) for name, peak in detour.items()}
    path = BrushPath(
        start=start.name, end=end.name, along=tuple(map(float, along)), detour=bumps,
        even=not faults(on_path),
    )  # fmt: skip
    return Morph(path, on_path, straight, gap, seen.jumps())


def _bump(along):
    """0 at both ends, 1 half-way."""
    return 4.0 * np.asarray(along) * (1.0 - np.asarray(along))


def brush_at(start, end, along, detour):
    """The brush so far along the straight line, with a detour."""
    bumps = {name: (0.0, float(_bump(along)) * peak, 0.0) for name, peak in detour.items()}
    path = BrushPath(start=start.name, end=end.name, along=(0.0, along, 1.0), detour=bumps)
    return mixed(start, end, 0.5, path)


def measures_of(simulation, first=0, count=None):
    """Polarization and milling of this moment; of so many animals from a row on."""
    agents, rows = simulation.agents, slice(first, None if count is None else first + count)
    forward = agents[Heading.forward][rows]
    return compute_polarization(forward), compute_milling(agents[Position.xyz][rows, :2], forward)


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


class Response:
    """What herds were seen to do along a way: points (n,), ascending, and means (n, 2) there.

    Points may be there more than once.
    """

    def __init__(self, points, means):
        self.points, self.means = np.asarray(points, float), np.asarray(means, float)

    def add(self, points, means):
        """More points, and what herds do there."""
        every = np.concatenate([self.points, points])
        order = np.argsort(every, kind="stable")
        self.points, self.means = every[order], np.concatenate([self.means, means])[order]

    def one_way(self):
        """Each point once, and the nearest values there that never go back, (k,) and (k, 2)."""
        points, where, count = np.unique(self.points, return_inverse=True, return_counts=True)
        means = np.zeros((len(points), self.means.shape[1]))
        np.add.at(means, where, self.means)
        means /= count[:, None]
        smooth = [isotonic_regression(v, weights=count, increasing=bool(v[-1] >= v[0])).x for v in means.T]
        return points, np.stack(smooth, 1)

    def too_far(self):
        """The middles between neighbouring points whose herds differ by too much."""
        points, means = self.one_way()
        apart, change = np.diff(points), np.abs(np.diff(means, axis=0)).max(1)
        wide = (change > FINE) & (apart > RESOLUTION)
        return (0.5 * (points[1:] + points[:-1]))[wide]

    def jumps(self):
        """Where herds change by more than a step may though the points are next to one another, and by how much."""
        points, means = self.one_way()
        apart, change = np.diff(points), np.abs(np.diff(means, axis=0)).max(1)
        return tuple(
            (float(0.5 * (points[k] + points[k + 1])), float(change[k]))
            for k in np.flatnonzero((change > MOST_STEP) & (apart <= RESOLUTION))
        )

    def evenly(self, steps):
        """``steps + 1`` points between which the behaviour changes as much.

        Where nothing changes the way still goes on, by a small share of its own length.
        """
        points, means = self.one_way()
        change = np.abs(np.diff(means, axis=0)).sum(1) + KEEP_GOING * np.diff(points)
        gone = np.concatenate([[0.0], np.cumsum(change)])
        found = np.interp(np.linspace(0.0, gone[-1], steps + 1), gone, points)
        found[0], found[-1] = 0.0, 1.0
        return found


def response(at, trial) -> Response:
    """What fresh herds do along a way, measured more closely where it changes."""
    points = np.linspace(0.0, 1.0, COARSE + 1)
    seen = Response(points, measured(at, points, trial, FIRST_FRESH).mean)
    while len(more := seen.too_far()[: MOST_POINTS - len(seen.points)]):
        seen.add(more, measured(at, more, trial, FIRST_FRESH).mean)
    return seen


def measured(at, points, trial, first_seed=FIRST_CHECK) -> Measured:
    """Fresh herds at every point; those of one seed side by side in one world."""
    brushes = [at(point).model_copy(update={"name": f"point-{k}"}) for k, point in enumerate(points)]
    found = np.array([_run(brushes, trial, first_seed + k) for k in range(trial.seeds)])
    return Measured(found.mean(0), found.std(0, ddof=min(1, trial.seeds - 1)), trial.seeds)


def _run(brushes, trial, seed):
    """What a herd of each brush does, (brushes, 2)."""
    length = brushes[0].body.length
    fastest, farthest = max(b.speed.mean for b in brushes), max(b.vision.range for b in brushes)
    reach = 2.0 * (fastest * trial.seconds + math.sqrt(trial.animals / DENSITY)) + farthest
    simulation = herds_apart(brushes, trial.animals, DENSITY, "scatter", seed, apart=reach * length)
    simulation.run(round(SETTLED * trial.seconds * RATE))
    moments = []
    for _ in range(max(1, round(2 * (1.0 - SETTLED) * trial.seconds))):
        simulation.run(RATE // 2)
        moments.append([measures_of(simulation, k * trial.animals, trial.animals) for k in range(len(brushes))])
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
            said.append(f"{name} reverses by {-step.min():.2f}")
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
    lines += [f"jumps by {size:.2f} at {where:.4f} of the straight line" for where, size in found.jumps]
    back = "bistable: the behaviour differs between both directions of the sweep and between new herds"
    if not found.bistable:
        back = "slow: herds need longer to change than the sweep waits at each step" if found.gap > JUMP else "no jump"
    lines.append(f"the two directions differ by {found.gap:.2f}: {back}")
    return "\n".join(lines)
