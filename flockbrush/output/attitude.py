"""Orientation of bodies in 3D, from heading and up vector: angles, matrices, quaternions."""

from __future__ import annotations

import numpy as np

from flockbrush.render.body_meshes import standing
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape

LEVEL = 1e-6


def back_of(forward, up=None):
    """Up vectors (n, 3), perpendicular to the headings: the given ones, or upright."""
    forward = np.asarray(forward, float)
    upright = standing(forward)
    if up is None:
        return upright
    up = np.asarray(up, float)
    up = up - (up * forward).sum(1)[:, None] * forward
    size = np.linalg.norm(up, axis=1)
    return np.where(size[:, None] > LEVEL, up / np.maximum(size, LEVEL)[:, None], upright)


def angles_of(forward, up=None):
    """(yaw, pitch, roll) in rad: counter-clockwise from east, upwards, right wing down; (n,) each."""
    forward = np.asarray(forward, float)
    back, upright = back_of(forward, up), standing(forward)
    right = np.cross(forward, upright)
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    pitch = np.arcsin(np.clip(forward[:, 2], -1, 1))
    return yaw, pitch, np.arctan2((back * right).sum(1), (back * upright).sum(1))


def axes_of(forward, up=None):
    """(n, 3, 3): the columns are ahead, left and up."""
    forward = np.asarray(forward, float)
    back = back_of(forward, up)
    return np.stack([forward, np.cross(back, forward), back], axis=-1)


def quaternions(matrices):
    """Unit quaternions (n, 4), w first, of rotations (n, 3, 3)."""
    m = np.asarray(matrices, float)
    w = np.sqrt(np.maximum(1 + m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2], 0)) / 2
    x = np.sqrt(np.maximum(1 + m[:, 0, 0] - m[:, 1, 1] - m[:, 2, 2], 0)) / 2
    y = np.sqrt(np.maximum(1 - m[:, 0, 0] + m[:, 1, 1] - m[:, 2, 2], 0)) / 2
    z = np.sqrt(np.maximum(1 - m[:, 0, 0] - m[:, 1, 1] + m[:, 2, 2], 0)) / 2
    best = np.argmax([w, x, y, z], axis=0)
    quaternions = np.empty((len(m), 4))
    for k, biggest in enumerate((w, x, y, z)):
        rows = best == k
        quaternions[rows] = _from(m[rows], k, biggest[rows])
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


def _from(m, k, biggest):
    """Quaternions, computed from the largest component."""
    a, b, c = m[:, 2, 1] - m[:, 1, 2], m[:, 0, 2] - m[:, 2, 0], m[:, 1, 0] - m[:, 0, 1]
    xy, xz, yz = m[:, 0, 1] + m[:, 1, 0], m[:, 0, 2] + m[:, 2, 0], m[:, 1, 2] + m[:, 2, 1]
    f = 0.25 / biggest
    rows = ((biggest, a * f, b * f, c * f), (a * f, biggest, xy * f, xz * f), (b * f, xy * f, biggest, yz * f),
            (c * f, xz * f, yz * f, biggest))  # fmt: skip
    return np.column_stack(rows[k])


def held(simulation, moment):
    """(forward, up), (n, 3) unit vectors each, of the bodies of a moment: flyers bank, walkers follow the slope."""
    forward, up = np.asarray(moment.forward, float).copy(), back_of(moment.forward, moment.up)
    land = land_of(simulation)
    if land is None or land.relief.shape[:2] == (1, 1):
        return forward, up
    x, y, z = moment.xyz.T
    slope = np.stack([heights_of_ground(_layer(land, k), moment.xyz) for k in (0, 1, 2)], axis=-1)
    walks = np.abs(z - slope[:, 0]) < 0.5 * moment.length
    normal = np.column_stack([-slope[:, 1], -slope[:, 2], np.ones(len(x))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = forward - (forward * normal).sum(1)[:, None] * normal
    size = np.linalg.norm(along, axis=1)
    walks &= size > LEVEL
    forward[walks], up[walks] = along[walks] / size[walks, None], normal[walks]
    return forward, up


class AttitudeTurns:
    """Orientations that stay in the same hemisphere from frame to frame."""

    def __init__(self, simulation):
        self.simulation = simulation
        self._ids, self._last = np.zeros(0, np.int64), np.zeros((0, 4))

    def of(self, moment):
        """Unit quaternions (n, 4), w first, that turn +X to where animals look and +Z out of their backs."""
        now = quaternions(axes_of(*held(self.simulation, moment)))
        _, old, new = np.intersect1d(self._ids, moment.ids, assume_unique=True, return_indices=True)
        now[new[(now[new] * self._last[old]).sum(1) < 0]] *= -1
        self._ids, self._last = moment.ids, now
        return now


def _layer(land, k):
    """`Heights` with one number of the relief where the heights are."""
    return land.heights._replace(relief=np.ascontiguousarray(np.repeat(land.relief[..., k : k + 1], 3, axis=2)))


def land_of(simulation):
    """The landscape; None for objects that only imitate a simulation."""
    from flockbrush.levels.build import Simulation

    return simulation.world.resource(Landscape) if isinstance(simulation, Simulation) else None
