"""A clip and simulated herds in ten measures of moments, each with the limits within which they are alike.

Positions half a second apart, or more where animals are slow, say how fast an animal goes and how much it turns, in a
clip and in a run alike; runs are seen with the noise of the clip's sightings.  The beginning of a run is the clip's,
so the first third is left out.

The limits of a measure come from the clip (a block bootstrap over its moments [1]_), from the runs (chance alone makes
so much of a difference) and from a floor below which nobody would see a difference.

References
----------
.. [1] Künsch, H. R. (1989). The jackknife and the bootstrap for general stationary observations. Annals of Statistics
   17, 1217-1241.
.. [2] Cavagna, A. et al. (2010). Scale-free correlations in starling flocks. PNAS 107, 11865-11870.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from flockbrush.film.missing_animals import share_lost, trust
from flockbrush.film.observations import Evidence
from flockbrush.learning.herd_views import fields_of, in_picture, told_apart, view_of, view_of_fields
from flockbrush.learning.rollout import Run
from flockbrush.learning.scores import CHANCE

SPAN = 0.5, 1.5  # s over which steps and turns are taken: as long as it takes to go one body length, within
PART = 0.25  # of the clip, which they are never longer than
SHORTEST = 0.8  # s of a clip that can be judged
LOOKS = 36  # moments of a clip that are looked at
SETTLED = 1 / 3  # of the time, that is left out at the beginning
BLOCKS, RESAMPLED = 5, 200  # of the bootstrap
DEVIATIONS = 3.3  # of clip and runs together, within which herds are alike: any of a dozen may be off by chance
STANDS, SLOWEST = 0.15, 0.05  # of the clip's fast animals; BL/s: slower animals stand
FARTHER = 2.0  # of the share of animals that a film loses, by which nearest neighbours seem farther away, about
WAVERS = 0.7  # of the value of as many independent animals: the fluctuation of the order of a herd without any
RINGS = 10  # of distance, in which velocities are compared
FARTHEST = 8.0  # limits: a herd that is farther off is just as wrong
SPEED_QUANTILES, TURN_QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9), (0.25, 0.5, 0.75, 0.9)
NEAREST_QUANTILES = (0.25, 0.5, 0.75, 0.9)  # the last tells of animals that have left the herd


@dataclass(frozen=True)
class BatteryMeasure:
    """What is compared: its name in a sentence, and the least difference that counts."""

    name: str
    unit: str
    floor: float  # in the unit
    share: float = 0.0  # of the clip's value, the floor too; whichever is larger
    lasting: float = 0.0  # the same after 20 s; 0: not compared then
    lasting_share: float = 0.0
    lasting_limits: float = 1.5  # the same, of the limit beside the clip
    onward: float = 1.0  # of the change in the clip, that may go on after it
    growth_error: float | None = None  # 1/s, of the growth of the clip, by which it may have changed after 20 s


MEASURES = {
    m.name: m
    for m in (
        BatteryMeasure("polarization", "", 0.06, lasting=0.2),
        BatteryMeasure("milling", "", 0.10, lasting=0.3),
        BatteryMeasure("nearest neighbour", "BL", 0.03, 0.10, 0.06, 0.10, 0.5, 0.5, growth_error=0.0),
        BatteryMeasure("speeds", "BL/s", 0.03, 0.10, lasting=0.05, lasting_share=0.15),
        BatteryMeasure("changes of speed", "BL/s²", 0.05, 0.25),
        BatteryMeasure("turning", "rad/s", 0.06, 0.30),
        BatteryMeasure("spread", "BL", 0.1, 0.10, 0.4, 0.45, growth_error=0.05 / DEVIATIONS),
        BatteryMeasure("growth", "1/s", 0.05),
        BatteryMeasure("correlation length", "BL", 0.5, 0.5),
        BatteryMeasure("share standing", "", 0.08, lasting=0.2),
        BatteryMeasure("response to neighbours", "rad", 0.001, 0.14),  # of the scatter of turns
        BatteryMeasure("scatter of turns", "rad", 0.003, 0.5),
    )
}


@dataclass
class ClipMoment:
    """A herd at one moment."""

    xy: np.ndarray  # (n, 2) BL
    heading: np.ndarray  # (n, 2) unit vectors, zero unknown
    velocity: np.ndarray  # (n, 2) BL/s over a span; NaN unknown
    change: np.ndarray  # (n,) BL/s², of speed from the span before to this one, without sign; NaN unknown
    turn: np.ndarray  # (n,) rad/s over a span; NaN unknown
    weight: np.ndarray  # (n,) animals
    trust: np.ndarray  # (n,) how much the distances to its neighbours count


def _looks(first, xy, heading, who, fps, every, span, single=True, velocity=None, counts=(None, None)):
    """[Look] at regular frames; steps are those of the same animal some frames later.

    ``counts``: weight and trust of each row, if they are not 1.
    """
    step = max(1, round(span * fps))
    angle = np.arctan2(heading[:, 1], heading[:, 0])
    found = []
    for t in range(0, len(first) - 1 - step, every) if single else range(0, len(first) - 1, every):
        rows = slice(first[t], first[t + 1])
        n = first[t + 1] - first[t]
        speed, change, turn = np.full((n, 2), np.nan), np.full(n, np.nan), np.full(n, np.nan)
        if single:
            later = slice(first[t + step], first[t + step + 1])
            mine, theirs = _paired(who[rows], who[later])
            speed[mine] = (xy[later][theirs] - xy[rows][mine]) * (fps / step)
            if t >= step:
                before = slice(first[t - step], first[t - step + 1])
                now, earlier = _paired(who[rows], who[before])
                was = np.hypot(*(xy[rows][now] - xy[before][earlier]).T) * (fps / step)
                change[now] = np.abs(np.hypot(*speed[now].T) - was) * (fps / step)
            turned = angle[later][theirs] - angle[rows][mine]
            turn[mine] = np.abs((turned + np.pi) % (2 * np.pi) - np.pi) * (fps / step)
        else:
            speed = velocity[rows]
        weight, trusted = (np.ones(n) if values is None else values[rows] for values in counts)
        found.append(ClipMoment(xy[rows], heading[rows], speed, change, turn, weight, trusted))
    return found


def _paired(who, others):
    """Where those are that are named in both of two lists of animals."""
    mine, theirs = same_animals(who, others)
    named = who[mine] >= 0
    return mine[named], theirs[named]


def same_animals(who, later) -> tuple[np.ndarray, np.ndarray]:
    """Where those are who are in both of two lists of animals: in the one, and in the other."""
    if np.array_equal(who, later) and (who[1:] > who[:-1]).all():
        return np.arange(len(who)), np.arange(len(who))
    return np.intersect1d(who, later, return_indices=True)[1:]


def looks_of(clip: Evidence, every: int, span: float = SPAN[0]) -> list[ClipMoment]:
    """Looks at a clip at regular frames."""
    if told_apart(clip):
        seen = clip.sightings
        assert seen is not None  # animals are told apart
        counts = None, trust(seen.neighbours_seen)
        return _looks(seen.first, seen.xy, seen.forward, seen.track, clip.fps, every, span, counts=counts)
    return _of_view(view_of(clip, False), clip.fps, every)


def looks_of_run(
    run: Run, clip: Evidence, every: int, fps: float | None = None, span: float = SPAN[0]
) -> list[ClipMoment]:
    """Looks at a run as seen in that clip, with the errors of its sightings."""
    fps = clip.fps if fps is None else fps
    if not told_apart(clip):
        return _of_view(view_of_fields(fields_of(run, clip.fields)), fps, every)
    first, xy, forward, who = seen_run(run, clip)
    return _looks(first, xy, forward, who, fps, every, span)


def seen_run(run: Run, clip: Evidence) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A run with the errors of a clip: first rows of frames (T + 1,), positions and headings (m, 2), ids (m,)."""
    inside = in_picture(run, clip.fields)
    frame = run.frame[inside]
    rng = np.random.default_rng(len(frame))
    first = np.searchsorted(frame, np.arange(len(run) + 1))
    if clip.smoothing is not None and _as_often(run, clip):
        return first, *_smoothed_run(run, inside, frame, clip, rng), run.ids[inside]
    xy = run.xy[inside] + clip.place_noise * rng.normal(size=(len(frame), 2))
    angle = np.arctan2(run.forward[inside, 1], run.forward[inside, 0])
    angle = angle + clip.heading_noise * rng.normal(size=len(frame))
    return first, xy, np.column_stack([np.cos(angle), np.sin(angle)]), run.ids[inside]


