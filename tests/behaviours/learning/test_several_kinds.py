"""That a clip shows animals of several kinds is told, and animals of one kind are not taken for two."""

import cv2
import numpy as np
import pytest

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.body_outlines import areas_alone
from flockbrush.film.several_kinds import sizes_told, speeds_told, two_groups


@pytest.mark.parametrize("share", [0.15, 0.5, 0.85])
def test_two_kinds_are_found_with_their_shares(share):
    rng = np.random.default_rng(1)
    upper = round(300 * share)
    values = np.concatenate([rng.normal(1.0, 0.1, 300 - upper), rng.normal(3.0, 0.3, upper)])
    found, times = two_groups(rng.permutation(values))
    assert found == pytest.approx(share, abs=0.01) and times == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize("seed", range(20))
def test_values_of_one_kind_are_no_two_groups(seed):
    rng = np.random.default_rng(seed)
    for values in (
        rng.normal(1.0, 0.15, 200), rng.uniform(0.5, 2.0, 200), rng.lognormal(0.0, 0.5, 200), rng.gamma(4.0, 1.0, 30),
    ):  # fmt: skip
        assert two_groups(np.abs(values)) is None


@pytest.mark.parametrize("name", ["band", "mill", "swarm", "torus", "school", "graze"])
def test_herds_of_one_kind_are_not_told_to_be_two(name):
    clip = evidence_of_truth(herd(name, 60, 3.0, seed=4))
    assert speeds_told(clip.sightings, clip.fps) == []


def test_a_herd_some_of_which_are_fast_is_told():
    truth = herd("band", 60, 3.0, seed=4)
    truth.speed[:, :20] *= 3.0
    clip = evidence_of_truth(truth)
    (said,) = speeds_told(clip.sightings, clip.fps)
    assert said.startswith("33% of the moving animals are 3 times as fast")


@pytest.mark.parametrize(("calves", "told"), [(0, False), (25, True)])
def test_bodies_of_two_sizes_are_told(calves, told):
    rng, mask = np.random.default_rng(2), np.zeros((900, 900), np.uint8)
    for k, (x, y) in enumerate(80 * np.argwhere(np.ones((10, 10))) + 60):
        long = (10.0 if k < calves else 20.0) * rng.normal(1.0, 0.06)
        cv2.ellipse(mask, ((float(x), float(y)), (long, 0.45 * long), float(rng.uniform(0, 180))), 1, -1)
    said = sizes_told(areas_alone([mask]))
    assert bool(said) is told
