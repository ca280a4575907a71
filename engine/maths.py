"""Exponential, logarithm and angles that give the same bits on every machine.

The transcendental functions of numpy and of the C library may differ in the last bit from
one processor to the next, and one bit is another herd a thousand ticks later.  These are
additions, multiplications and divisions only, written without branches so that LLVM inlines
them into a kernel's loop and turns the loop into vector instructions.

The polynomials interpolate at Chebyshev nodes, computed with 40 digits, on the interval named
beside each; their own error is below 2e-17.  The functions are good to 2e-15 relative, most of
them to 4e-16.  The trailing underscore says: for use inside a kernel (they also work outside).
"""

from __future__ import annotations

from flockbrush.engine.interpreted import intrinsic
from flockbrush.engine.kernel_cache import compile_without_collecting, forget_stale_kernels, save_one_at_a_time
from llvmlite import ir
from numba import njit, types

forget_stale_kernels()
save_one_at_a_time()
compile_without_collecting()

# one line in a kernel's loop; a function for C callers would be compiled in vain
kernel_function = njit(cache=True, error_model="numpy", forceinline=True, no_cfunc_wrapper=True)
# too long for that, and called by kernels alone: what Python would call it through takes half the compiler's time
inner_kernel = njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)

LN2_HIGH = 0.6931471803691238  # 32 bits: its product with an exponent is exact
LN2_LOW = 1.9082149292705877e-10
ROUNDER = 6755399441055744.0  # 1.5 * 2**52: adding it leaves the nearest whole number in the low bits
ROUNDER_BITS = 0x4338000000000000
HALF_PI_HIGH = 1.5707963267341256  # 33 bits
HALF_PI_MIDDLE = 6.077100506303966e-11  # 33 bits
HALF_PI_LOW = 2.0222662487959506e-21
QUARTER_PI = 0.7853981633974483
HALF_PI = 1.5707963267948966
PI = 3.141592653589793
EXP = (  # (e^r - 1 - r) / r^2 by powers of r, for |r| <= ln 2 / 2
    0.5000000000000001, 0.16666666666666669, 0.04166666666662404, 0.008333333333330055, 0.0013888888917258759,
    0.00019841269863088255, 2.4801521225986432e-05, 2.7557268406190795e-06, 2.7620121717381933e-07,
    2.51004110820149e-08,
)  # fmt: skip
ATAN = (  # (atan q - q) / q^3 by powers of q^2, for |q| <= tan(pi / 8)
    -0.3333333333333333, 0.19999999999995519, -0.14285714284666184, 0.11111111015227572, -0.09090904576954117,
    0.07692183163650894, -0.06664511064599371, 0.05858145587628202, -0.050854323376990765, 0.0392311556198723,
    -0.01917627151752634,
)  # fmt: skip
TAN_EIGHTH = 0.4142135623730951  # tan(pi / 8)


@intrinsic
def bits_of_(typing_context, x):
    """The 64 bits of a float, as an int64."""

    def build(context, builder, signature, args):
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), build


@intrinsic
def float_of_(typing_context, bits):
    """The float that these 64 bits are."""

    def build(context, builder, signature, args):
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), build


@kernel_function
def exp_(x):
    """e to the power of x: 0 below -708, infinity above 709.78.

    x = n ln 2 + r with |r| <= ln 2 / 2, and e^x = 2^n e^r.
    """
    inside = x
    if x < -708.0:
        inside = -708.0
    if x > 709.782712893384:
        inside = 709.782712893384
    shifted = inside * 1.4426950408889634 + ROUNDER
    n = shifted - ROUNDER
    r = inside - n * LN2_HIGH - n * LN2_LOW
    r2 = r * r
    r4 = r2 * r2
    low = (EXP[0] + r * EXP[1]) + r2 * (EXP[2] + r * EXP[3])
    middle = (EXP[4] + r * EXP[5]) + r2 * (EXP[6] + r * EXP[7])
    high = EXP[8] + r * EXP[9]
    power = 1.0 + (r + r2 * (low + r4 * (middle + r4 * high)))
    # 2**(n - 1), then twice: n may be 1024, whose power of two is no float
    scale = float_of_((bits_of_(shifted) - ROUNDER_BITS + 1022) << 52)
    result = (2.0 * power) * scale
    if x < -708.0:
        result = 0.0
    if x > 709.782712893384:
        result = float_of_(0x7FF0000000000000)
    return result


