"""Animals as little bodies in space: birds with wings that beat and bank, beasts on four legs.

A body is a handful of triangles in its own axes (ahead, left, up; one body length is 1), lit by the sun and drawn from
back to front; nothing is kept from frame to frame.  `far_bodies` draws those of a few pixels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_figures import KINDS, LEADER, NO_WINGS, WINGSPAN
from flockbrush.render.animal_looks import WIDE
from flockbrush.render.facets import SpacePose, deep, draw_triangle, haze_at, lit, pixel, pixel_of
from flockbrush.render.far_bodies import BACK, BEATS, BELLY, FarBody, draw_far_beast, draw_far_bird, step_of
from flockbrush.render.gaits import sizes
from flockbrush.render.mesh_bodies import PALE, Postures, draw_mesh, mesh_inks
from flockbrush.render.shapes import kernel

SMALLEST = 6.0  # pixels; animals farther away are drawn as long as this, to be seen at all
FINE = 13.0  # pixels; shorter bodies have fewer triangles
COARSE = 10.0  # pixels; bodies shorter than this are two or three triangles, and one for each wing
LEGS = 16.0  # pixels; shorter beasts have no legs


class SpaceHerd(NamedTuple):
    """The animals of one moment in space, a row each."""

    xyz: np.ndarray  # (n, 3) m above the drawn ground; a beast's position is that of its feet
    # forward, up: (n, 3); unit vectors
    forward: np.ndarray
    up: np.ndarray
    walks: np.ndarray  # (n,) bool; beasts on the ground
    # length, radius: (n,); m
    length: np.ndarray
    radius: np.ndarray
    beat: np.ndarray  # (n,); how high wings are, -1 to 1, `NO_WINGS` for none
    look: np.ndarray  # (n,) int64; row of the colours (k, 7, 3), as `look_colours` has them
    postures: Postures  # of those that are drawn with the mesh of their look


class SmallBody(NamedTuple):
    """A body of few triangles, as the eye sees it."""

    points: np.ndarray  # (20, 3); its corners, body lengths in its own axes
    places: np.ndarray  # (20, 2); where they are in the picture, pixels
    ink: np.ndarray  # (4, 3); colours of body, head, wings and wing tips (or legs)
    # in its own axes, a unit vector to the sun, and body lengths to the eye
    light: tuple[float, float, float]
    eye: tuple[float, float, float]
    lift: float  # how far its back points upwards, 1 for straight up
    near: float  # 1 / m, as `draw_triangle` wants it
    long: float  # pixels


@kernel
def draw_bodies(buffer, cam, order, herd, meshes, colours, haze, sun, smallest):
    """Draw the animals of a `SpaceHerd` in an order from far to near.

    Parameters
    ----------
    colours : (k, 7, 3)
        Of the looks.
    haze : Haze
    sun : (3,)
        Unit vector to the light.
    smallest : float
        Pixels; no animal is drawn shorter.
    """
    xyz, forward, up, walks, lengths, radius, beats, looks, (shown, clips, phase) = herd
    clip = buffer.clip
    points, places = np.empty((20, 3)), np.empty((20, 2))
    ink, axes = np.empty((4, 3)), np.empty((3, 3))
    for i in order:
        (px, py, pz), length, look, beat = (xyz[i, 0], xyz[i, 1], xyz[i, 2]), lengths[i], looks[i], beats[i]
        rx, ry, rz = deep(cam, px, py, pz)
        if rz < cam[15] + 1.2 * length:
            continue
        share = cam[12] / rz
        long = max(length * share, smallest)
        x, y = cam[13] + rx * share, cam[14] - ry * share
        if x < clip[0] - 1.5 * long or x > clip[2] + 1.5 * long or y < clip[1] - 1.5 * long or y > clip[3] + 1.5 * long:
            continue
        _axes(axes, forward, up, i)
        size, near, fog = long / share, share / cam[12] * 1.002, haze_at(rz, haze.clear)
        if shown[i] >= 0:
            mesh_inks(ink, colours[look], look % KINDS == LEADER)
            _fade(ink, haze.ink, fog)
            posture = (shown[i], clips[i], phase[i])
            wide = 2 * radius[i] / (WIDE * length)
            draw_mesh(buffer, cam, meshes, posture, SpacePose(xyz[i], axes), size, wide, ink, near, sun)
            continue
        light = _in_axes(axes, sun[0], sun[1], sun[2])
        eye = _in_axes(axes, (cam[0] - px) / size, (cam[1] - py) / size, (cam[2] - pz) / size)
        winged = beat > NO_WINGS
        _inks(ink, colours, look, winged, long)
        _fade(ink, haze.ink, fog)
        thick = min(max(radius[i] / length, 0.06), 0.5)
        if long < COARSE:
            seen, scale = (rx, ry, rz), long / rz
            steps = (
                step_of(cam, axes, 0, seen, scale), step_of(cam, axes, 1, seen, scale),
                step_of(cam, axes, 2, seen, scale),
            )  # fmt: skip
            far = FarBody(x, y, steps, light, eye, axes[2, 2], near, long)
            if walks[i]:
                draw_far_beast(buffer, far, ink, max(thick, 0.14))
            else:
                draw_far_bird(buffer, far, ink, beat)
            continue
        count = _beast(points, thick, long) if walks[i] else _bird(points, beat, long)
        _project(places, points, count, cam, SpacePose(xyz[i], axes), size)
        body = SmallBody(points, places, ink, light, eye, axes[2, 2], near, long)
        if walks[i]:
            _draw_beast(buffer, body)
        else:
            _draw_bird(buffer, body, winged)


@kernel
def _axes(axes, forward, up, i):
    """Unit vectors (3, 3) ahead, to the left and out of the back of the animal in row `i`."""
    fx, fy, fz = _unit(forward[i, 0], forward[i, 1], forward[i, 2], 1.0, 0.0, 0.0)
    ux, uy, uz = up[i, 0], up[i, 1], up[i, 2]
    lx, ly, lz = _unit(uy * fz - uz * fy, uz * fx - ux * fz, ux * fy - uy * fx, -fy, fx, 0.0)
    _put(axes, 0, fx, fy, fz)
    _put(axes, 1, lx, ly, lz)
    _put(axes, 2, fy * lz - fz * ly, fz * lx - fx * lz, fx * ly - fy * lx)


@kernel
def _in_axes(axes, x, y, z):
    """A vector by its parts ahead, to the left and up."""
    return (
        x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2],
        x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2],
        x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2],
    )


@kernel
def _project(places, points, count, cam, pose, size):
    """Where corners (body lengths) are in the picture, pixels."""
    for k in range(count):
        x, y, _ = pixel_of(cam, pose, points[k, 0] * size, points[k, 1] * size, points[k, 2] * size)
        places[k, 0], places[k, 1] = x, y


@kernel
def _unit(x, y, z, ox, oy, oz):
    """A vector of length 1, or the other one when it has none."""
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return ox, oy, oz
    return x / size, y / size, z / size


@kernel
def _inks(ink, colours, look, winged, long):
    """Colours of body, head, wings and wing tips (or legs) of a body of so many pixels.

    The head is as pale as that of a mesh where the body is large enough for legs, and the paler the smaller it is.
    """
    leads, share = look % KINDS == LEADER, 0.75 if winged else 0.9
    pale = PALE + (1.0 - PALE) * min(max((LEGS - long) / (LEGS - COARSE), 0.0), 1.0)
    for c in range(3):
        body, mark = colours[look, 0, c], colours[look, 3, c]
        skin = mark if leads else body
        ink[0, c] = body if winged else skin
        ink[1, c] = mark if leads and not winged else body + (colours[look, 1, c] - body) * pale
        ink[2, c] = skin
        ink[3, c] = skin + (colours[look, 2, c] - skin) * share


@kernel
def _fade(ink, beyond, fog):
    """Take colours into the haze."""
    for k in range(4):
        for c in range(3):
            ink[k, c] += (beyond[c] - ink[k, c]) * fog * 0.85


@kernel
def _put(points, k, x, y, z):
    """Set one corner."""
    points[k, 0], points[k, 1], points[k, 2] = x, y, z


@kernel
def _facet(buffer, body, a, b, c, row, closed):
    """One triangle of a body; the outside of a closed one is where its corners go round to the left."""
    points, places, light, eye = body.points, body.places, body.light, body.eye
    ux, uy, uz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    vx, vy, vz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    toward = nx * (eye[0] - points[a, 0]) + ny * (eye[1] - points[a, 1]) + nz * (eye[2] - points[a, 2])
    if toward < 0:
        if closed:
            return
        nx, ny, nz = -nx, -ny, -nz
    size = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    facing = (nx * light[0] + ny * light[1] + nz * light[2]) / size
    shine = 0.60 + 0.12 * nz / size * body.lift + (0.42 * facing if facing > 0 else 0.10 * facing)
    draw_triangle(buffer, pixel(places, a), pixel(places, b), pixel(places, c), body.near, lit(body.ink, row, shine))


# birds ---------------------------------------------------------------------------------


@kernel
def _bird(points, beat, long):
    """Corners of a bird, wings as high as they are; how many."""
    fat = 0.085 + 0.35 / long  # small ones need their room for colour
    _put(points, 0, 0.46, 0.0, 0.01)  # bill
    _put(points, 1, -0.40, 0.0, 0.02)  # where the tail begins
    for k in range(4):  # shoulders and neck: right, above, left, below
        y, z = (-1.0, 0.0, 1.0, 0.0)[k], (0.0, 0.85, 0.0, -1.0)[k]
        _put(points, 2 + k, 0.04, y * fat, z * fat)
        _put(points, 6 + k, 0.27, 0.62 * y * fat, 0.62 * z * fat + 0.01)
    _put(points, 10, -0.56, 0.11, 0.02)
    _put(points, 11, -0.56, -0.11, 0.02)
    if beat > NO_WINGS:
        arm, hand = BEATS * beat, BEATS * beat * 1.25 - 0.10
        ca, sa, ch, sh = np.cos(arm), np.sin(arm), np.cos(hand), np.sin(hand)
        half = 0.5 * WINGSPAN
        wrist, root = 0.40 * half, 0.7 * fat
        for side in range(2):
            s, k = (1.0, -1.0)[side], 12 + 4 * side
            _put(points, k, 0.16, s * root, 0.02)
            _put(points, k + 1, -0.13, s * root, 0.02)
            _put(points, k + 2, 0.19, s * (root + wrist * ca), 0.02 + wrist * sa)
            rest = half - wrist
            _put(points, k + 3, -0.17, s * (root + wrist * ca + rest * ch), 0.02 + wrist * sa + rest * sh)
    return 20 if beat > NO_WINGS else 12


@kernel
def _draw_bird(buffer, body, winged):
    """The wing on the far side, tail and trunk, then the wing on the near side."""
    left_first = body.eye[1] < 0
    bill, rump, tail = np.int64(0), np.int64(1), np.int64(10)  # numbers as such are types, to be compiled for each
    skin, head, tip = np.int64(0), np.int64(1), np.int64(3)
    flat, trunk = np.bool_(False), np.bool_(True)
    if winged:
        _wing(buffer, body, 12 if left_first else 16)
    if body.eye[0] >= -0.4:
        _facet(buffer, body, rump, tail, tail + 1, tip, flat)
    for k in range(4):
        m = (k + 1) % 4
        _facet(buffer, body, rump, 2 + k, 2 + m, skin, trunk)
        if body.long < FINE:
            _facet(buffer, body, bill, 2 + m, 2 + k, head, trunk)
        else:
            _facet(buffer, body, 2 + k, 6 + m, 2 + m, skin, trunk)
            _facet(buffer, body, 2 + k, 6 + k, 6 + m, skin, trunk)
            _facet(buffer, body, bill, 6 + m, 6 + k, head, trunk)
    if body.eye[0] < -0.4:
        _facet(buffer, body, rump, tail, tail + 1, tip, flat)
    if winged:
        _wing(buffer, body, 16 if left_first else 12)


@kernel
def _wing(buffer, body, k):
    """One wing: an arm, and a darker hand."""
    flat, arm, hand = np.bool_(False), np.int64(2), np.int64(3)
    _facet(buffer, body, k, k + 2, k + 1, arm, flat)
    _facet(buffer, body, k + 1, k + 2, k + 3, hand, flat)


# beasts --------------------------------------------------------------------------------


@kernel
def _beast(points, thick, long):
    """Corners of a beast: a trunk, a head, and where the legs are; how many."""
    wide = max(thick, 0.14)
    for k in range(8):  # bit 0: left, bit 1: above, bit 2: in front
        side, high, front = 1.0 if k & 1 else -1.0, k & 2, k & 4
        x = 0.28 if front else -0.46
        y = side * wide * (0.78 if high else 1.0) * (0.85 if front else 1.0)
        _put(points, k, x, y, (BACK if high else BELLY) - (0.03 if not front and high else 0.0))
    for k in range(8):
        side, high, front = 1.0 if k & 1 else -1.0, k & 2, k & 4
        x = 0.56 if front else 0.24
        y = side * wide * (0.30 if front else 0.52)
        z = (BACK + 0.06 if high else BACK - 0.24) if not front else (BACK - 0.04 if high else BACK - 0.20)
        _put(points, 8 + k, x, y, z)
    for k in range(4):
        _put(points, 16 + k, (0.19, -0.36)[k >> 1], (1.0, -1.0)[k & 1] * wide * 0.72, 0.0)
    return 20


@kernel
def _draw_beast(buffer, body):
    """Legs, then trunk and head, the farther one first."""
    if body.long >= LEGS:
        half, near, ink = 0.035 * body.long, body.near, lit(body.ink, 3, 0.55)
        for k in range(4):
            (x, y), (hx, hy) = pixel(body.places, 16 + k), _hip(body.places, k)
            draw_triangle(buffer, (x - half, y), (x + half, y), (hx - half, hy), near, ink)
            draw_triangle(buffer, (hx - half, hy), (hx + half, hy), (x + half, y), near, ink)
    for k in range(2):
        _block(buffer, body, k if body.eye[0] > 0.3 else 1 - k)


@kernel
def _hip(places, k):
    """Where a leg meets the trunk, in pixels."""
    corner = (5, 4, 1, 0)[k]
    other = (1, 0, 5, 4)[k]
    return places[corner, 0] * 0.88 + places[other, 0] * 0.12, places[corner, 1] * 0.88 + places[other, 1] * 0.12


@kernel
def _block(buffer, body, part):
    """The trunk (0) or the head (1), a block of eight corners; see `_beast` for their order."""
    trunk, first = np.bool_(True), 8 * part
    for face in range(6):
        a, b, c, d = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (1, 3, 7, 5), (0, 4, 6, 2))[face]
        _facet(buffer, body, first + a, first + b, first + c, part, trunk)
        _facet(buffer, body, first + a, first + c, first + d, part, trunk)


def standing(forward: np.ndarray) -> np.ndarray:
    """Unit vectors out of the backs of animals that do not bank, (n, 3), from their headings (n, 3)."""
    x, y, z = forward.T
    lean = z / np.maximum(x * x + y * y + z * z, 1e-12)
    up = np.column_stack([0.0 - lean * x, 0.0 - lean * y, 1.0 - lean * z])
    size = sizes(up)
    steep = size < 1e-6
    up[steep] = (-1.0, 0.0, 0.0)
    return up / np.where(steep, 1.0, size)[:, None]


def attitude_of(heading, pitch, bank) -> tuple[np.ndarray, np.ndarray]:
    """Headings and backs, (n, 3) unit vectors each, of animals that climb and lean.

    Parameters
    ----------
    heading : (n,)
        Counter-clockwise from east, rad.
    pitch : (n,)
        Upwards, rad.
    bank : (n,)
        With the right wing down, rad.
    """
    heading, pitch, bank = (np.asarray(angle, float) for angle in (heading, pitch, bank))
    flat, climb = np.cos(pitch), np.sin(pitch)
    forward = np.stack([flat * np.cos(heading), flat * np.sin(heading), climb], axis=-1)
    level = np.stack([-climb * np.cos(heading), -climb * np.sin(heading), flat], axis=-1)
    right = np.stack([np.sin(heading), -np.cos(heading), np.zeros_like(heading)], axis=-1)
    return forward, np.cos(bank)[..., None] * level + np.sin(bank)[..., None] * right