def _as_often(run, clip):
    """Whether a run is observed at the frame rate of the clip."""
    return len(run) > 1 and abs((run.times[1] - run.times[0]) * clip.fps - 1.0) < 1e-6


def _smoothed_run(run, inside, frame, clip, rng):
    """Positions and headings (m, 2) of those inside, observed as the animals of the clip were."""
    names, who = np.unique(run.ids[inside], return_inverse=True)
    xy, angle = np.full((len(run), len(names), 2), np.nan), np.full((len(run), len(names)), np.nan)
    xy[frame, who] = run.xy[inside]
    angle[frame, who] = np.arctan2(run.forward[inside, 1], run.forward[inside, 0])
    xy, angle = clip.smoothing.observed(xy, angle, clip.fps, rng)
    angle = angle[frame, who]
    return xy[frame, who], np.column_stack([np.cos(angle), np.sin(angle)])


def _of_view(view, fps, every):
    velocity = view.heading * view.speed[:, None]
    velocity[~np.isfinite(view.speed)] = np.nan
    return _looks(view.first, view.xy, view.heading, None, fps, every, 0.0, False, velocity, (view.weight, None))


# measures of looks ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Yard:
    """What measures of clip and runs have in common."""

    span: float  # s over which steps and turns are taken
    slow: float  # BL/s, below which an animal stands
    rings: np.ndarray  # BL, edges of the rings of `correlation length`
    single: bool


