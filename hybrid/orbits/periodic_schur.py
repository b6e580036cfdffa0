"""Eigenvalues of a product of matrices from its factors, each to its own relative accuracy.

The product of the factors along a periodic orbit has eigenvalues (multipliers) that can be hundreds of orders
of magnitude apart; formed as one matrix of floating-point numbers, it keeps only the largest. The periodic QR
algorithm works on the factors and never forms their product: it finds orthogonal matrices between them that
make all of them upper triangular but the first, which becomes quasi-triangular. The eigenvalues are products
of the entries of the diagonals, and their logarithms are sums.

References
----------
A. Bojanczyk, G. Golub, P. Van Dooren, "The periodic Schur decomposition. Algorithms and applications", Proc.
SPIE 1770 (1992) 31, doi:10.1117/12.130915; D. Kressner, "The periodic QR algorithm is a disguised QR
algorithm", Linear Algebra Appl. 417 (2006) 423, doi:10.1016/j.laa.2003.08.014; K. Lust, "Improved numerical
Floquet multipliers", Int. J. Bifurc. Chaos 11 (2001) 2389, doi:10.1142/S0218127401003486; A. Cox, N. Higham,
"Stability of Householder QR factorization for weighted least squares problems", Numerical Analysis 1997
(Longman 1998) 57.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import attrs
import numpy as np

EPSILON = float(np.finfo(float).eps)
# A factor whose smallest singular value is below this part of its largest is singular: it is rounding.
SINGULAR = 1e-13
# Rounds in which rows and columns are brought to the same size before that is judged.
ROUNDS = 4
# Moduli are the same if their logarithms agree to this many digits behind the point.
SAME_DIGITS = 9
# Sweeps for one eigenvalue, and after how many without success the shifts are varied.
MOST_SWEEPS = 60
EXCEPTIONAL = 10
# An entry below the diagonal that is this small after all sweeps stands between equal eigenvalues.
EQUAL = 1e-6


@attrs.frozen(eq=False)
class ProductEigenvalues:
    """Eigenvalues of a product of matrices, as logarithms of their moduli and as points on the unit circle.

    Attributes
    ----------
    log_moduli
        Natural logarithms of the moduli ``(n,)``, largest first; minus infinity for an eigenvalue of zero.
    phases
        Each eigenvalue over its modulus ``(n,)``, complex: exactly 1 or -1 for a real one, conjugate for a
        pair, 1 for a zero.
    """

    log_moduli: np.ndarray
    phases: np.ndarray

    @property
    def values(self) -> np.ndarray:
        """The eigenvalues ``(n,)``, real if all of them are; those out of range are zero or infinite."""
        units = self.phases
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            moduli = np.exp(self.log_moduli)
            if np.all(units.imag == 0):
                return np.asarray(moduli * units.real)
            # Component by component: infinity times zero would be nan.
            values = np.empty(len(moduli), dtype=complex)
            values.real = np.where(units.real == 0, 0.0, moduli * units.real)
            values.imag = np.where(units.imag == 0, 0.0, moduli * units.imag)
            return values


def product_eigenvalues(
    factors: Sequence[np.ndarray] | np.ndarray, singular: Collection[int] = ()
) -> ProductEigenvalues:
    """Eigenvalues of ``factors[-1] @ ... @ factors[1] @ factors[0]``.

    Each is right to about the rounding times the condition of the worst factor, however far the eigenvalues
    are apart, unless it is ill-conditioned as a function of the factors. A factor that is singular to
    rounding gives eigenvalues of exactly zero. Rows and columns that are merely short do not make a factor
    singular, as those of a reset that shrinks one state by a factor of 1e-20 do not.

    Parameters
    ----------
    factors
        Real matrices ``(m, n, n)`` in the order in which they are applied, at least one, finite.
    singular
        Indices of factors that are known to be singular: their rows that are merely short are rounding.

    Returns
    -------
    ProductEigenvalues
        Largest first, of the same moduli the one farther to the right, of a complex pair the one in the
        upper half plane.

    Examples
    --------
    >>> shrink = np.array([[1.0, 1.0], [0.0, 1e-3]])
    >>> product_eigenvalues([shrink] * 200).log_moduli / np.log(10)
    array([   0., -600.])
    """
    chain = [np.array(factor, dtype=float) for factor in factors]
    n = chain[0].shape[-1]
    with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
        chain, logs = _without_null_space(chain, [i in singular for i in range(len(chain))])
        moduli, phases = [], []
        if chain and len(chain[0]):
            found = _Reduced(chain).eigenvalues()
            moduli = [modulus + logs for modulus, _ in found]
            phases = [phase for _, phase in found]
    log_moduli = np.array(moduli + [-np.inf] * (n - len(moduli)))
    units = np.array(phases + [1.0] * (n - len(phases)), dtype=complex)
    order = np.lexsort((-units.imag, -units.real, -log_moduli.round(SAME_DIGITS)))
    return ProductEigenvalues(log_moduli[order], units[order])


def _without_null_space(chain: list[np.ndarray], known: list[bool]) -> tuple[list[np.ndarray], float]:
    """Regular factors of unit size, whose product has the nonzero eigenvalues, and the logarithm taken out.

    The product may begin anywhere: ``A B`` and ``B A`` have the same eigenvalues but for zeros. It is made to
    begin with what a singular factor leaves, ``A = Q R`` with fewer columns in ``Q`` than in ``A``: the
    product restricted to the range of ``Q`` has smaller factors. They may be singular in their turn.
    ``known`` tells which factors are known to be singular.
    """
    total = 0.0
    while True:
        sizes = [float(np.linalg.norm(factor)) for factor in chain]
        if len(chain[0]) == 0 or min(sizes) == 0.0:
            return [], 0.0
        chain = [factor / size for factor, size in zip(chain, sizes, strict=True)]
        total += float(np.sum(np.log(sizes)))
        stack = np.array(chain)
        rows, columns = _row_and_column_sizes(stack)
        rows[known], columns[known] = 1.0, 1.0
        level = stack / rows[:, :, None] / columns[:, None, :]
        values = np.linalg.svd(level, compute_uv=False)
        singular = np.flatnonzero(values[:, -1] <= SINGULAR * values[:, 0])
        if not len(singular):
            return chain, total
        first = int(singular[0])
        left, sizes_kept, right = np.linalg.svd(level[first])
        rank = int(np.sum(sizes_kept > SINGULAR * sizes_kept[0]))
        basis, start = np.linalg.qr(rows[first][:, None] * left[:, :rank])
        last = start @ (sizes_kept[:rank, None] * right[:rank] * columns[first])
        smaller = []
        for factor in chain[first + 1 :] + chain[:first]:
            basis, triangle = rowwise_qr(factor @ basis)
            smaller.append(triangle)
        chain, known = [*smaller, last @ basis], [*known[first + 1 :], *known[:first], True]


def _row_and_column_sizes(stack: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers ``(m, n)`` for rows and for columns that, divided by, leave matrices with entries up to 1."""
    rows, columns = np.ones(stack.shape[:2]), np.ones(stack.shape[:2])
    for _ in range(ROUNDS):
        left = np.abs(stack) / rows[:, :, None] / columns[:, None, :]
        rows *= _or_one(left.max(axis=2))
        left = np.abs(stack) / rows[:, :, None] / columns[:, None, :]
        columns *= _or_one(left.max(axis=1))
    return rows, columns


