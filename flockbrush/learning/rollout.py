"""A herd on a plane, run by the kernels of a level but without a world: what learning tries parameters with.

One tick is what an animal goes through on an endless plane (`flockbrush.levels.build.systems`): neighbours, sight,
roles, the model, pace, move, by the very functions the systems call, so a herd here and the same herd in a level are
the same bits.  What is left out is what a plain has not got: ground, slopes, goals, births, several brushes; and
flight, for which `flockbrush.learning.world_rollout` has a world.

Lengths are in body lengths (BL), times in seconds; x points right and y up.

A clip that sees only a part of a herd has `Gates`: whoever leaves the picture is taken out, and others come in where
animals came in, so that their number is the clip's [1]_.  Leaders follow the clip's motion where a `Guide` is given.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Sections 5.1, 6.1 and 7.1.3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from flockbrush.behaviours.behaviour import ByRow, Parameters, frozen, read_only
from flockbrush.behaviours.brush import BodySpec, VisionSpec
from flockbrush.behaviours.models.herd import HerdState, Land, Params, forces_of, herd_kernel
from flockbrush.behaviours.wander import random_turns, wander_kernel
from flockbrush.engine.noise import Noise
from flockbrush.film.observations import ByFrame, Fields
from flockbrush.learning.perceive import BODILESS, NO_OWNER, cosine_of, half_and_radius, leader_rule, walls_in_sight
from flockbrush.learning.plane_scene import wishes_on_plane
from flockbrush.learning.world_rollout import between, model_of, needs_world, world_looks
from flockbrush.systems.contact import move
from flockbrush.systems.decide import Members, RoleState, roles_kernel
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.ground_edges import outline_edges
from flockbrush.systems.pace import (
    PaceRules,
    PaceState,
    Walkers,
    crowding,
    pace_kernel,
    pause,
    speed_chance,
    walking_share,
)
from flockbrush.systems.perception import filtered_of_one_kind
from flockbrush.systems.visibility import edges_by_cell, no_edges, visible_neighbours

DT = 1 / 32  # s, the tick of a level
FORCES = "avoidance", "cohesion", "alignment", "obstacle"
KINDS = "weight", "radial", "angular"
NAMES = tuple(f"{force}_{kind}" for force in FORCES for kind in KINDS)  # the order of theta
STANDS = 0.3  # of the mean speed, below which an animal of a clip that shows pauses stands
LEAST, MOST = 1e-3, 1.0  # theta is kept within
BODY, VISION = BodySpec(), VisionSpec()


def params_of(theta, extras: Mapping = {}) -> Params:
    """The parameters of the herd model.

    Parameters
    ----------
    theta : array_like (12,)
        Weight, radial and angular range of avoidance, cohesion, alignment and obstacle avoidance, 0 to 1; clamped.
    extras : mapping
        Any other parameters of `flockbrush.behaviours.models.herd.Params`.
    """
    theta = np.clip(np.asarray(theta, float), LEAST, MOST)
    return Params(**dict(zip(NAMES, theta.tolist(), strict=True)) | dict(extras))


def theta_of(params) -> np.ndarray:
    """The twelve numbers of a brush's parameters, (12,)."""
    return np.array([getattr(params, name) for name in NAMES])


@dataclass
class HerdStart:
    """How a herd begins."""

    xy: np.ndarray  # (n, 2) BL
    forward: np.ndarray  # (n, 2) unit headings
    speed: np.ndarray | None = None  # (n,) BL/s, the speed process; None: drawn from the brush's own spread

    def __len__(self):
        return len(self.xy)


@dataclass
class Run(ByFrame):
    """What a herd did, frame by frame; animals may come and go."""

    times: np.ndarray  # (T,) s since the start
    first: np.ndarray  # (T + 1,)
    ids: np.ndarray  # (m,)
    xy: np.ndarray  # (m, 2) BL
    forward: np.ndarray  # (m, 2) unit headings
    velocity: np.ndarray  # (m, 2) BL/s, what they really did

    @property
    def speed(self):
        """(m,) BL/s."""
        return np.hypot(*self.velocity.T)

    def start(self, t=0) -> HerdStart:
        """A herd as it was in one frame."""
        rows = self.of(t)
        return HerdStart(self.xy[rows].copy(), self.forward[rows].copy(), self.speed[rows].copy())


