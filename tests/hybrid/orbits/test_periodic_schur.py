"""Eigenvalues of matrix products compared with the product in many digits, beyond the range of floats."""

from itertools import pairwise
from types import SimpleNamespace

import mpmath as mp
import numpy as np
import pytest

from hybrid.orbits import periodic_schur
from hybrid.orbits.periodic_schur import product_eigenvalues, rowwise_qr


@pytest.fixture(autouse=True)
def _sweeps_end(monkeypatch):
    """A product whose eigenvalues do not separate fails; its sweeps are few."""
    sweeps, sweep = [], periodic_schur._Reduced._sweep

    def counted(*args):
        sweeps.append(1)
        assert len(sweeps) < 2000
        return sweep(*args)

    monkeypatch.setattr(periodic_schur._Reduced, "_sweep", counted)


def orthogonal(n, rng):
    return np.linalg.qr(rng.normal(size=(n, n)))[0]


def exact_eigenvalues(factors, digits):
    """Eigenvalues of the product of exactly these floats, in many digits."""
    with mp.workdps(digits):
        product = mp.eye(len(factors[0]))
        for factor in factors:
            product = mp.matrix(factor.tolist()) * product
        if len(product) == 1:
            return [product[0, 0]]
        return list(mp.eig(product, left=False, right=False))


def relative_error(found, exact):
    """Largest relative distance between found eigenvalues and their nearest unmatched exact ones."""
    worst, left = 0.0, list(exact)
    with mp.workdps(50):
        for log_modulus, phase in zip(found.log_moduli, found.phases, strict=True):
            value = mp.exp(mp.mpf(float(log_modulus))) * mp.mpc(phase.real, phase.imag)
            distances = [abs(value - each) / max(abs(each), abs(value)) for each in left]
            nearest = min(range(len(left)), key=distances.__getitem__)
            worst = max(worst, float(distances[nearest]))
            left.pop(nearest)
    return worst


@pytest.mark.parametrize("n", range(1, 9))
def test_random_factors_whose_product_no_float_can_hold(n):
    """Thirty dense factors of condition 1e5 at most: the product has up to 1e150."""
    rng = np.random.default_rng(n)
    factors = [
        orthogonal(n, rng) @ np.diag(10.0 ** -rng.uniform(0, 5, n)) @ orthogonal(n, rng) for _ in range(30)
    ]
    assert relative_error(product_eigenvalues(factors), exact_eigenvalues(factors, 250)) < 1e-9


@pytest.mark.parametrize("n", range(2, 8))
def test_eigenvalues_three_hundred_orders_of_magnitude_apart(n):
    """Factors that are triangular in rotated frames: their eigenvalues and signs are known."""
    rng = np.random.default_rng(10 + n)
    frames = [orthogonal(n, rng) for _ in range(60)]
    frames.append(frames[0])
    sizes = 10.0 ** -np.linspace(0, 5, n)
    factors, logs, signs = [], np.zeros(n), np.ones(n)
    for before, after in pairwise(frames):
        diagonal = sizes * rng.uniform(0.5, 2, n) * rng.choice([-1, 1], n)
        upper = np.triu(rng.normal(size=(n, n)), 1) * sizes[:, None]
        factors.append(after @ (upper + np.diag(diagonal)) @ before.T)
        logs, signs = logs + np.log(np.abs(diagonal)), signs * np.sign(diagonal)
    found = product_eigenvalues(factors)
    assert logs[0] - logs[-1] > 600
    np.testing.assert_allclose(found.log_moduli, logs, atol=1e-8)
    np.testing.assert_array_equal(found.phases, signs)


def test_a_pair_of_equal_moduli_and_opposite_signs():
    """+1, -1 and +-1e-200 are distinguished from each other and from complex pairs."""
    rng = np.random.default_rng(1)
    frames = [orthogonal(4, rng) for _ in range(40)]
    frames.append(frames[0])
    step = np.diag([1.0, 1.0, 1e-5, 1e-5])
    last = np.diag([1.0, -1.0, 1e-5, -1e-5])
    factors = [b @ (last if i == 39 else step) @ a.T for i, (a, b) in enumerate(pairwise(frames))]
    found = product_eigenvalues(factors)
    np.testing.assert_allclose(found.values, [1.0, -1.0, 1e-200, -1e-200], rtol=1e-10)
    assert found.values.dtype == float


