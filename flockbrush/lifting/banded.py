"""Symmetric banded systems, solved on one thread without the interpreter's lock, while a window is drawn.

A matrix is stored by the rows of its upper half, (n, band + 1): ``bands[i, k]`` is the element (i, i + k).
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def banded_product(bands, vector):
    """Product of a symmetric banded matrix and a vector.

    Parameters
    ----------
    bands : (n, band + 1) ndarray
    vector : (n,) ndarray

    Returns
    -------
    (n,) ndarray
    """
    n, wide = bands.shape
    out = np.zeros(n)
    for i in range(n):
        out[i] += bands[i, 0] * vector[i]
        for k in range(1, min(wide, n - i)):
            out[i] += bands[i, k] * vector[i + k]
            out[i + k] += bands[i, k] * vector[i]
    return out


@njit(cache=True, nogil=True)
def solve_banded(bands, side):
    """Solution of a positive definite banded system, by Cholesky decomposition in place.

    Parameters
    ----------
    bands : (n, band + 1) ndarray
        Is overwritten.
    side : (n,) ndarray
        Right-hand side.

    Returns
    -------
    (n,) ndarray
        NaN when the matrix is not positive definite.
    """
    n, wide = bands.shape
    x = side.copy()
    for i in range(n):
        if not bands[i, 0] > 0.0:
            return np.full(n, np.nan)
        root = np.sqrt(bands[i, 0])
        reach = min(wide, n - i)
        for k in range(reach):
            bands[i, k] /= root
        x[i] /= root
        for k in range(1, reach):
            share = bands[i, k]
            if share != 0.0:
                x[i + k] -= share * x[i]
                for m in range(reach - k):
                    bands[i + k, m] -= share * bands[i, k + m]
    for i in range(n - 1, -1, -1):
        for k in range(1, min(wide, n - i)):
            x[i] -= bands[i, k] * x[i + k]
        x[i] /= bands[i, 0]
    return x


@njit(cache=True, nogil=True)
def add_squares(bands, places, vectors, weight):
    """Add ``weight * vectors.T @ vectors`` to a banded system, in place.

    Parameters
    ----------
    bands : (size, band + 1) ndarray
    places : (n,) int ndarray
        Rows of the system to which the columns of `vectors` belong, ascending.
    vectors : (k, n) ndarray
    weight : float
    """
    for a in range(len(places)):
        for b in range(a, len(places)):
            total = 0.0
            for k in range(len(vectors)):
                total += vectors[k, a] * vectors[k, b]
            bands[places[a], places[b] - places[a]] += weight * total
