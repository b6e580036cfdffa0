"""Differences between results and exact ones."""

import numpy as np
import pytest

import hybrid
from hybrid.accuracy.answer import EPSILON, _exponents, errors_of, rounding_of


def answer(**others):
    return hybrid.Answer(state=np.array([1.0, -2.0]), **others)


def test_states_times_and_exponents_are_compared_absolutely():
    truth = answer(times=np.array([1.0, 2.0]), exponents=np.array([0.5, -np.inf]))
    found = hybrid.Answer(
        state=np.array([1.25, -2.5]), times=np.array([1.0, 2.125]), exponents=np.array([0.25, -np.inf])
    )
    assert errors_of(found, truth) == {"state": 0.5, "times": 0.125, "exponents": 0.25}


@pytest.mark.parametrize("size", [1.0, 2.0**-10])
def test_matrices_are_compared_as_shares_of_their_largest_entry(size):
    exact = size * np.array([[4.0, 0.0], [0.0, 1.0]])
    truth = answer(saltation=np.array([exact, 0.0 * exact]), fundamental=exact)
    found = answer(
        saltation=np.array([exact + 0.5 * size, 0.0 * exact + 0.25]), fundamental=exact - 1.0 * size
    )
    assert errors_of(found, truth) == {"state": 0.0, "saltation": 0.25, "fundamental": 0.25}


def test_what_one_of_them_lacks_is_not_compared():
    assert errors_of(answer(times=np.array([1.0])), answer()) == {"state": 0.0}
    assert errors_of(answer(), answer(times=np.array([1.0]))) == {"state": 0.0}


def test_other_numbers_of_events_are_wrong():
    one, other = answer(times=np.array([1.0])), answer(times=np.array([1.0, 2.0]))
    assert errors_of(one, other) == {"state": 0.0, "times": np.inf}


def test_a_finite_exponent_in_place_of_an_infinite_one_is_wrong():
    one, other = answer(exponents=np.array([-30.0])), answer(exponents=np.array([-np.inf]))
    assert errors_of(one, other)["exponents"] == np.inf


def test_rounding_is_that_of_the_largest_value():
    truth = answer(times=np.array([8.0, 4.0]), fundamental=np.eye(2), exponents=np.array([-np.inf, -0.5]))
    expected = {"state": EPSILON, "times": 4 * EPSILON, "fundamental": EPSILON / 2, "exponents": EPSILON / 4}
    assert rounding_of(truth) == expected
    assert rounding_of(answer(times=np.empty(0)))["times"] == 0.0


def test_exponents_of_a_fundamental_matrix():
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    found = _exponents(turn @ np.diag([np.exp(3.0), np.exp(-1.0)]) @ turn.T, 2.0)
    np.testing.assert_allclose(found, [1.5, -0.5], rtol=1e-13)
    np.testing.assert_allclose(_exponents(np.diag([2.0, 1e-13]), 2.0), [np.log(2.0) / 2, -np.inf])
    np.testing.assert_allclose(_exponents(np.diag([1.0, 1e-11]), 1.0), [0.0, np.log(1e-11)])
    assert np.isnan(_exponents(np.array([[np.nan, 0.0], [0.0, 1.0]]), 1.0)).tolist() == [True, True]


@pytest.mark.parametrize("span", [0.5, 2.0])
def test_a_run_has_the_exponents_of_its_fundamental_matrix(span):
    """``x' = -a x`` for two rates."""
    system = hybrid.HybridSystem(
        state=("x", "y"), modes=[hybrid.Mode("m", lambda t, x, p: (-3.0 * x.x, -0.5 * x.y))]
    )
    rows = hybrid.work_precision(
        system,
        (1.0, 1.0),
        (0.0, span),
        tolerances=(1e-10,),
        methods={"DOP853": hybrid.DOP853()},
        tangent=True,
        repeats=1,
        reference=hybrid.Answer(state=np.exp([-3.0 * span, -0.5 * span]), exponents=np.array([-0.5, -3.0])),
    )
    assert max(rows.error["exponents"]) < 1e-8
