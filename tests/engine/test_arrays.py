"""Slices and orders written for the compiler are those of numpy."""

import numpy as np
import pytest
from flockbrush.engine.arrays import order_, write_


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 8, 9, 64, 1000])
@pytest.mark.parametrize("ties", [False, True])
def test_the_order_is_that_of_numpys_stable_sort(n, ties):
    chance = np.random.default_rng(n)
    keys = chance.integers(0, 5, n + 3).astype(float) if ties else chance.normal(size=n + 3)
    assert order_(keys, n).tolist() == np.argsort(keys[:n], kind="stable").tolist()


def test_a_row_is_written_and_nothing_beside_it():
    rows = np.arange(12.0).reshape(3, 4)
    write_(rows[1, 1:3], np.array([-1.0, -2.0, -3.0]))
    assert rows.tolist() == [[0, 1, 2, 3], [4, -1, -2, 7], [8, 9, 10, 11]]
