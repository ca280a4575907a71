"""What stands on the ground, as `Solid` pieces for those in the air."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.solids import convex_parts, cylinder, half_space, packed, polyhedron, prism, sphere


def solids_in_the_air(land):
    """What keeps those in the air of a `Landscape` out, and what hides those behind it: two `Solids`."""
    things = [(b, solid) for b in (*land.barriers, *land.overhead) for solid in _stood_up(b, land)]
    bodies = [solid for b, solid in things if b.solid]
    views = [solid for b, solid in things if b.blocks_view]
    if land.wrap is not None:
        bodies, views = _in_all_images(bodies, land.wrap), _in_all_images(views, land.wrap)
    if land.boundary == "wall":
        w, h = land.width, land.height
        bodies += [
            half_space((0, 0, 0), (1, 0, 0)), half_space((w, 0, 0), (-1, 0, 0)),
            half_space((0, 0, 0), (0, 1, 0)), half_space((0, h, 0), (0, -1, 0)),
        ]  # fmt: skip
    return packed(bodies), packed(views)


def _stood_up(barrier, land):
    """The pieces of an `Obstacle`."""
    polygon, ground = barrier.polygon, land.ground(barrier.polygon.mean(0))
    low, high = barrier.z_min + ground, barrier.z_max + ground
    if barrier.shape == "plane":  # below it when it lies on the ground, above it when it is a ceiling
        point = np.array([*polygon.mean(0), low if barrier.z_min > 0 else high])
        return [half_space(point, (0, 0, -1) if barrier.z_min > 0 else (0, 0, 1), barrier.blocks_view)]
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
