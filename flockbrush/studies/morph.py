"""Paths between two brushes along which the measured behaviour changes evenly.

The way goes straight from the numbers of one brush to those of the other, but for parameters that differ more than
tenfold, which go by ratio, and for random turning, which may be added between the ends: weak alignment against noise
gives every degree of order, and without noise a herd only takes longer to become ordered.  Fresh herds are measured
along the way, and again half-way between points whose herds differ by too much, until they do not or the points are
next to one another: what herds do, not what their numbers are, says where the steps of the path lie.  Herds of their
own at the steps correct them, others say what the path is worth, beside the straight line.  At last herds are swept
along the path and back.  A pair whose path is not even is bistable when herds on the way there and those on the way
back differ at the same step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.mixture import BrushPath, mixed
from flockbrush.components import BrushBinding, Heading, Position
from flockbrush.levels.build import herds_apart
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_milling, compute_polarization
from flockbrush.systems.palette import Palette

RATE = 32  # ticks a second
DENSITY = 0.6  # animals per square body length at the start
BEGINNINGS = {"random": ("scatter", None), "aligned": ("scatter", 0.0), "mill": ("mill", None)}  # formation, heading
MEASURES = ("polarization", "milling")
COARSE = 8  # steps of the way that are measured first
MOST_POINTS = 48  # that are measured in all
RESOLUTION = 1 / 4096  # of the way; what changes within it jumps
ROUNDS = 2  # of herds at the steps themselves, after which the steps are laid anew
SETTLED = 0.5  # of a run, which is left out
FIRST_SWEEP, FIRST_FRESH, FIRST_CHECK = 100, 1_000_000, 2_000_000  # seeds
MOST_STEP = MOST_DEVIATION = 0.15  # between two points, and between seeds
FINE = 0.6 * MOST_STEP  # between two points that are measured in search of the path
JUMP = 0.25  # there and back may differ by so much
TENFOLD = 10.0  # parameters that differ by more go by ratio
RISE = 8.0  # added noise is there from the first eighth of the way to the last
NOISE = 0.03  # no standard error is taken to be less: few seeds may not show it, and so little does not matter
KEEP_GOING = 0.15  # of the way along which nothing changes, at least, in changes of behaviour


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
    begin: Literal["random", "aligned", "mill"] = "random"


class Branches(NamedTuple):
    """What herds do that are swept along a way, and on their way back, by point of the way."""

    there: Measured
    back: Measured

    def widest(self):
        """Where the two differ most: point, column, difference, and its standard error."""
        apart = np.abs(self.there.mean - self.back.mean)[1:-1]
        point, column = np.unravel_index(apart.argmax(), apart.shape)
        spread = np.hypot(self.there.deviation, self.back.deviation)[point + 1, column]
        return int(point) + 1, int(column), float(apart[point, column]), float(spread / math.sqrt(self.there.seeds))

    @property
    def hysteresis(self):
        """Whether herds differ there and back, by more than two standard errors and `JUMP`."""
        *_, apart, error = self.widest()
        return apart > max(JUMP, 2.0 * error)


@dataclass(frozen=True)
class Morph:
    """A path, what was measured on it and on the straight line, herds swept along it, and where it jumps.

    A jump is where it is along the straight line, and by how much polarization or milling change there.
    """

    path: BrushPath
    on_path: Measured
    straight: Measured
    swept: Branches
    jumps: tuple[tuple[float, float], ...] = ()


def morph(start: Brush, end: Brush, trial: Trial, wander: float = 0.0, tell=lambda words: None):
    """Find a path between two brushes of one model.

    Parameters
    ----------
    wander : float
        Random turning added between the ends; nothing at them.
    tell : callable
        Is told what is being done.

    Returns
    -------
    Morph
    """

    def at(along):
        return brush_at(start, end, along, wander)

    tell("measuring new herds where the behaviour changes")
    responses = response(at, trial)
    for k in range(ROUNDS):
        tell(f"measuring new herds on the path, round {k + 1}")
        along = responses.evenly(trial.steps)
        responses.add(along, measured(at, along, trial, FIRST_FRESH + (k + 1) * trial.seeds).mean)
    along, steps = responses.evenly(trial.steps), np.linspace(0.0, 1.0, trial.steps + 1)
    tell("measuring other herds on the path")
    on_path = measured(at, along, trial)
    tell("measuring the same herds on the straight line")
    straight = measured(lambda share: mixed(start, end, share), steps, trial)
    tell("sweeping there and back")
    swept = sweep(at, along, trial, FIRST_SWEEP)
    even = not faults(on_path)
    path = BrushPath(
        start=start.name, end=end.name, along=tuple(map(float, along)), detour=detours(start, end, along, wander),
        begin=trial.begin, seconds=trial.seconds, even=even, bistable=not even and swept.hysteresis,
    )  # fmt: skip
    return Morph(path, on_path, straight, swept, responses.jumps())


def detours(start, end, along, wander=0.0):
    """What parameters have besides those of the straight line at some points of it, {name: numbers}."""
    along, best = np.asarray(along, float), {}
    for name in type(start.params).model_fields:
        a, b = getattr(start.params, name), getattr(end.params, name)
        if isinstance(a, float) and isinstance(b, float) and min(a, b) > 0.0 and max(a / b, b / a) > TENFOLD:
            best[name] = a ** (1.0 - along) * b**along - (a + along * (b - a))
    if wander:
        best["wander"] = wander * np.minimum(1.0, RISE * along) * np.minimum(1.0, RISE * (1.0 - along))
    inner = (along > 0.0) & (along < 1.0)  # rounding may leave something at the ends
    return {name: tuple(map(float, np.where(inner, values, 0.0))) for name, values in best.items()}


def brush_at(start, end, along, wander=0.0):
    """The brush so far along the way."""
    points = (0.0, along, 1.0)
    path = BrushPath(start=start.name, end=end.name, along=points, detour=detours(start, end, points, wander))
    return mixed(start, end, 0.5, path)


def measures_of(simulation, first=0, count=None):
    """Polarization and milling of this moment; of so many animals from a row on."""
    agents, rows = simulation.agents, slice(first, None if count is None else first + count)
    forward = agents[Heading.forward][rows]
    return compute_polarization(forward), compute_milling(agents[Position.xyz][rows, :2], forward)


def sweep(at, points, trial, seed) -> Branches:
    """Herds from the first point to the last and back, as many as seeds, side by side in one world.

    They are at each point as long as fresh herds, and measured in the same part of that time: what differs then does
    not do so because herds had less time.
    """
    order = [*range(len(points)), *reversed(range(len(points)))]
    simulation = _herds([at(point) for point in points], trial, seed, len(order), trial.seeds)
    world, samples = simulation.world, []
    palette, agents = world.resource(Palette), simulation.agents
    for k, point in enumerate(order):
        brush = at(points[point]).model_copy(update={"name": f"swept-{k % 2}"})
        agents[BrushBinding.home][:] = palette.add(brush)
        world.resource(Landscape).see_to(float(palette.view_range.max() * brush.body.length))
        samples.append(_last_part(simulation, trial, trial.seeds))
    simulation.close()
    n = len(points)
    return Branches(*(_over_seeds(np.swapaxes(way, 0, 1)) for way in (samples[:n], samples[n:][::-1])))


def _last_part(simulation, trial, herds):
    """What herds do after the time in which they settle, (herds, 2)."""
    simulation.run(round(SETTLED * trial.seconds * RATE))
    moments = []
    for _ in range(max(1, round(2 * (1.0 - SETTLED) * trial.seconds))):
        simulation.run(RATE // 2)
        moments.append([measures_of(simulation, k * trial.animals, trial.animals) for k in range(herds)])
    return np.mean(moments, axis=0)


def _herds(brushes, trial, seed, dwells=1, copies=0):
    """Herds that begin as the trial says, too far apart to meet: of each brush one, or so many of the first."""
    length = brushes[0].body.length
    fastest, farthest = max(b.speed.mean for b in brushes), max(b.vision.range for b in brushes)
    reach = 2.0 * (fastest * trial.seconds * dwells + math.sqrt(trial.animals / DENSITY)) + farthest
    formation, heading = BEGINNINGS[trial.begin]
    herds = [brushes[0].model_copy(update={"name": f"herd-{k}"}) for k in range(copies)] or brushes
    return herds_apart(herds, trial.animals, DENSITY, formation, seed, heading, apart=reach * length)


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

        Where nothing changes the way still goes on, by a small share of its own length; by more, where all that changes
        is little.
        """
        points, means = self.one_way()
        means[1:-1] = 0.25 * means[:-2] + 0.5 * means[1:-1] + 0.25 * means[2:]  # few seeds leave stairs
        change = np.abs(np.diff(means, axis=0)).sum(1)
        change += max(KEEP_GOING, 1.0 - change.sum()) * np.diff(points)
        travelled = np.concatenate([[0.0], np.cumsum(change)])
        positions = np.interp(np.linspace(0.0, travelled[-1], steps + 1), travelled, points)
        positions[0], positions[-1] = 0.0, 1.0
        return positions


