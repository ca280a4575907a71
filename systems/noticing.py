"""SENSE and DECIDE: whom animals notice because of what they are, and how long a fright lasts.

Brushes perceive neighbours (`flockbrush.systems.senses`); this is about those whom the species table names: dangers,
prey, and whoever is followed.  *j* is noticed by *i* when it is nearer than the relation's ``notice`` (for a danger
divided by the boldness of *i*), in the field of view of the eyes, or anywhere around once *i* is alarmed, and no
obstacle, no ground that blocks the view (between two on the ground) and no hill is between the eyes of one and the body
of the other.  Bodies hide nobody here: a head is above the backs of others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import NoticedLists, empty_noticed_lists
from flockbrush.components import Alarm, Body, BrushBinding, Heading, Individual, Position, Species
from flockbrush.engine.clock import Clock
from flockbrush.engine.maths import exp_, inner_kernel, sincos_
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.seam import on_the_map_, short_way_
from flockbrush.engine.solid_queries import blocks_
from flockbrush.systems.fauna import FEAR, FOLLOW, HUNT, SpeciesList, kinds_of
from flockbrush.systems.ground_height import Heights, height_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near
from flockbrush.systems.sightline import crosses
from numba import njit

STEPS = 24  # places between two animals at which a hill is looked for
FADED = 0.02  # of alarm: less is calm


class Watchers(NamedTuple):
    """Who looks and is looked at, (n,) each unless stated."""

    xyz: np.ndarray  # (n, 3) m
    forward: np.ndarray  # (n, 3)
    length: np.ndarray  # m
    radius: np.ndarray  # m
    aloft: np.ndarray  # bool
    kind: np.ndarray  # int32
    boldness: np.ndarray
    alarm: np.ndarray
    cosine: np.ndarray  # of half the field of view
    eyes: np.ndarray  # m above the ground


class ByKind(NamedTuple):
    """Which kinds of animals heed which."""

    by_kind: np.ndarray  # (n,) int32 rows
    kind_first: np.ndarray  # (c + 1,) those of kind k are by_kind[kind_first[k] : kind_first[k + 1]]
    verb: np.ndarray  # (c, c) uint8
    notice: np.ndarray  # (c, c) m; less than 0: in lengths of the longer body


class Hiding(NamedTuple):
    """What hides animals from others."""

    edges: np.ndarray  # (k, 4) m
    solids: Any  # `flockbrush.engine.solids.Solids`
    heights: Heights


@dataclass
class Noticed:
    """The lists; None while no animal of the world could notice another."""

    lists: NoticedLists | None = None


class Notice(System):
    """Dangers, and prey and leaders where brushes ask for them."""

    stage = Stage.SENSE
    reads = (Near, Position, Heading, Body, Species, BrushBinding, Individual, Alarm, SpeciesList, Palette, Landscape)
    writes = (Noticed,)

    def process(self, world):
        agents, palette = world.agents, world.resource(Palette)
        noticed = world.resource(Noticed)
        noticed.lists = None
        species = agents[Species.index]
        if not len(agents):
            return
        relations, table = world.resource(SpeciesList).relations, world.resource(SpeciesList).table
        kind = kinds_of(species, palette.danger[agents[BrushBinding.brush]])
        verb = _asked_for(relations.verb, palette)
        present = np.zeros(len(verb), bool)
        present[kind] = True
        verb = np.where(present[:, None] & present, verb, 0).astype(np.uint8)
        if not verb.any():
            return
        aloft = world.resource(Near).aloft
        noticed.lists = noticed_by(agents, world.resource(Landscape), aloft, kind, verb, relations, table)


def _asked_for(verb, palette):
    """The verbs that somebody's drives act on: danger always, prey and leaders where a brush asks for them."""
    if not palette.hunting:
        verb = np.where(verb == HUNT, 0, verb)
    if not palette.following:
        verb = np.where(verb == FOLLOW, 0, verb)
    return verb


def noticed_by(agents, land, aloft, kind, verb, relations, table):
    """`NoticedLists` of all animals of a world, by their kinds."""
    n, species = len(agents), agents[Species.index]
    aloft = np.zeros(n, np.bool_) if aloft is None else aloft
    cosine = np.array([-1.0 if v >= np.pi else sincos_(v)[1] for v in table.view / 2.0])[species]
    by_kind = np.argsort(kind, kind="stable").astype(np.int32)
    kind_first = np.searchsorted(kind[by_kind], np.arange(len(verb) + 1))
    watchers = Watchers(
        agents[Position.xyz], agents[Heading.forward], agents[Body.length], agents[Body.radius], aloft, kind,
        agents[Individual.boldness], agents[Alarm.level], cosine, table.eyes[species] * agents[Body.length],
    )  # fmt: skip
    kinds = ByKind(by_kind, kind_first, verb, relations.notice)
    hiding = Hiding(land.opaque.ends, land.opaque_solids, land.heights)
    given = watchers, kinds, hiding
    count = np.zeros(n, np.int64)
    nothing = np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros(0)
    over_rows(_notice, n, *given, np.zeros(n + 1, np.int64), *nothing, count)
    first = np.zeros(n + 1, np.int64)
    np.cumsum(count, out=first[1:])
    near, offset, notice = np.empty(first[-1], np.int32), np.empty((first[-1], 3)), np.empty(first[-1])
    if first[-1]:
        over_rows(_notice, n, *given, first, near, offset, notice, count)
    observer = np.repeat(np.arange(n), count)
    pair = kind[observer], kind[near]
    return NoticedLists(first, near, offset, verb[pair], relations.weight[pair], notice)


