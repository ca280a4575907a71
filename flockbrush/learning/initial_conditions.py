"""What follows from a clip directly: how its animals begin, how fast they go, what bodies they have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from flockbrush.behaviours.brush import BodySpec, SpeedSpec
from flockbrush.film.body_gaps import distances_of_axes
from flockbrush.film.observations import Evidence
from flockbrush.film.speeds import joined
from flockbrush.learning.herd_views import told_apart
from flockbrush.learning.rollout import DT, OPEN, HerdStart, Surroundings, Walls
from flockbrush.systems.measures import compute_nnd

TOUCHING = 0.06  # share of animals lying on another as capsules, above which bodies are taken for discs
LYING = 0.8  # of two radii: axes that are nearer are of animals that lie on one another
UNEVEN = 0.15  # of the mean: speeds that differ less between crowded and empty places are taken for the same
LEAST_OWN = 0.2  # of the spread of speeds is the animals' own, whatever crowding explains
TRIES = 30  # places looked at for each animal
BESIDE = 0.25  # BL from an obstacle, to where animals are put that would be in it


def speed_of(evidences: list[Evidence]) -> SpeedSpec:
    """The speed process of several clips: means by frames, and a table of densities where that matters.

    The deviation of a brush is the noise of the process: speeds spread by deviation / sqrt(2 reversion).
    """
    known = [e.speed for e in evidences if e.speed is not None]
    if not known:
        return SpeedSpec(mean=0.5, deviation=0.05)
    weight = np.array([len(e.fields) for e in evidences if e.speed is not None], float)
    mean = float(np.average([s.mean for s in known], weights=weight))
    own, between, common = (
        float(np.average(np.nan_to_num([getattr(s, name) ** 2 for s in known]), weights=weight))
        for name in ("deviation", "individual", "common")
    )
    rates = [s.reversion for s in known if s.reversion is not None] or [s.likely for s in known]
    reversion = float(np.clip(np.median(rates), 0.05, 20.0))
    table = [(float(np.clip(a, 0, 100)), b) for a, b in joined(known)]
    factors = [factor for _, factor in table]
    uneven = len(table) > 1 and max(factors) - min(factors) > UNEVEN
    if uneven:  # the table spreads speeds by itself: what is left are differences of animals and the process's own
        left = between - mean**2 * float(np.var(factors))
        square = float(np.mean(np.square(factors)))
        own, between = max(own + min(left, 0.0), LEAST_OWN**2 * own) / square, max(left, 0.0) / square
    pausing, states = [s for s in known if s.stops > 0], {}
    for name in ("stops", "starts", "imitation") if 2 * len(pausing) > len(known) else ():  # most clips show it
        states[name] = float(np.clip(np.median([getattr(s, name) for s in pausing]), 0, 20))
    return SpeedSpec(
        **states,
        mean=float(np.clip(mean, 0, 100)),
        deviation=float(np.clip(np.sqrt((2 - reversion * DT) * reversion * own), 0, 50)),  # in ticks of so long
        reversion=reversion,
        individual=float(np.clip(np.sqrt(between) / mean, 0, 1)) if mean > 0 else 0.0,
        common=float(np.clip(np.sqrt(common), 0, 50)),
        common_time=float(np.median([s.common_time for s in known if s.common > 0] or [known[0].common_time])),
        by_density=tuple(table) if uneven else (),
    )


def own_speed(speed: SpeedSpec, paces, weight) -> SpeedSpec:
    """The speed process of animals whose model multiplies it, where they are observed, by these factors.

    Crowding then acts on speeds by the model, and not by a table.

    Parameters
    ----------
    speed : SpeedSpec
        As observed: the product of both.
    paces, weight : (k,) ndarray
        Factors, and how much each counts.
    """
    if (paces == 1.0).all():
        return speed
    mean, square = (float(np.average(paces**power, weights=weight)) for power in (1, 2))
    own, noise = speed.mean / mean, speed.own_spread
    left = (noise**2 - own**2 * (square - mean**2)) / square
    noise = np.sqrt(max(left, (LEAST_OWN * noise) ** 2))
    deviation = float(np.clip(noise * np.sqrt(2 * speed.reversion), 0, 50))
    changed = {"mean": float(np.clip(own, 0, 100)), "deviation": deviation, "common": speed.common / mean}
    return speed.model_copy(update=changed | {"by_density": ()})


def body_of(evidences: list[Evidence]) -> BodySpec:
    """Bodies as wide as the clip's; as discs, and smaller ones, if its animals would lie on one another."""
    radius = float(np.clip(np.median([e.radius_bl for e in evidences]), 0.05, 0.5))
    apart = [e.sightings for e in evidences if e.sightings is not None and len(e.sightings.xy) and told_apart(e)]
    lying = [np.mean(distances_of_axes(seen, radius) < 2.0 * LYING * radius) for seen in apart]
    if not lying or np.mean(lying) <= TOUCHING:
        return BodySpec(length=1.0, radius=radius)
    gap = np.concatenate([distances_of_axes(seen, 0.5) for seen in apart])
    radius = float(np.clip(min(radius, 0.5 * np.quantile(gap, 0.05)), 0.05, 0.5))
    return BodySpec(length=1.0, radius=radius, contact="disc")


