"""Who follows the guides, and leaders that are appointed and steered: commands, and the kernels of DECIDE and GROUND.

By the paper's rule (Gong et al. 2025, section 5.1) an animal leads that sees at most two others.  In a packed herd next
to nobody does, and a guide is dead.  So a brush says who follows a guide where there is one: ``guided`` is ``front``
(the paper's rule alone), ``everyone``, a ``share`` of the animals, or those ``appointed``.  Whoever is appointed
always leads.

A steered animal of any model goes where it is sent: its wish to go there takes what the drives that keep the body whole
leave (`flockbrush.behaviours.drive.drives_of_steered`), so that nothing is left to its model and to other drives.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from flockbrush.behaviours.behaviour import TAKES_UP, air_of, frozen
from flockbrush.behaviours.drives.avoid_obstacles import past_solids
from flockbrush.components import Body, BrushBinding, Ground, Leading, Position, Role, Species
from flockbrush.components.agent import DIRECTION, NOWHERE, POINT
from flockbrush.engine.commands import command
from flockbrush.engine.maths import atan2_, sincos_
from flockbrush.engine.noise import Noise, uniform_
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.seam import short_way
from flockbrush.systems.fauna import SpeciesList, by_medium
from flockbrush.systems.flight import MAX_ACCELERATION
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.selection import OfAnimals
from flockbrush.systems.undo import need, need_entities, rows_of
from numba import njit

ARRIVED = 1.0  # body lengths from the place where it is sent: there a steered animal stops being steered
WALK = 1.0  # body lengths per second: slower brushes do not slow steered animals
STAND = 1e-6  # m/s: standing animals keep their heading
WIDEST = 2.7  # rad to the side of the heading that are asked for: what is straight behind has no side
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
        super().check(world)
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

    The length of a direction is the share of its own speed at which it goes.  With 0 it stands; who cannot stand, in
    the air, goes straight on as slowly as it can.  Free animals do what their model and their drives say.  An animal
    that has come to its place is free again.  Without numbers it sends the appointed ones of a species, or those within
    ``radius`` of (at_x, at_y).
    """

    place_kinds = ("place",)
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


def release_arrived(world):
    """Who has come to the place where it is sent is free again."""
    agents = world.agents
    rows = np.flatnonzero(agents[Leading.kind] == POINT)
    if not len(rows):
        return
    length, way, (slowest, turn, most) = agents[Body.length][rows], _way_to(world, rows), _limits(world, rows)
    circle = np.maximum(slowest / turn, slowest**2 / most)  # animals that cannot stand circle round their place
    there = rows[np.sqrt((way * way).sum(axis=1)) <= np.maximum(ARRIVED * length, circle)]
    agents[Leading.kind][there] = NOWHERE
    agents[Leading.target][there] = 0.0


def _limits(world, rows):
    """(k,) m/s, rad/s and m/s²: the slowest that each can go, and the most that it can turn and accelerate."""
    agents, palette, table = world.agents, world.resource(Palette), world.resource(SpeciesList).table
    brush, length, species = agents[BrushBinding.brush][rows], agents[Body.length][rows], agents[Species.index][rows]
    aloft = palette.flies_free[brush]
    turn, most = by_medium(table, species, aloft, table.turn, table.acceleration)
    slowest = np.maximum(palette.least_speed[brush] * length, np.where(aloft, table.slowest[species], 0.0))
    most = np.minimum(most, palette.flight[brush, MAX_ACCELERATION] * length)
    return slowest, np.minimum(turn, palette.max_turn[brush]), most


def _way_to(world, rows):
    """(k, 2) m from each of these to the place where it is sent, across a seam if that is shorter."""
    agents, wrap = world.agents, world.resource(Landscape).wrap
    return short_way(agents[Leading.target][rows] - agents[Position.xyz][rows, :2], wrap)


def steering_velocities(world, scene, rows, rise, wished):
    """Write the velocities that take these steered animals where they are sent, as fast as they can turn.

    Those in the air pass what stands in their way.

    Parameters
    ----------
    rise : ndarray (k,)
        m/s, up; as their models wish.
    wished : ndarray (n, 3)
        m/s, by row.
    """
    agents, bodies = world.agents, scene.bodies
    place = agents[Leading.kind][rows] == POINT
    way = np.where(place[:, None], _way_to(world, rows), agents[Leading.target][rows])
    _send(rows, scene.animals, bodies.aloft, place, way, _limits(world, rows), wished)
    wished[rows, 2] = np.clip(rise, -bodies.sink[rows], bodies.climb[rows])
    if not len(bodies.solids.kind):
        return
    hit, aim, bodies = np.full(len(rows), np.inf), np.zeros((len(rows), 3)), frozen(bodies._replace(wished=wished))
    past_solids(rows, bodies, scene.animals, air_of(scene).up, hit, aim)
    ahead = hit < np.where(place, np.sqrt((way * way).sum(axis=1)), np.inf)
    wished[rows[ahead]] = np.sqrt((wished[rows[ahead]] ** 2).sum(axis=1))[:, None] * aim[ahead]


@njit(cache=True, nogil=True, error_model="numpy")
def _send(rows, animals, aloft, place, way, limits, wished):
    forward, velocity, length, speed = animals.forward, animals.velocity, animals.length, animals.speed
    slowest, turn, most = limits
    for k in range(len(rows)):
        i = rows[k]
        x, y, fx, fy = way[k, 0], way[k, 1], forward[i, 0], forward[i, 1]
        far = np.sqrt(x * x + y * y)
        fast = np.sqrt(velocity[i, 0] ** 2 + velocity[i, 1] ** 2)
        rate = min(turn[k], most[k] / max(fast, 1e-6))
        pace = max(speed[i], WALK * length[i])
        pace = min(pace, 0.5 * rate * far) if place[k] else pace * far
        pace = max(pace, slowest[k], STAND)
        angle = atan2_(fx * y - fy * x, fx * x + fy * y) if far > 0.0 else 0.0
        limit = min(TAKES_UP * (rate if aloft[i] else turn[k]), WIDEST)
        sine, cosine = sincos_(min(max(angle, -limit), limit))
        per = pace / max(np.sqrt(fx * fx + fy * fy), 1e-9)
        wished[i, 0], wished[i, 1] = per * (cosine * fx - sine * fy), per * (sine * fx + cosine * fy)


def assign_leaders(world):
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
