"""GROUND: what is underfoot, and which brush it gives the animal."""

from __future__ import annotations

import numpy as np
from flockbrush.components import (
    BrushBinding,
    Destination,
    Ground,
    Leading,
    Migration,
    Position,
    ProgramState,
    Species,
    Speed,
    Transit,
    Urge,
    Velocity,
    Vision,
)
from flockbrush.components.agent import Body
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.binding import mix_paint, painted_for, through_media
from flockbrush.systems.fauna import AIR, PLANE, WATER, SpeciesList
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import hold_back, steer_leaders
from flockbrush.systems.navigation import follow
from flockbrush.systems.palette import Palette
from flockbrush.systems.terrain import NO_BRUSH, underfoot
from numba import njit


class Underfoot(System):
    """Brush, speed factor, cap, slope and guidance at the place where each animal stands."""

    stage = Stage.GROUND
    reads = (
        Position,
        Velocity,
        Body,
        Destination,
        Migration,
        ProgramState,
        Species,
        SpeciesList,
        Palette,
        Landscape,
        Clock,
        Noise,
    )
    writes = (Ground, BrushBinding, Vision, Transit, Speed, Urge, Leading)

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
        steer_leaders(agents)
        hold_back(agents, palette)
        b = BrushBinding
        self._paint(world, xyz[:, 2] - up, painted)
        state = agents[ProgramState.brush]
        painted[state >= 0] = NO_BRUSH  # a program's state stands above all paint
        wanted = np.where(state >= 0, state, np.where(painted >= 0, painted, agents[b.home])).astype(np.int32)
        self._change_media(world, xyz[:, 2] - up, wanted)
        over_rows(
            _bind, n, xyz, land.cell, land.transition, painted, wanted,
            agents[b.brush], agents[b.previous], agents[b.blend],
            agents[Body.length], agents[Vision.range], agents[Vision.field_of_view],
            palette.transition, palette.view_range, palette.field_of_view, world.resource(Clock).dt,
        )  # fmt: skip

    @staticmethod
    def _change_media(world, height, wanted):
        """Who wants a brush of another medium lands or takes off first."""
        agents, palette = world.agents, world.resource(Palette)
        table, air, brush = world.resource(SpeciesList).table, palette.flies_free, agents[BrushBinding.brush]
        if not air.any() or not ((air[wanted] != air[brush]) | (agents[Transit.kind] > 0)).any():
            return
        walks = table.media[:, PLANE] | table.media[:, WATER]
        over_rows(
            through_media, len(agents), wanted, brush, air, walks, table.media[:, AIR], agents[Species.index],
            table.slowest, table.height, agents[Migration.kind] > 0, palette.least_speed,
            agents[Body.length], agents[Body.radius], height, agents[Velocity.xyz],
            agents[Transit.kind], agents[Speed.drawn], agents[Urge.driven],
        )  # fmt: skip

    @staticmethod
    def _paint(world, height, painted):
        """What paint gives to each animal, by its species, medium and height."""
        agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
        above, below, *bounds = land.sheets.packed(palette, world.resource(SpeciesList))
        if len(palette):
            over_rows(
                painted_for, len(agents), agents[Position.xyz], land.cell, above, land.painted.brush, below, *bounds,
                palette.flies_free, agents[Species.index], agents[BrushBinding.brush], agents[Body.length],
                agents[Body.radius], height, painted,
            )  # fmt: skip
        if land.sheets.mixing:
            over_rows(
                mix_paint, len(agents), agents[Position.xyz], land.cell,
                land.sheets.packed_mixing(palette, world.resource(SpeciesList)), palette.flies_free, palette.mixes,
                world.resource(Noise).key("paint", 0), agents.ids, agents[Species.index],
                agents[BrushBinding.brush], agents[BrushBinding.home], agents[Body.length], agents[Body.radius],
                height, painted,
            )  # fmt: skip


@njit(cache=True, nogil=True)
def _bind(
    lo, hi, xyz, cell, here, painted, wanted, brush, previous, blend, length, view_range, view_angle,
    transition, ranges, angles, dt,
):  # fmt: skip
    """Take up the brush that is wanted; blend over its transition time, or the zone's where paint gives it."""
    ny, nx = here.shape
    for i in range(lo, hi):
        if wanted[i] != brush[i]:
            if blend[i] < 1.0 and wanted[i] == previous[i]:
                # back over the border: the same mixture seen from the other side, so that nothing jumps
                previous[i], blend[i] = brush[i], 1.0 - blend[i]
            else:
                # half-way between two brushes the one that weighs more is what the animal comes from
                if blend[i] >= 0.5:
                    previous[i] = brush[i]
                blend[i] = 0.0
            brush[i] = wanted[i]
            view_range[i] = ranges[brush[i]] * length[i]
            view_angle[i] = angles[brush[i]]
        if blend[i] < 1.0:
            time = transition[brush[i]]
            if painted[i] == brush[i]:
                ix = int(min(max(xyz[i, 0] / cell, 0.0), nx - 1.0))
                iy = int(min(max(xyz[i, 1] / cell, 0.0), ny - 1.0))
                time = here[iy, ix] if here[iy, ix] >= 0.0 else time
            blend[i] = min(1.0, blend[i] + dt / time) if time > 0.0 else 1.0
