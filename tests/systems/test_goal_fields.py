"""Travel times to goals, and the ways that they give."""

import heapq

import numpy as np
import pytest
from flockbrush.systems.navigation import goal_field, goal_mask, navigation_of
from ground_pictures import free, guide, lengths, one_cell, random_ground


def any_angle(goal, blocked):
    """Shortest ways by brute force: Dijkstra over a visibility graph, whose corners are those of blocked cells."""
    ny, nx = blocked.shape
    corners = [(x, y) for y in range(1, ny) for x in range(1, nx) if blocked[y - 1 : y + 1, x - 1 : x + 1].sum() == 1]
    centres = [(ix + 0.5, iy + 0.5) for iy in range(ny) for ix in range(nx) if not blocked[iy, ix]]
    nodes = np.array([(goal[1] + 0.5, goal[0] + 0.5), *corners])

    def sees(a, b):
        t = (np.arange(200) + 0.5) / 200
        p = a + t[:, None] * (b - a)
        within = (np.abs(p % 1 - 0.5) < 0.5 - 1e-9).all(1)  # along a wall is not through it
        return not blocked[p[:, 1].astype(int), p[:, 0].astype(int)][within].any()

    best, queue = {}, [(0.0, 0)]
    while queue:
        d, i = heapq.heappop(queue)
        if i in best:
            continue
        best[i] = d
        for j in range(len(nodes)):
            if j not in best and sees(nodes[i], nodes[j]):
                heapq.heappush(queue, (d + np.hypot(*(nodes[i] - nodes[j])), j))
    time = np.full(blocked.shape, np.inf)
    for x, y in centres:
        ways = [best[i] + np.hypot(*(nodes[i] - (x, y))) for i in best if sees(np.array([x, y]), nodes[i])]
        time[int(y), int(x)] = min(ways, default=np.inf)
    return time


def test_travel_times_agree_with_any_angle_shortest_ways():
    blocked = free(16, 20)
    blocked[3:12, 8:10] = True
    blocked[10:12, 8:15] = True
    exact = any_angle((6, 15), blocked)
    _, time = goal_field(one_cell(blocked.shape, 6, 15), None, blocked, 1.0)
    free_cells = ~blocked
    error = time[free_cells] - exact[free_cells]
    assert error.max() < 2.5, "of 31 m: a first-order sweep, which rounds corners at cell centres"
    assert error.min() > -0.5
    assert np.isinf(time[blocked]).all()


def test_travel_times_are_never_longer_than_dijkstra_over_the_four_sides():
    sparse = pytest.importorskip("scipy.sparse")
    from scipy.sparse.csgraph import dijkstra

    blocked = random_ground(4)
    blocked[12, 15] = False
    ny, nx = blocked.shape
    number = np.arange(ny * nx).reshape(ny, nx)
    rows, columns = [], []
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        both = ~blocked[a] & ~blocked[b]
        rows += [number[a][both], number[b][both]]
        columns += [number[b][both], number[a][both]]
    rows, columns = np.concatenate(rows), np.concatenate(columns)
    graph = sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), (ny * nx, ny * nx))
    sides = dijkstra(graph, indices=number[12, 15]).reshape(ny, nx)
    _, time = goal_field(one_cell(blocked.shape, 12, 15), None, blocked, 1.0)
    np.testing.assert_array_equal(np.isfinite(time), np.isfinite(sides) & ~blocked)
    reached = np.isfinite(time)
    assert (time[reached] <= sides[reached] + 1e-9).all()
    assert (time[reached] >= sides[reached] / np.sqrt(2) - 1e-9).all()


def test_in_open_ground_the_way_is_straight_to_the_goal():
    direction, _ = goal_field(one_cell((101, 101), 50, 50), None, free(101, 101), 1.0)
    y, x = np.mgrid[:101, :101] - 50.0
    r = np.hypot(x, y)
    away = r > 0
    error = np.degrees(np.arccos(np.clip(-(direction[..., 0] * x + direction[..., 1] * y)[away] / r[away], -1, 1)))
    assert error.max() < 8
    ring = (r > 20) & (r < 45)
    eighths = np.degrees(np.arctan2(direction[..., 1], direction[..., 0]))[ring] % 45
    counts, _ = np.histogram(eighths, 9, (0, 45))
    assert counts.min() > 0.5 * counts.mean(), "not one of eight directions"


def test_costly_ground_is_avoided_when_the_way_round_costs_less():
    cost = np.ones((21, 41))
    cost[4:, 15:25] = 20.0
    direction, _ = goal_field(one_cell((21, 41), 12, 38), cost, free(21, 41), 1.0)
    assert direction[12, 12, 1] < -0.5, "down to the gap in the south"
    cost[4:, 15:25] = 1.2
    direction, _ = goal_field(one_cell((21, 41), 12, 38), cost, free(21, 41), 1.0)
    assert direction[12, 12, 0] > 0.95, "straight across"


def test_in_the_goal_nobody_is_sent_anywhere():
    goal = goal_mask((10, 10), 3.0, None, (20, 20), 1.0)
    direction, time = goal_field(goal, None, free(20, 20), 1.0)
    assert goal.sum() == 32
    assert not direction[goal].any() and not time[goal].any()
    np.testing.assert_allclose(lengths(direction)[~goal], 1.0)


def test_an_island_is_not_reached_and_says_so():
    blocked = free(12, 12)
    blocked[4:9, 4:9] = True
    blocked[5:8, 5:8] = False
    navigation = navigation_of([], [one_cell((12, 12), 1, 1)], blocked, cell=2.0)
    assert not navigation.fields[1][5:8, 5:8].any()
    np.testing.assert_array_equal(np.isfinite(navigation.times[0][[6, 11, 4], [6, 0, 4]]), [False, True, False])


def test_a_goal_inside_an_obstacle_is_reached_at_its_edge():
    blocked = free(15, 15)
    blocked[5:10, 5:10] = True
    direction, time = goal_field(one_cell((15, 15), 7, 7), None, blocked, 1.0)
    assert np.isfinite(time[~blocked]).all()
    assert time[7, 4] == 0
    assert direction[7, 0, 0] > 0.9


def test_a_goal_smaller_than_a_cell_is_the_cell_that_it_lies_in():
    np.testing.assert_array_equal(np.argwhere(goal_mask((4.1, 2.9), 0.1, None, (9, 9), 1.0)), [[2, 4]])
    assert not goal_mask((-3, 2), 0.5, None, (9, 9), 1.0).any()
    square = np.array([(1, 1), (3, 1), (3, 4), (1, 4)], float)
    np.testing.assert_array_equal(np.argwhere(goal_mask((2, 2), 99, square, (9, 9), 1.0)).max(0), [3, 2])


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
def test_an_impossible_cost_is_refused(bad):
    with pytest.raises(ValueError, match="cost"):
        goal_field(one_cell((4, 4), 1, 1), np.full((4, 4), bad), free(4, 4), 1.0)


def test_maps_of_one_cell_and_maps_without_free_ground():
    for blocked in (free(1, 1), ~free(1, 1), ~free(6, 7), free(1, 9), free(9, 1)):
        shape = blocked.shape
        navigation = navigation_of([guide([(0, 0.5), (9, 0.5)])], [one_cell(shape, 0, 0)], blocked, cell=1.0)
        assert np.isfinite(navigation.fields).all()
        assert np.isfinite(navigation.at([(0.5, 0.5), (99, -99)], 0)).all()
        assert np.isfinite(navigation.times[0][0, 0]) == (not blocked.any())