def _or_one(sizes: np.ndarray) -> np.ndarray:
    return np.where(sizes > 0.0, sizes, 1.0)


def rowwise_qr(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``Q (n, k)`` and the upper triangle ``(k, k)``; each row has errors relative to its own size.

    Householder's reflections have that property if the longest rows come first (Cox and Higham 1998).
    """
    order = np.argsort(-np.abs(matrix).max(axis=1), kind="stable")
    sorted_basis, triangle = np.linalg.qr(matrix[order])
    basis = np.empty_like(sorted_basis)
    basis[order] = sorted_basis
    return basis, triangle


class _Reduced:
    """The product ``head @ tail[0] @ tail[1] @ ...`` in Hessenberg-triangular form, and its eigenvalues.

    All changes are orthogonal matrices put between the factors. ``head`` is upper Hessenberg; the factors of
    ``tail (m, n, n)`` are upper triangular.
    """

    def __init__(self, chain: list[np.ndarray]) -> None:
        n = len(chain[0])
        self.n = n
        triangles, basis = [], np.eye(n)
        for factor in chain[:-1]:
            basis, triangle = rowwise_qr(factor @ basis)
            triangles.append(triangle)
        self.head = chain[-1] @ basis
        self.tail = np.array(triangles[::-1]).reshape(len(triangles), n, n)
        for column in range(n - 2):
            for row in range(n - 2, column, -1):
                self._rotate(row, self.head[row, column], self.head[row + 1, column])
                self.head[row + 1, column] = 0.0

    def _rotate(self, i: int, a: float, b: float) -> None:
        """Similarity by the rotation of the rows ``i`` and ``i + 1`` that takes ``(a, b)`` to ``(r, 0)``."""
        turn = _rotation(a, b)
        head = self.head
        head[i : i + 2] = turn @ head[i : i + 2]
        for triangle in self.tail[::-1]:
            block = triangle[: i + 2, i : i + 2] @ turn.T
            triangle[: i + 2, i : i + 2] = block
            turn = _rotation(block[i, 0], block[i + 1, 0])
            triangle[i : i + 2, i:] = turn @ triangle[i : i + 2, i:]
            triangle[i + 1, i] = 0.0
        head[:, i : i + 2] = head[:, i : i + 2] @ turn.T

    def eigenvalues(self) -> list[tuple[float, complex]]:
        """Logarithm of the modulus, and phase, of each."""
        found: list[tuple[float, complex]] = []
        stop, sweeps = self.n, 0
        while stop > 0:
            first = self._active(stop)
            size = stop - first
            if size <= 2:
                found += self._block(first, stop)
                stop, sweeps = first, 0
                continue
            sweeps += 1
            if sweeps <= MOST_SWEEPS:
                self._sweep(first, stop, sweeps)
            elif not self._part(first, stop):
                found += self._unseparated(first, stop)
                stop, sweeps = first, 0
        return found

    def _part(self, first: int, stop: int) -> bool:
        """Part a block of eigenvalues as good as equal where it nearly parts; False if it does not."""
        below = np.abs(np.diagonal(self.head, -1)[first : stop - 1])
        i = first + 1 + int(np.argmin(below))
        if below.min() > EQUAL * np.abs(self.head[first:stop, first:stop]).max():
            return False
        self.head[i, i - 1] = 0.0
        return True

    def _unseparated(self, first: int, stop: int) -> list[tuple[float, complex]]:
        """Eigenvalues of a block that no sweep parts, from its product.

        Factors that are singular but for rounding keep sweeps from parting what they annihilate from the
        others. Those are right; what is annihilated is small.
        """
        product, scale = _scaled_product_with_log(self._blocks(first, stop))
        found = np.linalg.eigvals(product)
        moduli = np.abs(found)
        return [
            (
                float(np.log(size)) + scale if size > 0.0 else -np.inf,
                complex(each / size) if size > 0.0 else 1.0,
            )
            for each, size in zip(found, moduli, strict=True)
        ]

    def _active(self, stop: int) -> int:
        """Where the last unreduced block that ends before ``stop`` begins; negligible entries become zero."""
        head = self.head
        for i in range(stop - 1, 0, -1):
            near = abs(head[i, i]) + abs(head[i - 1, i - 1])
            if abs(head[i, i - 1]) <= EPSILON * (near if near > 0.0 else np.abs(head).max()):
                head[i, i - 1] = 0.0
                return i
        return 0

    def _sweep(self, first: int, stop: int, sweeps: int) -> None:
        """One sweep of the implicit QR algorithm with two shifts, after Francis, on an unreduced block."""
        product = _scaled_product(self._blocks(first, stop))
        corner = product[-2:, -2:]
        trace = corner[0, 0] + corner[1, 1]
        determinant = corner[0, 0] * corner[1, 1] - corner[0, 1] * corner[1, 0]
        if sweeps % EXCEPTIONAL == 0:
            size = abs(product[-1, -2]) + abs(product[-2, -3])
            trace, determinant = 1.5 * size, size * size
        # The first column of (P - s_1)(P - s_2), of which three entries are not zero.
        start = product[:3, :2] @ product[:2, 0] - trace * product[:3, 0]
        start[0] += determinant
        if not np.any(start) or not np.all(np.isfinite(start)):
            start = product[:3, 0]
        self._rotate(first + 1, start[1], start[2])
        self._rotate(first, start[0], float(np.hypot(start[1], start[2])))
        for column in range(first, stop - 2):
            for row in range(min(column + 2, stop - 2), column, -1):
                self._rotate(row, self.head[row, column], self.head[row + 1, column])
                self.head[row + 1, column] = 0.0

    def _blocks(self, first: int, stop: int) -> np.ndarray:
        """Diagonal blocks of all factors, ``(m + 1, size, size)``, in the order of the product."""
        part = slice(first, stop)
        return np.concatenate([self.head[None, part, part], self.tail[:, part, part]])

    def _block(self, first: int, stop: int) -> list[tuple[float, complex]]:
        """Eigenvalues of a diagonal block of size 1 or 2.

        The product of the two of a pair is a sum of logarithms, exact however small; the larger one follows
        from the trace, and the smaller one from the larger.
        """
        blocks = self._blocks(first, stop)
        diagonals = np.diagonal(blocks, axis1=1, axis2=2)
        if stop - first == 1:
            return [(float(np.log(np.abs(diagonals)).sum()), complex(np.prod(np.sign(diagonals))))]
        head, tail = blocks[0], diagonals[1:]
        determinant = head[0, 0] * head[1, 1] - head[0, 1] * head[1, 0]
        log_product = float(np.log(np.abs(tail)).sum() + np.log(np.abs(determinant)))
        sign = float(np.prod(np.sign(tail)) * np.sign(determinant))
        product, scale = _scaled_product_with_log(blocks)
        # In units in which the product of the two has the modulus 1.
        half = 0.5 * (product[0, 0] + product[1, 1])
        log_half = float(np.log(abs(half))) + scale - 0.5 * log_product
        if sign > 0 and log_half < 0:
            cosine = float(np.copysign(np.exp(log_half), half))
            phase = complex(cosine, float(np.sqrt((1 - cosine) * (1 + cosine))))
            if phase.imag > 0:
                return [(0.5 * log_product, phase), (0.5 * log_product, phase.conjugate())]
        # Real: |half| + sqrt(half^2 - sign), without overflow.
        if log_half > 20.0:
            log_larger = log_half + float(np.log(2.0))
        else:
            size = float(np.exp(log_half))
            log_larger = float(np.log(size + np.sqrt(max(size * size - sign, 0.0))))
        side = float(np.copysign(1.0, half))
        return [
            (0.5 * log_product + log_larger, complex(side)),
            (0.5 * log_product - log_larger, complex(side * sign)),
        ]


def _rotation(a: float, b: float) -> np.ndarray:
    """Rotation that takes ``(a, b)`` to ``(r, 0)``."""
    r = float(np.hypot(a, b))
    if r == 0.0:
        return np.eye(2)
    c, s = a / r, b / r
    return np.array([[c, s], [-s, c]])


def _scaled_product(factors: np.ndarray) -> np.ndarray:
    return _scaled_product_with_log(factors)[0]


def _scaled_product_with_log(factors: np.ndarray) -> tuple[np.ndarray, float]:
    """``factors[0] @ factors[1] @ ...`` over its size, and the logarithm of that; in pairs, and so on."""
    log_size = 0.0
    while True:
        sizes = np.abs(factors).max(axis=(1, 2))
        if not np.all(sizes > 0):
            return np.zeros(factors.shape[1:]), 0.0
        factors = factors / sizes[:, None, None]
        log_size += float(np.log(sizes).sum())
        if len(factors) == 1:
            return factors[0], log_size
        even = len(factors) - len(factors) % 2
        factors = np.concatenate([factors[0:even:2] @ factors[1:even:2], factors[even:]])
