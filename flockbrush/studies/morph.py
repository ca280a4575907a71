"""Paths between two brushes along which the measured behaviour changes evenly.

The way goes straight from the numbers of one brush to those of the other, but for parameters that differ more than
tenfold, which go by ratio, for parameters that may change before the others, and for random turning, which may be added
between the ends (`Route`): weak alignment against noise gives every degree of order, and without noise a herd only
takes longer to become ordered.  Fresh herds are measured along the way, and again half-way between points whose herds
differ by too much, until they do not or the points are next to one another: what herds do, not what their numbers are,
says where the steps of the path lie.  Herds of several sizes may be measured: steps are laid where either changes.
Herds of their own at the steps correct them, others say what the path is worth, beside the straight line.  At last,
where the path is not even, herds are swept along it and back.  The pair is bistable when herds on the way there and
those on the way back differ at the same step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.mixture import STEPS, BrushPath, mixed
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
VALLEY = 0.06  # next to an end, what lies farther than this outside the range between the ends has no steps


class Route(NamedTuple):
    """How the numbers go from one brush to another, beside the straight line.

    Attributes
    ----------
    wander : float
        Random turning added between the ends; nothing at them.
    first : tuple of str
        How the names of parameters begin that change in the first half of the way; all others change in the second.
    """

    wander: float = 0.0
    first: tuple[str, ...] = ()

    def along(self, way):
        """How far the other numbers are at so much of the way."""
        return np.maximum(0.0, 2.0 * np.asarray(way, float) - 1.0) if self.first else np.asarray(way, float)


STRAIGHT = Route()


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
    steps: int = STEPS
    seconds: float = 20.0
    begin: Literal["random", "aligned", "mill"] = "random"


def trials_of(sizes, seeds, steps=None, seconds=20.0, begin="random") -> list[Trial]:
    """One for herds of each size: so many of the smallest, of larger ones fewer, at least two."""
    least = min(sizes)
    return [
        Trial(size, max(2, round(seeds * least / size)), steps or STEPS, seconds, begin) for size in sorted(set(sizes))
    ]


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


class Judged(NamedTuple):
    """What herds of one size do on a path, on the straight line, and swept along the path if it is not even."""

    animals: int
    on_path: Measured
    straight: Measured
    swept: Branches | None


class Morph(NamedTuple):
    """A path, what herds of each size do on it, and where it jumps.

    A jump is where it is along the way, and by how much polarization or milling change there.
    """

    path: BrushPath
    judged: tuple[Judged, ...]
    jumps: tuple[tuple[float, float], ...] = ()


def morph(start: Brush, end: Brush, trials, route=STRAIGHT, tell=lambda words: None) -> Morph:
    """Find a path between two brushes of one model.

    Parameters
    ----------
    trials : sequence of Trial
        One for each size of herds; alike but for that and the seeds.
    tell : callable
        Is told what is being done.
    """

    def at(way):
        return brush_at(start, end, way, route)

    steps = trials[0].steps
    tell("measuring new herds where the behaviour changes")
    seen = response(at, trials)
    for k in range(ROUNDS):
        tell(f"measuring new herds on the path, round {k + 1}")
        way = seen.evenly(steps)
        seen.add(way, means_of(at, way, trials, FIRST_FRESH + (k + 1) * trials[0].seeds))
    way = seen.evenly(steps)
    tell("measuring other herds on the path and on the straight line")
    judged = tuple(_judged(start, end, at, way, trial) for trial in trials)
    even = all(one.swept is None for one in judged)
    path = BrushPath(
        start=start.name, end=end.name, along=tuple(map(float, route.along(way))),
        detour=detours(start, end, way, route), begin=trials[0].begin, seconds=trials[0].seconds, even=even,
        bistable=any(one.swept.hysteresis for one in judged if one.swept),
    )  # fmt: skip
    return Morph(path, judged, seen.jumps())


def _judged(start, end, at, way, trial):
    on_path = measured(at, way, trial)
    straight = measured(lambda share: mixed(start, end, share), np.linspace(0.0, 1.0, len(way)), trial)
    return Judged(trial.animals, on_path, straight, sweep(at, way, trial, FIRST_SWEEP) if faults(on_path) else None)


def detours(start, end, way, route=STRAIGHT):
    """What parameters have besides those of the straight line at some points of the way, {name: numbers}."""
    way, found = np.asarray(way, float), {}
    along = route.along(way)
    for name in type(start.params).model_fields:
        a, b = getattr(start.params, name), getattr(end.params, name)
        if not (isinstance(a, float) and isinstance(b, float)) or a == b:
            continue
        leads = bool(route.first) and name.startswith(route.first)
        share, by_ratio = (
            np.minimum(1.0, 2.0 * way) if leads else along,
            min(a, b) > 0.0 and max(a / b, b / a) > TENFOLD,
        )
        if leads or by_ratio:
            value = a ** (1.0 - share) * b**share if by_ratio else a + share * (b - a)
            found[name] = value - (a + along * (b - a))
    if route.wander:
        noise = route.wander * np.minimum(1.0, RISE * way) * np.minimum(1.0, RISE * (1.0 - way))
        found["wander"] = found.get("wander", 0.0) + noise
    inner = (way > 0.0) & (way < 1.0)  # rounding may leave something at the ends
    return {name: tuple(map(float, np.where(inner, values, 0.0))) for name, values in found.items()}


def brush_at(start, end, way, route=STRAIGHT):
    """The brush so far along the way."""
    points = np.array([0.0, way, 1.0])
    along, detour = tuple(map(float, route.along(points))), detours(start, end, points, route)
    return mixed(start, end, 0.5, BrushPath(start=start.name, end=end.name, along=along, detour=detour))


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
    world, found = simulation.world, []
    palette, agents = world.resource(Palette), simulation.agents
    for k, point in enumerate(order):
        brush = at(points[point]).model_copy(update={"name": f"swept-{k % 2}"})
        agents[BrushBinding.home][:] = palette.add(brush)
        world.resource(Landscape).see_to(float(palette.view_range.max() * brush.body.length))
        found.append(_last_part(simulation, trial, trial.seeds))
    simulation.close()
    n = len(points)
    return Branches(*(_over_seeds(np.swapaxes(way, 0, 1)) for way in (found[:n], found[n:][::-1])))


def _last_part(simulation, trial, herds):
    """What herds do after the time in which they settle, (herds, 2)."""
    simulation.run(round(SETTLED * trial.seconds * RATE))
    moments = []
    for _ in range(max(1, round(2 * (1.0 - SETTLED) * trial.seconds))):
        simulation.run(RATE // 2)
        moments.append([measures_of(simulation, k * trial.animals, trial.animals) for k in range(herds)])
    return np.mean(moments, axis=0)


def _herds(brushes, trial, seed, dwells=1, copies=0):
    """Herds with the start of the trial, too far apart to meet: one of each brush, or several of the first."""
    length = brushes[0].body.length
    fastest, farthest = max(b.speed.mean for b in brushes), max(b.vision.range for b in brushes)
    reach = 2.0 * (fastest * trial.seconds * dwells + math.sqrt(trial.animals / DENSITY)) + farthest
    formation, heading = BEGINNINGS[trial.begin]
    herds = [brushes[0].model_copy(update={"name": f"herd-{k}"}) for k in range(copies)] or brushes
    return herds_apart(herds, trial.animals, DENSITY, formation, seed, heading, apart=reach * length)


class Response:
    """What herds were seen to do along a way: points (n,), ascending, and means (n, c) there.

    A column is a measure of herds of one size.

    Points may be there more than once.
    """

    def __init__(self, points, means):
        self.points, self.means = np.asarray(points, float), np.asarray(means, float)

    def add(self, points, means):
        """More points, and what herds do there."""
        every = np.concatenate([self.points, points])
        order = np.argsort(every, kind="stable")
        self.points, self.means = every[order], np.concatenate([self.means, means])[order]

    def each(self):
        """Each point once, its mean and how often it was measured; and the valleys next to the ends, (k,) bool.

        A valley is where herds lie outside the range between those of the ends: random turning may first take from a
        herd the order that it had.
        """
        points, where, count = np.unique(self.points, return_inverse=True, return_counts=True)
        means = np.zeros((len(points), self.means.shape[1]))
        np.add.at(means, where, self.means)
        means /= count[:, None]
        low, high = np.sort(means[[0, -1]], axis=0)
        outside = (((means < low - VALLEY) | (means > high + VALLEY)) & (high - low > MOST_STEP)).any(1)
        outside[[0, -1]] = True
        if outside.all():
            outside[:] = False
        first, last = (np.logical_and.accumulate(way) for way in (outside, outside[::-1]))
        return points, means, count, first, last[::-1]

    def one_way(self):
        """Each point once, and the nearest values there that never go back, (k,) and (k, c); as the end in valleys."""
        points, means, count, first, last = self.each()
        means[first], means[last] = means[0], means[-1]
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
        is little.  No step lies in a valley.
        """
        points, means = self.one_way()
        *_, first, last = self.each()
        apart = np.where(first[1:] & first[:-1] | last[1:] & last[:-1], 0.0, np.diff(points))
        means[1:-1] = 0.25 * means[:-2] + 0.5 * means[1:-1] + 0.25 * means[2:]  # few seeds leave stairs
        change = np.abs(np.diff(means, axis=0)).max(1)
        change += max(KEEP_GOING, 1.0 - change.sum()) * apart
        gone = np.concatenate([[0.0], np.cumsum(change)])
        found = np.interp(np.linspace(0.0, gone[-1], steps + 1), gone, points)
        found[0], found[-1] = 0.0, 1.0
        return found


