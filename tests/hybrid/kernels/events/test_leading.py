"""Polynomials in Bernstein form: the proof that there is no root, and halves."""

from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid.kernels.guards import leading
from tests.hybrid.kernels.plain import plain

kernels = plain(leading)


def in_bernstein_form(powers, degree):
    powers = [*powers, *[0.0] * (degree + 1 - len(powers))]
    return np.array(
        [sum(powers[j] * comb(k, j) / comb(degree, j) for j in range(k + 1)) for k in range(degree + 1)]
    )


@given(st.lists(st.floats(-2, 3), min_size=1, max_size=7), st.sampled_from([-1, 1]), st.floats(0, 0.1))
def test_the_cheap_proof_is_a_proof(roots, side, band):
    powers = np.polynomial.polynomial.polyfromroots(roots)
    if kernels.stays(in_bernstein_form(powers, 7), 7, side, band):
        assert not any(0.0 <= root <= 1.0 for root in roots)
        assert (np.polynomial.Polynomial(powers)(np.linspace(0, 1, 65)) * side > band - 1e-12).all()


@pytest.mark.parametrize("degree", [1, 4, 7])
def test_the_halves_have_the_same_values(degree):
    coefficients = np.random.default_rng(degree).normal(size=degree + 1)
    stack = np.zeros((2, degree + 3))
    stack[0] = 0.0, 1.0, *coefficients
    kernels.halve(stack, 0, degree)
    assert stack[:, :2].tolist() == [[0.5, 1.0], [0.0, 0.5]]

    def value(row, place):
        return sum(c * comb(degree, k) * place**k * (1 - place) ** (degree - k) for k, c in enumerate(row))

    for place in np.linspace(0.0, 1.0, 9):
        half, row = (stack[1, 2:], 2 * place) if place < 0.5 else (stack[0, 2:], 2 * place - 1)
        assert value(half, row) == pytest.approx(value(coefficients, place), abs=1e-13)
