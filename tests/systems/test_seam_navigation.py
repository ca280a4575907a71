"""Guides and ways to goals on maps that go on at the opposite border."""

import numpy as np
import pytest
from flockbrush.components import Destination, Position
from flockbrush.components.level_things import Goal
from flockbrush.systems.named_regions import in_goal
from flockbrush.systems.navigation import Navigation, goal_mask, navigation_of
from ground_pictures import free, guide, one_cell
from hypothesis import given, settings
from hypothesis import strategies as st
from small_herd import meadow, put, straight


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_ways_are_those_on_a_large_map_of_many_copies(seed, hilly):
    rng = np.random.default_rng(seed)
    ny, nx = rng.integers(4, 24, 2)
    blocked, cost, goal = rng.random((ny, nx)) < 0.2, rng.uniform(0.5, 3.0, (ny, nx)), free(ny, nx)
    goal[rng.integers(ny), rng.integers(nx)] = True
    east, north = (np.arange(n) * 2 * np.pi / n for n in (nx, ny))
    height = np.sin(east) + 2.0 * np.cos(north)[:, None] if hilly else None
    found = navigation_of([], [goal], blocked, cost, 1.0, height, wrap=True)

    def copies(values):
        return None if values is None else np.tile(values, (7, 7))

    large = navigation_of([], [copies(goal)], copies(blocked), copies(cost), 1.0, copies(height))
    middle = slice(3 * ny, 4 * ny), slice(3 * nx, 4 * nx)
    np.testing.assert_allclose(found.times[0], large.times[0][middle])
    np.testing.assert_allclose(found.fields[1], large.fields[1][middle])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6))
def test_where_the_border_of_the_map_lies_makes_no_difference(seed):
    rng = np.random.default_rng(seed)
    ny, nx = rng.integers(6, 20, 2)
    blocked, by = rng.random((ny, nx)) < 0.1, rng.integers(0, 6, 2)
    points = rng.uniform(0, 1, (3, 2)) * [nx, ny]
    at = rng.uniform(0, 1, 2) * [nx, ny]

    def made(dy, dx):
        goal = Goal(1, "there", tuple(np.mod(at + [dx, dy], [nx, ny])), 1.5, "stay", "")
        ways = navigation_of([], [goal], np.roll(blocked, (dy, dx), (0, 1)), wrap=True)
        guides = navigation_of([guide(points + [dx, dy], 1.0, 2.0, 2.0)], [], free(ny, nx), wrap=True)
        return np.roll(ways.times[0], (-dy, -dx), (0, 1)), np.roll(guides.fields[0], (-dy, -dx), (0, 1))

    (times, field), (moved_times, moved_field) = made(0, 0), made(*by)
    np.testing.assert_allclose(times, moved_times, atol=1e-9)
    np.testing.assert_allclose(field, moved_field, atol=0.05)  # of cells as far from two the first is told by rounding


def test_a_goal_that_reaches_over_the_border_has_cells_on_both_sides():
    goal = Goal(1, "there", (0.2, 5.0), 2.0, "stay", "")
    times = navigation_of([], [goal], free(10, 12), wrap=True).times[0]
    assert np.flatnonzero(times[5] == 0.0).tolist() == [0, 1, 10, 11]
    assert goal_mask(goal.xy, goal.radius, None, (10, 12), 1.0)[5].nonzero()[0].tolist() == [0, 1]


def test_the_field_is_bilinear_over_the_border():
    fields = np.random.default_rng(0).random((1, 3, 4, 2))
    navigation = Navigation(2.0, fields, np.empty((0, 3, 4)), wrap=True)
    felt = navigation.at([(0.0, 1.0), (8.0, 1.0), (-1.0, 1.0), (3.0, 6.0)])
    np.testing.assert_allclose(felt[:2], [fields[0, 0, [0, 3]].mean(0)] * 2)
    np.testing.assert_allclose(felt[2:], [fields[0, 0, 3], fields[0, [0, 2], 1].mean(0)])


@pytest.mark.parametrize(("boundary", "east"), [("wrap", False), ("wall", True)])
def test_an_animal_takes_the_short_way_to_its_goal_over_the_border(boundary, east):
    walk = straight(mean=2.0, guided="everyone")
    goal = Goal(1, "water", (36.0, 20.0), 2.0, "stay", "")
    simulation = meadow(walk, boundary=boundary, goals=[goal])
    put(simulation, [(6.0, 20.0)], 0.0 if east else np.pi)
    simulation.agents[Destination.goal][:] = 0
    simulation.run(32 * 4)
    x = simulation.agents[Position.xyz][0, 0]
    assert (x < 20.0) == east, x


def test_nobody_is_told_that_no_way_leads_where_one_leads_over_the_border():
    wall = free(20, 40)
    wall[:, 20] = True
    times = navigation_of([], [one_cell((20, 40), 10, 30)], wall, wrap=True).times[0]
    assert times[10, 0] == pytest.approx(10.0)
    assert np.isinf(navigation_of([], [one_cell((20, 40), 10, 30)], wall).times[0][10, 0])


@pytest.mark.parametrize("polygon", [None, np.array([(38.0, 18.0), (43.0, 18.0), (43.0, 22.0), (38.0, 22.0)])])
def test_who_stands_in_a_goal_that_reaches_over_the_border_has_arrived(polygon):
    goal = Goal(1, "water", (39.5, 20.0), 2.5, "stay", "", polygon)
    xyz = np.array([(39.0, 20.0, 0.0), (1.0, 20.0, 0.0), (4.0, 20.0, 0.0), (36.0, 20.0, 0.0)])
    assert in_goal(goal, xyz, (40.0, 40.0)).tolist() == [True, True, False, False]
    assert in_goal(goal, xyz).tolist() == [True, False, False, False]
