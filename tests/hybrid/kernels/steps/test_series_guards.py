"""Results proved from the leading powers of a guard hold for the whole guard."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.steps import series_guards
from hybrid.kernels.types.codes import HIGHEST_ORDER as ORDER

_judge, _to_bernstein, _leading = (
    series_guards.judge_leading,
    series_guards.leading_to_bernstein,
    series_guards.leading_powers,
)
_keeps_half = series_guards.keeps_half
CLEAR, CROSSES, UNKNOWN = series_guards.CLEAR, series_guards.CROSSES, series_guards.UNKNOWN


@njit
def _judged(powers, side, band, last, size):
    series = powers.reshape((-1, 1))
    polynomial, stack = np.zeros(40), np.zeros((64, 40))
    degree, rest = _leading(series, 0, len(powers) - 1, 1.0, 0, size, polynomial, 1.0)
    _to_bernstein(polynomial, degree, stack)
    verdict, start, end, _ = _judge(degree, rest, (len(powers) - 1) * rest, side, band, last, stack)
    return verdict, start, end, degree, rest


def judged(powers, band=0.0):
    side = 1 if powers[0] > 0.0 else -1
    return side, *_judged(np.array(powers), side, band, float(np.sum(powers)), float(np.abs(powers).sum()))


def guards(radius):
    """Coefficients on the unit interval of series with about the given radius of convergence."""
    entry = st.floats(-1.0, 1.0).filter(lambda v: abs(v) > 1e-6)
    return st.lists(entry, min_size=ORDER + 1, max_size=ORDER + 1).map(
        lambda values: [value * radius**-k for k, value in enumerate(values)]
    )


def on_grid(powers):
    places = np.linspace(0.0, 1.0, 2001)
    return places, np.polynomial.polynomial.polyval(places, powers)


@njit
def _half(first, value, size):
    return _keeps_half(first, value, size)


@given(st.sampled_from([1.5, 2.5, 4.0, 8.0]).flatmap(guards))
def test_what_keeps_half_does(powers):
    side = 1 if powers[0] > 0.0 else -1
    _, values = on_grid(powers)
    if _half(abs(powers[0]), side * float(np.sum(powers)), float(np.abs(powers).sum())):
        assert np.all(side * values >= 0.5 * abs(powers[0]))


@pytest.mark.parametrize(
    ("powers", "keeps"),
    [((1.0, -0.4), True), ((1.0, -0.6), False), ((1.0, 1e3, -0.4), True), ((1e-9, 1.0, -1e-10), True),
     ((1e-17, 1.0, -1e-18), False), ((0.0,), False), ((1.0, math.nan), False)],
)  # fmt: skip
def test_what_keeps_half(powers, keeps):
    assert _half(powers[0], sum(powers), sum(map(abs, powers))) == keeps


@given(st.sampled_from([1.5, 2.5, 4.0, 8.0]).flatmap(guards), st.sampled_from([0.0, 1e-3]))
def test_verdicts_hold(powers, band):
    side, verdict, start, end, _, _ = judged(powers, band)
    places, values = on_grid(powers)
    values = side * values
    if verdict == CLEAR:
        assert np.all(values > band)
    if verdict == CROSSES:
        assert np.all(values[places < start] > band)
        inside = values[(places >= start) & (places <= end)]
        assert np.polynomial.polynomial.polyval(end, powers) * side < 0.0
        assert np.all(np.diff(inside) < 0.0)


@given(guards(2.5))
def test_what_is_left_out_is_bounded(powers):
    *_, degree, rest = judged(powers)
    assert math.fsum(map(abs, powers[degree + 1 :])) <= rest


@pytest.mark.parametrize(
    ("powers", "verdict"),
    [
        ([1.0, 1.0], CLEAR),
        ([1.0, -2.0], CROSSES),
        ([-1.0, 2.0], CROSSES),
        ([1.0, -4.0, 4.0], UNKNOWN),  # a touch
        ([0.1, -1.0, 1.0], CROSSES),  # the first of two
        ([0.2499, -1.0, 1.0], UNKNOWN),  # two close together
        ([1.0, -1.0], UNKNOWN),  # a zero at the very end
    ],
)
def test_verdicts(powers, verdict):
    assert judged([*powers, *[0.0] * (ORDER + 1 - len(powers))])[1] == verdict


def test_the_share_of_nearly_all_steps_is_decided():
    """For guards that change by their own size over a step, few cases need the whole polynomial."""
    random = np.random.default_rng(5)
    verdicts = []
    for _ in range(400):
        powers = random.uniform(-1.0, 1.0, ORDER + 1) * 3.0 ** -np.arange(ORDER + 1.0)
        powers[0] = random.choice([-1.0, 1.0]) * random.uniform(0.2, 1.0)
        verdicts.append(judged(powers)[1])
    assert np.mean(np.array(verdicts) == UNKNOWN) < 0.1


@njit
def _converted(powers, degree):
    stack = np.zeros((2, 40))
    _to_bernstein(powers, degree, stack)
    return stack[0, 2 : 3 + degree].copy()


@pytest.mark.parametrize("degree", [0, 1, 2, 7, 12, 15, 16, 20, 28])
def test_bernstein_coefficients(degree):
    """Up to degree 15 the computation uses registers, above it single numbers."""
    powers = np.random.default_rng(degree).normal(size=40)
    shares = [
        sum(math.comb(i, k) / math.comb(degree, k) * powers[k] for k in range(i + 1))
        for i in range(degree + 1)
    ]
    np.testing.assert_allclose(_converted(powers, degree), shares, rtol=1e-12, atol=1e-13)
