"""Flocks in line formation, tick by tick: who leads, whom each follows, where its place is (Klotsman & Tal).

A flock is a skein: birds of one kind under one brush that found each other by what they see
(`flockbrush.systems.skeins`).  Its frame has the leader as origin and the leader's heading as track, so a flock turns
with its leader.  The target shape is the steady flight of the
brush, which goes on by itself: initiation and steady flight are one, and a bird that comes later finds its place.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.formation.reaching import FormingRules, part_in_height
from flockbrush.behaviours.models.line_formation import AFTER, frame_of, places, rules_of
from flockbrush.components import (
    Body,
    BrushBinding,
    Destination,
    Heading,
    Leading,
    Migration,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Velocity,
    Vision,
)
from flockbrush.components.agent import DIRECTION, POINT
from flockbrush.components.formation import FormationPlace, Lost
from flockbrush.engine.clock import Clock
from flockbrush.engine.maths import atan2_, sincos_
from flockbrush.engine.noise import Noise
from flockbrush.engine.seam import short_way
from flockbrush.systems.gusts import blow
from flockbrush.systems.initiation import Flying, Following, decide, rules_with_margin, target_of, usual
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import SightInSpace
from flockbrush.systems.skeins import skeins

NEARBY = 0.7  # of what a bird sees: two skeins join from there on, so that they do not part again at once
REMEMBERED = 60.0  # s for which a bird looks for the flock that it lost sight of.  By eye
VARIANTS = 8  # of steady flight, so that skeins of as many birds do not move in step


def keep_formations(world):
    """Roles, reference birds and places of all birds that fly in formation; those that do not any more lose theirs."""
    agents, palette = world.agents, world.resource(Palette)
    if not palette.formation.any():
        return
    brush, species = agents[BrushBinding.brush], agents[Species.index]
    flies = palette.formation[brush]
    _forget(agents, ~flies)
    for b, kind in sorted(set(zip(brush[flies].tolist(), species[flies].tolist(), strict=True))):
        rows = np.flatnonzero(flies & (brush == b) & (species == kind))
        blow(agents, rows, world.resource(Clock).dt)
        _keep_all(world, rows, palette.brushes[b].params)


def _forget(agents, rows):
    rows = rows & (agents[FormationPlace.track] != 0.0).any(axis=1)
    for field in (Lost.entity, FormationPlace.reference,
                  FormationPlace.arm, FormationPlace.offset, FormationPlace.track,
                  FormationPlace.climb, FormationPlace.led, FormationPlace.gust, FormationPlace.wind,
                  FormationPlace.felt):  # fmt: skip
        agents[field][rows] = 0
    agents[FormationPlace.place][rows] = -1


def _keep_all(world, rows, p):
    """Every skein of one kind and brush."""
    agents = world.agents
    reference = _rows_of(agents.ids, rows, agents[FormationPlace.reference][rows])
    sees, forward = _perceived(world, rows), agents[Heading.forward][rows, :2]
    place = agents[FormationPlace.place][rows]
    xy, wrap = agents[Position.xyz][rows, :2], world.resource(Landscape).wrap
    nearby = sees & (_apart(xy, wrap) <= NEARBY * agents[Vision.range][rows][:, None])
    label, leads = skeins(xy, forward, reference, place, sees, nearby & (p.meets == "join"), wrap)
    _see_again(agents, rows, sees)
    for skein in range(label.max() + 1):
        mine = np.flatnonzero(label == skein)
        met = np.flatnonzero((label != skein) & (sees[mine].any(axis=0) | sees[:, mine].any(axis=1)))
        variant = int(agents.ids[rows[mine[0]]] - agents.ids[rows[0]]) % VARIANTS
        _keep(world, rows[mine], rows[met], p, sees[np.ix_(mine, mine)], leads[mine], variant)


def _apart(xy, wrap):
    """(n, n) m between birds."""
    return np.sqrt((short_way(xy[:, None] - xy[None], wrap) ** 2).sum(axis=2))


def _keep(world, rows, met, p, sees, leads, variant):
    """One skein; ``met`` are the rows of birds of other skeins in sight, ``leads`` who led one until now."""
    agents, clock = world.agents, world.resource(Clock)
    ids, n = agents.ids, len(rows)
    forward = agents[Heading.forward][rows, :2]
    place, arm = agents[FormationPlace.place][rows].astype(np.int64), agents[FormationPlace.arm][rows].astype(np.int64)
    reference = _rows_of(ids, rows, agents[FormationPlace.reference][rows])
    xy, wrap = agents[Position.xyz][rows, :2], world.resource(Landscape).wrap
    appointed = agents[Leading.appointed][rows] > 0
    leader = _leader(place, appointed if appointed.any() else leads, xy, forward, wrap)
    led = agents[FormationPlace.led][rows]
    if p.turns > 0.0 and led[leader] >= p.turns and n > 2 and not appointed[leader]:
        leader = _change_leader(leader, reference, arm, place)
        led = np.zeros(n)
    place[(place == 0) & (np.arange(n) != leader)] = -1
    place[leader], arm[leader], reference[leader] = 0, 0, -1
    ahead = _unit(forward[leader])
    wing = p.wingspan * agents[Body.length][rows[leader]]
    x, y = (part / wing for part in _in_frame(xy, xy[leader], ahead, wrap))
    heading = np.array([_bearing(f, ahead) for f in forward])
    rules = rules_of(p)
    target = _target(p, n, clock.tick * clock.dt, world.resource(Noise).seed + variant * (n > 1))
    if n > 1:
        rules = rules_with_margin(rules, target)
        birds, now = Flying(x, y, heading), Following(reference, arm, place)
        new = Following(np.full(n, -1), np.zeros(n, np.int64), np.full(n, -1))
        decide(birds, leader, now, target.length, rules, sees, new)
        reference, arm, place = new
    frame = frame_of(wing, agents[Speed.drawn][rows[leader]])
    agents[FormationPlace.climb][rows] = _climb(agents, np.r_[rows, met], leader, ahead, rules, wing, frame, wrap)[:n]
    _remember(agents, rows, leader, p.leader_turn, clock.dt, world.resource(Landscape))
    offset = _offsets(reference, arm, place, target) * wing
    offset[leader] = _after_the_lost(agents, rows, leader, wrap)
    agents[FormationPlace.offset][rows] = offset
    agents[FormationPlace.track][rows] = ahead
    agents[FormationPlace.arm][rows], agents[FormationPlace.place][rows] = arm, place
    follows = reference >= 0
    agents[FormationPlace.reference][rows] = np.where(follows, ids[rows[np.maximum(reference, 0)]], 0)
    agents[ReferenceBird.entity][rows] = agents[FormationPlace.reference][rows]
    second = (place == n - 1) & p.shape.startswith("inverted")  # the other tip
    agents[Role.leader][rows] = (place == 0) | second
    led = np.where(np.arange(n) == leader, led + clock.dt, 0.0)
    agents[FormationPlace.led][rows] = led


def _perceived(world, rows):
    """(n, n) bool: whom each bird of the flock perceives, as its brush's ``[vision]`` has it."""
    lists, n = world.resource(SightInSpace).lists, len(rows)
    index = np.full(len(world.agents), -1)
    index[rows] = np.arange(n)
    observer = index[np.repeat(np.arange(len(index)), np.diff(lists.first))]
    observed = index[lists.near]
    both = (observer >= 0) & (observed >= 0)
    perceived = np.zeros((n, n), np.bool_)
    perceived[observer[both], observed[both]] = True
    return perceived


