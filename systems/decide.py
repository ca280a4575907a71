"""DECIDE: who leads, who keeps his place by whom."""

from __future__ import annotations

import numpy as np
from numba import njit

from components import Body, BrushBinding, Heading, Memory, Position, ReferenceBird, Role, Species, Speed, Velocity
from components.formation import FormationPlace
from engine.clock import Clock
from engine.noise import Noise
from engine.parallel import over_rows
from engine.schedule import Stage, System
from systems.formations import keep_formations
from systems.landscape import Landscape
from systems.palette import Palette
from systems.senses import Sight


class Roles(System):
    """Leaders see at most two of their kind (Gong et al. 2025, section 5.1); all remember where the herd was.

    The nearest visible animal in the front half is the one to keep one's place by.  Birds in line formation have
    rules of their own for both (`systems.formations`).
    """

    stage = Stage.DECIDE
    reads = (
        Position, Velocity, Heading, Body, Species, Speed, BrushBinding, Sight, Palette, Landscape, Clock, Noise,
    )  # fmt: skip
    writes = (Role, Memory, ReferenceBird, FormationPlace)

    def process(self, world):
        agents, palette, lists = world.agents, world.resource(Palette), world.resource(Sight).lists
        over_rows(
            _roles, len(agents), agents[Position.xyz], agents[Body.length], agents[Species.index],
            agents[BrushBinding.brush],
            agents[Heading.forward], lists.first, lists.near, lists.offset,
            palette.neighbour_range, palette.leader_neighbours, palette.leader_cone,
            agents[Role.leader], agents[Memory.herd], agents[Memory.known],
        )  # fmt: skip
        over_rows(
            _reference, len(agents), agents.ids, agents[Heading.forward],
            lists.first, lists.near, lists.offset, agents[ReferenceBird.entity],
        )  # fmt: skip
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


@njit(cache=True, nogil=True)
def _reference(lo, hi, ids, forward, first, near, offset, reference):
    for i in range(lo, hi):
        nearest, who = np.inf, 0
        for k in range(first[i], first[i + 1]):
            x, y = offset[k, 0], offset[k, 1]
            d2 = x * x + y * y
            if d2 < nearest and forward[i, 0] * x + forward[i, 1] * y > 0.0:
                nearest, who = d2, ids[near[k]]
        reference[i] = who
