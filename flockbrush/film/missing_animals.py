"""Estimated positions of animals missing from tracks, and the share of seen neighbours of each present animal.

Between two sights an animal is taken to go straight.  Before its first sight and after its last it is taken to go on as
it went, for a short time: after that nobody knows.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

NEAREST = 8  # neighbours, seen or missing, that an animal is assumed to respond to
ONWARDS = 2.0  # s before the first and after the last sight
STEPS = 8  # frames by which the velocity of the first and the last sight is measured
MOST_SEEN = 0.95  # quantile of the numbers of animals in frames that is taken for all of a herd
UNSEEN = 0.1  # share of neighbours missing at which an animal counts half.  By trial: tests/behaviours/learning


def missing_places(xy, there, fps: float) -> np.ndarray:
    """(T, A, 2) estimated positions of animals in frames in which they are missing; NaN where they are not missing.

    Parameters
    ----------
    xy : (T, A, 2) ndarray
        Places in a file, NaN where an animal has none.
    there : (T, A) bool ndarray
        Whether the animal is present, or its gap was filled.
    """
    out = np.full(xy.shape, np.nan)
    far, frames = round(ONWARDS * fps), np.arange(len(xy))
    for animal in range(xy.shape[1]):
        rows = np.flatnonzero(np.isfinite(xy[:, animal]).all(-1))
        if not len(rows):
            continue
        places = xy[rows, animal]
        for c in range(2):
            out[:, animal, c] = np.interp(frames, rows, places[:, c])
        k = min(STEPS, len(rows) - 1)
        before, after = frames[: rows[0]], frames[rows[-1] + 1 :]
        if k:
            first = (places[k] - places[0]) / (rows[k] - rows[0])
            last = (places[-1] - places[-1 - k]) / (rows[-1] - rows[-1 - k])
            out[before, animal] = places[0] + (before - rows[0])[:, None] * first
            out[after, animal] = places[-1] + (after - rows[-1])[:, None] * last
        out[before[before < rows[0] - far], animal] = np.nan
        out[after[after > rows[-1] + far], animal] = np.nan
    out[there] = np.nan
    return out


def neighbours_seen(xy, missing) -> np.ndarray:
    """(T, P) share of the `NEAREST` neighbours of each animal that are seen; 1 where nobody is missing.

    Parameters
    ----------
    xy : (T, P, 2) ndarray
        Animals that are seen, NaN elsewhere.
    missing : (T, A, 2) ndarray
        As of `missing_places`.
    """
    out = np.ones(xy.shape[:2])
    for t in np.flatnonzero(np.isfinite(missing[..., 0]).any(1)):
        here, gone = (np.flatnonzero(np.isfinite(places[t, :, 0])) for places in (xy, missing))
        everybody = np.concatenate([xy[t, here], missing[t, gone]])
        k = min(NEAREST, len(everybody) - 1)
        if not len(here) or k < 1:
            continue
        own = np.arange(len(here))[:, None]
        who = np.atleast_2d(cKDTree(everybody).query(xy[t, here], k=k + 1)[1])
        others = np.argsort(who == own, axis=1, kind="stable")[:, :k]  # itself comes last, wherever it was
        out[t, here] = 1.0 - (np.take_along_axis(who, others, 1) >= len(here)).mean(1)
    return out


def share_lost(evidence) -> float:
    """Share of the animals that are usually not found where a film holds the whole herd; 0 where that is not known.

    As many animals are in every frame, so where fewer are found, some are taken for one: mostly the nearest neighbours.
    """
    if evidence.sightings is None or evidence.from_tracks or not evidence.fields.holds_all:
        return 0.0
    found = np.diff(evidence.sightings.first)
    return float(1.0 - min(found.mean() / max(np.quantile(found, MOST_SEEN), 1.0), 1.0)) if len(found) else 0.0


def trust(neighbours_seen):
    """How much an animal's turn and the distances to its neighbours count, by the share of them that are seen."""
    return 1.0 / (1.0 + ((1.0 - neighbours_seen) / UNSEEN) ** 2)