def _rows_of(ids, rows, entities):
    """Which of the flock's rows these entities are; -1 for none of them."""
    at = np.searchsorted(ids[rows], entities)
    at = np.minimum(at, len(rows) - 1)
    return np.where(ids[rows[at]] == entities, at, -1)


def _leader(place, leads, xy, forward, wrap):
    """The bird that has led a skein so far or is appointed; the front-most of several, or if there is none."""
    some = next((some for some in (leads & (place == 0), leads, place == 0) if some.any()), np.full(len(place), True))
    candidates = np.flatnonzero(some)
    if len(candidates) == 1:
        return int(candidates[0])
    ahead = _unit(np.array([_sum(forward[:, 0]), _sum(forward[:, 1])]))
    away = short_way(xy - xy[0], wrap)
    along = away[:, 0] * ahead[0] + away[:, 1] * ahead[1]
    return int(candidates[np.argmax(along[candidates])])


def _see_again(agents, rows, sees):
    """Who sees the leader that it lost knows where that one is."""
    lost = _rows_of(agents.ids, rows, agents[Lost.entity][rows])
    found = np.flatnonzero((lost >= 0) & sees[np.arange(len(rows)), np.maximum(lost, 0)])
    mine, seen = rows[found], rows[lost[found]]
    _note(agents, mine, seen)
    agents[Lost.ticks][mine] = 0


