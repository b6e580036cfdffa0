"""Roots of series of powers, and places where a series shows a value."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid.kernels.steps import series_roots
from hybrid.kernels.types.codes import HIGHEST_ORDER as ORDER
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain

kernels = plain(series_roots)


def _sought(series, column, known_roots, h, low, high, left, right, side):
    """The arguments of ``root_between`` for a step of length ``h``."""
    path = Path(series, len(series) - 1, -1, 0.0, 1.0, h, True)
    return path, column, known_roots, series_roots.Bracket(low, high, left, right), side


def _beside(powers):
    """A series in the second column of two."""
    return np.column_stack([np.full(len(powers), 9.0), powers])


def _expanded(powers, first, s):
    return kernels.expanded_at(_beside(powers), 1, first, len(powers) - 1, s)


def _root(powers, known_roots, low, high):
    left, _, _ = _expanded(powers, known_roots, low)
    right, _, _ = _expanded(powers, known_roots, high)
    side = 1 if left > 0.0 else -1
    return kernels.root_between(*_sought(_beside(powers), 1, known_roots, 1.0, low, high, left, right, side))


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


def _root_with_ends(powers, low, high, left, right):
    side = 1 if left > 0.0 else -1
    return kernels.root_between(*_sought(_beside(powers), 1, 0, 1.0, low, high, left, right, side))


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
    found = kernels.root_between(*_sought(series, 0, known_roots, 2.0, 0.5, 1.5, -0.5, 0.5, -1))
    # To first order; for ``s - 1`` that is exact.
    assert found == pytest.approx(1.0 - rounding, rel=0, abs=1e-15 if known_roots == 0 else 1e-17 / 1e-2)


def test_a_root_is_not_moved_to_the_start_of_a_step():
    """A value of rounding at the start, as large as the guard where it turns, is none of the way."""
    series = np.array([[-0.5], [-1.0], [1.0]])
    found = kernels.root_between(*_sought(series, 0, 1, 2.0, 0.5, 1.5, -0.5, 0.5, -1))
    assert found == 1.0


@pytest.mark.parametrize("span", [0.0, 1e-9, 0.3, 1.0, 3.0, 4.0])
def test_the_place_where_a_clock_shows_a_time(span):
    """The clock ``3 s + s^2``, and one that starts at speed zero, ``s^2``; places end with the step."""
    even = np.array([[9.0, 0.0], [9.0, 3.0], [9.0, 1.0]])
    exact = 2.0 * span / (np.sqrt(9.0 + 4.0 * span) + 3.0)
    assert kernels.time_of(even, 1, 2, 1.0, span) == pytest.approx(exact, rel=1e-14, abs=0.0)
    still = np.array([[9.0, 0.0], [9.0, 0.0], [9.0, 1.0]])
    assert kernels.time_of(still, 1, 2, 2.0, span) == pytest.approx(np.sqrt(span), rel=1e-14, abs=0.0)


def counted():
    """The kernels, and a list that grows at each evaluation of the series."""
    calls = []

    def expanded_at(*given):
        calls.append(given)
        return kernels.expanded_at(*given)

    return plain(series_roots, expanded_at=expanded_at), calls


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(
    ("powers", "place", "steps"),
    [
        ((0.0, 1.0, 0.0), 0.3, 2),
        ((0.0, 3.0, 1.0), 0.3, 5),
        ((0.0, 0.0, 1.0), 0.3, 1),
        ((0.0, 1.0, -0.49), 0.99, 6),
        ((0.0, 0.01, 1.0), 0.9, 4),
    ],
)
def test_a_clock_is_read_in_a_few_steps(powers, place, steps, unit):
    """In any unit of the place, which ends at 1."""
    tested, calls = counted()
    series = np.array([powers]).T / unit ** np.arange(3.0)[:, None]
    span = powers[1] * place + powers[2] * place**2
    found = tested.time_of(series, 0, 2, unit, span)
    assert found == pytest.approx(place * unit, rel=2e-14, abs=0.0)
    assert len(calls) <= steps


def test_a_time_beyond_a_step_is_at_its_end():
    assert kernels.time_of(np.array([[0.0], [3.0], [1.0]]), 0, 2, 1.0, 4.5) == 1.0


def cubic(*roots):
    return np.polynomial.Polynomial.fromroots(roots).coef


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("powers", "ends", "root", "steps"),
    [
        # An affine guard is solved by its secant.
        ((-0.3, 1.0), (0.0, 1.0), 0.3, 1),
        ((-0.75, 1.0), (0.5, 1.0), 0.75, 1),
        (cubic(0.3, -2.0, 4.0), (0.0, 1.0), 0.3, 3),
        (cubic(0.7, -0.2, 1.3), (0.5, 1.0), 0.7, 3),
        (cubic(0.7, 0.2, 1.1), (0.4, 1.0), 0.7, 3),
        (cubic(0.1, -0.2, 1.3), (0.0, 1.0), 0.1, 3),
        # Steps that rounding does not let shrink any more.
        (cubic(0.5, 0.5 + 1e-7), (0.4, 0.5 + 4e-8), 0.5, 5),
    ],
)
def test_a_root_is_found_in_a_few_steps(powers, ends, root, steps, unit):
    """In any unit of the place, where the step ends at 1."""
    tested, calls = counted()
    powers = np.array(powers)
    left, right = np.polynomial.polynomial.polyval(ends, powers)
    series = (powers / unit ** np.arange(float(len(powers))))[:, None]
    low, high = np.array(ends) * unit
    side = 1 if left > 0.0 else -1
    found = tested.root_between(*_sought(series, 0, 0, unit, low, high, 2.0 * left, 2.0 * right, side))
    assert found == pytest.approx(root * unit, rel=1e-8 if steps == 5 else 1e-15, abs=0.0)
    assert len(calls) <= steps


def test_the_ends_of_a_bracket_have_values_up_to_a_factor():
    """The secant of the given values leads to 1/2, where the series is 1, and Newton's method from there."""
    assert (
        kernels.root_between(*_sought(np.array([[-1.0], [4.0]]), 0, 0, 1.0, 0.0, 1.0, -1.0, 1.0, -1)) == 0.25
    )


