"""Skeins: which birds in line formation fly as one, by what they see.

A skein is a leader and all who keep their place by it, through however many others.  Who belongs to none (late birds,
birds whose leader died, strays) joins the skein of the nearest bird that it sees or that sees it; those who see none
make one of their own.  Two skeins that see each other join, or pass, as their brush says (``meets``); those that fly
different ways always pass.  Ours; the paper has one flock that sees itself.
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.seam import short_way
from numba import njit

ALIKE = 0.5  # cosine of the angle between headings within which two skeins join


def skeins(xy, forward, reference, place, sees, joins, wrap=None):
    """The skein of each bird of one brush and kind, as a number from 0, and who led one of two or more.

    Parameters
    ----------
    xy, forward : ndarray (n, 2)
        m, and headings.
    reference, place : ndarray (n,)
        Rows, -1 for none; 0 leads, -1 open.
    sees, joins : ndarray (n, n) bool
        Whom each sees, and with whom its skein joins if both fly the same way.
    wrap : (float, float), optional
        m, the size of a map without edges.

    Returns
    -------
    ndarray (n,) int, ndarray (n,) bool
    """
    n = len(reference)
    either = sees | sees.T
    label = _connected(_followed(reference))
    led = np.bincount(label[place == 0], minlength=n) > 0
    formed = led[label] & (np.bincount(label, minlength=n)[label] > 1)
    leads = formed & (place == 0)
    links = _followed(reference)
    if not formed.all():
        free = ~formed
        links |= either & free[:, None] & free[None, :]
        if formed.any():
            _attach(links, _connected(links), xy, free, either, wrap)
    if leads.sum() > 1:
        fx, fy = (forward / np.maximum(np.sqrt((forward**2).sum(axis=1)), 1e-12)[:, None]).T
        links |= (joins | joins.T) & (np.outer(fx, fx) + np.outer(fy, fy) > ALIKE) & np.outer(formed, formed)
    return _connected(links), leads


def _followed(reference):
    """(n, n) bool: from each bird to the one it keeps its place by."""
    links = np.zeros((len(reference), len(reference)), np.bool_)
    follows = np.flatnonzero(reference >= 0)
    links[follows, reference[follows]] = True
    return links


@njit(cache=True, nogil=True, error_model="numpy")
def _connected(links):
    """(n,) the part of each, numbered in the order in which they are met."""
    n = len(links)
    label, stack, parts = np.full(n, -1), np.empty(n, np.int64), 0
    for first in range(n):
        if label[first] >= 0:
            continue
        label[first], stack[0], depth = parts, first, 1
        while depth > 0:
            depth -= 1
            i = stack[depth]
            for j in range(n):
                if label[j] < 0 and (links[i, j] or links[j, i]):
                    label[j], stack[depth] = parts, j
                    depth += 1
        parts += 1
    return label


def _attach(links, label, xy, free, either, wrap):
    """Link each cluster of free birds with one bird of a skein: the nearest that one of them sees."""
    to = np.flatnonzero(~free)
    loose = np.flatnonzero(free)
    away = short_way(xy[loose, None] - xy[None, to], wrap)
    far = np.where(either[np.ix_(loose, to)], (away**2).sum(2), np.inf)
    nearest = far.argmin(axis=1)
    best = far[np.arange(len(loose)), nearest]
    for cluster in np.unique(label[loose]):
        mine = np.flatnonzero(label[loose] == cluster)
        k = mine[best[mine].argmin()]
        if best[k] < np.inf:
            links[loose[k], to[nearest[k]]] = True