@dataclass
class ClipGuide:
    """Where leaders are led: the motion of a clip, by cell and time."""

    fields: Fields
    direction: np.ndarray  # (T, ny, nx, 2) unit vectors; zero where nothing is known

    @classmethod
    def of(cls, fields, reach=4.0):
        """From the velocity of `Fields`; empty cells take the direction of the nearest animals within ``reach`` BL."""
        size = np.hypot(fields.velocity[..., 0], fields.velocity[..., 1])
        direction = fields.velocity / np.where(size > 1e-9, size, np.inf)[..., None]
        return cls(fields, _spread(direction, reach / fields.cell))

    def at(self, time, xy):
        """(n, 2) direction at each place; zero without leaders."""
        row, column, inside = self.fields.cells_of(xy)
        return np.where(inside[:, None], self.direction[_frame(self.fields, time), row, column], 0.0)


def _frame(fields, time):
    """The frame that is shown after so many seconds, or the last."""
    return min(int(time * fields.fps + 1e-9), len(fields) - 1)


def _spread(direction, reach):
    """Fill each cell without a direction from the nearest that has one, at most ``reach`` cells away."""
    out = np.nan_to_num(direction)
    for frame in out:
        nobody = ~frame.any(-1)
        if nobody.all():
            continue
        far, nearest = ndimage.distance_transform_edt(nobody, return_indices=True)
        close = nobody & (far <= reach)
        frame[close] = frame[tuple(nearest[:, close])]
    return out


@dataclass
class Gates:
    """The borders of a picture that sees part of a herd."""

    fields: Fields
    entry: list[np.ndarray]  # by frame: (k, 4) cell ix, iy and heading of newcomers

    @classmethod
    def of(cls, fields):
        """From `Fields`; None where the picture holds the whole herd all the time."""
        if not fields.shows_part:
            return None
        speed = np.hypot(fields.velocity[..., 0], fields.velocity[..., 1])
        density, entry = np.nan_to_num(fields.density), []
        for t, rim in enumerate(fields.rims):
            entry.append(_inward(fields, t, rim & (density[t] > 0) & (np.nan_to_num(speed[t]) > 0)))
        return cls(fields, entry)

    def inside(self, time, xy):
        """(n,) bool, places in the picture."""
        row, column, inside = self.fields.cells_of(xy)
        return inside & self.fields.seen[_frame(self.fields, time), row, column]

    def newcomers(self, time, present, chance):
        """Where as many come in as are missing: xy and forward (k, 2); ``chance(k, 3)`` gives numbers in [0, 1)."""
        fields, t = self.fields, _frame(self.fields, time)
        missing = round(float(fields.count[t])) - present
        if missing < 1 or not len(self.entry[t]):
            return np.zeros((0, 2)), np.zeros((0, 2))
        u = chance(missing, 3)
        gate = self.entry[t][(u[:, 0] * len(self.entry[t])).astype(int)]
        return fields.origin + (gate[:, :2] + u[:, 1:]) * fields.cell, gate[:, 2:]


def _inward(fields, t, busy):
    """(k, 4) cells of the rim whose animals walk into the picture: ix, iy, heading."""
    iy, ix = np.nonzero(busy)
    heading = fields.velocity[t, iy, ix]
    heading = heading / np.maximum(np.hypot(*heading.T), 1e-12)[:, None]
    middle = np.argwhere(fields.seen[t]).mean(0)[::-1] if fields.seen[t].any() else np.zeros(2)
    ahead = np.round(np.column_stack([ix, iy]) + 1.5 * heading).astype(int)
    ny, nx = busy.shape
    ok = (ahead[:, 0] >= 0) & (ahead[:, 1] >= 0) & (ahead[:, 0] < nx) & (ahead[:, 1] < ny)
    ok[ok] = fields.seen[t, ahead[ok, 1], ahead[ok, 0]]
    ok &= (heading * (middle - np.column_stack([ix, iy]))).sum(1) > 0
    return np.column_stack([ix, iy, heading])[ok]


