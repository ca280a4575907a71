"""Animals a few pixels long: a body of two or three triangles, and one for each wing.

So far away all parts of a body are as deep as its middle, and its places in the picture follow from three steps of a
body length: ahead, to the left and up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.animal_figures import NO_WINGS, WINGSPAN
from flockbrush.render.facets import draw_triangle, lit
from flockbrush.render.shapes import kernel

BELLY, BACK = 0.26, 0.62  # body lengths above its feet, of a beast
BEATS = 0.62  # rad that a wing goes up and down at the shoulder
WRIST, HAND = 0.20 * WINGSPAN, 0.30 * WINGSPAN  # body lengths from the shoulder to the wrist, and on to the tip


class FarBody(NamedTuple):
    """A small body as the eye sees it."""

    # pixels; of its origin in the picture
    x: float
    y: float
    # pixels to the right and down for a body length ahead, to the left and up
    steps: tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
    # in its own axes, a unit vector to the sun, and body lengths to the eye
    light: tuple[float, float, float]
    eye: tuple[float, float, float]
    lift: float  # how far its back points upwards, 1 for straight up
    near: float  # 1 / m, as `draw_triangle` wants it
    long: float  # pixels


@kernel
def step_of(cam, axes, row, seen, scale):
    """Pixels to the right and down for a body length along one axis, of a body at `seen` in the camera's axes.

    `scale` is how many pixels a body length is, over the depth.
    """
    right, up, ahead = seen
    ex, ey, ez = axes[row, 0], axes[row, 1], axes[row, 2]
    deeper = cam[9] * ex + cam[10] * ey + cam[11] * ez
    return (
        scale * (ahead * (cam[3] * ex + cam[4] * ey + cam[5] * ez) - right * deeper),
        -scale * (ahead * (cam[6] * ex + cam[7] * ey + cam[8] * ez) - up * deeper),
    )


@kernel
def _place(body, ahead, left, up):
    """Column and row of a point of the body, body lengths in its own axes."""
    (ax, ay), (lx, ly), (ux, uy) = body.steps
    return body.x + ahead * ax + left * lx + up * ux, body.y + ahead * ay + left * ly + up * uy


@kernel
def _shine(body, left, up):
    """How bright a side is that points so far to the left and up of the body, a unit vector."""
    facing = left * body.light[1] + up * body.light[2]
    return 0.60 + 0.12 * up * body.lift + (0.42 * facing if facing > 0 else 0.10 * facing)


@kernel
def _body_shine(body):
    """How bright a long body is on the side that it turns to the eye."""
    eye = body.eye
    size = max(np.sqrt(eye[1] * eye[1] + eye[2] * eye[2]), 1e-9)
    return _shine(body, eye[1] / size, eye[2] / size)


@kernel
def _across(bill, tail, wide):
    """A step of so many pixels across the line from the tail to the bill, and one of a pixel along it."""
    dx, dy = bill[0] - tail[0], bill[1] - tail[1]
    far = 1.0 / max(np.sqrt(dx * dx + dy * dy), 1e-9)
    return -dy * far * wide, dx * far * wide, dx * far, dy * far


@kernel
def draw_far_bird(buffer, body, ink, beat):
    """The wing on the far side, both halves of the body, the wing on the near side."""
    winged, side = beat > NO_WINGS, 1.0 if body.eye[1] < 0 else -1.0
    out, high, root = 0.0, 0.0, 0.0
    if winged:
        for k in range(3):
            ink[3, k] += 0.3 * (ink[2, k] - ink[3, k])
        (arm_out, arm_high), (hand_out, hand_high) = _turned(BEATS * beat), _turned(BEATS * beat * 1.25 - 0.10)
        out, high = WRIST * arm_out + HAND * hand_out, WRIST * arm_high + HAND * hand_high
        root = 0.7 * (0.085 + 0.35 / body.long)
        _far_wing(buffer, body, ink, side, root, out, high)
    bill, tail, (x, y) = _place(body, 0.46, 0.0, 0.01), _place(body, -0.52, 0.0, 0.02), _place(body, 0.08, 0.0, 0.0)
    px, py, _, _ = _across(bill, tail, 0.085 * body.long + 0.35)
    shine = _body_shine(body)
    head, skin = lit(ink, 1, shine), lit(ink, 0, shine)
    for half in range(2):  # the end that is farther away comes first
        if (half == 0) == (body.eye[0] > 0):
            draw_triangle(buffer, tail, (x + px, y + py), (x - px, y - py), body.near, skin)
        else:
            draw_triangle(buffer, bill, (x + px, y + py), (x - px, y - py), body.near, head)
    if winged:
        _far_wing(buffer, body, ink, -side, root, out, high)


@kernel
def _turned(angle):
    """Cosine and sine of an angle up to 1 rad, to a hundredth."""
    square = angle * angle
    return 1.0 - square * (0.5 - square / 24.0), angle * (1.0 - square / 6.0)


@kernel
def _far_wing(buffer, body, ink, side, root, out, high):
    """One wing, a triangle whose tip lies `out` to the `side` of its root and `high` above it, body lengths."""
    size, eye = 1.0 / np.sqrt(out * out + high * high), body.eye
    left, up = -side * high * size, out * size
    if left * (eye[1] - side * root) + up * (eye[2] - 0.02) < 0:
        left, up = -left, -up
    tip = _place(body, -0.05, side * (root + out), 0.02 + high)
    a, b = _place(body, 0.21, side * root, 0.02), _place(body, -0.15, side * root, 0.02)
    draw_triangle(buffer, a, tip, b, body.near, lit(ink, 3, _shine(body, left, up)))


@kernel
def draw_far_beast(buffer, body, ink, thick):
    """A trunk as a bar, `thick` body lengths to each side of its middle, and a head, the farther one first."""
    eye, long, near = body.eye, body.long, body.near
    away = max(np.sqrt(eye[0] ** 2 + eye[1] ** 2 + eye[2] ** 2), 1e-9)
    middle, high = 0.5 * (BELLY + BACK), 0.5 * (BACK - BELLY)
    nose, rump = _place(body, 0.56, 0.0, middle + 0.08), _place(body, -0.46, 0.0, middle)
    neck = _place(body, 0.28, 0.0, middle)
    px, py, ex, ey = _across(nose, rump, long * (high * abs(eye[1]) + thick * abs(eye[2])) / away)
    more = long * high * abs(eye[0]) / away  # of its front or its back is seen
    ax, ay, bx, by = rump[0] - more * ex, rump[1] - more * ey, neck[0] + more * ex, neck[1] + more * ey
    shine = _body_shine(body)
    trunk, head = lit(ink, 0, shine), lit(ink, 1, shine)
    for part in range(2):
        if part == (0 if eye[0] > 0 else 1):
            draw_triangle(buffer, (ax + px, ay + py), (ax - px, ay - py), (bx + px, by + py), near, trunk)
            draw_triangle(buffer, (ax - px, ay - py), (bx + px, by + py), (bx - px, by - py), near, trunk)
        else:
            sx, sy = 0.6 * px, 0.6 * py
            draw_triangle(buffer, (bx + sx, by + sy), (bx - sx, by - sy), nose, near, head)
