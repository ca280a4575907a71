"""Distance of a simulated herd from a clip: the same measures of both, taken in the same way.

A `HerdView` is what can be seen of a herd in each frame: points with a heading and a weight. If the animals of a clip
can be told apart, the points are the animals, else the cells of its fields. A simulated herd is viewed through the same
window and, if the clip has only fields, on the same grid. Both thus lose the same information.

A distance is given in standard deviations of the clip over its frames, which are at least .05 for measures between 0
and 1, and a twentieth of the mean for lengths and speeds. 0 is the same herd; about 1 is a herd as different as two
moments of the clip.

References
----------
.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Section 7.1.2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from flockbrush.engine.maths import atan2_
from flockbrush.film.observations import Evidence, Fields
from flockbrush.film.pair_density import mean_pairs, pairs_of_bodies, pairs_off
from flockbrush.learning.axis_variance import variance_of_run, variance_told
from flockbrush.learning.herd_views import HerdView, in_picture, told_apart, view_of, view_of_run
from flockbrush.learning.rollout import Run

FLOOR = 0.05  # of a share; and of a length or speed, so many times its mean
LINK = 4.0  # BL: animals nearer than this belong together
NEAR = 2.0  # BL within which headings are compared
REACH = 4.0  # BL of the map of neighbours
COARSE = 10  # cells along a side on which fields are compared (section 7.1.2 of [1])
LOOKS = 48  # at a herd that runs on
FARTHEST = 10.0  # deviations: a herd that is farther off is just as wrong

SHARES = ("polarization", "milling", "milling in the picture", "order nearby", "largest part")
LENGTHS = ("aspect", "spread", "density", "nearest neighbour", "speed")
MEASURES = SHARES + LENGTHS
LYING, LEAST_LYING = 0.2, 2.0  # of the logarithm of the variance of directions in a photograph; degrees² it is told to
# weights; 1 for the others
COUNTS = {
    "directions": 3.0,
    "polarization": 3.0,
    "milling": 3.0,
    "nearest neighbour": 2.0,
    "spacing": 6.0,
    "pairs": 6.0,
}
CHANCE = {"polarization": 1.0, "milling": 0.5}  # mean square of n strangers, times n
SPACING = 0.05  # of the deciles of the distances to the nearest neighbour of a photograph
KNOWN = 0.5  # of its moments a measure must be told in to count
# what should last, and by how much true models are off in the long run from what a clip of some seconds comes to, by
# trial on 16 clips: a share, or so many times a length
LASTING = {
    "polarization": 0.1, "milling": 0.1, "order nearby": 0.1, "nearest neighbour": 0.1, "density": 0.2, "spread": 0.15,
}  # fmt: skip


# measures of a frame -------------------------------------------------------------------------------


def measures_of(view: HerdView, every=1) -> dict[str, np.ndarray]:
    """The measures of a herd over time.

    ``polarization`` and ``milling`` are eqs. 12 and 13 of [1]_, about the centroid, or about the middle of the picture;
    ``aspect`` is the extent across the common heading divided by that along it; ``spread`` the root mean square
    distance to the centroid (BL); ``density`` the mean local density (1/BL²); ``order nearby`` the mean cosine between
    headings within two body lengths; ``largest part`` the share of the largest connected group; ``nearest neighbour``
    in BL, ``speed`` in BL/s.

    Parameters
    ----------
    view : HerdView
    every : int
        Use every n-th frame.

    Returns
    -------
    dict of str to (frames,) ndarray
        NaN where a measure is undefined.
    """
    rows = [_measures(view, view.of(t)) for t in range(0, len(view), every)]
    return {name: np.array([row[name] for row in rows]) for name in MEASURES}


def _measures(view, rows):
    xy, heading, weight, speed = view.xy[rows], view.heading[rows], view.weight[rows], view.speed[rows]
    total = weight.sum()
    if not total > 0:
        return dict.fromkeys(MEASURES, np.nan)
    share = weight / total
    known = heading.any(1)
    of_known = share * known / max((share * known).sum(), 1e-12)
    mean = of_known @ heading
    centre = share @ xy
    nearest, order, part = _neighbours(xy, heading, share, known, view, view.trust[rows])
    fine = np.isfinite(speed)
    return {
        "polarization": float(np.hypot(*mean)) if known.any() else np.nan,
        "milling": _turning(xy - centre, heading, of_known) if known.any() else np.nan,
        "milling in the picture": _turning(xy - view.middle, heading, of_known) if known.any() else np.nan,
        "order nearby": order,
        "largest part": part,
        "aspect": _aspect(xy - centre, mean, share),
        "spread": float(np.sqrt(share @ ((xy - centre) ** 2).sum(1))),
        "density": _crowding(view, xy, weight, view.trust[rows]),
        "nearest neighbour": nearest,
        "speed": float(share[fine] @ speed[fine] / share[fine].sum()) if fine.any() else np.nan,
    }


def _turning(offset, heading, share):
    radius = np.maximum(np.hypot(*offset.T), 1e-12)
    return float(abs(share @ ((offset[:, 0] * heading[:, 1] - offset[:, 1] * heading[:, 0]) / radius)))


def _aspect(offset, mean, share):
    """Extent across divided by extent along the mean heading, without the outer 1 % on each side; NaN without order."""
    size = np.hypot(*mean)
    if size < 0.2 or len(offset) < 5:
        return np.nan
    along = offset @ (mean / size)
    across = offset @ np.array([-mean[1], mean[0]]) / size
    length = _extent(along, share)
    return float(_extent(across, share) / length) if length > 0 else np.nan


def _extent(values, share):
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(share[order])
    low, high = np.searchsorted(reached, [0.01, 0.99])
    return float(values[order[min(high, len(order) - 1)]] - values[order[low]])


def _crowding(view, xy, weight, trust):
    """Mean density around an animal, 1/BL², on cells of at least two BL."""
    side = 2.0 if view.single else max(1, round(2.0 / view.cell)) * view.cell
    at = np.floor((xy - view.middle) / side).astype(np.int64)
    at -= at.min(0)
    cell = at[:, 0] * (at[:, 1].max() + 1) + at[:, 1]
    number, trusted = np.bincount(cell, weight), np.bincount(cell, weight * trust)
    return float((number * trusted).sum() / trusted.sum() / side**2)


def _neighbours(xy, heading, share, known, view, trust):
    """Mean distance to the nearest neighbour (BL), order nearby, and the share of the largest part."""
    reach, link = (NEAR, LINK) if view.single else (1.5 * view.cell, max(LINK, 1.5 * view.cell))
    if len(xy) < 2:
        return np.nan, np.nan, 1.0
    nearest, order, part = _neighbour_kernel(np.ascontiguousarray(xy), heading, share, known, trust, reach, link)
    return nearest if view.single else np.nan, order, part


@njit(cache=True, nogil=True, error_model="numpy")
def _neighbour_kernel(xy, heading, share, known, trust, reach, link):
    """The same for all pairs: groups are joined by links (union-find), `reach` and `link` are in BL."""
    n = len(xy)
    least, root = np.full(n, np.inf), np.arange(n)
    agree, weight = 0.0, 0.0
    for i in range(n):
        for j in range(i + 1, n):
            x, y = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            far = x * x + y * y
            least[i], least[j] = min(least[i], far), min(least[j], far)
            if far <= reach * reach and known[i] and known[j]:
                both = share[i] * share[j]
                weight += both
                agree += both * (heading[i, 0] * heading[j, 0] + heading[i, 1] * heading[j, 1])
            if far <= link * link:
                a, b = i, j
                while root[a] != a:
                    root[a] = root[root[a]]
                    a = root[a]
                while root[b] != b:
                    root[b] = root[root[b]]
                    b = root[b]
                root[max(a, b)] = min(a, b)
    parts = np.zeros(n)
    for i in range(n):
        a = i
        while root[a] != a:
            a = root[a]
        parts[a] += share[i]
    return (trust * np.sqrt(least)).sum() / trust.sum(), agree / weight if weight > 0.0 else np.nan, parts.max()


def neighbour_map(view: HerdView, reach=REACH, rings=8, sectors=8, every=4):
    """Animals per BL² around an animal by distance and bearing, (rings, sectors): the histogram of section 7.1.2 of
    [1]_.

    Row 0 is nearest, column 0 ahead, the last column behind; left and right are added. `reach` is the largest
    distance, BL. Of fields the cells are counted, weighted by their number of animals. Every `every`-th frame is used.
    """
    number, animals = np.zeros((rings, sectors)), 0.0
    for t in range(0, len(view), every):
        rows = view.of(t)
        weight, counts = view.weight[rows], view.weight[rows] * view.trust[rows]
        _count_neighbours(view.xy[rows], view.heading[rows], weight, counts, reach, number)
        animals += counts.sum()
    radius = np.linspace(0, reach, rings + 1)
    area = np.pi * (radius[1:] ** 2 - radius[:-1] ** 2) / sectors
    return number / max(animals, 1e-12) / area[:, None]


@njit(cache=True, nogil=True, error_model="numpy")
def _count_neighbours(xy, heading, weight, counts, reach, number):
    """Add each pair within reach to `number` (rings, sectors), once from the view of each animal."""
    rings, sectors = number.shape
    for i in range(len(xy)):
        for j in range(i + 1, len(xy)):
            x, y = xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1]
            far = np.sqrt(x * x + y * y)
            if far > reach:
                continue
            ring = min(int(far / reach * rings), rings - 1)
            number[ring, _sector(heading[i, 0], heading[i, 1], x, y, sectors)] += counts[i] * weight[j]
            number[ring, _sector(heading[j, 0], heading[j, 1], -x, -y, sectors)] += counts[j] * weight[i]


@njit(cache=True, nogil=True, error_model="numpy")
def _sector(forward_x, forward_y, x, y, sectors):
    """The sector of the bearing of (x, y), 0 to π on either side."""
    bearing = atan2_(abs(forward_x * y - forward_y * x), forward_x * x + forward_y * y)
    return min(int(bearing / np.pi * sectors), sectors - 1)


def map_error(a, b):
    """Weighted difference of two neighbour maps, by the area of the rings: 0 the same, 1 nothing in common."""
    area = 2.0 * np.arange(len(a))[:, None] + 1.0
    return float((area * np.abs(a - b)).sum() / max((area * (a + b)).sum(), 1e-12))


# errors of fields ----------------------------------------------------------------------------------


def density_errors(simulated: Fields, target: Fields):
    """ε_D of section 7.1.2 of [1]_ and a symmetric density error of `Fields`, on `COARSE` x `COARSE` cells.

    Returns ``density error`` (relative; NaN in frames without animals) and ``symmetric density error`` (0 to 1, the
    share of animals in the wrong cell), (T,) each.
    """
    a, b = _coarse(simulated, target), _coarse(target, target)
    asymmetric, symmetric = [], []
    for mine, theirs in zip(a, b, strict=False):
        there = mine > 0
        off = np.abs(theirs - mine)
        asymmetric.append(float((off[there] / (theirs[there] + 0.1)).mean()) if there.any() else np.nan)
        symmetric.append(float(off.sum() / max((mine + theirs).sum(), 1e-12)))
    return {"density error": np.array(asymmetric), "symmetric density error": np.array(symmetric)}


def _coarse(fields, like):
    """Animals per BL², (T, COARSE, COARSE), on a grid over `like`; animals beyond are counted at its border."""
    ny, nx = like.shape
    side = max(nx, ny) * like.cell / COARSE
    out = np.zeros((len(fields), COARSE, COARSE))
    at = np.floor((fields.centres - np.asarray(like.origin, float)) / side).astype(int)
    at = np.clip(at, 0, COARSE - 1)
    number = np.nan_to_num(fields.density) * fields.cell**2
    for t, frame in enumerate(number):
        np.add.at(out[t], (at[..., 1], at[..., 0]), frame)
    return out / side**2


def velocity_errors(run: Run, target: Fields):
    """ε_V of section 7.1.2 of [1]_, (T,): mean |unit heading - unit velocity of the clip|, 0 to 2.

    Over animals in cells where the clip shows motion; NaN in frames without any.
    """
    out = np.full(min(len(run), len(target)), np.nan)
    for t in range(len(out)):
        rows = run.of(t)
        row, column, inside = target.cells_of(run.xy[rows])
        theirs = target.velocity[t, row, column]
        size = np.hypot(*theirs.T)
        there = inside & np.isfinite(size) & (size > 1e-9)
        if there.any():
            off = run.forward[rows][there] - theirs[there] / size[there, None]
            out[t] = np.hypot(*off.T).mean()
    return out


# scores --------------------------------------------------------------------------------------------


@dataclass
class ClipTarget:
    """The measures of a clip, with which simulated herds are compared."""

    over_time: dict[str, np.ndarray]  # (frames looked at,)
    mean: dict[str, float]
    scale: dict[str, float]  # one standard deviation of the clip, or the floor
    map: np.ndarray
    every: int  # frames from look to look
    single: bool
    end: dict[str, float]  # what should last; where a measure still changes, what it comes to
    end_scale: dict[str, float]  # and how far from there it may well go
    directions: float = np.nan  # degrees², of a photograph, where order is not to be seen by motion
    # (9,) BL, deciles of the distances to the nearest neighbour in a photograph; NaN of a film
    spacing: np.ndarray = field(default_factory=lambda: np.full(9, np.nan))
    headed: bool = True  # whether headings are known
    trend: dict[str, float] = field(default_factory=dict)  # of fields alone: -1 to 1, falling or rising without a doubt
    pairs: np.ndarray | None = None  # (RINGS,) of a film of animals that cannot be told apart, means over its frames
    pairs_end: np.ndarray | None = None  # what they come to, as `end`
    pairs_scale: float = FLOOR  # mean of what its frames are off their mean

    @classmethod
    def of(cls, evidence: Evidence, every=None, single=None):
        """The measures of a clip, at about forty frames or every `every`-th; `single`: of tracked animals."""
        single = told_apart(evidence) if single is None else single
        every = max(1, len(evidence.fields) // 40) if every is None else every
        view = view_of(evidence, single)
        over_time = measures_of(view, every)
        mean = {name: _mean(values) for name, values in over_time.items()}
        for name, values in over_time.items():
            if np.isfinite(values).mean() < KNOWN:  # of a few moments that happen to be told nothing follows
                mean[name] = np.nan
        scale = {name: max(_deviation(values), _floor(name, mean[name])) for name, values in over_time.items()}
        if evidence.fields.holds_all:
            mean["milling in the picture"] = np.nan
        else:  # the herd's own outline is not to be seen
            for name in ("aspect", "spread"):
                mean[name] = np.nan
        around, headed = neighbour_map(view), evidence.fields.tells_motion
        later = {name: off if name in SHARES else off * mean[name] for name, off in LASTING.items()}
        if not (single and headed):  # fields tell a trend instead, and a photograph nothing of what changes
            later = dict.fromkeys(later, 0.0)
        ends = {name: _in_the_end(over_time[name], mean[name], scale[name], later[name]) for name in LASTING}
        end, end_scale, trend = ({name: told[k] for name, told in ends.items()} for k in (0, 1, 2))
        spacing = spacings([view.xy[view.of(0)]] if single and not headed else [])
        directions = _directions(evidence)
        trend = dict.fromkeys(trend, 0.0) if single else trend
        told = over_time, mean, scale, around, every, single, end, end_scale, directions, spacing, headed, trend
        if single or evidence.fields.pairs is None:
            return cls(*told)
        pairs = np.asarray(evidence.fields.pairs)[::every]
        usual, third = mean_pairs(pairs), max(1, len(pairs) // 3)
        apart = max(float(np.mean([pairs_off(row, usual) for row in pairs])), FLOOR)
        first, last = mean_pairs(pairs[:third]), mean_pairs(pairs[-third:])
        share = pairs_off(first, last) ** 2 / (pairs_off(first, last) ** 2 + apart**2)
        return cls(*told, usual, usual + share * (last - usual), apart)


def _in_the_end(values, mean, scale, later):
    """The final value of a measure, its standard deviation and its trend: the mean, or the last value in a trend.

    A herd that is still gaining order is unlikely to keep the order it had before.  ``later``: a standard deviation of
    what comes after the clip.
    """
    third = max(1, len(values) // 3)
    first, last = _mean(values[:third]), _mean(values[-third:])
    change = last - first
    if not np.isfinite(change):
        return mean, float(np.hypot(scale, later)), 0.0
    share = change**2 / (change**2 + scale**2)
    off = float(np.sqrt(scale**2 + later**2 + (share * change) ** 2))
    return mean + share * (last - mean), off, float(share * np.sign(change))


def spacings(looks) -> np.ndarray:
    """Deciles (9,) of the distance to the nearest neighbour, BL, over moments of (n, 2) BL; NaN without animals."""
    far = [cKDTree(xy).query(xy, k=2)[0][:, 1] for xy in looks if len(xy) > 1]
    return np.quantile(np.concatenate(far), np.arange(1, 10) / 10) if far else np.full(9, np.nan)


def _directions(evidence):
    """Variance of directions in a photograph, degrees²; NaN for a video, whose motion shows more."""
    fields = evidence.fields
    if fields.tells_motion or not np.isfinite(fields.angular_variance).any():
        return np.nan
    return variance_told(evidence)


def _mean(values):
    return float(np.nanmean(values)) if np.isfinite(values).any() else np.nan


def _deviation(values):
    return float(np.nanstd(values)) if np.isfinite(values).any() else 0.0


def _floor(name, mean):
    return FLOOR if name in SHARES else max(FLOOR * abs(np.nan_to_num(mean)), 1e-3)


def distance(run: Run, evidence: Evidence, target: ClipTarget, lasting=False) -> dict[str, float]:
    """Distance of a run from a clip, by measure, in standard deviations; the run starts as the first frame of the clip.

    Parameters
    ----------
    run : Run
    evidence : Evidence
    target : ClipTarget
    lasting : bool
        The run is longer than the clip: compare the means over its last two thirds with the final values of the clip,
        for the measures in `LASTING`.

    Returns
    -------
    dict of str to float
        At most `FARTHEST` each; measures that the clip does not show are left out.
    """
    view = view_of_run(run, evidence, target.single)
    every = max(1, len(run) // LOOKS) if lasting else target.every
    seen, out = measures_of(view, every), {}
    for name in LASTING if lasting else MEASURES:
        if np.isfinite(target.mean[name]):
            out[name] = _off_in_the_end(seen[name], target, name) if lasting else _off(seen[name], target, name)
    if np.isfinite(target.directions):
        moments = range(len(run) // 3, len(run), max(1, len(run) // 8))
        lie = _mean(variance_of_run(run, evidence.fields, moments))
        off = abs(np.log((lie + LEAST_LYING) / (target.directions + LEAST_LYING)))
        out["directions"] = float(np.nan_to_num(min(off / LYING, FARTHEST), nan=FARTHEST))
    if np.isfinite(target.spacing).all():
        looks = [view.xy[view.of(t)] for t in range(len(run) // 3, len(run), max(1, len(run) // 8))]
        off = np.log(np.maximum(spacings(looks), 1e-3) / np.maximum(target.spacing, 1e-3))
        out["spacing"] = float(np.nan_to_num(min(np.sqrt(np.mean(off**2)) / SPACING, FARTHEST), nan=FARTHEST))
    if target.pairs is not None:
        inside = in_picture(run, evidence.fields)
        looks = [np.flatnonzero(inside[run.of(t)]) + run.first[t] for t in range(0, len(run), every)]
        pairs = [pairs_of_bodies(run.xy[r], run.forward[r], evidence.radius_bl) for r in looks]
        mean = mean_pairs(pairs[len(pairs) // 3 :] if lasting else pairs)
        out["pairs"] = _in_deviations(
            pairs_off(mean, target.pairs_end if lasting else target.pairs), target.pairs_scale
        )
    around, theirs = neighbour_map(view, every=max(4, len(run) // LOOKS)), target.map
    if not target.headed:  # then only how far neighbours are is known, and not where
        around, theirs = around.mean(1, keepdims=True), theirs.mean(1, keepdims=True)
    out["neighbours"] = min(map_error(around, theirs) / (2 * FLOOR), FARTHEST)
    return out


def order_off(run: Run, evidence: Evidence, target: ClipTarget) -> dict[str, float]:
    """Distance of polarization and milling of a longer run from those of a clip, in standard deviations.

    It does not depend on the number of animals: a few with random headings are more polarized than many. The expected
    value of random headings is removed from both, and the standard deviation is at least the one due to chance.
    """
    seen, out = measures_of(view_of_run(run, evidence, target.single)), {}
    for name, of_one in CHANCE.items():
        mine, theirs, animals = _mean(seen[name][len(run) // 3 :]), target.end[name], len(run.xy) / len(run)
        if np.isfinite(theirs):
            mine = beyond_chance(mine, animals, of_one)
            theirs = beyond_chance(theirs, float(np.nanmean(evidence.fields.count)), of_one)
            by_chance = 0.5 * np.sqrt(of_one / max(animals, 1.0))
            gap = _short_of(mine - theirs, target, name)
            out[name] = min(gap / max(target.end_scale[name], by_chance), FARTHEST)
    return out


def beyond_chance(share, animals, of_one):
    """Polarization or milling (0 to 1) without the part expected of so many animals with random headings."""
    chance = of_one / max(animals, 2.0)
    return float(np.sqrt(max(share**2 - chance, 0.0) / (1.0 - chance)))


def _off(mine, target, name):
    """Half the mean difference frame by frame and half the difference of means, in standard deviations."""
    theirs = target.over_time[name]
    k = min(len(mine), len(theirs))
    both = np.isfinite(mine[:k]) & np.isfinite(theirs[:k])
    each = np.abs(mine[:k] - theirs[:k])[both].mean() if both.any() else np.inf
    return _in_deviations(0.5 * each + 0.5 * abs(_mean(mine[:k]) - _mean(theirs[:k])), target.scale[name])


def _off_in_the_end(mine, target, name):
    gap = _short_of(_mean(mine[len(mine) // 3 :]) - target.end[name], target, name)
    return _in_deviations(gap, target.end_scale[name])


def _short_of(gap, target, name):
    """How far a measure is from its final value; less where it goes on as it did at the end of the clip."""
    return abs(gap) * (1.0 - max(0.0, np.sign(gap) * target.trend.get(name, 0.0)))


def _in_deviations(gap, scale):
    return float(np.nan_to_num(min(gap / scale, FARTHEST), nan=FARTHEST))


def total(parts: dict[str, float]) -> float:
    """Weighted root mean square of the parts of a distance, with the weights `COUNTS`; infinite without parts."""
    if not parts:
        return np.inf
    weights = [COUNTS.get(name.removeprefix("lasting "), 1.0) for name in parts]
    return float(np.sqrt(np.average(np.square(list(parts.values())), weights=weights)))