@dataclass
class Walls:
    """Obstacles of a clip, as edges: solid and blocking the view."""

    ends: np.ndarray  # (k, 4) x0, y0, x1, y1 in BL; edges of one obstacle follow one another
    owner: np.ndarray  # (k,) int32, the obstacle of each edge

    @classmethod
    def of(cls, fields):
        """From the obstacles of `Fields`: each connected patch is one; None where there is none."""
        if fields.outline is not None:
            ends, owner = fields.outline[:, :4].copy(), fields.outline[:, 4].astype(np.int32)
            return cls(ends, owner) if len(ends) else None
        if not fields.obstacle.any():
            return None
        patches, many = ndimage.label(fields.obstacle)
        edges = [outline_edges(patches == k + 1) * fields.cell for k in range(many)]
        owner = np.repeat(np.arange(many), [len(e) for e in edges])
        ends = np.concatenate(edges) + np.tile(np.asarray(fields.origin, float), 2)
        return cls(ends, owner.astype(np.int32))

    def grown(self, by: float, middle) -> Walls:
        """The same, so many times as large about a point (2,) BL."""
        about = np.tile(middle, 2)
        return Walls(about + (self.ends - about) * by, self.owner)

    def outside(self, xy, room=0.0) -> np.ndarray:
        """(n, 2) places, of which those in an obstacle are at its nearest edge, so much room before it."""
        xy = np.array(xy, float).reshape(-1, 2)
        for number in np.unique(self.owner):
            (ax, ay), (bx, by) = self.ends[self.owner == number].reshape(-1, 2, 2).transpose(1, 2, 0)
            x, y = xy[:, :1], xy[:, 1:]
            with np.errstate(divide="ignore", invalid="ignore"):
                crossed = ((ay > y) != (by > y)) & (x < ax + (bx - ax) * (y - ay) / (by - ay))
            inside = np.flatnonzero(crossed.sum(1) % 2)
            along = (x - ax) * (bx - ax) + (y - ay) * (by - ay)
            share = np.clip(along / np.maximum((bx - ax) ** 2 + (by - ay) ** 2, 1e-24), 0.0, 1.0)
            near = np.stack([ax + share * (bx - ax), ay + share * (by - ay)], -1)
            away = near - xy[:, None]
            for k in inside:
                e = int(np.hypot(*away[k].T).argmin())
                far = np.hypot(*away[k, e])
                xy[k] = near[k, e] + away[k, e] * (room / far if far > 1e-9 else 0.0)
        return xy


class Surroundings(NamedTuple):
    """What is around the animals of a clip: obstacles, what leaders follow, and the borders of its picture."""

    walls: Walls | None = None
    guide: ClipGuide | None = None
    gates: Gates | None = None  # where a picture that sees a part of the herd ends

    @classmethod
    def of(cls, fields):
        """From `Fields`; leaders walk the clip's way into a picture that sees a part of the herd."""
        gates = Gates.of(fields)
        return cls(Walls.of(fields), None if gates is None else ClipGuide.of(fields), gates)


OPEN = Surroundings()


