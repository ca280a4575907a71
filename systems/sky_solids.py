"""What stands on the ground, as `Solid` pieces for those in the air."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.solids import convex_parts, cylinder, half_space, packed, polyhedron, prism, sphere

ANY_HEIGHT = 1e5  # m


def solids_in_the_air(land):
    """What keeps those in the air of a `Landscape` out, and what hides those behind it: two `Solids`."""
    things = [(b, solid) for b in (*land.barriers, *land.overhead) for solid in _stood_up(b, land)]
    bodies = [solid for b, solid in things if b.solid]
    views = [solid for b, solid in things if b.blocks_view]
    if land.wrap is not None:
        bodies, views = _in_all_images(bodies, land.wrap), _in_all_images(views, land.wrap)
    return packed(bodies + _edge_of_the_map(land)), packed(views)


def solids_on_the_ground(land):
    """What keeps those out that a model of flight moves along the ground: whatever stops walkers, at any height."""
    polygons = [part for b in land.barriers if b.solid for part in convex_parts(b.polygon)]
    polygons += [land.cell * corners for corners in _rectangles(~land.walkable)]
    bodies = [prism(polygon, -ANY_HEIGHT, ANY_HEIGHT) for polygon in polygons]
    return packed((bodies if land.wrap is None else _in_all_images(bodies, land.wrap)) + _edge_of_the_map(land))


def _rectangles(mask):
    """(4, 2) corners, in cells, of rectangles that cover the True cells of a raster (ny, nx), each once."""
    open_runs, done = {}, []
    for row in range(len(mask) + 1):
        line = np.zeros(mask.shape[1] + 2, np.int8)
        if row < len(mask):
            line[1:-1] = mask[row]
        change = np.diff(line)
        runs = set(zip(np.flatnonzero(change == 1).tolist(), np.flatnonzero(change == -1).tolist(), strict=True))
        for run in sorted(open_runs.keys() - runs):
            done.append((*run, open_runs.pop(run), row))
        for run in runs - open_runs.keys():
            open_runs[run] = row
    return [np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float) for x0, x1, y0, y1 in done]


def _edge_of_the_map(land):
    if land.boundary != "wall":
        return []
    w, h = land.width, land.height
    return [
        half_space((0, 0, 0), (1, 0, 0)), half_space((w, 0, 0), (-1, 0, 0)),
        half_space((0, 0, 0), (0, 1, 0)), half_space((0, h, 0), (0, -1, 0)),
    ]  # fmt: skip


def _stood_up(barrier, land):
    """The pieces of an `Obstacle`."""
    polygon, ground = barrier.polygon, land.ground(barrier.polygon.mean(0))
    low, high = barrier.z_min + ground, barrier.z_max + ground
    if barrier.shape == "plane":  # below it when it lies on the ground, above it when it is a ceiling
        point = np.array([*polygon.mean(0), high if barrier.on_the_ground else low])
        return [half_space(point, (0, 0, 1) if barrier.on_the_ground else (0, 0, -1), barrier.blocks_view)]
    if barrier.shape == "hull":
        return [polyhedron(barrier.corners + np.array([*polygon.mean(0), low]), barrier.blocks_view)]
    middle, away = np.array([*polygon.mean(0), 0.5 * (low + high)]), polygon - polygon.mean(0)
    radius = float(np.sqrt((away**2).sum(1).max()))
    if barrier.shape == "sphere":
        return [sphere(middle, radius, barrier.blocks_view)]
    if barrier.shape == "cylinder":
        return [cylinder(middle, radius, 0.5 * (high - low), opaque=barrier.blocks_view)]
    return [prism(part, low, high, barrier.blocks_view) for part in convex_parts(polygon)]


def _in_all_images(solids, wrap):
    """Solids of a periodic map and their copies across the seams."""
    shifts = [(dx * wrap[0], dy * wrap[1], 0.0) for dx in (0, -1, 1) for dy in (0, -1, 1)]
    return [solid.moved(shift) for shift in shifts for solid in solids]
