"""Bodies as joints for tools with skeletons or nodes: where joints are, and how they stand in a clip."""

from __future__ import annotations

import numpy as np

from flockbrush.render.animal_looks import bob, joint, mesh_of


def pivot(mesh, k):
    """Where joint k turns, body lengths; -1 is the body."""
    return (0.0, 0.0, 0.0) if k < 0 else mesh.parts[k].pivot


def offsets(mesh):
    """(joints, 3): where each joint is from its parent."""
    numbers = {part.name: k for k, part in enumerate(mesh.parts)}
    offsets = [np.zeros(3)]
    for part in mesh.parts:
        offsets.append(np.subtract(part.pivot, pivot(mesh, numbers.get(part.parent, -1))))
    return np.array(offsets)


def posture(look, clip, phase):
    """(translations (j, 3), quaternions (j, 4) w first, scales (j, 3)) of the joints of a look, the body first."""
    mesh = mesh_of(look)
    places, turns, scales = offsets(mesh), np.tile([1.0, 0, 0, 0], (len(mesh.parts) + 1, 1)), np.ones((1, 3))
    moved = [joint(mesh, part, clip, phase) for part in mesh.parts]
    if moved:
        turns[1:] = [turn for turn, _ in moved]
        scales = np.vstack([scales, [scale for _, scale in moved]])
    stands = -mesh.points[:, 2].min() if mesh.strides and clip in ("rest", "walk", "run") else 0.0
    rise = bob(mesh, clip, phase)
    places[0, 2] += stands + rise
    for k, part in enumerate(mesh.parts):
        if part.kind == "leg":
            places[k + 1, 2] -= rise  # feet stay on the ground while the body goes up and down
    return places, turns, scales
