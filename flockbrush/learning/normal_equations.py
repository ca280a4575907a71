"""Normal equations, summed in the order of the rows: those of BLAS depend on how many threads share them."""

from __future__ import annotations

import numpy as np
from numba import njit


def normal_equations(slopes, share, off):
    """What least squares solve for a step.

    Parameters
    ----------
    slopes : (k, d) ndarray
        Of each of k predictions by d numbers.
    share : (k,) ndarray
        Weights.
    off : (k,) ndarray
        What is left to explain.

    Returns
    -------
    pull : (d,) ndarray
    information : (d, d) ndarray
    """
    return _sums(np.ascontiguousarray(slopes), share, off)


@njit(cache=True, nogil=True)
def _sums(slopes, share, off):
    many, d = slopes.shape
    pull, information = np.zeros(d), np.zeros((d, d))
    for k in range(many):
        for i in range(d):
            weighed = share[k] * slopes[k, i]
            pull[i] += weighed * off[k]
            for j in range(i + 1):
                information[i, j] += weighed * slopes[k, j]
    for i in range(d):
        for j in range(i):
            information[j, i] = information[i, j]
    return pull, information
