"""Where leaders are sent: guides and goals as vector fields over the ground.

A *guide* is an arrow that a designer draws: animals near it go its way.  A
*goal* is a place: animals go there along the least-cost way.  Both become one
vector per grid cell, its direction being where to go and its length, 0 to 1,
how strongly.  `navigation_of` makes them all; `Navigation.at` is what an
animal feels, bilinear between cell centres.

The steps for guides are those of Gong et al. [1]_, section 7.3: every cell
that a guide crosses takes the mean direction of the pieces inside; directions
are propagated to neighbouring cells, around obstacles and never through them,
and averaged; they hold out to the guide's radius and decay exponentially
beyond; near obstacles a cancelling field (eq. 14) takes away what would lead
into the wall.  What the paper leaves open is settled in the functions below.

Goals, guides' distances and ways round obstacles all come from one fast
marching sweep [2]_, `march_`: own code, because its bits must be the same on
every CPU, its seeds may carry sub-cell distances, it must not slip between
two obstacles that touch at a corner, and painted costs may be as rough as a
designer likes.  Everything here is ``+ - * / sqrt`` and `engine.maths.exp_`.

Arrays are ``[iy, ix]``, row 0 in the south; cell ``(iy, ix)`` has its centre at
``((ix + .5) * cell, (iy + .5) * cell)``.

References
----------
.. [1] Gong et al. 2025, Herds From Video: Learning a Microscopic Herd Model
   From Macroscopic Motion Data, section 7.3.
.. [2] Sethian 1996, A fast marching level set method for monotonically
   advancing fronts, PNAS 93(4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.maths import exp_
from engine.parallel import over_rows
from systems.terrain import rasterise_polygon

FADED = 5.0  # decay lengths after which a guide is forgotten: exp(-5) is less than 1/100
FULL = 4.0  # a field turned aside by a wall keeps its length unless less than 1/4 of it is left

EVERYWHERE = np.empty(0, np.int64)

AROUND = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
QUADRANTS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


# Navigation: what the rest of the house uses -------------------------------------------------------------------


@dataclass(frozen=True)
class Navigation:
    """The navigation fields of a level.

    Attributes
    ----------
    cell : float
        Size of a grid cell, m.
    fields : ndarray, (1 + goals, ny, nx, 2)
        Direction to go, its length at most 1 and saying how strongly.  ``fields[0]`` is for animals without a
        goal, guides alone; ``fields[1 + k]`` is for those bound to goal ``k``.
    times : ndarray, (goals, ny, nx)
        Least cost to the goal, metres of plain ground; infinite where no way leads there.
    """

    cell: float
    fields: np.ndarray
    times: np.ndarray

    @property
    def guidance(self):
        """(ny, nx, 2) the field of the guides alone."""
        return self.fields[0]

    def at(self, xy, goal=-1):
        """What animals at ``xy`` feel.

        Parameters
        ----------
        xy : array_like, (n, 2)
            Metres.  Outside of the map the nearest point of the map counts.
        goal : int or array_like of int, (n,)
            Which goal each animal is bound to; -1 for none.

        Returns
        -------
        ndarray, (n, 2)
        """
        xy = np.ascontiguousarray(xy, np.float64).reshape(-1, 2)
        goal = np.ascontiguousarray(np.broadcast_to(np.asarray(goal, np.int32), len(xy)))
        if len(goal) and not -1 <= goal.min() <= goal.max() < len(self.times):
            raise ValueError(f"a goal is -1 to {len(self.times) - 1} here, got {goal.min()} to {goal.max()}")
        out = np.empty((len(xy), 2))
        over_rows(follow, len(xy), xy, goal, self.cell, self.fields, out)
        return out

    def reachable(self, goal, xy):
        """(n,) bool, whether a way leads from the cells under ``xy`` (n, 2) m to goal number ``goal``."""
        time = self.times[goal]
        iy, ix = _cells_under(np.asarray(xy, np.float64).reshape(-1, 2), self.cell, time.shape)
        return np.isfinite(time[iy, ix])


def navigation_of(guides, goals, blocked, cost=None, cell=1.0, cancel_radius=None, goal_weight=1.0):
    """The navigation fields of a level.

    Parameters
    ----------
    guides : sequence
        Each ``(points (k, 2) m, strength, radius m, decay m, loop)``, or an object with these attributes.
    goals : sequence
        Each a mask (ny, nx) of bool, or an object with ``name``, ``xy`` (m), ``radius`` (m) and ``polygon`` (k, 2) or
        None.  A guide with a ``goal`` (the name of one) is followed only by animals bound to that goal and by those
        bound to none.
    blocked : ndarray, (ny, nx) bool
        Where nobody can stand.
    cost : ndarray, (ny, nx), optional
        What a metre of this ground costs; 1 is plain ground, more is avoided, infinite is blocked.
    cell : float
        Size of a grid cell, m.
    cancel_radius : float, optional
        How far from obstacles guides begin to turn aside, m; two cells unless told.  0: not at all.
    goal_weight : float
        How strongly the goal field fills in where guides fade, 0 to 1: see `blend`.

    Returns
    -------
    Navigation
    """
    blocked, cost = _ground(blocked, cost)
    radius = 2.0 if cancel_radius is None else cancel_radius / cell
    known = {}

    def guidance(chosen):
        if chosen not in known:
            field = guide_field([guides[i] for i in chosen], blocked.shape, cell, blocked)
            known[chosen] = around_obstacles(field, blocked, radius)
        return known[chosen]

    fields, times = [guidance(tuple(range(len(guides)))).copy()], []
    for goal in goals:
        name = getattr(goal, "name", None)
        theirs = tuple(i for i, guide in enumerate(guides) if getattr(guide, "goal", "") in ("", None, name))
        direction, time = goal_field(_mask_of(goal, blocked.shape, cell), cost, blocked, cell)
        fields.append(blend(guidance(theirs), direction, goal_weight, blocked))
        times.append(time)
    for field in fields:
        point_out_(field, blocked)
    return Navigation(float(cell), np.array(fields), np.array(times).reshape(-1, *blocked.shape))


@njit(cache=True, nogil=True)
def follow(lo, hi, xy, goal, cell, fields, out):
    """Write to ``out[lo:hi]`` (n, 2) what animals bound to ``goal`` (n,) feel at ``xy`` (n, 2 or more) m."""
    ny, nx = fields.shape[1], fields.shape[2]
    for i in range(lo, hi):
        field = fields[goal[i] + 1]
        x = min(max(xy[i, 0] / cell - 0.5, 0.0), nx - 1.0)
        y = min(max(xy[i, 1] / cell - 0.5, 0.0), ny - 1.0)
        ix, iy = int(x), int(y)
        jx, jy = min(ix + 1, nx - 1), min(iy + 1, ny - 1)
        a, b = x - ix, y - iy
        for k in range(2):
            south = field[iy, ix, k] * (1.0 - a) + field[iy, jx, k] * a
            north = field[jy, ix, k] * (1.0 - a) + field[jy, jx, k] * a
            out[i, k] = south * (1.0 - b) + north * b


# Guides --------------------------------------------------------------------------------------------------------


def guide_field(guides, shape, cell, blocked=None):
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
    for points, strength, radius, decay in _in_order(guides, cell):
        inside, seeds = trace_(points, ny, nx)
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


# The sweep -----------------------------------------------------------------------------------------------------


@njit(cache=True, nogil=True)
def march_(seeds, slowness, limit, targets):
    """Least cost from the seeds to every cell: |grad T| = slowness, by fast marching.

    First order; a front never squeezes through the point where two blocked cells touch.

    Parameters
    ----------
    seeds : (ny, nx)
        Cost at the seeds, infinite elsewhere.
    slowness : (ny, nx)
        Cost per cell, positive; infinite where blocked.
    limit : float
        Cells that cost more are left out.
    targets : (k,) int64
        Stop as soon as these cells, ``iy * nx + ix``, are reached; empty: go everywhere.

    Returns
    -------
    time : (ny, nx)
        Infinite where the front does not come.
    order : (m,) int64
        The cells reached, as ``iy * nx + ix``, the nearest first.
    """
    ny, nx = slowness.shape
    wide = nx + 2  # a rim of blocked cells spares every look at the edge
    slow = rimmed_(slowness)
    first = rimmed_(seeds)  # the earliest time found so far
    known = np.full(slow.size, np.inf)
    wanted = np.zeros(slow.size, np.bool_)
    for c in targets:
        wanted[(c // nx + 1) * wide + c % nx + 1] = True
    missing = wanted.sum() if len(targets) else -1
    # a cell is put on the heap as a seed and once by each neighbour at most; memory that stays unused costs nothing
    times, cells, size = np.empty(5 * slow.size), np.empty(5 * slow.size, np.int64), 0
    for c in range(slow.size):
        if first[c] < np.inf and first[c] <= limit and slow[c] < np.inf:
            rise_(times, cells, size, first[c], c)
            size += 1
        else:
            first[c] = np.inf
    order, count = np.empty(ny * nx, np.int64), 0
    while size > 0 and missing != 0:
        t, c = times[0], cells[0]
        size -= 1
        replace_first_(times, cells, size, times[size], cells[size])
        if known[c] < np.inf:
            continue  # it was reached earlier, by a shorter way
        known[c] = t
        order[count] = c
        count += 1
        if wanted[c]:
            missing -= 1
        for step in (1, wide, -1, -wide):
            to = c + step
            if known[to] == np.inf and slow[to] < np.inf:
                new, _, _ = arrive_(known, slow, wide, to)
                if new < first[to] and new <= limit:
                    first[to] = new
                    rise_(times, cells, size, new, to)
                    size += 1
    iy, ix = order[:count] // wide - 1, order[:count] % wide - 1
    return known.reshape(ny + 2, wide)[1:-1, 1:-1].copy(), iy * nx + ix


@njit(cache=True, nogil=True)
def rimmed_(values):
    """The grid with a rim of infinity, flat."""
    ny, nx = values.shape
    out = np.full((ny + 2, nx + 2), np.inf)
    out[1:-1, 1:-1] = values
    return out.reshape(-1)


@njit(cache=True, nogil=True)
def arrive_(known, slow, wide, c):
    """When a front of known times arrives at a cell (of rimmed grids), and where from: not normalised, east, north."""
    f = slow[c]
    west, east, south, north = known[c - 1], known[c + 1], known[c - wide], known[c + wide]
    tx, dx = (east, 1) if east <= west else (west, -1)
    ty, dy = (north, 1) if north <= south else (south, -1)
    if tx == np.inf and ty == np.inf:
        return np.inf, 0.0, 0.0
    apart = abs(tx - ty)
    if apart >= f:
        return (tx + f, dx * f, 0.0) if tx < ty else (ty + f, 0.0, dy * f)
    if slow[c + dx + dy * wide] < np.inf:
        t = 0.5 * (tx + ty + np.sqrt(2.0 * f * f - apart * apart))
        return t, dx * (t - tx), dy * (t - ty)
    return arrive_beside_(known, slow, wide, c)


@njit(cache=True, nogil=True)
def arrive_beside_(known, slow, wide, c):
    """`arrive_` where the best two neighbours have the corner of an obstacle between them: the best of four."""
    f = slow[c]
    best, gx, gy = np.inf, 0.0, 0.0
    for dx, dy in QUADRANTS:
        tx, ty = known[c + dx], known[c + dy * wide]
        apart = abs(tx - ty)
        if apart < f and slow[c + dx + dy * wide] < np.inf:
            t = 0.5 * (tx + ty + np.sqrt(2.0 * f * f - apart * apart))
            if t < best:
                best, gx, gy = t, dx * (t - tx), dy * (t - ty)
        elif tx <= ty and tx + f < best:
            best, gx, gy = tx + f, dx * f, 0.0
        elif ty < tx and ty + f < best:
            best, gx, gy = ty + f, 0.0, dy * f
    return best, gx, gy


@njit(cache=True, nogil=True)
def rise_(keys, items, i, key, item):
    """Put an item at position i of a binary heap, or as far above as its key is smaller."""
    while i > 0 and key < keys[(i - 1) >> 1]:
        above = (i - 1) >> 1
        keys[i], items[i] = keys[above], items[above]
        i = above
    keys[i], items[i] = key, item


@njit(cache=True, nogil=True)
def replace_first_(keys, items, size, key, item):
    """Take the first of a binary heap out and put another in, of which there are then that many.

    The gap goes down to a leaf first, and the item up from there: it was the last, so it rarely rises far.
    """
    i = 0
    while 2 * i + 2 < size:
        below = 2 * i + 1
        below += keys[below + 1] < keys[below]
        keys[i], items[i] = keys[below], items[below]
        i = below
    if 2 * i + 1 < size:
        keys[i], items[i] = keys[2 * i + 1], items[2 * i + 1]
        i = 2 * i + 1
    rise_(keys, items, i, key, item)


@njit(cache=True, nogil=True)
def spread_(values, seeds, distance, order):
    """Carry values (ny, nx, k) from the seeds outwards: each cell takes the mean of its neighbours that are nearer.

    A neighbour counts by how much nearer it is; a neighbour behind the corner of an obstacle does not count.
    """
    nx = distance.shape[1]
    wide = nx + 2
    far = rimmed_(distance)
    out = np.zeros(values.shape)
    for c in order:
        iy, ix = c // nx, c % nx
        if seeds[iy, ix] < np.inf:
            out[iy, ix] = values[iy, ix]
            continue
        here, total = (iy + 1) * wide + ix + 1, 0.0
        for dx, dy in AROUND:
            weight = far[here] - far[here + dx + dy * wide]
            if weight <= 0.0:
                continue
            if dx * dy != 0:
                if far[here + dx] == np.inf or far[here + dy * wide] == np.inf:
                    continue
                weight *= 0.5
            total += weight
            for k in range(values.shape[2]):
                out[iy, ix, k] += weight * out[iy + dy, ix + dx, k]
        for k in range(values.shape[2]):
            out[iy, ix, k] /= total
    return out


# Obstacles -----------------------------------------------------------------------------------------------------


def cancelling_field(field, blocked, radius_cells):
    """The cancelling field CF of eq. 14 [1]_: added to a field, nobody is sent into a wall.

    In a cell beside an obstacle it is the sum of eq. 14 over the blocked neighbours that the field could be
    propagated to: those to the east, north, west and south, and a diagonal one when it stands out as a corner (both
    cells between are free) and the field heads for it (within 22.5 degrees).  Counting every diagonal would cancel a
    flat wall's part twice and send animals back.  From there CF spreads outwards, averaged, fading linearly to
    nothing at the radius; away from the wall it never takes more than the field has in that direction.

    Parameters
    ----------
    field : ndarray, (ny, nx, 2)
        The field GF.
    blocked : ndarray, (ny, nx) bool
        Obstacles.
    radius_cells : float
        How far it reaches, in cells; up to 1: only beside the obstacle.  0: no cancelling at all.

    Returns
    -------
    ndarray, (ny, nx, 2)
        CF, zero in blocked cells.
    """
    blocked = np.ascontiguousarray(blocked, bool)
    return _cancel(np.ascontiguousarray(field, np.float64), blocked, radius_cells, np.zeros(blocked.shape))[..., :2]


def around_obstacles(field, blocked, radius_cells):
    """A guide field that leads along walls, and round them where it would run straight into one.

    The field plus its `cancelling_field` runs along walls.  Straight at a wall nothing is left (the paper's result);
    a user expects the herd to go round.  So the nearer way round to where the guide comes out again behind that
    obstacle decides the side, left or right of the guide's direction, and the field turns to that side by as much
    as is cancelled.  That matters within about 38 degrees of head-on; a guide that meets the wall at a smaller angle
    keeps its own side.  If there is no way round (the wall closes off the map, or the guide ends inside) nothing
    replaces what was cancelled.  The length of the field is kept, unless less than a quarter of it is left.

    A way round that first leads back (out of a pocket) is not taken: that needs a goal.

    Parameters
    ----------
    field : ndarray, (ny, nx, 2)
        What `guide_field` gives.
    blocked : ndarray, (ny, nx) bool
        Obstacles.
    radius_cells : float
        How far from obstacles the field begins to turn, in cells.

    Returns
    -------
    ndarray, (ny, nx, 2)
        In no cell does it lead into a blocked one.
    """
    blocked = np.ascontiguousarray(blocked, bool)
    field = np.ascontiguousarray(field, np.float64)
    side = _sides(field, blocked) if radius_cells > 0 else np.zeros(blocked.shape)
    out = turn_(field, _cancel(field, blocked, radius_cells, side))
    keep_out_(out, blocked)
    return out


def _cancel(field, blocked, radius_cells, side):
    """(ny, nx, 3) the cancelling field and, averaged likewise, the side to turn to."""
    if radius_cells <= 0:
        return np.zeros((*blocked.shape, 3))
    seeds, values = beside_(field, blocked, side)
    slowness = np.where(blocked, np.inf, 1.0)
    distance, order = march_(seeds, slowness, max(1.0, radius_cells), EVERYWHERE)
    return fade_(field, spread_(values, seeds, distance, order), distance, order, radius_cells)


@njit(cache=True, nogil=True)
def is_blocked_(blocked, iy, ix):
    """Whether there is an obstacle; beyond the map there is none."""
    return 0 <= iy < blocked.shape[0] and 0 <= ix < blocked.shape[1] and blocked[iy, ix]


@njit(cache=True, nogil=True)
def beside_(field, blocked, side):
    """Eq. 14 in the cells that touch an obstacle, the side to turn to, and their distance from it (1 cell)."""
    ny, nx = blocked.shape
    seeds = np.full((ny, nx), np.inf)
    values = np.zeros((ny, nx, 3))
    for iy in range(ny):
        for ix in range(nx):
            if blocked[iy, ix]:
                continue
            gx, gy = field[iy, ix]
            for dx, dy in AROUND:
                if not is_blocked_(blocked, iy + dy, ix + dx):
                    continue
                seeds[iy, ix] = 1.0
                long = np.sqrt(1.0 * (dx * dx + dy * dy))
                vx, vy = dx / long, dy / long
                ahead = gx * vx + gy * vy
                if ahead <= 0.0:
                    continue
                if dx * dy != 0:
                    corner = not is_blocked_(blocked, iy, ix + dx) and not is_blocked_(blocked, iy + dy, ix)
                    aside = abs(gy * vx - gx * vy)
                    if not corner or aside > ahead * (np.sqrt(2.0) - 1.0):  # tan 22.5 degrees
                        continue
                values[iy, ix, 0] -= ahead * vx  # eq. 14
                values[iy, ix, 1] -= ahead * vy
            values[iy, ix, 2] = side[iy, ix]
    return seeds, values


@njit(cache=True, nogil=True)
def fade_(field, spread, distance, order, radius):
    """The cancelling field with its falloff, never more than the field has in that direction."""
    nx = distance.shape[1]
    out = np.zeros(spread.shape)
    for c in order:
        iy, ix = c // nx, c % nx
        cx, cy, side = spread[iy, ix]
        long = np.sqrt(cx * cx + cy * cy)
        falloff = 1.0 - (distance[iy, ix] - 1.0) / max(radius, 1.0)
        if long == 0.0 or falloff <= 0.0:
            continue
        ahead = -(field[iy, ix, 0] * cx + field[iy, ix, 1] * cy) / long
        amount = min(long * falloff, max(0.0, ahead))
        out[iy, ix, 0], out[iy, ix, 1], out[iy, ix, 2] = cx / long * amount, cy / long * amount, side
    return out


@njit(cache=True, nogil=True)
def turn_(field, cancel):
    """The field with its cancelled part turned to the side, lengths kept."""
    out = np.empty(field.shape)
    for iy in range(field.shape[0]):
        for ix in range(field.shape[1]):
            gx, gy = field[iy, ix]
            cx, cy, side = cancel[iy, ix]
            strength = np.sqrt(gx * gx + gy * gy)
            share = (cx * cx + cy * cy) / (strength * strength) if strength > 0.0 else 0.0
            x = gx + cx - gy * side * share
            y = gy + cy + gx * side * share
            out[iy, ix, 0], out[iy, ix, 1] = lengthened_(x, y, strength)
    return out


@njit(cache=True, nogil=True)
def lengthened_(x, y, strength):
    """The vector with that length, but at most `FULL` times its own."""
    long = np.sqrt(x * x + y * y)
    if long <= 1e-12 * strength:  # nothing is left but rounding
        return 0.0, 0.0
    scale = min(strength, FULL * long) / long
    return x * scale, y * scale


def _sides(field, blocked):
    """(ny, nx) the side that leads round, in cells where the field runs straight at an obstacle: 1 left, -1 right."""
    side = np.zeros(blocked.shape)
    cells, exits = head_on_(field, blocked)
    if len(cells) == 0:
        return side
    from scipy.ndimage import find_objects, label  # late: most levels need no way round, and it takes long to load

    obstacle, _ = label(blocked, np.ones((3, 3)))
    nx = blocked.shape[1]
    hit = obstacle[exits[:, 1] // nx, exits[:, 1] % nx]
    boxes = find_objects(obstacle)
    for number in np.unique(hit):
        ys, xs = boxes[number - 1]
        size = ys.stop - ys.start + xs.stop - xs.start + 2
        top, left = max(0, ys.start - size), max(0, xs.start - size)
        part = np.s_[top : ys.stop + size, left : xs.stop + size]  # no shorter way round leaves it
        mine = hit == number
        choose_side_(side, cells[mine], exits[mine, 0], field, blocked[part], top, left, 2.0 * size)
    return side


@njit(cache=True, nogil=True)
def head_on_(field, blocked):
    """Cells beside an obstacle whose field runs into it; for each where a ray along the field comes out again, and
    the last blocked cell of the ray; all as ``iy * nx + ix``."""
    ny, nx = blocked.shape
    cells, exits, count = np.empty(ny * nx, np.int64), np.empty((ny * nx, 2), np.int64), 0
    for iy in range(ny):
        for ix in range(nx):
            gx, gy = field[iy, ix]
            long = max(abs(gx), abs(gy))
            if blocked[iy, ix] or long == 0.0:
                continue
            ux, uy = gx / long, gy / long
            if not is_blocked_(blocked, iy + round_(uy), ix + round_(ux)):
                continue
            t = 1.0
            while is_blocked_(blocked, iy + round_(t * uy), ix + round_(t * ux)):
                t += 1.0
            jy, jx = iy + round_(t * uy), ix + round_(t * ux)
            if 0 <= jy < ny and 0 <= jx < nx:
                cells[count] = iy * nx + ix
                exits[count, 0] = jy * nx + jx
                exits[count, 1] = (iy + round_((t - 1.0) * uy)) * nx + ix + round_((t - 1.0) * ux)
                count += 1
    return cells[:count], exits[:count]


@njit(cache=True, nogil=True)
def round_(x):
    """The nearest whole number; halves away from zero, so that mirrored scenes stay mirrored."""
    return int(np.floor(x + 0.5)) if x >= 0.0 else -int(np.floor(0.5 - x))


@njit(cache=True, nogil=True)
def choose_side_(side, cells, exits, field, blocked, top, left, limit):
    """Write the side that leads from the cells round to the exits, within a part of the map that begins at top, left.

    Left (1) or right (-1) of the field's direction; it stays 0 where the shortest way leads back, or nowhere.
    """
    nx = side.shape[1]
    ny_part, nx_part = blocked.shape
    seeds, slowness = np.full(blocked.shape, np.inf), np.ones(blocked.shape)
    for iy in range(ny_part):
        for ix in range(nx_part):
            if blocked[iy, ix]:
                slowness[iy, ix] = np.inf
    targets = (cells // nx - top) * nx_part + cells % nx - left
    for c in exits:
        seeds[c // nx - top, c % nx - left] = 0.0
    time, _ = march_(seeds, slowness, limit, targets)
    known, slow = rimmed_(time), rimmed_(slowness)
    for c in cells:
        iy, ix = c // nx, c % nx
        if time[iy - top, ix - left] == np.inf:
            continue
        gx, gy = field[iy, ix]
        _, wx, wy = arrive_(known, slow, nx_part + 2, (iy - top + 1) * (nx_part + 2) + ix - left + 1)
        aside, ahead = gx * wy - gy * wx, gx * wx + gy * wy
        if abs(aside) > -ahead and aside != 0.0:
            side[iy, ix] = 1.0 if aside > 0.0 else -1.0


@njit(cache=True, nogil=True)
def keep_out_(field, blocked):
    """Take out of the field, in place, what leads into a blocked cell within a cell's length, lengths kept."""
    ny, nx = blocked.shape
    for iy in range(ny):
        for ix in range(nx):
            u, v = field[iy, ix]
            if blocked[iy, ix] or (u == 0.0 and v == 0.0):
                continue
            strength = np.sqrt(u * u + v * v)
            dx, dy = 1 if u > 0.0 else -1, 1 if v > 0.0 else -1
            if is_blocked_(blocked, iy, ix + dx):
                u = 0.0
            if is_blocked_(blocked, iy + dy, ix):
                v = 0.0
            if is_blocked_(blocked, iy + dy, ix + dx):  # pass its corner at a distance
                if abs(u) >= abs(v):
                    v = dy * min(abs(v), abs(u) / 3.0)
                else:
                    u = dx * min(abs(u), abs(v) / 3.0)
            field[iy, ix, 0], field[iy, ix, 1] = lengthened_(u, v, strength)


@njit(cache=True, nogil=True)
def point_out_(field, blocked):
    """In blocked cells, the way out to the free cells around, as strong as the field is there.

    Between a free and a blocked cell centre the field is a mixture of both, so animals are kept off the wall, and
    an animal on the rim of a blocked cell (cells are coarser than obstacles) is led off it.  In thin walls it is
    zero: there is no telling which side is out.
    """
    ny, nx = blocked.shape
    for iy in range(ny):
        for ix in range(nx):
            if not blocked[iy, ix]:
                continue
            x, y, strength, free = 0.0, 0.0, 0.0, 0
            for dx, dy in AROUND:
                jy, jx = iy + dy, ix + dx
                if jy < 0 or jx < 0 or jy == ny or jx == nx or blocked[jy, jx]:
                    continue
                long = np.sqrt(1.0 * (dx * dx + dy * dy))
                x, y, free = x + dx / long, y + dy / long, free + 1
                strength += np.sqrt(field[jy, jx, 0] * field[jy, jx, 0] + field[jy, jx, 1] * field[jy, jx, 1])
            field[iy, ix, 0], field[iy, ix, 1] = lengthened_(x, y, strength / max(free, 1))


# Goals ---------------------------------------------------------------------------------------------------------


def goal_mask(xy, radius, polygon, shape, cell):
    """(ny, nx) bool, the cells of a goal: centres inside the polygon or, without one, the disc about ``xy``, m.

    A goal smaller than a cell is the cell that it lies in; one outside of the map has no cell.
    """
    ny, nx = shape
    if polygon is not None and len(polygon) > 2:
        mask = rasterise_polygon(polygon, shape, cell)
    else:
        x, y = (np.arange(nx) + 0.5) * cell - xy[0], (np.arange(ny) + 0.5) * cell - xy[1]
        mask = x * x + (y * y)[:, None] <= radius * radius
    if not mask.any() and 0 <= xy[0] < nx * cell and 0 <= xy[1] < ny * cell:
        mask[min(int(xy[1] / cell), ny - 1), min(int(xy[0] / cell), nx - 1)] = True
    return mask


def goal_field(goal, cost, blocked, cell):
    """The least-cost way to a goal from everywhere.

    The sweep follows [1]_ in taking one destination over ground of varying cost; it is fast marching, so ways run at
    any angle and not in the eight directions of the grid.

    Parameters
    ----------
    goal : ndarray, (ny, nx) bool
        The goal's cells.  A goal that lies inside an obstacle is reached at the free cells nearest to it.
    cost : ndarray, (ny, nx) or None
        Cost of a metre; infinite is blocked.
    blocked : ndarray, (ny, nx) bool
        Where no way leads.
    cell : float
        Size of a cell, m.

    Returns
    -------
    direction : ndarray, (ny, nx, 2)
        Unit vectors along the steepest descent of time; zero in the goal, in blocked cells and where no way leads to
        the goal.  None leads into a blocked cell.
    time : ndarray, (ny, nx)
        Least cost to the goal, m of plain ground; infinite where no way leads.

    Raises
    ------
    ValueError
        When a cost is zero, negative or NaN.
    """
    blocked, cost = _ground(blocked, cost)
    slowness = np.where(blocked, np.inf, cost * cell)
    goal = _free_part(np.asarray(goal, bool), np.isinf(slowness))
    time, _ = march_(np.where(goal, 0.0, np.inf), slowness, np.inf, EVERYWHERE)
    direction = descent_(time, slowness)
    direction[goal] = 0.0
    keep_out_(direction, np.isinf(slowness))
    return direction, time


def _free_part(goal, blocked):
    """The free cells of a goal, or those nearest to it when it has none."""
    if not goal.any() or not (goal & blocked).any() or (goal & ~blocked).any() or blocked.all():
        return goal & ~blocked
    ys, xs = np.nonzero(goal)
    y, x = np.arange(goal.shape[0]) - ys.mean(), np.arange(goal.shape[1]) - xs.mean()
    away = np.where(blocked, np.inf, np.sqrt(x * x + (y * y)[:, None]))
    return away <= away.min() + 1.0


@njit(cache=True, nogil=True)
def descent_(time, slowness):
    """(ny, nx, 2) unit vectors of steepest descent of time; zero where time is infinite or nothing is nearer."""
    ny, nx = time.shape
    known, slow = rimmed_(time), rimmed_(slowness)
    out = np.zeros((ny, nx, 2))
    for iy in range(ny):
        for ix in range(nx):
            if time[iy, ix] == np.inf:
                continue
            t, gx, gy = arrive_(known, slow, nx + 2, (iy + 1) * (nx + 2) + ix + 1)
            if t <= time[iy, ix]:
                long = np.sqrt(gx * gx + gy * gy)
                out[iy, ix, 0], out[iy, ix, 1] = gx / long, gy / long
    return out


def blend(guidance, direction, goal_weight=1.0, blocked=None):
    """Guides where they reach, the goal where they fade.

    With a the length of the guidance (how strongly guides hold) and w the goal's weight, the direction is that of
    ``guidance + w (1 - a) direction``, and the length ``a + w (1 - a)``.  So a guide of strength 1 rules alone within
    its radius, one of strength .5 shares with the goal half and half, and far from all guides the goal rules.
    Where the two cancel exactly, the goal wins; where no way leads to the goal the guides are left.

    Parameters
    ----------
    guidance, direction : ndarray, (ny, nx, 2)
        What the guides say; where the goal is.
    goal_weight : float
        0: guides alone; 1: the goal field fills in wherever guides fade.
    blocked : ndarray, (ny, nx) bool, optional
        The result is kept from leading into these.

    Returns
    -------
    ndarray, (ny, nx, 2)
    """
    out = blend_(np.asarray(guidance, np.float64), np.asarray(direction, np.float64), float(goal_weight))
    if blocked is not None:
        keep_out_(out, np.ascontiguousarray(blocked, bool))
    return out


@njit(cache=True, nogil=True)
def blend_(guidance, direction, goal_weight):
    """`blend`, cell by cell."""
    ny, nx, _ = guidance.shape
    out = np.zeros((ny, nx, 2))
    for iy in range(ny):
        for ix in range(nx):
            gx, gy = guidance[iy, ix]
            dx, dy = direction[iy, ix]
            a = min(1.0, np.sqrt(gx * gx + gy * gy))
            w = goal_weight * (1.0 - a)
            strength = min(1.0, a + w * np.sqrt(dx * dx + dy * dy))
            x, y = gx + w * dx, gy + w * dy
            if x * x + y * y <= 1e-18 * strength * strength:  # they cancel
                x, y = dx, dy
            long = np.sqrt(x * x + y * y)
            if long > 0.0:
                out[iy, ix, 0], out[iy, ix, 1] = x / long * strength, y / long * strength
    return out


# Small helpers -------------------------------------------------------------------------------------------------


def _ground(blocked, cost):
    """Checked (blocked, cost): blocked where the cost is infinite too."""
    blocked = np.asarray(blocked, bool)
    cost = np.ones(blocked.shape) if cost is None else np.asarray(cost, np.float64)
    if cost.shape != blocked.shape:
        raise ValueError(f"cost is {cost.shape} cells and blocked {blocked.shape}: they must be the same grid")
    blocked = np.ascontiguousarray(blocked | (cost == np.inf))
    if not (cost[~blocked] > 0).all():
        raise ValueError("a cost must be more than 0: ways over ground that costs nothing are not defined")
    return blocked, cost


def _mask_of(goal, shape, cell):
    if isinstance(goal, np.ndarray):
        return goal
    return goal_mask(goal.xy, goal.radius, goal.polygon, shape, cell)


def _cells_under(xy, cell, shape):
    """(iy, ix) of the cells under xy (n, 2) m, clamped to the map."""
    ix = np.clip(np.floor(xy[:, 0] / cell), 0, shape[1] - 1).astype(np.int64)
    return np.clip(np.floor(xy[:, 1] / cell), 0, shape[0] - 1).astype(np.int64), ix
