"""Down the errors of the paper, from fields alone."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from flockbrush.behaviours.brush import SpeedSpec

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning.torch_descent import STEP, FollowedClip, descend, fixed_step

SPEED = SpeedSpec(mean=3.0, deviation=0.2)


def clip(name="band", seconds=0.6, count=30, **more):
    return evidence_of_truth(herd(name, count, seconds, 16.0, seed=1, warmup=1.0), sight=False, grid=12, **more)


def followed(film, **how):
    return FollowedClip(film, speed=SPEED, **how)


def test_a_band_teaches_to_march():
    """From numbers that do not align, towards more alignment and less error."""
    begin = np.array([0.9, 0.5, 0.5, 0.1, 0.5, 0.5, 0.001, 0.5, 0.5, 0.15, 1.0, 0.5])
    found = descend([followed(clip(), beta=0.0)], begin, seed=1, steps=45)
    assert found.theta[6] > 0.02
    assert found.losses[-9:].mean() < found.losses[:9].mean()


def test_the_same_seed_gives_the_same_numbers():
    one, other = (descend([followed(clip())], np.full(12, 0.4), seed=3, steps=18) for _ in range(2))
    assert np.array_equal(one.theta, other.theta) and np.array_equal(one.losses, other.losses)


def test_numbers_that_are_not_free_stay():
    free = np.ones(12, bool)
    free[2::3] = False
    found = descend([followed(clip())], np.full(12, 0.4), steps=9, free=free)
    assert (found.theta[2::3] == 0.4).all() and (found.theta[free] != 0.4).any()


def test_the_authors_step_is_as_long_anywhere():
    chance, free, theta = np.random.default_rng(0), np.ones(12, bool), np.full(12, 0.5)
    for slope in (np.zeros(12), np.eye(12)[3] * 1e-9, np.ones(12)):
        moved = fixed_step(theta, slope, chance, free)
        assert abs(np.linalg.norm(moved - theta) - STEP) < 1e-12
    assert fixed_step(np.full(12, 1e-3), np.ones(12), chance, free).min() == 1e-3


def test_a_photograph_teaches_disorder():
    """One image, no velocity: density, and animals that lie any way."""
    film = clip("swarm").part(slice(0, 1))
    fields = film.fields
    unseen = {name: np.full_like(getattr(fields, name), np.nan) for name in ("velocity", "angular_variance")}
    still = replace(film, fields=replace(fields, **unseen))
    begin = np.array([0.2, 0.5, 1.0, 0.1, 1.0, 1.0, 0.5, 1.0, 1.0, 0.15, 1.0, 0.5])
    found = descend([followed(still)], begin, seed=1, steps=60)
    without = descend([followed(still, use={"occlusion", "angular", "density"})], begin, seed=1, steps=60)
    assert found.theta[6] < without.theta[6] - 0.02  # aligns less


def test_animals_are_put_where_there_are_too_few():
    film = clip()
    along = followed(film, use={"density"}, device="cpu")
    walkers = along._begin(np.full(12, 0.4), 0)
    walkers.xyz[:, :2] = film.fields.origin + film.fields.cell * 0.5  # all in one corner
    before = walkers.xyz[:, :2].copy()
    along._put_elsewhere(walkers, 3, np.random.default_rng(0))
    moved = (walkers.xyz[:, :2] != before[0]).any(1)
    assert len(walkers) == len(before) and 1 <= moved.sum() <= 0.1 * len(before) + 1


def test_a_part_of_a_herd_walks_through_the_picture():
    """The camera sees a strip of the band: animals leave it and others come, and every frame has an error."""
    film = herd("band", 40, 0.6, 16.0, seed=1, warmup=1.0)
    low, high = film.xy[0].min(0), film.xy[0].max(0)
    middle = 0.5 * (low + high)
    part = evidence_of_truth(film, sight=False, grid=8, window=(*(middle - 2.5), *(middle + 2.5)))
    found = descend([followed(part)], np.full(12, 0.4), steps=9)
    assert len(found.losses) == 9 and np.isfinite(found.losses).all()
