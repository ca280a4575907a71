"""A mask of obstacles is outlined as it was painted, and nobody begins inside."""

import dataclasses

import cv2
import numpy as np
import pytest

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.clip_fields import grid_over, outlined, painted
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.rollout import Walls
from flockbrush.learning.side_by_side import ComparisonGround

BODY = 12.0  # px
MIDDLE, RADIUS = np.array([150.0, 90.0]), 40.0


@pytest.fixture(scope="module")
def pond():
    """(mask of a round pond with an island, grid)."""
    mask = np.zeros((240, 320), np.uint8)
    cv2.circle(mask, MIDDLE.astype(int).tolist(), int(RADIUS), 1, -1)
    cv2.circle(mask, MIDDLE.astype(int).tolist(), 10, 0, -1)
    return mask, grid_over((320, 240), np.eye(2, 3)[None], BODY, 20)


def area(edges):
    """Of the polygons with these edges, holes counted off."""
    return abs(0.5 * (edges[:, 0] * edges[:, 3] - edges[:, 2] * edges[:, 1]).sum())


def test_an_outline_follows_the_mask_and_not_the_cells(pond):
    mask, grid = pond
    edges = outlined(mask, grid, 1.0)
    assert set(edges[:, 4]) == {0.0}
    assert area(edges) == pytest.approx(mask.sum() / BODY**2, rel=0.02)
    cells = painted(mask, grid, 1.0).astype(bool)
    assert abs(cells.sum() * grid.cell**2 - mask.sum() / BODY**2) > 0.03 * mask.sum() / BODY**2
    middle = grid.to_bl[:, :2] @ MIDDLE + grid.to_bl[:, 2]
    far = np.hypot(*(edges[:, :2] - middle).T) * BODY
    assert (np.abs(far - RADIUS) < 1.5).sum() + (np.abs(far - 10) < 1.5).sum() == len(edges)
    assert len(outlined(np.zeros_like(mask), grid, 1.0)) == 0


def test_who_is_in_an_obstacle_is_moved_to_its_edge_and_nobody_else(pond):
    mask, grid = pond
    edges = outlined(mask, grid, 1.0)
    walls = Walls(edges[:, :4], edges[:, 4].astype(np.int32))
    at = np.array([MIDDLE + (30, 0), MIDDLE, MIDDLE + (60, 5)])  # in the water, on the island, ashore
    here = at @ grid.to_bl[:, :2].T + grid.to_bl[:, 2]
    out = walls.outside(here, 0.3)
    assert np.array_equal(out[1:], here[1:])
    middle = grid.to_bl[:, :2] @ MIDDLE + grid.to_bl[:, 2]
    assert abs(np.hypot(*(out[0] - middle)) - (RADIUS / BODY + 0.3)) < 0.1


def test_a_herd_begins_beside_the_obstacles_of_its_clip():
    clip = evidence_of_truth(herd("swarm", 30, 0.2, seed=2))
    x, y = clip.sightings.xy[clip.sightings.of(0)].mean(0)
    corners = np.array([(x - 2, y - 2), (x + 2, y - 2), (x + 2, y + 2), (x - 2, y + 2)])
    edges = np.column_stack([corners, np.roll(corners, -1, 0), np.zeros(4)])
    walled = dataclasses.replace(clip, fields=dataclasses.replace(clip.fields, outline=edges))
    inside = lambda start: (np.abs(start.xy - (x, y)) < 2).all(1).sum()  # noqa: E731
    assert inside(start_of(clip)) > 0 and inside(start_of(walled)) == 0
    half = dataclasses.replace(clip.fields, outline=edges).scaled(0.5)
    assert np.allclose(half.outline[:, :4], 0.5 * edges[:, :4])
    stage = ComparisonGround(walled, _brush(), [], 10.0)
    bare = ComparisonGround(clip, _brush(), [], 10.0)
    drawn = stage.herd(np.zeros((0, 2)), np.zeros((0, 2)), 0.0) != bare.herd(np.zeros((0, 2)), np.zeros((0, 2)), 0.0)
    assert drawn.any(-1).sum() == pytest.approx((4 * stage.scale) ** 2, rel=0.1)  # 4 BL each way


def _brush():
    from flockbrush.behaviours.brush import shipped

    return shipped().get("march")
