"""GROUND: what is underfoot, and which brush it gives the animal."""

from __future__ import annotations

import numpy as np
from numba import njit

from components import BrushBinding, Destination, Ground, Position, Vision
from components.agent import Body
from engine.clock import Clock
from engine.parallel import over_rows
from engine.schedule import Stage, System
from systems.landscape import Landscape
from systems.navigation import follow
from systems.palette import Palette
from systems.terrain import underfoot


class Underfoot(System):
    """Brush, speed factor, cap, slope and guidance at the place where each animal stands."""

    stage = Stage.GROUND
    reads = (Position, Body, Destination, Palette, Landscape, Clock)
    writes = (Ground, BrushBinding, Vision)

    def process(self, world):
        agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
        n = len(agents)
        painted, up = np.empty(n, np.int32), np.empty(n)
        xyz, slope = agents[Position.xyz], agents[Ground.slope]
        over_rows(
            underfoot, n, xyz, land.cell, land.surface, land.brush, land.relief_cell, land.relief,
            agents[Ground.factor], agents[Ground.cap], painted, slope, up,
        )  # fmt: skip
        nav = land.navigation
        over_rows(follow, n, xyz, agents[Destination.goal], nav.cell, nav.fields, agents[Ground.guidance])
        b = BrushBinding
        over_rows(
            _bind, n, xyz, land.cell, land.transition, painted,
            agents[b.home], agents[b.brush], agents[b.previous], agents[b.blend],
            agents[Body.length], agents[Vision.range], agents[Vision.field_of_view],
            palette.transition, palette.view_range, palette.field_of_view, world.resource(Clock).dt,
        )  # fmt: skip


@njit(cache=True, nogil=True)
def _bind(
    lo, hi, xyz, cell, here, painted, home, brush, previous, blend, length, view_range, view_angle,
    transition, ranges, angles, dt,
):  # fmt: skip
    """Take up the brush underfoot, or one's own on unpainted ground; blend over its transition time, or the zone's."""
    ny, nx = here.shape
    for i in range(lo, hi):
        wanted = painted[i] if painted[i] >= 0 else home[i]
        if wanted != brush[i]:
            if blend[i] < 1.0 and wanted == previous[i]:
                # back over the border: the same mixture seen from the other side, so that nothing jumps
                previous[i], blend[i] = brush[i], 1.0 - blend[i]
            else:
                # half-way between two brushes the one that weighs more is what the animal comes from
                if blend[i] >= 0.5:
                    previous[i] = brush[i]
                blend[i] = 0.0
            brush[i] = wanted
            view_range[i] = ranges[wanted] * length[i]
            view_angle[i] = angles[wanted]
        if blend[i] < 1.0:
            time = transition[brush[i]]
            if painted[i] == brush[i]:
                ix = int(min(max(xyz[i, 0] / cell, 0.0), nx - 1.0))
                iy = int(min(max(xyz[i, 1] / cell, 0.0), ny - 1.0))
                time = here[iy, ix] if here[iy, ix] >= 0.0 else time
            blend[i] = min(1.0, blend[i] + dt / time) if time > 0.0 else 1.0
