"""MOVE: the only writer of position, velocity and heading."""

from __future__ import annotations

import numpy as np
from numba import njit

from components import Body, BrushBinding, Heading, Position, Speed, Velocity, Wish
from engine.clock import Clock
from engine.parallel import over_rows
from engine.schedule import Stage, System
from systems.contact import move
from systems.landscape import Landscape
from systems.palette import Palette
from systems.senses import Near


class Move(System):
    """Turn within the limit, step without touching anybody or anything."""

    stage = Stage.MOVE
    reads = (Body, BrushBinding, Speed, Wish, Near, Palette, Landscape, Clock)
    writes = (Position, Velocity, Heading)

    def process(self, world):
        agents, land = world.agents, world.resource(Landscape)
        palette, clock = world.resource(Palette), world.resource(Clock)
        n = len(agents)
        if not n:
            return
        binding, blend = agents[BrushBinding.brush], agents[BrushBinding.blend]
        # while brushes blend, neither may turn faster than it allows
        max_turn = np.where(
            blend < 1.0,
            np.minimum(palette.max_turn[binding], palette.max_turn[agents[BrushBinding.previous]]),
            palette.max_turn[binding],
        )
        body = agents[Body.axis] + agents[Body.radius]
        reach = float(body.max() + agents[Body.radius].max() + 4.0 * clock.dt * agents[Speed.target].max())
        near = world.resource(Near)
        step, heading = move(
            near.cells, agents[Heading.forward], agents[Wish.direction], agents[Speed.target],
            max_turn, land.walls_within(reach), clock.dt, near.ghosts,
        )  # fmt: skip
        wrap = land.wrap or (0.0, 0.0)
        over_rows(
            _go, n, step, heading, clock.dt, land.relief_cell, land.relief, wrap[0], wrap[1],
            agents[Position.xyz], agents[Velocity.xyz], agents[Heading.forward],
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _go(lo, hi, step, heading, dt, relief_cell, relief, width, height, xyz, velocity, forward):
    flat = relief.shape[0] == 1 and relief.shape[1] == 1
    for i in range(lo, hi):
        below = 0.0 if flat else _height(relief, relief_cell, xyz[i, 0], xyz[i, 1])
        velocity[i, 0], velocity[i, 1] = step[i, 0] / dt, step[i, 1] / dt
        x, y = xyz[i, 0] + step[i, 0], xyz[i, 1] + step[i, 1]
        if width > 0.0:
            x, y = x - width * np.floor(x / width), y - height * np.floor(y / height)
        rise = 0.0 if flat else _height(relief, relief_cell, x, y) - below
        velocity[i, 2] = rise / dt
        xyz[i, 0], xyz[i, 1] = x, y
        xyz[i, 2] += rise  # whoever flies keeps his altitude above ground
        forward[i, 0], forward[i, 1], forward[i, 2] = heading[i, 0], heading[i, 1], 0.0


@njit(cache=True, nogil=True)
def _height(relief, cell, x, y):
    """Height of the ground, bilinear between the centres of cells."""
    my, mx = relief.shape[0], relief.shape[1]
    u, v = min(max(x / cell - 0.5, 0.0), mx - 1.0), min(max(y / cell - 0.5, 0.0), my - 1.0)
    west, south = int(u), int(v)
    east, north = min(west + 1, mx - 1), min(south + 1, my - 1)
    a, b = u - west, v - south
    low = relief[south, west, 0] * (1.0 - a) + relief[south, east, 0] * a
    high = relief[north, west, 0] * (1.0 - a) + relief[north, east, 0] * a
    return low * (1.0 - b) + high * b
