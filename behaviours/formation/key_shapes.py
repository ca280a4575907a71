"""Key shapes: where birds must fly so that each saves a given share (Klotsman & Tal [1]_, section 5, step 3).

On a grid of equal lateral distances the total E is fixed, so shares ξ become savings ê = ξ E, and the equations
e(y) = ê have as Jacobian minus the Laplacian of a weighted graph: e is, but for its sign, the gradient of a convex
function.  The solution is therefore unique up to a shift, *if there is one*; shares that no shape has send any solver
to infinity.  The default is the proximal form, which always has exactly one solution,

    min Φ(y) + μ/2 |y - y_before|²,  ∇Φ = ê - e(y),

and the paper's Levenberg-Marquardt is kept beside it.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.formation.hummel import power, power_and_jacobian
from numba import njit

PROXIMAL = 0.05  # μ; larger keeps nearer to the shape before
ENOUGH = 1e-12  # of a bird's saving: residual at which to stop
STEPS = 100  # at most


class NoShape(ArithmeticError):
    """No shape has these shares, or the solver did not find it."""


def solve_proximal(x, wanted, before, mu=PROXIMAL):
    """The shape nearest to what saves ``wanted``, not far from ``before``.

    Parameters
    ----------
    x : ndarray (n,)
        Wingspans, no two nearer than `flockbrush.behaviours.formation.hummel.REACH`.
    wanted : ndarray (n,)
        Savings ê, their sum the flock's total.
    before : ndarray (n,)
        y of the shape before, wingspans.
    mu : float
        0 asks for the savings exactly, by a damped Newton method; larger stays nearer to ``before``.

    Returns
    -------
    ndarray (n,)
        y, with the mean of ``before``.

    Raises
    ------
    NoShape
        With ``mu`` 0 only, when no shape has these savings.
    """
    x, wanted, before = (np.ascontiguousarray(a, np.float64) for a in (x, wanted, before))
    y, left = _newton(x, wanted, before, float(mu))
    if left > 1e-9:
        raise NoShape("no shape saves these shares; widen the ranges, or solve with mu above 0")
    return y


@njit(cache=True, nogil=True, error_model="numpy")
def _newton(x, wanted, before, mu):
    """Damped Newton on the proximal form: y and the largest residual.  No BLAS: its bits differ between machines."""
    n = len(x)
    y = before.copy()
    e, jacobian = power_and_jacobian(x, y)
    residual = wanted - e
    for _ in range(STEPS):
        size = _square(residual)
        if _largest(residual) <= ENOUGH:
            break
        # with mu 0, a shift of all costs something: the flock stays where it is
        hold = 1.0 / n if mu == 0.0 else 0.0
        hessian = hold - jacobian
        for i in range(n):
            hessian[i, i] += mu
        step = _solve(hessian, -residual)
        share = min(1.0, 50.0 / max(_largest(step), 1e-300))
        better = False
        for _ in range(50):  # the residual falls along Newton's step, if the step is short enough
            trial = y + share * step
            left = wanted - power(x, trial) + mu * (trial - before)
            if _square(left) <= (1.0 - 1e-4 * share) ** 2 * size:
                better = True
                break
            share *= 0.5
        if not better:
            break
        y, residual = trial, left
        jacobian = power_and_jacobian(x, y)[1]
    return y, _largest(residual)


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(matrix, right):
    """The solution of a symmetric positive definite system (Cholesky); ``matrix`` is overwritten."""
    n = len(right)
    for j in range(n):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = np.sqrt(max(matrix[j, j], 1e-300))
        for i in range(j + 1, n):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    out = right.copy()
    for i in range(n):
        for k in range(i):
            out[i] -= matrix[i, k] * out[k]
        out[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            out[i] -= matrix[k, i] * out[k]
        out[i] /= matrix[i, i]
    return out


@njit(cache=True, nogil=True)
def _square(values):
    total = 0.0
    for value in values:
        total += value * value
    return total


@njit(cache=True, nogil=True)
def _largest(values):
    most = 0.0
    for value in values:
        most = max(most, abs(value))
    return most


def solve_levenberg_marquardt(x, wanted, start):
    """The paper's method (MINPACK's), with the Jacobian in closed form; ``start`` is only where the search begins.

    Parameters, result and errors as of `solve_proximal`.
    """
    from scipy.optimize import least_squares  # takes long to load; flocks are solved by `solve_proximal`

    x, wanted, start = (np.ascontiguousarray(a, np.float64) for a in (x, wanted, start))
    solution = least_squares(
        lambda y: power(x, y) - wanted, start, lambda y: power_and_jacobian(x, y)[1], method="lm",
        xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200,
    )  # fmt: skip
    if not _largest(solution.fun) <= 1e-8:
        raise NoShape("Levenberg-Marquardt found no shape that saves these shares")
    return solution.x + (np.mean(start) - solution.x.mean())


def project(values, low, high, total=1.0):
    """The nearest numbers within ``low`` and ``high`` whose sum is ``total``.

    Raises
    ------
    ValueError
        When the ranges do not allow the sum.
    """
    values, low, high = (np.asarray(a, float) for a in (values, low, high))
    if not (low <= high).all() or not low.sum() - 1e-12 <= total <= high.sum() + 1e-12:
        raise ValueError(f"ranges from {low.sum():.6g} to {high.sum():.6g} in sum do not allow {total}")
    least, most = (low - values).min(), (high - values).max()
    for _ in range(200):  # the sum goes up with the shift
        shift = 0.5 * (least + most)
        if np.clip(values + shift, low, high).sum() < total:
            least = shift
        else:
            most = shift
        if most - least <= 1e-16 * max(1.0, abs(most)):
            break
    return np.clip(values + most, low, high)
