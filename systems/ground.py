"""GROUND: what is underfoot, and which brush it gives the animal."""

from __future__ import annotations

from typing import NamedTuple

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
from flockbrush.systems.binding import Bindable, MediaChange, mix_paint, painted_brush, through_media
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.grid import farthest_sight
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import release_arrived
from flockbrush.systems.navigation import follow
from flockbrush.systems.palette import Palette
from flockbrush.systems.terrain import NO_BRUSH, Footing, sample_ground
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
        footing = Footing(agents[Ground.factor], agents[Ground.cap], painted, slope, up)
        over_rows(sample_ground, n, xyz, land.cell, land.surface, land.brush, land.heights, footing)
        steepest = world.resource(SpeciesList).table.steepest
        ways = land.ways_for(steepest, agents[Species.index], agents[Destination.goal])
        way = land.navigation
        over_rows(follow, n, xyz, ways, way.cell, way.fields, way.wrap, agents[Ground.guidance])
        release_arrived(world)
        b = BrushBinding
        animals = Bindable(
            agents.ids, agents[Species.index], agents[b.brush], agents[b.home], xyz, agents[Velocity.xyz],
            agents[Body.length], agents[Body.radius], xyz[:, 2] - up,
        )  # fmt: skip
        self._paint(world, animals, painted)
        state = agents[ProgramState.brush]
        painted[state >= 0] = NO_BRUSH  # a program's state stands above all paint
        wanted = np.where(state >= 0, state, np.where(painted >= 0, painted, agents[b.home])).astype(np.int32)
        self._change_media(world, animals, wanted)
        rules = TakingUp(palette.transition, palette.view_range, palette.field_of_view)
        taken = Taken(*(agents[c] for c in (b.brush, b.previous, b.blend, Vision.range, Vision.field_of_view)))
        dt = world.resource(Clock).dt
        over_rows(_bind, n, animals, land.cell, land.transition, painted, wanted, rules, dt, taken)
        if land.wrap is not None:
            np.minimum(taken.view_range, farthest_sight(land.wrap), out=taken.view_range)

    @staticmethod
    def _change_media(world, animals, wanted):
        """Who wants a brush of another medium lands or takes off first."""
        agents, palette = world.agents, world.resource(Palette)
        air, transit = palette.flies_free, agents[Transit.kind]
        if not air.any() or not ((air[wanted] != air[animals.brush]) | (transit > 0)).any():
            return
        table, bound = world.resource(SpeciesList).table, agents[Migration.kind] > 0
        crossing = MediaChange(wanted, transit, agents[Speed.drawn], agents[Urge.driven])
        over_rows(through_media, len(agents), animals, air, palette.least_speed, table, bound, crossing)

    @staticmethod
    def _paint(world, animals, painted):
        """What paint gives to each animal, by its species, medium and height."""
        land, palette, fauna = world.resource(Landscape), world.resource(Palette), world.resource(SpeciesList)
        n, air = len(painted), palette.flies_free
        if len(palette):
            sheets = land.sheets.packed(palette, fauna)
            over_rows(painted_brush, n, animals, land.cell, sheets, land.painted.brush, air, painted)
        if land.sheets.mixing:
            sheets, key = land.sheets.packed_mixing(palette, fauna), world.resource(Noise).key("paint", 0)
            wrap = land.heights.wrap
            over_rows(mix_paint, n, animals, land.cell, wrap, sheets, air, palette.mixes, key, painted)


class TakingUp(NamedTuple):
    """What becomes of an animal under a brush, (b,) each."""

    transition: np.ndarray  # s in which it is taken up
    ranges: np.ndarray  # body lengths that one sees
    angles: np.ndarray  # rad, full field of view


class Taken(NamedTuple):
    """Which brush each animal has, (n,) each; is written."""

    brush: np.ndarray  # int32
    previous: np.ndarray  # int32
    blend: np.ndarray  # 0: still the previous brush, 1: the brush alone
    view_range: np.ndarray  # m
    view_angle: np.ndarray  # rad


@njit(cache=True, nogil=True)
def _bind(lo, hi, animals, cell, here, painted, wanted, rules, dt, taken):
    """Take up the brush that is wanted; blend over its transition time, or the zone's where paint gives it."""
    xyz, length = animals.xyz, animals.length
    transition, ranges, angles = rules
    brush, previous, blend, view_range, view_angle = taken
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
