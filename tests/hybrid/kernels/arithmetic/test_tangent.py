"""Orthonormalisation and determinants compared with LAPACK, and cases beyond LAPACK."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import tangent

_orthonormalise, _log_abs_determinant = tangent.orthonormalise, tangent.log_abs_determinant
_solve, _strain = tangent.solve, tangent.strain
_independence_kernel, _multiply = tangent.independence, tangent.multiply


@njit
def _run(y, n, k, growth, sizes, images, annihilated):
    return _orthonormalise(y, n, k, growth, sizes, images, annihilated)


@njit
def _independence(y, n, k, gram):
    return _independence_kernel(y, n, k, gram)


@njit
def _solved(system, out):
    _solve(system, len(out), out)


@njit
def _multiplied(matrix, y, n, k, image, ends):
    _multiply(matrix, y, n, k, image, ends)


@njit
def _determinant(matrix, magnitude):
    return _log_abs_determinant(matrix, magnitude, matrix.shape[0])


def orthonormalise(vectors, images=False, growth=None, annihilated=1):
    """``(Q, growth, indistinct)`` of the columns of ``vectors``; as images, of terms of their own size.

    The matrix that made the images has annihilated so many directions.
    """
    n, k = vectors.shape
    y = np.concatenate([np.full(n, 7.0), vectors.T.ravel()])
    growth = np.zeros(k) if growth is None else growth
    indistinct = _run(y, n, k, growth, np.abs(vectors.T).copy(), images, annihilated)
    assert np.all(y[:n] == 7.0), "the state was touched"
    return y[n:].reshape(k, n).T, growth, indistinct


def log_determinant(matrix, magnitude=None):
    return log_determinant_and_nullity(matrix, magnitude)[0]


def log_determinant_and_nullity(matrix, magnitude=None):
    matrix = np.array(matrix, dtype=float)
    return _determinant(matrix, np.abs(matrix) if magnitude is None else magnitude)


@st.composite
def tall_matrices(draw):
    n = draw(st.integers(1, 6))
    k = draw(st.integers(1, n))
    seed = draw(st.integers(0, 2**32 - 1))
    scales = 10.0 ** np.array(draw(st.lists(st.integers(-12, 12), min_size=k, max_size=k)))
    return np.random.default_rng(seed).normal(size=(n, k)) * scales


@given(tall_matrices())
def test_is_the_qr_decomposition_with_a_positive_diagonal(matrix):
    q, growth, indistinct = orthonormalise(matrix)
    expected_q, expected_r = np.linalg.qr(matrix)
    signs = np.sign(np.diag(expected_r))
    np.testing.assert_allclose(q, expected_q * signs, atol=1e-9)
    np.testing.assert_allclose(growth, np.log(np.abs(np.diag(expected_r))), atol=1e-9)
    assert indistinct == 0


@given(tall_matrices())
def test_is_orthonormal_to_rounding(matrix):
    q, _, _ = orthonormalise(matrix)
    np.testing.assert_allclose(q.T @ q, np.eye(q.shape[1]), atol=1e-14)


@pytest.mark.parametrize("images", [False, True])
@pytest.mark.parametrize("scale", [2.0**-200, 2.0**-40, 2.0**40, 2.0**200])
@pytest.mark.parametrize("rest", [0.0, 3e-16, 1e-9])
def test_the_length_of_vectors_only_adds_to_their_growth(images, scale, rest):
    matrix = np.array([[0.3, 0.7, 0.1], [0.6, 1.4 + rest, 0.0], [0.0, 0.0, 2.0]])
    q, growth, indistinct = orthonormalise(matrix, images)
    scaled_q, scaled_growth, scaled_indistinct = orthonormalise(scale * matrix, images)
    np.testing.assert_array_equal(scaled_q, q)
    np.testing.assert_allclose(scaled_growth, growth + math.log(scale), rtol=1e-13)
    assert scaled_indistinct == indistinct


def test_nearly_parallel_vectors_become_orthogonal():
    matrix = np.array([[1.0, 1.0], [0.0, 1e-9], [0.0, 0.0]])
    q, growth, _ = orthonormalise(matrix)
    np.testing.assert_allclose(q.T @ q, np.eye(2), atol=1e-15)
    assert growth[1] == pytest.approx(math.log(1e-9), rel=1e-12)


def test_growth_adds_up():
    growth = np.array([1.0, 2.0])
    orthonormalise(np.diag([math.e, math.e**2]), growth=growth)
    np.testing.assert_allclose(growth, [2.0, 4.0])


@pytest.mark.parametrize("images", [False, True])
def test_a_zero_vector_has_collapsed(images):
    q, growth, indistinct = orthonormalise(np.array([[2.0, 0.0], [0.0, 0.0]]), images)
    np.testing.assert_array_equal(q, [[1.0, 0.0], [0.0, 0.0]])
    assert growth[1] == -math.inf
    assert indistinct == 0


def test_what_a_projection_leaves_of_a_direction_is_rounding():
    """Both images lie on one line up to rounding, as after a catch; only the rounding part is dropped."""
    image = np.array([[0.3, 0.7], [0.6, 1.4 + 3e-16]])
    _, growth, indistinct = orthonormalise(image, images=True)
    assert growth[1] == -math.inf
    assert indistinct == 0
    _, growth, indistinct = orthonormalise(np.array([[1.0, 0.0], [0.0, 1e-9]]), images=True)
    assert growth[1] == pytest.approx(math.log(1e-9))
    assert indistinct == 0


def test_no_more_images_collapse_than_the_matrix_annihilates():
    """An invertible matrix annihilates nothing: images that only rounding tells apart are not known."""
    image = np.array([[0.3, 0.7], [0.6, 1.4 + 3e-16]])
    for annihilated in range(3):
        _, growth, indistinct = orthonormalise(image, True, annihilated=annihilated)
        assert np.isfinite(growth[1]) == (annihilated == 0)
        assert indistinct == (annihilated == 0)


@pytest.mark.parametrize("images", [False, True])
def test_a_vector_of_which_nothing_is_left_is_counted(images):
    q, growth, indistinct = orthonormalise(np.array([[2.0, 4.0], [0.0, 0.0]]), images, annihilated=0)
    assert indistinct == 1
    assert growth[1] == -math.inf
    assert not q[:, 1].any()


def test_vectors_that_only_rounding_tells_apart_are_counted():
    """Without a threshold no vector collapses, but the rest of the second vector is only rounding."""
    _, growth, indistinct = orthonormalise(np.array([[0.3, 0.7], [0.6, 1.4 + 3e-16]]))
    assert math.isfinite(growth[1])
    assert indistinct == 1


def test_a_zero_vector_stays_minus_infinity():
    growth = np.array([0.0, -math.inf])
    _, _, indistinct = orthonormalise(np.array([[1.0, 0.0], [0.0, 0.0]]), growth=growth)
    assert indistinct == 0
    assert growth[1] == -math.inf


@given(tall_matrices())
def test_independence_is_the_square_of_the_product_of_the_sines(matrix):
    """It equals the squared diagonal of ``R`` divided by the squared lengths of the columns."""
    n, k = matrix.shape
    diagonal = np.diag(np.linalg.qr(matrix)[1])
    expected = np.prod(diagonal**2 / (matrix**2).sum(axis=0))
    y = np.concatenate([np.zeros(n), matrix.T.ravel()])
    assert _independence(y, n, k, np.empty((n, n + 1))) == pytest.approx(expected, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("length", [1e-120, 1e120])
def test_independence_tells_lengths_near_the_limits_of_numbers(length):
    y = np.array([0.0, 0.0, length, 0.0, 0.0, 1.0])
    assert _independence(y, 2, 2, np.empty((2, 3))) == -1.0


@given(st.integers(1, 7), st.integers(0, 2**32 - 1))
def test_log_determinant(n, seed):
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    assert log_determinant(matrix) == pytest.approx(np.linalg.slogdet(matrix)[1], abs=1e-9)


@pytest.mark.parametrize(
    "matrix",
    [
        np.zeros((2, 2)),
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 2.0], [2.0, 4.0]],
        [[0.1, 0.2], [0.3, 0.6]],
        [[1 / 3, 1 / 7, 0.1], [2 / 3, 2 / 7, 0.2], [5.0, -3.0, 2.0]],
    ],
)
def test_singular_is_minus_infinity(matrix):
    assert log_determinant(matrix) == -math.inf


@given(st.integers(1, 6), st.integers(0, 6), st.integers(0, 2**32 - 1))
def test_the_directions_that_a_matrix_annihilates_are_counted(n, rank, seed):
    rng, rank = np.random.default_rng(seed), min(rank, n)
    left, right = rng.normal(size=(n, rank)), rng.normal(size=(rank, n))
    found = log_determinant_and_nullity(left @ right, np.abs(left) @ np.abs(right))
    assert found[1] == n - rank
    assert (found[0] == -math.inf) == (rank < n)


def test_projection_is_singular():
    angle = 0.4
    c, s = math.cos(angle), math.sin(angle)
    assert log_determinant([[c * c, -c * s], [-c * s, s * s]]) == -math.inf


@pytest.mark.parametrize("speed", [1e-2, 1e-6, 1e-10, 1e-13])
def test_near_grazing_is_not_singular(speed):
    """The impact's matrix ``[[-r, 0], [s, -r]]`` with ``s`` like one over the speed has determinant r^2."""
    r = 0.8
    assert log_determinant([[-r, 0.0], [1.8 / speed, -r]]) == pytest.approx(2 * math.log(r), abs=1e-12)


