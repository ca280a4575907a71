"""What the benchmark of sliders computes from runs, and the ranges that it is given."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.sliders import Range

from benchmarks.macros import given, interval, moved, movements, ratio, scene_of, with_slider
from flockbrush.studio.panels.macros import macros_of


def runs(courses, seeds=16, seed=0, deviation=1.0):
    """Values (positions, seeds, measures) around the courses of measures, (positions, measures)."""
    courses = np.asarray(courses, float)
    noise = np.random.default_rng(seed).normal(size=(len(courses), seeds, courses.shape[1]))
    return courses[:, None] + deviation * noise


def test_what_does_not_move_moves_by_nothing_and_what_moves_by_its_deviations():
    flat = np.full((5, 1), 100.0)
    found = np.array([moved(runs(flat, seed=k))[0] for k in range(200)])
    assert np.median(found) < 0.1 and found.mean() < 0.25
    far = [moved(runs([[100], [102], [110], [105], [101]], seed=k))[0] for k in range(50)]
    assert np.mean(far) == pytest.approx(10.0, rel=0.05)


def test_a_ratio_is_that_of_the_movements_and_lies_in_its_interval():
    values = runs([[100, 200], [110, 201], [120, 203], [130, 204], [140, 205]], seeds=64)
    low, high = interval(values)
    apart = ratio(moved(values), 64)
    assert low < 8.0 < high and low < apart < high and high - low < 5.0
    assert ratio(np.array([9.0, 0.0]), 2) == 9.0  # one standard error of the difference of two means


def test_a_seed_that_counts_for_nothing_is_left_out():
    values = runs([[100, 200], [110, 201], [105, 203]], seeds=6)
    once = np.array([1.0, 1, 1, 0, 1, 0])
    np.testing.assert_allclose(moved(values, times=once), moved(values[:, [0, 1, 2, 4]]))


def test_given_ranges_are_those_of_a_slider():
    general = next(one for one in macros_of(shipped().get("bolt"), {}) if one.slider == "order")
    slider = given(general, ["alignment_weight=0.01:1:times", "mean=5.5:4.5", "wander=2:0:0.1"])
    assert slider.ranges == (
        Range("params", "alignment_weight", 0.01, 1.0, True), Range("speed", "mean", 5.5, 4.5),
        Range("params", "wander", 2.0, 0.0, False, 0.1),
    )  # fmt: skip
    assert slider.slider == "order"


def test_brushes_start_as_their_bands_say_and_formations_have_no_order_of_headings():
    assert scene_of("march")["heading"] == 0.0 and scene_of("mill-hollow")["start"] == "ring"
    assert scene_of("starlings")["heading"] == 0.0 and scene_of("rest")["heading"] is None
    assert not {"cranes", "geese", "pelicans", "skein"} & set(with_slider("order"))


def moments(angles, radius=10.0, speed=2.0):
    """Positions, velocities and headings of a ring of 12 that turns, at 1, 1/2, 1/4 and 0 s ago."""
    found = []
    for angle in angles:
        at = angle + np.arange(12) * np.pi / 6
        forward = np.stack([-np.sin(at), np.cos(at), 0 * at], 1)
        found.append((radius * np.stack([np.cos(at), np.sin(at), 0 * at], 1), speed * forward, forward))
    return found


def test_who_turns_steadily_does_not_wander():
    steady = movements(moments([0.0, 0.5, 0.75, 1.0]), 1.0)
    assert steady["turning"] == pytest.approx(0.0, abs=1e-9) and steady["unevenness"] == pytest.approx(0.0, abs=1e-9)
    assert movements(moments([0.0, 0.5, 0.75, 1.3]), 1.0)["turning"] == pytest.approx(0.3)


def test_a_herd_that_walks_and_turns_as_a_whole_does_not_shuffle():
    rng = np.random.default_rng(2)
    xy, ahead = rng.normal(size=(20, 2)), np.array([1.0, 0.0])
    told = []
    for angle in (0.0, 0.2, 0.3, 0.4):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        places = np.column_stack([xy @ turn.T + 5.0 * angle, np.zeros(20)])
        forward = np.column_stack([np.tile(turn @ ahead, (20, 1)), np.zeros(20)])
        told.append((places, forward, forward))
    assert movements(told, 1.0)["shuffling"] == pytest.approx(0.0, abs=1e-9)
    told[-1][0][0, 1] += 4.0
    assert movements(told, 2.0)["shuffling"] == pytest.approx((19 * 0.2 + 3.8) / 20 / 2)
