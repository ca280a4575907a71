"""Hidden-point removal: who is visible among points without bodies."""

import numpy as np
import pytest
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.hidden_points import hidden_point_removal, visible_by_hpr
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

ORIGIN = {2: (0.0, 0.0), 3: (0.0, 0.0, 0.0)}


def circle(n, radius, turned=0.0):
    angle = 2 * np.pi * (np.arange(n) + turned) / n
    return radius * np.c_[np.cos(angle), np.sin(angle)]


def sphere(n, radius):
    """Spread evenly, by the golden angle."""
    z, angle = 1 - (2 * np.arange(n) + 1) / n, np.pi * (3 - 5**0.5) * np.arange(n)
    return radius * np.c_[np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z]


def by_qhull(points, viewpoint, radius_factor):
    """The definition with Qhull, for points in no special place."""
    away = points - np.asarray(viewpoint)
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    flipped = away + 2 * (radius_factor * distance.max() - distance) * away / distance
    corners = ConvexHull(np.vstack([flipped, np.zeros(away.shape[1])])).vertices
    return sorted(corners[corners < len(points)])


def lists(xyz, view=360.0, view_range=10.0, radius_factor=100.0, heading=0.0, z=None, wrap=None):
    n = len(xyz)
    xyz = np.c_[np.asarray(xyz, float)[:, :2], np.zeros(n)]
    forward = np.tile([np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading)), 0.0], (n, 1))
    cells = sort_into_cells(xyz, forward, np.ones(n), np.full(n, 0.2), view_range, wrap)
    cosine = -1.0 if view >= 360 else np.cos(np.deg2rad(view) / 2)
    return visible_by_hpr(cells, np.full(n, view_range), np.full(n, cosine), radius_factor, z)


# --- points -----------------------------------------------------------------------------------------------------------


def test_all_animals_on_a_circle_are_visible_from_within():
    assert len(hidden_point_removal(circle(40, 5.0), (0, 0))) == 40
    assert len(hidden_point_removal(circle(40, 5.0), (1, -2))) == 40


def test_a_circle_of_animals_hides_a_wider_one_behind_it():
    inner, outer = circle(90, 2.0), circle(90, 8.0, 0.5)
    assert hidden_point_removal(np.r_[inner, outer], (0, 0), 10).tolist() == list(range(90))


def test_through_a_gap_in_the_inner_circle_some_of_the_outer_are_visible():
    inner, outer = circle(90, 2.0), circle(90, 8.0, 0.5)
    inner = inner[(inner[:, 0] < 0) | (np.abs(inner[:, 1]) > 1)]
    seen = np.r_[inner, outer][hidden_point_removal(np.r_[inner, outer], (0, 0), 10)]
    beyond = seen[np.hypot(*seen.T) > 5]
    assert 5 < len(beyond) < 45 and beyond[:, 0].min() > 5


def test_a_wall_hides_those_behind_it_and_not_those_beside_it():
    wall = np.c_[np.full(81, 3.0), np.linspace(-4, 4, 81)]
    behind, beside, before = [(6.0, 0.03), (5.0, 2.02)], [(3.0, 9.0), (-4.0, 1.0)], [(2.0, 0.02)]
    assert hidden_point_removal(np.r_[wall, behind], (0, 0), 10).tolist() == list(range(81))
    seen = hidden_point_removal(np.r_[wall, behind, beside, before], (0, 0), 10)
    assert set(seen) >= {83, 84, 85} and not {81, 82} & set(seen)


def test_the_far_half_of_a_ball_of_animals_is_hidden():
    ball = sphere(500, 1.0)
    seen = ball[hidden_point_removal(ball, (10, 0, 0), 100)]
    assert seen[:, 0].min() > -0.15
    assert len(seen) >= 0.95 * (ball[:, 0] > 0.15).sum()


def test_a_larger_radius_shows_more():
    points = np.random.default_rng(0).uniform(-10, 10, (400, 2))
    seen = [set(hidden_point_removal(points, (0, 0), factor)) for factor in (1.5, 10, 100, 1000)]
    assert all(a < b for a, b in zip(seen, seen[1:], strict=False))


@pytest.mark.parametrize("dimensions", [2, 3])
@pytest.mark.parametrize("radius_factor", [1.5, 10.0, 100.0])
def test_scattered_points_are_visible_as_qhull_says(dimensions, radius_factor):
    rng = np.random.default_rng(dimensions)
    for n in (8, 60, 400):
        points, viewpoint = rng.normal(0, 5, (n, dimensions)), rng.normal(0, 3, dimensions)
        seen = hidden_point_removal(points, viewpoint, radius_factor)
        assert seen.tolist() == by_qhull(points, viewpoint, radius_factor)


def test_few_points_are_all_visible_unless_one_is_right_behind_another():
    for d in (2, 3):
        one, two = np.eye(d)[0] * 2, np.eye(d)[1] * 3
        assert hidden_point_removal(np.zeros((0, d)), ORIGIN[d]).tolist() == []
        assert hidden_point_removal([one], ORIGIN[d]).tolist() == [0]
        assert hidden_point_removal([one, two], ORIGIN[d]).tolist() == [0, 1]
        assert hidden_point_removal([one, 2 * one], ORIGIN[d]).tolist() == [0]
        assert hidden_point_removal([one, -2 * one, 3 * one], ORIGIN[d]).tolist() == [0, 1]
    assert hidden_point_removal(np.eye(3), ORIGIN[3]).tolist() == [0, 1, 2]


