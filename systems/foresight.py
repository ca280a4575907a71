"""SENSE and DECIDE for those in the air: what lies ahead, and where the migration goes.

What lies ahead is what the heading meets within the brush's foresight, a body and a half away from the animal's own
middle line; where to steer instead is a point one body length past its silhouette edge (Reynolds 1987, "Avoiding
Environmental Obstacles", steer-to-avoid).  Animals on the ground are obstacles too: upright cylinders as wide as they
are long and as high as they are wide.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from flockbrush.components import Airborne, Body, BrushBinding, Heading, Migration, Position, Species, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.solid_queries import BodyFrame, ahead_, far_, past_, surface_
from flockbrush.engine.solids import Solids, no_solids, with_cylinders
from flockbrush.systems.fauna import SpeciesList, by_medium
from flockbrush.systems.flight import flyers_of
from flockbrush.systems.grid import with_ghosts
from flockbrush.systems.ground_height import height_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near
from numba import njit

ROOM = 0.5  # body lengths beside the body that count as in the way
NEAR = 2.0  # body lengths beyond its time of foresight that an animal looks ahead


class Foreseen(NamedTuple):
    """What lies ahead, (n,) each unless stated."""

    hit: np.ndarray  # m along the heading to what is in the way; inf: nothing
    aim: np.ndarray  # (n, 3) unit vectors, where to steer instead
    gap: np.ndarray  # m to the nearest surface within foresight; inf: none
    normal: np.ndarray  # (n, 3) unit vectors away from that surface
    height: np.ndarray  # m above the ground


@dataclass
class Ahead:
    """What lies ahead of those in the air, by row (see `flockbrush.behaviours.behaviour.Air`)."""

    hit: np.ndarray = field(default_factory=lambda: np.zeros(0))
    aim: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    gap: np.ndarray = field(default_factory=lambda: np.zeros(0))
    normal: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    height: np.ndarray = field(default_factory=lambda: np.zeros(0))
    solids: Solids = field(default_factory=no_solids)  # the sky's and the bodies of those on the ground

    def trace(self):
        """Arrays by which replays are compared (`flockbrush.engine.trail`)."""
        return self.hit, self.aim, self.gap, self.normal, self.height


class SeeAhead(System):
    """The first solid in the way, and the way past it."""

    stage = Stage.SENSE
    reads = (
        Near, Position, Velocity, Heading, Airborne, Body, BrushBinding, Species, SpeciesList, Palette, Landscape
    )  # fmt: skip
    writes = (Ahead,)

    def process(self, world):
        agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
        near, n = world.resource(Near), len(agents)
        if near.aloft is None:
            world.insert(Ahead())
            return
        aim = agents[Heading.forward].copy()
        foreseen = Foreseen(np.full(n, np.inf), aim, np.full(n, np.inf), np.zeros((n, 3)), np.zeros(n))
        order, foresight = np.flatnonzero(near.aloft), palette.foresight[agents[BrushBinding.brush]]
        table = world.resource(SpeciesList).table
        [top] = by_medium(table, agents[Species.index], near.aloft, table.speed)
        reach = float((foresight * top + (NEAR + ROOM) * agents[Body.length])[order].max())
        solids = solids_to_avoid(agents, land.sky, near.aloft, land.wrap, reach)
        over_rows(
            _look_ahead, len(order), order, agents.ids, flyers_of(agents), foresight, solids, land.heights, foreseen
        )
        world.insert(Ahead(*foreseen, solids))


class ShiftMigration(System):
    """The migratory register moves evenly to where the script wants it."""

    stage, reads, writes = Stage.SENSE, (Clock,), (Migration,)

    def process(self, world):
        left = world.agents[Migration.left]
        moving = left > 0.0
        if moving.any():
            dt = world.resource(Clock).dt
            target, next_ = world.agents[Migration.target], world.agents[Migration.next]
            share = np.minimum(dt / left[moving], 1.0)
            target[moving] += share[:, None] * (next_[moving] - target[moving])
            left[moving] = np.maximum(left[moving] - dt, 0.0)


def solids_to_avoid(agents, sky, aloft, wrap=None, reach=0.0):
    """The solids of the sky, and the bodies of animals on the ground where they are now.

    Those within ``reach`` m of a border over which the map goes on are beyond the opposite one, too.
    """
    walkers = np.flatnonzero(~aloft)
    if not len(walkers):
        return sky
    xyz, size = agents[Position.xyz], agents[Body.axis] + agents[Body.radius]
    x, y = xyz[walkers, 0], xyz[walkers, 1]
    if wrap is not None:
        reach = min(reach, 0.5 * max(wrap)) + float(size[walkers].max())
        x, y, walkers = with_ghosts(x, y, walkers, reach, wrap)
    radius = agents[Body.radius][walkers]
    return with_cylinders(sky, np.column_stack([x, y, xyz[walkers, 2] + radius]), size[walkers], radius)


@njit(cache=True, nogil=True, error_model="numpy")
def _look_ahead(lo, hi, order, ids, flyers, foresight, solids, heights, foreseen):
    xyz, velocity, forward, up, length, radius = flyers
    hit, aim, gap, normal, height = foreseen
    for o in range(lo, hi):
        i = order[o]
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        height[i] = z - height_of_ground(heights, x, y)
        if foresight[i] <= 0.0 or len(solids.kind) == 0:
            continue
        speed = np.sqrt(velocity[i, 0] ** 2 + velocity[i, 1] ** 2 + velocity[i, 2] ** 2)
        reach = foresight[i] * speed + NEAR * length[i]
        fx, fy, fz = forward[i, 0], forward[i, 1], forward[i, 2]
        who, distance = ahead_(solids, x, y, z, fx, fy, fz, reach, radius[i] + ROOM * length[i])
        if who >= 0:
            hit[i] = distance
            beyond = radius[i] + (ROOM + 0.5) * length[i]
            pose = BodyFrame((x, y, z), (fx, fy, fz), (up[i, 0], up[i, 1], up[i, 2]))
            aim[i, 0], aim[i, 1], aim[i, 2] = past_(solids, who, pose, beyond, height[i], ids[i] & 1)
        for k in range(len(solids.kind)):
            if not far_(solids, k, x, y, z, reach, 0.0):
                near, nx, ny, nz = surface_(solids, k, x, y, z)
                if near < gap[i]:
                    gap[i] = near
                    normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz
