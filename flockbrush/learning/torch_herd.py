"""The forces of the herd model in torch: the formulas of `flockbrush.behaviours.models.herd`, with gradients.

Equal to `herd_kernel` (a test holds them together), in float64, over all visible pairs at once.  Who sees whom is
given (`flockbrush.learning.perceive`) and constant.  The next heading is N(h + dt Ω F) with the unit heading h: dt and
Ω are those of a run, in the loss and in the simulation alike (eqs. 2-5 of [1]_).

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
"""

from __future__ import annotations

from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import torch

from flockbrush.learning.perceive import Percept

DT = 1 / 32  # s, the tick of a level
SENSITIVITY = 10.0  # 1/s, Ω of the paper
REACH = 4.0  # BL, neighbours farther away are ignored; also what a radial range of 1 stands for
AVOIDANCE, COHESION, ALIGNMENT, OBSTACLE = range(4)  # rows of theta as (4, 3)


class TorchPercept(NamedTuple):
    """A `Percept` as tensors, by pairs: what does not change while parameters are learned."""

    forward: torch.Tensor  # (n, 2)
    leader: torch.Tensor  # (n,) bool
    i: torch.Tensor  # (m,) observers
    j: torch.Tensor  # (m,) neighbours within range
    offset: torch.Tensor  # (m, 2) BL
    distance2: torch.Tensor  # (m,) BL²
    walls_i: torch.Tensor  # (k,)
    walls: torch.Tensor  # (k, 2) BL
    memory: torch.Tensor  # (n, 2)
    known: torch.Tensor  # (n,) bool


def device_of(name=None):
    """The device for computing; default: a CUDA device if there is one."""
    if name is None or name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    return torch.device(name)


@contextmanager
def threads(count):
    """At most so many threads of torch inside; several starts run side by side, and each must leave the others room."""
    before = torch.get_num_threads()
    torch.set_num_threads(max(1, int(count)))
    try:
        yield
    finally:
        torch.set_num_threads(before)


def missing_device(name) -> str:
    """Why there is no such device here; "" where there is."""
    if not str(name).startswith("cuda"):
        return ""
    count, number = torch.cuda.device_count(), int(name.partition(":")[2] or 0)
    if number < count:
        return ""
    return f"there is no {name} here: torch finds {count} graphics cards; use --device auto or cpu"


def sight_of(percept: Percept, neighbour_range=REACH, device=None) -> TorchPercept:
    """The tensors of a percept."""
    at = device_of(device)
    i, j, offset = percept.observer, percept.near.astype(np.int64), percept.offset
    near = (offset**2).sum(1) <= neighbour_range**2
    if not near.all():
        i, j, offset = i[near], j[near], offset[near]

    def tensor(values, dtype=torch.float64):
        return torch.as_tensor(np.ascontiguousarray(values), dtype=dtype, device=at)

    return TorchPercept(
        tensor(percept.forward), tensor(percept.leader, torch.bool), tensor(i, torch.int64), tensor(j, torch.int64),
        tensor(offset), tensor((offset**2).sum(1)), tensor(percept.walls_observer, torch.int64),
        tensor(percept.walls_offset), tensor(percept.memory), tensor(percept.known, torch.bool),
    )  # fmt: skip


def theta_tensor(theta, device=None, requires_grad=False):
    """The twelve numbers as a tensor (12,), in the order of `flockbrush.learning.rollout.NAMES`."""
    values = torch.as_tensor(np.array(theta, float), dtype=torch.float64, device=device_of(device))
    return values.requires_grad_(requires_grad)


def bearing2(offset, forward):
    """Squares of the angles between offsets and headings, rad²; 0 for an offset of 0."""
    x, y = offset.unbind(-1)
    fx, fy = forward.unbind(-1)
    nowhere = (x == 0) & (y == 0)
    ahead = torch.where(nowhere, torch.ones_like(x), fx * x + fy * y)
    return torch.atan2(fx * y - fy * x, ahead) ** 2


def forces(theta, sight: TorchPercept, forward=None, others=None):
    """The weighted sum of the four forces (eqs. 3-5) without Ω, (n, 2).

    Parameters
    ----------
    theta : (12,) tensor
    forward : (n, 2) tensor, optional
        Headings other than those of ``sight``, for instance with a gradient.
    others : (n, 2) tensor, optional
        What the neighbours' headings are, if not ``forward``.
    """
    forward = sight.forward if forward is None else forward
    others = forward if others is None else others
    weight, radial, angular = theta.reshape(4, 3).unbind(1)
    radial, angular = 0.5 / (REACH * radial) ** 2, 0.5 / (torch.pi * angular) ** 2
    bearing = bearing2(sight.offset, forward[sight.i])

    def weigh(kind, distance2, bearing):  # eq. 4
        return weight[kind] * torch.exp(-(distance2 * radial[kind] + bearing * angular[kind]))

    avoid, join, align = (weigh(kind, sight.distance2, bearing) for kind in (AVOIDANCE, COHESION, ALIGNMENT))
    # eq. 5; d u is the offset itself
    pairs = (join - avoid)[:, None] * sight.offset + align[:, None] * others[sight.j]
    total = torch.zeros_like(forward).index_add(0, sight.i, pairs)
    if len(sight.walls):
        w = weigh(OBSTACLE, (sight.walls**2).sum(1), bearing2(sight.walls, forward[sight.walls_i]))
        total = total.index_add(0, sight.walls_i, -w[:, None] * sight.walls)
    return total


def headings(theta, sight: TorchPercept, dt=DT, *, sensitivity=SENSITIVITY, forward=None, others=None):
    """The next unit heading of every animal (eqs. 2-5), (n, 2): what `herd_kernel` gives where nobody is guided.

    Leaders return to where they last saw others.

    Parameters
    ----------
    theta : (12,) tensor
    dt : float
        Seconds to a tick.
    sensitivity : float or tensor
        Ω, 1/s.
    forward : (n, 2) tensor, optional
        Headings other than those of ``sight``.
    others : (n, 2) tensor, optional
        What the neighbours' headings are, if not ``forward``.
    """
    forward = sight.forward if forward is None else forward
    turn = dt * sensitivity
    heading = forward + turn * forces(theta, sight, forward, others)
    far = torch.linalg.vector_norm(sight.memory, dim=1, keepdim=True)
    back = (sight.leader & sight.known)[:, None] & (far > 1.0)
    heading = torch.where(back, heading + turn * 0.3 * sight.memory / torch.clamp(far, min=1.0), heading)
    return _unit_or(heading, forward)


def _unit_or(vectors, otherwise):
    """Unit vectors; where there is no direction, the other one."""
    size2 = (vectors**2).sum(1, keepdim=True)
    fine = size2 > 1e-24
    return torch.where(fine, vectors / torch.sqrt(torch.where(fine, size2, torch.ones_like(size2))), otherwise)
