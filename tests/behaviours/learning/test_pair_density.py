"""How dense animals are at some distance from a body, from their places and from a mask of their bodies."""

import dataclasses

import cv2
import numpy as np
import pytest
from test_scores import clip_of, march

from benchmarks.herd_film import _capsules, _fill
from flockbrush.film.observations import Fields
from flockbrush.film.pair_density import (
    AREA,
    REACH,
    RING,
    RINGS,
    pairs_of_bodies,
    pairs_of_mask,
    pairs_off,
    pairs_scaled,
)


def herd(gap=1.2, side=12, seed=1):
    rng = np.random.default_rng(seed)
    xy = np.argwhere(np.ones((side, side))) * gap + rng.uniform(-0.2, 0.2, (side * side, 2)) + 3.0
    angle = rng.uniform(-np.pi, np.pi, len(xy))
    return xy, np.column_stack([np.cos(angle), np.sin(angle)])


def mask_of(xy, forward, px):
    mask = np.zeros((int(px * (xy[:, 1].max() + 3)), int(px * (xy[:, 0].max() + 3))), np.uint8)
    for outline in _capsules(xy * px, forward, px, 1.0):
        _fill(mask, outline, 1)
    return mask


@pytest.mark.parametrize(("px", "near"), [(24.0, 0.03), (6.0, 0.08)])
def test_a_mask_tells_what_the_places_tell(px, near):
    xy, forward = herd()
    mask = mask_of(xy, forward, px)
    seen = pairs_of_mask(mask, px, cv2.countNonZero(mask) / len(xy))
    true = pairs_of_bodies(xy, forward, 0.2)
    assert seen[3:] == pytest.approx(true[3:], rel=near)  # beyond the body itself, which pixels make wider
    assert seen[:3].sum() == pytest.approx(true[:3].sum(), rel=5 * near)


@pytest.mark.parametrize("px", [24.0, 6.0])
def test_a_herd_a_sixth_looser_is_farther_off_than_pixels_make_the_same_one(px):
    tight, forward = herd(gap=0.8)
    loose, _ = herd(gap=0.93)
    mask = mask_of(tight, forward, px)
    seen = pairs_of_mask(mask, px, cv2.countNonZero(mask) / len(tight))
    same, other = (pairs_off(pairs_of_bodies(xy, forward, 0.2), seen) for xy in (tight, loose))
    assert same < 0.06 and other > 3.0 * same
    coarse = np.where(np.arange(RINGS) == 0, np.nan, seen)  # pixels that do not tell the first ring
    assert pairs_off(pairs_of_bodies(tight, forward, 0.2), coarse) < 0.08


def test_pairs_are_those_of_brute_force():
    xy, forward = herd(side=5)
    rows = np.arange(-0.5, 0.51, 0.02)
    x, y = (v.ravel() for v in np.meshgrid(rows, rows))
    inside = np.hypot(np.maximum(np.abs(x) - 0.3, 0.0), y) <= 0.2
    body = np.column_stack([x, y])[inside][::7]
    side = np.column_stack([-forward[:, 1], forward[:, 0]])
    points = (xy[:, None] + body[None, :, :1] * forward[:, None] + body[None, :, 1:] * side[:, None]).reshape(-1, 2)
    far = np.hypot(*(points[:, None] - points[None]).reshape(-1, 2).T)
    number = np.histogram(far, RING * np.arange(RINGS + 1))[0]
    assert pairs_of_bodies(xy, forward, 0.2)[2:] == pytest.approx(
        (number / len(points) / len(body) / AREA)[2:], rel=0.06
    )


def test_strangers_are_as_dense_at_every_distance_and_a_gap_is_empty():
    rng = np.random.default_rng(4)
    xy, ahead = rng.uniform(0, 60, (900, 2)), np.tile([1.0, 0.0], (900, 1))
    inner = pairs_of_bodies(xy, ahead, 0.2)[4:]
    assert inner == pytest.approx(0.25, rel=0.15) and RING * RINGS == REACH
    wide = pairs_of_bodies(np.argwhere(np.ones((9, 9))) * 2.5, np.tile([1.0, 0.0], (81, 1)), 0.1)
    assert wide[4:6].max() < 1e-9 < wide[9]


def test_a_unit_of_length_half_as_long_makes_distances_twice_as_long():
    xy, forward = herd(gap=1.5)
    long = np.linspace(0, 1, RINGS) ** 2
    again = pairs_scaled(np.array([long]), 2.0)[0]
    assert again[6] == pytest.approx(np.interp(6.5 / 2, np.arange(RINGS) + 0.5, long) / 4)
    assert np.isnan(pairs_of_mask(np.zeros((20, 20), np.uint8), 6.0, 10.0)).all()
    assert np.isnan(pairs_of_bodies(xy[:0], forward[:0], 0.2)).all()


def test_fields_keep_them_in_files_and_parts(tmp_path):
    fields = clip_of(*march(), cell=3.0).fields
    pairs = np.arange(len(fields) * RINGS, dtype=float).reshape(len(fields), RINGS)
    fields = dataclasses.replace(fields, pairs=pairs)
    fields.save(tmp_path / "herd.npz")
    again = Fields.load(tmp_path / "herd.npz")
    assert np.array_equal(again.pairs, pairs) and np.array_equal(again.part(slice(3, 7)).pairs, pairs[3:7])
    assert fields.scaled(1.0).pairs == pytest.approx(pairs)
    with pytest.raises(ValueError, match="pairs"):
        dataclasses.replace(fields, pairs=pairs[:2])