def start_of(evidence: Evidence, t=0, seed=0, body=BodySpec()) -> HerdStart:  # noqa: B008  frozen
    """The herd of frame t: its animals where they are separated, the others from the fields.

    Animals drawn from fields stand where the density says, apart from one another, and face the way the cell moves,
    scattered as its angular variance says.
    """
    rng = np.random.default_rng([seed, t, 40])
    fields = evidence.fields
    missing = round(float(fields.count[t]))
    xy, forward, speed = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    seen = evidence.sightings
    if seen is not None and told_apart(evidence):
        rows = seen.of(t)
        xy, forward, speed = (getattr(seen, name)[rows] for name in ("xy", "forward", "speed"))
        missing = max(0, missing - len(xy)) if len(xy) < 0.9 * missing else 0
    if missing:
        more = _drawn(fields, t, missing, xy, 2 * body.radius / body.length, rng)
        xy, forward = np.concatenate([xy, more[0]]), np.concatenate([forward, more[1]])
        speed = np.concatenate([speed, more[2]])
    known = speed[np.isfinite(speed)]
    usual = known.mean() if len(known) else 1.0
    walls = Walls.of(fields)
    if walls is not None:
        xy = walls.outside(xy, 1.05 * body.radius / body.length)
    return HerdStart(xy.copy(), forward.copy(), np.where(np.isfinite(speed), speed, usual))


def _drawn(fields, t, count, others, room, rng):
    """Positions, headings and speeds of animals drawn from the fields of a frame."""
    number = np.nan_to_num(fields.density[t]) * fields.cell**2
    row, column, inside = fields.cells_of(others)
    np.subtract.at(number, (row[inside], column[inside]), 1.0)
    number = np.maximum(number, 0.0).ravel()
    if not number.sum() > 0:
        return np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)
    # whole animals by cell: as near the density as whole numbers can be
    wanted = np.cumsum(number) / number.sum() * count
    cells = np.searchsorted(wanted, rng.uniform() + np.arange(count), side="right")
    cells = np.minimum(cells, len(number) - 1)
    xy = _apart(cells, fields, others, room, rng)
    cells = _cells_of_motion(fields, t)[cells]
    velocity = fields.velocity[t].reshape(-1, 2)[cells]
    mean = np.arctan2(velocity[:, 1], velocity[:, 0])
    spread = np.radians(np.sqrt(np.nan_to_num(fields.angular_variance[t].ravel()[cells], nan=2700.0)))
    # the variance of |x| of a normal x is (1 - 2/π) σ²; from about 50° on all directions are alike
    angle = mean + np.minimum(spread / np.sqrt(1 - 2 / np.pi), 3.0) * rng.normal(size=len(cells))
    angle = np.where(np.isfinite(angle), angle, rng.uniform(-np.pi, np.pi, len(cells)))
    speed = fields.speed[t].ravel()[cells]
    return xy, np.column_stack([np.cos(angle), np.sin(angle)]), speed


def _cells_of_motion(fields, t):
    """(ny * nx,) for each cell the nearest in which motion is seen: itself, if it is, or if it is seen nowhere."""
    cells, unknown = np.arange(fields.occupied[t].size), ~fields.occupied[t]
    if unknown.all():
        return cells
    row, column = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return (row * unknown.shape[1] + column).ravel()


def _apart(cells, fields, others, room, rng):
    """A place for each animal in its cell, the emptiest of some tries, one after the other."""
    ny, nx = fields.shape
    corner = np.asarray(fields.origin, float) + fields.cell * np.column_stack([cells % nx, cells // nx])
    placed = np.concatenate([others, np.zeros((len(cells), 2))])
    for k, low in enumerate(corner):
        n = len(others) + k
        tries = low + fields.cell * rng.random((TRIES, 2))
        if n:
            off = tries[:, None] - placed[None, :n]
            far = np.hypot(off[..., 0], off[..., 1]).min(1)
            free = np.flatnonzero(far > 1.2 * max(room, 0.5))
            placed[n] = tries[free[0] if len(free) else int(far.argmax())]
        else:
            placed[n] = tries[0]
    return placed[len(others) :]


def resized(start: HerdStart, factor: float, seed=0) -> HerdStart:
    """A herd with a multiple of the animals, of the same density and the same heading at each place of its outline."""
    n = len(start)
    draw = np.random.default_rng(seed)
    whole, rest = divmod(round(n * factor), n) if n else (0, 0)
    chosen = np.concatenate([np.repeat(np.arange(n), whole), np.sort(draw.permutation(n)[:rest])]).astype(int)
    middle = start.xy.mean(0) if n else 0.0
    xy = middle + (start.xy[chosen] - middle) * np.sqrt(factor)
    if factor > 1:
        xy = xy + _aside(chosen, n, _gap(start.xy))
    speed = None if start.speed is None else start.speed[chosen]
    return HerdStart(xy, start.forward[chosen], speed)


def resized_among(start: HerdStart, walls: Walls | None, factor: float, seed=0) -> tuple[HerdStart, Surroundings]:
    """`resized`, and the obstacles around: they grow as the herd does, so that it finds room in an arena."""
    herd = resized(start, factor, seed)
    if walls is None or not len(herd):
        return herd, OPEN
    walls = walls.grown(np.sqrt(factor), start.xy.mean(0))
    return replace(herd, xy=walls.outside(herd.xy, BESIDE)), Surroundings(walls)


def _gap(xy):
    return float(np.median(compute_nnd(xy))) if len(xy) > 1 else 1.0


def _aside(chosen, n, gap):
    """Where the copies of an animal stand about its place: on a lattice as wide as the herd's own."""
    copy = np.zeros(len(chosen), int)
    counted = np.zeros(n, int)
    for row, animal in enumerate(chosen):
        copy[row] = counted[animal]
        counted[animal] += 1
    side = int(np.ceil(np.sqrt(max(counted.max(initial=1), 1))))
    return (np.column_stack([copy % side, copy // side]) - (side - 1) / 2) * gap
