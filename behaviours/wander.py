"""Random turns: chance that turns headings, anew in each tick or for a while in one direction.

``wander`` is how far: the standard deviation of a heading grows with the square root of time. By default each tick has
a turn of its own, as in most models since Vicsek et al. 1995 [1]_. Real animals keep turning to one side for a while:
the rate at which they turn is correlated in time (the persistent turning walker of Gautrais et al. 2009 [2]_). With a
``wander_time`` τ the rate is a sum of normal numbers, one for each τ of the scene's time, each of which comes and goes
like a half wave of 2 τ. Its variance is the same at all times, and it is correlated over about τ. From 2 τ on, the
variance of headings grows as fast as it does without (`lasting`). The numbers depend on animal and time alone, so that
nothing has to be remembered from tick to tick.

References
----------
.. [1] Vicsek, T., Czirók, A., Ben-Jacob, E., Cohen, I. & Shochet, O. (1995). Novel type of phase transition in a
   system of self-driven particles. Physical Review Letters 75(6), 1226-1229.
.. [2] Gautrais, J. et al. (2009). Analyzing fish movement as a persistent turning walker. Journal of Mathematical
   Biology 58, 429-445.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.engine.maths import sincos_
from flockbrush.engine.noise import normal_
from flockbrush.engine.parallel import over_rows
from numba import njit

STREAM, LASTING = "wander", "wander that lasts"
HALF_PI = 0.5 * math.pi


def wander_parameter(default: float, more: str = ""):
    """The parameter ``wander`` of a model."""
    text = f"random turning: standard deviation of the heading after 1 s{more}"
    return quantity(default, "rad/√s", text, 0, 10, chance=True)


def wander_time_parameter():
    """The parameter ``wander_time`` of a model."""
    text = "time for which a random turn goes on; up to the length of a tick: each tick has its own"
    return quantity(0.0, "s", text, 0, 10, chance=True)


class RandomTurns(NamedTuple):
    """The numbers of which the random turns of a tick are made, for `wander_kernel`."""

    keys: np.ndarray  # (k,) uint64, of `normal_`
    weights: np.ndarray  # (k,) rad


def random_turns(wander: float, wander_time: float, dt: float, tick: int, key: Callable) -> RandomTurns:
    """Those of one tick.

    Parameters
    ----------
    wander : float
        rad/√s.
    wander_time, dt : float
        s.
    tick : int
    key : callable
        ``key(stream, tick)``: see `flockbrush.engine.noise.Noise.key`.
    """
    if wander_time < dt:
        return RandomTurns(np.array([key(STREAM, tick)]), np.array([wander * np.sqrt(dt)]))
    begin, end = tick * dt / wander_time, (tick + 1) * dt / wander_time
    first = int(begin)
    waves = [first + k for k in range(3) if first + k - 1 < end]
    risen = [_risen(end - wave) - _risen(begin - wave) for wave in waves]
    weights = 0.5 * wander * math.sqrt(wander_time) * np.array(risen)
    return RandomTurns(np.array([key(LASTING, wave) for wave in waves]), weights)


def _risen(y):
    """The integral of a half wave up to y, from -1 to 1; the wave lasts from -1 to 1."""
    return sincos_(HALF_PI * min(max(y, -1.0), 1.0))[0]


def rms_turn(wander: float, wander_time: float, dt: float) -> float:
    """Root mean square of a random turn in one tick, rad."""
    if wander_time < dt:
        return wander * math.sqrt(dt)
    return 0.25 * math.pi * wander * dt / math.sqrt(wander_time)


def lasting(times, wander_time: float) -> np.ndarray:
    """The variance of headings after some times (k,), s, as a share of what it is if random turns do not last."""
    times = np.asarray(times, float)
    if wander_time <= 0.0:
        return np.ones(times.shape)
    lag = np.linspace(0.0, 2.0, 201)
    x = times[..., None] / wander_time
    both = 2.0 * np.trapezoid(np.maximum(x - lag, 0.0) * half_wave_correlation(lag), lag, axis=-1)
    return (np.pi / 4.0) ** 2 * both / x[..., 0]


def half_wave_correlation(lag) -> np.ndarray:
    """Correlation of a sum of half waves with itself, each of 2, one begun in each unit of time; ``lag`` in units."""
    lag = np.minimum(np.abs(lag), 2.0)
    return 0.5 * (2.0 - lag) * np.cos(HALF_PI * lag) + np.sin(HALF_PI * lag) / np.pi


def wander(scene, rows, p, direction):
    """Turn the headings of some rows by chance.

    Parameters
    ----------
    scene : Scene
    rows : (k,) int32 ndarray
    p : Parameters
        With ``wander`` and ``wander_time``.
    direction : (k, 3) ndarray
        Headings, changed in place.
    """
    if p.wander > 0.0:
        turns = random_turns(p.wander, p.wander_time, scene.dt, scene.tick, scene.key)
        over_rows(wander_kernel, len(rows), rows, scene.ids, *turns, direction)


@njit(cache=True, nogil=True, error_model="numpy")
def wander_kernel(lo, hi, rows, ids, keys, weights, direction):
    """Turn each heading by the sum of its normal numbers of these keys, times weights in radians."""
    for k in range(lo, hi):
        turn = 0.0
        for j in range(len(keys)):
            turn += weights[j] * normal_(keys[j], ids[rows[k]], 0)
        sine, cosine = sincos_(turn)
        x, y = direction[k, 0], direction[k, 1]
        direction[k, 0], direction[k, 1] = cosine * x - sine * y, sine * x + cosine * y
