"""Algorithm 3 of Lin's thesis [1]_: depths frame by frame, found by COBYLA between the near and the far bound.

It is fast for five birds, keeps every bird on its ray and within the bounds, and gives plausible flights. It does not
recover depth: its energy is lower for constant depth than for the true flight. Use `flockbrush.lifting.lift_solver` to
estimate depth.

Where the thesis leaves a choice: frame 1 starts at the middle of the range; frame 2 uses the flock term as well (with
the initial speed alone there are two solutions, towards and away from the camera); differences of velocities are
vectors; terms are squared; cohesion is divided by the number of other birds; without a neighbour there is no
separation.

.. [1] Lin, C.-A. (2019). Predicting 3D bird flock motion from 2D projection. Master's thesis, The University of Tokyo.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from flockbrush.lifting.lens import Camera
from flockbrush.lifting.lift_solver import LiftedFlight, LiftError, LiftWish, prepared

TOLERANCE = 1e-4  # of the depths, relative, where COBYLA stops
PLAUSIBLE = "these depths look plausible but are not measurements: the energy of the thesis does not favour true depths"
MOST = 200  # evaluations for each bird of a frame


def lift_by_thesis(tracks, camera: Camera, wish: LiftWish | None = None) -> LiftedFlight:
    """The flight of a flock by Algorithm 3.

    Parameters
    ----------
    tracks : Tracks
        Pixels.
    camera : Camera
    wish : LiftWish, optional
        Weights; ``evenness`` is not used.

    Returns
    -------
    LiftedFlight
        Positions in metres, in the axes of the camera.

    Raises
    ------
    LiftError
        When there is nothing to lift, or the package `nlopt` is not installed.
    """
    try:
        import nlopt
    except ImportError:
        raise LiftError("the thesis' method needs the package nlopt:  pip install nlopt") from None
    wish = wish or LiftWish()
    sight = prepared(tracks, camera)
    rays, there = sight.rays, sight.there
    depth = np.full(there.shape, np.nan)
    step = camera.mean_speed / camera.fps  # m a frame
    weights = np.array([wish.smoothness, wish.flock, min(wish.separation, 1.0), wish.separation_distance, step], float)
    for f in range(len(rays)):
        birds = np.flatnonzero(there[f])
        if len(birds):
            depth[f, birds] = _frame(nlopt, f, birds, rays, depth, camera, weights)
    notes = [*sight.notes, PLAUSIBLE]
    return LiftedFlight(
        depth[..., None] * rays, depth, tracks.ids, sight.frames, camera.fps, sight.stiffness, sight.noise, notes
    )


def _frame(nlopt, f, birds, rays, depth, camera, weights):
    """Depths of the birds of one frame, m, from those of the two frames before."""
    middle = 0.5 * (camera.near + camera.far)
    before = depth[f - 1, birds] if f else np.full(len(birds), np.nan)
    known = np.isfinite(before)
    if not known.any():
        return np.full(len(birds), middle)
    start = np.clip(np.where(known, before, np.nanmean(before)), camera.near, camera.far)
    last = depth[f - 1, birds, None] * rays[f - 1, birds]
    earlier = depth[f - 2, birds, None] * rays[f - 2, birds] if f > 1 else np.full_like(last, np.nan)
    ray = np.ascontiguousarray(rays[f, birds])
    solver = nlopt.opt(nlopt.LN_COBYLA, len(birds))
    solver.set_lower_bounds(np.full(len(birds), camera.near))
    solver.set_upper_bounds(np.full(len(birds), camera.far))
    solver.set_min_objective(lambda d, _: energy(d, ray, last, earlier, weights))
    solver.set_initial_step(0.5 * weights[4])
    solver.set_xtol_abs(TOLERANCE * middle)
    solver.set_maxeval(MOST * len(birds))
    try:
        return solver.optimize(start)
    except (nlopt.RoundoffLimited, RuntimeError):  # the last digits: where it stands is good enough
        return start


@njit(cache=True, nogil=True)
def energy(d, ray, last, earlier, weights):
    """The energy that Algorithm 3 minimises in each frame.

    Parameters
    ----------
    d : (n,) ndarray
        Depths, m.
    ray : (n, 3) ndarray
        Unit vectors.
    last, earlier : (n, 3) ndarray
        Positions one and two frames before, m; NaN for birds that were missing.
    weights : (5,) ndarray
        λ_t, λ_f, w_sep, d_sep (m) and the initial speed (m per frame).

    Returns
    -------
    float
    """
    n = len(d)
    smooth, flock, w_sep, d_sep, step = weights
    b = d.reshape(n, 1) * ray
    total = 0.0
    for i in range(n):
        if not np.isfinite(last[i, 0]):
            continue
        v = b[i] - last[i]
        if np.isfinite(earlier[i, 0]):
            change = v - (last[i] - earlier[i])
            total += smooth * (change * change).sum()
        else:
            total += (np.sqrt((v * v).sum()) - step) ** 2
        separation, cohesion = np.zeros(3), np.zeros(3)
        near = 0
        for j in range(n):
            if j == i:
                continue
            way = b[i] - b[j]
            gap = np.sqrt((way * way).sum())
            if gap <= d_sep and gap > 0.0:
                near += 1
                separation += way / gap
            cohesion -= way
        if near:
            separation /= near
        if n > 1:
            cohesion /= n - 1
        off = b[i] - (last[i] + w_sep * separation + (1.0 - w_sep) * cohesion)
        total += flock * (off * off).sum()
    return total