def test_a_complex_pair_of_modulus_far_below_the_largest():
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    factor = np.zeros((3, 3))
    factor[0, 0], factor[1:, 1:] = -2.0, 1e-4 * turn
    frame = orthogonal(3, np.random.default_rng(2))
    found = product_eigenvalues([frame @ factor @ frame.T] * 101)
    expected = [101 * np.log(2.0), 101 * np.log(1e-4), 101 * np.log(1e-4)]
    np.testing.assert_allclose(found.log_moduli, expected, rtol=1e-12)
    pair = np.exp(1j * 101 * angle)
    pair = pair if pair.imag > 0 else pair.conjugate()
    np.testing.assert_allclose(found.phases, [-1.0, pair, pair.conjugate()], atol=1e-9)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_a_defective_product(n):
    """One Jordan block: its eigenvalue is accurate and real to the n-th root of rounding."""
    jordan = np.diag(np.full(n, 0.5)) + np.diag(np.ones(n - 1), 1)
    found = product_eigenvalues([jordan] * 3)
    np.testing.assert_allclose(found.values, np.full(n, 0.125), atol=20 * np.finfo(float).eps ** (1 / n))
    np.testing.assert_allclose(found.log_moduli.sum(), n * np.log(0.125), rtol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("rank", [1, 2])
def test_a_singular_factor_gives_zeros_and_leaves_the_others_exact(n, rank):
    rng = np.random.default_rng(n)
    factors = [rng.normal(size=(n, n)) for _ in range(12)]
    rank = min(rank, n - 1)
    factors[5] = rng.normal(size=(n, rank)) @ rng.normal(size=(rank, n))
    found = product_eigenvalues(factors)
    assert np.isneginf(found.log_moduli[rank:]).all()
    assert found.values[rank:].tolist() == [0.0] * (n - rank)
    with mp.workdps(60):
        left, sizes, right = np.linalg.svd(factors[5])
        small = mp.matrix((sizes[:rank, None] * right[:rank]).tolist())
        for factor in factors[:5][::-1]:
            small = small * mp.matrix(factor.tolist())
        for factor in factors[:5:-1]:
            small = small * mp.matrix(factor.tolist())
        small = small * mp.matrix(left[:, :rank].tolist())
        exact = [small[0, 0]] if rank == 1 else list(mp.eig(small, left=False, right=False))
    kept = type(found)(found.log_moduli[:rank], found.phases[:rank])
    assert relative_error(kept, exact) < 1e-9


def test_zeros_of_a_nilpotent_product():
    shift = np.diag(np.ones(3), 1)
    assert product_eigenvalues([shift, np.eye(4)]).values.tolist() == [0.0] * 4
    assert product_eigenvalues([np.zeros((2, 2))]).values.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("factor", [1e-40, 1e40])
def test_eigenvalues_out_of_range_keep_their_logarithms(factor):
    found = product_eigenvalues([factor * np.array([[0.0, -1.0], [1.0, 0.0]])] * 101)
    np.testing.assert_allclose(found.log_moduli, 101 * np.log(factor), rtol=1e-14)
    np.testing.assert_allclose(found.phases, [1j, -1j], atol=1e-15)
    expected = 0.0 if factor < 1 else np.inf
    assert abs(found.values.imag).tolist() == [expected, expected]


def test_one_factor_has_its_own_eigenvalues():
    matrix = np.random.default_rng(3).normal(size=(7, 7))
    expected = np.linalg.eigvals(matrix)
    expected = expected[np.lexsort((-expected.imag, -np.abs(expected).round(9)))]
    np.testing.assert_allclose(product_eigenvalues([matrix]).values, expected, rtol=1e-10)


@pytest.mark.parametrize("n", range(3, 9))
@pytest.mark.parametrize("length", [1, 4])
def test_roots_of_unity_on_which_the_usual_shifts_stand_still(n, length):
    """A cyclic permutation is its own QR step; only shifts chosen otherwise separate its eigenvalues."""
    cycle = np.roll(np.eye(n), 1, axis=0)
    found = product_eigenvalues([cycle, *[np.eye(n)] * (length - 1)])
    exact = np.exp(2j * np.pi * np.arange(n) / n)
    exact = exact[np.lexsort((-exact.imag, -exact.real.round(9)))]
    np.testing.assert_allclose(found.log_moduli, 0.0, atol=1e-13)
    np.testing.assert_allclose(found.phases, exact, atol=1e-12)


@pytest.mark.parametrize("columns", [2, 4])
def test_each_row_of_a_graded_matrix_is_factorised_to_its_own_size(columns):
    """The rows are 60 orders of magnitude apart, the longest neither first nor last."""
    rng = np.random.default_rng(4)
    sizes = 10.0 ** np.array([-30.0, 0.0, -60.0, -15.0])
    matrix = sizes[:, None] * rng.normal(size=(4, columns))
    basis, triangle = rowwise_qr(matrix)
    np.testing.assert_array_equal(np.tril(triangle, -1), 0.0)
    np.testing.assert_allclose(basis.T @ basis, np.eye(columns), atol=1e-14)
    errors = np.abs(basis @ triangle - matrix).max(axis=1)
    assert np.all(errors <= 1e-14 * sizes)


def test_the_shifts_make_sweeps_converge_fast(monkeypatch):
    """Francis' shifts need two to three sweeps per eigenvalue, others tens of them."""
    sweeps = []
    sweep = periodic_schur._Reduced._sweep
    monkeypatch.setattr(
        periodic_schur._Reduced, "_sweep", lambda *arguments: sweeps.append(1) or sweep(*arguments)
    )
    rng = np.random.default_rng(5)
    factors = rng.normal(size=(3, 30, 30))
    found = product_eigenvalues(factors)
    expected = np.linalg.eigvals(factors[2] @ factors[1] @ factors[0])
    np.testing.assert_allclose(found.log_moduli, np.sort(np.log(np.abs(expected)))[::-1], atol=1e-9)
    assert len(sweeps) < 3 * 30


def test_what_has_not_separated_after_many_sweeps_is_taken_as_equal_if_it_nearly_parts():
    """The smallest entry below the diagonal of the block becomes zero, and nothing else."""
    head = np.arange(1.0, 37.0).reshape(6, 6)
    head[[1, 2, 3, 4, 5], [0, 1, 2, 3, 4]] = 1e-9, 5.0, -1e-5, 7.0, 1e-9
    reduced = SimpleNamespace(head=head.copy())
    assert periodic_schur._Reduced._part(reduced, 1, 5)
    head[3, 2] = 0.0
    np.testing.assert_array_equal(reduced.head, head)
    head[3, 2] = -0.5
    reduced = SimpleNamespace(head=head.copy())
    assert not periodic_schur._Reduced._part(reduced, 1, 5)
    np.testing.assert_array_equal(reduced.head, head)


def test_a_block_that_no_sweep_parts_has_the_eigenvalues_of_its_product():
    """Two directions that the factors turn and keep, and one that they annihilate."""
    turn, _ = np.linalg.qr(np.arange(1.0, 10.0).reshape(3, 3) + np.eye(3))
    chain = [turn @ np.diag([1.0, -0.5, 1e-200]), np.diag([2.0, 1.0, 1e-200]) @ turn.T]
    reduced = periodic_schur._Reduced([each.copy() for each in chain])
    found = reduced._unseparated(0, 3)
    values = sorted(np.exp(size) * phase.real for size, phase in found)
    np.testing.assert_allclose(values, [-0.5, 0.0, 2.0], atol=1e-12)
