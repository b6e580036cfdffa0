"""The field on the intersection of surfaces whose jumps add up, as those of several dry contacts do.

With a share from -1 to 1 of the two sides of each surface, the field is ``f + sum_i s_i d_i``. The rates of
the heights vanish for one choice of the shares, which solves a linear system: the equivalent control of Utkin
1992, *Sliding Modes in Control and Optimization*, chapter 2. Taken one surface after another, the same field
would be a quotient of large terms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product

from hybrid.expression.nodes import HALF, MINUS_ONE, ZERO, Expression, add, power
from hybrid.expression.polynomials import expanded, is_zero

Field = list[Expression]
Matrix = list[list[Expression]]


def sliding_field(
    vertex_field: Callable[[Mapping[int, int]], Sequence[Expression]],
    on: Sequence[int],
    gradients: Sequence[Sequence[Expression]],
) -> Field | None:
    """The field along which all heights stay; None where jumps do not add up, or the shares are not unique.

    Parameters
    ----------
    vertex_field
        The field with the branches of some sides of the surfaces, -2 or 2 by number.
    on
        Numbers of the surfaces.
    gradients
        For each of them the derivatives of its height in the states, then in time.
    """
    parts = _parts(vertex_field, on)
    if parts is None:
        return None
    middle, halves = parts
    rates = [_along(normal, middle) + own for *normal, own in gradients]
    matrix = [[_along(normal, half) for half in halves] for *normal, _ in gradients]
    shares = _solved(matrix, [-rate for rate in rates])
    if shares is None:
        return None
    field = [
        entry + _sum(share * half[i] for share, half in zip(shares, halves, strict=True))
        for i, entry in enumerate(middle)
    ]
    # A state that stays where it is must have the rate 0, not what is left by rounding.
    return [ZERO if is_zero(entry) else entry for entry in field]


def _parts(
    vertex_field: Callable[[Mapping[int, int]], Sequence[Expression]], on: Sequence[int]
) -> tuple[Field, list[Field]] | None:
    """The field midway between all sides, and half the jump across each surface.

    None if the jumps do not add up.
    """
    top = vertex_field(dict.fromkeys(on, 2))
    lower = [vertex_field({**dict.fromkeys(on, 2), number: -2}) for number in on]
    halves = [[expanded(a - b) * HALF for a, b in zip(top, each, strict=True)] for each in lower]
    middle = [entry - _sum(half[i] for half in halves) for i, entry in enumerate(top)]
    for signs in product((-1, 1), repeat=len(on)):
        if sum(sign < 0 for sign in signs) < 2:
            continue
        corner = vertex_field({number: 2 * sign for number, sign in zip(on, signs, strict=True)})
        for i, entry in enumerate(corner):
            added = middle[i] + _sum(sign * half[i] for sign, half in zip(signs, halves, strict=True))
            if not is_zero(entry - added):
                return None
    return middle, halves


def _along(normal: Sequence[Expression], field: Field) -> Expression:
    return _sum(slope * rate for slope, rate in zip(normal, field, strict=True))


def _sum(terms: Iterable[Expression]) -> Expression:
    return add(*terms)


def _solved(matrix: Matrix, right: Field) -> Field | None:
    """The solution of a linear system by elimination; None if the matrix is singular."""
    rows = [[*row, entry] for row, entry in zip(matrix, right, strict=True)]
    size = len(rows)
    for k in range(size):
        # A row with few entries keeps expressions small: mostly each surface has a contact of its own.
        usable = [i for i in range(k, size) if not is_zero(rows[i][k])]
        if not usable:
            return None
        best = min(usable, key=lambda i: sum(entry is not ZERO for entry in rows[i][:size]))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k]
        for i in range(size):
            if i != k and rows[i][k] is not ZERO:
                factor = rows[i][k] * power(pivot[k], MINUS_ONE)
                rows[i] = [ZERO if j == k else entry - factor * pivot[j] for j, entry in enumerate(rows[i])]
    return [rows[k][size] * power(rows[k][k], MINUS_ONE) for k in range(size)]
