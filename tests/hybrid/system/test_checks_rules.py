"""Checks of what model functions return, one by one."""

import re

import numpy as np
import pytest

from hybrid.errors import ModelError
from hybrid.system import checks
from hybrid.system.functions import CONDITION, ModelFunction
from hybrid.system.variables import Variables

VARIABLES = Variables(("q", "v"), {"g": 9.81})


def function(value, *, size=2, kind="field", derivative=None):
    return ModelFunction("Mode 'a'", kind, value, "jacobian", derivative, size)


def told(check, *given):
    """The text of the error of a check; empty if it passes."""
    try:
        check(*given)
    except ModelError as error:
        return str(error)
    return ""


def test_the_point_of_the_trial_call():
    """Every component has another value, from one half to three halves."""
    x = checks.sample_state(Variables(5, {}))
    np.testing.assert_allclose(x, 0.5 + np.mod(np.arange(1, 6) * (np.sqrt(5) - 1) / 2, 1.0), rtol=1e-14)
    t, x, p = checks._arguments(VARIABLES)
    assert 0.5 < t < 1.5
    assert (x.q, x.v) == tuple(checks.sample_state(VARIABLES))
    assert p.g == 9.81


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ((1.0, 2.0), ""),
        ([1, np.float32(2)], ""),
        (np.array([1.0, 2.0]), ""),
        ((1.0,), "Mode 'a': field returned 1 values; the state has 2 (q, v). Return one time derivative per"),
        ((1.0, 2.0, 3.0), "Mode 'a': field returned 3 values"),
        ((1.0, "2"), "Mode 'a': field: value 1 is not a number: '2'."),
        ((None, 2.0), "Mode 'a': field: value 0 is not a number: None."),
        ((1.0, np.timedelta64(2, "s")), "Mode 'a': field: value 1 is not a number"),
        (3.0, "Mode 'a': field must return a tuple or an array of one value per state (q, v); got 3.0"),
        ("ab", "Mode 'a': field must return a tuple or an array"),
        (b"ab", "Mode 'a': field must return a tuple or an array"),
        ({1.0, 2.0}, "Mode 'a': field must return a tuple or an array"),
        (np.array(3.0), "Mode 'a': field must return a tuple or an array"),
        (iter((1.0, 2.0)), "Mode 'a': field must return a tuple or an array"),
    ],
)
def test_values_of_a_field(value, text):
    found = told(checks._check_value, VARIABLES, function(None), value)
    assert found.startswith(text)
    assert bool(found) == bool(text)
    reset = told(checks._check_value, VARIABLES, function(None, kind="reset"), value)
    assert reset == found.replace("field", "reset").replace("time derivative", "value")


@pytest.mark.parametrize(
    ("value", "guard", "condition"),
    [
        (1.5, True, True),
        (np.array(2), True, True),
        (True, False, True),
        (np.True_, False, True),
        ((1.0,), False, False),
        (None, False, False),
        (np.array([1.0]), False, False),
    ],
)
def test_values_of_guards_and_conditions(value, guard, condition):
    found = told(checks._check_value, VARIABLES, function(None, size=None, kind="guard"), value)
    assert found.startswith("" if guard else "Mode 'a': guard must return one number that changes sign; got ")
    assert bool(found) != guard
    found = told(checks._check_value, VARIABLES, function(None, size=None, kind=CONDITION), value)
    assert found.startswith("" if condition else "Mode 'a': when must return one number, positive where the")
    assert bool(found) != condition


@pytest.mark.parametrize(
    ("value", "size", "text"),
    [
        (((0, 1), (2, 3)), 2, ""),
        (np.zeros((2, 3)), 2, ""),
        (
            np.zeros((3, 2)),
            2,
            "returned 3 rows of 2 values; it must return 2 rows of 2 or 3 values: one",
        ),
        (np.zeros((1, 2)), 2, "returned 1 rows of 2 values"),
        (np.zeros((2, 4)), 2, "returned 2 rows of 4 values"),
        (np.zeros((2, 1)), 2, "returned 2 rows of 1 values"),
        (((0, 1), (0, 1, 2)), 2, "returned 2 rows of 2 or 3 values"),
        ((0, 1), 2, "must return a tuple or an array of rows of 2 or 3 values"),
        (3.0, 2, "must return a tuple or an array of 2 rows"),
        (((0, 1), (2, None)), 2, "value 1 is not a number: None."),
        ((0, 1), None, ""),
        ((0, 1, 2), None, ""),
        ((0,), None, "returned 1 values; it must return 2 or 3 values: one column per state (q, v), and D_t"),
        ((0, 1, 2, 3), None, "returned 4 values"),
        (3.0, None, "must return a tuple or an array of 2 or 3 values"),
    ],
)
def test_shapes_of_derivatives(value, size, text):
    found = told(checks._check_derivative_shape, VARIABLES, function(None, size=size), value)
    assert bool(found) == bool(text)
    assert re.sub("^Mode 'a': jacobian:? ", "", found).startswith(text)


