"""A photograph tells where bodies lie, how far apart and along which axes; which end is the head it does not tell."""

import numpy as np
import pytest

from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning.herd_views import followed, told_apart, view_of
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.photo import standing
from flockbrush.learning.rollout import Run
from flockbrush.learning.scores import ClipTarget, distance, measures_of, spacings

N = 64


def photograph(angles, apart=1.5):
    """Bodies on an uneven lattice, each shown along its axis, either end first."""
    rng = np.random.default_rng(3)
    xy = (np.argwhere(np.ones((8, 8))) + rng.uniform(-0.2, 0.2, (N, 2))) * apart
    angles = np.broadcast_to(angles, N) + np.pi * rng.integers(0, 2, N)
    forward = np.column_stack([np.cos(angles), np.sin(angles)])
    twice = Truth("photo", 10.0, np.stack([xy, xy]), np.stack([forward, forward]), np.ones((2, N)))
    return evidence_of_truth(twice).part(slice(0, 1))


def run_of(xy, frames=8):
    """Animals that stand there, heading east."""
    ids, east = np.tile(np.arange(len(xy)), frames), np.tile([1.0, 0.0], (frames * len(xy), 1))
    return Run(
        np.arange(frames) / 2.0, np.arange(frames + 1) * len(xy), ids, np.tile(xy, (frames, 1)), east, 0.0 * east
    )  # fmt: skip


def test_a_herd_from_a_photograph_begins_where_its_bodies_lie():
    photo = photograph(np.random.default_rng(1).uniform(-np.pi, np.pi, N))
    start = start_of(standing(photo, 0.7), 0)
    assert np.array_equal(start.xy, photo.sightings.xy) and (start.speed == 0.7).all()
    along = np.abs((start.forward * photo.sightings.forward).sum(1))
    assert along == pytest.approx(1.0)


def test_bodies_that_lie_alike_head_alike_and_others_either_way():
    alike = start_of(standing(photograph(0.4)), 0).forward
    assert np.linalg.norm(alike.mean(0)) > 0.99
    rng = np.random.default_rng(5)
    others = start_of(standing(photograph(rng.uniform(-np.pi, np.pi, N))), 0).forward
    assert np.linalg.norm(others.mean(0)) < 0.4


def test_nothing_is_made_of_heads_that_are_guessed():
    clip = standing(photograph(0.4))
    assert told_apart(clip) and not followed(clip)
    measured = measures_of(view_of(clip), 10)
    assert np.isnan(measured["polarization"]).all() and np.isnan(measured["speed"]).all()
    assert np.isfinite(measured["nearest neighbour"]).all()


def test_a_looser_herd_is_farther_from_the_photograph_by_its_spacing():
    clip = standing(photograph(0.4))
    target, xy = ClipTarget.of(clip), clip.sightings.xy[:N]
    same, looser = (distance(run_of(by * xy), clip, target)["spacing"] for by in (1.0, 1.3))
    assert same < 0.1
    assert looser == pytest.approx(np.log(1.3) / 0.05, rel=0.02)
    neighbours = [distance(run_of(by * xy), clip, target)["neighbours"] for by in (1.0, 1.3)]
    assert neighbours[0] == pytest.approx(0.0, abs=1e-9) and neighbours[1] > 2.0


def test_spacings_are_deciles_of_the_distances_to_the_nearest():
    line = np.column_stack([np.cumsum(np.arange(11.0)), np.zeros(11)])  # gaps of 1 to 10
    assert spacings([line])[4] == pytest.approx(np.median([1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]))
    assert np.isnan(spacings([])).all()
