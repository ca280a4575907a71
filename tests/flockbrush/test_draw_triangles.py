"""Triangles of bodies: drawn in spans of rows, as if every pixel were looked at by itself."""

import numpy as np
import pytest

from flockbrush.render.facets import draw_triangle
from flockbrush.render.shapes import FrameBuffer

SIDE = 40
INK = (200.0, 90.3, 17.8)


def drawn_pixel_by_pixel(frame, depth, corners, near):
    """Each pixel by how far its middle is inside the three edges, moved out by half a pixel and a soft one."""
    a, b, c = corners
    if np.linalg.det([b - a, c - a]) < 0:
        b, c = c, b
    box = np.min(corners, axis=0) - 0.5, np.max(corners, axis=0) + 0.5
    y, x = np.mgrid[:SIDE, :SIDE] + 0.5
    inside = np.full((SIDE, SIDE), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        ux, uy = (q - p) / max(np.hypot(*(q - p)), 1e-9)
        inside = np.minimum(inside, ux * (y - p[1]) - uy * (x - p[0]) + 1.0)
    near_box = (x > box[0][0] - 0.5) & (x < box[1][0] + 0.5) & (y > box[0][1] - 0.5) & (y < box[1][1] + 0.5)
    shown = near_box & (inside > 0) & (depth <= near)
    share = np.where(shown, np.minimum(inside, 1.0), 0.0)[..., None]
    return np.where(shown[..., None], frame + (np.array(INK) - frame) * share + 0.5, frame).astype(np.uint8)


@pytest.mark.parametrize("kind", ["any", "level", "thin", "outside"])
def test_a_triangle_covers_the_pixels_that_its_edges_say(kind):
    rng = np.random.default_rng(7)
    for _ in range(60):
        corners = rng.uniform(-15, SIDE + 15, (3, 2)) if kind == "outside" else rng.uniform(2, SIDE - 2, (3, 2))
        if kind == "level":
            corners[1, 1] = corners[0, 1]
        if kind == "thin":
            corners[2] = corners[0] + (corners[1] - corners[0]) * rng.random() + rng.normal(0, 0.3, 2)
        before = rng.integers(0, 256, (SIDE, SIDE, 3)).astype(np.uint8)
        depth = rng.choice([0.0, 2.0], (SIDE, SIDE)).astype(np.float32)
        wanted = drawn_pixel_by_pixel(before.astype(float), depth, corners, 1.0)
        buffer = FrameBuffer(before, depth, np.array([0, 0, SIDE, SIDE]))
        draw_triangle(buffer, *map(tuple, corners.tolist()), 1.0, INK)
        apart = np.abs(before.astype(int) - wanted).max(axis=2)
        assert apart.max() <= 1, corners  # rounding of a share