@pytest.mark.parametrize("small", [1e-3, 1e-9, 1e-200])
def test_small_is_not_singular(small):
    assert log_determinant([[small, 0.0], [0.0, 1.0]]) == pytest.approx(math.log(small))
    assert log_determinant([[0.0, 1.0], [small, 0.0]]) == pytest.approx(math.log(small))


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_solutions(n):
    rng = np.random.default_rng(n)
    matrix, known, out = rng.normal(size=(n, n)), rng.normal(size=n), np.empty(n)
    matrix[0, 0] = 0.0 if n > 1 else 2.0
    _solved(np.column_stack([matrix, known]), out)
    np.testing.assert_allclose(out, np.linalg.solve(matrix, known), rtol=1e-10)


@pytest.mark.parametrize(
    "matrix", [np.zeros((2, 2)), [[0.1, 0.2], [0.3, 0.6]], [[0.0, 2.0], [0.0, 3.0]], [[1.0, 0.0], [0.0, 0.0]]]
)
def test_of_singular_equations_one_solution_is_found(matrix):
    known, out = np.array(matrix) @ [1.5, -0.5], np.empty(2)
    _solved(np.column_stack([matrix, known]), out)
    np.testing.assert_allclose(np.array(matrix) @ out, known, atol=1e-14)


