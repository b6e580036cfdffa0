"""Logarithms and powers are accurate enough for the length of a step."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import powers
from hybrid.kernels.arithmetic.lanes import load, store

_logarithms, _power = powers.binary_logarithms, powers.power_of_two


@njit
def logarithms(matrix):
    store(matrix, 1, 0, _logarithms(load(matrix, 0, 0)))


@njit
def power(x):
    return _power(x)


def logarithms_of(numbers):
    matrix = np.array([numbers, np.zeros(4)])
    logarithms(matrix)
    return matrix[1]


@given(st.lists(st.floats(1e-300, 1e300), min_size=4, max_size=4))
def test_logarithms(numbers):
    np.testing.assert_allclose(logarithms_of(numbers), np.log2(numbers), atol=0.044, rtol=0)


def test_logarithms_of_what_is_not_in_range():
    zero, one, infinite, undefined = logarithms_of([0.0, 1.0, np.inf, np.nan])
    assert (zero, one) == pytest.approx((-1023.0, 0.0), abs=0.044)
    assert infinite >= 1024.0
    assert undefined >= 1024.0


@given(st.floats(-990.0, 990.0))
def test_powers(x):
    assert power(x) == pytest.approx(2.0**x, rel=0.007)


@pytest.mark.parametrize(("x", "exact"), [(0.0, 1.0), (3.0, 8.0), (-2.0, 0.25), (1e300, 2.0**1000)])
def test_powers_of_whole_numbers(x, exact):
    assert power(x) == exact
