"""Room for bodies: animals that would stand in walls or in others step aside to the nearest free place."""

from __future__ import annotations

import numpy as np
from flockbrush.components import Body, BrushBinding, Heading, Position
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import birth_bounds, bodies_of, ground_for
from flockbrush.systems.spawning import Capsules, inside_polygon, nearest_free, overlaps_, touching
from numba import njit

PRESSED = 1e-6  # m that bodies may overlap by rounding


def in_the_air(world):
    """(n,) bool: animals whose brush moves them through the air; they are no bodies on the ground."""
    return world.resource(Palette).flies_free[world.agents[BrushBinding.brush]]


def move_to_free_places(world, trapped):
    """Move these animals, (n,) bool, to the nearest place that is free of walls and of bodies on the ground.

    Raises
    ------
    ValueError
        When there is none nearby.  Nobody has moved then.
    """
    if not trapped.any():
        return
    agents = world.agents
    half, radius = agents[Body.axis], agents[Body.radius]
    bodies = [np.ascontiguousarray(c) for c in (*agents[Position.xyz][:, :2].T, *agents[Heading.forward][:, :2].T)]
    x, y, fx, fy = bodies
    find = _finder(world, 2.0 * float((half + radius).max()))
    stands = ~trapped & ~in_the_air(world)
    for row in np.flatnonzero(trapped):
        others = Capsules(*(np.ascontiguousarray(c[stands]) for c in (x, y, fx, fy, half, radius)))
        found, x[row], y[row] = find(x[row], y[row], fx[row], fy[row], half[row], radius[row], others)
        if not found:
            raise ValueError(f"animal {agents.ids[row]} stands there, and has no room to step aside")
        stands[row] = True
    agents[Position.xyz][:, 0], agents[Position.xyz][:, 1] = x, y


def place_newcomers(world, columns):
    """Move newcomers, given as columns, who would stand in others or in walls, to the nearest free place."""
    land, agents = world.resource(Landscape), world.agents
    xyz, forward = columns[Position.xyz], columns[Heading.forward]
    half, radius = columns[Body.axis], columns[Body.radius]
    reach = 2.0 * float((half + radius).max())
    others = bodies_of(agents, land.wrap, reach)
    walls = np.ascontiguousarray(land.solid.ends)
    pressed = touching(xyz, forward, half, np.maximum(radius - PRESSED, 0.0), walls)
    pressed |= pressing(xyz, forward, half, radius, others)
    for polygon in land.solids:
        pressed |= inside_polygon(xyz, polygon)
    iy, ix = cell_under(land, xyz)
    pressed |= ~land.walkable[iy, ix] & on_map(land, xyz)
    if not pressed.any():
        return
    find = _finder(world, reach)
    mine = [xyz[:, 0].copy(), xyz[:, 1].copy(), forward[:, 0], forward[:, 1], half, radius]
    stands = ~pressed
    for row in np.flatnonzero(pressed):
        around = Capsules(*(np.concatenate([o, m[stands]]) for o, m in zip(others, mine, strict=True)))
        found, mine[0][row], mine[1][row] = find(*(m[row] for m in mine), around)
        if not found:
            raise ValueError("an animal cannot come back: there is no room where it stood")
        stands[row] = True
    xyz[:, 0], xyz[:, 1] = mine[0], mine[1]


def _finder(world, reach):
    """`nearest_free` for this landscape: (x, y, fx, fy, half, radius, others) to (found, x, y)."""
    land = world.resource(Landscape)
    ground = ground_for(land, reach, ~land.walkable)

    def find(x, y, fx, fy, half, radius, others):
        inside = ground._replace(bounds=birth_bounds(land, half + radius))
        return nearest_free(x, y, fx, fy, half, radius, inside, others)

    return find


def cell_under(land, xyz):
    """(iy, ix) of the cell under each animal, the nearest one for those off the map."""
    ny, nx = land.brush.shape
    return tuple(np.clip(np.floor(xyz[:, k] / land.cell), 0, n - 1).astype(np.int64) for k, n in ((1, ny), (0, nx)))


def on_map(land, xyz):
    """(n,) bool, who is on the map."""
    return (xyz[:, 0] >= 0) & (xyz[:, 1] >= 0) & (xyz[:, 0] < land.width) & (xyz[:, 1] < land.height)


@njit(cache=True, nogil=True, error_model="numpy")
def pressing(xyz, forward, half, radius, others):
    """(n,) bool, whose body is inside one of the others'."""
    out = np.zeros(len(xyz), np.bool_)
    for i in range(len(xyz)):
        x, y, ux, uy = xyz[i, 0], xyz[i, 1], forward[i, 0], forward[i, 1]
        for j in range(len(others.x)):
            if overlaps_(x, y, ux, uy, half[i], radius[i] - PRESSED, others, j):
                out[i] = True
                break
    return out
