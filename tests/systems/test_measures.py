"""Measures against figures one can work out, and against brute force."""

import numpy as np
import pytest
from flockbrush.systems.measures import (
    compute_aspect_ratio,
    compute_crossings,
    compute_density,
    compute_elongation,
    compute_group_spread,
    compute_largest_part,
    compute_milling,
    compute_neighbour_map,
    compute_nn_bearing,
    compute_nnd,
    compute_polarization,
    compute_rotation,
    compute_speed,
    compute_turning_angle,
    compute_unwrapped,
    herd_measures,
    measures,
)
from hypothesis import given
from hypothesis import strategies as st

N = 500


def ring(n=60, radius=5.0, centre=(3.0, -2.0)):
    angle = 2 * np.pi * np.arange(n) / n
    xy = np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return xy, np.column_stack([-np.sin(angle), np.cos(angle)])


def random_herd(seed=1, n=N):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, n)
    return rng.uniform(0, 20, (n, 2)), np.column_stack([np.cos(angle), np.sin(angle)])


def test_a_perfect_mill_mills_and_is_not_polarized():
    xy, forward = ring()
    assert compute_milling(xy, forward) == pytest.approx(1.0)
    assert compute_rotation(xy, forward) == pytest.approx(1.0)
    assert compute_rotation(xy, -forward) == pytest.approx(-1.0)
    assert compute_milling(xy, -forward) == pytest.approx(1.0)
    assert compute_polarization(forward) == pytest.approx(0.0, abs=1e-12)


def test_an_aligned_flock_is_polarized_and_does_not_mill():
    xy, _ = random_herd()
    forward = np.tile([0.6, 0.8, 0.0], (N, 1))
    assert compute_polarization(forward) == pytest.approx(1.0)
    assert compute_milling(xy - xy.mean(0), forward) < 3 / np.sqrt(N)
    square, _ = ring(4)
    assert compute_milling(square, np.tile([1.0, 0.0], (4, 1))) == pytest.approx(0.0, abs=1e-12)


def test_random_headings_have_the_order_of_one_over_root_n():
    orders = [compute_polarization(random_herd(seed)[1]) for seed in range(60)]
    # the length of a mean of N unit vectors at random has the mean sqrt(pi / N) / 2
    assert np.mean(orders) == pytest.approx(np.sqrt(np.pi / N) / 2, rel=0.2)
    mills = [compute_milling(*random_herd(seed)) for seed in range(60)]
    assert np.mean(mills) == pytest.approx(np.sqrt(1 / (np.pi * N)), rel=0.25)  # |normal| of variance 1 / 2N


def test_the_length_of_the_arrows_does_not_count():
    xy, forward = random_herd()
    longer = forward * np.random.default_rng(2).uniform(0.1, 9, (N, 1))
    assert compute_polarization(longer) == pytest.approx(compute_polarization(forward))
    assert compute_milling(xy, longer) == pytest.approx(compute_milling(xy, forward))


def test_those_who_stand_have_no_direction():
    assert compute_polarization(np.array([(1.0, 0.0), (0.0, 0.0)])) == pytest.approx(0.5)


def test_milling_is_about_the_centroid_unless_told_otherwise():
    xy, forward = ring(centre=(0, 0))
    assert compute_milling(xy, forward, centre=(500.0, 0.0)) < 0.05


def test_nearest_neighbours_by_brute_force_also_across_the_seam():
    xy, _ = random_herd(n=80)
    for wrap in (None, (20.0, 20.0)):
        off = xy[:, None] - xy
        if wrap:
            off -= 20 * np.round(off / 20)
        distance = np.hypot(off[..., 0], off[..., 1]) + 1e9 * np.eye(80)
        assert compute_nnd(xy, wrap) == pytest.approx(distance.min(1))


def test_bearings_of_the_nearest_neighbour():
    xy = np.array([(0, 0), (1, 1), (10, 0), (10, -1)], float)
    forward = np.array([(1, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1, 0)], float)
    found = compute_nn_bearing(xy, forward)
    found[2] = abs(found[2])  # straight behind is both pi and -pi
    assert found == pytest.approx([np.pi / 4, -3 * np.pi / 4, np.pi, 0.0])


def test_spread_elongation_and_density_of_simple_shapes():
    square = np.array([(0, 0), (2, 0), (2, 2), (0, 2)], float)
    assert compute_group_spread(square) == pytest.approx(np.sqrt(2))
    assert compute_elongation(square) == pytest.approx(0.0)
    assert compute_density(square) == pytest.approx(1.0)
    line = np.column_stack([np.arange(9.0), 2 * np.arange(9.0)])
    assert compute_elongation(line) == pytest.approx(1.0)
    assert np.isnan(compute_density(line))
    assert compute_elongation(square * (1, 3)) == pytest.approx(1 - 1 / 3)


def test_a_file_is_long_and_a_rank_is_wide():
    place, east = np.column_stack([np.arange(11.0), np.zeros(11)]), np.tile([1.0, 0.0, 0.0], (11, 1))
    assert compute_aspect_ratio(place, east) == 0.0
    box = np.array([(0, 0), (4, 0), (4, 2), (0, 2)], float)
    assert compute_aspect_ratio(box, east[:4]) == pytest.approx(0.5)
    assert compute_aspect_ratio(box, np.tile([0.0, 1.0], (4, 1))) == pytest.approx(2.0)
    assert np.isnan(compute_aspect_ratio(box, np.array([(1, 0), (-1, 0), (0, 1), (0, -1)], float)))


