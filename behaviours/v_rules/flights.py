"""Flocks by the thousand: the rules run for many flocks at once, without a world.

Each flock has a seed of its own, and its chance is hashed from seed, step and bird (`flockbrush.engine.noise`), so a
flock flies
the same way alone, in any batch and on any number of threads; and in a world of the same seed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.v_rules.rules import (
    VRuleSettings,
    dodge,
    kernel,
    law_of,
    sort_by,
    turned,
    wish,
    would_collide,
)
from flockbrush.engine.arrays import write_
from flockbrush.engine.maths import inner_kernel
from flockbrush.engine.noise import Noise, key_, normal_, uniform_
from flockbrush.engine.parallel import over_rows

SIDE = 768 / 50  # wingspans: the unit square of the paper
STREAM = "v_rules"


class Flights(NamedTuple):
    """What became of many flocks; lengths in wingspans, positions in the frame that flies with the flock."""

    xyz: np.ndarray  # (flocks, birds, 3) at the end: to the right, along the way, up
    steps: np.ndarray  # (flocks,) until no bird moved; all steps if that was not reached
    settled: np.ndarray  # (flocks,) whether it came
    series: np.ndarray  # (flocks, moments, birds, 3) on the way, if asked for


class InFrame(NamedTuple):
    """Where the birds of a flock are in the frame that flies with it, (n,) each."""

    x: np.ndarray  # to the right
    y: np.ndarray  # along the way
    z: np.ndarray  # up


def starts(seeds, birds, rules: VRuleSettings = VRuleSettings(), side=SIDE, apart=True):  # noqa: B008  frozen
    """Birds at random in a square, drawn again where they would be too near one another.

    Parameters
    ----------
    seeds : sequence of int
    birds : int
    side : float
        Of the square, wingspans.  With ``rules.layer`` it is a cube.
    apart : bool
        False takes the first draw, as the paper may have done: some flocks then begin with birds in one another.

    Returns
    -------
    (flocks, birds, 3) float64, wingspans
    """
    xyz = np.zeros((len(seeds), birds, 3))
    law = law_of(rules)
    keys = np.array([Noise(int(seed)).key(f"{STREAM} start", 0) for seed in seeds], np.uint64)
    _scatter(law, keys, float(side), bool(apart), xyz)
    return xyz


@kernel
def _scatter(law, keys, side, apart, xyz):
    for flock in range(len(keys)):
        draw = 0
        for i in range(xyz.shape[1]):
            for _ in range(10_000):
                xyz[flock, i, 0] = side * uniform_(keys[flock], draw, 0)
                xyz[flock, i, 1] = side * uniform_(keys[flock], draw, 1)
                xyz[flock, i, 2] = side * uniform_(keys[flock], draw, 2) if law.layer > 0.0 else 0.0
                draw += 1
                free = True
                for k in range(i):
                    dx, dy = abs(xyz[flock, k, 0] - xyz[flock, i, 0]), abs(xyz[flock, k, 1] - xyz[flock, i, 1])
                    free &= dx >= law.wide or dy >= law.long or abs(xyz[flock, k, 2] - xyz[flock, i, 2]) >= law.long
                if free or not apart:
                    break


def fly(xyz, seeds, rules: VRuleSettings = VRuleSettings(), steps=2000, every=0, ids=None, frame="flock") -> Flights:  # noqa: B008
    """Let flocks fly until they settle, or for so many steps.

    Parameters
    ----------
    xyz : (flocks, birds, 3) array_like
        Where they begin, wingspans.
    seeds : sequence of int
        One for each flock.
    steps : int
        At most (the paper's T).
    every : int
        Keep positions every so many steps, from the start on; 0 keeps none.
    ids : (birds,) array_like of int, optional
        Who the birds are, for their chance; 1, 2, ... by default, which are the entities of a new world.
    frame : {"flock", "world"}
        Whether positions are told from a bird's eye that flies along, or from the ground.
    """
    if frame not in ("flock", "world"):
        raise ValueError(f"frame must be 'flock' or 'world', got {frame!r}")
    here = np.array(xyz, np.float64)
    flocks, birds, _ = here.shape
    ids = np.arange(1, birds + 1) if ids is None else np.asarray(ids, np.int64)
    streams = np.array([Noise(int(seed)).stream(STREAM) for seed in seeds], np.uint64)
    moments = steps // every + 1 if every else 0
    flown = Flights(
        here, np.full(flocks, steps, np.int64), np.zeros(flocks, np.bool_), np.zeros((flocks, moments, birds, 3))
    )
    law = law_of(rules)
    on = law.cruise if frame == "world" else 0.0
    over_rows(_fly, flocks, law, ids, streams, steps, every, on, flown)
    return flown


@kernel
def _fly(lo, hi, law, ids, streams, steps, every, on, flown):
    xyz, took, settled, series = flown
    n = xyz.shape[1]
    x, y, z = np.empty(n), np.empty(n), np.empty(n)
    angle, by_x = np.zeros(n), np.empty(n, np.int64)
    sx, sy, sz = (x, y, z) if law.in_turn else (np.empty(n), np.empty(n), np.empty(n))
    at_present, seen = InFrame(x, y, z), InFrame(sx, sy, sz)
    for flock in range(lo, hi):
        for i in range(n):
            x[i], y[i], z[i], by_x[i], angle[i] = xyz[flock, i, 0], xyz[flock, i, 1], xyz[flock, i, 2], i, 0.0
        still = False
        for t in range(steps + 1):
            if every and t % every == 0:
                for i in range(n):
                    at = series[flock, t // every, i]
                    at[0], at[1], at[2] = x[i], y[i] + t * on, z[i]
            if t == steps or (still and not every):
                break
            if not still:
                still = not one_step(law, n, ids, key_(streams[flock], t), at_present, seen, angle, by_x)
                still &= law.perturbation == 0.0
                if still:
                    took[flock], settled[flock] = t, True
        for i in range(n):
            xyz[flock, i, 0], xyz[flock, i, 1], xyz[flock, i, 2] = x[i], y[i] + took[flock] * on, z[i]


@inner_kernel
def one_step(law, n, ids, key, flock, seen, angle, by_x):
    """One time step of a flock, in place, by what each has ``seen``.  Whether anybody moved or wanted to."""
    x, y, z = flock
    busy = False
    sort_by(x, by_x, n)
    if not law.in_turn:
        write_(seen.x, x)
        write_(seen.y, y)
        write_(seen.z, z)
    for i in range(n):
        acts, angle[i], mx, my, mz = shift(law, i, n, n, seen, flock, by_x, key, ids[i], angle[i])
        busy |= acts
        x[i], y[i], z[i] = x[i] + mx, y[i] + my, z[i] + mz
        if law.in_turn and mx != 0.0:
            sort_by(x, by_x, n)
    return busy


@inner_kernel
def shift(law, i, kin, n, seen, flock, by_x, key, entity, angle):
    """What one bird does in one step: (acts?, angle to the flock's way, displacement to the side, forward and up).

    It keeps the rules with the first ``kin`` birds as it has ``seen`` them, and clear of all n of the ``flock`` where
    they are.
    """
    x, y, z = flock
    mx, my, mz = wish(law, i, kin, seen.x, seen.y, seen.z, by_x, uniform_(key, entity, 0))
    acts = mx != 0.0 or my != 0.0 or mz != 0.0
    if law.turn > 0.0:
        angle, mx, my = turned(law, angle, mx, my)
        acts |= angle != 0.0
    if mx != 0.0 or my != 0.0 or mz != 0.0:
        mx, my, mz = dodge(law, i, n, x, y, z, mx, my, mz, uniform_(key, entity, 1))
    if law.perturbation > 0.0:
        bx = mx + law.perturbation * normal_(key, entity, 2)
        by = my + law.perturbation * normal_(key, entity, 3)
        bz = mz + (law.perturbation * normal_(key, entity, 4) if law.layer > 0.0 else 0.0)
        if not would_collide(law, i, n, x, y, z, bx, by, bz):
            mx, my, mz = bx, by, bz
    return acts, angle, mx, my, mz
