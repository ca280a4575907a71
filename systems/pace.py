"""SPEED: how fast, apart from where to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import TAKES_UP
from flockbrush.behaviours.wander import HALF_PI
from flockbrush.components import (
    Body,
    BrushBinding,
    Ground,
    Heading,
    Individual,
    Position,
    Species,
    Speed,
    Urge,
    Wish,
)
from flockbrush.engine.clock import Clock
from flockbrush.engine.maths import kernel_function, sincos_
from flockbrush.engine.noise import Noise, key_, normal_, uniform_
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.systems.fauna import SpeciesList, by_medium
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near
from flockbrush.systems.terrain import slope_factor_
from numba import njit

COMPANY = 4.0  # body lengths within which neighbours are imitated
CRAWL = 0.02  # of the mean: the slowest walk, because 0 is standing
# over the ground, of what a herd does together: places 30 body lengths apart are half alike, 60 hardly at all
WAVES = np.array([  # rad/BL
    (0.0383, 0.0000), (-0.0620, 0.0568), (0.0011, -0.0128), (0.0331, 0.0432),
    (-0.0304, -0.0054), (0.0551, -0.0351), (-0.0060, 0.0222), (-0.0212, -0.0408),
])  # fmt: skip


class Pace(System):
    """The Ornstein-Uhlenbeck speed of each animal (Gong et al. 2025, eq. 6), then density, ground, slope and caps."""

    stage = Stage.SPEED
    reads = (
        Position, Body, BrushBinding, Ground, Heading, Wish, Near, Palette, Clock, Noise, Individual, Species,
        SpeciesList, Landscape,
    )  # fmt: skip
    writes = (Speed, Urge)

    def process(self, world):
        agents, palette, clock = world.agents, world.resource(Palette), world.resource(Clock)
        table, n = world.resource(SpeciesList).table, len(agents)
        aloft = palette.aloft(agents[BrushBinding.brush])
        free = np.zeros(n, np.bool_) if aloft is None else aloft & ~palette.grounded[agents[BrushBinding.brush]]
        cells, density = world.resource(Near).cells, np.zeros(n)
        if palette.uses_density:
            over_rows(crowding, n, cells, agents[Body.length], density)
        was = agents[Speed.drawn].copy() if palette.pauses else None
        herd, waves = herds_of(world)
        walkers = Walkers(
            free, agents.ids, agents[Body.length], agents[BrushBinding.brush], herd, density,
            agents[Ground.factor], agents[Ground.cap], agents[Ground.slope], agents[Position.xyz],
            agents[Heading.forward], agents[Wish.pace], agents[Individual.pace],
            *by_medium(table, agents[Species.index], aloft, table.speed, table.acceleration),
            agents[Urge.share], agents[Urge.speed],
        )  # fmt: skip
        rules = PaceRules(*(getattr(palette, name) for name in PaceRules._fields))
        state = PaceState(*(agents[field] for field in (Urge.driven, Speed.drawn, Speed.effort, Speed.target)))
        chance = speed_chance(world.resource(Noise), clock.tick, clock.dt, waves)
        over_rows(pace_kernel, n, walkers, rules, chance, clock.dt, state)
        if was is None:
            return
        walking = np.full(n, -1.0)
        over_rows(walking_share, n, cells, agents[Body.length], was, walking)
        key = world.resource(Noise).key("pause", clock.tick)
        over_rows(pause, n, walkers, rules, was, walking, key, clock.dt, state)


class Walkers(NamedTuple):
    """What the speed of each animal depends on, (n,) each unless stated."""

    free: np.ndarray  # bool, in the air
    ids: np.ndarray
    length: np.ndarray  # m
    brush: np.ndarray
    herd: np.ndarray  # int32, row of `SpeedChance.waves`
    density: np.ndarray  # others per square body length
    factor: np.ndarray  # of the ground
    cap: np.ndarray  # m/s
    slope: np.ndarray  # (n, 2)
    place: np.ndarray  # (n, 3) m
    forward: np.ndarray  # (n, 3)
    wanted: np.ndarray  # effort that the model wishes
    own: np.ndarray  # factor of the individual
    top: np.ndarray  # m/s
    most: np.ndarray  # m/s²
    share: np.ndarray  # of the drives
    wished: np.ndarray  # m/s that the drives wish


class PaceRules(NamedTuple):
    """The columns of the `Palette` that say how fast, by brush."""

    mean: np.ndarray
    deviation: np.ndarray
    reversion: np.ndarray
    individual: np.ndarray
    common: np.ndarray
    common_time: np.ndarray
    density_first: np.ndarray
    density_table: np.ndarray
    stops: np.ndarray
    starts: np.ndarray
    imitation: np.ndarray


class PaceState(NamedTuple):
    """What is written, (n,) each."""

    driven: np.ndarray
    drawn: np.ndarray  # m/s
    effort: np.ndarray
    target: np.ndarray  # m/s


class SpeedChance(NamedTuple):
    """What the speeds of a tick are drawn with."""

    own: np.uint64  # key of each animal's own noise in this tick
    life: np.uint64  # key of how animals differ, the same in all ticks
    common: np.uint64  # stream of what herds do together
    waves: np.ndarray  # (h, 8, 2) of that, by `Walkers.herd` (`waves_of`)
    time: float  # s since the start of the run


def speed_chance(noise: Noise, tick: int, dt: float, waves: np.ndarray = WAVES[None]) -> SpeedChance:
    """That of one tick of ``dt`` s; the waves are those of bodies of 1 m unless others are given."""
    keys = noise.key("speed", tick), noise.key("usual speed", 0), noise.stream("common speed")
    return SpeedChance(*keys, waves, tick * dt)


def herds_of(world):
    """((n,) int32, (h, 8, 2)): the row of each animal in the waves of what herds do together, and these.

    All of a species have the same waves, whatever their own size and brush; of one without a file, all of a home brush.
    """
    agents, palette, fauna = world.agents, world.resource(Palette), world.resource(SpeciesList)
    if not palette.common.any():
        return np.zeros(len(agents), np.int32), np.zeros((0, *WAVES.shape))
    bodies = [None if asset is None else asset.body for asset in fauna.assets] + [b.body for b in palette.brushes]
    species, home = agents[Species.index], agents[BrushBinding.home]
    herd = np.where(fauna.table.known[species], species, len(fauna.assets) + home).astype(np.int32)
    lengths = [1.0 if body is None else body.length for body in bodies]
    return herd, waves_of(lengths, world.resource(Landscape).wrap)


def waves_of(lengths, wrap=None):
    """(h, 8, 2) rad/m, the waves for bodies of these lengths; a whole number of each on a map that goes on."""
    waves = WAVES / np.array(lengths)[:, None, None]
    if wrap is None:
        return waves
    one = 2.0 * np.pi / np.array(wrap)
    return np.round(waves / one) * one


@njit(cache=True, nogil=True, error_model="numpy")
def crowding(lo, hi, cells, length, density):
    """Others per square body length within two body lengths (seen or not: what presses, slows)."""
    x, y, slot, start, nx, ny = cells.x, cells.y, cells.slot, cells.start, cells.nx, cells.ny
    cell, west, south = cells.cell, cells.west, cells.south
    for i in range(lo, hi):
        s = slot[i]
        if s < 0:
            continue
        reach = 2.0 * length[i]
        r0, r1 = max(0, int((y[s] - reach - south[s]) / cell)), min(ny - 1, int((y[s] + reach - south[s]) / cell))
        c0, c1 = max(0, int((x[s] - reach - west[s]) / cell)), min(nx - 1, int((x[s] + reach - west[s]) / cell))
        count = -1
        for r in range(r0, r1 + 1):
            for j in range(start[r * nx + c0], start[r * nx + c1 + 1]):
                dx, dy = x[j] - x[s], y[j] - y[s]
                count += dx * dx + dy * dy < reach * reach
        density[i] = count / (4.0 * np.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def pace_kernel(lo, hi, walkers, rules, chance, dt, state):
    free, ids, length, brush, herd, density, factor, cap, slope, place, forward, wanted, own = walkers[:13]
    top, most, share, wished = walkers[13:]
    mean, deviation, reversion, individual, common, common_time, first, table, _, _, _ = rules
    driven, drawn, effort, target = state
    root = np.sqrt(dt)
    for i in range(lo, hi):
        b = brush[i]
        v = drawn[i]
        usual = own[i] * mean[b]
        if individual[b] > 0.0:
            usual *= max(1.0 + individual[b] * normal_(chance.life, ids[i], np.int64(0)), 0.0)
        if common[b] > 0.0:
            x, y, time = place[i, 0], place[i, 1], chance.time / common_time[b]
            usual = max(usual + common[b] * in_common_(x, y, time, chance.common, chance.waves, herd[i]), 0.0)
        back = -reversion[b] * (v - usual * length[i]) * dt
        v += back + deviation[b] * length[i] * root * normal_(chance.own, ids[i], np.int64(0))
        drawn[i] = max(v, 0.0)  # eq. 6, no walking backwards
        ease = _look_up(table, first[b], first[b + 1], density[i])
        rise = slope[i, 0] * forward[i, 0] + slope[i, 1] * forward[i, 1]
        if rise != 0.0:
            ease *= slope_factor_(rise)
        mud = factor[i]
        if free[i]:  # in the air there is neither mud nor slope
            ease = mud = 1.0
        if driven[i]:  # up to what drives wish, and back again, as fast as the body can
            was, goes = target[i], drawn[i] * ease * mud
            if share[i] > 0.0:
                goes = wished[i] * ease * mud
            step = most[i] * dt
            target[i] = min(was + min(max(goes - was, -step), step), top[i], cap[i])
            effort[i] = min(target[i] / max(drawn[i] * ease * mud, 1e-6), 1.0)
            driven[i] = share[i] > 0.0 or abs(target[i] - goes) > step
            continue
        effort[i] += (wanted[i] - effort[i]) * min(dt / TAKES_UP, 1.0)
        target[i] = min(drawn[i] * ease * mud * effort[i], top[i], cap[i])


@kernel_function
def in_common_(x, y, time, stream, waves, herd):
    """A nearly normal number of variance 1, that is alike at near places and times.

    ``time`` is in units of how long it lasts.  It is the same for all brushes, so that it goes through mixed paint.
    In time it is a sum of half waves, as random turns are (`flockbrush.behaviours.wander`), over the ground a sum of
    waves whose phases are drawn anew for each of those.
    """
    begun = np.floor(time)
    falling, rising = sincos_(HALF_PI * (1.0 - (time - begun)))
    total = 0.0
    for j in range(2):
        key, weight = key_(stream, np.int64(begun) + j), falling if j == 0 else rising
        for k in range(len(WAVES)):
            phase = 2.0 * np.pi * uniform_(key, np.int64(k), np.int64(0))
            total += weight * sincos_(waves[herd, k, 0] * x + waves[herd, k, 1] * y + phase)[0]
    return total * np.sqrt(2.0 / len(WAVES))


@njit(cache=True, nogil=True, error_model="numpy")
def walking_share(lo, hi, cells, length, speed, walking):
    """Share of the others within four body lengths that walk; -1 if there are none."""
    x, y, slot, start, nx, ny = cells.x, cells.y, cells.slot, cells.start, cells.nx, cells.ny
    cell, west, south, row = cells.cell, cells.west, cells.south, cells.row
    for i in range(lo, hi):
        s = slot[i]
        if s < 0:
            continue
        reach = COMPANY * length[i]
        r0, r1 = max(0, int((y[s] - reach - south[s]) / cell)), min(ny - 1, int((y[s] + reach - south[s]) / cell))
        c0, c1 = max(0, int((x[s] - reach - west[s]) / cell)), min(nx - 1, int((x[s] + reach - west[s]) / cell))
        count, walk = 0, 0
        for r in range(r0, r1 + 1):
            for j in range(start[r * nx + c0], start[r * nx + c1 + 1]):
                dx, dy = x[j] - x[s], y[j] - y[s]
                if row[j] != i and dx * dx + dy * dy < reach * reach:
                    count += 1
                    walk += speed[row[j]] > 0.0
        if count > 0:
            walking[i] = walk / count


@njit(cache=True, nogil=True, error_model="numpy")
def pause(lo, hi, walkers, rules, was, walking, key, dt, state):
    """Stop, stand, and begin to walk again: by chance, and as neighbours do.  Whose drawn speed is 0 stands."""
    ids, length, mean, driven, drawn = walkers.ids, walkers.length, rules.mean, state.driven, state.drawn
    stops, starts, imitation = rules.stops, rules.starts, rules.imitation
    for i in range(lo, hi):
        b = walkers.brush[i]
        if stops[b] <= 0.0:
            continue
        usual = mean[b] * length[i]
        if driven[i]:  # drives are stronger
            drawn[i] = max(drawn[i], CRAWL * usual)
            continue
        alike = walking[i] if was[i] <= 0.0 else 1.0 - walking[i]
        rate = (starts[b] if was[i] <= 0.0 else stops[b]) * (1.0 + imitation[b] * (alike if walking[i] >= 0.0 else 0.0))
        changes = uniform_(key, ids[i], 0) < rate * dt / (1.0 + 0.5 * rate * dt)
        if changes and was[i] <= 0.0:
            spread = rules.deviation[b] / np.sqrt(2.0 * rules.reversion[b]) * length[i]
            drawn[i] = max(usual + spread * normal_(key, ids[i], np.int64(1)), CRAWL * usual)
        elif changes or was[i] <= 0.0:
            drawn[i] = state.target[i] = 0.0
        else:
            drawn[i] = max(drawn[i], CRAWL * usual)


@njit(inline="always")
def _look_up(table, first, last, at):
    """Linear between rows of (density, factor), constant outside."""
    if at <= table[first, 0]:
        return table[first, 1]
    for k in range(first + 1, last):
        if at < table[k, 0]:
            t = (at - table[k - 1, 0]) / (table[k, 0] - table[k - 1, 0])
            return table[k - 1, 1] + t * (table[k, 1] - table[k - 1, 1])
    return table[last - 1, 1]