def test_the_largest_part_by_brute_force():
    xy, _ = random_herd(4, 60)
    for link in (0.5, 1.2, 2.0, 30.0):
        near = np.hypot(*(xy[:, None] - xy).T) <= link
        reach = np.linalg.matrix_power(near.astype(float), 60) > 0
        assert compute_largest_part(xy, link) == pytest.approx(reach.sum(1).max() / 60)


def test_parts_hang_together_across_the_seam():
    xy = np.array([(0.5, 5), (19.5, 5), (10, 5)], float)
    assert compute_largest_part(xy, 2.0) == pytest.approx(1 / 3)
    assert compute_largest_part(xy, 2.0, (20.0, 20.0)) == pytest.approx(2 / 3)


def test_turning_angles_are_signed():
    angle = np.array([0.0, 1.0, 3.0, -3.0])
    after = angle + np.array([0.5, -0.5, 0.4, -0.4])
    unit = [np.column_stack([np.cos(a), np.sin(a), np.zeros(4)]) for a in (angle, after)]
    assert compute_turning_angle(*unit) == pytest.approx([0.5, -0.5, 0.4, -0.4])


def test_speed_counts_the_climb():
    assert compute_speed(np.array([(3.0, 4.0, 12.0)])).tolist() == [13.0]


@given(st.integers(0, 1000), st.integers(2, 40))
def test_the_neighbour_map_by_brute_force(seed, n):
    xy, forward = random_herd(seed, n)
    found = compute_neighbour_map(xy, np.column_stack([forward, np.zeros(n)]), 4.0, 8)
    expected = np.zeros((8, 8))
    for i in range(n):
        for j in range(n):
            off = xy[j] - xy[i]
            ahead, right = off @ forward[i], off[0] * forward[i, 1] - off[1] * forward[i, 0]
            if i != j and abs(ahead) < 4 and abs(right) < 4:
                expected[int((ahead + 4) // 1), int((right + 4) // 1)] += 1 / n
    assert found == pytest.approx(expected)


def test_crossings_are_counted_by_side_and_each_once():
    gate = np.array([(0, 0), (0, 5), (0, 10)], float)  # northwards: west is to its left
    before = np.array([(1, 1), (1, 7), (-1, 2), (1, 12), (1, 3), (0.5, 5)], float)
    after = np.array([(-1, 1), (-1, 7), (1, 2), (-1, 12), (2, 3), (-0.5, 5)], float)
    assert compute_crossings(before, after, gate) == (3, 1)
    back = compute_crossings(after, before, gate)
    assert back == (1, 3)


def test_a_herd_on_the_seam_measures_as_in_the_middle():
    wrap = (40.0, 30.0)
    rng = np.random.default_rng(8)
    xyz = np.column_stack([rng.normal((20, 15), 2, (60, 2)), np.zeros(60)])
    _, forward = random_herd(n=60)
    forward = np.column_stack([forward, np.zeros(60)])
    middle = herd_measures(xyz, forward, forward, 1.0, wrap)
    for shift in ((20, 0), (0, 15), (20, 15), (13, 8)):
        moved = xyz.copy()
        moved[:, :2] = np.mod(moved[:, :2] + shift, wrap)
        assert herd_measures(moved, forward, forward, 1.0, wrap) == pytest.approx(middle)
    assert middle["largest_part"] == 1.0
    assert compute_unwrapped(xyz, None).tolist() == xyz[:, :2].tolist()


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_few_animals_are_measured_or_not_a_number(n):
    xyz = np.arange(3.0 * n).reshape(n, 3)
    forward = np.tile([1.0, 0.0, 0.0], (n, 1))
    for wrap in (None, (40.0, 40.0)):
        found = herd_measures(xyz, forward, forward, 1.0, wrap)
        assert found["animals"] == n
        assert found["polarization"] == (pytest.approx(1.0) if n else pytest.approx(np.nan, nan_ok=True))
        assert all(np.ndim(value) == 0 for value in found.values())


def test_an_axis_spells_a_measure_out_and_has_its_unit():
    known = measures()
    assert known["nnd"].axis() == "nearest neighbour distance, m"
    assert known["speed_mean"].axis() == "speed mean, m/s"
    assert known["polarization"].axis() == "polarization"
    assert known["nnd"].axis("body lengths") == "nearest neighbour distance, BL"
    assert [known[name].unit_in("body lengths") for name in ("speed_mean", "density")] == ["BL/s", "1/BL²"]


def test_numbers_of_numpy_become_numbers_of_python(monkeypatch):
    from flockbrush.systems import measures as room

    for name, value in {
        "many": np.int64(3),
        "wide": np.float32(0.5),
        "zero_d": np.array(2.0),
        "some": np.bool_(True),
    }.items():
        monkeypatch.setitem(room._registry, name, room.Measure(name, lambda herd, value=value: value, "own"))
    found = herd_measures(np.zeros((1, 3)), np.zeros((1, 3)), np.eye(3)[:1], 1.0)
    own = [found[name] for name in ("many", "wide", "zero_d", "some")]
    assert [type(value) for value in own] == [int, float, float, bool] and own == [3, 0.5, 2.0, True]


def test_animals_whose_heading_is_unknown_do_not_count_in_measures_of_headings():
    xyz = np.array([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (2.0, 2.0, 0.0)])
    forward = np.array([(0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)])
    found = herd_measures(xyz, forward, forward, 1.0)
    assert found["polarization"] == pytest.approx(1.0)
    assert found["rotation"] == pytest.approx(compute_rotation(xyz[:2, :2], forward[:2], xyz[:, :2].mean(0)))
    assert found["animals"] == 3
