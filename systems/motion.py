"""MOVE: the only writer of position, velocity and heading."""

from __future__ import annotations

import numpy as np
from numba import njit

from components import Airborne, Body, BrushBinding, Ground, Heading, Position, Speed, Thrust, Velocity, Wish
from engine.clock import Clock
from engine.parallel import over_rows
from engine.schedule import Stage, System
from systems.contact import move
from systems.flight import fly
from systems.foresight import in_the_way
from systems.ground_height import height_of_ground
from systems.landscape import Landscape
from systems.palette import Palette
from systems.senses import Near


class Move(System):
    """Those on the ground: turn within the limit, step without touching anybody or anything.  Then those in the air."""

    stage = Stage.MOVE
    reads = (Body, BrushBinding, Speed, Ground, Wish, Thrust, Near, Palette, Landscape, Clock)
    writes = (Position, Velocity, Heading, Airborne)

    def process(self, world):
        agents, near = world.agents, world.resource(Near)
        if not len(agents):
            return
        max_turn = _max_turn(agents, world.resource(Palette))
        if near.aloft is None:
            _walk(world, slice(None), max_turn)
            return
        walkers = np.flatnonzero(~near.aloft)
        if len(walkers):
            _walk(world, walkers, max_turn)
        _fly(world, near, max_turn)


def _max_turn(agents, palette):
    """(n,) rad/s; while brushes blend, neither may turn faster than it allows."""
    binding, blend = agents[BrushBinding.brush], agents[BrushBinding.blend]
    return np.where(
        blend < 1.0,
        np.minimum(palette.max_turn[binding], palette.max_turn[agents[BrushBinding.previous]]),
        palette.max_turn[binding],
    )


def _walk(world, rows, max_turn):
    agents, land, near = world.agents, world.resource(Landscape), world.resource(Near)
    dt = world.resource(Clock).dt
    body, radius, speed = agents[Body.axis] + agents[Body.radius], agents[Body.radius], agents[Speed.target]
    reach = float(body[rows].max() + radius[rows].max() + 4.0 * dt * speed[rows].max())
    if near.aloft is not None:
        speed = np.where(near.aloft, 0.0, speed)
    step, heading = move(
        near.cells, agents[Heading.forward], agents[Wish.direction], speed, max_turn, land.walls_within(reach), dt,
        near.ghosts,
    )  # fmt: skip
    wrap = land.wrap or (0.0, 0.0)
    aloft = np.zeros(len(agents), np.bool_) if near.aloft is None else near.aloft
    over_rows(
        _go, len(agents), aloft, step, heading, dt, land.relief_cell, land.relief, wrap[0], wrap[1],
        agents[Position.xyz], agents[Velocity.xyz], agents[Heading.forward],
    )  # fmt: skip


def _fly(world, near, max_turn):
    agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
    wrap, order = land.wrap or (0.0, 0.0), np.flatnonzero(near.aloft)
    over_rows(
        fly, len(order), order, world.resource(Clock).dt, agents[BrushBinding.brush], palette.flight, max_turn,
        agents[Body.length], agents[Body.radius], agents[Speed.target], agents[Ground.cap], agents[Thrust.kind],
        agents[Thrust.acceleration], agents[Thrust.velocity], agents[Wish.direction],
        in_the_way(agents, land.sky, near.aloft), land.relief_cell, land.relief, wrap[0], wrap[1],
        agents[Position.xyz], agents[Velocity.xyz], agents[Heading.forward], agents[Airborne.up],
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _go(lo, hi, aloft, step, heading, dt, relief_cell, relief, width, height, xyz, velocity, forward):
    flat = relief.shape[0] == 1 and relief.shape[1] == 1
    for i in range(lo, hi):
        if aloft[i]:
            continue
        below = 0.0 if flat else height_of_ground(relief, relief_cell, xyz[i, 0], xyz[i, 1])
        velocity[i, 0], velocity[i, 1] = step[i, 0] / dt, step[i, 1] / dt
        x, y = xyz[i, 0] + step[i, 0], xyz[i, 1] + step[i, 1]
        if width > 0.0:
            x, y = x - width * np.floor(x / width), y - height * np.floor(y / height)
        rise = 0.0 if flat else height_of_ground(relief, relief_cell, x, y) - below
        velocity[i, 2] = rise / dt
        xyz[i, 0], xyz[i, 1] = x, y
        xyz[i, 2] += rise  # whoever flies keeps his altitude above ground
        forward[i, 0], forward[i, 1], forward[i, 2] = heading[i, 0], heading[i, 1], 0.0
