"""Simulated herds are observed as the tracks that they are compared with: with their noise, by their smoother."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from flockbrush.engine.noise import Noise
from scipy.signal import savgol_filter

from benchmarks.learning_models import evidence_of, tracks_of, truths
from flockbrush.film.observations import Evidence
from flockbrush.film.path_smoothing import SightSmoothing
from flockbrush.film.tracks import Tracks, smoothed, smoothed_alike
from flockbrush.learning.battery import Battery
from flockbrush.learning.response import response
from flockbrush.learning.simulate import simulated

NOISE = 0.03  # BL


@functools.cache
def truth_and_clip(name):
    _, brush = truths()[name]
    return brush, evidence_of(tracks_of(brush, 24)[:96], noise=NOISE)


@pytest.mark.parametrize("name", ["herd", "zones"])
def test_herds_of_the_truth_turn_as_the_animals_in_noisy_tracks(name):
    brush, clip = truth_and_clip(name)
    runs = [simulated(clip, brush, seed, True) for seed in range(3)]
    battery = Battery.of(clip)
    rows = battery.compared([battery.measured(run) for run in runs]) + response(clip, brush, runs)
    far = {row.name: row.far for row in rows}
    assert max(far["turning"], far["scatter of turns"], far["response to neighbours"], far["changes of speed"]) < 1.0


def test_paths_that_share_a_smoother_are_smoothed_as_each_alone():
    px = np.cumsum(Noise(3).normal("walk", 0, np.arange(30), 10), axis=0).reshape(30, 5, 2)
    px[12:15, 1] = np.nan  # a gap
    px[:6, 2] = np.nan  # comes later
    for stiffness in (0.1, 100.0):
        alone = smoothed(Tracks(px, np.arange(5)), stiffness).px
        np.testing.assert_allclose(smoothed_alike(px, stiffness), alone, atol=1e-9)


def test_the_smoother_is_saved_with_what_was_observed(tmp_path):
    _, clip = truth_and_clip("herd")
    clip.save(tmp_path / "fields.npz")
    assert Evidence.load(tmp_path / "fields.npz").smoothing == clip.smoothing
    assert clip.smoothing.heading is None and clip.smoothing.noise == pytest.approx(NOISE, rel=0.3)
    twice = clip.in_lengths_of(0.5 * clip.clip_body_px).smoothing
    assert twice.noise == pytest.approx(2 * clip.smoothing.noise) and twice.stiffness == clip.smoothing.stiffness


def test_herds_beside_a_film_are_seen_through_its_local_polynomials():
    """Against `savgol_filter` of scipy: what an animal's path becomes without noise, and how long noise lasts."""
    rng = np.random.default_rng(5)
    xy, angle = rng.normal(size=(40, 3, 2)).cumsum(0), np.unwrap(rng.normal(0, 0.3, (40, 3)).cumsum(0), axis=0)
    xy[25:, 1] = np.nan  # leaves
    seen, heading = SightSmoothing(3, 0.0, 0.0).observed(xy, angle, 25.0, rng)
    np.testing.assert_allclose(seen[3:-3, 0], savgol_filter(xy[:, 0], 7, 2, axis=0)[3:-3], atol=1e-6)
    off = heading[3:-3, 2] - savgol_filter(angle[:, 2], 7, 2)[3:-3]
    np.testing.assert_allclose(np.sin(off), 0.0, atol=1e-6)
    assert np.isnan(seen[25:, 1]).all() and np.isfinite(seen[:25, 1]).all()
    still = np.zeros((4000, 1))
    noise = SightSmoothing(3, 0.0, 0.1).observed(np.zeros((4000, 1, 2)), still, 25.0, rng)[1][:, 0]
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] > 0.5  # where noise itself is new in each frame


def test_the_smoother_of_a_film_is_saved_with_it(tmp_path):
    _, clip = truth_and_clip("herd")
    of_film = replace(clip, smoothing=SightSmoothing(2, 0.01, 0.03))
    of_film.save(tmp_path / "fields.npz")
    assert Evidence.load(tmp_path / "fields.npz").smoothing == of_film.smoothing
    assert of_film.in_lengths_of(0.5 * clip.clip_body_px).smoothing == SightSmoothing(2, 0.02, 0.03)
