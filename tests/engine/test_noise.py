"""Noise: by name, by tick, by animal, and nothing else."""

import numpy as np
import pytest
from flockbrush.engine.noise import Noise, normal_, quantile_, uniform_
from numba import njit
from scipy.special import ndtri
from scipy.stats import kstest

HERD = np.arange(1, 50_001)
KEY = 5232861162808690300
UNIFORM = [0.09689416722372446, 0.006751978607853815]
NORMAL = [-1.2994535208088636, -2.4701945928923674]


def test_noise_of_one_animal_ignores_the_others():
    noise = Noise(3)
    full, part = noise.normal("wander", 9, np.arange(1, 50), 2), noise.normal("wander", 9, [7, 21], 2)
    assert np.array_equal(full[[6, 20]], part)


def test_more_numbers_leave_the_first_ones_alone():
    noise = Noise(3)
    assert np.array_equal(noise.uniform("s", 1, HERD[:9], 5)[:, :2], noise.uniform("s", 1, HERD[:9], 2))


def test_noise_is_the_same_in_every_version():
    """These numbers are part of what a seed means: a change of them is a change of every herd."""
    noise = Noise(7)
    assert int(noise.key("wander", 5)) == KEY
    assert noise.uniform("wander", 5, [3], 2).tolist() == [UNIFORM]
    assert noise.normal("wander", 5, [3], 2).tolist() == [NORMAL]


@njit
def _drawn(key, ids, out):
    for i in range(len(ids)):
        out[i, 0] = uniform_(key, ids[i], 1)
        out[i, 1] = normal_(key, ids[i], 1)


def test_kernels_and_arrays_draw_the_same_numbers():
    noise, ids, out = Noise(5), np.array([4, 8, 1 << 40]), np.empty((3, 2))
    _drawn(noise.key("s", 2), ids, out)
    assert out[:, 0].tolist() == noise.uniform("s", 2, ids, 2)[:, 1].tolist()
    assert out[:, 1].tolist() == noise.normal("s", 2, ids, 2)[:, 1].tolist()


def test_quantile_agrees_with_scipy():
    inner, tails = np.random.default_rng(0).random(5000), 10.0 ** -np.arange(1.0, 300)
    p = np.concatenate([inner, tails, 1 - tails[:15]])
    mine, exact = np.array([quantile_(x) for x in p]), ndtri(p)
    assert np.abs(mine - exact).max() < 1e-13
    assert quantile_(0.5) == 0.0


def test_normal_numbers_are_normal():
    z = Noise(1).normal("speed", 4, HERD, 2).ravel()
    assert abs(z.mean()) < 4 / np.sqrt(len(z))
    assert abs(z.var() - 1) < 4 * np.sqrt(2 / len(z))
    assert kstest(z, "norm").pvalue > 1e-3


def test_uniform_numbers_are_even():
    u = Noise(2).uniform("speed", 4, HERD, 2).ravel()
    assert u.min() >= 0 and u.max() < 1
    assert kstest(u, "uniform").pvalue > 1e-3


def normal(seed=0, stream="a", tick=0, ids=HERD, k=0):
    return Noise(seed).normal(stream, tick, ids, k + 1)[:, k]


@pytest.mark.parametrize(
    "other",
    [
        {"seed": 1},
        {"seed": 1 << 40},
        {"seed": -1},
        {"stream": "b"},
        {"tick": 1},
        {"tick": 2},
        {"ids": HERD + 1},
        {"k": 1},
    ],
    ids=lambda other: " ".join(map(str, other.items())) if "ids" not in other else "next animal",
)
def test_what_differs_draws_independently(other):
    r = np.corrcoef(normal(), normal(**other))[0, 1]
    assert abs(r) < 4 / np.sqrt(len(HERD))


def test_one_animal_through_time_is_white():
    walk = np.array([Noise(3).normal("wander", tick, [17])[0, 0] for tick in range(4000)])
    assert abs(walk.mean()) < 4 / np.sqrt(4000)
    assert abs(np.corrcoef(walk[1:], walk[:-1])[0, 1]) < 4 / np.sqrt(4000)


def test_no_animals_draw_nothing():
    assert Noise(0).normal("s", 0, []).shape == (0, 1)