def response(at, trial) -> Response:
    """What fresh herds do along a way, measured more closely where it changes."""
    points = np.linspace(0.0, 1.0, COARSE + 1)
    first_response = Response(points, measured(at, points, trial, FIRST_FRESH).mean)
    while len(more := first_response.too_far()[: MOST_POINTS - len(first_response.points)]):
        first_response.add(more, measured(at, more, trial, FIRST_FRESH).mean)
    return first_response


def measured(at, points, trial, first_seed=FIRST_CHECK) -> Measured:
    """Fresh herds at every point; those of one seed side by side in one world."""
    brushes = [at(point).model_copy(update={"name": f"point-{k}"}) for k, point in enumerate(points)]
    return _over_seeds(np.array([_run(brushes, trial, first_seed + k) for k in range(trial.seeds)]))


def _over_seeds(samples) -> Measured:
    return Measured(samples.mean(0), samples.std(0, ddof=min(1, len(samples) - 1)), len(samples))


def _run(brushes, trial, seed):
    """What a herd of each brush does, (brushes, 2)."""
    simulation = _herds(brushes, trial, seed)
    means = _last_part(simulation, trial, len(brushes))
    simulation.close()
    return means


def goes_back(measured: Measured) -> np.ndarray:
    """By how much each measure goes back between any two points, and how much of that chance explains, (2, 2)."""
    error = np.maximum(measured.deviation / np.sqrt(measured.seeds), NOISE)
    sign = np.where(measured.mean[-1] >= measured.mean[0], 1.0, -1.0)
    fallen = (measured.mean * sign)[:, None] - (measured.mean * sign)[None]  # [earlier, later, measure]
    allowed = 2.0 * np.hypot(error[:, None], error[None])
    later = np.triu(np.ones(fallen.shape[:2], bool))[..., None]
    excess = np.where(later, fallen - allowed, -np.inf).reshape(-1, fallen.shape[2])
    worst = excess.argmax(0), np.arange(fallen.shape[2])
    return np.stack([v.reshape(-1, fallen.shape[2])[worst] for v in (fallen, allowed)])


