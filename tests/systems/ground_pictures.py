"""Maps small enough to draw, for tests of fields."""

import numpy as np

EAST = (1.0, 0.0)


def ground(picture):
    """A map of blocked cells (#) from a picture with the north at the top."""
    return np.array([[c == "#" for c in line] for line in picture.split()[::-1]])


def free(ny, nx):
    return np.zeros((ny, nx), bool)


def guide(points, strength=1.0, radius=5.0, decay=2.0, loop=False):
    return np.array(points, float), strength, radius, decay, loop


def lengths(field):
    return np.hypot(field[..., 0], field[..., 1])


def one_cell(shape, iy, ix):
    mask = np.zeros(shape, bool)
    mask[iy, ix] = True
    return mask


def random_ground(seed, shape=(24, 31), share=0.3):
    return np.random.default_rng(seed).random(shape) < share


def leads_into_a_wall(field, blocked):
    """Cells whose field, followed for up to a cell's length from the centre, comes into a blocked cell."""
    iy, ix = np.nonzero(~blocked & (lengths(field) > 0))
    ahead = field[iy, ix] / lengths(field)[iy, ix, None]
    bad = np.zeros(len(iy), bool)
    for t in np.linspace(0.05, 1.0, 20):
        x, y = np.floor(ix + 0.5 + t * ahead[:, 0]).astype(int), np.floor(iy + 0.5 + t * ahead[:, 1]).astype(int)
        inside = (x >= 0) & (y >= 0) & (x < blocked.shape[1]) & (y < blocked.shape[0])
        bad[inside] |= blocked[y[inside], x[inside]]
    return int(bad.sum())
