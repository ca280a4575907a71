"""Which patches of a picture make up one bird, and the usual size of a bird: a fit of birds of one size.

A pale body between dark wings is split into pieces; two birds may nearly touch.  Patches are joined nearest first
(single linkage), and each join is kept where one bird of the usual size explains it better than its parts do.  The
usual size is the one that leaves the least unexplained, so neither a moon, a cloud, a branch nor specks decide it.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

LEAST_AREA = 6  # pixels: below, noise
GAP, SHORT_GAP = 0.4, 1.2  # of the longer and of the shorter of two pieces: farther apart they are not one bird
MOST_PIECES = 600  # patches: with more, pieces are not joined, since that is slow and unreliable
SOLID = 0.3  # part of its convex hull that a bird fills
THIN = 12.0  # longer than this for its width: a wire, a twig


class Patch(NamedTuple):
    """Something that looks like a bird."""

    x: float  # pixels
    y: float
    area: float  # pixels
    span: float  # pixels, its longest extent
    pale: float = 0.0  # share of it that is lighter than the sky
    shaped: bool = True  # neither as thin as a wire nor as ragged as a branch
    inside: bool = True  # not cut off by the picture's edge
    points: np.ndarray = np.zeros((0, 2), np.int32)  # its outline

    @property
    def whole(self):
        """Whether its size is used to estimate the size of birds."""
        return self.shaped and self.inside

    def __eq__(self, other):
        return self is other

    def __hash__(self):
        return id(self)


def patches_of(mask, lighter) -> list[Patch]:
    """Every patch of a mask (h, w) uint8; ``lighter`` (h, w) bool: where the picture is lighter than its sky."""
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    patches = []
    for k in range(1, count):
        left, top, wide, tall, area = stats[k]
        if area < LEAST_AREA:
            continue
        box = np.s_[top : top + tall, left : left + wide]
        shape = labels[box] == k
        outlines, _ = cv2.findContours(
            shape.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE, offset=(int(left), int(top))
        )
        edge = left == 0 or top == 0 or left + wide == mask.shape[1] or top + tall == mask.shape[0]
        points = np.vstack(outlines)[:, 0]
        patches.append(_patch(centres[k], float(area), points, float(lighter[box][shape].mean()), not edge))
    return patches


def _patch(centre, area, points, pale, inside):
    hull = cv2.contourArea(cv2.convexHull(points)) + 1.0
    sides = sorted(side + 1.0 for side in cv2.minAreaRect(points)[1])
    shaped = area / max(hull, area) >= SOLID and sides[1] / sides[0] <= THIN
    return Patch(float(centre[0]), float(centre[1]), area, sides[1], pale, shaped, inside, points)


def _both(a, b):
    """Two pieces as one patch."""
    share = a.area / (a.area + b.area)
    centre = share * a.x + (1 - share) * b.x, share * a.y + (1 - share) * b.y
    points = np.vstack([a.points, b.points])
    points = points[cv2.convexHull(points, returnPoints=False)[:, 0]] if len(points) > 2000 else points
    return _patch(centre, a.area + b.area, points, share * a.pale + (1 - share) * b.pale, True)


def of_one_size(patches: list[Patch]) -> tuple[list[Patch], float]:
    """Patches with pieces of one bird joined, and the usual span of a bird, pixels (0 without any)."""
    if not patches:
        return [], 0.0
    nodes, children = _linked(patches)
    sizes = np.unique([patch.span for patch in nodes if patch.whole] or [patch.span for patch in nodes])
    cost: list[np.ndarray] = []
    for k, node in enumerate(nodes):
        off = np.minimum(np.abs(np.log2(node.span / sizes)), 1.0)
        weight = np.log1p(node.area / LEAST_AREA) * (node.whole or k in children)
        alone = weight * off
        if k in children:
            parts = cost[children[k][0]] + cost[children[k][1]]
            alone = np.where(off < 1.0, alone, parts + 1.0)
            cost.append(np.minimum(alone, parts))
        else:
            cost.append(alone)
    inner = {part for pair in children.values() for part in pair}
    roots = [k for k in range(len(nodes)) if k not in inner]
    best = int(np.argmin(sum(cost[k] for k in roots)))
    birds, usual = [], float(sizes[best])
    while roots:
        k = roots.pop()
        if k in children and cost[k][best] >= cost[children[k][0]][best] + cost[children[k][1]][best]:
            roots.extend(children[k])
        else:
            birds.append(nodes[k])
    return birds, usual


def _linked(patches):
    """(patches and their joins, {join: its two parts}), nearest pieces joined first."""
    nodes = list(patches)
    children: dict[int, tuple[int, int]] = {}
    if not 1 < len(patches) <= MOST_PIECES:
        return nodes, children
    centres = np.array([(p.x, p.y) for p in patches])
    spans = np.array([p.span for p in patches])
    tree, near = cKDTree(centres), []
    for a in range(len(patches)):
        for b in tree.query_ball_point(centres[a], (1 + GAP) * spans[a] + 1.0):
            if b == a or (spans[b], b) > (spans[a], a):  # the longer one looks for the shorter
                continue
            gap = float(cdist(patches[a].points[::2], patches[b].points[::2]).min())
            if gap <= min(GAP * spans[a], SHORT_GAP * spans[b]) + 1.0:
                near.append((gap / spans[b], a, b))
    top = list(range(len(patches)))  # the join that each patch is in
    for _, a, b in sorted(near):
        one, other = top[a], top[b]
        if one == other:
            continue
        nodes.append(_both(nodes[one], nodes[other]))
        children[len(nodes) - 1] = one, other
        top = [len(nodes) - 1 if t in (one, other) else t for t in top]
    return nodes, children
