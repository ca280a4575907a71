"""Ground under the animals: brush, speed factor, speed cap, slope and height, for every animal in every tick.

Layers and zones are composed once, when a level is built or painted, into one raster each; a tick then reads the
cell under the animal (`sample_ground`).  Colours on the ground end at their cell's edge; height and slope are
continuous.

Arrays are ``[iy, ix]``, row 0 in the south; cell ``(iy, ix)`` has its centre at
``((ix + .5) * cell, (iy + .5) * cell)``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.maths import exp_, kernel_function
from flockbrush.engine.raster import corners_
from flockbrush.engine.seam import images
from numba import njit

NO_BRUSH = -1

STEEPNESS = 3.5  # Tobler 1993: speed falls by a factor e for every 1/3.5 of slope
BEST_SLOPE = -0.05  # Tobler 1993: a gentle way down is the fastest


# In a tick -----------------------------------------------------------------------------------------------------


class Footing(NamedTuple):
    """The ground under each animal, (n,) each unless stated."""

    factor: np.ndarray  # of speed
    cap: np.ndarray  # m/s
    brush: np.ndarray  # int32; -1 for unpainted ground
    slope: np.ndarray  # (n, 2) rise per metre, east and north
    height: np.ndarray  # m


@njit(cache=True, nogil=True)
def sample_ground(lo, hi, xyz, cell, surface, brush, heights, footing):
    """Write rows ``lo`` to ``hi``: the ground under each animal.

    Parameters
    ----------
    xyz : (n, 2 or 3)
        Metres.  Outside of the map nothing is painted, surfaces are plain, and the ground is as high as at the border.
    cell : float
        Size of the cells of surface and brush, m.
    surface : (ny, nx, 2)
        Speed factor and cap (m/s), see `compose_caps`.
    brush : (ny, nx) int32
        See `compose_brushes`.
    heights : Heights
        Its cells may be of another size.
    footing : Footing
        Is written.
    """
    relief, relief_cell, wrap = heights
    out_factor, out_cap, out_brush, out_slope, out_z = footing
    ny, nx = brush.shape
    my, mx = relief.shape[0], relief.shape[1]
    for i in range(lo, hi):
        x, y = xyz[i, 0], xyz[i, 1]
        ix = int(min(max(x / cell, 0.0), nx - 1.0))
        iy = int(min(max(y / cell, 0.0), ny - 1.0))
        out_factor[i], out_cap[i], out_brush[i] = surface[iy, ix, 0], surface[iy, ix, 1], brush[iy, ix]
        if is_off_(x, y, cell, nx, ny):
            out_factor[i], out_cap[i], out_brush[i] = 1.0, np.inf, NO_BRUSH
        west, east, a = corners_(x, relief_cell, mx, wrap[0])
        south, north, b = corners_(y, relief_cell, my, wrap[1])
        sw, se, nw, ne = (1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b
        p, q, r, s = relief[south, west], relief[south, east], relief[north, west], relief[north, east]
        out_z[i] = sw * p[0] + se * q[0] + nw * r[0] + ne * s[0]
        out_slope[i, 0] = sw * p[1] + se * q[1] + nw * r[1] + ne * s[1]
        out_slope[i, 1] = sw * p[2] + se * q[2] + nw * r[2] + ne * s[2]


@kernel_function
def is_off_(x, y, cell, nx, ny):
    """Whether a place lies outside a map of so many cells."""
    return x < 0.0 or y < 0.0 or x > nx * cell or y > ny * cell


@njit(cache=True, nogil=True)
def slope_factor_(rise):
    """Factor of the speed at this rise per metre: Tobler's hiking function [1]_, 1 on flat ground.

    ``exp(-3.5 (|rise + .05| - .05))``: .5 at a rise of .2, at most 1.19, on a gentle way down.

    References
    ----------
    .. [1] Tobler 1993, Three presentations on geographical analysis and modeling, NCGIA Technical Report 93-1, after
       measurements of people by Imhof 1950.  For animals it is a substitute without measurements.
    """
    return exp_(-STEEPNESS * (abs(rise - BEST_SLOPE) - abs(BEST_SLOPE)))


# When a level is built or painted ------------------------------------------------------------------------------


def compose_brushes(layers, zones, shape, cell, palette, wraps=False):
    """The brush of every cell.

    The painted layer of the greatest weight (opacity) wins, the later of two equal ones; a layer of weight 0 is
    hidden.  Zones lie above all layers, later zones above earlier ones.

    Parameters
    ----------
    layers : sequence
        Objects with ``name``, ``weight``, ``assets`` (names of brushes) and ``index`` (ny, nx), which counts in
        assets, -1 for unpainted.
    zones : sequence
        Objects with ``name``, ``polygon`` (k, 2) m and ``brush`` (a name, or None for a zone of another kind).
    shape : (ny, nx)
        The grid.
    cell : float
        Size of a cell, m.
    palette : sequence of str
        Names of the brushes, in the order of their index.
    wraps : bool
        The map goes on at the opposite border, and so do zones.

    Returns
    -------
    ndarray, (ny, nx) int32
        Index in palette, -1 for unpainted ground.
    """
    brush = np.full(shape, NO_BRUSH, np.int32)
    weight = np.zeros(shape)
    for layer in layers:
        own = np.array(
            [_index_of(name, palette, f"layer {layer.name!r}") for name in layer.assets] + [NO_BRUSH], np.int32
        )
        over = (layer.index >= 0) & (layer.weight >= weight) & (layer.weight > 0)
        brush[over] = own[layer.index[over]]
        weight[over] = layer.weight
    for zone in zones:
        if zone.brush:
            inside = rasterise_polygon(zone.polygon, shape, cell, wraps)
            brush[inside] = _index_of(zone.brush, palette, f"zone {zone.name!r}")
    return brush


def _index_of(name, palette, where):
    if name not in palette:
        raise ValueError(f"{where}: no brush {name!r}; there are {', '.join(palette) or 'none'}")
    return list(palette).index(name)


def compose_caps(shape, cell, speed_factor=None, factor=None, cap=None, zones=(), wraps=False):
    """Speed factor and cap in every cell: factors multiply, the smallest cap holds.

    Parameters
    ----------
    shape : (ny, nx)
        The grid.
    cell : float
        Size of a cell, m.
    speed_factor, factor : ndarray, (ny, nx), optional
        Of the terrain, and painted.
    cap : ndarray, (ny, nx), optional
        Painted, m/s; infinite for none.
    zones : sequence
        Objects with ``polygon`` (k, 2) m, ``max_speed`` (m/s or None) and ``factor`` (or None).
    wraps : bool
        The map goes on at the opposite border, and so do zones.

    Returns
    -------
    ndarray, (ny, nx, 2)
        Factor and cap, m/s.
    """
    surface = np.empty((*shape, 2))
    surface[..., 0] = 1.0 if speed_factor is None else speed_factor
    surface[..., 0] *= 1.0 if factor is None else factor
    surface[..., 1] = np.inf if cap is None else cap
    for zone in zones:
        if zone.max_speed is None and zone.factor is None:
            continue
        inside = rasterise_polygon(zone.polygon, shape, cell, wraps)
        if zone.factor is not None:
            surface[inside, 0] *= zone.factor
        if zone.max_speed is not None:
            surface[inside, 1] = np.minimum(surface[inside, 1], zone.max_speed)
    return surface


def compose_blocked(shape, cell, walkable=None, obstacles=()):
    """Blocked cells: ground that is not walkable, and obstacles.

    A cell is blocked when its centre is inside an obstacle or closer to it than its margin.  Where an obstacle is so
    thin that it passes between two free neighbouring centres (a fence), the nearer of the two is blocked, so that
    no way leads through.

    Parameters
    ----------
    shape : (ny, nx)
        The grid.
    cell : float
        Size of a cell, m.
    walkable : ndarray, (ny, nx) bool, optional
        Of the terrain.
    obstacles : sequence
        Objects with ``polygon`` (k, 2) m and ``margin`` (m).

    Returns
    -------
    ndarray, (ny, nx) bool
    """
    blocked = np.zeros(shape, bool) if walkable is None else ~np.asarray(walkable, bool)
    outlines = [np.ascontiguousarray(o.polygon, np.float64).reshape(-1, 2) / cell for o in obstacles]
    for obstacle, outline in zip(obstacles, outlines, strict=True):
        blocked |= rasterise_(outline, shape[0], shape[1], 1.0)
        margin_(blocked, outline, obstacle.margin / cell)
    for outline in outlines:
        fence_(blocked, outline)
        fence_(blocked.T, np.ascontiguousarray(outline[:, ::-1]))
    return blocked


@njit(cache=True, nogil=True)
def margin_(blocked, polygon, margin):
    """Block, in place, the cells with their centre closer than the margin to the outline; all in cells."""
    ny, nx = blocked.shape
    if margin <= 0.0:
        return
    for k in range(len(polygon)):
        ax, ay = polygon[k - 1]
        dx, dy = polygon[k, 0] - ax, polygon[k, 1] - ay
        square = dx * dx + dy * dy
        low, high = min(ay, ay + dy) - margin, max(ay, ay + dy) + margin
        left, right = min(ax, ax + dx) - margin, max(ax, ax + dx) + margin
        for iy in range(int(max(low - 0.5, 0.0)), int(min(high + 0.5, float(ny)))):
            for ix in range(int(max(left - 0.5, 0.0)), int(min(right + 0.5, float(nx)))):
                px, py = ix + 0.5 - ax, iy + 0.5 - ay
                t = min(1.0, max(0.0, (px * dx + py * dy) / square)) if square > 0.0 else 0.0
                px, py = px - t * dx, py - t * dy
                if px * px + py * py < margin * margin:
                    blocked[iy, ix] = True


@njit(cache=True, nogil=True)
def fence_(blocked, polygon):
    """Block, in place, the nearer of two free cells, east and west of one another, that an edge passes between."""
    ny, nx = blocked.shape
    for k in range(len(polygon)):
        ax, ay = polygon[k - 1]
        bx, by = polygon[k]
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        for iy in range(int(max(np.ceil(ay - 0.5), 0.0)), int(min(np.ceil(by - 0.5), float(ny)))):
            x = ax + (iy + 0.5 - ay) / (by - ay) * (bx - ax) - 0.5
            if 0.0 <= x < nx - 1.0:
                ix = int(x)
                if not blocked[iy, ix] and not blocked[iy, ix + 1]:
                    blocked[iy, ix if x - ix < 0.5 else ix + 1] = True


def relief_of(height=None, cell=1.0, goes_on=False):
    """Height and slope at the centre of every cell, ready for `sample_ground`.

    Parameters
    ----------
    height : ndarray, (ny, nx), optional
        Metres; None for flat ground.
    cell : float
        Size of a cell, m.
    goes_on : bool
        The map goes on at the opposite border.

    Returns
    -------
    ndarray, (ny, nx, 3)
        Height, m, and rise per metre east and north: central differences, one-sided at an edge.  Bilinear between
        centres, all three are continuous.
    """
    height = np.zeros((1, 1)) if height is None else np.asarray(height, np.float64)
    relief = np.zeros((*height.shape, 3))
    relief[..., 0] = height
    for k, axis in ((1, 1), (2, 0)):
        if height.shape[axis] > 1 or goes_on:
            around = np.pad(height, 1, mode="wrap") if goes_on else height
            slope = np.gradient(around, cell, axis=axis)
            relief[..., k] = slope[1:-1, 1:-1] if goes_on else slope
    return relief


def steepness_of(height, cell, goes_on=False):
    """Slope of the ground between the centres of every four cells.

    Parameters
    ----------
    height : ndarray, (ny, nx)
        Metres.
    cell : float
        Size of a cell, m.
    goes_on : bool
        The map goes on at the opposite border; else the nearest cell counts outside of it.

    Returns
    -------
    ndarray, (ny + 1, nx + 1)
        The greatest rise per metre; ``[iy, ix]`` is north-east of the centre of cell ``(iy - 1, ix - 1)``.
    """
    padded = np.pad(height, 1, mode="wrap" if goes_on else "edge")
    east, north = np.abs(np.diff(padded, axis=1)) / cell, np.abs(np.diff(padded, axis=0)) / cell
    return np.hypot(np.maximum(east[1:], east[:-1]), np.maximum(north[:, 1:], north[:, :-1]))


def steepest_within(steepness, relief_cell, shape, cell):
    """(ny, nx) the greatest slope in every cell of another size; ``steepness`` as from `steepness_of`."""

    def patches(count, among):
        edges = np.arange(count + 1) * (cell / relief_cell) + 0.5
        first = np.clip(np.floor(edges[:-1] + 1e-9).astype(int), 0, among - 1)
        return first, np.clip(np.ceil(edges[1:] - 1e-9).astype(int), first + 1, among)

    rows = np.array([steepness[lo:hi].max(axis=0) for lo, hi in zip(*patches(shape[0], len(steepness)), strict=True)])
    columns = zip(*patches(shape[1], steepness.shape[1]), strict=True)
    return np.array([rows[:, lo:hi].max(axis=1) for lo, hi in columns]).T


# Polygons ------------------------------------------------------------------------------------------------------


@njit(cache=True, nogil=True)
def is_left_of_(x, y, ax, ay, bx, by):
    """Whether a ray from (x, y) to the east crosses the edge a-b.

    The upper end does not belong to the edge, and a-b and b-a give the same result to the last bit: so two
    polygons that share an edge never both contain a point beside it, nor both miss it.
    """
    if (ay > y) == (by > y):
        return False
    if ay > by:
        ax, ay, bx, by = bx, by, ax, ay
    return (x - ax) * (by - ay) < (y - ay) * (bx - ax)


def centroid(polygon):
    """Centre of mass of a polygon with an area, (2,)."""
    p = polygon - polygon[0]
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
    return polygon[0] + ((p + q) * cross[:, None]).sum(axis=0) / (3 * cross.sum())


@njit(cache=True, nogil=True)
def point_in_polygon(x, y, polygon):
    """Whether a point is inside a polygon (k, 2), by crossing number (even-odd).

    Of the outline, the western and southern edges belong to the polygon and the eastern and northern ones do not: a
    tiling of polygons contains every point once.
    """
    inside = False
    for k in range(len(polygon)):
        if is_left_of_(x, y, polygon[k - 1, 0], polygon[k - 1, 1], polygon[k, 0], polygon[k, 1]):
            inside = not inside
    return inside


def rasterise_polygon(polygon, shape, cell, wraps=False):
    """(ny, nx) bool, the cells whose centre is `point_in_polygon` of a polygon (k, 2), m.

    It reaches over the borders of a map that ``wraps``.
    """
    polygon, (ny, nx) = np.ascontiguousarray(polygon, np.float64).reshape(-1, 2), shape
    mask = np.zeros(shape, np.bool_)
    for way in images(polygon, (nx * cell, ny * cell) if wraps else None):
        mask |= rasterise_(polygon + way, ny, nx, float(cell))
    return mask


@njit(cache=True, nogil=True)
def rasterise_(polygon, ny, nx, cell):
    """`rasterise_polygon`, row by row: only edges that cross the row are tested."""
    mask = np.zeros((ny, nx), np.bool_)
    for iy in range(ny):
        y = (iy + 0.5) * cell
        for k in range(len(polygon)):
            ax, ay, bx, by = polygon[k - 1, 0], polygon[k - 1, 1], polygon[k, 0], polygon[k, 1]
            if (ay > y) == (by > y):
                continue
            for ix in range(nx):
                if not is_left_of_((ix + 0.5) * cell, y, ax, ay, bx, by):
                    break  # no cell further east is inside
                mask[iy, ix] = not mask[iy, ix]
    return mask
