"""Chance that depends on who and when, never on the order of drawing.

Each number is a hash of (seed, stream, tick, entity), so taking one animal away, or adding a
system that draws, leaves everyone else's noise as it was.  Streams have names, such as "wander";
two systems that share a name share their numbers.

References
----------
.. [1] Steele, Lea & Flood (2014). Fast splittable pseudorandom number generators. OOPSLA.
.. [2] Wichura (1988). Algorithm AS 241: the percentage points of the normal distribution.
   Applied Statistics 37, 477-484.
"""

from __future__ import annotations

import struct
import zlib
from functools import lru_cache
from operator import index

import numpy as np
from flockbrush.engine.arguments import whole
from flockbrush.engine.maths import float_of_, kernel_function, log_
from numba import njit

LARGEST_SEED = 2**63 - 1  # that files keep
GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # 2**64 over the golden ratio: far apart for neighbouring counts
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _12 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(12)
_ONE = np.uint64(0x3FF0000000000000)  # the bits of 1.0
_MASK = (1 << 64) - 1


@kernel_function
def _mix(z):
    """Every bit out depends on every bit in: the finaliser of splitmix64 [1]_."""
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


@kernel_function
def _unit(key, entity, k):
    """A multiple of 2**-52 in [0, 1): 52 random bits behind the exponent of 1.0."""
    bits = _mix(_mix(key ^ (np.uint64(entity) * GOLDEN)) + (np.uint64(k) + np.uint64(1)) * GOLDEN)
    return float_of_(np.int64((bits >> _12) | _ONE)) - 1.0


@kernel_function
def key_(stream, tick):
    """`Noise.key` inside a kernel that goes through ticks itself; ``stream`` is `Noise.stream`, a uint64."""
    return _mix((stream ^ np.uint64(tick)) + GOLDEN)


@kernel_function
def uniform_(key, entity, k):
    """The k-th number of an entity, even over [0, 1).  ``key`` is `Noise.key`, a uint64."""
    return _unit(key, entity, k)


@kernel_function
def normal_(key, entity, k):
    """The k-th standard normal number of an entity.  ``key`` is `Noise.key`, a uint64.

    It goes up with `uniform_` of the same arguments; it lies within 8.3 deviations.
    """
    return quantile_(_unit(key, entity, k) + 2.0**-53)


@njit(cache=True, error_model="numpy")
def quantile_(p):
    """The standard normal number below which a share ``p`` lies, 0 < p < 1 [2]_."""
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        over = 2.5090809287301226727e3
        over = over * r + 3.3430575583588128105e4
        over = over * r + 6.7265770927008700853e4
        over = over * r + 4.5921953931549871457e4
        over = over * r + 1.3731693765509461125e4
        over = over * r + 1.9715909503065514427e3
        over = over * r + 1.3314166789178437745e2
        over = over * r + 3.3871328727963666080
        under = 5.2264952788528545610e3
        under = under * r + 2.8729085735721942674e4
        under = under * r + 3.9307895800092710610e4
        under = under * r + 2.1213794301586595867e4
        under = under * r + 5.3941960214247511077e3
        under = under * r + 6.8718700749205790830e2
        under = under * r + 4.2313330701600911252e1
        under = under * r + 1.0
        return q * over / under
    tail = p if q < 0.0 else 1.0 - p
    r = np.sqrt(-log_(tail))
    if r <= 5.0:
        r -= 1.6
        over = 7.74545014278341407640e-4
        over = over * r + 2.27238449892691845833e-2
        over = over * r + 2.41780725177450611770e-1
        over = over * r + 1.27045825245236838258
        over = over * r + 3.64784832476320460504
        over = over * r + 5.76949722146069140550
        over = over * r + 4.63033784615654529590
        over = over * r + 1.42343711074968357734
        under = 1.05075007164441684324e-9
        under = under * r + 5.47593808499534494600e-4
        under = under * r + 1.51986665636164571966e-2
        under = under * r + 1.48103976427480074590e-1
        under = under * r + 6.89767334985100004550e-1
        under = under * r + 1.67638483018380384940
        under = under * r + 2.05319162663775882187
        under = under * r + 1.0
    else:
        r -= 5.0
        over = 2.01033439929228813265e-7
        over = over * r + 2.71155556874348757815e-5
        over = over * r + 1.24266094738807843860e-3
        over = over * r + 2.65321895265761230930e-2
        over = over * r + 2.96560571828504891230e-1
        over = over * r + 1.78482653991729133580
        over = over * r + 5.46378491116411436990
        over = over * r + 6.65790464350110377720
        under = 2.04426310338993978564e-15
        under = under * r + 1.42151175831644588870e-7
        under = under * r + 1.84631831751005468180e-5
        under = under * r + 7.86869131145613259100e-4
        under = under * r + 1.48753612908506148525e-2
        under = under * r + 1.36929880922735805310e-1
        under = under * r + 5.99832206555887937690e-1
        under = under * r + 1.0
    return -over / under if q < 0.0 else over / under


