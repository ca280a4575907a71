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
marching sweep (`flockbrush.systems.fast_marching`); ways to goals over hills
cost what animals lose there (`flockbrush.systems.hill_marching`).  Everything
here is ``+ - * / sqrt`` and `flockbrush.engine.maths.exp_`.

Arrays are ``[iy, ix]``, row 0 in the south; cell ``(iy, ix)`` has its centre at
``((ix + .5) * cell, (iy + .5) * cell)``.

References
----------
.. [1] Gong et al. 2025, Herds From Video: Learning a Microscopic Herd Model
   From Macroscopic Motion Data, section 7.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.fast_marching import EVERYWHERE, arrive_, march_, rimmed_
from flockbrush.systems.guide_field import guide_field
from flockbrush.systems.hill_marching import march_on_hills_
from flockbrush.systems.terrain import rasterise_polygon
from flockbrush.systems.walls import around_obstacles, point_out_, remove_flow_into_walls_
from numba import njit

HERE = np.zeros((1, 2))  # m: a map that does not go on is where it is
ORDER = 0, -1, 1  # the map itself first
ASIDE = 2.0  # cells from obstacles at which guides begin to turn aside

# Navigation: what the rest of the house uses -------------------------------------------------------------------


@dataclass(frozen=True)
class Navigation:
    """The navigation fields of a level."""

    cell: float  # size of a grid cell, m
    # (limits * (1 + goals), ny, nx, 2); direction to go, its length at most 1 and saying how strongly. ``fields[0]`` is
    # for animals without a goal, guides alone; ``fields[1 + k]`` is for those bound to goal ``k``.  On hills the same
    # follows for each of the other slope limits of animals.
    fields: np.ndarray
    # (limits * goals, ny, nx); least cost to the goal, metres of plain ground; infinite where no way leads there
    times: np.ndarray
    wrap: bool = False  # the map goes on at the opposite border

    @property
    def guidance(self):
        """(ny, nx, 2) the field of the guides alone."""
        return self.fields[0]

    def at(self, xy, goal=-1):
        """What animals at ``xy`` feel.

        Parameters
        ----------
        xy : array_like, (n, 2)
            Metres.  Outside of the map the nearest point of the map counts, or that of the map that goes on there.
        goal : int or array_like of int, (n,)
            Which goal each animal is bound to, -1 for none; ``1 + goals`` more for each slope limit before its own.

        Returns
        -------
        ndarray, (n, 2)
        """
        xy = np.ascontiguousarray(xy, np.float64).reshape(-1, 2)
        goal = np.ascontiguousarray(np.broadcast_to(np.asarray(goal, np.int32), len(xy)))
        if len(goal) and not -1 <= goal.min() <= goal.max() < len(self.fields) - 1:
            raise ValueError(f"a goal is -1 to {len(self.fields) - 2} here, got {goal.min()} to {goal.max()}")
        out = np.empty((len(xy), 2))
        over_rows(follow, len(xy), xy, goal, self.cell, self.fields, self.wrap, out)
        return out


def navigation_of(guides, goals, blocked, cost=None, cell=1.0, height=None, wrap=False):
    """The navigation fields of a level.

    Where the map goes on at the opposite border, guides and ways lead over it (`EndlessMap`).

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
    height : ndarray, (ny, nx), optional
        Of the ground, m; flat by default.
    wrap : bool

    Returns
    -------
    Navigation
    """
    blocked, cost = _ground(blocked, cost)
    around = EndlessMap(blocked.shape, cell) if wrap else None
    if around is not None:
        blocked, cost, height = around.more(blocked), around.more(cost), None if height is None else around.more(height)
    images, known = around.images if around else HERE, {}

    def guidance(chosen):
        if chosen not in known:
            field = guide_field([guides[i] for i in chosen], blocked.shape, cell, blocked, images)
            known[chosen] = around_obstacles(field, blocked, ASIDE)
        return known[chosen]

    fields, times = [guidance(tuple(range(len(guides)))).copy()], []
    for goal in goals:
        name = getattr(goal, "name", None)
        theirs = tuple(i for i, guide in enumerate(guides) if getattr(guide, "goal", "") in ("", None, name))
        if isinstance(goal, np.ndarray):
            mask = around.more(goal) if around else goal
        else:
            mask = goal_mask(goal.xy, goal.radius, goal.polygon, blocked.shape, cell, images)
        direction, time = goal_field(mask, cost, blocked, cell, height)
        fields.append(blend(guidance(theirs), direction, blocked))
        times.append(time)
    for field in fields:
        point_out_(field, blocked)
    found = np.array(fields), np.array(times).reshape(-1, *blocked.shape)
    return Navigation(float(cell), *(found if around is None else map(around.middle, found)), wrap)


