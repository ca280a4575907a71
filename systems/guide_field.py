"""The field along guides: directions that leaders follow, turned aside before obstacles."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.maths import exp_
from flockbrush.systems.fast_marching import EVERYWHERE, march_, spread_
from numba import njit

FADED = 5.0  # decay lengths after which a guide is forgotten: exp(-5) is less than 1/100


def guide_field(guides, shape, cell, blocked=None, images=((0.0, 0.0),)):
    """What the guides say in every cell, as if nobody minded walls.

    A cell that guides cross takes the mean direction of the pieces inside, weighted by length and strength
    ([1]_, section 7.3), so opposing guides cancel.  From there directions spread outwards along the shortest way
    round obstacles.  Where several guides reach, the nearer one counts more, by the inverse square of the distance:
    two lanes side by side in opposite directions stay two lanes.  The length of the result is the strength of the
    strongest guide that reaches there (at most 1) out to its radius, decaying exponentially beyond, times how far
    the guides agree.

    Parameters
    ----------
    guides : sequence
        Each ``(points (k, 2) m, strength, radius m, decay m, loop)``, or an object with these attributes.  Their
        order does not matter.
    shape : (ny, nx)
        The grid.
    cell : float
        Size of a cell, m.
    blocked : ndarray, (ny, nx) bool, optional
        Where guides do not spread.  The part of a guide that runs inside an obstacle says nothing.
    images : array_like (k, 2)
        Metres by which guides are moved: each is at all of these places.

    Returns
    -------
    ndarray, (ny, nx, 2)
        Zero where no guide reaches and in blocked cells.

    Raises
    ------
    ValueError
        When a guide has a number that is not finite, or a negative strength, radius or decay.
    """
    ny, nx = shape
    slowness = np.ones((ny, nx)) if blocked is None else np.where(blocked, np.inf, 1.0)
    total = np.zeros((ny, nx, 4))  # weighted direction east, north; weight; strongest reach
    crossed = np.zeros((ny, nx, 4))
    images = np.asarray(images, float) / cell
    for points, strength, radius, decay in _in_order(guides, cell):
        inside, seeds = trace_(points + images[0], ny, nx)
        for image in images[1:]:
            more, nearer = trace_(points + image, ny, nx)
            inside, seeds = inside + more, np.minimum(seeds, nearer)
        distance, order = march_(seeds, slowness, radius + FADED * decay, EVERYWHERE)
        direction = spread_(mean_(inside), seeds, distance, order)
        add_guide_(total, direction, distance, order, strength, radius, decay)
        add_crossing_(crossed, inside, strength)
    return guidance_(total, crossed, slowness)


def _in_order(guides, cell):
    """Checked guides in cell units, in an order of their own: sums do not depend on the order in the file."""
    ready = []
    for number, guide in enumerate(guides, 1):
        if hasattr(guide, "points"):
            guide = guide.points, guide.strength, guide.radius, guide.decay, guide.loop
        points, *numbers, loop = guide
        points = np.ascontiguousarray(points, np.float64).reshape(-1, 2)
        numbers = [float(x) for x in numbers]
        if not np.isfinite(points).all() or not np.isfinite(numbers).all() or min(numbers) < 0:
            raise ValueError(
                f"guide {number}: points must be finite; strength, radius and decay finite and not negative"
            )
        if loop and len(points) > 2:
            points = np.concatenate([points, points[:1]])
        strength, radius, decay = numbers
        if strength > 0 and len(points) > 1:
            ready.append((points / cell, strength, radius / cell, decay / cell))
    return sorted(ready, key=lambda guide: (guide[0].tobytes(), *guide[1:]))


@njit(cache=True, nogil=True)
def mean_(inside):
    """(ny, nx, 2) mean direction of the pieces inside each cell."""
    ny, nx, _ = inside.shape
    out = np.zeros((ny, nx, 2))
    for iy in range(ny):
        for ix in range(nx):
            if inside[iy, ix, 2] > 0.0:
                out[iy, ix, 0] = inside[iy, ix, 0] / inside[iy, ix, 2]
                out[iy, ix, 1] = inside[iy, ix, 1] / inside[iy, ix, 2]
    return out


@njit(cache=True, nogil=True)
def guidance_(total, crossed, slowness):
    """(ny, nx, 2) mean direction times reach: guides that cross a cell count alone there."""
    ny, nx = slowness.shape
    out = np.zeros((ny, nx, 2))
    for iy in range(ny):
        for ix in range(nx):
            said = crossed[iy, ix] if crossed[iy, ix, 2] > 0.0 else total[iy, ix]
            if said[2] > 0.0 and slowness[iy, ix] < np.inf:
                reach = min(1.0, said[3])
                out[iy, ix, 0] = said[0] / said[2] * reach
                out[iy, ix, 1] = said[1] / said[2] * reach
    return out


@njit(cache=True, nogil=True)
def trace_(points, ny, nx):
    """Which cells a polyline crosses.

    Parameters
    ----------
    points : (k, 2), in cells

    Returns
    -------
    inside : (ny, nx, 3)
        Sum of length times direction (east, north) and of length of the pieces inside each cell, in cells.  A
        piece on the border of two cells is half in each.
    distance : (ny, nx)
        From the centre of each crossed cell to the polyline, in cells; infinite for other cells.
    """
    inside = np.zeros((ny, nx, 3))
    distance = np.full((ny, nx), np.inf)
    for k in range(len(points) - 1):
        ax, ay, dx, dy = clip_(points[k], points[k + 1], ny, nx)
        long = np.sqrt(dx * dx + dy * dy)
        t = 0.0
        while long > 0.0 and t < 1.0:
            stop = min(1.0, next_line_(ax, dx, t), next_line_(ay, dy, t))
            deposit_(inside, distance, ax, ay, dx, dy, long, 0.5 * (t + stop), stop - t)
            t = stop
    return inside, distance


@njit(cache=True, nogil=True)
def clip_(a, b, ny, nx):
    """The part of the segment from a to b that is on the map, as its start and what to add to reach its end."""
    start, end = 0.0, 1.0
    for k in range(2):
        d = b[k] - a[k]
        size = ny if k == 1 else nx
        if d == 0.0:
            if a[k] < 0.0 or a[k] > size:
                end = 0.0
        else:
            first, last = -a[k] / d, (size - a[k]) / d
            start, end = max(start, min(first, last)), min(end, max(first, last))
    if start >= end:
        return 0.0, 0.0, 0.0, 0.0
    dx, dy = b[0] - a[0], b[1] - a[1]
    x, y = min(max(a[0] + start * dx, 0.0), nx), min(max(a[1] + start * dy, 0.0), ny)
    return x, y, min(max(a[0] + end * dx, 0.0), nx) - x, min(max(a[1] + end * dy, 0.0), ny) - y


@njit(cache=True, nogil=True)
def next_line_(a, d, t):
    """The next ``t`` at which ``a + t d`` is a whole number."""
    if d == 0.0:
        return np.inf
    step = 1.0 if d > 0.0 else -1.0
    line = step * np.floor(step * (a + t * d)) + step
    while (line - a) / d <= t:  # by rounding, this is the line where we stand
        line += step
    return (line - a) / d


@njit(cache=True, nogil=True)
def deposit_(inside, distance, ax, ay, dx, dy, long, middle, share):
    """Add a piece of a segment to the cell of its middle, or half to each when it runs along the border of two."""
    ny, nx = distance.shape
    x, y = ax + middle * dx, ay + middle * dy
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    x1 = x0 - 1 if dx == 0.0 and x == x0 else x0
    y1 = y0 - 1 if dy == 0.0 and y == y0 else y0
    for cy, cx in ((y0, x0), (y1, x1)):
        iy, ix = min(max(cy, 0), ny - 1), min(max(cx, 0), nx - 1)
        inside[iy, ix, 0] += 0.5 * share * dx
        inside[iy, ix, 1] += 0.5 * share * dy
        inside[iy, ix, 2] += 0.5 * share * long
        px, py = ix + 0.5 - ax, iy + 0.5 - ay
        t = min(1.0, max(0.0, (px * (dx / long) + py * (dy / long)) / long))
        px, py = px - t * dx, py - t * dy
        distance[iy, ix] = min(distance[iy, ix], np.sqrt(px * px + py * py))


@njit(cache=True, nogil=True)
def add_guide_(total, direction, distance, order, strength, radius, decay):
    """Add one guide, as far as it reaches; distances in cells."""
    nx = distance.shape[1]
    for c in order:
        iy, ix = c // nx, c % nx
        d = distance[iy, ix]
        reach = strength
        if d > radius:
            reach *= exp_(-(d - radius) / decay)
        weight = reach / ((d + 1.0) * (d + 1.0))
        total[iy, ix, 0] += weight * direction[iy, ix, 0]
        total[iy, ix, 1] += weight * direction[iy, ix, 1]
        total[iy, ix, 2] += weight
        total[iy, ix, 3] = max(total[iy, ix, 3], reach)


@njit(cache=True, nogil=True)
def add_crossing_(crossed, inside, strength):
    """Add the pieces of one guide to the cells that they cross."""
    ny, nx, _ = inside.shape
    for iy in range(ny):
        for ix in range(nx):
            if inside[iy, ix, 2] > 0.0:
                for k in range(3):
                    crossed[iy, ix, k] += strength * inside[iy, ix, k]
                crossed[iy, ix, 3] = max(crossed[iy, ix, 3], strength)