def _note(agents, mine, seen):
    """Where another flies, and how."""
    agents[Lost.place][mine] = agents[Position.xyz][seen, :2]
    agents[Lost.velocity][mine] = agents[Velocity.xyz][seen, :2]


def _remember(agents, rows, leader, leader_turn, dt, land):
    """Who flies in a skein knows where it goes; in lesser company it remembers the greater."""
    _miss_the_others(agents, rows)
    lost, follows = agents[Lost.entity][rows], np.arange(len(rows)) != leader
    gone = (agents[Lost.ticks][rows] * dt > REMEMBERED) | np.isin(lost, agents.ids[rows]) | ~np.isin(lost, agents.ids)
    agents[Lost.entity][rows[gone]] = 0
    _reckon(agents, rows[~gone], leader_turn * dt, dt, land)
    anew = follows & (gone | (agents[Lost.company][rows] <= len(rows)))
    mine, seen = rows[anew], rows[leader]
    agents[Lost.entity][mine] = agents.ids[seen]
    _note(agents, mine, seen)
    agents[Lost.ticks][mine], agents[Lost.company][mine] = 0, len(rows)


def _reckon(agents, rows, turn, dt, land):
    """Where the leader is that each of these lost, if it flies as leaders do: ``turn`` rad a tick at most to where they
    themselves are bound, at their own speed (that seen last was one of fright); who is bound nowhere takes it to fly
    straight on.
    """
    velocity, place, goal = agents[Lost.velocity], agents[Lost.place], agents[Destination.goal]
    kind, target = agents[Migration.kind], agents[Migration.target][:, :2]
    for i in rows:
        way, bound = _unit(velocity[i]), np.zeros(2)
        if kind[i] == DIRECTION:
            bound = target[i]
        elif kind[i] == POINT or goal[i] >= 0:
            there = target[i] if kind[i] == POINT else np.array(land.goals[goal[i]].xy)
            bound = short_way(there - place[i], land.wrap)
        if bound.any():
            sine, cosine = sincos_(min(max(_bearing(bound, way), -turn), turn))  # clockwise
            way = np.array([cosine * way[0] + sine * way[1], cosine * way[1] - sine * way[0]])
        velocity[i] = agents[Speed.drawn][i] * way
    place[rows] += velocity[rows] * dt
    agents[Lost.ticks][rows] += 1


def _miss_the_others(agents, rows):
    """Who keeps the leader and loses most of the company remembers one of those instead, as it flew then."""
    lost = agents[Lost.entity][rows]
    for k in np.flatnonzero(np.isin(lost, agents.ids[rows]) & (2 * len(rows) <= agents[Lost.company][rows])):
        others = np.setdiff1d(np.flatnonzero(agents[Lost.entity] == lost[k]), rows)
        if len(others):
            mine, seen = rows[[k]], others[0]
            agents[Lost.entity][mine], agents[Lost.ticks][mine] = agents.ids[seen], 0
            _note(agents, mine, seen)


