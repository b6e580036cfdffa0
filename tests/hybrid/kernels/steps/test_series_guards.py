"""Polynomials of guards along a series; results proved from leading powers hold for the whole guard."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.steps import series_guards
from hybrid.kernels.steps.series_guards import DEGREES, NEGLIGIBLE, ROUNDING_OF_TERMS
from hybrid.kernels.types.codes import HIGHEST_ORDER as ORDER
from tests.hybrid.kernels.plain import plain

kernels = plain(series_guards)

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


@pytest.mark.parametrize("degree", [0, 1, 2, 7, 12, 15])
def test_bernstein_coefficients(degree):
    powers = np.random.default_rng(degree).normal(size=40)
    shares = [
        sum(math.comb(i, k) / math.comb(degree, k) * powers[k] for k in range(i + 1))
        for i in range(degree + 1)
    ]
    np.testing.assert_allclose(_converted(powers, degree), shares, rtol=1e-12, atol=1e-13)


def column(*powers):
    """A series in the second of two columns."""
    return np.column_stack([np.full(len(powers), 77.0), powers])


class TestForms:
    @pytest.mark.parametrize("degree", [0, 1, 2, 5, DEGREES - 1])
    def test_bernstein_coefficients(self, degree):
        powers = np.random.default_rng(degree).normal(size=degree + 1)
        exact = [
            sum(math.comb(i, k) / math.comb(degree, k) * powers[k] for k in range(i + 1))
            for i in range(degree + 1)
        ]
        given, stack = np.append(powers, 99.0), np.full((2, 2 + DEGREES + ORDER), 5.0)
        kernels.leading_to_bernstein(given, degree, stack)
        np.testing.assert_allclose(stack[0, 2 : 3 + degree], exact, rtol=1e-13, atol=1e-14)
        assert given.tolist() == [*powers, 99.0]
        assert stack[0, :2].tolist() == [5.0, 5.0]

    def test_what_is_left_without_the_known_terms(self):
        series = column(-1.0, 3.0, -5.0)
        for known, size, power in ((0, 100.0, 1.0), (1, 99.0, 2.0), (2, 93.0, 4.0), (3, 73.0, 8.0)):
            assert kernels.beyond_known_roots(series, 1, 2.0, known, 100.0) == (size, power)

    def test_the_cheap_proof(self):
        """Of a size of 10 and a value of 4 at the end, 3 are taken down at most: 6 keeps a half."""
        for first, kept in ((6.1, True), (5.9, False), (6.0, False), (-7.0, False)):
            assert kernels.keeps_half(first, 4.0, 10.0) == kept
        assert not kernels.keeps_half(6.0 + 9.0 * ROUNDING_OF_TERMS, 4.0, 10.0)
        assert kernels.keeps_half(6.0 + 11.0 * ROUNDING_OF_TERMS, 4.0, 10.0)

    def test_leading_powers(self):
        series = column(3.0, -50.0, 0.25, 1e-3, 1e-5)
        found = np.full(6, 99.0)
        # On a step of 2, divided by the variable: 100, 1, 8e-3, 1.6e-4.
        size = 100.0 + 1.0 + 8e-3 + 1.6e-4
        degree, rest = kernels.leading_powers(series, 1, 4, 2.0, 1, size, found, 2.0)
        assert degree == 1
        assert found.tolist() == [-100.0, 1.0, 99.0, 99.0, 99.0, 99.0]
        assert rest == pytest.approx(8e-3 + 1.6e-4 + ROUNDING_OF_TERMS * size, rel=1e-9)
        # A share of 0.003 of the size is negligible.
        for last, expected in ((0.99 * NEGLIGIBLE, 0), (1.01 * NEGLIGIBLE, 1)):
            small = column(1.0 - last, last)
            degree, rest = kernels.leading_powers(small, 1, 1, 1.0, 0, 1.0, found, 1.0)
            assert degree == expected
            assert rest == pytest.approx((last if expected == 0 else 0.0) + ROUNDING_OF_TERMS, rel=1e-6)
        # Rounding of the size leaves no negative rest.
        degree, rest = kernels.leading_powers(column(1.0, 2.0), 1, 1, 1.0, 0, 2.5, found, 1.0)
        assert (degree, rest) == (1, 2.5 * ROUNDING_OF_TERMS)

    @pytest.mark.parametrize("side", [1, -1])
    def test_a_polynomial_that_falls_throughout(self, side):
        for coefficients, slope, falls in (
            ((3.0, 2.0, 1.0), 1.9, True),
            ((3.0, 2.0, 1.0), 2.1, False),
            ((3.0, 2.0, 2.0), 0.0, False),
            ((2.0, 2.0, 1.0), 0.0, False),
            ((1.0, 2.0, 3.0), 0.0, False),
            ((3.0, 1.0), 1.9, True),
            ((3.0, 1.0), 2.1, False),
            ((3.0,), 0.0, False),
        ):
            given = side * np.array(coefficients)
            assert kernels.falls_throughout(given, len(coefficients) - 1, slope, side) == falls


class TestJudge:
    def judge(self, coefficients, side=1, rest=0.0, slope=0.0, band=0.0, last=None):
        stack = np.zeros((12, 10))
        stack[0, 2 : 2 + len(coefficients)] = coefficients
        last = coefficients[-1] if last is None else last
        verdict, *place = kernels.judge_leading(len(coefficients) - 1, rest, slope, side, band, last, stack)
        return verdict, tuple(place), stack

    @pytest.mark.parametrize("side", [1, -1])
    def test_a_line(self, side):
        for ends, band, rest, verdict in (
            ((2.0, 1.0), 0.5, 0.4, CLEAR),
            ((2.0, 1.0), 0.5, 0.6, UNKNOWN),
            ((2.0, -1.0), 0.0, 0.0, CROSSES),
            ((-1.0, 2.0), 0.0, 0.0, UNKNOWN),
        ):
            found, place, stack = self.judge(side * np.array(ends), side, rest, 0.0, band)
            assert found == verdict
            if verdict == CROSSES:
                assert place == (0.0, 1.0, 0)
                assert stack[0, 2:4].tolist() == [2.0 * side, -side]

    @pytest.mark.parametrize("side", [1, -1])
    def test_a_part_that_falls_after_one_that_is_clear(self, side):
        """``3 + 2 s - 6 s^2`` turns before it falls through zero, on the second half."""
        found, (start, end, row), stack = self.judge(side * np.array([3.0, 4.0, -1.0]), side)
        assert (found, start, end) == (CROSSES, 0.5, 1.0)
        np.testing.assert_allclose(stack[row, 2:5], side * np.array([2.5, 1.5, -1.0]))

    def test_what_is_left_out_may_make_it_rise_or_take_it_to_zero(self):
        ends = [2.0, -1.0]
        assert self.judge(ends, slope=2.9)[0] == CROSSES
        assert self.judge(ends, slope=3.1)[0] == UNKNOWN
        # The ends of the step themselves are exact.
        assert self.judge(ends, band=3.0, rest=3.0, last=-1e-9)[0] == CROSSES
        assert self.judge(ends, rest=0.1, last=1e-9)[:2] == (CROSSES, (0.5, 0.75, 1))
        falling = [3.0, 4.0, -1.0]
        # In the middle the value 2.5 must be beyond what is left out and the band.
        assert self.judge(falling, rest=0.6, band=0.6)[0] == CROSSES
        assert self.judge(falling, rest=1.3, band=1.3)[0] == UNKNOWN

    def test_parts_shorter_than_a_fifth_are_not_divided(self):
        found, (start, end, _), _ = self.judge([1.0, -1.0, 1.0])
        assert (found, start, end - start) == (UNKNOWN, 0.375, 0.125)
