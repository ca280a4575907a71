"""Our intrinsics for kernels that Python itself runs, as under ``NUMBA_DISABLE_JIT=1``, where a debugger can step in.

Numba has no Python form of an intrinsic: each has one here, of the same name, that gives the same bits.  A vector of
`flockbrush.engine.lanes` is an array of sixteen numbers, a pointer the array that it points into.
"""

from __future__ import annotations

import struct
from fractions import Fraction

import numba
import numpy as np
from numba.extending import intrinsic as numbas_intrinsic

INTERPRETED = bool(numba.config.DISABLE_JIT)
LANES, EIGHT = 16, 8

if INTERPRETED:
    np.seterr(divide="ignore", over="ignore", under="ignore", invalid="ignore")  # compiled kernels do not warn either


def intrinsic(build):
    """As numba's decorator; where kernels are interpreted, the function of this file with the same name instead."""
    return interpretable(globals()[build.__name__])(build)


def interpretable(plain):
    """A decorator as numba's for intrinsics, with the function that takes their place where kernels are interpreted."""
    return lambda build: plain if INTERPRETED else numbas_intrinsic(build)


# bits --------------------------------------------------------------------------------


def bits_of_(x):
    """The 64 bits of a float, as an int64."""
    return struct.unpack("<q", struct.pack("<d", x))[0]


def float_of_(bits):
    """The float that these 64 bits are."""
    return np.float64(struct.unpack("<d", struct.pack("<Q", int(bits) & 0xFFFFFFFFFFFFFFFF))[0])


# lanes -------------------------------------------------------------------------------


def splat(value):
    """The same number in all lanes."""
    return np.full(LANES, value)


def splat8(value):
    """The same float64 in all of eight lanes."""
    return np.full(EIGHT, value)


def lane_numbers():
    """0 to 15, as int32."""
    return np.arange(LANES, dtype=np.int32)


def pointer(array):
    """Where the numbers of a contiguous array begin."""
    return array.reshape(-1)


def load(start, at):
    """The numbers ``start[at:at + 16]``, which must exist."""
    return start[at : at + LANES].copy()


def load8(start, at):
    """The float64 ``start[at:at + 8]``, which must exist."""
    return start[at : at + EIGHT].copy()


def load_rows(table, rows, at):
    """The rows ``rows[at:at + 8]`` of a table of eight float64 columns, as its columns."""
    return tuple(table.reshape(-1, EIGHT)[rows[at : at + EIGHT]].T.copy())


def load_where(start, at, mask):
    """As `load` where the mask is set, and 0 elsewhere; reads nothing there."""
    return gather(start, at + np.arange(LANES), mask)


def gather(start, at, mask):
    """``start[at]`` lane by lane where the mask is set, and 0 elsewhere."""
    values = np.zeros(LANES, start.dtype)
    values[mask] = start[at[mask]]
    return values


def store(start, at, value):
    """Write ``start[at:at + 16]``, or eight, which must exist."""
    start[at : at + len(value)] = value


def pack(start, at, value, mask):
    """Write the lanes that the mask names side by side from ``start[at]`` on."""
    chosen = value[mask]
    start[at : at + len(chosen)] = chosen


def bits(mask):
    """The mask as an integer, lane 0 in the lowest bit."""
    return int(mask @ (1 << np.arange(LANES)))


def mask_of(number):
    """The mask of which `bits` gives this number."""
    return (int(number) >> np.arange(LANES) & 1).astype(bool)


def count(mask):
    """How many lanes are set."""
    return int(np.count_nonzero(mask))


def lowest(number):
    """The place of the lowest bit that is set."""
    return (int(number) & -int(number)).bit_length() - 1


def where(mask, yes, no):
    """``yes`` where the mask is set, else ``no``."""
    return np.where(mask, yes, no)


def largest(a, b):
    """The larger of two, lane by lane; b where they are equal or a is not a number."""
    return np.where(a > b, a, b)


def fused(a, b, c):
    """``a * b + c`` rounded once."""
    if a.dtype == np.float64:
        return np.array([_fused(*lanes) for lanes in zip(a, b, c, strict=True)])
    product = a.astype(np.float64) * b  # exact: 24 bits and 24 bits
    total = product + c
    back = total - product
    lost = (product - (total - back)) + (c - back)  # what the sum has rounded away
    odd = total.view(np.int64)
    toward = np.where((lost > 0) == (total > 0), 1, -1)
    sticky = np.isfinite(total) & (lost != 0) & (odd & 1 == 0)
    return np.where(sticky, odd + toward, odd).view(np.float64).astype(np.float32)  # rounded to odd, then to nearest


def _fused(a, b, c):
    if not np.isfinite([a, b]).all():
        return a * b + c
    if not np.isfinite(c):
        return c
    exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
    try:
        return float(exact) if exact else a * b + c
    except OverflowError:
        return np.inf if exact > 0 else -np.inf


def total(a):
    """The sum of the lanes: each of the first half and its partner in the second, and so on until one is left."""
    while len(a) > 1:
        a = a[: len(a) // 2] + a[len(a) // 2 :]
    return a[0]


def totals(vectors):
    """The `total` of each of eight vectors of eight, as a vector."""
    return np.array([total(vector) for vector in vectors])


def times_power(a, shifted):
    """``a * 2**n`` in float64, n being what `maths.ROUNDER` was added to; neither may leave the normal numbers."""
    return (a.view(np.int64) + (shifted.view(np.int64) << 52)).view(np.float64)


def root(a):
    """The square root."""
    return np.sqrt(a)


def narrow(a):
    """float64 to float32."""
    return a.astype(np.float32)
