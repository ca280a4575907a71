"""Drives on top of models: prioritised allocation (Reynolds 1987, "Arbitrating independent behaviours").

In the order of the brush each drive takes the share of the body that is as large as its urgency, as long as there is
any left; the model has the rest.  On the ground and where a model wishes a heading, the wishes are velocities: the
model's is its direction at the pace it wants, a drive's the one its acceleration leads to within
`flockbrush.behaviours.behaviour.TAKES_UP`.  In the air they are accelerations, or, for models that say their velocity,
changes of it.  Rows in which no drive acts are not touched.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import TAKES_UP, Bodies, Kinds, frozen
from flockbrush.behaviours.drive import Urges
from flockbrush.components import (
    Alarm,
    Body,
    BrushBinding,
    Family,
    Leading,
    Position,
    Species,
    Thrust,
    Transit,
    Urge,
    Velocity,
    Wish,
)
from flockbrush.components.agent import BY_ACCELERATION, BY_VELOCITY
from flockbrush.engine.plugins import blaming
from flockbrush.engine.seam import short_way
from flockbrush.systems.fauna import FEAR, NO_LIMIT, SpeciesList, by_medium, kin_of, kinds_of
from flockbrush.systems.foresight import Ahead
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.leaders import steering_velocities
from flockbrush.systems.noticing import Noticed
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near

FASTER = 2.0  # times its speed of the moment: the usual flight of a species without a file


class Shares(NamedTuple):
    """What drives took of some rows, and what they made of it."""

    rows: np.ndarray  # (k,)
    names: list  # (d,) of the drives that acted
    share: np.ndarray  # (d, k) of the body, 0 to 1
    acceleration: np.ndarray  # (d, k, 3) m/s², as asked for and within what the body can do


def relations_of(world):
    """`Kinds` of all animals of a world, for models."""
    agents, palette, fauna = world.agents, world.resource(Palette), world.resource(SpeciesList)
    relations = fauna.relations
    kind = kinds_of(agents[Species.index], palette.danger[agents[BrushBinding.brush]])
    return frozen(Kinds(kind, relations.verb == FEAR, relations.prey))


def kin(world):
    """(n,) int32: the same number for those who keep together."""
    return kin_of(world.resource(SpeciesList).table, world.agents[Species.index])


def dangers_of(world):
    """(first, offset) of the dangers that each animal notices."""
    lists, n = world.resource(Noticed).lists, len(world.agents)
    if lists is None:
        return np.zeros(n + 1, np.int64), np.zeros((0, 3))
    feared = lists.verb == FEAR
    if feared.all():
        return lists.first, lists.offset
    before = np.concatenate([[0], np.cumsum(feared)])
    return before[lists.first], lists.offset[feared]


def bodies_of(world, speed):
    """`Bodies` of all animals; None where no drive could act.

    Parameters
    ----------
    speed : ndarray (n,)
        m/s, what the speed process says now.
    """
    agents, palette = world.agents, world.resource(Palette)
    quiet = world.resource(Noticed).lists is None
    quiet &= not (agents[Alarm.level].any() or agents[Transit.kind].any() or agents[Leading.kind].any())
    near, ahead, hilly = world.resource(Near), world.resource(Ahead), world.resource(Landscape).relief.size > 3
    foresees = hilly or (len(ahead.solids.kind) > 0 and palette.drives_needed.any())
    if quiet and not palette.drives_asked.any() and not (foresees and near.aloft is not None):
        return None
    land, table = world.resource(Landscape), world.resource(SpeciesList).table
    n, species, length = len(agents), agents[Species.index], agents[Body.length]
    aloft = np.zeros(n, bool) if near.aloft is None else near.aloft & ~palette.grounded[agents[BrushBinding.brush]]
    top, flee, most = by_medium(table, species, aloft, table.speed, table.flee, table.acceleration)
    known = table.known[species]
    usual = np.maximum(FASTER * speed, 4.0 * length)  # of species without a file
    xyz = agents[Position.xyz]
    threat = agents[Alarm.place] - xyz
    threat[:, :2] = short_way(threat[:, :2], land.wrap)
    return frozen(Bodies(
        aloft=aloft,
        height=xyz[:, 2] - heights_of_ground(land.heights, xyz),
        top=top,
        flee=np.where(known, flee, usual),
        acceleration=np.where(known, most, 4.0 * usual),
        slowest=np.where(aloft, table.slowest[species], 0.0),
        alarm=agents[Alarm.level],
        threat=threat,
        cruise=table.height[species],
        climb=table.climb[species],
        sink=table.sink[species],
        walls=land.solid.ends,
        relief=land.relief,
        relief_cell=land.relief_cell,
        transit=agents[Transit.kind],
        radius=agents[Body.radius],
        family=agents[Family.number],
        solids=ahead.solids,
        foresight=palette.foresight[agents[BrushBinding.brush]],
        wished=np.zeros((n, 3)),
    ))  # fmt: skip


def with_wishes(world, scene):
    """The scene with the velocities that models say, for drives that look where an animal wishes to go.

    Steered animals wish to go where they are sent, and up or down as their model wishes.
    """
    if scene.bodies is None:
        return scene
    agents, aloft = world.agents, scene.bodies.aloft
    says = aloft & (agents[Thrust.kind] == BY_VELOCITY)
    wished, rows = np.where(says[:, None], agents[Thrust.velocity], 0.0), np.flatnonzero(agents[Leading.kind])
    if len(rows):
        own = model_velocity(scene, agents, rows)
        own[says[rows]] = wished[rows[says[rows]]]
        thrusts = agents[Thrust.kind][rows] == BY_ACCELERATION
        own[thrusts] = (scene.velocity + TAKES_UP * agents[Thrust.acceleration])[rows[thrusts]]
        steering_velocities(world, scene, rows, own[:, 2] * aloft[rows], wished)
    return scene._replace(bodies=frozen(scene.bodies._replace(wished=wished)))


def drives_by_rows(world, brush, rows):
    """[(rows, drives)] of one brush: animals that are not steered, and those that are."""
    palette, steered = world.resource(Palette), world.agents[Leading.kind][rows] > 0
    both = (rows[~steered], palette.drives[brush]), (rows[steered], palette.drives_steered[brush])
    return [(some, drives) for some, drives in both if len(some)]


def allocated_shares(scene, rows, drives) -> Shares | None:
    """What the drives of one brush take of these rows; None when none of them acts."""
    left = np.ones(len(rows))
    names, shares, wishes = [], [], []
    for drive, params in drives:
        with blaming("drive", drive.name, drive.urge.__module__):
            urges = drive.urge(scene, rows, params)
            if urges is not None:
                _check(drive, urges, len(rows))
        if urges is None or not np.any(urges.urgency > 0.0):
            continue
        share = np.minimum(np.clip(urges.urgency, 0.0, 1.0), left)
        left = left - share
        names.append(drive.name)
        shares.append(share)
        wishes.append(urges.acceleration)
    if not names:
        return None
    return Shares(rows, names, np.array(shares), np.array(wishes))


def _check(drive, urges, k):
    """Raise TypeError or ValueError, with the name of the drive, where it returned what no row can take."""
    if not isinstance(urges, Urges):
        raise TypeError(f"drive {drive.name!r} must return Urges or None, got {type(urges).__name__}")
    shapes = np.shape(urges.acceleration), np.shape(urges.urgency)
    if shapes != ((k, 3), (k,)):
        raise ValueError(
            f"drive {drive.name!r} was asked for {k} animals: accelerations must be ({k}, 3) and urgencies ({k},), "
            f"got {shapes[0]} and {shapes[1]}"
        )
    if not (np.isfinite(urges.acceleration).all() and np.isfinite(urges.urgency).all()):
        raise ValueError(f"drive {drive.name!r} gave an acceleration or urgency that is not finite")


def allocate(world, scene, taken: Shares):
    """Writes what is wished in the end where drives act: into `Wish`, `Thrust` and `Urge`."""
    agents, bodies = world.agents, scene.bodies
    total = taken.share.sum(axis=0)
    acts = total > 0.0
    rows, total = taken.rows[acts], total[acts]
    left = (1.0 - total)[:, None]
    pushed = (taken.share[:, acts, None] * taken.acceleration[:, acts]).sum(axis=0)
    velocity, kind = agents[Velocity.xyz][rows], agents[Thrust.kind][rows]
    direction, pace = agents[Wish.direction], agents[Wish.pace]
    says = bodies.aloft[rows] & (kind == BY_VELOCITY)
    own = model_velocity(scene, agents, rows)
    own[says] = agents[Thrust.velocity][rows[says]]
    wanted = left * own + total[:, None] * velocity + TAKES_UP * pushed
    thrusts = world.resource(Palette).flies[agents[BrushBinding.brush][rows]] & (kind == BY_ACCELERATION)
    some = rows[thrusts]
    agents[Thrust.acceleration][some] = left[thrusts] * agents[Thrust.acceleration][some] + pushed[thrusts]
    some = rows[says]  # at once as far as the model alone would, and as the body can
    jump = np.sqrt(((left * (own - velocity))[says] ** 2).sum(axis=1))
    change = cut((wanted - velocity)[says], np.maximum(jump, scene.dt * bodies.acceleration[some]))
    wanted[says] = agents[Thrust.velocity][some] = cut(velocity[says] + change, bodies.top[some])
    speed = np.sqrt((wanted**2).sum(axis=1))
    moves = speed > 1e-9
    direction[rows[moves]] = wanted[moves] / speed[moves, None]
    pace[rows] = np.where(scene.speed[rows] > 1e-9, speed / np.maximum(scene.speed[rows], 1e-9), pace[rows])
    agents[Urge.share][rows] = total
    agents[Urge.speed][rows] = np.minimum(speed, bodies.top[rows])
    agents[Urge.driven][rows] = 1


def model_velocity(scene, agents, rows):
    """(k, 3) m/s: what the model alone would have."""
    size = (agents[Wish.pace][rows] * scene.speed[rows])[:, None]
    return size * agents[Wish.direction][rows]


def cut(vectors, most):
    """(k, 3), none longer than ``most`` (k,)."""
    size = np.sqrt((vectors**2).sum(axis=1))
    return vectors * np.minimum(1.0, most / np.maximum(size, 1e-300))[:, None]


__all__ = [
    "NO_LIMIT", "Shares", "allocate", "allocated_shares", "bodies_of", "dangers_of", "drives_by_rows", "kin",
    "relations_of", "with_wishes",
]  # fmt: skip
