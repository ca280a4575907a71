"""A field near obstacles: what would lead into a wall is taken away, and who comes head on is sent round.

The cancelling field of Gong et al. 2025, eq. 14; what the paper leaves open is
settled in the functions below.
"""

from __future__ import annotations

import numpy as np
from flockbrush.systems.fast_marching import AROUND, EVERYWHERE, arrive_, march_, rimmed_, spread_
from numba import njit

FULL = 4.0  # a field turned aside by a wall keeps its length unless less than 1/4 of it is left


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
    out = turn_(field, cancelling_field(field, blocked, radius_cells, side))
    remove_flow_into_walls_(out, blocked)
    return out


def cancelling_field(field, blocked, radius_cells, side):
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
    side : ndarray, (ny, nx)
        To which side cells turn: 1 left, -1 right, 0 neither.

    Returns
    -------
    ndarray, (ny, nx, 3)
        CF, zero in blocked cells, and the side, averaged likewise.
    """
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
        part = np.ascontiguousarray(blocked[top : ys.stop + size, left : xs.stop + size])  # no shorter way leaves it
        mine = hit == number
        choose_side_(side, cells[mine], exits[mine, 0], field, part, top, left, 2.0 * size)
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
def remove_flow_into_walls_(field, blocked):
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