@njit
def _strain_of(matrix, log_determinant):
    return _strain(matrix, matrix.shape[0], log_determinant)


@given(st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_strain_bounds_the_condition_number(n, seed):
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    found = _strain_of(matrix, np.linalg.slogdet(matrix)[1])
    assert found >= -1e-12
    assert np.log(np.linalg.cond(matrix)) <= found + np.log(2.0) + 1e-9


def test_rotations_and_scales_do_not_strain():
    rotation = 3.0 * np.array([[0.6, -0.8], [0.8, 0.6]])
    assert _strain_of(rotation, np.log(9.0)) == pytest.approx(0.0, abs=1e-15)


def test_singular_matrices_strain_without_bound():
    assert _strain_of(np.zeros((2, 2)), -np.inf) == np.inf
    assert _strain_of(np.diag([1.0, 0.0]), -np.inf) == np.inf


@pytest.mark.parametrize("n", [1, 2, 7, 40])
@pytest.mark.parametrize("kind", ["dense", "jump", "empty rows"])
def test_products_and_determinants_of_matrices_with_zeros(n, kind):
    """The matrix of a jump in a large system is the identity but for a few rows."""
    rng = np.random.default_rng(n)
    matrix = rng.normal(size=(n, n))
    if kind == "jump":
        changed = rng.integers(n, size=2)
        matrix = np.eye(n)
        matrix[changed] = rng.normal(size=(2, n)) * (rng.random((2, n)) < 0.5)
    elif kind == "empty rows":
        matrix[::3] = 0.0
    vectors = rng.normal(size=(n, 3))
    y = np.concatenate([np.full(n, 7.0), vectors.T.ravel()])
    _multiplied(matrix, y, n, 3, np.empty(n), np.empty((4, n)))
    np.testing.assert_allclose(y[n:].reshape(3, n).T, matrix @ vectors, rtol=1e-13, atol=1e-13)
    assert np.all(y[:n] == 7.0)
    sign, expected = np.linalg.slogdet(matrix)
    found = log_determinant(matrix)
    if kind == "empty rows" or sign == 0.0:
        assert found == -math.inf
    else:
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("small", [1e-17, 1e-19])
def test_rows_are_exchanged_with_the_sizes_of_their_terms(small):
    """The second pivot is small beside the terms of the other row, not beside those of its own."""
    matrix = np.array([[0.0, small], [1.0, 1.0]])
    found = log_determinant_and_nullity(matrix, np.array([[0.0, small], [1.0, 1.0]]))
    assert found == (pytest.approx(np.log(small)), 0)
