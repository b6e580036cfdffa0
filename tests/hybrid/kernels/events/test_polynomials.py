"""Crossings of guards that are polynomials in a column of a path, isolated on its pieces."""

from fractions import Fraction
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid.kernels.events.onset import NO_ROOT
from hybrid.kernels.guards import isolate
from hybrid.kernels.guards.form import Guard
from hybrid.kernels.guards.roots import NOWHERE
from hybrid.kernels.types.codes import EXACT
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain

kernels = plain(isolate)


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


def crossing(coefficients, side, direction=0, sure=0.0):
    """Place of the first crossing on [0, 1] of a polynomial in powers, and the side after it."""
    coefficients = np.array([[float(each)] for each in coefficients])
    path = Path(coefficients, len(coefficients) - 1, -1, 0.0, 1.0, 1.0, True, 1)
    model = SimpleNamespace(
        dimension=1,
        period=0.0,
        parameters=None,
        direction=[direction],
        propagator=[EXACT],
        programs=SimpleNamespace(first=[0, 0]),
        guard=lambda transition, t, x, parameters, out: out.__setitem__(0, coefficients[0, 0]),
        guard_gradient=lambda transition, t, x, parameters, out: out.__setitem__(slice(None), 0.0),
        first_forcing=[0],
        first_residue=[0],
        target=np.zeros(1),
    )
    run = SimpleNamespace(
        mode=0, y=np.zeros(1), scale=np.zeros(1), changes=[NO_ROOT], last_fired=-1, since_entry=1.0,
        unproved=np.zeros(1, int), grazing_place=NO_ROOT, next_grazing=NO_ROOT,
    )  # fmt: skip
    work = SimpleNamespace(
        state=np.zeros(1), scalar=np.zeros(1), gradient=np.zeros(2), registers=np.zeros((1, 6)),
        intervals=np.zeros((64, 2)),
    )  # fmt: skip
    guard = Guard(0, 0, side, 0, sure, 0.0, 0.0, 0.0)
    place, guard, proved = kernels.first_change(model, run, path, guard, sure, work)
    assert (proved, run.unproved.sum()) == (1.0, 0)
    return place, guard.side


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
    return signs[0], NOWHERE, signs[-1]


# Multiples of 1/64 apart, so that rounding of the coefficients hardly moves a root.
apart = st.lists(st.integers(-40, 120), min_size=1, max_size=5, unique=True).map(
    lambda numerators: [n / 64 + 1 / 256 for n in numerators]
)
quadratics = st.lists(
    st.tuples(st.floats(-1, 2).map(lambda a: round(a, 3)), st.sampled_from([0.01, 0.3, 2.0])), max_size=1
)
directions = st.sampled_from([-1, 0, 1])


@given(apart, quadratics, directions)
def test_the_earliest_root_in_the_direction(roots, pairs, direction):
    side, expected, end = exact_crossing(roots, pairs, direction)
    place, after = crossing(powers(roots, pairs), side, direction)
    assert place == pytest.approx(expected, abs=1e-9)
    assert after == (end if expected == NOWHERE else (direction or -side))


@given(apart, quadratics, directions, st.floats(1e-150, 1e150))
def test_scale_does_not_matter(roots, pairs, direction, scale):
    side = exact_crossing(roots, pairs, direction)[0]
    coefficients = np.array(powers(roots, pairs), dtype=float)
    whole = crossing(coefficients, side, direction)
    # A power of two does not change the digits.
    assert crossing(coefficients * 2.0 ** round(np.log2(scale)), side, direction) == whole
    assert crossing(-coefficients, -side, -direction) == (whole[0], -whole[1])


@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9), directions)
def test_against_sampling(values, direction):
    """Every crossing that sampling sees is found, and every crossing found is a zero."""
    if not abs(values[0]) > 1e-3:
        return
    side = 1 if values[0] > 0 else -1
    place, _ = crossing(values, side, direction)
    grid = np.linspace(0, 1, 4001)
    sampled = np.polynomial.Polynomial(values)(grid)
    clear = np.abs(sampled) > 1e-12
    grid, signs = grid[clear], np.sign(sampled[clear])
    changes = np.flatnonzero((signs[1:] != signs[:-1]) & ((signs[1:] == direction) | (direction == 0)))
    if len(changes):
        assert 0.0 <= place <= grid[changes[0] + 1]
    if place != NOWHERE:
        assert abs(np.polynomial.Polynomial(values)(place)) < 1e-12