@pytest.mark.parametrize("direction", [(1.0, 3.0), (-0.1, 0.7), (1.0, 3.0, -0.3), (0.0, 0.0, 1.0)])
def test_in_single_file_only_the_first_is_visible(direction):
    file = np.arange(1, 20)[:, None] * np.array(direction)
    assert hidden_point_removal(file[::-1], ORIGIN[len(direction)]).tolist() == [18]


def test_points_at_the_viewpoint_are_visible_and_hide_nobody():
    assert hidden_point_removal([(1, 1), (1, 1), (3, 1)], (1, 1)).tolist() == [0, 1, 2]
    assert hidden_point_removal([(1, 1, 1)] * 4, (1, 1, 1)).tolist() == [0, 1, 2, 3]


def test_points_at_one_place_are_visible_together_or_not_at_all():
    points = [(2, 0), (2, 0), (4, 0), (4, 0), (0, 3)]
    assert hidden_point_removal(points, (0, 0)).tolist() == [0, 1, 4]


def test_points_of_a_plane_through_the_viewpoint_are_as_visible_as_on_a_map():
    rng = np.random.default_rng(3)
    flat = rng.normal(0, 5, (60, 2))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    on_the_map = hidden_point_removal(flat, (0, 0))
    assert hidden_point_removal(flat @ turn, (0, 0, 0)).tolist() == on_the_map.tolist()


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(*[st.integers(-3, 3)] * 3), max_size=12), st.sampled_from([1.0, 3.0, 100.0]))
def test_any_few_points_get_an_answer_in_which_the_nearest_is_visible(points, radius_factor):
    for d in (2, 3):
        cloud = np.array(points, float).reshape(-1, 3)[:, :d]
        seen = hidden_point_removal(cloud, ORIGIN[d], radius_factor)
        assert np.all(np.diff(seen) > 0)
        if len(cloud):
            assert np.linalg.norm(cloud, axis=1).argmin() in seen


@pytest.mark.parametrize(
    ("points", "viewpoint", "factor", "message"),
    [
        (np.zeros((3, 4)), (0, 0), 10, r"shape \(n, 2\) or \(n, 3\), got shape \(3, 4\)"),
        (np.zeros((3, 3)), (0, 0), 10, "viewpoint must have 3 numbers"),
        ([(np.nan, 1)], (0, 0), 10, "finite"),
        ([(1, 1)], (0, 0), 0.5, "radius_factor must be at least 1, got 0.5"),
    ],
)
def test_what_makes_no_sense_is_refused(points, viewpoint, factor, message):
    with pytest.raises(ValueError, match=message):
        hidden_point_removal(points, viewpoint, factor)


# --- herds ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("in_space", [False, True])
def test_each_animal_sees_what_hidden_point_removal_leaves_of_those_in_range(in_space):
    rng = np.random.default_rng(4)
    xyz = rng.uniform(0, 30, (150, 3))
    z = xyz[:, 2].copy() if in_space else None
    found = lists(xyz, z=z, radius_factor=20.0)
    points = xyz if in_space else xyz[:, :2]
    for i in range(0, 150, 7):
        near = np.flatnonzero((np.hypot(*(xyz[:, :2] - xyz[i, :2]).T) < 10) & (np.arange(150) != i))
        expected = near[hidden_point_removal(points[near] - points[i], np.zeros(points.shape[1]), 20.0)]
        assert sorted(found.of(i)) == expected.tolist()
        mine = slice(found.first[i], found.first[i + 1])
        assert np.array_equal(found.offset[mine], xyz[found.near[mine], :2] - xyz[i, :2])


def test_the_field_of_view_leaves_out_those_behind():
    rng = np.random.default_rng(5)
    xyz = rng.uniform(0, 25, (120, 2))
    all_round, ahead = lists(xyz), lists(xyz, view=180)
    for i in range(120):
        rows = all_round.of(i)
        assert ahead.of(i).tolist() == rows[xyz[rows, 0] > xyz[i, 0]].tolist()


def test_animals_at_one_place_see_one_another_and_are_seen_together():
    found = lists([(0, 0), (0, 0), (4, 0), (4, 0), (8, 0)])
    assert [sorted(found.of(i)) for i in range(5)] == [[1, 2, 3], [0, 2, 3], [0, 1, 3, 4], [0, 1, 2, 4], [2, 3]]


def test_nobody_alone_sees_anybody():
    assert lists(np.zeros((0, 2))).first.tolist() == [0]
    assert lists([(1, 1)]).first.tolist() == [0, 0]


def test_across_a_wrapped_seam_the_near_one_hides_the_far_one():
    found = lists([(1, 15), (28, 15), (25, 15)], wrap=(30, 30))
    assert found.of(0).tolist() == [1]
