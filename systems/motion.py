"""MOVE: the only writer of position, velocity and heading."""

from __future__ import annotations

import numpy as np
from flockbrush.components import (
    Airborne,
    Body,
    BrushBinding,
    Ground,
    Heading,
    Position,
    Species,
    Speed,
    Thrust,
    Transit,
    Velocity,
    Wish,
)
from flockbrush.components.agent import LANDING
from flockbrush.engine.clock import Clock
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.seam import on_the_map_
from flockbrush.systems.contact import move_by_slot
from flockbrush.systems.fauna import SpeciesList, by_medium
from flockbrush.systems.flight import FlightLimits, WantedFlight, fly, flyers_of
from flockbrush.systems.foresight import solids_to_avoid
from flockbrush.systems.ground_height import height_of_ground, turn_from_steep_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near
from numba import njit

STANDING = 1e-6  # m: more than rounding adds up to
STEEP = 0.2  # length of the level part of a heading of a landing bird, at least
FALL, SETTLE = 4.0, 0.3  # m/s at which walkers come down to the ground, from high up and at last


class Move(System):
    """Those on the ground: turn within the limit, step without touching anybody or anything.  Then those in the air."""

    stage = Stage.MOVE
    reads = (Body, BrushBinding, Speed, Ground, Wish, Thrust, Transit, Near, Palette, Landscape, Clock, Species,
             SpeciesList)  # fmt: skip
    writes = (Position, Velocity, Heading, Airborne)

    def process(self, world):
        agents, near = world.agents, world.resource(Near)
        if not len(agents):
            return
        palette = world.resource(Palette)
        top, turn = _limits(agents, palette, world.resource(SpeciesList).table, near.aloft)
        max_turn = np.minimum(_max_turn(agents, palette), turn)
        if near.aloft is None:
            _walk(world, slice(None), max_turn, top)
            return
        walkers = np.flatnonzero(~near.aloft)
        if len(walkers):
            _walk(world, walkers, max_turn, top)
        _fly(world, near, max_turn, top)


def _max_turn(agents, palette):
    """(n,) rad/s; while brushes blend, neither may turn faster than it allows."""
    binding, blend = agents[BrushBinding.brush], agents[BrushBinding.blend]
    most, changing = palette.max_turn[binding], np.flatnonzero(blend < 1.0)
    most[changing] = np.minimum(most[changing], palette.max_turn[agents[BrushBinding.previous][changing]])
    return most


def _limits(agents, palette, table, aloft):
    """((n,) m/s, (n,) rad/s) that each animal's species can do where it is."""
    if aloft is not None:
        aloft = aloft & ~palette.grounded[agents[BrushBinding.brush]]
    return by_medium(table, agents[Species.index], aloft, table.speed, table.turn)


def _hills(world):
    """`Hills` for the animals of a world."""
    steepest = world.resource(SpeciesList).table.steepest
    return world.resource(Landscape).hills_for(steepest[world.agents[Species.index]])


def _walk(world, rows, max_turn, top):
    agents, land, near = world.agents, world.resource(Landscape), world.resource(Near)
    dt = world.resource(Clock).dt
    body, radius, speed = agents[Body.axis] + agents[Body.radius], agents[Body.radius], agents[Speed.target]
    reach = float(body[rows].max() + radius[rows].max() + 4.0 * dt * speed[rows].max())
    if near.aloft is not None:
        speed = np.where(near.aloft, 0.0, speed)
    wish, cells, walls = agents[Wish.direction], near.cells, land.walls_within(reach)
    hills = _hills(world) if land.hilly else None
    if hills is not None:
        facing, wished, wish = agents[Heading.forward], wish, np.empty_like(wish)
        over_rows(turn_from_steep_ground, len(wish), agents[Position.xyz], facing, wished, speed * dt, hills, wish)
    order, going = move_by_slot(cells, wish, speed, max_turn, walls, dt, near.ghosts, top, hills)
    bodies = agents[Position.xyz], agents[Velocity.xyz], agents[Heading.forward]
    over_rows(_go, len(order), order, cells.row, going, dt, land.heights, *bodies)


def _fly(world, near, max_turn, top):
    agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
    order = np.flatnonzero(near.aloft)
    table, species = world.resource(SpeciesList).table, agents[Species.index]
    climb = np.where(table.known[species], table.climb[species], np.inf)  # species without a file have no limits
    cap = np.maximum(agents[Ground.cap], table.slowest[species])  # caps do not go below the lowest speed of flight
    limits = FlightLimits(
        palette.flight, agents[BrushBinding.brush], max_turn, climb, agents[Speed.target], np.minimum(cap, top)
    )
    wanted = WantedFlight(
        agents[Thrust.kind], agents[Thrust.acceleration], agents[Thrust.velocity], agents[Wish.direction],
        agents[Transit.kind],
    )  # fmt: skip
    dt, flyers = world.resource(Clock).dt, flyers_of(agents)
    held, hills = palette.grounded[agents[BrushBinding.brush]][order], _hills(world)
    for rows, solids in ((order[~held], land.sky), (order[held], land.standing if held.any() else None)):
        if len(rows):
            reach = float((dt * limits.cap + agents[Body.radius])[rows].max())
            around = solids_to_avoid(agents, solids, near.aloft, land.wrap, reach)
            over_rows(fly, len(rows), rows, dt, flyers, limits, wanted, around, hills)
    _raise_noses_at_landing(agents, order)


def _raise_noses_at_landing(agents, flyers):
    """Birds that land never point straight down, so that they have a heading when they stand."""
    landing = flyers[agents[Transit.kind][flyers] == LANDING]
    forward = agents[Heading.forward][landing]
    rows = landing[np.hypot(forward[:, 0], forward[:, 1]) < STEEP]
    if not len(rows):
        return
    # of a nose that points down the back points ahead, of one that points up it points backwards
    sign = np.sign(agents[Heading.forward][rows, 2])[:, None]
    ahead = -sign * agents[Airborne.up][rows, :2]
    size = np.sqrt((ahead * ahead).sum(axis=1))[:, None]
    ahead = np.where(size > 1e-6, ahead / np.maximum(size, 1e-6), (1.0, 0.0))
    steep = sign * np.sqrt(1.0 - STEEP**2)
    agents[Heading.forward][rows] = np.hstack([STEEP * ahead, steep])
    agents[Airborne.up][rows] = np.hstack([-steep * ahead, np.full((len(rows), 1), STEEP)])


@njit(cache=True, nogil=True, error_model="numpy")
def _go(lo, hi, order, row, going, dt, heights, xyz, velocity, forward):
    step, heading = going
    flat = heights.relief.shape[0] == 1 and heights.relief.shape[1] == 1
    for o in range(lo, hi):
        s = order[o]
        i = row[s]
        below = 0.0 if flat else height_of_ground(heights, xyz[i, 0], xyz[i, 1])
        velocity[i, 0], velocity[i, 1] = step[s, 0] / dt, step[s, 1] / dt
        x, y = on_the_map_(xyz[i, 0] + step[s, 0], xyz[i, 1] + step[s, 1], heights.wrap)
        rise = 0.0 if flat else height_of_ground(heights, x, y) - below
        above = xyz[i, 2] - below
        if abs(above) > STANDING:  # walkers stand on the ground
            rise -= min(above, max(SETTLE, min(FALL, 1.5 * above)) * dt)
        velocity[i, 2] = rise / dt
        xyz[i, 0], xyz[i, 1] = x, y
        xyz[i, 2] += rise
        forward[i, 0], forward[i, 1], forward[i, 2] = heading[s, 0], heading[s, 1], 0.0