@njit(cache=True, nogil=True, error_model="numpy")
def _notice(lo, hi, watchers, kinds, hiding, first, near, offset, distance, count):
    """Count those noticed; where ``near`` has room, write them down too."""
    xyz, length, radius, aloft, kind = watchers.xyz, watchers.length, watchers.radius, watchers.aloft, watchers.kind
    forward, cosine, kind_first, verb, notice = (
        watchers.forward, watchers.cosine, kinds.kind_first, kinds.verb, kinds.notice
    )  # fmt: skip
    edges, solids, heights = hiding
    write, hills = len(near) > 0, heights.relief.shape[0] * heights.relief.shape[1] > 1
    for i in range(lo, hi):
        found = 0
        for c in range(len(verb)):
            if verb[kind[i], c] == 0:
                continue
            for t in range(kind_first[c], kind_first[c + 1]):
                j = kinds.by_kind[t]
                x, y, z = xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], xyz[j, 2] - xyz[i, 2]
                x, y = short_way_(x, y, heights.wrap)
                reach = notice[kind[i], c]
                if reach < 0.0:
                    reach = -reach * max(length[i], length[j])
                if verb[kind[i], c] == FEAR:
                    reach /= watchers.boldness[i]
                d2 = x * x + y * y + z * z
                if d2 > reach * reach or j == i:
                    continue
                if watchers.alarm[i] <= 0.0 and cosine[i] > -1.0:
                    ahead = x * forward[i, 0] + y * forward[i, 1] + z * forward[i, 2]
                    if ahead < cosine[i] * np.sqrt(d2):
                        continue
                up = watchers.eyes[i] if not aloft[i] else 0.0
                rise = z - up + (radius[j] if not aloft[j] else 0.0)
                px, py, pz = xyz[i, 0], xyz[i, 1], xyz[i, 2] + up
                if not (aloft[i] or aloft[j]) and crosses_an_edge(edges, px, py, x, y, heights.wrap):
                    continue
                if len(solids.kind) and blocks_(solids, px, py, pz, x, y, rise):
                    continue
                if hills and behind_a_hill(heights, px, py, pz, x, y, rise):
                    continue
                if write:
                    at = first[i] + found
                    near[at], distance[at] = j, reach
                    offset[at, 0], offset[at, 1], offset[at, 2] = x, y, z
                found += 1
        count[i] = found


@inner_kernel
def crosses_an_edge(edges, x, y, ox, oy, wrap):
    """Whether the way from (x, y) by an offset crosses an edge that blocks the view.

    Where it leaves a map that goes on at the opposite border, the edges there count.
    """
    cx, cy = on_the_map_(x + ox, y + oy, wrap)
    cx, cy = cx - ox, cy - oy  # from there it comes in
    for image in range(4 if wrap[0] > 0.0 else 1):
        px, py = cx if image & 1 else x, cy if image & 2 else y
        if (image & 1 and abs(cx - x) < 0.5 * wrap[0]) or (image & 2 and abs(cy - y) < 0.5 * wrap[1]):
            continue
        x0, x1, y0, y1 = min(px, px + ox), max(px, px + ox), min(py, py + oy), max(py, py + oy)
        for e in range(len(edges)):
            ax, ay, bx, by = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
            if min(ax, bx) > x1 or max(ax, bx) < x0 or min(ay, by) > y1 or max(ay, by) < y0:
                continue
            if crosses(px, py, px + ox, py + oy, ax, ay, bx, by):
                return True
    return False


@inner_kernel
def behind_a_hill(heights, x, y, z, ox, oy, oz):
    """Whether the ground rises above the line from (x, y, z) by an offset."""
    for k in range(1, STEPS):
        t = k / STEPS
        if height_of_ground(heights, x + t * ox, y + t * oy) > z + t * oz:
            return True
    return False


class BeAlarmed(System):
    """Fear rises at once and fades with the time constant of the species, until it is less than `FADED`.

    Where the danger was is remembered until then: after full fear 3.9 times the time constant.
    """

    stage, reads, writes = Stage.DECIDE, (Noticed, Position, Species, SpeciesList, Clock), (Alarm,)

    def process(self, world):
        agents, lists = world.agents, world.resource(Noticed).lists
        level = agents[Alarm.level]
        if lists is None and not level.any():
            return
        table, dt = world.resource(SpeciesList).table, world.resource(Clock).dt
        keep = np.array([exp_(-dt / max(t, 1e-3)) for t in table.calm])[agents[Species.index]]
        if lists is None:
            lists = empty_noticed_lists(len(agents))
        over_rows(_be_alarmed, len(agents), lists, agents[Position.xyz], keep, level, agents[Alarm.place])


@njit(cache=True, nogil=True, error_model="numpy")
def _be_alarmed(lo, hi, lists, xyz, keep, level, place):
    first, offset, verb, weight, notice = lists.first, lists.offset, lists.verb, lists.weight, lists.notice
    for i in range(lo, hi):
        worst, at = 0.0, -1
        for k in range(first[i], first[i + 1]):
            if verb[k] == FEAR:
                d = np.sqrt(offset[k, 0] ** 2 + offset[k, 1] ** 2 + offset[k, 2] ** 2)
                fear = fear_(weight[k], d, notice[k])
                if fear > worst:
                    worst, at = fear, k
        level[i] = level[i] * keep[i]
        if worst > 0.0 and worst >= level[i]:
            level[i] = worst
        if at >= 0:
            for c in range(3):
                place[i, c] = xyz[i, c] + offset[at, c]
        if level[i] < FADED:
            level[i] = 0.0
            place[i, 0] = place[i, 1] = place[i, 2] = 0.0


@njit(cache=True, nogil=True, inline="always")
def fear_(weight, distance, notice):
    """0 to ``weight``: full within half the distance at which a danger is noticed, then less, in a straight line."""
    return weight * min(2.0 * (1.0 - distance / notice), 1.0)