class PlaneHerd:
    """Animals of one kind on a plane: columns and a tick.

    Parameters
    ----------
    params : Params
        Of a model on the ground (`params_of` gives the herd's).
    speed : SpeedSpec
    body, vision : BodySpec, VisionSpec
        The body's radius counts as a share of its length.
    around : Surroundings
        Its gates are for `rollout`.
    """

    dt = DT

    def __init__(self, start, params, speed, body=BODY, vision=VISION, *, seed=0, around=OPEN):
        self.params, self.spec, self.noise = params, speed, Noise(seed)
        self.axis, self.radius = half_and_radius(body)
        self.range, self.vision = float(vision.range), vision
        self.occlusion = vision.occlusion and vision.sight not in BODILESS
        self.model = None if type(params) is Params else model_of(params)  # the herd has kernels of its own
        self.cosine = cosine_of(vision)
        self.guide, self.tick_number, self.next_id = around.guide, 0, 1
        self._walls(around.walls)
        self._tables()
        self.join(start)

    def _walls(self, walls):
        ends = np.zeros((0, 4)) if walls is None else walls.ends
        self.owner = NO_OWNER if walls is None else walls.owner
        self.solid = no_edges() if walls is None else edges_by_cell(ends, self.range)
        quick = self.spec.mean + 6 * self.spec.deviation
        touch = 2.0 * (self.axis + 2 * self.radius + 4.0 * self.dt * quick)
        self.near_walls = no_edges() if walls is None else edges_by_cell(ends, touch)

    def _tables(self):
        p, spec = self.params, self.spec
        self.forces = forces_of(p) if self.model is None else None
        self.table = np.array(spec.by_density or [(0.0, 1.0)], float)
        self.roles = leader_rule(p)
        density = {"density_first": np.array([0, len(self.table)]), "density_table": self.table}
        of_spec = {k: np.array([getattr(spec, k)]) for k in PaceRules._fields if k not in density}
        self.pace_rules = PaceRules(**density, **of_spec)

    def _constants(self):
        n = len(self.ids)
        self.size, self.thick = np.full(n, 2 * (self.axis + self.radius)), np.full(n, self.radius)
        self.length, self.none, self.zero = np.ones(n), np.zeros(n, np.int32), np.zeros((n, 2))
        most = getattr(self.params, "max_turn", np.inf)
        self.max_turn, self.views = np.full(n, most), np.full(n, self.range)
        self.cosines, self.cap = np.full(n, self.cosine), np.full(n, np.inf)
        # all alike, of a body that can do anything, and driven by nothing
        undriven, on_foot = (self.length, self.cap, self.cap, np.zeros(n), np.zeros(n)), np.zeros(n, np.bool_)
        self.walkers = Walkers(
            on_foot, self.ids, self.length, self.none, self.none, self.cap, self.length, self.cap, self.zero, self.xyz,
            self.forward, self.length, *undriven,
        )  # fmt: skip
        self.pace = PaceState(np.zeros(n, np.uint8), self.drawn, self.effort, self.target)
        names = "forward", "length", "none", "leader", "known", "zero", "ids"
        self.shown = SimpleNamespace(**{name: read_only(getattr(self, name)) for name in names})

    def __len__(self):
        return len(self.ids)

    @property
    def time(self):
        """Seconds since the start."""
        return self.tick_number * self.dt

    def join(self, start):
        """Animals more: they get the next ids."""
        n = len(start)
        ids = np.arange(self.next_id, self.next_id + n)
        self.next_id += n
        drawn = start.speed
        if drawn is None:
            chance = self.noise.normal("birth speed", self.tick_number, np.asarray(ids) - 1)[:, 0]
            drawn = np.maximum(self.spec.mean + self.spec.spread * chance, 0.0)
        elif self.spec.stops > 0.0:  # animals that hardly move stand
            drawn = np.where(np.asarray(drawn) < STANDS * self.spec.mean, 0.0, drawn)
        flat = np.zeros((n, 1))
        news = {
            "ids": np.asarray(ids, np.int64), "xyz": np.hstack([start.xy, flat]),
            "forward": np.hstack([start.forward, flat]), "velocity": start.forward * np.asarray(drawn)[:, None],
            "drawn": np.asarray(drawn, float), "effort": np.ones(n), "target": np.asarray(drawn, float),
            "leader": np.zeros(n, np.uint8), "memory": np.zeros((n, 2)), "known": np.zeros(n, np.uint8),
        }  # fmt: skip
        for name, new in news.items():
            setattr(self, name, np.concatenate([getattr(self, name, new[:0]), new]))
        self._constants()

    def keep(self, rows):
        """Remove all other animals."""
        for name in ("ids", "xyz", "forward", "velocity", "drawn", "effort", "target", "leader", "memory", "known"):
            setattr(self, name, getattr(self, name)[rows])
        self._constants()

    def tick(self):
        """One tick, in the order of a level's schedule."""
        n, params = len(self.ids), self.params
        if not n:
            self.tick_number += 1
            return
        cells = sort_into_cells(self.xyz, self.forward, self.size, self.thick, self.range)
        lists = visible_neighbours(cells, self.views, self.cosines, self.solid, self.occlusion)
        lists = filtered_of_one_kind(lists, self.vision.sight, self.vision.neighbours)
        walls = walls_in_sight(self.xyz, self.views, self.solid, self.owner)
        members = Members(self.ids, self.xyz, self.length, self.none, self.none)
        roles_kernel(0, n, self.forward, *lists, members, self.roles, RoleState(self.leader, self.memory, self.known))
        if self.model is None:
            wish, pace = self._wishes(cells.row, lists, *walls, params), self.length
        else:
            wish, pace = wishes_on_plane(self, cells.row, lists, walls)
        self._hurry(cells, self.walkers._replace(wanted=pace))
        step, heading = move(cells, self.forward, wish, self.target, self.max_turn, self.near_walls, self.dt, np.inf)
        self.velocity = step / self.dt
        self.xyz[:, :2] += step
        self.forward[:, :2] = heading
        self.tick_number += 1

    def _wishes(self, rows, lists, walls_first, walls_offset, params):
        n = len(rows)
        shown = self.shown
        guidance = shown.zero if self.guide is None else read_only(self.guide.at(self.time, self.xyz[:, :2]))
        direction, wish = np.zeros((n, 3)), np.empty((n, 3))
        memory = read_only(self.memory - self.xyz[:, :2])
        herd = HerdState(shown.forward, shown.length, shown.none, shown.leader, memory, shown.known)
        land = Land(read_only(walls_first), read_only(walls_offset), guidance, shown.zero)
        herd_kernel(0, n, rows, self.dt, herd, frozen(ByRow(*lists)), land, self.forces, direction)
        if params.wander > 0.0:
            turns = random_turns(params.wander, params.wander_time, self.dt, self.tick_number, self.noise.key)
            wander_kernel(0, n, rows, shown.ids, *turns, direction)
        wish[rows] = direction
        return wish

    def _hurry(self, cells, walkers):
        n, key = len(self.ids), self.noise.key
        was = self.drawn.copy() if self.spec.stops > 0.0 else self.drawn
        if self.spec.by_density:
            walkers = walkers._replace(density=np.zeros(n))
            crowding(0, n, cells, self.length, walkers.density)
        chance = speed_chance(self.noise, self.tick_number, self.dt)
        pace_kernel(0, n, walkers, self.pace_rules, chance, self.dt, self.pace)
        if self.spec.stops > 0.0:
            walking = np.full(n, -1.0)
            walking_share(0, n, cells, self.length, was, walking)
            pause(0, n, walkers, self.pace_rules, was, walking, key("pause", self.tick_number), self.dt, self.pace)


