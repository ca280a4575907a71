"""How varied axes are: by bodies and those nearest to them, wherever the picture begins and whichever end is ahead."""

import numpy as np
import pytest

from flockbrush.learning.axis_variance import NEAREST, mean_variance


def axes(angle):
    return np.column_stack([np.cos(angle), np.sin(angle)])


def by_pairs(xy, angle):
    """The same, of angles (n,) in degrees, by the definition: one body after the other."""
    found = []
    for place in xy:
        near = np.argsort(((xy - place) ** 2).sum(1))[:NEAREST]
        doubled = np.exp(2j * np.radians(angle[near]))
        off = np.abs(np.degrees(np.angle(doubled / doubled.sum())))
        found.append(off.var())
    return np.mean(found)


@pytest.fixture
def herd():
    rng = np.random.default_rng(4)
    return rng.uniform(0.0, 12.0, (60, 2)), rng.uniform(-180.0, 180.0, 60)


def test_it_is_the_mean_over_bodies_of_the_variance_of_eight(herd):
    xy, angle = herd
    assert mean_variance(xy, axes(np.radians(angle))) == pytest.approx(by_pairs(xy, angle))


def test_neither_the_place_of_the_picture_nor_the_end_that_is_ahead_counts(herd):
    xy, angle = herd
    usual = mean_variance(xy, axes(np.radians(angle)))
    turned = np.radians(angle + 180.0 * (np.arange(60) % 3 == 0))
    assert mean_variance(xy + [0.37, -5.2], axes(turned)) == pytest.approx(usual)


def test_parallel_axes_have_none_and_axes_at_random_nearly_that_of_chance():
    rng = np.random.default_rng(5)
    xy = rng.uniform(0.0, 60.0, (2000, 2))
    assert mean_variance(xy, axes(np.full(2000, 0.7))) == pytest.approx(0.0, abs=1e-9)
    at_random = mean_variance(xy, axes(rng.uniform(-np.pi, np.pi, 2000)))
    assert 0.8 * 180.0**2 / 12.0 < at_random < 180.0**2 / 12.0  # of eight, about their own mean
    spread = np.radians(6.0)
    of_all = (1.0 - 2.0 / np.pi) * (2.0 * 6.0) ** 2  # the variance of |x| of a normal x, doubled
    assert 0.7 * of_all < mean_variance(xy, axes(rng.normal(0.7, spread, 2000))) < of_all


def test_two_bodies_tell_nothing():
    assert np.isnan(mean_variance(np.eye(2), np.eye(2)))
    assert mean_variance(np.arange(6.0).reshape(3, 2), axes(np.zeros(3))) == pytest.approx(0.0, abs=1e-9)
