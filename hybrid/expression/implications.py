"""Which signs of expressions follow from the signs of others, by sums of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
    columns, strict = [{ONE: 1.0}], [True]
    for other, on in given:
        row = _monomials(other)
        if row is None:
            continue
        signs = (1.0, -1.0) if on in (0, -2, 2) else (float(on),)
        columns += [{name: sign * factor for name, factor in row.items()} for sign in signs]
        strict += [on in (-1, 1)] * len(signs)
    if target is None:
        return False
    wanted = {name: side * factor for name, factor in target.items()}
    kept = _of_use(wanted, columns)
    if not kept:
        return False
    # SciPy's optimisers take half a second to import.
    from scipy.optimize import nnls

    names = [*{name for i in kept for name in columns[i]}]
    matrix = np.array([[columns[i].get(name, 0.0) for i in kept] for name in names])
    factors, distance = nnls(matrix, np.array([wanted.get(name, 0.0) for name in names]))
    scale = max(map(abs, wanted.values()))
    strictly = factors[[strict[i] for i in kept]]
    return bool(distance <= ROUNDING * scale and np.any(strictly > ROUNDING * scale))


def _of_use(wanted: Mapping[Expression, float], columns: Sequence[Mapping[Expression, float]]) -> list[int]:
    """The columns that a combination with positive factors may have; none if there is no combination.

    A monomial that is not wanted must cancel, and one that is wanted must come from somewhere.
    """
    kept = [*range(len(columns))]
    while True:
        signs: dict[Expression, set[bool]] = {}
        for i in kept:
            for name, factor in columns[i].items():
                signs.setdefault(name, set()).add(factor > 0.0)
        if any((factor > 0.0) not in signs.get(name, ()) for name, factor in wanted.items()):
            return []
        alone = {name for name, found in signs.items() if len(found) == 1 and name not in wanted}
        left = [i for i in kept if alone.isdisjoint(columns[i])]
        if len(left) == len(kept):
            return kept
        kept = left


@once
def _monomials(height: Expression) -> dict[Expression, float] | None:
    """Coefficients of the products of symbols in a height; None if it is too long to be expanded."""
    if is_larger_than(MOST_TERMS, height):
        return None
    return {name: float(factor) for name, factor in coefficients_of(height).items()}
