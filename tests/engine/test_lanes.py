"""Sixteen lanes against numpy; the plainest processor is in `test_replaying.py`."""

import numpy as np
from flockbrush.engine import lanes
from numba import njit


@njit
def _pack_where_positive(numbers, numbers32, places, out, out32, out_places):
    p, p32, q, q32, at = map_pointers(numbers, numbers32, out, out32, places)
    mask = lanes.load(p, 0) > 0.0
    lanes.pack(q, 0, lanes.load(p, 0), mask)
    lanes.pack(q32, 0, lanes.load(p32, 0), mask)
    lanes.pack(lanes.pointer(out_places), 0, lanes.load(at, 0), mask)
    return lanes.count(mask), lanes.bits(mask), lanes.bits(lanes.mask_of(lanes.bits(mask)))


@njit
def map_pointers(a, b, c, d, e):
    return lanes.pointer(a), lanes.pointer(b), lanes.pointer(c), lanes.pointer(d), lanes.pointer(e)


@njit
def _read(numbers, places, few, out, picked):
    there = lanes.lane_numbers() < np.int32(few)
    lanes.store(lanes.pointer(out), 0, lanes.load_where(lanes.pointer(numbers), 0, there))
    lanes.store(
        lanes.pointer(picked), 0, lanes.gather(lanes.pointer(numbers), lanes.load(lanes.pointer(places), 0), there)
    )


@njit
def _arithmetic(a, b, c, out):
    x, y, z = lanes.load(lanes.pointer(a), 0), lanes.load(lanes.pointer(b), 0), lanes.load(lanes.pointer(c), 0)
    p = lanes.pointer(out)
    lanes.store(p, 0, x + y * z - x / y)
    lanes.store(p, 16, lanes.root(y))
    lanes.store(p, 32, lanes.largest(x, z))
    lanes.store(p, 48, lanes.where(~(x < y) & (x >= z) | (x <= 0.0), x, lanes.splat(np.float64(7.0))))


def test_the_chosen_lanes_come_out_side_by_side_in_their_order():
    rng = np.random.default_rng(0)
    for chosen in [np.zeros(16, bool), np.ones(16, bool), *(rng.random((50, 16)) < 0.5)]:
        numbers = np.where(chosen, 1.0, -1.0) * rng.uniform(1, 2, 16)
        numbers32, places = numbers.astype(np.float32), rng.integers(0, 99, 16).astype(np.int32)
        out, out32, out_places = np.zeros(16), np.zeros(16, np.float32), np.zeros(16, np.int32)
        count, bits, again = _pack_where_positive(numbers, numbers32, places, out, out32, out_places)
        assert count == chosen.sum() and bits == again == sum(1 << k for k in np.flatnonzero(chosen))
        assert np.array_equal(out[:count], numbers[chosen])
        assert np.array_equal(out32[:count], numbers32[chosen])
        assert np.array_equal(out_places[:count], places[chosen])


def test_lanes_beyond_the_end_are_not_read_and_are_zero():
    numbers, places = np.arange(1.0, 6.0), np.r_[[4, 3, 2, 1, 0], np.full(11, 10**9)].astype(np.int32)
    out, picked = np.empty(16), np.empty(16)
    _read(numbers, places, 5, out, picked)
    assert out.tolist() == [1, 2, 3, 4, 5] + [0] * 11
    assert picked.tolist() == [5, 4, 3, 2, 1] + [0] * 11


def test_arithmetic_is_numpys_bit_for_bit():
    a, b, c = np.random.default_rng(1).uniform(-1, 3, (3, 16))
    b = np.abs(b)
    out = np.empty(64)
    _arithmetic(a, b, c, out)
    assert np.array_equal(out[:16], a + b * c - a / b)
    assert np.array_equal(out[16:32], np.sqrt(b))
    assert np.array_equal(out[32:48], np.maximum(a, c))
    assert np.array_equal(out[48:], np.where((a >= b) & (a >= c) | (a <= 0), a, 7.0))