@njit(cache=True, nogil=True)
def _fill_uniform(key, ids, out):
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            out[i, k] = uniform_(key, ids[i], k)


@njit(cache=True, nogil=True)
def _fill_normal(key, ids, out):
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            out[i, k] = normal_(key, ids[i], k)


def normals(key, ids):
    """Standard normal numbers (n,) of entities, for models in plain numpy; ``key`` is what `Scene.key` gives."""
    out = np.empty((len(ids), 1))
    _fill_normal(key, np.asarray(ids, np.int64), out)
    return out[:, 0]


def seed_of(seed) -> int:
    """A seed as recordings keep it: an integer from 0 to `LARGEST_SEED`; TypeError or ValueError for anything else."""
    if not 0 <= whole("seed", seed) <= LARGEST_SEED:
        raise ValueError(f"seed must be a whole number from 0 to {LARGEST_SEED}, got {seed}")
    return index(seed)


class Noise:
    """The chance of one world, from its seed.

    Parameters
    ----------
    seed : int
        Any whole number; only its low 64 bits count.
    """

    def __init__(self, seed=0):
        self.seed = int(seed)

    def __repr__(self):
        return f"Noise(seed={self.seed})"

    def state(self):
        """The seed as bytes (see `flockbrush.engine.state`)."""
        return struct.pack("<Q", self.seed & _MASK)

    def set_state(self, data):
        """Put back what `state` gave."""
        self.seed = struct.unpack("<Q", data)[0]

    def key(self, stream, tick):
        """What a kernel hands to `uniform_` and `normal_` for this stream in this tick: a uint64."""
        return np.uint64(_key(self.seed & _MASK, stream, int(tick) & _MASK))

    def stream(self, name):
        """What a kernel hands to `key_` for all ticks of a stream: a uint64."""
        return np.uint64(_stream(self.seed & _MASK, name))

    def uniform(self, stream, tick, ids, width=1):
        """Numbers in [0, 1).

        Parameters
        ----------
        stream : str
            What the numbers are for.
        tick : int
        ids : (n,) array_like of int
            Entities, not rows.
        width : int
            Numbers for each of them.

        Returns
        -------
        (n, width) float64
            The same numbers as ``uniform_(key(stream, tick), ids[i], k)``.
        """
        return self._filled(_fill_uniform, stream, tick, ids, width)

    def normal(self, stream, tick, ids, width=1):
        """Standard normal numbers, (n, width): as `uniform`, but normal."""
        return self._filled(_fill_normal, stream, tick, ids, width)

    def _filled(self, fill, stream, tick, ids, width):
        ids = np.ascontiguousarray(ids, np.int64)
        out = np.empty((len(ids), width))
        fill(self.key(stream, tick), ids, out)
        return out


def _mix_int(z):
    """`_mix` on Python's own integers."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


def _stream(seed, name):
    golden = int(GOLDEN)
    z = _mix_int((seed + golden) & _MASK)
    return _mix_int(((z ^ zlib.crc32(name.encode())) + golden) & _MASK)


@lru_cache(maxsize=64)
def _key(seed, stream, tick):
    return _mix_int(((_stream(seed, stream) ^ tick) + int(GOLDEN)) & _MASK)
