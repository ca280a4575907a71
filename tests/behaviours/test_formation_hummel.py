"""What birds save beside one another."""

import numpy as np
import pytest
from flockbrush.behaviours.formation.hummel import (
    REACH,
    g_,
    power,
    power_and_jacobian,
    relative_power,
    slope_,
    total_power,
)
from hypothesis import given
from hypothesis import strategies as st

# 40-digit values of Hummel's function: x, y, g
REFERENCE = [
    (1.0, 0.5, 0.310304893400819), (1.0, -0.5, 0.0784966838426872), (1.0, 1.0, 0.351304015617154),
    (1.0, 2.0, 0.375677447412954), (1.0, -2.0, 0.0131241298305522), (1.2, 0.1, 0.125876686656597),
    (0.9, 3.0, 0.574532217525963), (2.0, 1.5, 0.0551781635477676), (2.0, -4.0, 0.00329483414037112),
    (3.0, 0.25, 0.0156255793760747), (5.0, 10.0, 0.00959768247828446), (0.8, 0.01, 0.737769352345875),
    (1.0, 0.0, 0.194400788621753), (2.0, 0.0, 0.0339400055887418),
]  # fmt: skip

beside = st.floats(REACH + 1e-3, 60)
behind = st.floats(-200, 200)


@pytest.mark.parametrize(("x", "y", "value"), REFERENCE)
def test_a_bird_saves_what_hummel_says(x, y, value):
    assert g_(x, y) == pytest.approx(value, rel=3e-14)
    assert g_(-x, y) == g_(x, y)


def test_far_ahead_nothing_is_saved_and_far_behind_most():
    assert g_(1.0, 100.0) == pytest.approx(0.388795, abs=1e-6)
    assert g_(1.0, -100.0) == pytest.approx(6.24948e-6, rel=1e-5)
    assert g_(1.0, 1e9) == pytest.approx(2 * g_(1.0, 0.0), rel=1e-15)
    assert 0.0 < g_(1.0, -1e6) < 1e-12


def printed(x, y):
    """The formula as the paper prints it, which loses digits."""
    a = np.pi / 4

    def term(d):
        r = np.hypot(d, y)
        return np.log((d - y + r) / (d + y + r))

    # the printed brackets hold both the wing's ends and the logarithm of the lateral distance
    first = np.log(x**2 / ((x - a) * (x + a))) + 2 * term(x) - term(x - a) - term(x + a)
    return 2 / np.pi**2 * (first + (2 * np.hypot(x, y) - np.hypot(x + a, y) - np.hypot(x - a, y)) / y)


@given(x=st.floats(0.85, 8), y=st.floats(0.2, 5))
def test_it_is_the_printed_formula_where_that_has_digits(x, y):
    assert g_(x, y) == pytest.approx(printed(x, y), abs=1e-12)
    assert g_(x, -y) == pytest.approx(printed(x, -y), abs=1e-12)


@given(x=beside, y=behind, more=st.floats(1e-3, 10))
def test_farther_behind_is_better_and_a_pair_shares_a_fixed_sum(x, y, more):
    assert g_(x, y + more) >= g_(x, y) > 0
    assert g_(x, y) + g_(x, -y) == pytest.approx(2 * g_(x, 0.0), rel=1e-12)


@given(x=st.floats(0.8, 20), y=st.floats(-20, 20))
def test_the_slope_is_the_slope(x, y):
    h = 1e-4
    assert slope_(x, y) == pytest.approx((g_(x, y + h) - g_(x, y - h)) / (2 * h), rel=1e-4, abs=1e-11)


def test_the_reference_slope():
    assert slope_(1.0, 1.0) == pytest.approx(0.0487789918851, rel=1e-11)


# nine birds of Klotsman and Tal, dx = 1.25, by an independent evaluation
NINE_Y = np.array([-2.9, -2.1, -0.8, 0.0, -1.1, -1.9, -3.2, -3.9, -5.2])
NINE_E = [
    0.2292961344935073, 0.2769669378061221, 0.22503296145127746, 0.09166563223637988, 0.260976703766336,
    0.2512132856667816, 0.2956687084450486, 0.2488880345460955, 0.2512465891770649,
]  # fmt: skip


def test_nine_birds_save_what_an_independent_evaluation_says():
    x = 1.25 * np.arange(9)
    e, jacobian = power_and_jacobian(x, NINE_Y)
    assert e == pytest.approx(NINE_E, rel=1e-12)
    assert power(x, NINE_Y) == pytest.approx(NINE_E, rel=1e-12)
    assert total_power(x) == pytest.approx(2.130954987588613, rel=1e-12)
    assert relative_power(NINE_Y, 1.25).sum() == pytest.approx(1.0)
    assert np.argmin(e) == 3  # the leader works hardest
    assert jacobian.sum(axis=1) == pytest.approx(np.zeros(9), abs=1e-14)  # moving all changes nothing
    h = 1e-6
    moved = NINE_Y + h * np.eye(9)[5]
    assert (power(x, moved) - e) / h == pytest.approx(jacobian[:, 5], abs=1e-6)
