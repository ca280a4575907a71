"""That a clip shows animals of several kinds is told, and animals of one kind are not taken for two."""

import cv2
import numpy as np
import pytest

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.film.body_outlines import blobs_left, sizes_alone
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


@pytest.mark.parametrize("seed", [11, 23])
def test_animals_that_stop_and_start_are_no_two_kinds(seed):
    """Medians of their speeds are of two groups, by how long they stood."""
    truth = herd("graze", 70, 6.0, seed=seed)
    clip = evidence_of_truth(truth)
    usual = np.median(truth.speed, axis=0)
    assert (usual < 0.3).sum() > 0.1 * len(usual)
    assert speeds_told(clip.sightings, clip.fps) == []


@pytest.mark.parametrize(("calves", "told"), [(0, False), (25, True)])
def test_bodies_of_two_sizes_are_told(calves, told):
    rng, mask = np.random.default_rng(2), np.zeros((900, 900), np.uint8)
    for k, (x, y) in enumerate(80 * np.argwhere(np.ones((10, 10))) + 60):
        long = (10.0 if k < calves else 20.0) * rng.normal(1.0, 0.06)
        cv2.ellipse(mask, ((float(x), float(y)), (long, 0.45 * long), float(rng.uniform(0, 180))), 1, -1)
    said = sizes_told(*sizes_alone([mask]))
    assert bool(said) is told


@pytest.mark.parametrize("beside", [(0, 8), (20, 0)])
def test_pairs_that_touch_are_no_larger_kind(beside):
    """Side by side or nose to tail, they fill their hull as one body does."""
    rng, mask = np.random.default_rng(2), np.zeros((900, 900), np.uint8)
    for k, middle in enumerate(80 * np.argwhere(np.ones((10, 10))) + 60):
        half = np.array([10 + rng.integers(0, 2), 4])
        for at in [middle, middle + beside] if k % 2 else [middle]:
            cv2.rectangle(mask, (at - half).tolist(), (at + half).tolist(), 1, -1)
    areas, lengths = sizes_alone([mask])
    assert len(areas) == 100 and two_groups(areas) is not None
    assert sizes_told(areas, lengths) == []


def test_a_body_that_lost_a_part_to_a_stone_has_no_size():
    before = np.zeros((60, 60), np.uint8)
    before[10:18, 10:30] = before[40:48, 10:30] = 1
    mask = before.copy()
    mask[12:15, 26:30] = 0
    assert (blobs_left(before, mask) == np.where(np.arange(60)[:, None] > 30, before, 0)).all()
    assert (blobs_left(before, mask, 0.4) == before).all()
