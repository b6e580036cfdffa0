"""Differences between results and exact ones."""

import numpy as np
import pytest

import hybrid
import models
from hybrid.accuracy.answer import EPSILON, _exponents, as_answer, errors_of, rounding_of


def answer(**others):
    return hybrid.Answer(state=np.array([1.0, -2.0]), **others)


def test_what_is_given_becomes_arrays_of_numbers():
    found = hybrid.Answer(
        [1, 2], times=[3], exponents=(4, 5), fundamental=[[1, 0], [0, 1]], steps=7, seconds=0
    )
    for name, kept in (("state", [1, 2]), ("times", [3]), ("exponents", [4, 5]), ("fundamental", np.eye(2))):
        value = getattr(found, name)
        assert value.dtype == float
        np.testing.assert_array_equal(value, kept)
    assert (found.saltation, found.steps, found.seconds) == (None, 7, 0)
    for wrong in ({"state": None}, {"times": "x"}, {"steps": -1}, {"steps": 1.5}, {"seconds": -1.0}):
        with pytest.raises(hybrid.ArgumentError, match=f"Answer: {next(iter(wrong))}"):
            hybrid.Answer(**{"state": [1.0], **wrong})


@pytest.mark.parametrize("span", [0.0, 2.0])
def test_results_of_methods_become_answers(span):
    """A span of zero tells no exponents; those that are given stay."""
    matrix = np.diag([np.exp(3.0), 1.0])
    found = as_answer("m", answer(fundamental=matrix), 2, span)
    assert (found.exponents is None) == (span == 0.0)
    assert span == 0.0 or found.exponents.tolist() == pytest.approx([1.5, 0.0])
    given = answer(fundamental=matrix, exponents=[7.0, 8.0])
    assert as_answer("m", given, 2, span) is given
    assert as_answer("m", (1.0, -2.0), 2, span).state.tolist() == [1.0, -2.0]
    arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), tangent=True)
    found = as_answer("m", arc, 2, span)
    assert (found.steps, found.times.tolist()) == (arc.steps, arc.jumps.t.tolist())
    np.testing.assert_array_equal(found.state, arc.x[-1])
    np.testing.assert_array_equal(found.saltation, arc.jumps.saltation)
    np.testing.assert_array_equal(found.fundamental, arc.fundamental)
    with pytest.raises(hybrid.ArgumentError, match=r"m: the state must have shape \(3,\); got \(2,\)"):
        as_answer("m", arc, 3, span)
    with pytest.raises(hybrid.ArgumentError, match="m must be the state at the end, an Answer or"):
        as_answer("m", "x", 2, span)


def test_a_run_that_did_not_reach_its_end_has_no_state_there():
    arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), samples=[1.0], max_jumps=0)
    assert len(arc.x) == 0
    assert np.isnan(as_answer("m", arc, 2, 1.0).state).tolist() == [True, True]


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
        (3.0, 3.0 + span),
        tolerances=(1e-10,),
        methods={"DOP853": hybrid.DOP853()},
        tangent=True,
        repeats=1,
        reference=hybrid.Answer(state=np.exp([-3.0 * span, -0.5 * span]), exponents=np.array([-0.5, -3.0])),
    )
    assert max(rows.error["exponents"]) < 1e-8
