"""What formation a flock is in: the five indicators of Nathan & Barbosa 2008, its lines, and its shape by name.

All lengths are in wingspans, positions in the frame that flies with the flock (to the right, along the way, up).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.v_rules.rules import VRuleSettings, kernel, law_of
from flockbrush.engine.parallel import over_rows

SHAPES = ("V", "J", "W", "echelon", "inverted V", "several groups", "cluttered", "other")
V, J, W, ECHELON, INVERTED_V, GROUPS, CLUTTERED, OTHER = range(len(SHAPES))
SHORT_ARM = 0.5  # a V's short arm has at least so much of its long one's birds; else it is a J
LINES = 64  # straight lines counted in one flock at most


class Indicators(NamedTuple):
    """One value for each flock; distances in wingspans, NaN where a flock has no straight line."""

    leads: np.ndarray  # birds in no other bird's upwash
    groups: np.ndarray  # sets of birds that no upwash connects
    segments: np.ndarray  # straight lines, from a bird without followers to a lead or to one with two followers
    distance: np.ndarray  # mean from each bird to its nearest line; leads and bifurcations: to the nearest two
    own_distance: np.ndarray  # the same, to lines of the bird's own group only
    shape: np.ndarray  # index into SHAPES


def indicators(xyz, rules: VRuleSettings = VRuleSettings()) -> Indicators:  # noqa: B008  frozen
    """The indicators of flocks.

    Parameters
    ----------
    xyz : (flocks, birds, 3) array_like
        Wingspans.
    rules : Rules
        The size of the wakes.
    """
    xyz = np.ascontiguousarray(xyz, np.float64)
    law = law_of(rules)
    counts, distances = np.zeros((len(xyz), 4), np.int64), np.zeros((len(xyz), 2))
    over_rows(_measure, len(xyz), law, rules.margin, xyz, counts, distances)
    return Indicators(counts[:, 0], counts[:, 1], counts[:, 2], distances[:, 0], distances[:, 1], counts[:, 3])


def lines_of(xyz, rules: VRuleSettings = VRuleSettings()):  # noqa: B008  frozen
    """The straight lines of one flock, to draw them: (k, 2) indices of birds, from the last one to the one in front."""
    xyz = np.ascontiguousarray(xyz, np.float64)
    n = len(xyz)
    follows, lines = np.zeros((n, n), np.bool_), np.zeros((LINES, 2), np.int64)
    _link(law_of(rules), xyz, follows)
    return lines[: _lines(follows, np.zeros((2, n), np.int64), lines)]


def leaders_of(xyz, rules: VRuleSettings = VRuleSettings()):  # noqa: B008  frozen
    """(n,) bool, birds of one flock in no other bird's upwash."""
    xyz = np.ascontiguousarray(xyz, np.float64)
    follows = np.zeros((len(xyz), len(xyz)), np.bool_)
    _link(law_of(rules), xyz, follows)
    return ~follows.any(1)


