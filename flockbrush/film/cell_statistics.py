"""Statistics of animals in the cells of a grid: what pictures, tracks and simulated herds are compared by."""

from __future__ import annotations

import numpy as np


def cell_statistics(flat, forward, velocity, shape) -> dict[str, np.ndarray]:
    """Number of animals, means and variances of speed and direction in each cell of each frame.

    Parameters
    ----------
    flat : ndarray (n,) of int
        Cell of each animal: its index in a flat array of `shape`.
    forward : ndarray (n, 2)
        Unit vectors of heading.
    velocity : ndarray (n, 2)
        m/s.
    shape : tuple of int
        (frames, ny, nx).

    Returns
    -------
    dict
        ``number``, ``speed`` (m/s), ``speed_variance`` and ``angular_variance`` (degrees squared) of that shape,
        ``velocity`` of shape (frames, ny, nx, 2).  NaN where a cell is empty.
    """
    size = int(np.prod(shape))
    number = np.bincount(flat, minlength=size)
    some = np.where(number > 0, number, np.nan)

    def mean(values):
        return np.bincount(flat, values, size) / some

    speed = np.hypot(*velocity.T)
    mx, my = mean(forward[:, 0])[flat], mean(forward[:, 1])[flat]
    cross, dot = mx * forward[:, 1] - my * forward[:, 0], mx * forward[:, 0] + my * forward[:, 1]
    off = np.degrees(np.abs(np.arctan2(cross, dot)))
    cells = {
        "number": number.astype(float),
        "velocity": np.column_stack([mean(velocity[:, 0]), mean(velocity[:, 1])]),
        "speed": mean(speed),
        "speed_variance": np.maximum(mean(speed**2) - mean(speed) ** 2, 0.0),
        "angular_variance": np.maximum(mean(off**2) - mean(off) ** 2, 0.0),
    }
    return {name: values.reshape(*shape, *values.shape[1:]) for name, values in cells.items()}