@kernel_function
def log_(x):
    """The natural logarithm: minus infinity at 0, NaN below.

    x = 2^k m with m between 1/sqrt 2 and sqrt 2, and log m = 2 atanh(s), s = (m - 1) / (m + 1).
    """
    scaled = x
    shift = 0.0
    if x < 2.2250738585072014e-308:  # subnormal
        scaled = x * 18014398509481984.0
        shift = 54.0
    bits = bits_of_(scaled)
    offset = bits - 0x3FE6A09E667F3BCD  # the bits of 1 / sqrt 2
    exponent = offset >> 52
    m = float_of_(bits - (exponent << 52))
    k = (float_of_(exponent + ROUNDER_BITS) - ROUNDER) - shift
    f = m - 1.0
    s = f / (m + 1.0)
    z = s * s
    z2 = z * z
    low = (0.666666666666667 + z * 0.3999999999989924) + z2 * (0.2857142862609589 + z * 0.2222221111514416)
    high = (0.18182890556695602 + z * 0.1533167403016786) + z2 * 0.1461703754879165
    # 2s = f - s f: f is exact, so little is lost when m is near 1
    result = k * LN2_HIGH + (f - (s * (f - z * (low + z2 * z2 * high)) - k * LN2_LOW))
    if x == 0.0:
        result = -float_of_(0x7FF0000000000000)
    if not x >= 0.0:  # NaN too
        result = float_of_(0x7FF8000000000000)
    if x == float_of_(0x7FF0000000000000):
        result = x
    return result


@kernel_function
def _angle(y, x):
    """The angle of (x, y) for x, y >= 0, between 0 and pi / 2; 0 at the origin."""
    small, large = y, x
    if y > x:
        small, large = x, y
    # above pi / 8, measure from the diagonal: tan(a - pi/4) = (small - large) / (small + large)
    upper, lower, base = small, large, 0.0
    if small > TAN_EIGHTH * large:
        upper, lower, base = small - large, small + large, QUARTER_PI
    if lower == 0.0:
        lower = 1.0
    q = upper / lower
    z = q * q
    z2 = z * z
    z4 = z2 * z2
    low = (ATAN[0] + z * ATAN[1]) + z2 * (ATAN[2] + z * ATAN[3])
    middle = (ATAN[4] + z * ATAN[5]) + z2 * (ATAN[6] + z * ATAN[7])
    high = (ATAN[8] + z * ATAN[9]) + z2 * ATAN[10]
    angle = base + (q + q * z * (low + z4 * (middle + z4 * high)))
    if y > x:
        angle = HALF_PI - angle
    return angle


@kernel_function
def atan2_(y, x):
    """The direction of (x, y), radians counter-clockwise from east, in (-pi, pi]; 0 at the origin.

    A minus zero counts as zero, unlike in the C library: due west is always +pi.
    """
    angle = _angle(abs(y), abs(x))
    if x < 0.0:
        angle = PI - angle
    if y < 0.0:
        angle = -angle
    return angle


@kernel_function
def sincos_(a):
    """(sin a, cos a) for |a| up to 1e6 rad; the error there is 1e-15 absolute."""
    shifted = a * 0.6366197723675814 + ROUNDER
    n = shifted - ROUNDER
    quadrant = bits_of_(shifted) & 3
    r = ((a - n * HALF_PI_HIGH) - n * HALF_PI_MIDDLE) - n * HALF_PI_LOW
    z = r * r
    z2 = z * z
    s = (-0.16666666666666666 + z * 0.008333333333330948) + z2 * (
        (-0.0001984126983675712 + z * 2.755731610179909e-06)
        + z2 * (-2.5051131688000297e-08 + z * 1.5918117983848815e-10)
    )
    c = (0.041666666666666664 + z * -0.0013888888888887398) + z2 * (
        (2.4801587298764778e-05 + z * -2.7557317271258515e-07)
        + z2 * (2.0876146170183976e-09 + z * -1.1382625349447592e-11)
    )
    sine = r + r * z * s
    cosine = 1.0 - (0.5 * z - z2 * c)
    first, second = sine, cosine
    if quadrant & 1:
        first, second = cosine, sine
    if quadrant & 2:
        first = -first
    if (quadrant + 1) & 2:
        second = -second
    return first, second
