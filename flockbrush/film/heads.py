"""Which end of a standing animal is its head, learned from the looks of walking animals.

The motion of a walking animal shows which end is the front. Features of both ends (`Bodies.ends`) are compared over
these animals by Fisher's linear discriminant [1]_. If it finds the heads of walking animals that were left out of the
fit, it is applied to standing animals. Light from one side also makes the ends differ, depending on their direction;
this effect is fitted at the same time and subtracted.

References
----------
.. [1] Fisher, R. A. (1936). The use of multiple measurements in taxonomic problems. Annals of Eugenics 7(2), 179-188.
"""

from __future__ import annotations

import numpy as np

WALKERS = 8  # animals that are needed, and groups of them that are left out in turn
SURE = (0.6, 8, 0.0), (0.3, 4, 1.0)  # BL gone, in how many sights of an animal, within so many s to each side of them
NEAR = 3  # sights to each side, at least
FIRM = 6.0  # times the noise of a place, that a walker must go at least
TOLD = 0.8  # share of animals left out whose heads are found, below which nothing is told
ONE_WAY = 0.95  # length of the mean heading; of a herd that is more of one mind light and heads are not to be parted
SHRINK = 0.5  # share of a round shape in the scatter of what ends look like
LIGHT = 1.0  # of the walkers: what holds the effect of light back where headings hardly say


def by_looks(ends, axis, forward, at, begin, noise, fps):
    """Log odds that the axis of each body points to its head rather than to its tail.

    Parameters
    ----------
    ends : (k, m) ndarray
        Features of the ends of the bodies (`Bodies.ends`), for tracks stored one after the other.
    axis, forward : (k, 2) ndarray
        Unit vectors along the body, and of the heading by its motion.
    at : (k, 2) ndarray
        Positions, BL.
    begin : (tracks + 1,) ndarray
        First row of each track, and the number of rows.
    noise : float
        Standard deviation of a position, BL.
    fps : float

    Returns
    -------
    (k,) ndarray
        0 everywhere if fewer than `WALKERS` animals walk, if all head the same way, or if the heads of less than `TOLD`
        of the animals left out are found.
    """
    unknown = np.zeros(len(ends))
    track = np.repeat(np.arange(len(begin) - 1), np.diff(begin))
    sure = _walkers(at, forward, track, begin, noise, fps)
    if not ends.shape[1] or sure is None:
        return unknown
    who = np.unique(track[sure], return_inverse=True)[1]
    single = np.sign((axis[sure] * forward[sure]).sum(1))[:, None] * ends[sure]
    looks, facing = _means(single, who), _means(forward[sure], who)
    if np.hypot(*facing.mean(0)) > ONE_WAY:
        return unknown
    scores = np.empty(len(who))
    for g in range(WALKERS):
        mine = who % WALKERS == g
        others = np.arange(len(looks)) % WALKERS != g
        weight, light = _learned(looks[others], facing[others])
        scores[mine] = (single[mine] - forward[sure][mine] @ light) @ weight
    animals = _means(scores[:, None], who)[:, 0]
    if (animals > 0).mean() < TOLD:
        return unknown
    weight, light = _learned(looks, facing)
    usual = np.median(animals)
    between, within = _usual_square(animals - usual), _usual_square(scores - animals[who])
    likelier = 2 * usual * ((ends - axis @ light) @ weight) / (between + within + 1e-12)
    right = (animals > 0).sum()
    most = np.log((right + 1) / (len(animals) - right + 1))  # as sure as it was of those left out
    return np.clip(likelier, -most, most)


def _walkers(at, forward, track, begin, noise, fps):
    """Sightings (k,) bool of walking animals, by the strictest criterion that enough animals meet; else None."""
    row = np.arange(len(at))
    for far, times, seconds in SURE:
        near = max(NEAR, round(seconds * fps))
        first, last = np.maximum(row - near, begin[track]), np.minimum(row + near, begin[track + 1] - 1)
        distance = ((at[last] - at[first]) * forward).sum(1)
        sure = distance > max(far, FIRM * noise)
        often = np.bincount(track[sure], minlength=len(begin) - 1) >= times
        if often.sum() >= WALKERS:
            return sure & often[track]
    return None


def _usual_square(values):
    """Robust variance, from the median absolute deviation: some tracks mix two animals."""
    return float(1.4826 * np.median(np.abs(values))) ** 2


def _means(values, who):
    """Means of the rows of each animal, (animals, columns); `who` numbers the animals from 0."""
    count = np.bincount(who)
    return np.column_stack([np.bincount(who, column) for column in values.T]) / count[:, None]


def _learned(looks, facing):
    """Discriminant weights (m,) and effect of light (2, m), from features and headings, one row per animal."""
    known = np.column_stack([np.ones(len(looks)), facing])
    hold = np.diag([0.0, 1.0, 1.0]) * LIGHT * len(looks)
    effect = np.linalg.solve(known.T @ known + hold, known.T @ looks)
    rest = looks - known @ effect
    scatter = rest.T @ rest / max(len(looks) - 3, 1)
    round_one = np.trace(scatter) / len(scatter) * np.eye(len(scatter))
    weight = np.linalg.solve((1 - SHRINK) * scatter + SHRINK * round_one + 1e-9 * np.eye(len(scatter)), effect[0])
    return weight, effect[1:]
