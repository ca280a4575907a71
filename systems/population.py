"""Who lives in this world: species, births and the animals' first numbers."""

from __future__ import annotations

import numpy as np
from flockbrush.components import (
    Body,
    BrushBinding,
    Destination,
    Heading,
    Individual,
    Position,
    Species,
    Speed,
    Transit,
    Velocity,
    Vision,
)
from flockbrush.components.agent import SETTLED, TAKING_OFF
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.solid_queries import out_of_
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.grid import farthest_sight
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.spawning import Capsules, NoRoom, free_ground, place
from numba import njit

MANY = 20_000  # newborns or more are numbered row by row where they stand; the columns of fewer fit into caches


def give_birth(world, spawn, count, stream="birth"):
    """Put animals into the world as a spawn says, inside its polygon, touching nobody.

    Parameters
    ----------
    spawn : Spawn
        Where, which and how; its ``brush`` is one of the world's `Palette`.
    count : int
    stream : str
        Name of the noise: two calls in one tick need two names.

    Returns
    -------
    list of int
        Entities.

    Raises
    ------
    NoRoom
        Nothing has been born then.
    """
    land, palette, clock, noise = (world.resource(kind) for kind in (Landscape, Palette, Clock, Noise))
    index = palette.named(spawn.brush)
    asset = palette.brushes[index]
    fauna, number = world.resource(SpeciesList), np.arange(count)
    known = fauna.library.find(spawn.species)
    body = body_of(asset, known)
    size, pace, boldness = _individuals(known, noise, stream, clock.tick, number)
    length = size * (body.length if spawn.body_length is None else spawn.body_length)
    radius = body.radius * length / body.length
    axis = np.zeros(count) if body.contact == "disc" else np.maximum(0.5 * length - radius, 0.0)
    reach = float((axis + radius).max(initial=0.0))
    ground = ground_for(land, 2 * reach, land.blocked)._replace(bounds=birth_bounds(land, reach))
    others = bodies_of(world.agents, land.wrap, float(length.max(initial=0.0)))
    key = noise.key(stream, clock.tick)
    long, how = 2 * (axis + radius), (spawn.heading, spawn.formation)
    xy, forward = place(spawn.polygon, count, long, radius, *how, key, ground, others)
    if count >= MANY:
        order = _row_by_row(xy)  # so that neighbours in the field are neighbours in memory
        each = xy, forward, length, radius, axis, pace, boldness
        xy, forward, length, radius, axis, pace, boldness = (column[order] for column in each)
    land.see_to(float(length.max(initial=0.0) * palette.view_range.max()))
    chance = noise.normal(stream + " speed", clock.tick, number)[:, 0]
    speeds = _speeds(asset, pace, chance) * length if spawn.speed is None else np.full(count, float(spawn.speed))
    xyz = np.column_stack([xy, _heights(land, xy) + spawn.altitude])
    if spawn.depth > 0.0:
        xyz[:, 2] += spawn.depth * noise.uniform(stream + " height", clock.tick, number)[:, 0]
    if palette.flies_free[index]:
        _clear_of_solids(xyz, float(radius.max(initial=0.0)), land.sky)
    low = spawn.altitude == 0.0 == spawn.depth
    stands = palette.flies_free[index] and known is not None and known.fly.slowest > 0.0 and low
    forward = np.column_stack([forward, np.zeros(count)])
    return world.create_agents(
        count,
        {
            Position.xyz: xyz,
            Velocity.xyz: np.zeros((count, 3)) if stands else forward * speeds[:, None],
            Heading.forward: forward,
            Body.length: length,
            Body.radius: radius,
            Body.axis: axis,
            Species.index: fauna.index(spawn.species),
            Individual.pace: pace,
            Individual.boldness: boldness,
            Transit.kind: TAKING_OFF if stands else SETTLED,
            Vision.range: np.minimum(asset.vision.range * length, farthest_sight(land.wrap)),
            Vision.field_of_view: np.radians(asset.vision.field_of_view),
            **dict.fromkeys((BrushBinding.brush, BrushBinding.previous, BrushBinding.home), index),
            Speed.drawn: speeds,
            Speed.target: speeds,
            Destination.goal: 0 if land.goals else -1,
        },
    )


def _row_by_row(xy):
    """An order of places: rows from the south, each from the west; there are half as many as for a square lattice."""
    low, high = xy.min(axis=0), xy.max(axis=0)
    row = (xy[:, 1] - low[1]) * (0.5 * np.sqrt(len(xy)) / max(high[1] - low[1], 1e-9))
    return np.lexsort((xy[:, 0], np.floor(row)))


def _speeds(asset, pace, chance):
    """Body lengths a second, (n,): from the spread of the brush, by a standard normal number for each."""
    return np.maximum(pace * asset.speed.mean + asset.speed.spread * chance, 0.0)


def _heights(land, xy):
    """m, (n,): of the ground."""
    if land.relief.shape[:2] == (1, 1):
        return np.zeros(len(xy))
    return heights_of_ground(land.heights, xy)


def body_of(brush, species):
    """The body that an animal is born with: the brush's where it has one of its own, else that of the species."""
    return brush.body if brush.has_own_body or species is None else species.body


CUT = 2.0  # standard deviations: no individual differs more


def _individuals(species, noise, stream, tick, number):
    """(size, pace, boldness) of newborns, (n,) each: factors, drawn from the spread of their species.

    What differs in size goes no faster for that: paces are in body lengths, and are divided by it.
    """
    if species is None:
        return (np.ones(len(number)),) * 3
    spread = species.spread
    chance = np.clip(noise.normal(stream + " individual", tick, number, 3), -CUT, CUT)
    size, pace, boldness = 1.0 + chance.T * np.array([[spread.size], [spread.speed], [spread.boldness]])
    return size, pace / size, boldness


def bodies_of(agents, wrap, length):
    """`Capsules` of all there are, on a wrapped map with their copies across the seam that bodies may meet."""
    xy, forward, axis, radius = (agents[f] for f in (Position.xyz, Heading.forward, Body.axis, Body.radius))
    xy = xy[:, :2]
    columns = [np.column_stack([xy, forward[:, :2], axis, radius])]
    if wrap is not None and len(xy):
        near = length + 2 * float((axis + radius).max())
        for dx in (-wrap[0], 0.0, wrap[0]):
            for dy in (-wrap[1], 0.0, wrap[1]):
                moved = xy + (dx, dy)
                close = ((moved > -near) & (moved < np.array(wrap) + near)).all(1)
                if dx or dy:
                    columns.append(columns[0][close] + (dx, dy, 0, 0, 0, 0))
    return Capsules(*(np.ascontiguousarray(column) for column in np.concatenate(columns).T))


def ground_for(land, reach, blocked):
    """`FreeGround` of a landscape for bodies that reach so far, metres."""
    return free_ground(land.walls_within(reach), blocked, land.cell, land.solids)


@njit(cache=True, nogil=True, error_model="numpy")
def _clear_of_solids(xyz, radius, solids):
    """Move newborn animals out of solids."""
    for i in range(len(xyz)):
        _, x, y, z = out_of_(solids, xyz[i, 0], xyz[i, 1], xyz[i, 2], radius)
        xyz[i, 0], xyz[i, 1], xyz[i, 2] = x, y, z


def birth_bounds(land, body):
    """Where the middle of a newborn may be; on a wrapped map not across the seam."""
    west, south, east, north = map(float, land.bounds)
    room = float(body) if land.wrap else 0.0
    return west + room, south + room, east - room, north - room


__all__ = ["NoRoom", "SpeciesList", "give_birth"]
