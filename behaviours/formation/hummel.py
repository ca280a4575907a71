"""What a bird saves behind, beside and before another: Hummel's function.

Hummel [1]_ gives the share of induced drag that bird *i* saves by the wingtip vortices of bird *j*, both without
flapping, as a function g of the lateral distance x and of y, positive when *i* flies behind *j*.  Klotsman and Tal [2]_
print it as a sum of logarithms that loses most of its digits and has no value abreast.  With a = π/4 and
r(d) = √(d² + y²), r0 = r(x), r+ = r(x + a), r- = r(x - a), it is

    (π²/2) g = 2 ln(r0 - y) - ln(r+ - y) - ln(r- - y) + (2 r0 - r+ - r-) / y

and here it stands in a form of which every term is computed without cancellation.  By Munk's theorem a pair shares a
fixed sum, g(x, y) + g(x, -y) = 2 g(x, 0): flying farther behind takes from the one what it gives to the other.

Lengths are in wingspans.  Nearer than a to the side (`REACH`) a bird flies in another's downwash, for which there is no
such formula.

.. [1] Hummel, D. (1983). Aerodynamic aspects of formation flight in birds. J. Theoretical Biology 104(3), 321-347.
.. [2] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

import numpy as np
from flockbrush.engine.maths import log_
from numba import njit

REACH = np.pi / 4  # a, wingspans: half the distance between the two vortices of a wing
SCALE = 2.0 / np.pi**2  # the formula gives (π²/2) g


@njit(cache=True, nogil=True, error_model="numpy")
def _log1p(z):
    """ln(1 + z) without loss for small z."""
    u = 1.0 + z
    return z if u == 1.0 else log_(u) * z / (u - 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _bend(x, s):
    """(r+ + r- - 2 r0) / s², and the three distances: a sum of positive terms."""
    a = REACH
    r0, rp, rm = np.sqrt(x * x + s * s), np.sqrt((x + a) ** 2 + s * s), np.sqrt((x - a) ** 2 + s * s)
    both = rp + rm
    p = 1.0 / (rp + x + a) + 1.0 / (rm + x - a)
    top = a * a * (p * (both + 2.0 * x + 2.0 * r0) + 4.0 * x / (r0 + x))
    return top / (both * (rp + r0) * (rm + r0)), r0, rp, rm


@njit(cache=True, nogil=True, error_model="numpy")
def g_(x, y):
    """Hummel's function for |x| > `REACH`; for use inside a kernel (works outside too)."""
    a = REACH
    x, s = abs(x), abs(y)
    bend, r0, rp, rm = _bend(x, s)
    more = a * a * (2.0 * s * s - 2.0 * x * x + a * a) / (rp * rm + r0 * r0) + bend * s * s * s
    ahead = SCALE * (bend * s - _log1p(more / (r0 + s) ** 2))  # what the one ahead saves
    return 2.0 * g0_(x) - ahead if y > 0.0 else ahead


@njit(cache=True, nogil=True, error_model="numpy")
def g0_(x):
    """What each of two birds abreast saves."""
    return -SCALE * _log1p(-(REACH * REACH) / (x * x))


@njit(cache=True, nogil=True, error_model="numpy")
def slope_(x, y):
    """dg/dy, positive everywhere and the same before and behind."""
    return SCALE * _bend(abs(x), abs(y))[0]


@njit(cache=True, nogil=True, error_model="numpy")
def power(x, y):
    """Power reduction of every bird, e_i = Σ_j g_ij (eq. 1 without the drag ratio), (n,).

    ``x`` and ``y`` are positions in wingspans, +y the way they fly; no two x nearer than `REACH`.
    """
    n = len(x)
    e = np.zeros(n)
    for i in range(n):
        for j in range(n):
            if i != j:
                e[i] += g_(x[j] - x[i], y[j] - y[i])
    return e


@njit(cache=True, nogil=True, error_model="numpy")
def power_and_jacobian(x, y):
    """(e, J), J_ij = ∂e_i/∂y_j: minus the Laplacian of a graph whose weights are dg/dy."""
    n = len(x)
    e, jacobian = np.zeros(n), np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            dx, dy = x[j] - x[i], y[j] - y[i]
            behind = g_(dx, dy)
            e[i] += behind
            e[j] += 2.0 * g0_(dx) - behind  # Munk
            weight = slope_(dx, dy)
            jacobian[i, j] = jacobian[j, i] = weight
            jacobian[i, i] -= weight
            jacobian[j, j] -= weight
    return e, jacobian


@njit(cache=True, nogil=True, error_model="numpy")
def total_power(x):
    """E = Σ e_i of a flock, whatever its y (Munk)."""
    total = 0.0
    for i in range(len(x)):
        for j in range(i):
            total += 2.0 * g0_(x[j] - x[i])
    return total


def relative_power(y, dx):
    """ξ_i = e_i / E of birds in order from left to right, ``dx`` apart, (n,).

    On uneven x the shares differ and cannot be had on an even grid, so shapes are compared on the grid alone.
    """
    y = np.ascontiguousarray(y, float)
    e = power(np.arange(len(y)) * float(dx), y)
    return e / e.sum()
