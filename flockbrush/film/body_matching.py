"""Matching of bodies from frame to frame: the track number of each body."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

REACH = 0.65  # BL from the predicted position of a tracked animal
REACH_NEW = 0.65  # BL from the predicted position of a body seen for the first time
ASIDE = 2.0  # a step across the body counts so many times as long
TURNED = 0.3  # BL added to the cost of a body turned by a right angle
GAP = 5  # frames an animal may be missing within a track


def follow(xy, axis, moves=None) -> list[np.ndarray]:
    """Track numbers of the bodies; bodies of the same animal have the same number.

    Parameters
    ----------
    xy : list of (k, 2) ndarray
        For each frame, centres of the bodies, BL.
    axis : list of (k, 2) ndarray
        Unit vectors along the bodies; either end may be the head.
    moves : list of (k, 2) ndarray, optional
        Motion of each body to the next frame, BL; NaN where unknown.

    Returns
    -------
    list of (k,) ndarray of int
    """
    names = [np.full(len(p), -1) for p in xy]
    known = _Known()
    for t in range(len(xy)):
        known.next(xy[t], axis[t], None if moves is None else moves[t], names[t])
    return names


class _Known:
    """State of the tracks that are being followed: position, step, axis, track number, age and missed frames."""

    def __init__(self):
        self.at, self.go, self.axis = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2))
        self.name, self.age, self.missed = (np.zeros(0, int) for _ in range(3))
        self.count = 0

    def next(self, xy, axis, moves, names):
        """Match the bodies of the next frame, and write their names."""
        ahead = self.at + self.go
        matched_tracks, matched_bodies = matched(ahead, self.axis, np.where(self.age > 1, REACH, REACH_NEW), xy, axis)
        self._see(matched_tracks, matched_bodies, xy, axis, moves, ahead, names)
        new = np.setdiff1d(np.arange(len(xy)), matched_bodies)
        self._begin(new, xy, axis, moves, names)

    def _see(self, tracks, bodies, xy, axis, moves, ahead, names):
        """Update matched tracks; move the others on by their steps, and drop those missed for over `GAP` frames."""
        steps = (xy[bodies] - self.at[tracks]) / (1 + self.missed[tracks])[:, None]
        gain = np.where(self.age[tracks] > 3, 0.35, np.where(self.age[tracks] > 1, 0.6, 1.0))[:, None]
        self.go[tracks] += gain * (steps - self.go[tracks])
        if moves is not None:
            say = moves[bodies]
            known = np.isfinite(say[:, 0])
            self.go[tracks[known]] += 0.3 * (say[known] - self.go[tracks[known]])
        lost = np.setdiff1d(np.arange(len(self.at)), tracks)
        self.at[lost] = ahead[lost]
        self.missed[lost] += 1
        self.at[tracks], self.axis[tracks] = xy[bodies], axis[bodies]
        self.missed[tracks] = 0
        self.age[tracks] += 1
        names[bodies] = self.name[tracks]
        keep = (self.missed <= GAP) & ~((self.age < 2) & (self.missed > 1))
        for name in ("at", "go", "axis", "name", "age", "missed"):
            setattr(self, name, getattr(self, name)[keep])

    def _begin(self, new, xy, axis, moves, names):
        """Start tracks for unmatched bodies; their first step comes from the flow, else from their neighbours."""
        go = self._as_neighbours(xy[new], axis[new])
        if moves is not None:
            known = np.isfinite(moves[new, 0])
            go[known] = moves[new][known]
        names[new] = np.arange(self.count, self.count + len(new))
        self.count += len(new)
        zero = np.zeros(len(new), int)
        for name, value in (
            ("at", xy[new]), ("go", go), ("axis", axis[new]), ("name", names[new]), ("age", zero + 1), ("missed", zero),
        ):  # fmt: skip
            setattr(self, name, np.concatenate([getattr(self, name), value]))

    def _as_neighbours(self, xy, axis):
        """Mean step of nearby tracks with a similar axis, (k, 2) BL; 0 where there is none."""
        sure = self.age > 2
        if not sure.any() or not len(xy):
            return np.zeros((len(xy), 2))
        d, who = cKDTree(self.at[sure]).query(xy, k=min(5, int(sure.sum())))
        d, who = d.reshape(len(xy), -1), who.reshape(len(xy), -1)
        alike = np.abs(np.einsum("ik,ijk->ij", axis, self.axis[sure][who])) > 0.9
        weight = np.exp(-((d / 3.0) ** 2)) * alike
        total = weight.sum(1, keepdims=True)
        steps = np.einsum("ij,ijk->ik", weight, self.go[sure][who])
        return np.where(total > 0.1, steps / np.maximum(total, 1e-9), 0.0)


def matched(ahead, axis_of, reach, xy, axis):
    """Match predicted tracks with observed bodies at the least total cost.

    The cost is the distance of a body from the predicted position, with the part across the body counted `ASIDE` times,
    and `TURNED` BL added for a turn of the axis by a right angle.

    Parameters
    ----------
    ahead : (n, 2) ndarray
        Predicted positions, BL.
    axis_of : (n, 2) ndarray
        Unit vectors along the tracked bodies.
    reach : (n,) ndarray
        Largest cost of a match of each track, BL.
    xy, axis : (m, 2) ndarray
        Centres (BL) and axes (unit vectors) of the observed bodies.

    Returns
    -------
    (k,) ndarray of int, (k,) ndarray of int
        Rows of the tracks and of the bodies that belong together.
    """
    if not len(ahead) or not len(xy):
        return np.zeros(0, int), np.zeros(0, int)
    near = cKDTree(ahead).sparse_distance_matrix(cKDTree(xy), float(reach.max()), output_type="coo_matrix")
    i, j = near.row, near.col
    off = xy[j] - ahead[i]
    along = (off * axis[j]).sum(1)
    aside = np.sqrt(np.maximum((off**2).sum(1) - along**2, 0))
    turned = np.abs(axis_of[i, 0] * axis[j, 1] - axis_of[i, 1] * axis[j, 0])
    cost = np.sqrt(along**2 + (ASIDE * aside) ** 2 + (TURNED * turned) ** 2)
    ok = cost < reach[i]
    return _cheapest(i[ok], j[ok], cost[ok], len(ahead), len(xy))


def _cheapest(i, j, cost, n, m):
    """The assignment of least total cost among the permitted pairs, solved for each connected group of pairs."""
    if not len(i):
        return np.zeros(0, int), np.zeros(0, int)
    graph = coo_matrix((np.ones(len(i)), (i, n + j)), shape=(n + m, n + m))
    group = connected_components(graph, directed=False)[1][i]
    order = np.argsort(group, kind="stable")
    rows, columns = [], []
    for part in np.split(order, np.flatnonzero(np.diff(group[order])) + 1):
        if len(part) == 1:
            rows.append(i[part])
            columns.append(j[part])
            continue
        a, ia = np.unique(i[part], return_inverse=True)
        b, jb = np.unique(j[part], return_inverse=True)
        table = np.full((len(a), len(b)), 1e3)
        table[ia, jb] = cost[part]
        r, c = linear_sum_assignment(table)
        real = table[r, c] < 1e3
        rows.append(a[r[real]])
        columns.append(b[c[real]])
    return np.concatenate(rows), np.concatenate(columns)