def span_of(clip: Evidence, looks) -> float:
    """s in which the animals of a clip usually go a body length, within `SPAN`; whole frames if these are longer."""
    speed = np.concatenate([np.hypot(*look.velocity.T) for look in looks])
    usual = float(np.nanmedian(speed)) if np.isfinite(speed).any() else 1.0
    longest = max(SPAN[0], min(SPAN[1], PART * len(clip.fields) / clip.fps))
    span = float(np.clip(1.0 / max(usual, 1e-3), SPAN[0], longest))
    return span if SPAN[0] * clip.fps >= 1.0 else max(1, round(span * clip.fps)) / clip.fps


def yard_of(looks, single, span=SPAN[0]) -> Yard:
    """From the looks at a clip."""
    speed = np.concatenate([np.hypot(*look.velocity.T) for look in looks])
    speed = speed[np.isfinite(speed)]
    fast = float(np.quantile(speed, 0.9)) if len(speed) else 0.0
    spreads = [_spread(look) for look in looks if len(look.xy)]
    spread = float(np.median(spreads)) if spreads else 1.0
    return Yard(span, max(STANDS * fast, SLOWEST), np.linspace(0.0, 2.0 * max(spread, 0.5), RINGS + 1), single)


def rows_of(look: ClipMoment, yard: Yard) -> dict[str, np.ndarray]:
    """What is kept of a moment, {measure: (d,)}: its mean over moments gives the measure (`value_of`)."""
    speed = np.hypot(*look.velocity.T)
    known = np.isfinite(speed)
    share = look.weight / max(look.weight.sum(), 1e-12)
    heads = look.heading.any(1)
    of_known = share * heads / max((share * heads).sum(), 1e-12)
    off = look.xy - share @ look.xy if len(look.xy) else look.xy
    radius = np.maximum(np.hypot(*off.T), 1e-12)
    round_and_round = (off[:, 0] * look.heading[:, 1] - off[:, 1] * look.heading[:, 0]) / radius
    some = len(look.xy) > 1
    moving = known & (speed > yard.slow)
    turn = look.turn[moving & np.isfinite(look.turn)]
    return {
        "polarization": np.array([np.hypot(*(of_known @ look.heading)) if heads.any() else np.nan]),
        "milling": np.array([abs(of_known @ round_and_round) if heads.any() else np.nan]),
        "nearest neighbour": _nearest(look) if some and yard.single else np.full(len(NEAREST_QUANTILES), np.nan),
        "speeds": _quantiles(speed[known], SPEED_QUANTILES, share[known]),
        "changes of speed": _quantiles(look.change[np.isfinite(look.change)], TURN_QUANTILES),
        "turning": _quantiles(turn, TURN_QUANTILES),
        "spread": np.array([_spread(look) if some else np.nan]),
        "correlation length": _correlation(look, known, yard.rings),
        "share standing": np.array([share[known] @ (speed[known] < yard.slow) / share[known].sum()])
        if known.any() else np.array([np.nan]),
    }  # fmt: skip


def _nearest(look):
    """Quantiles of the distances to the nearest neighbour."""
    return _quantiles(_to_nearest(np.asarray(look.xy, float)), NEAREST_QUANTILES, look.trust)


@njit(cache=True, nogil=True, error_model="numpy")
def _to_nearest(xy):
    """(n,) distance of each animal to the nearest other, by all pairs: a moment has too few animals for a tree."""
    n = len(xy)
    least = np.full(n, np.inf)
    for i in range(n):
        for j in range(i + 1, n):
            x, y = xy[i, 0] - xy[j, 0], xy[i, 1] - xy[j, 1]
            far = x * x + y * y
            least[i], least[j] = min(least[i], far), min(least[j], far)
    return np.sqrt(least)


