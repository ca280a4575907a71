"""How much animals turn by chance is found from where they were seen to head."""

import herd_film
import numpy as np
import pytest
from herd_film import Truth, evidence_of_truth
from small_herd import brush, straight

from behaviours.learning.noise_of import noise_of, wandering


def wanderers(wander=0.5, rate=0.0, meant=0.0, noise=0.0, count=60, seconds=6.0, fps=25, seed=0):
    """Animals that walk straight but for chance, straightened out at a rate, or turning to and fro as they mean to."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * fps)) / fps
    angle = np.zeros((len(t), count))
    for k in range(1, len(t)):
        angle[k] = angle[k - 1] * np.exp(-rate / fps) + wander / np.sqrt(fps) * rng.normal(size=count)
    angle += meant * np.sin(2 * t[:, None] + rng.uniform(0, 6, count)) + rng.uniform(-3, 3, count)
    angle += noise * rng.normal(size=angle.shape)
    forward = np.stack([np.cos(angle), np.sin(angle)], -1)
    xy = np.cumsum(forward, 0) / fps + rng.uniform(0, 30, (count, 2))
    return Truth("wanderers", fps, xy, forward, np.ones(angle.shape))


def told(truth, half=0.0):
    return noise_of(evidence_of_truth(truth).sightings, truth.fps, half)


@pytest.mark.parametrize("wander", [0.1, 0.5, 2.0])
def test_headings_that_wander_say_by_how_much(wander):
    found = told(wanderers(wander))
    assert found.wander == pytest.approx(wander, rel=0.12)
    assert found.error < 0.3 * wander and not found.bound


def test_turning_that_is_meant_is_no_chance():
    assert told(wanderers(0.0, meant=0.7)).wander < 0.06
    assert told(wanderers(0.5, meant=0.7)).wander == pytest.approx(0.5, rel=0.2)


def test_errors_of_sighting_are_no_chance():
    assert told(wanderers(0.0, noise=0.04)).wander < 0.06
    assert told(wanderers(0.5, noise=0.04)).wander == pytest.approx(0.5, rel=0.2)


def test_animals_that_are_straightened_out_wander_all_the_same():
    assert told(wanderers(0.6, rate=4.0)).wander == pytest.approx(0.6, rel=0.25)


def test_the_structure_of_a_short_lag_is_that_of_a_random_walk():
    assert wandering(np.array([0.01]), 1.0) == pytest.approx(2 * 0.01, rel=0.02)
    assert wandering(np.array([0.5]), 0.01) == pytest.approx(2 * 0.5, rel=0.02)


def test_a_tenth_of_a_second_tells_nothing():
    assert told(wanderers(seconds=0.12)) is None
    nobody = evidence_of_truth(wanderers(count=2)).sightings
    nobody.track[:] = -1
    assert noise_of(nobody, 25) is None


@pytest.mark.parametrize("wander", [0.0, 0.3, 1.0])
def test_our_own_animals_wander_as_their_brush_says(wander):
    truth = herd_film.herd(straight(wander=wander, max_turn=20.0), 60, 3.0, fps=32)
    assert told(truth).wander == pytest.approx(wander, rel=0.15, abs=0.05)


def test_a_dense_march_that_wanders_is_told_within_a_third():
    march = brush(
        "march", mean=4.0, wander=0.6, avoidance_weight=0.742, avoidance_radial=0.526, cohesion_weight=0.505,
        cohesion_radial=1.0, cohesion_angular=0.965, alignment_weight=0.499, alignment_angular=1.0,
    )  # fmt: skip
    assert told(herd_film.herd(march, 80, 3.0, fps=32)).wander == pytest.approx(0.6, rel=0.35)


def test_the_fastest_turn_is_the_limit_where_there_is_one():
    truth = herd_film.herd(straight(wander=3.0, max_turn=4.0), 40, 2.0, fps=32)
    assert told(truth).fastest == pytest.approx(4.0, rel=0.05)
