"""What models see on a plane without a world: the `Scene` of animals of one kind, one body length long."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.behaviour import Scene, frozen


def plane_scene(*, ids, forward, speed, seen, walls, **more) -> Scene:
    """A scene on open ground without guides, dangers, slopes and memories.

    Parameters
    ----------
    ids : (n,) int ndarray
    forward : (n, 3) ndarray
        Unit headings.
    speed : (n,) ndarray
        BL/s, of the speed process.
    seen : Lists
        Neighbours, offsets (m, 2) BL.
    walls : (ndarray, ndarray)
        The nearest points of obstacles: first (n + 1,) and offset (j, 2) BL.
    **more
        Other fields of `Scene`: ``dt``, ``tick``, ``key`` and ``velocity`` at least.
    """
    n = len(ids)
    nothing, flat, nobody = np.zeros(n, np.uint8), np.zeros((n, 2)), np.zeros(n, np.int32)
    plain = {
        "xyz": np.zeros((n, 3)), "effort": np.ones(n), "length": np.ones(n), "leader": nothing, "species": nobody,
        "danger": nothing, "guidance": flat, "slope": flat, "memory": flat, "known": nothing,
        "order": np.arange(n, dtype=np.int32),
    }  # fmt: skip
    first, near, offset = seen
    return Scene(
        ids=ids, forward=forward, speed=speed, first=first, near=near, offset=offset, obstacle_first=walls[0],
        obstacle_offset=walls[1], **{**plain, **more},
    )  # fmt: skip


def wishes_on_plane(herd, order, lists, walls):
    """What the model of a `flockbrush.learning.rollout.PlaneHerd` wishes: directions (n, 3) and paces (n,).

    Parameters
    ----------
    order : (n,) int32 ndarray
        Rows in spatial order.
    lists : Lists
        Whom the animals see.
    walls : (ndarray, ndarray)
        As for `plane_scene`.
    """
    n, guide = len(herd.ids), herd.guide
    scene = plane_scene(
        dt=herd.dt, tick=herd.tick_number, key=lambda stream, tick=herd.tick_number: herd.noise.key(stream, tick),
        ids=herd.ids, xyz=herd.xyz, velocity=np.hstack([herd.velocity, np.zeros((n, 1))]), forward=herd.forward,
        speed=herd.drawn, effort=herd.effort, order=order, seen=lists, walls=walls, leader=herd.leader,
        known=herd.known, memory=herd.memory - herd.xyz[:, :2],
        guidance=np.zeros((n, 2)) if guide is None else guide.at(herd.time, herd.xyz[:, :2]),
    )  # fmt: skip
    with herd.model.blaming():
        wishes = herd.model.steer(frozen(scene), np.arange(n, dtype=np.int32), herd.params)
    return wishes.direction, wishes.pace
