"""Root isolation on polynomials with known roots, in exact arithmetic up to the last rounding."""

from fractions import Fraction
from itertools import pairwise
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import bernstein

NONE = bernstein.NO_ROOT
_first_crossing, _divide_by_theta, _stays = (
    bernstein.first_crossing,
    bernstein.divide_by_theta,
    bernstein.stays,
)
_value_and_slope, _next_turn, _restrict = (
    bernstein.value_and_slope,
    bernstein.next_turn,
    bernstein.restrict,
)
_multiply_by_theta = bernstein.multiply_by_theta


@njit
def first_crossing(coefficients, degree, side, direction):
    return _first_crossing(coefficients, degree, side, direction, np.zeros((64, degree + 4)))


@njit
def deflated(coefficients, times):
    degree = coefficients.size - 1
    for _ in range(times):
        degree = _divide_by_theta(coefficients, degree)
    return degree


@njit
def stays(coefficients, side, band):
    return _stays(coefficients, coefficients.size - 1, side, band)


@njit
def value_and_slope(coefficients, theta):
    return _value_and_slope(coefficients, coefficients.size - 1, theta)


@njit
def restricted(coefficients, start):
    _restrict(coefficients, coefficients.size - 1, start)
    return coefficients


@njit
def next_turn(coefficients, start):
    return _next_turn(coefficients, coefficients.size - 1, start, np.zeros((64, coefficients.size + 3)))


@njit
def multiplied(coefficients, degree):
    return _multiply_by_theta(coefficients, degree)


def powers(roots, pairs=()):
    """Exact coefficients of ``1, theta, ...`` from real roots and quadratics ``(theta - a)^2 + b``."""
    product = [Fraction(1)]

    def times(factor):
        result = [Fraction(0)] * (len(product) + len(factor) - 1)
        for i, a in enumerate(product):
            for j, b in enumerate(factor):
                result[i + j] += a * b
        return result

    for root in roots:
        product = times([-Fraction(root), Fraction(1)])
    for a, b in pairs:
        a, b = Fraction(a), Fraction(b)
        product = times([a * a + b, -2 * a, Fraction(1)])
    return product


def bernstein(power, degree=None):
    """Bernstein coefficients, rounded once, of the given degree or the polynomial's own."""
    n = degree or len(power) - 1
    power = [*power, *[Fraction(0)] * (n + 1 - len(power))]
    return np.array(
        [float(sum(power[j] * Fraction(comb(k, j), comb(n, j)) for j in range(k + 1))) for k in range(n + 1)]
    )


def crossing(coefficients, side, direction=0):
    return first_crossing(coefficients, len(coefficients) - 1, side, direction)


def exact_crossing(roots, pairs, direction):
    """The side before the interval, and the first root at which the sign changes in ``direction``."""
    power = powers(roots, pairs)
    inside = sorted({Fraction(root) for root in roots if 0 < root < 1})
    cuts = [Fraction(0), *inside, Fraction(1)]
    signs = [
        1 if sum(a * ((left + right) / 2) ** i for i, a in enumerate(power)) > 0 else -1
        for left, right in pairwise(cuts)
    ]
    for root, before, after in zip(inside, signs, signs[1:], strict=False):
        if before != after and direction in (0, after):
            return signs[0], float(root), signs[-1]
    return signs[0], NONE, signs[-1]


# Multiples of 1/64 apart, so that rounding of the coefficients hardly moves a root.
apart = st.lists(st.integers(-40, 120), min_size=1, max_size=5, unique=True).map(
    lambda numerators: [n / 64 + 1 / 256 for n in numerators]
)
quadratics = st.lists(
    st.tuples(st.floats(-1, 2).map(lambda a: round(a, 3)), st.sampled_from([0.01, 0.3, 2.0])), max_size=1
)
directions = st.sampled_from([-1, 0, 1])


@given(apart, quadratics, directions)
def test_first_crossing_is_the_earliest_root_in_the_direction(roots, pairs, direction):
    side, expected, end = exact_crossing(roots, pairs, direction)
    coefficients = bernstein(powers(roots, pairs), 7)
    theta, after = crossing(coefficients, side, direction)
    assert theta == pytest.approx(expected, abs=1e-9)
    assert after == (end if expected == NONE else (direction or -side))


@given(apart, quadratics, directions, st.floats(1e-150, 1e150))
def test_scale_does_not_matter(roots, pairs, direction, scale):
    side = exact_crossing(roots, pairs, direction)[0]
    coefficients = bernstein(powers(roots, pairs), 7)
    whole = crossing(coefficients, side, direction)
    # A power of two does not change the digits.
    scaled = crossing(coefficients * 2.0 ** round(np.log2(scale)), side, direction)
    assert scaled == whole
    mirrored = crossing(-coefficients, -side, -direction)
    assert mirrored == (whole[0], -whole[1])