class EndlessMap:
    """A map that goes on at the opposite border, with all of it again on each side: ways may wind that far.

    Parameters
    ----------
    shape : (ny, nx)
    cell : float
        Size of a cell, m.
    """

    def __init__(self, shape, cell):
        self._shape = ny, nx = shape
        # (9, 2) m: where the map lies in the larger one, and its neighbours
        self.images = np.array([(nx * (1 + i), ny * (1 + k)) for k in ORDER for i in ORDER], float) * cell

    def more(self, values):
        """The grid (ny, nx), larger."""
        return np.tile(values, (3, 3))

    def middle(self, values):
        """The map itself out of larger grids (k, 3 ny, 3 nx, ...)."""
        ny, nx = self._shape
        return np.ascontiguousarray(values[:, ny : 2 * ny, nx : 2 * nx])


@njit(cache=True, nogil=True)
def follow(lo, hi, xy, goal, cell, fields, wrap, out):
    """Write to ``out[lo:hi]`` (n, 2) what animals bound to ``goal`` (n,) feel at ``xy`` (n, 2 or more) m."""
    ny, nx = fields.shape[1], fields.shape[2]
    for i in range(lo, hi):
        field = fields[goal[i] + 1]
        x, y = xy[i, 0] / cell - 0.5, xy[i, 1] / cell - 0.5
        if not wrap:
            x, y = min(max(x, 0.0), nx - 1.0), min(max(y, 0.0), ny - 1.0)
        ix, iy = int(np.floor(x)), int(np.floor(y))
        a, b = x - ix, y - iy
        if wrap:
            ix, iy = ix % nx, iy % ny
            jx, jy = (ix + 1) % nx, (iy + 1) % ny
        else:
            jx, jy = min(ix + 1, nx - 1), min(iy + 1, ny - 1)
        for k in range(2):
            south = field[iy, ix, k] * (1.0 - a) + field[iy, jx, k] * a
            north = field[jy, ix, k] * (1.0 - a) + field[jy, jx, k] * a
            out[i, k] = south * (1.0 - b) + north * b


# Goals ---------------------------------------------------------------------------------------------------------


def goal_mask(xy, radius, polygon, shape, cell, images=HERE):
    """(ny, nx) bool, the cells of a goal: centres inside the polygon or, without one, the disc about ``xy``, m.

    A goal smaller than a cell is the cell that it lies in; one outside of the map has no cell.  The goal is once at
    each of the ``images`` (k, 2), m, by which it is moved.
    """
    ny, nx = shape
    found = np.zeros(shape, bool)
    for image in images:
        x, y = xy[0] + image[0], xy[1] + image[1]
        if polygon is not None and len(polygon) > 2:
            mask = rasterise_polygon(np.asarray(polygon, float) + image, shape, cell)
        else:
            east, north = (np.arange(nx) + 0.5) * cell - x, (np.arange(ny) + 0.5) * cell - y
            mask = east * east + (north * north)[:, None] <= radius * radius
        if not mask.any() and 0 <= x < nx * cell and 0 <= y < ny * cell:
            mask[min(int(y / cell), ny - 1), min(int(x / cell), nx - 1)] = True
        found |= mask
    return found


def goal_field(goal, cost, blocked, cell, height=None):
    """The least-cost way to a goal from everywhere.

    The sweep follows [1]_ in taking one destination over ground of varying cost; it is fast marching, so ways run at
    any angle and not in the eight directions of the grid.  On hills a metre costs as much more as animals are slower
    there, up or down (`flockbrush.systems.terrain.slope_factor_`).

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
    height : ndarray, (ny, nx), optional
        Of the ground, m; flat by default.

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
    seeds = np.where(goal, 0.0, np.inf)
    if height is None:
        time, _ = march_(seeds, slowness, np.inf, EVERYWHERE)
        direction = descent_(time, slowness)
    else:
        time, direction = march_on_hills_(seeds, slowness, np.ascontiguousarray(height, np.float64), float(cell))
    direction[goal] = 0.0
    remove_flow_into_walls_(direction, np.isinf(slowness))
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


def blend(guidance, direction, blocked=None):
    """Guides where they reach, the goal where they fade.

    With a the length of the guidance (how strongly guides hold), the direction is that of
    ``guidance + (1 - a) direction``, and the length ``a + (1 - a) |direction|``.  So a guide of strength 1 rules alone
    within its radius, one of strength .5 shares with the goal half and half, and far from all guides the goal rules.
    Where the two cancel exactly, the goal wins; where no way leads to the goal the guides are left.

    Parameters
    ----------
    guidance, direction : ndarray, (ny, nx, 2)
        What the guides say; where the goal is.
    blocked : ndarray, (ny, nx) bool, optional
        The result is kept from leading into these.

    Returns
    -------
    ndarray, (ny, nx, 2)
    """
    out = blend_(np.asarray(guidance, np.float64), np.asarray(direction, np.float64))
    if blocked is not None:
        remove_flow_into_walls_(out, np.ascontiguousarray(blocked, bool))
    return out


@njit(cache=True, nogil=True)
def blend_(guidance, direction):
    """`blend`, cell by cell."""
    ny, nx, _ = guidance.shape
    out = np.zeros((ny, nx, 2))
    for iy in range(ny):
        for ix in range(nx):
            gx, gy = guidance[iy, ix]
            dx, dy = direction[iy, ix]
            a = min(1.0, np.sqrt(gx * gx + gy * gy))
            w = 1.0 - a
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
