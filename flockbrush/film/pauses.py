"""Standing and walking: two states of the speed, if a clip shows them, and the rates of change between them.

An animal that walks stops at a rate, and one that stands starts at another; both rates grow with the share of the
neighbours that are already in the other state [1]_.  The rates are those of maximum likelihood: changes over the
time in which they could have happened, weighed by the imitation.

References
----------
.. [1] Ginelli, F. et al. (2015). Intermittent collective dynamics emerge from conflicting imperatives in sheep herds.
   PNAS 112, 12729-12734.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from flockbrush.systems.pace import COMPANY

SHARES = 0.08, 0.95  # of the sights that stand: outside there is one state
VALLEY = 0.6  # of the lower of the two peaks: a deeper valley separates two states
APART = 0.35  # of the speed of those that walk: the others stand if they are slower
FEWEST = 12  # changes that are needed
SHORT = 0.16  # s: shorter states are errors of sighting
BINS = 24
IMITATIONS = 0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0
CLEARLY = 2.0  # of the logarithm of the likelihood, that imitation must explain


@dataclass(frozen=True)
class Pauses:
    """Two states of the speed."""

    slow: float  # BL/s, below which an animal stands
    # stops, starts: 1/s, of an animal without company in the other state
    stops: float
    starts: float
    imitation: float  # factor by which it is likelier if all neighbours do it already
    standing: float  # share of the sights
    changes: int  # that it is estimated from


def limits_of(sightings) -> list[float]:
    """BL/s between the states of the speed: none where speeds are of one kind, and one or two valleys else."""
    speed = sightings.speed[np.isfinite(sightings.speed) & (sightings.track >= 0)]
    limits: list[float] = []
    while len(limits) < 2 and (limit := _valley(speed)) is not None:
        limits.append(limit)
        speed = speed[speed >= limit]
    return limits


def states_of(sightings, fps, limits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((m,) state of each sight, 0 the slowest, -1 unknown; rows before and after a frame, of the same animal)."""
    states, who = _states(sightings, limits, max(1, round(SHORT * fps)))
    before, after = _pairs(sightings, who)
    known = (states[before] >= 0) & (states[after] >= 0)
    return states, before[known], after[known]


def pauses_of(sightings, fps) -> Pauses | None:
    """The two states of a clip's animals; None if its speeds are of one kind, or change too seldom."""
    limits = limits_of(sightings)
    if not limits:
        return None
    slow = limits[0]
    walks, before, after = states_of(sightings, fps, [slow])
    share = _company(sightings, walks)
    changed = walks[before] != walks[after]
    if changed.sum() < FEWEST:
        return None
    fits = [_fitted(walks[before], share[before], changed, fps, imitation) for imitation in IMITATIONS]
    best = max(range(len(fits)), key=lambda k: fits[k][0])
    best = best if fits[best][0] > fits[0][0] + CLEARLY else 0
    _, stops, starts = fits[best]
    if not (stops > 0 and starts > 0):
        return None
    standing = float((walks[walks >= 0] == 0).mean())
    return Pauses(slow, stops, starts, IMITATIONS[best], standing, int(changed.sum()))


def _valley(speed):
    """BL/s between two peaks of the speeds; None where there is one."""
    if len(speed) < 200:
        return None
    top = float(np.quantile(speed, 0.98))
    if not top > 0:
        return None
    count = np.histogram(np.minimum(speed, top), BINS, (0.0, top))[0].astype(float)
    count = np.convolve(np.pad(count, 1, mode="edge"), [0.25, 0.5, 0.25], "valid")
    valley = None
    for k in range(1, BINS // 2 + 2):
        low, high = count[:k].max(), count[k + 1 :].max()
        if count[k] < VALLEY * min(low, high) and (valley is None or count[k] < count[valley]):
            valley = k
    if valley is None:
        return None
    slow = (valley + 0.5) * top / BINS
    stands = speed < slow
    if not SHARES[0] < stands.mean() < SHARES[1]:
        return None
    return slow if np.median(speed[stands]) < APART * np.median(speed[~stands]) else None


def _states(sightings, limits, least):
    """((m,) 0 stands, 1 walks and so on, -1 unknown; rows of each track in order)."""
    walks = np.where(np.isfinite(sightings.speed), np.searchsorted(limits, sightings.speed, "right"), -1)
    order = np.lexsort((sightings.frame, sightings.track))
    order = order[sightings.track[order] >= 0]
    begins = np.flatnonzero(np.diff(sightings.track[order])) + 1
    for rows in np.split(order, begins):
        state = walks[rows]
        edges = np.r_[0, np.flatnonzero(np.diff(state)) + 1, len(state)]
        for a, b in zip(edges[1:-2], edges[2:-1], strict=True):  # within the track: its ends are cut off by the clip
            if b - a < least:
                state[a:b] = state[a - 1]
        walks[rows] = state
    return walks, order


def _company(sightings, walks):
    """(m,) share of the neighbours that walk; NaN without neighbours."""
    share = np.full(len(walks), np.nan)
    for t in range(len(sightings)):
        rows = np.arange(sightings.first[t], sightings.first[t + 1])
        if len(rows) < 2:
            continue
        for k, near in enumerate(cKDTree(sightings.xy[rows]).query_ball_point(sightings.xy[rows], COMPANY)):
            others = walks[rows[[j for j in near if j != k]]]
            others = others[others >= 0]
            if len(others):
                share[rows[k]] = others.mean()
    return share


def _pairs(sightings, order):
    """Rows of the same animal in neighbouring frames."""
    track, frame = sightings.track[order], sightings.frame[order]
    follows = (np.diff(track) == 0) & (np.diff(frame) == 1)
    return order[:-1][follows], order[1:][follows]


def _fitted(state, share, changed, fps, imitation):
    """(log likelihood, stops, starts) for a given imitation."""
    total, rates = 0.0, []
    for now in (1, 0):
        mine = state == now
        alike = np.nan_to_num(1.0 - share[mine] if now else share[mine])
        weight = 1.0 + imitation * alike
        events, exposure = changed[mine].sum(), weight.sum() / fps
        rate = float(events / exposure) if exposure > 0 else 0.0
        rates.append(rate)
        if rate > 0:
            total += float(np.log(rate * weight[changed[mine]]).sum() - rate * exposure)
    return total, rates[0], rates[1]
