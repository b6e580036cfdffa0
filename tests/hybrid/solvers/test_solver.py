"""Tolerances of solvers: what is allowed, and how they are tightened."""

import numpy as np
import pytest

from hybrid import DOP853, ArgumentError, RadauIIA, Taylor, Tsit5
from hybrid.solvers.solver import LEAST_RTOL

SOLVERS = [Taylor, DOP853, Tsit5, RadauIIA]


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize(
    ("factor", "rtol", "atol"), [(10.0, 1e-5, 2e-8), (1.0, 1e-4, 2e-7), (1e3, 1e-7, 2e-10)]
)
def test_both_tolerances_shrink_by_the_factor(kind, factor, rtol, atol):
    found = kind(rtol=1e-4, atol=2e-7, max_step=0.5, max_steps=77).tightened(factor)
    assert type(found) is kind
    assert (found.rtol, found.atol) == (pytest.approx(rtol, rel=1e-14), pytest.approx(atol, rel=1e-14))
    assert (found.max_step, found.max_steps) == (0.5, 77)


def test_rounding_is_the_limit():
    found = Taylor(rtol=2 * LEAST_RTOL, atol=1e-3).tightened(100.0)
    assert (found.rtol, found.atol) == (LEAST_RTOL, pytest.approx(5e-4, rel=1e-14))
    least = Taylor(rtol=0.5 * LEAST_RTOL, atol=1e-3)
    assert least.tightened(100.0) == least
    # A factor below one may loosen them, but not beyond what they were.
    assert Taylor(rtol=1e-6, atol=1e-8).tightened(0.1) == Taylor(rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, np.inf, "a", None])
def test_other_factors_are_refused(factor):
    with pytest.raises(ArgumentError, match="factor must be positive; got"):
        DOP853().tightened(factor)


@pytest.mark.parametrize("kind", SOLVERS)
def test_limits_of_the_values(kind):
    for rtol in (1e-15, 1.0):
        assert kind(rtol=rtol).rtol == rtol
    name = kind.__name__
    for options, text in (
        ({"rtol": 0.9e-15}, "rtol = 9e-16 is too small for double precision"),
        ({"rtol": 1.1}, "rtol = 1.1 allows errors larger than the state"),
        ({"rtol": 0.0}, "rtol must be"),
        ({"atol": 0.0}, "atol must be"),
        ({"atol": np.inf}, "atol must be"),
        ({"max_step": 0.0}, "max_step must be"),
        ({"max_steps": 0}, "max_steps must be a whole number of at least 1; got 0"),
        ({"max_steps": 1.5}, "max_steps must be a whole number of at least 1; got 1.5"),
    ):
        with pytest.raises(ArgumentError, match=f"{name}: {text}"):
            kind(**options)
    assert kind(max_step=np.inf).max_step == np.inf


def test_values_become_plain_numbers():
    found = DOP853(rtol=np.float64(1e-6), max_step=2, max_steps=np.int64(9))
    assert [type(each) for each in (found.rtol, found.max_step, found.max_steps)] == [float, float, int]


def test_only_taylor_prefers_series():
    assert [kind.by_series for kind in SOLVERS] == [True, False, False, False]


@pytest.mark.parametrize(("rtol", "order"), [(1e-2, 12), (1e-4, 16), (1e-8, 25), (1e-10, 28), (1e-14, 28)])
def test_the_order_of_series_grows_with_the_digits(rtol, order):
    """It is six more than the number of e-foldings of the tolerance, between 12 and 28."""
    assert [kind(rtol=rtol).series_order for kind in SOLVERS] == [order] * 4
