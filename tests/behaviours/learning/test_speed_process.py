"""How the speeds of animals come and go is found from their tracks."""

import numpy as np
import pytest

from benchmarks import foreign_herds
from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.speed_process import speed_process


def walkers(mean=2.0, deviation=0.5, reversion=1.0, count=80, seconds=8.0, fps=25, common=0.0, seed=0):
    """Animals that go their own straight ways, with speeds of an Ornstein-Uhlenbeck process."""
    rng = np.random.default_rng(seed)
    keep = np.exp(-reversion / fps)
    spread = deviation / np.sqrt(2 * reversion)
    v = np.empty((round(seconds * fps), count))
    v[0] = spread * rng.normal(size=count)
    for t in range(1, len(v)):
        v[t] = keep * v[t - 1] + spread * np.sqrt(1 - keep**2) * rng.normal(size=count)
    v += mean + common * np.sin(np.arange(len(v)) / fps)[:, None]
    angle = rng.uniform(-np.pi, np.pi, count)
    forward = np.broadcast_to(np.column_stack([np.cos(angle), np.sin(angle)]), (*v.shape, 2))
    xy = np.cumsum(v[..., None] * forward, axis=0) / fps + rng.uniform(0, 60, (count, 2))
    return Truth("walkers", fps, xy, forward, v)


@pytest.mark.parametrize("reversion", [0.5, 1.0, 2.0])
def test_a_speed_is_forgotten_at_the_rate_at_which_it_was_made_to_be(reversion):
    truth = walkers(reversion=reversion)
    process = speed_process(evidence_of_truth(truth).sightings, truth.fps)
    assert process.mean == pytest.approx(2.0, rel=0.05)
    assert process.reversion == pytest.approx(reversion, rel=0.35)
    assert process.deviation == pytest.approx(0.5, rel=0.2)
    assert abs(process.reversion - reversion) < 3 * process.error + 0.1


def test_a_herd_that_speeds_up_and_slows_down_together_does_not_spread():
    truth = walkers(common=0.8)
    process = speed_process(evidence_of_truth(truth).sightings, truth.fps)
    assert process.reversion == pytest.approx(1.0, rel=0.35)
    assert process.spread == pytest.approx(0.5 / np.sqrt(2), rel=0.15)


def test_errors_of_single_sights_do_not_count():
    truth = walkers(deviation=0.3)
    sightings = evidence_of_truth(truth).sightings
    sightings.speed = sightings.speed + np.random.default_rng(1).normal(0, 0.3, len(sightings.speed))
    process = speed_process(sightings, truth.fps)
    assert process.spread == pytest.approx(0.3 / np.sqrt(2), rel=0.25)


def test_speeds_that_are_averages_over_half_a_second_have_the_process_back_that_was_averaged():
    truth = walkers(reversion=2.0, count=120)
    sightings = evidence_of_truth(truth).sightings
    table = truth.speed
    at = np.arange(-6, 7)
    weight = (1 - (at / 6.5) ** 2) / (1 - (at / 6.5) ** 2).sum()  # of a line through 13 places
    sightings.speed = np.apply_along_axis(np.convolve, 0, table, weight, "same").ravel()
    sightings = sightings.part(slice(6, len(table) - 6))
    process = speed_process(sightings, truth.fps, 0.5)
    assert process.reversion == pytest.approx(2.0, rel=0.35)
    assert process.deviation == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_a_process_varies_no_more_than_the_speeds_that_are_seen(seed):
    truth = walkers(seconds=2.0, count=25, fps=10, reversion=4.0, seed=seed)
    sightings = evidence_of_truth(truth).sightings
    sightings.speed = sightings.speed + np.random.default_rng(seed).normal(0, 0.2, len(sightings.speed))
    process = speed_process(sightings, truth.fps, 0.1)
    assert process.spread < 1.2 * np.std(sightings.speed)


def test_nothing_is_told_of_half_a_second_or_of_three_animals():
    short, few = walkers(seconds=0.5), walkers(count=3)
    assert speed_process(evidence_of_truth(walkers(seconds=0.3)).sightings, 25).reversion is None
    assert speed_process(evidence_of_truth(short).sightings, 25).reversion is None
    assert speed_process(evidence_of_truth(few).sightings, 25).reversion is None
    assert speed_process(evidence_of_truth(few).sightings, 25).mean == pytest.approx(2.0, rel=0.2)


def test_a_brush_of_ours_has_its_own_process_back():
    truth = foreign_herds.herd("own:march", 100, 5.0, fps=16)
    process = speed_process(evidence_of_truth(truth).sightings, 16)
    assert process.mean == pytest.approx(4.0, rel=0.02)
    assert process.reversion == pytest.approx(1.0, rel=0.35)
    assert process.deviation == pytest.approx(0.2, rel=0.2)
