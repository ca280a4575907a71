"""DECIDE: who leads, who keeps his place by whom."""

from __future__ import annotations

import numpy as np
from flockbrush.components import (
    Body,
    BrushBinding,
    Ground,
    Heading,
    Leading,
    Memory,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Velocity,
)
from flockbrush.components.formation import FormationPlace, Lost
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.formations import keep_formations
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import lead_by_brush
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Sight, SightInSpace
from numba import njit


class Roles(System):
    """Leaders see at most two of their kind (Gong et al. 2025, section 5.1); all remember where the herd was.

    The nearest visible animal in the front half is the one to keep one's place by.  Birds in line formation have
    rules of their own for both (`flockbrush.systems.formations`).
    """

    stage = Stage.DECIDE
    reads = (
        Position, Velocity, Heading, Body, Species, Speed, BrushBinding, Sight, Palette, Landscape, Clock, Noise,
        Ground, Leading, SightInSpace,
    )  # fmt: skip
    writes = (Role, Memory, ReferenceBird, FormationPlace, Lost)

    def process(self, world):
        agents, palette, found = world.agents, world.resource(Palette), world.resource(Sight).found
        cells, brush, reference = found.cells, agents[BrushBinding.brush], agents[ReferenceBird.entity]
        if len(cells.slot) > len(cells.row):  # those in the air see nobody on the ground
            nobody = cells.slot < 0
            agents[Role.leader][nobody] = palette.leader_neighbours[brush[nobody]] >= 0
            reference[nobody] = 0
        over_rows(
            _roles_by_slot, len(cells.row), cells.x, cells.y, cells.fx, cells.fy, cells.row, cells.ghost,
            agents[Species.index][cells.row], found.begin, found.count, found.seen,
            agents.ids, agents[Position.xyz], agents[Body.length], brush,
            palette.neighbour_range, palette.leader_neighbours, palette.leader_cone,
            agents[Role.leader], agents[Memory.herd], agents[Memory.known], reference,
        )  # fmt: skip
        lead_by_brush(world)
        keep_formations(world)


@njit(cache=True, nogil=True, error_model="numpy")
def _roles(
    lo,
    hi,
    xyz,
    length,
    species,
    brush,
    forward,
    first,
    near,
    offset,
    neighbour_range,
    leader_neighbours,
    leader_cone,
    leader,
    herd,
    known,
):
    for i in range(lo, hi):
        b = brush[i]
        reach = neighbour_range[b] * length[i]
        sx = sy = 0.0
        cosine = leader_cone[b]
        count = before = 0
        for k in range(first[i], first[i + 1]):
            x, y = offset[k, 0], offset[k, 1]
            if x * x + y * y <= reach * reach and species[near[k]] == species[i]:
                sx += x
                sy += y
                count += 1
                ahead = forward[i, 0] * x + forward[i, 1] * y
                before += cosine <= -1.0 or ahead >= cosine * np.sqrt(x * x + y * y)
        leader[i] = before <= leader_neighbours[b]
        if count > 0:
            herd[i, 0], herd[i, 1] = xyz[i, 0] + sx / count, xyz[i, 1] + sy / count
            known[i] = 1


@njit(cache=True, nogil=True, error_model="numpy")
def _roles_by_slot(
    lo, hi, x, y, fx, fy, row, ghost, species, begin, count, seen, ids, xyz, length, brush,
    neighbour_range, leader_neighbours, leader_cone, leader, herd, known, reference,
):  # fmt: skip
    """As `_roles`, and the reference birds, of the animals in slots lo to hi."""
    for s in range(lo, hi):
        if ghost[s]:
            continue
        i = row[s]
        b = brush[i]
        reach2, cosine = (neighbour_range[b] * length[i]) ** 2, leader_cone[b]
        sx = sy = 0.0
        kin = before = 0
        nearest, who = np.inf, -1
        for k in range(begin[s], begin[s] + count[i]):
            j = seen[k]
            dx, dy = x[j] - x[s], y[j] - y[s]
            d2, ahead = dx * dx + dy * dy, fx[s] * dx + fy[s] * dy
            if d2 < nearest and ahead > 0.0:
                nearest, who = d2, j
            if d2 <= reach2 and species[j] == species[s]:
                sx += dx
                sy += dy
                kin += 1
                before += cosine <= -1.0 or ahead >= cosine * np.sqrt(d2)
        reference[i] = ids[row[who]] if who >= 0 else 0
        leader[i] = before <= leader_neighbours[b]
        if kin > 0:
            herd[i, 0], herd[i, 1] = xyz[i, 0] + sx / kin, xyz[i, 1] + sy / kin
            known[i] = 1
