"""Results proved from the leading powers of a guard hold for the whole guard."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.steps import series_guards, series_roots
from hybrid.kernels.types.codes import HIGHEST_ORDER as ORDER
from tests.hybrid.kernels.plain import plain

_judge, _to_bernstein, _leading = (
    series_guards.judge_leading,
    series_guards.leading_to_bernstein,
    series_guards.leading_powers,
)
_expanded_at, _root_between, _keeps_half = (
    series_roots.expanded_at,
    series_roots.root_between,
    series_guards.keeps_half,
)
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


@njit
def _expanded(powers, first, s):
    return _expanded_at(powers.reshape((-1, 1)), 0, first, len(powers) - 1, s)


@njit
def _root(powers, known_roots, low, high):
    series = powers.reshape((-1, 1))
    left, _, _ = _expanded_at(series, 0, known_roots, len(powers) - 1, low)
    right, _, _ = _expanded_at(series, 0, known_roots, len(powers) - 1, high)
    return _root_between(series, 0, len(powers) - 1, known_roots, 1.0, low, high, left, right)


@pytest.mark.parametrize("order", [1, 2, 3, 8, 27, 28])
@pytest.mark.parametrize("first", [0, 1])
def test_value_and_derivatives(order, first):
    powers = np.random.default_rng(order).normal(size=order + 1)
    divided = np.polynomial.Polynomial(powers[first:])
    exact = [divided(0.7), divided.deriv()(0.7), divided.deriv(2)(0.7) / 2]
    np.testing.assert_allclose(_expanded(powers, first, 0.7), exact, rtol=1e-12, atol=1e-12)


@given(
    root=st.floats(0.05, 0.95),
    gap=st.floats(1e-7, 0.04),
    known_roots=st.integers(0, 2),
    tail=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=12),
)
def test_a_root_next_to_a_turning_point(root, gap, known_roots, tail):
    """The bracket ends where the guard turns back: the slope vanishes at one end of it."""
    # (s - root) (s - root - 2 gap) times a factor away from zero.
    rest = np.polynomial.Polynomial([1.0, *(0.3 * v / len(tail) for v in tail)])
    pair = np.polynomial.Polynomial.fromroots([root, root + 2.0 * gap])
    powers = np.concatenate([np.zeros(known_roots), (pair * rest).coef])
    found = _root(powers, known_roots, 0.0 if known_roots == 0 else 1e-3, root + gap)
    # Rounding of the terms, divided by the slope.
    assert abs(found - root) <= 64 * 2.2e-16 / (2.0 * gap * root**known_roots)


def test_a_root_to_rounding():
    """The cosine as a series of the length that exact modes use."""
    powers = np.array([0.0 if k % 2 else (-1.0) ** (k // 2) / math.factorial(k) for k in range(ORDER + 1)])
    assert _root(powers, 0, 1.0, 2.0) == pytest.approx(math.pi / 2, abs=2.3e-16)


@njit
def _root_with_ends(powers, low, high, left, right):
    return _root_between(powers.reshape((-1, 1)), 0, len(powers) - 1, 0, 1.0, low, high, left, right)


def test_a_root_that_rounding_puts_on_the_other_side_of_an_end():
    """The signs at the ends come from sums with other rounding errors than those of the series itself.

    The root is then just outside of the bracket as the series has it: it is at the end, to rounding.
    """
    orders = np.arange(ORDER + 1)
    sizes = np.array([(-1.0) ** (k // 2) * 1.3**k / math.factorial(k) for k in orders])
    cosine, sine = np.where(orders % 2 == 0, sizes, 0.0), np.where(orders % 2 == 1, sizes, 0.0)
    for beyond in (-1e-16, 0.0, 1e-17, 1e-16, 1e-15, 1e-12):
        for end, ends in ((1.0, (-1.0, 1e-17)), (0.5, (-1e-17, 1.0))):
            root = end + beyond if end == 1.0 else end - beyond
            powers = math.cos(1.3 * root) * sine - math.sin(1.3 * root) * cosine
            found = _root_with_ends(powers, 0.5, 1.0, *ends)
            assert found == pytest.approx(end, abs=max(4e-16, abs(beyond)))


@pytest.mark.parametrize("known_roots", [0, 1, 2])
@pytest.mark.parametrize("rounding", [1e-9, -1e-9, 0.0])
def test_a_root_is_one_of_the_whole_series(known_roots, rounding):
    """A guard that is known to be zero at the start is divided by the place; what is left there counts."""
    # ``rounding + s^k (s - 1)``, and a second column that must not matter.
    series = np.full((4, 2), 7.0)
    series[:, 0] = 0.0
    series[known_roots, 0], series[known_roots + 1, 0] = -1.0, 1.0
    series[0, 0] += rounding
    found = plain(series_roots).root_between(series, 0, 3, known_roots, 2.0, 0.5, 1.5, -0.5, 0.5)
    # To first order; for ``s - 1`` that is exact.
    assert found == pytest.approx(1.0 - rounding, rel=0, abs=1e-15 if known_roots == 0 else 1e-17 / 1e-2)


def test_a_root_is_not_moved_to_the_start_of_a_step():
    """A value of rounding at the start, as large as the guard where it turns, is none of the way."""
    series = np.array([[-0.5], [-1.0], [1.0]])
    found = plain(series_roots).root_between(series, 0, 2, 1, 2.0, 0.5, 1.5, -0.5, 0.5)
    assert found == 1.0


@pytest.mark.parametrize("span", [0.0, 1e-9, 0.3, 1.0, 3.0, 4.0])
def test_the_place_where_a_clock_shows_a_time(span):
    """The clock ``3 s + s^2``, and one that starts at speed zero, ``s^2``; places end with the step."""
    time_of = plain(series_roots).time_of
    even = np.array([[9.0, 0.0], [9.0, 3.0], [9.0, 1.0]])
    assert time_of(even, 1, 2, 1.0, span) == pytest.approx(
        (np.sqrt(9.0 + 4.0 * span) - 3.0) / 2.0, rel=1e-6 if span == 1e-9 else 1e-14, abs=0.0
    )
    still = np.array([[9.0, 0.0], [9.0, 0.0], [9.0, 1.0]])
    assert time_of(still, 1, 2, 2.0, span) == pytest.approx(np.sqrt(span), rel=1e-14, abs=0.0)