@kernel
def _measure(lo, hi, law, margin, xyz, counts, distances):
    n = xyz.shape[1]
    follows, lines = np.empty((n, n), np.bool_), np.empty((LINES, 2), np.int64)
    degree, group, by_x = np.empty((2, n), np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    for flock in range(lo, hi):
        birds = xyz[flock]
        _link(law, birds, follows)
        line_count = _lines(follows, degree, lines)
        counts[flock, 0] = np.sum(degree[0] == 0)
        counts[flock, 1] = _groups(follows, group)
        counts[flock, 2] = line_count
        for own in range(2):
            distances[flock, own] = _mean_distance(birds, degree, lines[:line_count], group, own == 1)
        counts[flock, 3] = GROUPS if counts[flock, 1] > 1 else _shape(law, margin, birds, by_x)


@kernel
def _link(law, xyz, follows):
    """Who is with any part of body or wings in whose upwash."""
    n = len(xyz)
    reach = law.outer + 0.5 * law.wing
    for i in range(n):
        for j in range(n):
            dy = xyz[j, 1] - xyz[i, 1]
            near = abs(xyz[j, 0] - xyz[i, 0]) <= reach and abs(xyz[j, 2] - xyz[i, 2]) <= law.layer
            follows[i, j] = i != j and near and 0.0 < dy <= law.depth


@kernel
def _lines(follows, degree, lines):
    """Fill in how many each bird follows (0) and is followed by (1), and the straight lines; how many lines."""
    n = len(follows)
    degree[:] = 0
    for i in range(n):
        for j in range(n):
            degree[0, i] += follows[i, j]
            degree[1, j] += follows[i, j]
    found = 0
    stack, seen = np.empty(n, np.int64), np.empty(n, np.bool_)
    for last in range(n):
        if degree[1, last] or not degree[0, last]:
            continue
        seen[:] = False
        seen[last] = True
        stack[0], depth = last, 1
        while depth:
            depth -= 1
            i = stack[depth]
            if i != last and (degree[0, i] == 0 or degree[1, i] >= 2):
                if found < len(lines):
                    lines[found, 0], lines[found, 1] = last, i
                    found += 1
                continue
            for j in range(n):
                if follows[i, j] and not seen[j]:
                    seen[j] = True
                    stack[depth] = j
                    depth += 1
    return found


@kernel
def _groups(follows, group):
    """Label birds that hang together by upwash; how many groups."""
    n = len(follows)
    group[:] = -1
    stack = np.empty(n, np.int64)
    count = 0
    for first in range(n):
        if group[first] >= 0:
            continue
        group[first] = count
        stack[0], depth = first, 1
        while depth:
            depth -= 1
            i = stack[depth]
            for j in range(n):
                if group[j] < 0 and (follows[i, j] or follows[j, i]):
                    group[j] = count
                    stack[depth] = j
                    depth += 1
        count += 1
    return count


@kernel
def _mean_distance(xyz, degree, lines, group, own):
    total, birds = 0.0, 0
    for i in range(len(xyz)):
        first = second = np.inf
        for k in range(len(lines)):
            a, b = lines[k, 0], lines[k, 1]
            if own and group[a] != group[i]:
                continue
            d = _to_segment(xyz[i], xyz[a], xyz[b])
            if d < first:
                first, second = d, first
            elif d < second:
                second = d
        if (degree[0, i] == 0 or degree[1, i] >= 2) and second < np.inf:
            first = 0.5 * (first + second)
        if first < np.inf:
            total += first
            birds += 1
    return total / birds if birds else np.nan


@kernel
def _to_segment(p, a, b):
    along = dot = 0.0
    for c in range(3):
        along += (b[c] - a[c]) ** 2
        dot += (p[c] - a[c]) * (b[c] - a[c])
    t = min(max(dot / along, 0.0), 1.0) if along > 0.0 else 0.0
    d2 = 0.0
    for c in range(3):
        d2 += (a[c] + t * (b[c] - a[c]) - p[c]) ** 2
    return np.sqrt(d2)


@kernel
def _shape(law, margin, xyz, by_x):
    """The shape of one connected flock, told from left to right: where its outline turns back, and how long it is."""
    n = len(xyz)
    for i in range(n):
        by_x[i] = i
        b = i - 1
        while b >= 0 and xyz[by_x[b], 0] > xyz[i, 0]:
            by_x[b + 1] = by_x[b]
            b -= 1
        by_x[b + 1] = i
    for k in range(1, n):
        aside = xyz[by_x[k], 0] - xyz[by_x[k - 1], 0]
        if aside < 0.5 * law.best or aside > law.outer + 0.5 * law.wing:
            return CLUTTERED  # birds behind one another, or a hole
    turns = np.empty(n + 1, np.int64)
    rising, bends = _bends(margin, xyz, by_x, turns)
    if bends == 0:
        return ECHELON
    if bends == 1 and rising:
        left, right = turns[0], n - 1 - turns[0]
        return V if min(left, right) >= SHORT_ARM * max(left, right) else J
    if bends == 1:
        return INVERTED_V
    return W if bends == 3 and rising else OTHER


@kernel
def _bends(margin, xyz, by_x, turns):
    """(whether the outline first goes forward, how often it turns by more than the margin); ``turns`` says where."""
    low = high = 0
    direction, bends, rising = 0, 0, True
    for k in range(1, len(xyz)):
        y = xyz[by_x[k], 1]
        if y > xyz[by_x[high], 1]:
            high = k
        if y < xyz[by_x[low], 1]:
            low = k
        if direction >= 0 and xyz[by_x[high], 1] - y > margin:
            if direction > 0:
                turns[bends] = high
                bends += 1
            else:
                rising = False
            direction, low = -1, k
        elif direction <= 0 and y - xyz[by_x[low], 1] > margin:
            if direction < 0:
                turns[bends] = low
                bends += 1
            direction, high = 1, k
    return rising, bends
