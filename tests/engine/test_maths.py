"""Our own exponential, logarithm and angles against those of the C library."""

import hashlib
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from flockbrush.engine.maths import atan2_, exp_, log_, sincos_
from numba import njit

CHANCE = np.random.default_rng(1)
GOOD = 2e-15  # relative
BITS = """
import hashlib
import numpy as np
from flockbrush.engine.maths import atan2_, exp_, log_, sincos_
from flockbrush.engine.noise import Noise
x = np.random.default_rng(5).normal(size=(3000, 2)) * 10
rows = [(exp_(a), log_(abs(a)), atan2_(a, b), *sincos_(a)) for a, b in x]
noise = Noise(4)
numbers = noise.uniform("s", 3, np.arange(999), 3), noise.normal("s", 3, np.arange(9999), 2)
print(hashlib.sha256(np.array(rows).tobytes() + numbers[0].tobytes() + numbers[1].tobytes()).hexdigest())
"""


def relative_error(mine, exact):
    return np.max([abs(a - b) / abs(b) for a, b in zip(mine, exact, strict=True) if b])


def test_exponential_agrees_over_its_whole_range():
    x = np.concatenate([CHANCE.uniform(-708, 709.7, 3000), CHANCE.uniform(-3, 1, 3000)])
    assert relative_error([exp_(a) for a in x], [math.exp(a) for a in x]) < GOOD


def test_exponential_at_its_ends():
    assert exp_(0.0) == 1.0
    assert [exp_(x) for x in (-708.5, -1e9, -math.inf)] == [0.0, 0.0, 0.0]
    assert [exp_(x) for x in (709.79, 1e300, math.inf)] == [math.inf] * 3
    assert math.isnan(exp_(math.nan))


def test_logarithm_agrees_over_its_whole_range():
    near_one = 1 + CHANCE.normal(size=2000) * 1e-5
    x = np.concatenate([near_one, np.exp(CHANCE.uniform(-744, 709, 3000)), CHANCE.uniform(0.1, 4, 2000)])
    assert relative_error([log_(a) for a in x], [math.log(a) for a in x]) < GOOD


def test_logarithm_at_its_ends():
    assert log_(1.0) == 0.0
    assert log_(0.0) == -math.inf
    assert log_(math.inf) == math.inf
    assert math.isnan(log_(-1.0))
    assert math.isnan(log_(math.nan))


def test_direction_agrees_in_all_quadrants():
    points = CHANCE.normal(size=(4000, 2)) * 10.0 ** CHANCE.uniform(-6, 6, (4000, 2))
    assert relative_error([atan2_(y, x) for y, x in points], [math.atan2(y, x) for y, x in points]) < GOOD


def test_direction_of_the_compass_points():
    assert atan2_(0.0, 0.0) == 0.0
    assert [atan2_(0.0, 2.0), atan2_(2.0, 0.0), atan2_(-2.0, 0.0)] == [0.0, math.pi / 2, -math.pi / 2]
    assert atan2_(0.0, -2.0) == atan2_(-0.0, -2.0) == math.pi


def test_sine_and_cosine_agree():
    for a in np.concatenate([CHANCE.uniform(-7, 7, 3000), CHANCE.uniform(-1e6, 1e6, 1000)]):
        sine, cosine = sincos_(a)
        assert abs(sine - math.sin(a)) < 1e-15
        assert abs(cosine - math.cos(a)) < 1e-15


@njit(error_model="numpy")
def _weights(distances, out):
    for i in range(len(distances)):
        out[i] = exp_(-distances[i] * distances[i]) * atan2_(distances[i], 1.0)


def test_a_loop_gives_the_bits_of_single_calls():
    distances, out = CHANCE.uniform(0, 9, 1003), np.empty(1003)
    _weights(distances, out)
    assert out.tolist() == [exp_(-d * d) * atan2_(d, 1.0) for d in distances]


def bits(**environment):
    """A hash of what a fresh process computes."""
    done = subprocess.run(
        [sys.executable, "-c", BITS],
        cwd=Path(__file__).parents[2], env=os.environ | environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.strip()


def test_any_processor_gives_the_same_bits():
    native = bits()
    assert len(native) == len(hashlib.sha256().hexdigest())
    assert bits(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", PYTHONHASHSEED="99") == native
