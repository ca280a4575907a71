"""Local polynomials along tracks: positions, headings and their rates, from the bodies of some frames to each side."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def fitted_along(frame, at, angle, weight, begin, half, far, out_frame, first, out):
    """Fit positions, headings and their rates around every frame of every track, into `out` (rows, 8).

    Positions and headings are fitted by quadratics, velocities by lines, within `half` frames to each side; axes more
    than `far` rad off the fit get almost no weight. Columns: x, y (BL), their rates (BL per frame), heading (rad), its
    rate (rad per frame), and the factors by which noise of one body enters the rates of heading and of position.
    """
    for track in range(len(begin) - 1):
        a, b = begin[track], begin[track + 1]
        for row in range(first[track], first[track + 1]):
            t = out_frame[row]
            lo, hi = _window(frame, a, b, t, half)
            n = hi - lo
            u = frame[lo:hi] - t
            w = np.ones(n)
            x = _quadratic(u, at[lo:hi, 0], w, n)[0]
            y = _quadratic(u, at[lo:hi, 1], w, n)[0]
            rx, nv = _slope(u, at[lo:hi, 0])
            ry, nv = _slope(u, at[lo:hi, 1])
            w[:] = weight[lo:hi]
            h, turn, nt = _quadratic(u, angle[lo:hi], w, n)
            # an axis that is far off its track is another animal's, or two animals'
            off = np.empty(n)
            middle = np.median(angle[lo:hi])
            slope = 0.0
            for k in range(n):
                off[k] = np.abs(angle[lo + k] - (h + turn * u[k]))
            if off.max() > far:
                diff = np.empty(n - 1)
                for k in range(n - 1):
                    diff[k] = (angle[lo + k + 1] - angle[lo + k]) / (u[k + 1] - u[k])
                slope = np.median(diff)
                rest = np.empty(n)
                for k in range(n):
                    rest[k] = angle[lo + k] - slope * u[k]
                middle = np.median(rest)
                for k in range(n):
                    if np.abs(rest[k] - middle) > far:
                        w[k] = 1e-3
                h, turn, nt = _quadratic(u, angle[lo:hi], w, n)
            out[row, 0], out[row, 1], out[row, 2], out[row, 3] = x, y, rx, ry
            out[row, 4], out[row, 5], out[row, 6], out[row, 7] = h, turn, nt, nv


@njit(cache=True, nogil=True)
def local_values(frame, values, begin, half, out):
    """Write the values (k, m) along tracks, each replaced by the quadratic through those around it, into `out`."""
    for track in range(len(begin) - 1):
        a, b = begin[track], begin[track + 1]
        for row in range(a, b):
            lo, hi = _window(frame, a, b, frame[row], half)
            u, w = frame[lo:hi] - frame[row], np.ones(hi - lo)
            for m in range(values.shape[1]):  # no quadratic goes through fewer than three
                out[row, m] = _quadratic(u, values[lo:hi, m], w, hi - lo)[0] if hi - lo > 2 else values[row, m]


@njit(cache=True, nogil=True)
def _window(frame, a, b, t, half):
    """First and last row, not included, of those of a track within `half` frames of `t`.

    At the ends of a track it reaches farther, to as many as in the middle.
    """
    wide = half
    while True:
        lo = a + np.searchsorted(frame[a:b], t - wide)
        hi = a + np.searchsorted(frame[a:b], t + wide, side="right")
        if hi - lo >= min(2 * half + 1, b - a):
            return lo, hi
        wide += 1.0


@njit(cache=True, nogil=True)
def _slope(u, values):
    """Slope of the least-squares line through points, and the factor by which the noise of a value enters it."""
    off = u - u.mean()
    square = (off * off).sum()
    return (off * values).sum() / square, 1.0 / np.sqrt(square)


@njit(cache=True, nogil=True)
def _quadratic(u, values, w, n):
    """Value and slope at 0 of the weighted quadratic through points, and the factor of noise in the slope."""
    s0 = s1 = s2 = s3 = s4 = 0.0
    y0 = y1 = y2 = 0.0
    for k in range(n):
        p = w[k] * u[k]
        q = p * u[k]
        s0 += w[k]
        s1 += p
        s2 += q
        s3 += q * u[k]
        s4 += q * u[k] * u[k]
        y0 += w[k] * values[k]
        y1 += p * values[k]
        y2 += q * values[k]
    s4 += 1e-9
    # the first two rows of the inverse of the matrix of sums
    a, b, c = s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2
    d, e = s0 * s4 - s2 * s2, s1 * s2 - s0 * s3
    whole = s0 * a + s1 * b + s2 * c
    noise = 0.0
    for k in range(n):
        g = w[k] * (b + d * u[k] + e * u[k] * u[k])
        noise += g * g
    value = (a * y0 + b * y1 + c * y2) / whole
    slope = (b * y0 + d * y1 + e * y2) / whole
    return value, slope, np.sqrt(noise) / np.abs(whole)
