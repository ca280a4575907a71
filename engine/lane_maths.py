"""`flockbrush.engine.maths` for eight numbers at once: the same polynomials, with products and sums rounded once.

Inside kernels that use `flockbrush.engine.lanes`; the results differ from those of `maths` in the last bit or two, and
are the same on every machine.  Numba's cache does not see a change in this file, nor in `maths`: after one, touch the
kernels that use it.
"""

from __future__ import annotations

from flockbrush.engine.lanes import fused, largest, splat8, times_power, where
from flockbrush.engine.maths import ATAN, EXP, HALF_PI, LN2_HIGH, LN2_LOW, PI, QUARTER_PI, ROUNDER, TAN_EIGHTH
from numba import njit

# of vectors, which only kernels can hold: no wrappers for Python or C
lane_function = njit(cache=True, error_model="numpy", forceinline=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)


@lane_function
def exponential(x):
    """e to the power of x, for x up to 700: 0 below -700."""
    inside = largest(x, splat8(-700.0))
    shifted = fused(inside, splat8(1.4426950408889634), splat8(ROUNDER))
    n = shifted - ROUNDER
    r = fused(n, splat8(-LN2_LOW), fused(n, splat8(-LN2_HIGH), inside))
    p = fused(splat8(EXP[9]), r, splat8(EXP[8]))
    p = fused(p, r, splat8(EXP[7]))
    p = fused(p, r, splat8(EXP[6]))
    p = fused(p, r, splat8(EXP[5]))
    p = fused(p, r, splat8(EXP[4]))
    p = fused(p, r, splat8(EXP[3]))
    p = fused(p, r, splat8(EXP[2]))
    p = fused(p, r, splat8(EXP[1]))
    p = fused(p, r, splat8(EXP[0]))
    power = fused(r * r, p, r) + 1.0
    return where(x < -700.0, splat8(0.0), times_power(power, shifted))


@lane_function
def square_of_angle(cross, dot):
    """The square of the angle between two vectors, rad^2, from their cross and dot product; 0 where both are 0."""
    zero = splat8(0.0)
    y, x = largest(cross, zero - cross), largest(dot, zero - dot)
    steep = y > x
    small, large = where(steep, x, y), where(steep, y, x)
    # above pi / 8, measure from the diagonal: tan(a - pi/4) = (small - large) / (small + large)
    diagonal = small > large * TAN_EIGHTH
    lower = where(diagonal, small + large, large)
    q = where(diagonal, small - large, small) / where(lower > 0.0, lower, splat8(1.0))
    z = q * q
    p = fused(splat8(ATAN[10]), z, splat8(ATAN[9]))
    p = fused(p, z, splat8(ATAN[8]))
    p = fused(p, z, splat8(ATAN[7]))
    p = fused(p, z, splat8(ATAN[6]))
    p = fused(p, z, splat8(ATAN[5]))
    p = fused(p, z, splat8(ATAN[4]))
    p = fused(p, z, splat8(ATAN[3]))
    p = fused(p, z, splat8(ATAN[2]))
    p = fused(p, z, splat8(ATAN[1]))
    p = fused(p, z, splat8(ATAN[0]))
    angle = where(diagonal, splat8(QUARTER_PI), zero) + fused(q * z, p, q)
    angle = where(steep, splat8(HALF_PI) - angle, angle)
    angle = where(dot < 0.0, splat8(PI) - angle, angle)
    return angle * angle
