"""Whether a clip shows animals of several kinds: two groups of speeds or of sizes, with nothing between.

A brush describes one kind of animal, so a clip of two is read as something between them.  Values are split in two where
that leaves least variance within the groups; the groups are two kinds if Ashman's D of their logarithms is large [1]_.
The halves of even values have D = 3.5, those of a normal distribution 2.7.

References
----------
.. [1] Ashman, K. M., Bird, C. M. & Zepf, S. E. (1994). Detecting bimodality in astronomical datasets. The Astronomical
   Journal 108, 2348-2361.
"""

from __future__ import annotations

import numpy as np

APART = 4.5  # Ashman's D above which two groups are two kinds
LEAST = 0.1  # share of the animals in the smaller group
TIMES = 1.6  # times as fast or as large, at least
LONGER = 0.25, 0.75  # log(ratio of lengths) / log(ratio of areas) lies between; 0.5 where the shape is the same
ENOUGH = 12  # animals
EVEN = 0.03  # of a logarithm: values that differ less are the same
SECONDS = 0.4  # of a track, of which the speed is taken
ADVICE = (
    "and hardly any are between: several species, or one that moves in two ways; a brush is of one kind, so learn from "
    "each alone (films: --regions, --body-colour)"
)
STANDS, SLOWEST = 0.15, 0.05  # of the fast animals' speed; BL/s: slower animals stand


def two_groups(values) -> tuple[float, float] | None:
    """(share of the upper group, how many times the lower it is) of positive values; None where they are one group."""
    logs = np.sort(np.log(np.asarray(values, float)))
    n = len(logs)
    least = max(2, int(np.ceil(LEAST * n)))
    if n < ENOUGH or 2 * least > n:
        return None
    cuts = np.arange(least, n - least + 1)
    sums, squares = np.cumsum(logs), np.cumsum(logs**2)
    below = squares[cuts - 1] - sums[cuts - 1] ** 2 / cuts
    above = squares[-1] - squares[cuts - 1] - (sums[-1] - sums[cuts - 1]) ** 2 / (n - cuts)
    cut = int(cuts[np.argmin(below + above)])
    (low, low_spread), (high, high_spread) = _middle(logs[:cut]), _middle(logs[cut:])
    apart = (high - low) / np.sqrt(0.5 * (low_spread**2 + high_spread**2))
    if apart < APART or high - low < np.log(TIMES):
        return None
    return 1.0 - cut / n, float(np.exp(high - low))


def _rows(values, share):
    """(rows of the lower group, rows of the upper one, which has this share)."""
    return np.split(np.argsort(values, kind="stable"), [round((1.0 - share) * len(values))])


def _middle(logs):
    """(median, deviation by the quartiles)."""
    low, middle, high = np.quantile(logs, (0.25, 0.5, 0.75))
    return middle, max((high - low) / 1.349, EVEN)


def speeds_told(sightings, fps) -> list[str]:
    """A sentence where tracked animals go at two speeds; none where the slow ones are fast now and then."""
    if sightings is None:
        return []
    known = np.isfinite(sightings.speed) & (sightings.track >= 0)
    order = np.argsort(sightings.track[known], kind="stable")
    track, speed = sightings.track[known][order], sightings.speed[known][order]
    parts = np.split(speed, np.flatnonzero(np.diff(track)) + 1)
    long = [part for part in parts if len(part) >= max(3, SECONDS * fps)]
    if not long:
        return []
    usual, fast = np.array([np.quantile(part, (0.5, 0.9)) for part in long]).T
    moving = usual > max(STANDS * np.quantile(usual, 0.9), SLOWEST)
    groups = two_groups(usual[moving])
    if groups is None:
        return []
    share, times = groups
    lower, upper = _rows(usual[moving], share)
    if np.median(fast[moving][lower]) > np.median(usual[moving][upper]) / np.sqrt(times):
        return []
    return [f"{share:.0%} of the moving animals are {times:.2g} times as fast as the others, {ADVICE}"]


def sizes_told(areas, lengths) -> list[str]:
    """A sentence where the areas (k,) and lengths (k,) of bodies that stand alone are of two sizes.

    None where the larger ones are pairs that touch: these are as long or as wide as one animal.
    """
    groups = two_groups(areas) if len(areas) else None
    if groups is None:
        return []
    share, times = groups
    lower, upper = _rows(areas, share)
    longer = np.log(np.median(lengths[upper]) / np.median(lengths[lower])) / np.log(times)
    if not LONGER[0] < longer < LONGER[1]:
        return []
    return [f"{share:.0%} of the bodies that stand alone have {times:.2g} times the area of the others, {ADVICE}"]
