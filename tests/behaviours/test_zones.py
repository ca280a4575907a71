"""What the zones of Couzin et al. 2002 say, pair by pair, and what becomes of a herd of them."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from small_herd import brush, forward_of, meadow, put

from tests.behaviours.test_models import scene, steer

ZONES = behaviours()["zones"]
WIDE = {"repulsion": 1.0, "orientation": 2.0, "attraction": 4.0, "blind_angle": 60.0, "max_turn": 200.0, "wander": 0.0}


def wish(xy, heading=0.0, **more):
    """Where the first animal faces next; it may turn as fast as it likes."""
    parameters = WIDE | {name: more.pop(name) for name in list(more) if name in ZONES.Params.model_fields}
    return ZONES.steer(scene(xy, heading, **more), np.array([0], np.int32), ZONES.Params(**parameters)).direction[0, :2]


def test_who_is_too_near_is_all_that_counts():
    crowd = [(0, 0), (0, 0.5), (2, 2), (-1, 4)]
    assert wish(crowd, (0.0, 1.0, 1.0, 1.0)) == pytest.approx((0, -1), abs=1e-12)
    two = wish([(0, 0), (0, 0.9), (0.3, 0)])
    assert two == pytest.approx(np.array([-1, -1]) / 2**0.5, abs=1e-12)  # by direction alone, however near


def test_the_middle_zone_aligns_and_the_far_one_draws():
    assert wish([(0, 0), (0, 2)], (0.0, 2.0)) == pytest.approx((np.cos(2), np.sin(2)), abs=1e-12)
    assert wish([(0, 0), (0, 5)], (0.0, 2.0)) == pytest.approx((0, 1), abs=1e-12)
    assert wish([(0, 0), (0, 7.5)], (0.0, 2.0)) == pytest.approx((1, 0), abs=1e-12)


def test_both_count_alike_however_many_are_in_each():
    herd = [(0, 0), (0, 2), (0, 2.5), (0, 2.9), (5, 0.0)]
    both = wish(herd, (0.0, np.pi / 2, np.pi / 2, np.pi / 2, 1.0))
    assert both == pytest.approx(np.array([1, 1]) / 2**0.5, abs=1e-12)


def test_behind_it_is_blind_but_for_who_is_too_near():
    behind = np.array([-np.cos(0.4), np.sin(0.4)])  # 23° off straight behind: within half of 60°
    assert wish([(0, 0), 2 * behind], (0.0, 2.0)) == pytest.approx((1, 0), abs=1e-12)
    assert wish([(0, 0), 2 * behind], (0.0, 2.0), blind_angle=40.0) == pytest.approx((np.cos(2), np.sin(2)), abs=1e-12)
    assert wish([(0, 0), 0.8 * behind], (0.0, 2.0)) == pytest.approx(-behind, abs=1e-12)


def test_it_turns_no_faster_than_it_can():
    turned = wish([(0, 0), (0, 2)], (0.0, 2.0), max_turn=0.7)
    assert np.arctan2(turned[1], turned[0]) == pytest.approx(0.7 / 32)


def test_other_kinds_are_only_kept_off():
    others = {"species": np.array([0, 1], np.int32)}
    assert wish([(0, 0), (0, 2)], (0.0, 2.0), **others) == pytest.approx((1, 0), abs=1e-12)
    assert wish([(0, 0), (0, 0.5)], (0.0, 2.0), **others) == pytest.approx((0, -1), abs=1e-12)


def test_obstacles_repel_and_who_leads_weighs_the_guide_against_the_others():
    assert wish([(0, 0)], obstacles=[(0, 0.5)]) == pytest.approx((0, -1), abs=1e-12)
    led = {"leader": [1, 0], "guidance": (1.0, 0.0), "guidance_weight": 0.5}
    expected = np.array([0.5, 1.0])
    assert wish([(0, 0), (0, 5)], **led) == pytest.approx(expected / np.hypot(*expected), abs=1e-12)
    assert steer(ZONES, scene([(0, 0)], 0.0, leader=[1], guidance=(0.0, 1.0)), max_turn=200.0, wander=0.0).direction[
        0, 1
    ] == pytest.approx(1.0)


@pytest.mark.parametrize("orientation, ordered", [(0.0, False), (10.0, True)])
def test_a_wide_zone_of_orientation_makes_a_march_of_a_swarm(orientation, ordered):
    herd = brush(
        "shoal", "zones", mean=3.0, vision={"range": 16.0, "sight": "metric"},
        repulsion=1.0, orientation=orientation, attraction=12.0, max_turn=2.0,
    )  # fmt: skip
    simulation = meadow(herd, width=200, height=200)
    rng = np.random.default_rng(4)
    put(simulation, 100 + rng.uniform(-3, 3, (30, 2)), rng.uniform(0, 6.28, 30), brush="shoal")
    simulation.run(640)
    polarization = np.hypot(*forward_of(simulation).mean(0))
    assert polarization > 0.9 if ordered else polarization < 0.6