def response(at, trials) -> Response:
    """What fresh herds do along a way, measured more closely where it changes."""
    points = np.linspace(0.0, 1.0, COARSE + 1)
    seen = Response(points, means_of(at, points, trials, FIRST_FRESH))
    while len(more := seen.too_far()[: MOST_POINTS - len(seen.points)]):
        seen.add(more, means_of(at, more, trials, FIRST_FRESH))
    return seen


def means_of(at, points, trials, first_seed):
    """What fresh herds of each size do, side by side, (points, 2 * sizes)."""
    return np.hstack([measured(at, points, trial, first_seed).mean for trial in trials])


def measured(at, points, trial, first_seed=FIRST_CHECK) -> Measured:
    """Fresh herds at every point; those of one seed side by side in one world."""
    brushes = [at(point).model_copy(update={"name": f"point-{k}"}) for k, point in enumerate(points)]
    return _over_seeds(np.array([_run(brushes, trial, first_seed + k) for k in range(trial.seeds)]))


def _over_seeds(found) -> Measured:
    return Measured(found.mean(0), found.std(0, ddof=min(1, len(found) - 1)), len(found))


def _run(brushes, trial, seed):
    """What a herd of each brush does, (brushes, 2)."""
    simulation = _herds(brushes, trial, seed)
    means = _last_part(simulation, trial, len(brushes))
    simulation.close()
    return means