def _spread(look):
    if not len(look.xy):
        return np.nan
    off = look.xy - np.average(look.xy, axis=0, weights=look.weight)
    return float(np.sqrt(np.average((off**2).sum(1), weights=look.weight)))


def _quantiles(values, shares, weight=None):
    if len(values) < 3:
        return np.full(len(shares), np.nan)
    if weight is None:
        return np.quantile(values, shares)
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weight[order]) / weight.sum()
    return values[order][np.minimum(np.searchsorted(reached, shares), len(values) - 1)]


def _correlation(look, known, rings):
    """(2 rings,) sums of products of velocity fluctuations by distance, and how many pairs they are of."""
    xy, velocity = look.xy[known], look.velocity[known]
    if len(xy) < 3:
        return np.full(2 * (len(rings) - 1), np.nan)
    return _products_by_distance(xy, velocity - velocity.mean(0), np.asarray(rings, float))


@njit(cache=True, nogil=True, error_model="numpy")
def _products_by_distance(xy, velocity, rings):
    """The correlation function of [2]_, not divided: sums over pairs, and pairs, in rings of equal width from 0 on."""
    n, count = len(xy), len(rings) - 1
    found, per_length = np.zeros(2 * count), count / rings[-1]
    for i in range(n):
        for j in range(i + 1, n):
            x, y = xy[i, 0] - xy[j, 0], xy[i, 1] - xy[j, 1]
            far = np.sqrt(x * x + y * y) * per_length
            k = int(far)
            if min(far - k, k + 1.0 - far) < 1e-9 * far:  # so near a ring's edge that rounding decides
                k = int(np.hypot(x, y) * per_length)
            if 0 <= k < count:
                found[k] += velocity[i, 0] * velocity[j, 0] + velocity[i, 1] * velocity[j, 1]
                found[count + k] += 1
    return found


def value_of(name, mean, yard) -> np.ndarray:
    """The measure of a herd, (1,) or its quantiles, from the mean of what moments keep."""
    if name != "correlation length":
        return mean
    sums, pairs = np.split(mean, 2)
    level = sums / np.maximum(pairs, 1e-9)
    middle = 0.5 * (yard.rings[1:] + yard.rings[:-1])
    below = np.flatnonzero((level <= 0) & (pairs > 0))
    if not len(below) or below[0] == 0:
        return np.array([yard.rings[1] if len(below) else middle[-1]])
    k = below[0]
    return np.array([middle[k - 1] + (middle[k] - middle[k - 1]) * level[k - 1] / max(level[k - 1] - level[k], 1e-12)])


@dataclass
class Series:
    """A herd over time: what moments keep, {measure: (moments, d)}, and how its spread grows, 1/s."""

    rows: dict[str, np.ndarray]
    yard: Yard
    growth: float = np.nan

    @classmethod
    def of(cls, looks, yard, seconds) -> Series:
        """From the looks at a herd without the first third; they span ``seconds``."""
        kept = [rows_of(look, yard) for look in looks]
        later = kept[int(SETTLED * len(kept)) :]
        rows = {name: np.array([row[name] for row in later]) for name in kept[0]} if kept else {}
        spread = np.array([row["spread"][0] for row in later])
        return cls(rows, yard, _growth(spread, (1 - SETTLED) * seconds))

    def value(self, name, chosen=slice(None)) -> np.ndarray:
        """The measure over some moments."""
        if name == "growth":
            return np.array([self.growth])
        rows = self.rows[name][chosen]
        rows = rows[np.isfinite(rows).all(1)]
        if len(rows) < 0.5 * len(self.rows[name][chosen]) or not len(rows):
            return np.full(1, np.nan)
        return value_of(name, rows.mean(0), self.yard)


def _growth(spread, seconds):
    """Rate at which the logarithm of the spread grows, 1/s, by a straight line."""
    good = np.isfinite(spread) & (spread > 0)
    if good.sum() < 4 or not seconds > 0:
        return np.nan
    t = np.linspace(0.0, seconds, len(spread))[good]
    return float(np.polyfit(t, np.log(spread[good]), 1)[0])


# limits ---------------------------------------------------------------------------------------------


@dataclass
class BatteryRow:
    """One measure of a clip and of runs."""

    name: str
    clip: float
    herd: float
    off: float
    limit: float
    by_chance: float = np.nan  # values of as many independent animals
    boot: float = 0.0  # standard error of the clip's value, by the bootstrap
    spreads_on: bool = False  # alone: alike only if the herd of the clip goes on spreading

    @property
    def far(self) -> float:
        """How many limits the runs are off."""
        return min(self.off / self.limit, FARTHEST) if np.isfinite(self.off) else FARTHEST

    @property
    def met(self) -> bool:
        """Whether they are alike."""
        return self.far <= 1.0