@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9), directions)
def test_against_sampling(values, direction):
    """Every crossing that sampling sees is found, and every crossing found is a zero."""
    coefficients = np.array(values)
    if not abs(coefficients[0]) > 1e-3:
        return
    side = 1 if coefficients[0] > 0 else -1
    theta, _ = crossing(coefficients, side, direction)
    grid = np.linspace(0, 1, 4001)
    basis = [comb(8, k) * grid**k * (1 - grid) ** (8 - k) for k in range(9)]
    sampled = np.array(basis).T @ coefficients
    clear = np.abs(sampled) > 1e-12
    grid, signs = grid[clear], np.sign(sampled[clear])
    changes = np.flatnonzero((signs[1:] != signs[:-1]) & ((signs[1:] == direction) | (direction == 0)))
    if len(changes):
        assert theta <= grid[changes[0] + 1]
    if theta <= 1:
        assert abs(value_and_slope(coefficients, theta)[0]) < 1e-12


@pytest.mark.parametrize(
    ("roots", "side", "direction", "expected"),
    [
        ((0.25, 0.5), 1, 0, 0.25),
        ((0.25, 0.5), 1, 1, 0.5),
        ((0.5, 0.75), 1, 1, 0.75),
        ((0.5, 0.75), 1, -1, 0.5),
        ((0.3, 1.0), 1, 0, 0.3),
        ((0.3, 1.0), 1, 1, 1.0),
        ((1.0,), -1, 1, 1.0),
        ((1.0,), -1, -1, NONE),
        ((0.125, 0.25, 0.5, 1.0), 1, 1, 0.25),
    ],
)
def test_roots_where_intervals_are_cut(roots, side, direction, expected):
    """Signs alone prove nothing for roots at the ends and middles of intervals."""
    assert crossing(bernstein(powers(roots), 7), side, direction)[0] == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("place", [0.1, 0.37, 0.9])
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_a_close_pair_is_two_crossings(gap, place, direction):
    """A grazing that reaches ``gap^2 / 4`` beyond: at 1e-9 below the rounding of coefficients near 1."""
    power = powers((place, place + gap))
    coefficients = bernstein(power)
    if gap == 1e-9:
        coefficients = np.array([place * (place + gap), -place + place * place, (1 - place) ** 2])
    theta, _ = crossing(coefficients, 1, direction)
    if gap == 1e-9:
        # The coefficients cannot resolve the pair; a crossing that is found must be in the right place.
        assert theta == NONE or abs(theta - place) < 1e-7
    else:
        assert theta == pytest.approx(place + (gap if direction == 1 else 0.0), abs=1e-15 / gap + 1e-15)


@pytest.mark.parametrize("gap", [1e-9, 1e-12])
def test_a_close_pair_near_the_start_is_two_crossings(gap):
    """Near zero the coefficients are as small as the roots, so no digits are lost."""
    coefficients = bernstein(powers((gap, 2 * gap, 0.7)), 7)
    assert crossing(coefficients, -1, +1)[0] == pytest.approx(gap, rel=1e-3)
    assert crossing(coefficients, -1, -1)[0] == pytest.approx(2 * gap, rel=1e-3)


def test_a_double_root_is_no_crossing():
    coefficients = bernstein(powers((0.5, 0.5)), 7)
    for direction in (-1, 0, 1):
        assert crossing(coefficients, 1, direction) == (NONE, 1)


def test_a_triple_root_is_one_crossing():
    assert crossing(bernstein(powers((0.5, 0.5, 0.5))), -1, 1)[0] == pytest.approx(0.5, abs=1e-4)


def test_a_grazing_pair_fires_in_the_right_direction():
    coefficients = bernstein(powers((0.4, 0.4001)), 7)
    assert crossing(coefficients, 1, -1)[0] == pytest.approx(0.4, abs=1e-10)
    assert crossing(coefficients, 1, +1)[0] == pytest.approx(0.4001, abs=1e-10)


def test_the_zero_polynomial_crosses_nothing():
    for side in (-1, 1):
        assert crossing(np.zeros(8), side) == (NONE, side)
        for before in (-3.0, 3.0):
            # A constant has no slope; what lies before it in memory is none.
            assert crossing(np.array([before, 0.0])[1:], side) == (NONE, side)


def test_a_side_that_differs_at_once_is_a_crossing_at_the_start():
    coefficients = bernstein(powers((0.6,)), 7)
    assert crossing(coefficients, 1, 0) == (0.0, -1)
    assert crossing(coefficients, 1, -1) == (0.0, -1)
    assert crossing(coefficients, 1, +1)[0] == pytest.approx(0.6)


def test_no_side_takes_the_first_sign():
    coefficients = bernstein(powers((0.6,)), 7)
    assert crossing(coefficients, 0, 0)[0] == pytest.approx(0.6)


def test_without_a_side_roots_at_the_start_up_to_rounding_are_no_crossings():
    """With a side they are one crossing at the start, if their number is odd."""
    cluster = bernstein(powers((1e-17, 2e-17, 3e-17, 0.5)), 7)
    assert cluster[0] > 0.0 > cluster[1]
    assert crossing(cluster, 0, 0)[0] == pytest.approx(0.5)
    assert crossing(cluster, 0, +1)[0] == pytest.approx(0.5)
    assert crossing(cluster, 1, 0)[0] == pytest.approx(0.0, abs=1e-14)


