"""Four numbers in a register compute what an array of four does."""

import numpy as np
import pytest
from numba import njit

from hybrid.kernels.lanes import load, store

EXPRESSIONS = {
    "sum": lambda a, b, s: a + b,
    "difference": lambda a, b, s: a - b,
    "product": lambda a, b, s: a * b,
    "quotient": lambda a, b, s: a / b,
    "negative": lambda a, b, s: -a,
    "numbers on the left": lambda a, b, s: s * a + (s - b),
    "numbers on the right": lambda a, b, s: (a - s) / 2 + b * s,
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_arithmetic(name):
    expression = njit(EXPRESSIONS[name])

    @njit
    def compiled(matrix, s):
        store(matrix, 2, 3, expression(load(matrix, 0, 1), load(matrix, 1, 2), s))

    matrix = np.random.default_rng(1).normal(size=(3, 8))
    expected = matrix.copy()
    store(expected, 2, 3, EXPRESSIONS[name](load(expected, 0, 1), load(expected, 1, 2), 0.3))
    compiled(matrix, 0.3)
    np.testing.assert_allclose(matrix, expected, rtol=1e-15)
