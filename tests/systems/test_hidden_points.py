"""Hidden-point removal: who is visible among points without bodies."""

import numpy as np
import pytest
from flockbrush.systems.hidden_points import RADIUS_FACTOR
from flockbrush.systems.perception import filtered_of_one_kind
from flockbrush.systems.visibility import Lists
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull


def visible(points):
    """Indices of the points (n, 2) that a brush with ``sight = "hidden_points"`` sees from the origin."""
    points = np.asarray(points, float).reshape(-1, 2)
    n = len(points)
    first = np.full(n + 2, n)
    first[0] = 0
    lists = Lists(first, np.arange(1, n + 1, dtype=np.int32), points)
    return (filtered_of_one_kind(lists, "hidden_points", 0).of(0) - 1).tolist()


def by_qhull(points):
    """The definition with Qhull, for points in no special place."""
    distance = np.linalg.norm(points, axis=1, keepdims=True)
    flipped = points + 2 * (RADIUS_FACTOR * distance.max() - distance) * points / distance
    corners = ConvexHull(np.vstack([flipped, np.zeros(2)])).vertices
    return sorted(corners[corners < len(points)].tolist())


def circle(n, radius, turned=0.0):
    angle = 2 * np.pi * (np.arange(n) + turned) / n
    return radius * np.c_[np.cos(angle), np.sin(angle)]


def test_all_animals_on_a_circle_are_visible_from_within():
    assert len(visible(circle(40, 5.0))) == 40
    assert len(visible(circle(40, 5.0) - (1, -2))) == 40


def test_a_circle_of_animals_hides_a_wider_one_behind_it():
    assert visible(np.r_[circle(90, 2.0), circle(90, 8.0, 0.5)]) == list(range(90))


def test_through_a_gap_in_the_inner_circle_some_of_the_outer_are_visible():
    inner, outer = circle(90, 2.0), circle(90, 8.0, 0.5)
    inner = inner[(inner[:, 0] < 0) | (np.abs(inner[:, 1]) > 1)]
    seen = np.r_[inner, outer][visible(np.r_[inner, outer])]
    beyond = seen[np.hypot(*seen.T) > 5]
    assert 5 < len(beyond) < 45 and beyond[:, 0].min() > 5


@pytest.mark.parametrize("n", [8, 60, 400])
def test_scattered_points_are_visible_as_qhull_says(n):
    rng = np.random.default_rng(n)
    points = rng.normal(0, 5, (n, 2)) - rng.normal(0, 3, 2)
    assert visible(points) == by_qhull(points)


@pytest.mark.parametrize("direction", [(1.0, 3.0), (-0.1, 0.7), (0.0, -1.0)])
def test_in_single_file_only_the_first_is_visible(direction):
    assert visible(np.arange(19, 0, -1)[:, None] * np.array(direction)) == [18]


def test_points_at_the_viewpoint_are_visible_and_hide_nobody():
    assert visible([(0, 0), (0, 0), (2, 0)]) == [0, 1, 2]


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=12, unique=True))
def test_any_few_points_get_an_answer_in_which_the_nearest_is_visible(points):
    seen = visible(points)
    assert seen == sorted(set(seen))
    assert np.linalg.norm(np.array(points, float), axis=1).argmin() in seen
