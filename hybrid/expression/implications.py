"""Which signs of expressions follow from the signs of others, by sums of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import attrs
import numpy as np

from hybrid.expression.graph import is_larger_than, once
from hybrid.expression.nodes import ONE, Expression
from hybrid.expression.polynomials import coefficients_of

# Expressions written as longer trees are not written out, and nothing follows from them.
MOST_TERMS = 200
# Rounding of coefficients, as a share of the largest.
ROUNDING = 1e-12


def follows(height: Expression, side: int, given: Sequence[tuple[Expression, int]]) -> bool:
    """Whether a height is proved to have the sign ``side``, as a sum of others (Farkas' lemma).

    It has if it is a positive constant plus a combination of the others, with factors that have the signs of
    these others; a surface that the state lies on may have any factor. Products of states and parameters
    count as variables of their own.
    """
    target = _monomials(height)
    columns = [
        Column({name: (on if on in (-1, 1) else 1) * factor for name, factor in row.items()}, on in (-1, 1))
        for other, on in given
        if (row := _monomials(other)) is not None
    ]
    if target is None:
        return False
    wanted = {name: side * factor for name, factor in target.items()}
    kept = _of_use(wanted, [Column({ONE: 1.0}, True), *columns])
    if not kept:
        return False
    names = [*{name for column in kept for name in column.terms}]
    matrix = np.array([[column.terms.get(name, 0.0) for column in kept] for name in names])
    factors = _combination(matrix, np.array([wanted.get(name, 0.0) for name in names]), kept)
    least = ROUNDING * max(map(abs, wanted.values()))
    distance = matrix @ factors - [wanted.get(name, 0.0) for name in names]
    signed = factors[[column.is_signed for column in kept]]
    return bool(np.linalg.norm(distance) <= least and np.all(signed >= -least) and np.any(signed > least))


@attrs.frozen
class Column:
    """What may be added to a combination: terms by monomial; if it is signed, with a positive factor only."""

    terms: Mapping[Expression, float]
    is_signed: bool


def _of_use(wanted: Mapping[Expression, float], columns: Sequence[Column]) -> Sequence[Column]:
    """The columns that a combination may have; none if there is no combination.

    A monomial that is not wanted must cancel, and one that is wanted must come from somewhere.
    """
    while True:
        signs: dict[Expression, set[bool]] = {}
        for column in columns:
            for name, factor in column.terms.items():
                signs.setdefault(name, set()).update((factor > 0.0, (factor > 0.0) == column.is_signed))
        if any((factor > 0.0) not in signs.get(name, ()) for name, factor in wanted.items()):
            return []
        alone = {name for name, found in signs.items() if len(found) == 1 and name not in wanted}
        left = [column for column in columns if alone.isdisjoint(column.terms)]
        if len(left) == len(columns):
            return columns
        columns = left


def _combination(matrix: np.ndarray, wanted: np.ndarray, columns: Sequence[Column]) -> np.ndarray:
    """The factors of columns that come closest to what is wanted, negative ones only if there are no others.

    Independent columns have but one combination.
    """
    factors: np.ndarray
    factors, _, rank, _ = np.linalg.lstsq(matrix, wanted)
    if rank == len(columns):
        return factors
    # SciPy's optimisers take half a second to import.
    from scipy.optimize import nnls

    free = [i for i, column in enumerate(columns) if not column.is_signed]
    factors, _ = nnls(np.hstack([matrix, -matrix[:, free]]), wanted)
    factors[free] -= factors[len(columns) :]
    return factors[: len(columns)]


@once
def _monomials(height: Expression) -> dict[Expression, float] | None:
    """Coefficients of the products of symbols in a height; None if it is too long to be expanded."""
    if is_larger_than(MOST_TERMS, height):
        return None
    return {name: float(factor) for name, factor in coefficients_of(height).items()}