def rollout(start, params, speed, body=BODY, vision=VISION, *, seconds, fps=25.0, seed=0, around=OPEN) -> Run:
    """Run a herd and look at it frame by frame.

    Parameters
    ----------
    params : Params or (12,) array_like
        Of any model; twelve numbers are the herd's.  Those that fly have nothing around them (ValueError).
    speed, body, vision : SpeedSpec, BodySpec, VisionSpec
    seconds, fps : float
        Frames are at 0, 1/fps ... up to ``seconds``; between two ticks positions are interpolated.
    seed : int
        Of the noise.
    around : Surroundings
    """
    if not isinstance(params, Parameters):
        params = params_of(params)
    if needs_world(params):
        return _run_of(world_looks(start, params, speed, body, vision, seconds, fps, seed, around), fps)
    herd = PlaneHerd(start, params, speed, body, vision, seed=seed, around=around)
    frames = int(seconds * fps + 1e-6) + 1
    looks = [_look(herd)]
    for k in range(1, frames):
        after, before = k / fps / DT, None
        while herd.tick_number < after - 1e-9:
            before = _look(herd)
            herd.tick()
        share = 1.0 - (herd.tick_number - after)
        looks.append(_look(herd) if before is None or share > 1 - 1e-9 else between(before, _look(herd), share))
        if around.gates is not None:
            pass_gates(herd, around.gates, k / fps)
    return _run_of(looks, fps)


def _run_of(looks, fps) -> Run:
    sizes = [len(look[0]) for look in looks]
    return Run(
        np.arange(len(looks)) / fps, np.cumsum([0, *sizes]), *(np.concatenate(c) for c in zip(*looks, strict=True))
    )


def _look(herd):
    return herd.ids, herd.xyz[:, :2].copy(), herd.forward[:, :2].copy(), herd.velocity.copy()


def pass_gates(herd, gates, time):
    """Remove animals that left the picture; add as many as the clip has more."""
    inside = gates.inside(time, herd.xyz[:, :2])
    if not inside.all():
        herd.keep(inside)

    def chance(k, width):
        return herd.noise.uniform("gate", herd.tick_number, np.arange(k), width)

    xy, forward = gates.newcomers(time, len(herd), chance)
    free = _free(xy, herd.xyz[:, :2], 2 * (herd.axis + herd.radius))
    if free.any():
        herd.join(HerdStart(xy[free], forward[free]))


def _free(xy, others, room):
    """(k,) bool, places on which an animal touches no other, filled in order."""
    taken, free = list(others), np.zeros(len(xy), bool)
    for k, place in enumerate(xy):
        if not len(taken) or np.min(np.hypot(*(np.array(taken) - place).T)) > room:
            free[k] = True
            taken.append(place)
    return free