@pytest.mark.parametrize(
    ("roots", "side", "direction", "expected"),
    [
        ((0.25, 0.5), 1, 0, 0.25),
        ((0.25, 0.5), 1, 1, 0.5),
        ((0.5, 0.75), 1, 1, 0.75),
        ((0.5, 0.75), 1, -1, 0.5),
        ((0.3, 1.0), 1, 0, 0.3),
        ((1.0,), -1, -1, NOWHERE),
        ((0.125, 0.25, 0.5, 1.0), 1, 1, 0.25),
    ],
)
def test_roots_where_pieces_are_cut(roots, side, direction, expected):
    """Signs alone prove nothing for roots at the ends and middles of pieces."""
    assert crossing(powers(roots), side, direction)[0] == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize("gap", [1e-3, 1e-6])
@pytest.mark.parametrize("place", [0.1, 0.37, 0.9])
@pytest.mark.parametrize("direction", [-1, 0, 1])
def test_a_close_pair_is_two_crossings(gap, place, direction):
    """A grazing that reaches ``gap^2 / 4`` beyond."""
    found, _ = crossing(powers((place, place + gap)), 1, direction)
    assert found == pytest.approx(place + (gap if direction == 1 else 0.0), abs=1e-15 / gap + 1e-15)


@pytest.mark.parametrize("gap", [1e-9, 1e-12])
def test_a_close_pair_near_the_start_is_two_crossings(gap):
    """Near zero the coefficients are as small as the roots, so no digits are lost."""
    coefficients = powers((gap, 2 * gap, 0.7))
    assert crossing(coefficients, -1, +1)[0] == pytest.approx(gap, rel=1e-3)
    assert crossing(coefficients, -1, -1)[0] == pytest.approx(2 * gap, rel=1e-3)


def test_a_double_root_is_no_crossing_and_a_triple_root_is_one():
    for direction in (-1, 0, 1):
        assert crossing(powers((0.5, 0.5)), 1, direction) == (NOWHERE, 1)
    assert crossing(powers((0.5, 0.5, 0.5)), -1, 1)[0] == pytest.approx(0.5, abs=1e-4)


def test_the_zero_polynomial_crosses_nothing():
    for side in (-1, 1):
        assert crossing(np.zeros(8), side) == (NOWHERE, side)


def test_a_side_that_differs_at_once_is_a_crossing_at_the_start():
    coefficients = powers((-1e-9,))
    assert crossing(coefficients, -1, 0) == crossing(coefficients, -1, 1) == (0.0, 1)
    assert crossing(coefficients, -1, -1) == (NOWHERE, 1)
    # No side takes the first sign.
    assert crossing(powers((0.6,)), 0, 0) == (NOWHERE, 1)


def test_side_after_crossings_against_the_direction():
    assert crossing(powers((0.2,)), -1, -1) == (NOWHERE, 1)
    assert crossing(powers((0.2, 0.4)), 1, 1)[1] == 1


@pytest.mark.parametrize("noise", [0.0, 1e-17, -1e-17])
def test_roots_at_the_start_are_not_found_again(noise):
    """As after a very short bounce: the guard is zero now, up to rounding, and again a little later."""
    coefficients = np.array(powers((0, 1e-6)), dtype=float)
    coefficients[0] = noise
    assert crossing(-coefficients, 1, -1, 1e-9) == (pytest.approx(1e-6, rel=1e-4), -1)
    coefficients = np.array(powers((0, 0, 0.3)), dtype=float)
    coefficients[:2] = noise, -noise
    assert crossing(coefficients, -1, 1, 1e-6)[0] == pytest.approx(0.3, abs=1e-14)
