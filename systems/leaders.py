"""Who follows the guides, and leaders that are appointed and steered: commands, and the kernels of DECIDE and GROUND.

By the paper's rule (Gong et al. 2025, section 5.1) an animal leads that sees at most two others.  In a packed herd next
to nobody does, and a guide is dead.  So a brush says who follows a guide where there is one: ``guided`` is ``front``
(the paper's rule alone), ``everyone``, a ``share`` of the animals, or those ``appointed``.  Whoever is appointed
always leads.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from flockbrush.components import Body, BrushBinding, Ground, Leading, Position, Role
from flockbrush.components.agent import DIRECTION, NOWHERE, POINT
from flockbrush.engine.commands import command
from flockbrush.engine.noise import Noise, uniform_
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.palette import Palette
from flockbrush.systems.selection import OfAnimals, check_circle
from flockbrush.systems.undo import need, need_entities, rows_of
from numba import njit

ARRIVED = 1.0  # body lengths from the place where it is sent: there a steered animal stops being steered
KINDS = {"free": NOWHERE, "direction": DIRECTION, "place": POINT}


def need_alive(world, entities):
    """Rows of these animals; ValueError when one of them does not live."""
    need_entities(entities)
    rows = rows_of(world, entities)
    if len(rows) < len(entities):
        missing = sorted(set(entities) - set(world.agents.ids[rows].tolist()))
        raise ValueError(f"there is no animal {missing[0]}")
    return rows


class ToLeaders(OfAnimals):
    """A command to the animals that it names, or to those of a species in a circle."""

    def check(self, world):
        check_circle(self)
        self.rows(world)

    def rows(self, world):
        return need_alive(world, self.entities) if self.entities else super().rows(world)


@command
class Appoint(ToLeaders):
    """Make animals leaders, or plain members of the herd again: others follow them by what they see.

    Those with these numbers; without numbers a species, or those within ``radius`` of (at_x, at_y).
    """

    changes = (Leading.appointed, Leading.kind, Leading.target)
    entities: list = field(default_factory=list)
    leads: bool = True
    species: str = ""
    at_x: float = 0.0
    at_y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def apply(self, world):
        rows = self.rows(world)
        world.agents[Leading.appointed][rows] = self.leads
        if not self.leads:
            world.agents[Leading.kind][rows] = NOWHERE
            world.agents[Leading.target][rows] = 0.0


@command
class Steer(ToLeaders):
    """Send appointed animals: ``kind`` is direction (x east, y north, length at most 1), place (m), or free.

    The length of a direction is the share of its own speed at which a walker goes; with 0 it stands.  Free animals
    follow the guides.  An animal that has come to its place is free again.  Without numbers it sends the appointed
    ones of a species, or those within ``radius`` of (at_x, at_y).
    """

    changes = (Leading.kind, Leading.target)
    entities: list = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    kind: str = "direction"
    species: str = ""
    at_x: float = 0.0
    at_y: float = 0.0
    radius: float = 0.0  # m; 0: everywhere

    def check(self, world):
        need(self.kind in KINDS, f"kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if self.kind == "direction":
            need(self.x**2 + self.y**2 <= 1.0 + 1e-9, f"a direction is at most 1 long, got ({self.x:g}, {self.y:g})")
        super().check(world)
        rows = super().rows(world)
        if self.entities:
            plain = world.agents.ids[rows][world.agents[Leading.appointed][rows] == 0]
            need(not len(plain), f"animal {plain[0] if len(plain) else 0} is not appointed; give Appoint first")

    def rows(self, world):
        rows = super().rows(world)
        return rows[world.agents[Leading.appointed][rows] > 0]

    def apply(self, world):
        rows = self.rows(world)
        world.agents[Leading.kind][rows] = KINDS[self.kind]
        world.agents[Leading.target][rows] = (0.0, 0.0) if self.kind == "free" else (self.x, self.y)


def steer_leaders(agents):
    """Put the wishes of whoever steers in the place of the guides, for steered animals alone."""
    rows = np.flatnonzero(agents[Leading.kind])
    if not len(rows):
        return
    kind, target = agents[Leading.kind][rows], agents[Leading.target][rows]
    way = np.where((kind == POINT)[:, None], target - agents[Position.xyz][rows, :2], target)
    far = np.sqrt((way * way).sum(1))
    arrived = (kind == POINT) & (far <= ARRIVED * agents[Body.length][rows])
    scale = np.where(kind == POINT, 1.0 / np.maximum(far, 1e-12), 1.0)
    agents[Ground.guidance][rows] = np.where(arrived[:, None], 0.0, way * scale[:, None])
    agents[Leading.kind][rows[arrived]] = NOWHERE
    agents[Leading.target][rows[arrived]] = 0.0


def hold_back(agents, palette):
    """Walkers that are steered by a direction shorter than 1 go no faster than that share of their speed."""
    rows = np.flatnonzero(agents[Leading.kind] == DIRECTION)
    if not len(rows):
        return
    brush = agents[BrushBinding.brush][rows]
    share = np.sqrt((agents[Leading.target][rows] ** 2).sum(1))
    most = share * palette.mean[brush] * agents[Body.length][rows]
    held = ~palette.flies_free[brush] & (share < 1.0 - 1e-9)
    agents[Ground.cap][rows[held]] = np.minimum(agents[Ground.cap][rows[held]], most[held])


def lead_by_brush(world):
    """Make those leaders whom their brush lets follow a guide where there is one, and all who are appointed."""
    agents, palette = world.agents, world.resource(Palette)
    appointed = agents[Leading.appointed]
    if not palette.guided.any() and not appointed.any():
        return
    over_rows(
        _lead, len(agents), agents.ids, agents[BrushBinding.brush], agents[Ground.guidance], appointed,
        palette.guided, palette.guided_share, world.resource(Noise).key("guided", 0), agents[Role.leader],
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _lead(lo, hi, ids, brush, guidance, appointed, guided, share, key, leader):
    for i in range(lo, hi):
        rule = guided[brush[i]]
        if rule == 3:
            leader[i] = 0
        elif rule == 1 or (rule == 2 and uniform_(key, ids[i], 0) < share[brush[i]]):
            leader[i] |= guidance[i, 0] != 0.0 or guidance[i, 1] != 0.0
        if appointed[i]:
            leader[i] = 1
