"""SPEED: how fast, apart from where to."""

from __future__ import annotations

import numpy as np
from numba import njit

from components import Body, BrushBinding, Ground, Heading, Speed, Wish
from engine.clock import Clock
from engine.noise import Noise, normal_
from engine.parallel import over_rows
from engine.schedule import Stage, System
from systems.grid import Cells
from systems.palette import Palette
from systems.senses import Near
from systems.terrain import slope_factor_

GATHER = 0.4  # s in which an animal takes up a new effort.  By eye


class Pace(System):
    """The Ornstein-Uhlenbeck speed of each animal (Gong et al. 2025, eq. 6), then density, ground, slope and caps."""

    stage = Stage.SPEED
    reads = (Body, BrushBinding, Ground, Heading, Wish, Near, Palette, Clock, Noise)
    writes = (Speed,)

    def process(self, world):
        agents, palette, clock = world.agents, world.resource(Palette), world.resource(Clock)
        n = len(agents)
        aloft = palette.aloft(agents[BrushBinding.brush])
        free = np.zeros(n, np.bool_) if aloft is None else aloft & ~palette.grounded[agents[BrushBinding.brush]]
        density = np.zeros(n)
        if palette.uses_density:
            over_rows(crowding, n, *_grid(world.resource(Near).cells), agents[Body.length], density)
        over_rows(
            _pace, n, free, agents.ids, agents[Body.length], agents[BrushBinding.brush], density,
            agents[Ground.factor], agents[Ground.cap], agents[Ground.slope], agents[Heading.forward],
            agents[Wish.pace], palette.mean, palette.deviation, palette.reversion,
            palette.density_first, palette.density_table,
            world.resource(Noise).key("speed", clock.tick), clock.dt,
            agents[Speed.drawn], agents[Speed.effort], agents[Speed.target],
        )  # fmt: skip


def _grid(cells: Cells):
    return (
        cells.x, cells.y, cells.slot, cells.start, cells.nx, cells.ny, cells.cell, cells.west, cells.south,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def crowding(lo, hi, x, y, slot, start, nx, ny, cell, west, south, length, density):
    """Others per square body length within two body lengths (seen or not: what presses, slows)."""
    for i in range(lo, hi):
        s = slot[i]
        if s < 0:
            continue
        reach = 2.0 * length[i]
        r0, r1 = max(0, int((y[s] - reach - south) / cell)), min(ny - 1, int((y[s] + reach - south) / cell))
        c0, c1 = max(0, int((x[s] - reach - west) / cell)), min(nx - 1, int((x[s] + reach - west) / cell))
        count = -1
        for r in range(r0, r1 + 1):
            for j in range(start[r * nx + c0], start[r * nx + c1 + 1]):
                dx, dy = x[j] - x[s], y[j] - y[s]
                count += dx * dx + dy * dy < reach * reach
        density[i] = count / (4.0 * np.pi)


@njit(cache=True, nogil=True, error_model="numpy")
def _pace(
    lo, hi, free, ids, length, brush, density, factor, cap, slope, forward, wanted,
    mean, deviation, reversion, table_first, table, key, dt, drawn, effort, target,
):  # fmt: skip
    root = np.sqrt(dt)
    for i in range(lo, hi):
        b = brush[i]
        v = drawn[i]
        v += -reversion[b] * (v - mean[b] * length[i]) * dt + deviation[b] * length[i] * root * normal_(key, ids[i], 0)
        drawn[i] = max(v, 0.0)  # eq. 6, no walking backwards
        share = _look_up(table, table_first[b], table_first[b + 1], density[i])
        rise = slope[i, 0] * forward[i, 0] + slope[i, 1] * forward[i, 1]
        if rise != 0.0:
            share *= slope_factor_(rise)
        effort[i] += (wanted[i] - effort[i]) * min(dt / GATHER, 1.0)
        if free[i]:  # in the air there is neither mud nor slope
            target[i] = min(drawn[i] * effort[i], cap[i])
            continue
        target[i] = min(drawn[i] * share * factor[i] * effort[i], cap[i])


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
