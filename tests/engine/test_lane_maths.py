"""Exponentials and angles of eight numbers at once, against the C library; interpreted they give the same bits."""

import math

import numpy as np
import pytest
from flockbrush.engine import interpreted, lane_maths, lanes
from flockbrush.engine.maths import ROUNDER
from numba import njit
from numba.core.errors import TypingError


@njit
def _exponentials(numbers, out):
    p, q = lanes.pointer(numbers), lanes.pointer(out)
    for k in range(0, len(numbers), 8):
        lanes.store(q, k, lane_maths.exponential(lanes.load8(p, k)))


@njit
def _angles(cross, dot, out):
    p, q, o = lanes.pointer(cross), lanes.pointer(dot), lanes.pointer(out)
    for k in range(0, len(cross), 8):
        lanes.store(o, k, lane_maths.square_of_angle(lanes.load8(p, k), lanes.load8(q, k)))


@njit
def _sums(numbers, out):
    p = lanes.pointer(numbers)
    out[0], out[1] = lanes.total(lanes.load(p, 0)), lanes.total(lanes.load8(p, 0))
    lanes.store(p, 0, lanes.times_power(lanes.load8(p, 0), lanes.splat8(ROUNDER - 3.0)))


@njit
def _rows_added(table, rows, at, out):
    columns = lanes.load_rows(lanes.pointer(table), lanes.pointer(rows), at)
    lanes.store(lanes.pointer(out), 0, columns[2])
    lanes.store(lanes.pointer(out), 8, columns[7])
    lanes.store(lanes.pointer(out), 16, lanes.totals(columns))


def in_python(kernel):
    """A compiled kernel as Python runs it, its functions too."""
    below = {name: getattr(interpreted, name) for name in ("fused", "largest", "splat8", "times_power", "where")}
    maths = type("maths", (), {})
    for name in ("exponential", "square_of_angle"):
        code = getattr(lane_maths, name).py_func
        plain = type(code)(code.__code__, {**code.__globals__, **below})
        setattr(maths, name, staticmethod(plain))
    code = kernel.py_func
    return type(code)(code.__code__, {**code.__globals__, "lanes": interpreted, "lane_maths": maths})


def numbers(seed, low, high):
    return np.random.default_rng(seed).uniform(low, high, 4000)


def test_exponentials_are_right_to_the_last_digits():
    for x in (numbers(1, -2, 0), numbers(2, -50, 2), numbers(3, -700, 700), np.zeros(8)):
        out = np.empty_like(x)
        _exponentials(x, out)
        right = np.array([math.exp(v) for v in x])
        assert np.abs(out / right - 1.0).max() < 1e-15
    _exponentials(np.array([-701.0, -1e300, -np.inf, -700.0] * 2), out)
    assert out[:3].tolist() == [0, 0, 0] and 0 < out[3] < 1e-303


def test_angles_are_right_to_the_last_digits():
    direction = np.concatenate([numbers(4, -np.pi, np.pi), np.arange(-8, 9).repeat(8) * np.pi / 8])
    size = np.resize(10.0 ** np.arange(-6, 7), len(direction))
    cross, dot = size * np.sin(direction), size * np.cos(direction)
    out = np.empty_like(cross)
    _angles(cross, dot, out)
    right = np.array([math.atan2(abs(y), x) for y, x in zip(cross, dot, strict=True)]) ** 2
    assert np.abs(out - right).max() < 1e-14
    _angles(np.array([0.0, 0.0, 0.0, 2.0, -2.0, -0.0, 1.0, -1.0]), np.array([0.0, 3, -3, 0, 0, -0.0, 1, -1]), out)
    quarters = np.array([0, 0, 4, 2, 2, 0, 1, 3]) * np.pi / 4
    assert out[:8] == pytest.approx(quarters**2, abs=1e-15)


def test_python_gives_the_same_bits():
    x = np.round(numbers(5, -30, 3)[:160], 3)
    y = np.round(numbers(6, -3, 3)[:160], 1)
    for kernel, given in ((_exponentials, (x,)), (_angles, (x, y)), (_sums, (x[:16].copy(),))):
        one, other = np.zeros(160), np.zeros(160)
        mine = [g.copy() for g in given]
        kernel(*given, one)
        in_python(kernel)(*mine, other)
        assert one.tobytes() == other.tobytes() and given[0].tobytes() == mine[0].tobytes()
        assert one.any()


def test_lanes_are_added_up_in_halves():
    a, out = np.array([1e16, 1.0, -1e16, 1.0] * 4), np.empty(2)
    eight = a[:8].copy()
    _sums(a, out)
    while len(eight) > 1:
        eight = eight[: len(eight) // 2] + eight[len(eight) // 2 :]
    assert out[1] == eight[0] == 4.0
    assert a[:2].tolist() == [1.25e15, 0.125]


def test_rows_of_a_table_come_as_columns_and_are_added_up_as_one_is():
    rng = np.random.default_rng(8)
    table = rng.normal(size=(40, 8)) * 10.0 ** rng.integers(-9, 9, (40, 8))
    rows = rng.integers(0, 40, 30).astype(np.int32)
    for at in (0, 5, 22):
        out, plain, one = np.zeros(24), np.zeros(24), np.zeros(2)
        _rows_added(table, rows, at, out)
        in_python(_rows_added)(table, rows, at, plain)
        columns = table[rows[at : at + 8]].T
        assert out.tobytes() == plain.tobytes()
        assert out[:8].tolist() == columns[2].tolist() and out[8:16].tolist() == columns[7].tolist()
        for column, sum_ in zip(columns, out[16:], strict=True):
            _sums(np.r_[column, column], one)
            assert sum_ == one[1]


def test_a_pointer_into_every_second_number_is_refused():
    with pytest.raises(TypingError, match="contiguous"):
        _exponentials(np.zeros(16)[::2], np.zeros(8))
