"""Tracks of which the numbers change in a crossing get them back, whatever order they were followed in."""

import numpy as np
import pytest

from flockbrush.film.crossings import Crossed, renamed


def crossing(seed, swapped, frames=80, birds=3):
    """Birds that meet in the middle, seen with noise; those named in `swapped` have changed numbers there."""
    chance = np.random.default_rng(seed)
    way = np.arange(frames)[:, None] - frames / 2
    slope = np.linspace(-1, 1, birds) * 1.2
    px = np.stack([3.0 * way + 0 * slope, way * slope], axis=-1) + chance.normal(0, 0.3, (frames, birds, 2))
    merged = np.abs(way[:, 0]) < 9
    blob = np.where(merged[:, None], 0, np.full(birds, -1))
    area = np.where(merged[:, None], np.nan, 60 + chance.normal(0, 5, (frames, birds)))
    order = np.where(way > 0, np.array(swapped), np.arange(birds))
    px, area = np.take_along_axis(px, order[..., None], 1), np.take_along_axis(area, order, 1)
    return Crossed(px, blob, area, np.zeros(blob.shape, bool)), order


@pytest.mark.parametrize("swapped", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
@pytest.mark.parametrize("seed", range(3))
def test_numbers_that_were_exchanged_are_put_back(swapped, seed):
    told, order = crossing(seed, swapped)
    names = renamed(told)
    assert (names[-25:] == order[-25:]).all() and (names[:25] == np.arange(3)).all()
    assert (np.sort(names, 1) == np.arange(3)).all()


def test_from_the_frame_that_a_person_has_named_numbers_stay():
    told, order = crossing(0, (2, 1, 0))
    told.fixed[60, 0] = True
    names = renamed(told)
    assert (names[52:60] == order[52:60]).all() and (names[60:] == np.arange(3)).all()


def test_birds_that_share_no_blob_keep_their_numbers():
    told, _ = crossing(0, (2, 1, 0))
    told.blob[:] = -1
    assert (renamed(told) == np.arange(3)).all()
