"""Who lives in this world: species, births and the animals' first numbers."""

from __future__ import annotations

import json
from dataclasses import dataclass, field

import numpy as np
from numba import njit

from components import (
    Body,
    BrushBinding,
    Destination,
    Heading,
    Position,
    Species,
    Speed,
    Velocity,
    Vision,
)
from engine.clock import Clock
from engine.noise import Noise
from engine.solids import out_of_
from systems.ground_height import height_of_ground
from systems.landscape import Landscape
from systems.palette import Palette
from systems.spawning import NoRoom, outlines, place


@dataclass
class SpeciesList:
    """Names of species by index."""

    names: list[str] = field(default_factory=list)

    def state(self):
        """The names (see `engine.state`)."""
        return json.dumps(self.names).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        self.names = json.loads(data)

    def index(self, name):
        """Index of this species, new or known."""
        if name not in self.names:
            self.names.append(name)
        return self.names.index(name)


def give_birth(
    world, polygon, count, brush, species, heading=None, speed=None, altitude=0.0, formation="scatter",
    body_length=None, stream="birth", depth=0.0,
):  # fmt: skip
    """Put animals into the world, inside a polygon, touching nobody.

    Parameters
    ----------
    polygon : ndarray (k, 2)
        Metres.
    brush : str
        Name in the world's `Palette`.
    heading : float, optional
        Radians; None: each its own.
    speed : float, optional
        Metres per second at birth; None: drawn from the brush's own spread.
    body_length : float, optional
        Metres; None: the brush's.
    stream : str
        Name of the noise: two calls in one tick need two names.
    depth : float
        Metres: they are born at random between ``altitude`` and so much higher.

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
    agents = world.agents
    index = palette.named(brush)
    asset = palette.brushes[index]
    length = asset.body.length if body_length is None else body_length
    radius = asset.body.radius * length / asset.body.length
    axis = 0.0 if asset.body.contact == "disc" else max(0.5 * length - radius, 0.0)
    xy, forward = place(
        polygon, count, 2 * (axis + radius), radius, heading, formation, noise.key(stream, clock.tick),
        land.walls_within(2 * (axis + radius)), land.blocked, land.cell, _bodies(agents, land.wrap, length),
        outlines(land.solids), _inset(land, axis + radius),
    )  # fmt: skip
    land.see_to(float(length * palette.view_range.max()))
    number = np.arange(count)
    spread = asset.speed.deviation / np.sqrt(2 * asset.speed.reversion)
    chance = noise.normal(stream + " speed", clock.tick, number)[:, 0]
    drawn = np.maximum(asset.speed.mean + spread * chance, 0.0) * length
    if speed is not None:
        drawn[:] = speed
    flat = land.relief.shape[:2] == (1, 1)
    z = np.array([0.0 if flat else height_of_ground(land.relief, land.relief_cell, x, y) for x, y in xy]) + altitude
    if depth > 0.0:
        z += depth * noise.uniform(stream + " height", clock.tick, number)[:, 0]
    xyz = np.column_stack([xy, z])
    if palette.flies[index]:
        _clear_of_solids(xyz, radius, land.sky)
    forward = np.column_stack([forward, np.zeros(count)])
    return world.create_agents(
        count,
        {
            Position.xyz: xyz,
            Velocity.xyz: forward * drawn[:, None],
            Heading.forward: forward,
            Body.length: length,
            Body.radius: radius,
            Body.axis: axis,
            Species.index: world.resource(SpeciesList).index(species),
            Vision.range: asset.vision.range * length,
            Vision.field_of_view: np.radians(asset.vision.field_of_view),
            BrushBinding.brush: index,
            BrushBinding.previous: index,
            BrushBinding.home: index,
            Speed.drawn: drawn,
            Speed.target: drawn,
            Destination.goal: 0 if land.goals else -1,
        },
    )


def _bodies(agents, wrap, length):
    """x, y, fx, fy, length, radius of all there are, on a wrapped map with their copies across the seam."""
    xy, forward = agents[Position.xyz][:, :2], agents[Heading.forward]
    size, radius = 2 * (agents[Body.axis] + agents[Body.radius]), agents[Body.radius]
    columns = [np.column_stack([xy, forward[:, :2], size, radius])]
    if wrap is not None and len(xy):
        near = length + float(size.max())
        for dx in (-wrap[0], 0.0, wrap[0]):
            for dy in (-wrap[1], 0.0, wrap[1]):
                moved = xy + (dx, dy)
                close = ((moved > -near) & (moved < np.array(wrap) + near)).all(1)
                if dx or dy:
                    columns.append(columns[0][close] + (dx, dy, 0, 0, 0, 0))
    return tuple(np.ascontiguousarray(column) for column in np.concatenate(columns).T)


@njit(cache=True, nogil=True, error_model="numpy")
def _clear_of_solids(xyz, radius, solids):
    """Moves out of every solid whoever would be born inside one."""
    for i in range(len(xyz)):
        _, x, y, z = out_of_(solids, xyz[i, 0], xyz[i, 1], xyz[i, 2], radius)
        xyz[i, 0], xyz[i, 1], xyz[i, 2] = x, y, z


def _inset(land, body):
    """Where a newborn's middle may be: on a wrapped map nobody is born across the seam."""
    west, south, east, north = land.bounds
    room = body if land.wrap else 0.0
    return west + room, south + room, east - room, north - room


__all__ = ["NoRoom", "SpeciesList", "give_birth"]
