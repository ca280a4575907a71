"""Guides, walls and goals as fields: scenes small enough to draw."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.systems.fast_marching import EVERYWHERE, march_, spread_
from flockbrush.systems.guide_field import guide_field
from flockbrush.systems.navigation import Navigation, blend, goal_field, goal_mask, navigation_of
from flockbrush.systems.walls import around_obstacles, cancelling_field
from ground_pictures import EAST, free, ground, guide, leads_into_a_wall, lengths, one_cell, random_ground
from hypothesis import given, settings
from hypothesis import strategies as st

# Guides


def test_a_straight_guide_gives_its_direction_within_its_radius_and_fades_exponentially_beyond():
    field = guide_field([guide([(0, 20.5), (60, 20.5)], strength=0.8, radius=6, decay=3)], (41, 60), 1.0)
    distance = np.abs(np.arange(41) - 20.0)
    expected = 0.8 * np.where(distance <= 6, 1.0, np.exp(-(distance - 6) / 3))
    assert distance.max() < 6 + 5 * 3
    np.testing.assert_allclose(field[:, 30, 0], expected, rtol=1e-12)
    np.testing.assert_allclose(field[:, :, 1], 0, atol=1e-15)


def test_a_slanted_guide_gives_its_own_direction_and_not_one_of_eight():
    field = guide_field([guide([(0, 5), (60, 35)], radius=8)], (41, 60), 1.0)
    reached = lengths(field) > 0.5
    assert reached.sum() > 900
    np.testing.assert_allclose(
        field[reached] / lengths(field)[reached, None], np.broadcast_to([2, 1] / np.sqrt(5), (reached.sum(), 2))
    )


def test_the_reach_is_in_metres_whatever_the_cell():
    coarse = guide_field([guide([(0, 20), (60, 20)], radius=6, decay=3)], (20, 30), 2.0)
    fine = guide_field([guide([(0, 20), (60, 20)], radius=6, decay=3)], (80, 120), 0.5)
    for y in (21.0, 25.0, 29.0, 35.0):  # centres of coarse cells, between two fine ones
        between = fine[int(y * 2) - 1 : int(y * 2) + 1, 60, 0].mean()
        assert coarse[int(y / 2), 15, 0] == pytest.approx(between, rel=0.02)


def test_a_circular_guide_turns_the_herd_about_its_centre():
    a = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    field = guide_field([guide(np.c_[25 + 12 * np.cos(a), 25 + 12 * np.sin(a)], radius=8, loop=True)], (50, 50), 1.0)
    y, x = np.mgrid[:50, :50] - 24.5
    r = np.hypot(x, y)
    ring = (r > 5) & (r < 19)
    along = (field[..., 1] * x - field[..., 0] * y) / np.maximum(r, 1e-9)
    assert (along[ring] > 0.97).all()
    assert lengths(field)[24:26, 24:26].max() < 0.6  # in the middle the directions cancel


def test_a_cell_takes_the_mean_direction_by_length_inside_and_strength():
    east, north = guide([(2, 2.5), (3, 2.5)], strength=0.5), guide([(2.5, 2.5), (2.5, 3)], strength=0.25)
    field = guide_field([east, north], (5, 5), 1.0)
    mean = np.array([0.5 * 1.0, 0.25 * 0.5]) / (0.5 * 1.0 + 0.25 * 0.5)
    np.testing.assert_allclose(field[2, 2], 0.5 * mean)


def test_opposing_guides_cancel():
    there, back = guide([(0, 10.5), (20, 10.5)]), guide([(20, 10.5), (0, 10.5)])
    assert lengths(guide_field([there, back], (21, 20), 1.0)).max() < 1e-12


def test_two_lanes_in_opposite_directions_stay_two_lanes():
    lanes = [guide([(0, 6.5), (30, 6.5)], radius=10), guide([(30, 14.5), (0, 14.5)], radius=10)]
    field = guide_field(lanes, (21, 30), 1.0)
    assert (field[6:9, 5:25, 0] > 0.5).all() and (field[12:15, 5:25, 0] < -0.5).all()
    np.testing.assert_allclose(field[10, 5:25, 0], 0, atol=1e-12)


def test_a_guide_along_the_border_of_two_rows_is_half_in_each():
    field = guide_field([guide([(0, 5), (20, 5)], radius=2)], (10, 20), 1.0)
    np.testing.assert_array_equal(field, field[::-1])
    np.testing.assert_allclose(field[4:6, :, 0], 1.0)


def test_guides_do_not_pass_walls_but_go_round_them():
    blocked = free(21, 30)
    blocked[10, :25] = True
    field = guide_field([guide([(0, 8.5), (20, 8.5)], radius=3, decay=2)], (21, 30), 1.0, blocked)
    assert field[8, 10, 0] == 1.0
    assert field[11, 10, 0] == 0.0, "13 m round the end of the wall, not 3 m through it"
    assert 0.0 < field[11, 25, 0] < 0.2
    assert not field[blocked].any()


def test_a_mirrored_scene_has_a_mirrored_field():
    blocked = free(24, 30)
    blocked[13:18, 9:12] = True  # no two ways round of the same length: such a tie has no mirror image
    points = np.array([(1, 4.25), (12, 9.5), (26.5, 19)])
    field = around_obstacles(guide_field([guide(points, radius=6, decay=4)], (24, 30), 1.0, blocked), blocked, 3.0)
    points[:, 1] = 24 - points[:, 1]
    other = blocked[::-1].copy()  # in the layout of the other maps, or kernels are compiled once more
    mirrored = around_obstacles(guide_field([guide(points, radius=6, decay=4)], (24, 30), 1.0, other), other, 3.0)
    np.testing.assert_allclose(mirrored[::-1] * [1, -1], field, atol=1e-9)


def test_a_turned_scene_has_a_turned_field():
    blocked = free(25, 25)
    blocked[12:18, 9:12] = True
    points = np.array([(1, 4.25), (12, 17.5), (22.5, 19)])

    def field(points, blocked):
        return around_obstacles(guide_field([guide(points, radius=6, decay=4)], (25, 25), 1.0, blocked), blocked, 3.0)

    turned = field(points[:, ::-1] * [-1, 1] + [25, 0], np.rot90(blocked, -1).copy())
    back = np.rot90(turned, 1)  # arrays have the north below: this is a quarter turn to the right
    np.testing.assert_allclose(np.stack([back[..., 1], -back[..., 0]], -1), field(points, blocked), atol=1e-9)


def test_the_order_of_guides_changes_no_bit():
    rng = np.random.default_rng(3)
    guides = [guide(rng.random((6, 2)) * 30, *(rng.random(3) * 5)) for _ in range(7)]
    field = guide_field(guides, (30, 30), 1.0)
    for _ in range(3):
        np.testing.assert_array_equal(guide_field([guides[i] for i in rng.permutation(7)], (30, 30), 1.0), field)


@pytest.mark.parametrize(
    "nothing",
    [
        [],
        [guide(np.zeros((0, 2)))],
        [guide([(3, 3)])],
        [guide([(3, 3), (3, 3), (3, 3)])],
        [guide([(-9, -9), (-2, -5)])],
        [guide([(1e300, 1e300), (2e300, 1e300)])],
        [guide([(0, 3), (9, 3)], strength=0)],
    ],
    ids=["no guides", "no points", "one point", "zero length", "off the map", "very far", "no strength"],
)
def test_a_guide_that_says_nothing_leaves_the_field_empty(nothing):
    assert not guide_field(nothing, (9, 9), 1.0).any()


def test_a_guide_that_leaves_the_map_counts_where_it_is_inside():
    field = guide_field([guide([(-1e6, 4.5), (1e6, 4.5)], radius=1, decay=0)], (9, 9), 1.0)
    np.testing.assert_allclose(field[3:6], np.broadcast_to(EAST, (3, 9, 2)))
    assert not field[[0, 1, 7, 8]].any()


def test_a_guide_inside_an_obstacle_says_nothing():
    blocked = free(9, 9)
    blocked[2:7, 2:7] = True
    assert not guide_field([guide([(3, 4.5), (6, 4.5)])], (9, 9), 1.0, blocked).any()


@pytest.mark.parametrize(
    "bad", [{"strength": -1}, {"radius": np.nan}, {"decay": np.inf}, {"points": [(0, 0), (np.nan, 1)]}]
)
def test_a_guide_with_an_impossible_number_is_named(bad):
    with pytest.raises(ValueError, match="guide 2"):
        guide_field([guide([(0, 0), (1, 1)]), guide(**{"points": [(0, 0), (1, 1)], **bad})], (4, 4), 1.0)


def test_every_piece_of_a_polyline_is_in_the_cell_that_it_crosses():
    rng = np.random.default_rng(5)
    points = rng.random((12, 2)) * [20, 15]
    field = guide_field([guide(points, radius=0, decay=0)], (15, 20), 1.0)
    t = np.linspace(0, 1, 20001)[:-1] + 0.5 / 20000
    expected = np.zeros((15, 20, 3))
    for a, b in pairwise(points):
        xy = a + t[:, None] * (b - a)
        piece = [*(b - a), np.hypot(*(b - a))]
        np.add.at(expected, (xy[:, 1].astype(int), xy[:, 0].astype(int)), np.array(piece) / 20000)
    mean = expected[..., :2] / np.maximum(expected[..., 2:], 1e-12)
    clear = expected[..., 2] > 0.05
    np.testing.assert_allclose(field[clear], mean[clear], atol=0.01)
    assert not field[expected[..., 2] == 0].any()


# Walls


def cancel_of(field, blocked, radius):
    """The cancelling field where no side is asked for."""
    return cancelling_field(field, blocked, radius, np.zeros(blocked.shape))[..., :2]


def test_equation_14_on_a_map_of_five_by_five():
    blocked = ground("""
        .....
        .....
        ..#..
        .....
        .....""")
    field = np.broadcast_to([0.6, 0.8], (5, 5, 2)).copy()
    cancel = cancel_of(field, blocked, 1)
    expected = np.zeros((5, 5, 2))
    expected[2, 1] = [-0.6, 0]  # V = east: -(GF . V) V
    expected[1, 2] = [0, -0.8]  # V = north
    expected[1, 1] = [-0.7, -0.7]  # V = north-east, GF . V = 1.4 / sqrt 2
    np.testing.assert_allclose(cancel, expected, atol=1e-12)


def test_in_a_corner_the_cancelling_fields_of_both_walls_are_summed():
    blocked = ground("""
        ####.
        ...#.
        ...#.
        ...#.
        .....""")
    field = np.broadcast_to([0.6, 0.8], (5, 5, 2)).copy()
    cancel = cancel_of(field, blocked, 1)
    np.testing.assert_allclose(cancel[3, 2], [-0.6, -0.8])  # east and north
    np.testing.assert_allclose(cancel[3, 1], [0, -0.8])
    np.testing.assert_allclose(cancel[2, 2], [-0.6, 0])
    assert not cancel[2, 1].any()


def test_the_cancelling_field_fades_linearly_to_its_radius():
    blocked = free(12, 9)
    blocked[10:] = True
    field = np.broadcast_to([0.0, 1.0], (12, 9, 2)).copy()
    cancel = cancel_of(field, blocked, 4)
    np.testing.assert_allclose(cancel[:10, 4, 1], [0, 0, 0, 0, 0, 0, -0.25, -0.5, -0.75, -1.0], atol=1e-12)
    assert not cancel_of(field, blocked, 0).any()


def test_the_cancelling_field_never_turns_a_guide_back():
    rng = np.random.default_rng(8)
    blocked = random_ground(8)
    field = rng.normal(size=(*blocked.shape, 2)) * ~blocked[..., None]
    cancel = cancel_of(field, blocked, 4)
    beside = np.zeros_like(blocked)
    for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)):
        beside |= np.roll(blocked, (dy, dx), (0, 1))
    far = ~beside & ~blocked & (lengths(cancel) > 0)
    assert far.any()
    assert (((field + cancel) * -cancel).sum(-1)[far] >= -1e-12).all()


def test_along_a_wall_the_herd_goes_along_it():
    blocked = free(12, 40)
    blocked[8] = True
    field = around_obstacles(guide_field([guide([(0, 2), (40, 14)], radius=20)], (12, 40), 1.0, blocked), blocked, 3.0)
    np.testing.assert_allclose(field[7, 10:30], np.broadcast_to(EAST, (20, 2)), atol=1e-9)
    assert (field[2, 5:35, 1] > 0.1).all()


def test_straight_at_a_wall_the_herd_turns_to_the_shorter_way_round():
    blocked = free(25, 50)
    blocked[6:17, 24:28] = True
    field = around_obstacles(
        guide_field([guide([(0, 11.5), (50, 11.5)], radius=9, decay=3)], (25, 50), 1.0, blocked), blocked, 3.0
    )
    assert (field[12:17, 23, 1] > 0.9).all(), "north of the middle they go north"
    assert (field[6:11, 23, 1] < -0.9).all(), "south of the middle they go south"
    assert (field[6:17, 5, 0] > 0.99).all(), "far off nobody turns"


def test_a_herd_that_is_guided_straight_through_an_obstacle_comes_out_behind_it():
    blocked = free(25, 50)
    blocked[6:17, 24:28] = True
    navigation = navigation_of([guide([(0, 10.3), (50, 10.3)], radius=12, decay=3)], [], blocked, cell=1.0)
    xy = np.c_[np.full(40, 3.0), np.linspace(6.1, 16.9, 40)]
    for _ in range(1500):
        xy = walk(navigation, xy, -1, 0.1)
        assert not blocked[np.clip(xy[:, 1], 0, 24.9).astype(int), np.clip(xy[:, 0], 0, 49.9).astype(int)].any()
    assert (xy[:, 0] > 45).all()


def test_where_no_way_leads_round_what_was_cancelled_stays_cancelled():
    blocked = free(15, 20)
    blocked[:, 10] = True
    field = around_obstacles(guide_field([guide([(0, 7.5), (20, 7.5)])], (15, 20), 1.0, blocked), blocked, 2.0)
    assert not field[:, 9].any()
    assert (field[5:10, 5, 0] > 0.99).all()


@pytest.mark.parametrize("seed", range(6))
def test_no_field_leads_into_a_wall(seed):
    blocked = random_ground(seed, share=(0.05, 0.15, 0.3)[seed % 3])
    rng = np.random.default_rng(seed)
    guides = [guide(rng.random((5, 2)) * [31, 24], *(rng.random(3) * [1, 8, 8])) for _ in range(3)]
    navigation = navigation_of(guides, [one_cell(blocked.shape, 12, 15)], blocked, cell=1.0)
    direction, _ = goal_field(one_cell(blocked.shape, 12, 15), None, blocked, 1.0)
    assert lengths(direction).any() and lengths(navigation.guidance).any()
    for field in (*navigation.fields, direction):
        assert leads_into_a_wall(field, blocked) == 0
        assert np.isfinite(field).all() and lengths(field).max() < 1 + 1e-12


def test_between_obstacles_that_touch_at_a_corner_there_is_no_way():
    blocked = ground("""
        ..#..
        ..#..
        ..#..
        ...##
        .....""")
    blocked[1, :3] = True
    blocked[1, 3:] = False
    _, time = goal_field(one_cell((5, 5), 4, 4), None, blocked, 1.0)
    assert np.isinf(time[2:, :2]).all()
    assert np.isfinite(time[0]).all()


def test_no_way_and_no_guide_cuts_the_corner_of_an_obstacle():
    blocked = ground("""
        .#
        ..""")
    goals = np.array([[False, True], [True, False]])  # beside the animal to the east and to the north
    _, time = goal_field(goals, None, blocked, 1.0)
    assert time[0, 0] == 1.0, "not .7, between the two and into the corner"
    seeds = np.array([[0.5, np.inf], [0.0, np.inf]])
    slowness = np.array([[1.0, 1.0], [1.0, np.inf]])
    distance, order = march_(seeds, slowness, np.inf, EVERYWHERE)
    values = spread_(np.array([[[0.0], [0.0]], [[1.0], [0.0]]]), seeds, distance, order)
    assert values[0, 1, 0] == 0.0, "what is said behind the corner is not heard"


def test_beside_a_wall_an_animal_is_led_off_it():
    blocked = free(10, 20)
    blocked[6:] = True
    navigation = navigation_of([guide([(0, 5.5), (20, 5.5)], radius=3)], [], blocked, cell=1.0)
    felt = navigation.at([(10.0, 5.95), (10.0, 6.4), (10.0, 5.5)])
    assert felt[0, 0] > 0.5 and felt[0, 1] < -0.4
    assert felt[1, 1] < -0.8
    np.testing.assert_allclose(felt[2], EAST, atol=1e-12)


# Guides and goals together


def walk(navigation, xy, goal, step):
    felt = navigation.at(xy, goal)
    return xy + step * felt / np.maximum(np.hypot(*felt.T), 1e-9)[:, None]


@pytest.mark.parametrize("strength", [None, 0.7], ids=["goal alone", "with a guide that disagrees"])
def test_out_of_a_pocket_everyone_comes_to_the_goal_without_touching_the_wall(strength):
    blocked = free(40, 50)
    blocked[10:30, 30:33] = True
    blocked[10:13, 12:33] = True
    blocked[27:30, 12:33] = True
    goal = goal_mask((43.0, 20.0), 2.0, None, (40, 50), 1.0)
    guides = [] if strength is None else [guide([(2, 2), (2, 38)], strength=strength, radius=2, decay=1)]
    navigation = navigation_of(guides, [goal], blocked, cell=1.0)
    iy, ix = np.nonzero(~blocked)
    start = np.random.default_rng(1).choice(len(iy), 200, replace=False)
    xy = np.c_[ix[start], iy[start]] + np.random.default_rng(2).random((200, 2))
    arrived = np.zeros(200, bool)
    for _ in range(1600):
        xy = np.where(arrived[:, None], xy, walk(navigation, xy, 0, 0.1))
        xy = np.clip(xy, 0, (49.999, 39.999))  # the edge of the map is a fence
        under = xy.astype(int)
        assert not blocked[under[:, 1], under[:, 0]].any()
        arrived |= goal[under[:, 1], under[:, 0]]
    assert arrived.all()


def test_a_strong_guide_rules_near_it_and_the_goal_far_from_it():
    goal = one_cell((41, 60), 38, 57)
    navigation = navigation_of([guide([(0, 5.5), (60, 5.5)], radius=4, decay=1)], [goal], free(41, 60), cell=1.0)
    np.testing.assert_allclose(navigation.fields[1][5, 20], EAST, atol=1e-12)
    alone, _ = goal_field(goal, None, free(41, 60), 1.0)
    np.testing.assert_allclose(navigation.fields[1][30, 20], alone[30, 20], atol=1e-6)
    np.testing.assert_allclose(lengths(navigation.fields[1])[~goal], 1.0)


def test_a_guide_of_half_strength_shares_with_the_goal():
    half = np.array([[[0.5, 0.0]]])
    mixed = blend(half, np.array([[[0.0, 1.0]]]))
    np.testing.assert_allclose(mixed, [[[np.sqrt(0.5), np.sqrt(0.5)]]])
    np.testing.assert_allclose(blend(half, -2 * half), -2 * half, err_msg="where they cancel the goal wins")
    np.testing.assert_array_equal(blend(half, np.zeros((1, 1, 2))), half)


def test_a_guide_to_one_goal_does_not_concern_those_bound_to_another():
    def named(points, goal):
        return SimpleNamespace(
            points=np.array(points, float), strength=1.0, radius=3.0, decay=1.0, loop=False, goal=goal
        )

    def place(name, *xy):
        return SimpleNamespace(name=name, xy=np.array(xy), radius=1.0, polygon=None)

    goals = [place("water", 18.5, 10.5), place("barn", 1.5, 10.5)]
    navigation = navigation_of([named([(0, 10.5), (20, 10.5)], "water")], goals, free(20, 20), cell=1.0)
    felt = navigation.at([(10.0, 10.5)] * 3, [-1, 0, 1])
    np.testing.assert_allclose(felt, [EAST, EAST, (-1, 0)], atol=1e-9)
    with pytest.raises(ValueError, match="-1 to 1"):
        navigation.at([(10.0, 10.5)], 2)


def test_between_cell_centres_the_field_is_bilinear_and_beyond_the_map_it_goes_on():
    fields = np.random.default_rng(0).random((1, 3, 4, 2))
    navigation = Navigation(2.0, fields, np.empty((0, 3, 4)))
    np.testing.assert_allclose(navigation.at([(3.0, 3.0)])[0], fields[0, 1, 1])
    np.testing.assert_allclose(navigation.at([(4.0, 4.0)])[0], fields[0, 1:3, 1:3].mean((0, 1)))
    np.testing.assert_allclose(navigation.at([(-50.0, 99.0)])[0], fields[0, 2, 0])


def test_without_guides_and_goals_nobody_is_led():
    navigation = navigation_of([], [], random_ground(2), cell=1.0)
    assert navigation.fields.shape == (1, 24, 31, 2) and not navigation.fields.any()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(0, 0.6), st.integers(1, 12), st.integers(1, 12))
def test_any_ground_gives_fields_that_are_finite_repeatable_and_kept_off_walls(seed, share, ny, nx):
    rng = np.random.default_rng(seed)
    blocked = rng.random((ny, nx)) < share
    points = np.round(rng.normal(0.5, 0.6, (4, 2)) * [nx, ny] * 2) / 2  # often on borders of cells, or off the map
    guides = [guide(points, *(rng.random(3) * [2, 5, 5]), loop=bool(seed % 2))]
    goals = [rng.random((ny, nx)) < 0.1]
    cost = 0.01 + rng.random((ny, nx)) * 100
    first, again = (navigation_of(guides, goals, blocked, cost, 1.0) for _ in range(2))
    np.testing.assert_array_equal(first.fields, again.fields)
    assert np.isfinite(first.fields).all()
    assert all(leads_into_a_wall(field, blocked) == 0 for field in first.fields)