@given(st.floats(0.01, 0.99), st.sampled_from([0.0, 1.0]), st.sampled_from([-1.0, 1.0]))
def test_a_root_at_an_end_up_to_rounding_does_not_stand_for_the_one_inside(root, end, sign):
    """A step that ends at the event of one guard may begin or end at a root of another."""
    coefficients = sign * bernstein(powers((root, end)), 5)
    first = -1 if (sign > 0.0) == (end == 1.0) else 1
    coefficients[int(5 * end)] = -first * 1e-17 if end == 0.0 else first * 1e-17
    assert crossing(coefficients, -first, first)[0] == pytest.approx(root, abs=1e-12)


def test_side_after_crossings_against_the_direction():
    assert crossing(bernstein(powers((0.2,)), 7), -1, -1) == (NONE, 1)
    assert crossing(bernstein(powers((0.2, 0.4)), 7), 1, 1)[1] == 1


@given(apart)
def test_deflation_takes_out_exactly_the_root_at_zero(roots):
    expected = bernstein(powers(roots), 7)
    coefficients = bernstein(powers([0, *roots]), 8)
    degree = deflated(coefficients, 1)
    assert degree == 7
    np.testing.assert_allclose(coefficients[:8], expected, rtol=1e-14, atol=1e-14)


def test_a_second_root_next_to_the_known_one_is_found():
    """As after a very short bounce: the guard is zero now and again after 1e-12 of the step."""
    coefficients = bernstein(powers((0, 1e-12)), 7)
    degree = deflated(coefficients, 1)
    theta, side = first_crossing(-coefficients[: degree + 1], degree, 1, -1)
    assert theta == pytest.approx(1e-12, rel=1e-9)
    assert side == -1


def test_a_double_root_at_zero_is_deflated_twice():
    coefficients = bernstein(powers((0, 0, 0.3)), 8)
    degree = deflated(coefficients, 2)
    assert first_crossing(coefficients[: degree + 1], degree, -1, 1)[0] == pytest.approx(0.3, abs=1e-14)


@given(apart, quadratics)
def test_the_cheap_proof_is_a_proof(roots, pairs):
    side, expected, _ = exact_crossing(roots, pairs, 0)
    if stays(bernstein(powers(roots, pairs), 7), side, 0.0):
        assert expected == NONE


@given(st.lists(st.floats(-5, 5), min_size=4, max_size=4), st.floats(0, 1))
def test_value_and_slope(values, theta):
    a, b, c, d = values
    value, slope = value_and_slope(np.array(values), theta)
    s = 1 - theta
    expected = a * s**3 + 3 * b * s**2 * theta + 3 * c * s * theta**2 + d * theta**3
    assert value == pytest.approx(expected, abs=1e-13)
    expected = 3 * ((b - a) * s**2 + 2 * (c - b) * s * theta + (d - c) * theta**2)
    assert slope == pytest.approx(expected, abs=1e-12)


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=9), st.floats(0, 0.99), st.floats(0, 1))
def test_the_restriction_has_the_same_values(values, start, theta):
    expected = value_and_slope(np.array(values), start + theta * (1 - start))[0]
    assert value_and_slope(restricted(np.array(values), start), theta)[0] == pytest.approx(
        expected, abs=1e-13
    )


def test_values_and_slopes_of_a_constant():
    assert value_and_slope(np.array([3.0]), 0.3) == (3.0, 0.0)


@given(apart, st.floats(-1.0, 1.0))
def test_the_turns_inside_one_after_another(turns, height):
    """Of ``height`` plus the integral of a product of factors: its turns are known."""
    slope = np.array([float(c) for c in powers(turns)])
    power = np.polynomial.polynomial.polyint(slope, k=height)
    coefficients = bernstein([Fraction(float(c)) for c in power])
    start, found = 0.0, []
    while (turn := next_turn(coefficients, start))[0] < NONE:
        found.append(turn)
        start = turn[0] + 1e-9
    inside = np.sort([turn for turn in turns if 0 < turn < 1])
    bends = np.sign(np.polynomial.polynomial.polyval(inside, np.polynomial.polynomial.polyder(slope)))
    values = np.polynomial.polynomial.polyval(inside, power)
    places, heights, kinds = np.array(found).reshape(-1, 3).T
    np.testing.assert_allclose(places, inside, rtol=0, atol=1e-6)
    np.testing.assert_allclose(heights, values, rtol=0, atol=1e-9 * abs(power).sum())
    np.testing.assert_array_equal(kinds, bends)


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=9))
def test_a_multiplication_undoes_a_division(values):
    degree = len(values) - 1
    room = np.array([*values, 0.0])
    assert multiplied(room, degree) == degree + 1
    assert room[0] == 0.0
    assert deflated(room, 1) == degree
    np.testing.assert_allclose(room[:-1], values, rtol=1e-14, atol=1e-300)