def _after_the_lost(agents, rows, leader, wrap):
    """m east and north to where a leader makes for whose skein has lost the greater part; 0, 0 for any other."""
    lost = agents[Lost.entity][rows]
    misses = np.flatnonzero((lost > 0) & ~np.isin(lost, agents.ids[rows]))
    misses = misses[2 * len(rows) <= agents[Lost.company][rows[misses]]]
    if not len(misses):
        return 0.0, 0.0
    row = rows[misses[np.argmin(agents[Lost.ticks][rows[misses]])]]
    return (
        short_way(agents[Lost.place][row] - agents[Position.xyz][rows[leader], :2], wrap)
        + agents[Lost.velocity][row] * AFTER
    )


def _change_leader(leader, reference, arm, place):
    """The first of the longer arm leads from now on; who has led goes to the end of that arm."""
    longer = max((-1, 1), key=lambda side: int(((arm == side) & (place > 0)).sum()))
    mine = np.flatnonzero((arm == longer) & (place > 0))
    first = mine[place[mine] == 1]
    if not len(first):
        return leader
    new = int(first[0])
    last = int(mine[np.argmax(place[mine])])
    reference[reference == leader] = new
    place[mine] -= 1
    reference[leader] = last if last != new else new
    arm[leader], place[leader] = longer, len(mine)
    reference[new], arm[new], place[new] = -1, 0, 0
    return new


def _in_frame(xy, origin, ahead, wrap):
    """(to the right, ahead) of the leader, m."""
    away = short_way(xy - origin, wrap)
    return (
        np.ascontiguousarray(away[:, 0] * ahead[1] - away[:, 1] * ahead[0]),
        np.ascontiguousarray(away[:, 0] * ahead[0] + away[:, 1] * ahead[1]),
    )


def _climb(agents, rows, leader, ahead, rules: FormingRules, wing, frame, wrap):
    """m/s up, for each of these birds: those of a skein and, after them, others whom they meet."""
    n = len(rows)
    climb = np.zeros(n)
    xyz, forward = agents[Position.xyz][rows], agents[Heading.forward][rows, :2]
    x, y = (part / wing for part in _in_frame(xyz[:, :2], xyz[leader, :2], ahead, wrap))
    heading = np.array([_bearing(f, ahead) for f in forward])
    z = (xyz[:, 2] - xyz[leader, 2]) / wing
    v = agents[Velocity.xyz][rows] - agents[FormationPlace.felt][rows]
    speed = np.sqrt(v[:, 0] ** 2 + v[:, 1] ** 2) * frame / wing
    part_in_height(x, y, np.ascontiguousarray(z), heading, speed, rules, climb)
    return climb * wing / frame + v[leader, 2]


def _offsets(reference, arm, place, target):
    """(to the right, ahead) of the reference bird, wingspans."""
    out = np.zeros((len(reference), 2))
    ox, oy = usual(target)
    for i in np.flatnonzero(reference >= 0):
        side, k = (arm[i] + 1) // 2, place[i]
        known = 0 < k < target.dx.shape[1]
        dx, dy = (target.dx[side, k], target.dy[side, k]) if known else (ox, oy)
        out[i] = arm[i] * dx, -dy
    return out


def _target(p, birds, time, seed):
    """The target of this moment."""
    x, y = places(p, max(birds, 2), seed).at(time)
    return target_of(x, y)


def _bearing(forward, ahead):
    """Angle of a heading, clockwise from the track, rad."""
    return atan2_(forward[0] * ahead[1] - forward[1] * ahead[0], forward[0] * ahead[0] + forward[1] * ahead[1])


def _unit(vector):
    size = np.sqrt(vector[0] * vector[0] + vector[1] * vector[1])
    return vector / size if size > 1e-9 else np.array([1.0, 0.0])


def _sum(values):
    """In order, so that the bits are the same everywhere."""
    total = 0.0
    for value in values.tolist():
        total += value
    return total
