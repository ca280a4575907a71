"""DECIDE: who leads, who keeps his place by whom."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.components import (
    Body,
    BrushBinding,
    Destination,
    Ground,
    Heading,
    Leading,
    Memory,
    Migration,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Velocity,
    Vision,
)
from flockbrush.components.formation import FormationPlace, Lost
from flockbrush.engine.clock import Clock
from flockbrush.engine.lanes import pointer
from flockbrush.engine.noise import Noise
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.formations import keep_formations
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import assign_leaders
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
        Ground, Leading, SightInSpace, Destination, Migration, Vision,
    )  # fmt: skip
    writes = (Role, Memory, ReferenceBird, FormationPlace, Lost)

    def process(self, world):
        agents, palette, found = world.agents, world.resource(Palette), world.resource(Sight).by_slot
        cells, brush, reference = found.cells, agents[BrushBinding.brush], agents[ReferenceBird.entity]
        if len(cells.slot) > len(cells.row):  # animals in the air see none on the ground
            nobody = cells.slot < 0
            agents[Role.leader][nobody] = palette.leader_neighbours[brush[nobody]] >= 0
            reference[nobody] = 0
        members = Members(agents.ids, agents[Position.xyz], agents[Body.length], agents[Species.index], brush)
        rules = LeaderRules(palette.neighbour_range, palette.leader_neighbours, palette.leader_cone)
        state = RoleState(agents[Role.leader], agents[Memory.herd], agents[Memory.known])
        over_rows(_roles_by_slot, len(cells.row), found, members.species[cells.row], members, rules, state, reference)
        assign_leaders(world)
        keep_formations(world)


class Members(NamedTuple):
    """Who looks and is looked at, (n,) each unless stated."""

    ids: np.ndarray
    xyz: np.ndarray  # (n, 3) m
    length: np.ndarray  # m
    species: np.ndarray
    brush: np.ndarray


class LeaderRules(NamedTuple):
    """The columns of the `Palette` that say who leads, by brush."""

    neighbour_range: np.ndarray  # body lengths
    leader_neighbours: np.ndarray
    leader_cone: np.ndarray  # cosine of half the cone


class RoleState(NamedTuple):
    """What is written, by row."""

    leader: np.ndarray  # (n,)
    herd: np.ndarray  # (n, 2) m, where it last saw the others
    known: np.ndarray  # (n,) whether there is such a place


@njit(cache=True, nogil=True, error_model="numpy")
def roles_kernel(lo, hi, forward, first, near, offset, members, rules, state):
    xyz, length, species = members.xyz, members.length, members.species
    for i in range(lo, hi):
        b = members.brush[i]
        reach, cosine = rules.neighbour_range[b] * length[i], rules.leader_cone[b]
        sx = sy = 0.0
        count = before = 0
        for k in range(first[i], first[i + 1]):
            x, y = offset[k, 0], offset[k, 1]
            if x * x + y * y <= reach * reach and species[near[k]] == species[i]:
                sx += x
                sy += y
                count += 1
                ahead = forward[i, 0] * x + forward[i, 1] * y
                before += cosine <= -1.0 or ahead >= cosine * np.sqrt(x * x + y * y)
        _remember(i, count, before, sx, sy, xyz, rules.leader_neighbours[b], state)


@njit(inline="always")
def _remember(i, kin, before, sx, sy, xyz, most, state):
    """Who sees so many of its kind, so many of them before it, at offsets that add up to (sx, sy)."""
    state.leader[i] = before <= most
    if kin > 0:
        state.herd[i, 0], state.herd[i, 1] = xyz[i, 0] + sx / kin, xyz[i, 1] + sy / kin
        state.known[i] = 1


@njit(cache=True, nogil=True, error_model="numpy")
def _roles_by_slot(lo, hi, found, species, members, rules, state, reference):
    """As `roles_kernel`, and the reference birds, of the animals in slots lo to hi; ``species`` is by slot."""
    cells, _, begin, count = found
    x, y, kind, seen = pointer(cells.x), pointer(cells.y), pointer(species), pointer(found.seen)
    for s in range(lo, hi):
        if cells.ghost[s]:
            continue
        i = cells.row[s]
        b = members.brush[i]
        reach2, cosine = (rules.neighbour_range[b] * members.length[i]) ** 2, rules.leader_cone[b]
        xi, yi, u, v = x[s], y[s], cells.fx[s], cells.fy[s]
        all_round, sx, sy, kin, before = cosine <= -1.0, 0.0, 0.0, 0, 0
        nearest, who = np.inf, np.int32(-1)
        for k in range(begin[s], begin[s] + count[i]):  # without branches, which would be foreseen wrongly
            j = seen[k]
            dx, dy = x[j] - xi, y[j] - yi
            d2, ahead = dx * dx + dy * dy, u * dx + v * dy
            nearer = (d2 < nearest) & (ahead > 0.0)
            nearest, who = (d2 if nearer else nearest), (j if nearer else who)
            alike = (d2 <= reach2) & (kind[j] == kind[s])
            sx += dx if alike else 0.0
            sy += dy if alike else 0.0
            kin += alike
            before += alike & (all_round or ahead >= cosine * np.sqrt(d2))
        reference[i] = members.ids[cells.row[who]] if who >= 0 else 0
        _remember(i, kin, before, sx, sy, members.xyz, rules.leader_neighbours[b], state)
