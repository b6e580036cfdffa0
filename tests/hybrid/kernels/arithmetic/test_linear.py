"""LU factors compared with NumPy, with row exchanges and for singular matrices."""

import numpy as np
import pytest
from numba import njit

from hybrid.kernels.arithmetic.linear import factorise, substitute
from hybrid.kernels.types.kinds import INDICES, MATRIX, TRUTH, VECTOR
from hybrid.kernels.types.numba_door.numba_types import signature_of


@njit(signature_of(TRUTH, MATRIX, INDICES, VECTOR))
def solve(matrix, pivots, vector):
    n = vector.shape[0]
    regular = factorise(matrix, pivots, n)
    if regular:
        substitute(matrix, pivots, n, vector)
    return regular


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_solution(n):
    random = np.random.default_rng(n)
    for _ in range(20):
        matrix, x = random.normal(size=(n, n)), random.normal(size=n)
        vector = matrix @ x
        condition = np.linalg.cond(matrix)
        assert solve(matrix.copy(), np.zeros(n, dtype=np.int64), vector)
        np.testing.assert_allclose(vector, x, atol=1e-14 * condition)


def test_zero_on_the_diagonal():
    vector = np.array([1.0, 2.0, 3.0])
    assert solve(np.roll(np.eye(3), 1, axis=0), np.zeros(3, dtype=np.int64), vector)
    np.testing.assert_array_equal(vector, [2.0, 3.0, 1.0])


@pytest.mark.parametrize("entry", [0.0, np.nan])
def test_no_solution(entry):
    matrix = np.array([[1.0, 2.0], [0.0, entry]])
    assert not solve(matrix, np.zeros(2, dtype=np.int64), np.ones(2))
