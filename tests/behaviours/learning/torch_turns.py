"""The turns of a body in torch, for comparison with the kernels: aside from those it touches, and limited."""

from typing import NamedTuple

import numpy as np
import torch
from flockbrush.systems.contact import DEFLECT, SKIN, nearest_of_segments_

from flockbrush.learning.perceive import Percept
from flockbrush.learning.torch_herd import DT, SENSITIVITY, TorchPercept, _unit_or, device_of, headings


class Contacts(NamedTuple):
    """Bodies so near that they turn a heading aside (`flockbrush.systems.contact`), by turn: the k-th one of every
    animal."""

    i: list[torch.Tensor]  # of rows (c,), one tensor for each k
    normal: list[torch.Tensor]  # (c, 2) unit vectors towards the other body
    share: list[torch.Tensor]  # (c,) of the heading into it that is taken away


def contacts_of(percept: Percept, half, radius, device=None) -> Contacts:
    """Who touches whom, nearly; capsules of half axis ``half`` and ``radius``, BL."""
    at = device_of(device)
    by_turn: dict = {}
    touch = 2.0 * radius
    far = (1.0 + SKIN) * touch + 2.0 * half
    close = np.flatnonzero((percept.offset**2).sum(1) < far * far)
    rows = percept.observer
    seen: dict = {}
    for m in close:
        i, j = rows[m], percept.near[m]
        f, g = percept.forward[i], percept.forward[j]
        ox, oy = nearest_of_segments_(0.0, 0.0, f[0], f[1], half, *percept.offset[m], g[0], g[1], half)
        d = float(np.hypot(ox, oy))
        room = DEFLECT * (1.0 - (d - touch) / (SKIN * touch))
        if d > 1e-12 and room > 0.0:
            seen[i] = seen.get(i, -1) + 1
            by_turn.setdefault(seen[i], []).append((i, ox / d, oy / d, min(room, DEFLECT)))
    columns = [np.array(by_turn[k]).T for k in sorted(by_turn)]
    return Contacts(
        [torch.as_tensor(c[0], dtype=torch.int64, device=at) for c in columns],
        [torch.as_tensor(c[1:3].T.copy(), device=at) for c in columns],
        [torch.as_tensor(c[3].copy(), device=at) for c in columns],
    )


def turned(forward, wish, limit, contacts: Contacts | None = None):
    """The heading that a body really takes: aside from bodies it touches, and no faster than ``limit`` rad."""
    heading = wish
    if contacts is not None:
        for i, normal, share in zip(*contacts, strict=True):
            into = (heading[i] * normal).sum(1)
            heading = heading.index_add(0, i, -(share * torch.clamp(into, min=0.0))[:, None] * normal)
        heading = _unit_or(heading, forward)
    if limit >= np.pi:
        return heading
    angle = angle_between(forward, heading)
    too_far = angle.abs() > limit
    return torch.where(too_far[:, None], rotated(forward, torch.sign(angle) * limit), heading)


def angle_between(a, b):
    """Signed angles from a to b, counter-clockwise, rad."""
    return torch.atan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(1))


def rotated(vectors, angle):
    """Vectors turned counter-clockwise by angles, rad."""
    sine, cosine = torch.sin(angle), torch.cos(angle)
    x, y = vectors.unbind(1)
    return torch.stack([cosine * x - sine * y, sine * x + cosine * y], 1)


def heading_rollout(theta, sight: TorchPercept, ticks, *, contacts=None, limit=np.inf, sensitivity=SENSITIVITY, dt=DT):
    """By how much everybody turns in some ticks, (n,) rad, while neighbours stay where they are."""
    forward, total, left = sight.forward, torch.zeros_like(sight.forward[:, 0]), float(ticks)
    while left > 1e-9:
        wish = headings(theta, sight, dt, sensitivity=sensitivity, forward=forward, others=sight.forward)
        ahead = turned(forward, wish, limit * dt if np.isfinite(limit) else np.inf, contacts)
        total = total + min(left, 1.0) * angle_between(forward, ahead)
        forward, left = ahead, left - 1.0
    return total