def faults(measured: Measured) -> list[str]:
    """What keeps a way from being even, in words."""
    sentences = []
    back, allowed = goes_back(measured)
    for column, name in enumerate(MEASURES):
        step = np.abs(np.diff(measured.mean[:, column])).max()
        if back[column] > allowed[column]:
            sentences.append(f"{name} goes back by {back[column]:.2f}")
        if step > MOST_STEP:
            sentences.append(f"{name} changes by {step:.2f} in one step")
        if measured.deviation[:, column].max() >= MOST_DEVIATION:
            sentences.append(f"{name} deviates by {measured.deviation[:, column].max():.2f} between seeds")
    return sentences


def table(path: Morph) -> str:
    """All ways side by side, and what they are worth."""
    steps = len(path.path.along) - 1
    ways = {"path": path.on_path, "straight line": path.straight, "there": path.swept.there,
            "back": path.swept.back}  # fmt: skip
    lines = [" " * 16 + "".join(f"{name:<26}" for name in ways), "step   along   " + "polarization  milling     " * 4]
    for k, along in enumerate(path.path.along):
        cells = [f"{m.mean[k, c]:.2f} ± {m.deviation[k, c]:.2f}" for m in ways.values() for c in (0, 1)]
        lines.append(f"{k:>2} / {steps:<2} {along:.4f}  {'   '.join(cells)}")
    for name in ("path", "straight line"):
        sentences = faults(ways[name])
        lines.append(f"{name}: {'; '.join(sentences) if sentences else 'even'}")
    lines += [f"jumps by {size:.2f} at {where:.4f} of the way" for where, size in path.jumps]
    return "\n".join([*lines, verdict(path.swept, path.path.even)])


def verdict(swept: Branches, even: bool) -> str:
    """What the way there and the way back say, in words."""
    point, column, apart, error = swept.widest()
    name, last = MEASURES[column], len(swept.there.mean) - 1
    there, back = (m.mean[point, column] for m in swept)
    sentence = f"at {point}/{last} {name} is {there:.2f} there and {back:.2f} back (standard error {error:.2f})"
    if not swept.hysteresis:
        return f"no hysteresis: {sentence}"
    jumps = [np.abs(np.diff(m.mean[:, column])) for m in swept]
    largest = [f"{jump.max():.2f} between {jump.argmax()}/{last} and {jump.argmax() + 1}/{last}" for jump in jumps]
    kind = "hysteresis, though fresh herds change evenly" if even else "bistable"
    return f"{kind}: {sentence}; largest step there {largest[0]}, back {largest[1]}"