def test_where_the_slope_is_zero_the_bracket_is_halved():
    """``(s - 1/2)^3 + 1/64`` in the middle of the bracket."""
    series = np.array([[-1 / 8 + 1 / 64], [3 / 4], [-3 / 2], [1.0]])
    tested, calls = counted()
    assert tested.root_between(*_sought(series, 0, 0, 1.0, 0.0, 1.0, -1.0, 1.0, -1)) == 0.25
    assert len(calls) == 2


def test_a_root_outside_of_the_bracket_is_not_found():
    """The secant ends at an end of the bracket, by rounding, and another root is next to it."""
    series = cubic(0.34, 0.7)[:, None]
    found = kernels.root_between(*_sought(series, 0, 0, 1.0, 0.5, 1.0, -1.0, 1e-17, -1))
    assert found == pytest.approx(0.7, rel=4e-16)
    series = cubic(0.49, 0.9)[:, None]
    found = kernels.root_between(*_sought(series, 0, 0, 1.0, 0.5, 1.0, -1e-17, 1.0, -1))
    assert found == pytest.approx(0.9, rel=4e-16)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_what_is_left_at_the_start_moves_a_root(unit):
    """``r + s (s - 1)`` on a step of length 2: ``r`` counts if it moves the root by at most 1e-6 of it."""
    for rest, moves in ((1.9e-6, True), (-1.9e-6, True), (2.1e-6, False), (-2.1e-6, False), (3.9e-6, False)):
        tested, calls = counted()
        series = np.array([rest, -1.0 / unit, 1.0 / unit**2])[:, None]
        found = tested.root_between(*_sought(series, 0, 1, 2.0 * unit, 0.4 * unit, 1.5 * unit, -0.6, 0.5, -1))
        scaled = 0.5 * (1.0 + math.sqrt(1.0 - 4.0 * rest)) if moves else 1.0
        assert found == pytest.approx(scaled * unit, rel=4e-16, abs=0.0)
        assert len(calls) <= (5 if moves else 2)


def test_a_root_next_to_the_start_is_moved_by_less_than_its_half():
    for rest, share in ((1e-13, 1.0), (1.08e-12, 0.0)):
        root = 1.2e-6
        series = np.array([[rest], [-root], [1.0]])
        found = kernels.root_between(*_sought(series, 0, 1, 1.0, 1e-7, 1.0, -1.0, 1.0, -1))
        moved = 0.5 * (root + math.sqrt(root**2 - 4.0 * share * rest))
        assert found == pytest.approx(moved, rel=1e-9, abs=0.0)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("at_end", [0.0, 1e-17, -1e-17])
@pytest.mark.parametrize(("low", "high", "other"), [(0.5, 1.0, 0.5), (0.0, 0.75, 0.75)])
def test_a_root_beside_one_at_an_end_of_the_bracket(low, high, other, at_end, side):
    """``(s - 0.6) (s - other)``: the value at the other root is rounding, so it tells no side."""
    powers = side * np.array([0.6 * other, -0.6 - other, 1.0])
    before = side if low < 0.5 else -side
    left, right = np.polynomial.polynomial.polyval((low, high), powers)
    left, right = (at_end, right) if other == low else (left, at_end)
    found = kernels.root_between(*_sought(_beside(powers), 1, 0, 1.0, low, high, left, right, before))
    assert found == pytest.approx(0.6, rel=1e-15)