@dataclass
class Battery:
    """A clip, ready to be compared with runs that begin as it begins."""

    clip: Evidence
    every: int  # frames from look to look
    series: Series
    values: dict[str, np.ndarray]  # of the measures that the clip determines
    boot: dict[str, float]  # standard errors of the values
    chance: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, clip: Evidence) -> Battery:
        """Measure a clip."""
        every = max(1, len(clip.fields) // LOOKS)
        single = told_apart(clip)
        span = span_of(clip, looks_of(clip, every))
        looks = looks_of(clip, every, span)
        series = Series.of(looks, yard_of(looks, single, span), len(looks) * every / clip.fps)
        values = {name: series.value(name) for name in (*series.rows, "growth")}
        values = {name: value for name, value in values.items() if np.isfinite(value).all()}
        if not clip.fields.holds_all:  # the herd's own outline is not visible
            values = {n: v for n, v in values.items() if n not in ("spread", "growth", "correlation length")}
        boot = {name: _bootstrap(series, name, values[name]) for name in values}
        return cls(clip, every, series, values, boot, _by_chance(clip, looks, single))

    def measured(self, run: Run) -> dict[str, np.ndarray]:
        """The same of one run at the clip's frame rate, {measure: value}."""
        looks = looks_of_run(run, self.clip, self.every, span=self.series.yard.span)
        series = Series.of(looks, self.series.yard, len(looks) * self.every / self.clip.fps)
        return {name: series.value(name) for name in self.values}

    def compared(self, measured: list[dict[str, np.ndarray]]) -> list[BatteryRow]:
        """The clip and what was measured of some runs."""
        return [self._row(name, [one[name] for one in measured]) for name in self.values]

    def _row(self, name, herds):
        value, kind = self.values[name], MEASURES[name]
        herds = np.array([h if len(h) == len(value) else np.full(len(value), np.nan) for h in herds])
        mean = herds.mean(0)
        level = float(np.abs(value).mean())
        floor = max(kind.floor, kind.share * level)
        if name == "spread":  # headings that are a little off at the start carry animals apart
            floor += self.clip.heading_noise * float(np.abs(self.values.get("speeds", np.zeros(1))).mean())
        if name == "nearest neighbour":
            floor += FARTHER * share_lost(self.clip) * level
        if name in CHANCE:  # few disordered animals are polarized by chance, for as long as their headings persist
            floor = max(floor, WAVERS * self.chance[name] * (1.0 - level**2))
        if name == "correlation length":
            floor = max(floor, 1.5 * float(self.series.yard.rings[1]))
        between = float(herds.std(0, ddof=1).mean()) if len(herds) > 1 else 0.0
        between = min(between, max(2.0 * self.boot[name], floor))  # runs that go anywhere excuse nothing
        chance = np.hypot(self.boot[name], between * np.sqrt(1.0 + 1.0 / len(herds)))
        off = float(np.abs(mean - value).mean())
        return BatteryRow(
            name, float(value.mean()), float(mean.mean()), off, max(floor, DEVIATIONS * chance),
            self.chance.get(name, np.nan), self.boot[name],
        )  # fmt: skip


def _bootstrap(series, name, value):
    """Standard error of a value by resampling blocks of moments."""
    if name == "growth":
        return 0.0
    rng, n = np.random.default_rng(len(series.rows[name])), len(series.rows[name])
    size = max(1, -(-n // BLOCKS))
    values = []
    for _ in range(RESAMPLED):
        begins = rng.integers(0, max(1, n - size + 1), -(-n // size))
        chosen = (begins[:, None] + np.arange(size)).ravel()[:n]
        values.append(series.value(name, np.minimum(chosen, n - 1)))
    spread = [np.abs(v - value).mean() for v in values if len(v) == len(value) and np.isfinite(v).all()]
    return float(np.sqrt(np.mean(np.square(spread)))) if spread else 0.0


def _by_chance(clip, looks, single):
    """The measures of as many independent animals, where they are known in closed form."""
    count = float(np.nanmedian(clip.fields.count))
    found = {name: float(np.sqrt(of_one / max(count, 1.0))) for name, of_one in CHANCE.items()}
    spread = np.nanmedian([_spread(look) for look in looks]) if looks else np.nan
    if single and np.isfinite(spread) and count > 1:  # on a disc of the same extent
        of_one = np.sqrt(-np.log1p(-np.array(NEAREST_QUANTILES)) / np.pi).mean()
        found["nearest neighbour"] = float(of_one * np.sqrt(2 * np.pi * spread**2 / count))
    return found
