"""Rasters: two by three cells of two metres, small enough to draw."""

import numpy as np
import pytest
from flockbrush.engine.raster import Raster, bilinear_
from numba import njit

MEADOW = Raster(2.0, np.array([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]]))  # the first row is the south


def test_a_raster_knows_its_size():
    assert (MEADOW.shape, MEADOW.width, MEADOW.height) == ((2, 3), 6.0, 4.0)


def test_the_south_west_corner_is_the_first_cell():
    assert MEADOW.at((0.1, 0.1)) == 1
    assert MEADOW.at([(5.9, 0.1), (0.1, 3.9)]).tolist() == [3, 10]


def test_outside_the_nearest_cell_answers():
    assert MEADOW.at([(-9, -9), (99, 99), (99, -9), (np.nan, 1)]).tolist() == [1, 30, 3, 1]
    assert MEADOW.sample([(-9, -9), (99, 99)]).tolist() == [1, 30]


def test_between_centres_the_ground_changes_evenly():
    assert MEADOW.sample((2.0, 1.0)) == 1.5
    assert MEADOW.sample((1.0, 2.0)) == 5.5
    assert MEADOW.sample((3.0, 3.0)) == 20


def test_a_plane_is_sampled_exactly():
    field = Raster(0.5, np.zeros((8, 9)))
    field.values = field.centres() @ (3.0, -2.0) + 1
    xy = np.random.default_rng(0).uniform((0.25, 0.25), (4.25, 3.75), (50, 2))
    assert field.sample(xy) == pytest.approx(xy @ (3.0, -2.0) + 1)


def test_directions_are_sampled_component_by_component():
    arrows = Raster(1.0, np.arange(12.0).reshape(2, 3, 2))
    assert arrows.sample([(1.0, 0.5)]).tolist() == [[1.0, 2.0]]
    assert arrows.at((2.5, 1.5)).tolist() == [10.0, 11.0]


@njit
def _sampled(values, cell, xy, out):
    for i in range(len(xy)):
        out[i] = bilinear_(values, cell, xy[i, 0], xy[i, 1], (0.0, 0.0))


def test_kernels_agree_with_the_arrays():
    xy, out = np.random.default_rng(1).uniform(-2, 8, (200, 2)), np.empty(200)
    _sampled(MEADOW.values, MEADOW.cell, xy, out)
    assert np.array_equal(out, MEADOW.sample(xy))


@pytest.mark.parametrize("cell, values", [(0, [[1]]), (np.nan, [[1]]), (1, [1, 2]), (1, np.zeros((0, 3)))])
def test_what_is_no_raster_is_refused(cell, values):
    with pytest.raises(ValueError, match="raster"):
        Raster(cell, values)
