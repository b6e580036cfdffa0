"""Two parts hold what one number cannot: products exactly, sums and quotients to twice the digits."""

from fractions import Fraction

import numpy as np
import pytest
from numba import njit

from hybrid.kernels.doubled import divided, nothing, plus, times
from hybrid.kernels.lanes import load, store, store_down


def compute(matrix, a, b, by):
    """Row 0: two times four numbers. The results follow, each with its high and its low parts."""
    high, low = times(a, load(matrix, 0, 0), nothing()[0])
    store(matrix, 1, 0, high)
    store(matrix, 1, 4, low)
    high, low = plus(high, low, *times(b, load(matrix, 0, 4), nothing()[0]))
    store(matrix, 2, 0, high)
    store(matrix, 2, 4, low)
    high, low = divided(high, low, by)
    store(matrix, 3, 0, high)
    store(matrix, 3, 4, low)


@pytest.mark.parametrize("run", [compute, njit(fastmath={"contract"})(compute)], ids=["Python", "compiled"])
@pytest.mark.parametrize("seed", range(20))
def test_twice_the_digits(run, seed):
    rng = np.random.default_rng(seed)
    matrix = np.zeros((4, 8))
    matrix[0] = rng.normal(size=8) * 10.0 ** rng.integers(-5, 5, 8)
    a, b, by = float(rng.normal()), float(rng.normal()), float(rng.integers(1, 40))
    run(matrix, a, b, by)
    for lane in range(4):
        first = Fraction(a) * Fraction(matrix[0, lane])
        both = first + Fraction(b) * Fraction(matrix[0, 4 + lane])
        exact = (first, both, both / int(by))
        size = abs(first) + abs(both - first)
        for row, wanted in enumerate(exact, start=1):
            found = Fraction(matrix[row, lane]) + Fraction(matrix[row, 4 + lane])
            assert abs(found - wanted) <= (0 if row == 1 else size * Fraction(2) ** -98)
        # The first part of a quotient is the whole, rounded.
        assert matrix[3, lane] == float(exact[2])


def test_writing_down_a_column():
    @njit
    def compiled(matrix):
        store_down(matrix, 1, 2, 5, load(matrix, 0, 0))

    matrix = np.arange(60.0).reshape(3, 20)
    expected = matrix.copy()
    store_down(expected, 1, 2, 5, load(expected, 0, 0))
    compiled(matrix)
    np.testing.assert_array_equal(matrix, expected)
    np.testing.assert_array_equal(matrix[1, [2, 7, 12, 17]], matrix[0, :4])