@pytest.mark.parametrize(
    ("size", "derivative", "has"),
    [
        (2, lambda t, x, p: ((0, 1, 0), (1, 0, 0)), True),
        (2, lambda t, x, p: ((0, 1), (1, 0)), False),
        (None, lambda t, x, p: (0, 1, 0), True),
        (None, lambda t, x, p: (0, 1), False),
        (2, lambda t, x, p: 1 / 0, False),
    ],
)
def test_a_derivative_has_a_column_of_time_or_not(size, derivative, has):
    given = function(None, size=size, derivative=derivative)
    assert checks.derivative_has_time_column(VARIABLES, given) is has


def test_a_function_that_gives_other_values_when_it_is_called_again():
    calls = []

    def counting(t, x, p):
        calls.append(t)
        return x.v, float(len(calls))

    text = told(checks._check_pure, VARIABLES, function(counting))
    assert text.startswith("Mode 'a': field returned [")
    assert "must be pure" in text
    assert told(checks._check_pure, VARIABLES, function(lambda t, x, p: (x.v, -x.q))) == ""

    def failing_once(t, x, p):
        calls.append(t)
        return x.v, 1.0 if len(calls) > 6 else np.nan

    calls.clear()
    # A value that is missing in one of two calls is no difference.
    assert told(checks._check_pure, VARIABLES, function(failing_once)) == ""


def raising(error):
    def raises(t, x, p):
        raise error

    return raises


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ZeroDivisionError("division"), ""),
        (OverflowError("range"), ""),
        (FloatingPointError("range"), ""),
        (ValueError("math domain error"), ""),
        (
            ValueError("assignment destination is read-only"),
            "It writes into its argument, which is the",
        ),
        (ValueError("no spring"), "It fails when called with (t, x, p): ValueError: no spring."),
        (TypeError("read-only"), "It fails when called with (t, x, p): TypeError: read-only."),
        (
            TypeError("math domain error"),
            "It fails when called with (t, x, p): TypeError: math domain",
        ),
        (ModelError("no name"), "It: no name"),
    ],
)
def test_errors_of_a_function(error, text):
    found = told(checks._call, "It", raising(error), (0.0, 1.0, 2.0))
    assert found.startswith(text)
    assert bool(found) == bool(text)
    if not text:
        assert checks._call("It", raising(error), (0.0, 1.0, 2.0)) is None


def test_the_value_of_a_call():
    assert checks._call("It", lambda t, x, p: None, (0.0, 1.0, 2.0)) == (None,)
    assert checks._call("It", max, (0.0, 1.0, 2.0)) == (2.0,)
    # The arithmetic of NumPy does not warn.
    assert np.isinf(checks._call("It", lambda t, x, p: np.float64(1.0) / t, (np.float64(0.0), 1, 2))[0])
    text = "It must take (t, x, p); got a function of (t): too many positional arguments."
    assert told(checks._call, "It", lambda t: t, (0.0, 1.0, 2.0)) == text


def test_a_period_is_a_number():
    for period, text in (
        (lambda p: p.g, ""),
        (lambda p: 1 / 0, ""),
        (lambda p: None, "HybridSystem: period must return a number; got None."),
        (lambda p: p.h, "HybridSystem: period: Parameter 'h' does not exist"),
        (lambda: 1.0, "HybridSystem: period must take (p); got a function of ()"),
    ):
        found = told(checks._check_period_function, VARIABLES, period)
        assert found.startswith(text)
        assert bool(found) == bool(text)


def test_a_period_is_checked_at_the_default_parameters():
    forced = [function(lambda t, x, p: (x.v, np.cos(t)))]
    for period, wrong in (
        (2 * np.pi, False),
        (lambda p: 2 * np.pi, False),
        (3.0, True),
        (None, False),
        (lambda p: 1 / 0, False),
    ):
        assert bool(told(checks._check_period, VARIABLES, forced, period)) is wrong
