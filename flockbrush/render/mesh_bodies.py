"""Animals drawn with the meshes and poses of their looks, where they are large enough in a picture for legs and wings.

`Meshes` packs the poses of all looks into flat arrays for one kernel; `Postures` says which look, clip and phase each
animal of a picture shows.  Smaller animals are drawn by `sprites` and `body_meshes`, those of the plan by `top_views`.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_looks import CLIPS, DARK, LIGHT, LOOKS, WIDE, mesh_of, poses_of
from flockbrush.render.facets import draw_triangle, lit, pixel, pixel_of
from flockbrush.render.shapes import kernel

LOOK_NAMES = tuple(LOOKS)
FROM = 30.0  # pixels that the mesh of an animal is long or wide; smaller ones have no legs that one could see
NO_LOOK = -1
MOST_POINTS = 160  # of a mesh
MOST = 300  # animals in view in space that a window has time for; of more, nobody has legs
BODY, HEAD, LIMB, WING = 0, 1, 2, 3  # rows of the inks of an animal
PALE = 0.45  # share of the head's colour: of a mesh one sees by its shape where the head is


class Meshes(NamedTuple):
    """The poses of every look, one after another."""

    points: np.ndarray  # (p, 3) float64; body lengths, pose after pose
    # first, poses: (looks, clips) int64; first row in `points` of a clip's first pose, -1 where the look has no such
    # clip; how many poses it has
    first: np.ndarray
    poses: np.ndarray
    corners: np.ndarray  # (looks,) int64; points of one pose
    triangles: np.ndarray  # (t, 3) int64; counted within a pose
    faces: np.ndarray  # (looks + 1,) int64; first triangle of each look
    inks: np.ndarray  # (t,) int64; BODY, HEAD, LIMB or WING
    span: np.ndarray  # (looks, 3); sides of a mesh at rest, body lengths


class Postures(NamedTuple):
    """What the bodies of some animals show, one row each."""

    look: np.ndarray  # (n,) int64; index into `LOOK_NAMES`; `NO_LOOK` for none
    clip: np.ndarray  # (n,) int64; index into `CLIPS`
    phase: np.ndarray  # (n,); 0 to 1 through the clip


@cache
def meshes() -> Meshes:
    """All looks, packed."""
    points, triangles, inks, span = [], [], [], []
    first = np.full((len(LOOK_NAMES), len(CLIPS)), -1, np.int64)
    poses, faces, rows = np.ones_like(first), [0], 0
    for k, name in enumerate(LOOK_NAMES):
        mesh = mesh_of(name)
        for clip, shown in poses_of(name).items():
            first[k, CLIPS.index(clip)], poses[k, CLIPS.index(clip)] = rows, len(shown)
            points.append(shown.reshape(-1, 3))
            rows += shown.shape[0] * shown.shape[1]
        triangles.append(mesh.triangles)
        inks.append(_inks_of(mesh))
        faces.append(faces[-1] + len(mesh.triangles))
        span.append(np.ptp(mesh.points, axis=0))
    corners = np.array([len(mesh_of(name).points) for name in LOOK_NAMES])
    return Meshes(
        np.concatenate(points), first, poses, corners, np.concatenate(triangles).astype(np.int64), np.array(faces),
        np.concatenate(inks), np.array(span),
    )  # fmt: skip


def _inks_of(mesh):
    """Which ink each triangle of a mesh has."""
    kinds = np.array([part.kind for part in mesh.parts] + ["body"])
    corner = mesh.triangles[:, 0]
    shade, wing = mesh.shade[corner], np.isin(kinds[mesh.part[corner]], ("wing",))
    return np.select([wing, shade == LIGHT, shade == DARK], [WING, HEAD, LIMB], BODY).astype(np.int64)


def usual_lengths(herd) -> np.ndarray:
    """(n,) m: the mean body length of those of the same species, or of the same look if no species are given."""
    kind = np.asarray(herd.postures.look if herd.species is None else herd.species, np.int64)
    kind = kind - kind.min(initial=0)
    return (np.bincount(kind, herd.length) / np.maximum(np.bincount(kind), 1))[kind]


def large(herd, long, flat: bool, least=FROM) -> np.ndarray:
    """(n,) bool: who has a look and is large enough for it; `flat` from above.

    `long` (n,) are the pixels of the usual body length where each is, so that of a species all at one distance have
    legs or none: half a herd without would look like another species.
    """
    look = herd.postures.look
    known = look >= 0
    if not known.any() or not (long > least / 4).any():  # nobody is more than four lengths wide or high
        return known & False
    sides = meshes().span[np.maximum(look, 0)]
    across = np.maximum(sides[:, 0], sides[:, 1] * (2 * herd.radius / (WIDE * herd.length)))
    return known & ((across if flat else np.maximum(across, sides[:, 2])) * long >= least)


@kernel
def pose(body, meshes, posture, size, wide):
    """Corners (MOST_POINTS, 3) of a mesh in a posture, m in its own axes, between two poses kept; how many."""
    look, way, phase = posture
    count, start, poses = meshes.corners[look], meshes.first[look, way], meshes.poses[look, way]
    if start < 0:
        start, poses = meshes.first[look, 0], 1  # at rest
    at = (phase % 1.0) * poses
    one = int(at) % poses
    other, share = (one + 1) % poses, at - int(at)
    for k in range(count):
        for c in range(3):
            a, b = meshes.points[start + one * count + k, c], meshes.points[start + other * count + k, c]
            body[k, c] = size * (a + (b - a) * share)
        body[k, 1] *= wide
    return count


@kernel
def draw_mesh(buffer, cam, meshes, posture, at, size, wide, ink, near, sun):
    """Draw one animal with its mesh, far triangles first.

    Parameters
    ----------
    posture : (look, clip, phase)
    at : SpacePose
        Of the mesh's origin.
    size, wide : float
        Metres of a body length; by how much more its width is stretched.
    ink : (4, 3)
        Colours of body, head, limbs and wings.
    near : float
        1 / m, as `draw_triangle` wants it.
    sun : (3,)
        Unit vector to the light.
    """
    body, seen, axes = np.empty((MOST_POINTS, 3)), np.empty((MOST_POINTS, 3)), at.axes
    for k in range(pose(body, meshes, posture, size, wide)):
        seen[k, 0], seen[k, 1], seen[k, 2] = pixel_of(cam, at, body[k, 0], body[k, 1], body[k, 2])
    _draw_faces(buffer, meshes, posture[0], body, seen, axes @ sun, axes[:, 2].copy(), ink, near)


@kernel
def _draw_faces(buffer, meshes, look, body, seen, light, lift, ink, near):
    """The triangles that face the eye, in the light; `light` and `lift` are the sun and the zenith in body axes."""
    first, last = meshes.faces[look], meshes.faces[look + 1]
    far, shown, met = np.empty(last - first), np.empty(last - first, np.int64), 0
    for t in range(first, last):
        a, b, c = meshes.triangles[t]
        turn = (seen[b, 0] - seen[a, 0]) * (seen[c, 1] - seen[a, 1])
        turn -= (seen[b, 1] - seen[a, 1]) * (seen[c, 0] - seen[a, 0])
        if turn < 0:  # y is down: who goes round to the left outside goes round to the right here
            far[met], shown[met] = -(seen[a, 2] + seen[b, 2] + seen[c, 2]), t
            met += 1
    order = np.argsort(far[:met])
    for k in order:
        t = shown[k]
        a, b, c = meshes.triangles[t]
        ux, uy, uz = body[b, 0] - body[a, 0], body[b, 1] - body[a, 1], body[b, 2] - body[a, 2]
        vx, vy, vz = body[c, 0] - body[a, 0], body[c, 1] - body[a, 1], body[c, 2] - body[a, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        size = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
        facing = (nx * light[0] + ny * light[1] + nz * light[2]) / size
        upward = (nx * lift[0] + ny * lift[1] + nz * lift[2]) / size
        shine = 0.64 + 0.10 * upward + (0.40 * facing if facing > 0 else 0.10 * facing)
        colour = lit(ink, meshes.inks[t], shine)
        draw_triangle(buffer, pixel(seen, a), pixel(seen, b), pixel(seen, c), near, colour)


@kernel
def mesh_inks(ink, colours, yellow):
    """Inks (4, 3) of an animal from its look's `colours` (7, 3); of leaders that wear their colour, `yellow`."""
    for c in range(3):
        skin = colours[3, c] if yellow else colours[0, c]
        ink[BODY, c] = skin
        ink[HEAD, c] = skin + (colours[1, c] - skin) * PALE
        ink[LIMB, c] = skin + (colours[2, c] - skin) * 0.8
        ink[WING, c] = 0.92 * skin
