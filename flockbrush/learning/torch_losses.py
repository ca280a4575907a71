"""How unlike a clip a herd is, with gradients: the errors of the paper [1]_ and turns over several ticks.

Eqs. 7, 8, 10 and 11 compare animals with the fields of a clip at the places where they are.  Where animals were told
apart, their turns say more (`flockbrush.learning.turns`).  All are means over followers, so that they do not grow with
the herd.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Section 6.1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

CHANCE = 2700.0  # degrees², the variance of an unsigned angle that may be any: 180² / 12
ALONE = 3000.0  # degrees², what the paper takes for animals of a photograph that lie any way (section 7.2.4)


class Aims(NamedTuple):
    """What a clip asks of the animals of a herd in one frame, animal by animal."""

    direction: torch.Tensor  # (n, 2) N(U), eq. 11; 0 where the clip asks for nothing
    asked: torch.Tensor  # (n,) bool, where it asks for something
    variance: torch.Tensor  # (n,) degrees², S; NaN unknown
    cell: torch.Tensor  # (n,) number of the cell or block of cells; -1 outside


def density_of(xy, fields):
    """Animals a BL² in each cell of a grid, (ny, nx)."""
    row, column, inside = fields.cells_of(xy)
    number = np.zeros(fields.shape)
    np.add.at(number, (row[inside], column[inside]), 1.0)
    return number / fields.cell**2


def towards_density(simulated, target, cell):
    """D = -∇(ρ' - ρ), where to go so that the density becomes the clip's (eq. 10), (ny, nx, 2)."""
    difference = np.where(np.isfinite(target), simulated - target, 0.0)
    down = [np.gradient(difference, cell, axis=a) if difference.shape[a] > 1 else 0.0 * difference for a in (1, 0)]
    return -np.stack(down, axis=-1)


def aims(fields, t, xy, beta, device=None, block=1) -> Aims:
    """What frame t of a clip asks of animals at these places.

    Parameters
    ----------
    xy : (n, 2) ndarray
        BL.
    beta : float
        How much density counts against velocity (eq. 11); 0 leaves it out.
    block : int
        Cells along a side that are taken together where disorder is measured: alone in a cell nobody is disorderly.
    """
    row, column, inside = fields.cells_of(xy)
    velocity = _units(np.nan_to_num(fields.velocity[t, row, column]))
    where = np.zeros_like(velocity)
    if beta > 0.0:
        where = _units(towards_density(density_of(xy, fields), fields.density[t], fields.cell)[row, column])
    wish = np.where(inside[:, None], beta * where + (1.0 - beta) * velocity, 0.0)
    direction = _units(wish)
    variance = np.where(inside, fields.angular_variance[t, row, column], np.nan)
    cell = np.where(inside, row // block * fields.shape[1] + column // block, -1)

    def tensor(values):
        return torch.as_tensor(values, device=device)

    return Aims(tensor(direction), tensor(np.hypot(*direction.T) > 0.5), tensor(variance), tensor(cell))


def _units(vectors):
    size = np.hypot(vectors[..., 0], vectors[..., 1])[..., None]
    return np.where(size > 1e-12, vectors / np.maximum(size, 1e-12), 0.0)


def error_mean(heading, aim: Aims, follows):
    """How far headings are from where the clip asks them to be (eq. 7), a follower; 0 without any.

    ``follows`` (n,) bool: leaders are left out.
    """
    counted = follows & aim.asked
    if not bool(counted.any()):
        return heading.sum() * 0.0
    off2 = ((heading - aim.direction)[counted] ** 2).sum(1)
    return torch.sqrt(off2 + 1e-12).mean()


def variance_by_animal(heading, cell, cells):
    """The variance of the unsigned angles to the mean heading of one's cell, degrees² (n,); and how many are there."""
    inside = cell >= 0
    at = torch.where(inside, cell, torch.full_like(cell, cells))
    one = torch.ones_like(heading[:, 0])

    def mean_by_cell(values):
        shape = (cells + 1, *values.shape[1:])
        return torch.zeros(shape, dtype=values.dtype, device=values.device).index_add(0, at, values)

    number = mean_by_cell(one)[at]
    mean = mean_by_cell(heading)[at] / number[:, None]
    cross = heading[:, 0] * mean[:, 1] - heading[:, 1] * mean[:, 0]
    angle = torch.rad2deg(torch.atan2(torch.sqrt(cross**2 + 1e-18), (heading * mean).sum(1)))
    middle = mean_by_cell(angle)[at] / number
    return mean_by_cell((angle - middle) ** 2)[at] / number, number


def error_var(heading, aim: Aims, follows, cells):
    """How far the disorder of each animal's cell is from the clip's (eq. 8), a follower, in parts of chance (2700).

    Cells with a single animal say nothing of disorder.
    """
    variance, number = variance_by_animal(heading, aim.cell, cells)
    counted = follows & (aim.cell >= 0) & (number > 1.5) & torch.isfinite(aim.variance)
    if not bool(counted.any()):
        return heading.sum() * 0.0
    return (variance - torch.nan_to_num(aim.variance))[counted].abs().mean() / CHANCE