def goes_back(found: Measured) -> np.ndarray:
    """By how much each measure goes back between any two points, and how much of that chance explains, (2, 2)."""
    error = np.maximum(found.deviation / np.sqrt(found.seeds), NOISE)
    sign = np.where(found.mean[-1] >= found.mean[0], 1.0, -1.0)
    fallen = (found.mean * sign)[:, None] - (found.mean * sign)[None]  # [earlier, later, measure]
    allowed = 2.0 * np.hypot(error[:, None], error[None])
    later = np.triu(np.ones(fallen.shape[:2], bool))[..., None]
    excess = np.where(later, fallen - allowed, -np.inf).reshape(-1, fallen.shape[2])
    worst = excess.argmax(0), np.arange(fallen.shape[2])
    return np.stack([v.reshape(-1, fallen.shape[2])[worst] for v in (fallen, allowed)])


def faults(found: Measured) -> list[str]:
    """What keeps a way from being even, in words."""
    said = []
    back, allowed = goes_back(found)
    for column, name in enumerate(MEASURES):
        step = np.abs(np.diff(found.mean[:, column])).max()
        if back[column] > allowed[column]:
            said.append(f"{name} goes back by {back[column]:.2f}")
        if step > MOST_STEP:
            said.append(f"{name} changes by {step:.2f} in one step")
        if found.deviation[:, column].max() >= MOST_DEVIATION:
            said.append(f"{name} deviates by {found.deviation[:, column].max():.2f} between seeds")
    return said


def table(found: Morph) -> str:
    """All ways side by side, for herds of each size, and what they are worth."""
    lines = [line for one in found.judged for line in _table_of(one, found.path)]
    return "\n".join([*lines, *(f"jumps by {size:.2f} at {where:.4f} of the way" for where, size in found.jumps)])


def _table_of(one: Judged, path: BrushPath):
    ways = {"path": one.on_path, "straight line": one.straight}
    if one.swept:
        ways |= {"there": one.swept.there, "back": one.swept.back}
    yield f"{one.animals} animals, {one.on_path.seeds} seeds"
    yield (" " * 16 + "".join(f"{name:<26}" for name in ways)).rstrip()
    yield ("step   along   " + "polarization  milling     " * len(ways)).rstrip()
    for k, along in enumerate(path.along):
        cells = [f"{m.mean[k, c]:.2f} ± {m.deviation[k, c]:.2f}" for m in ways.values() for c in (0, 1)]
        yield f"{k:>2} / {len(path.along) - 1:<2} {along:.4f}  {'   '.join(cells)}"
    for name in ("path", "straight line"):
        said = faults(ways[name])
        yield f"{name}: {'; '.join(said) if said else 'even'}"
    if one.swept:
        yield verdict(one.swept)


def verdict(swept: Branches) -> str:
    """What the way there and the way back say, in words."""
    point, column, apart, error = swept.widest()
    name, last = MEASURES[column], len(swept.there.mean) - 1
    there, back = (m.mean[point, column] for m in swept)
    said = f"at {point}/{last} {name} is {there:.2f} there and {back:.2f} back (standard error {error:.2f})"
    if not swept.hysteresis:
        return f"no hysteresis: {said}"
    jumps = [np.abs(np.diff(m.mean[:, column])) for m in swept]
    largest = [f"{jump.max():.2f} between {jump.argmax()}/{last} and {jump.argmax() + 1}/{last}" for jump in jumps]
    return f"bistable: {said}; largest step there {largest[0]}, back {largest[1]}"
