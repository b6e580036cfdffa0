"""The field on the intersection of surfaces whose jumps add up, as those of several dry contacts do.

With a share from -1 to 1 of the two sides of each surface, the field is ``f + sum_i s_i d_i``. The rates of
the heights vanish for one choice of the shares, which solves a linear system: the equivalent control of Utkin
1992, *Sliding Modes in Control and Optimization*, chapter 2. Taken one surface after another, the same field
would be a quotient of large terms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product

import sympy
from sympy.core.parameters import distribute

from hybrid.symbolic.expressions import HALF, ONE, ZERO, power
from hybrid.symbolic.nodes import expanded

Field = list[sympy.Expr]
Matrix = list[list[sympy.Expr]]


def sliding_field(
    vertex_field: Callable[[Mapping[int, int]], Sequence[sympy.Expr]],
    on: Sequence[int],
    gradients: Sequence[Sequence[sympy.Expr]],
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
    with distribute(False):
        rates = [_along(normal, middle) + own for *normal, own in gradients]
        matrix = [[_along(normal, half) for half in halves] for *normal, _ in gradients]
        shares = _solved(matrix, [-rate for rate in rates])
        if shares is None:
            return None
        field = [
            entry + _sum(share * half[i] for share, half in zip(shares, halves, strict=True) if half[i] != 0)
            for i, entry in enumerate(middle)
        ]
    # A state that stays where it is must have the rate 0, not what is left by rounding.
    return [ZERO if expanded(entry) == 0 else entry for entry in field]


def _parts(
    vertex_field: Callable[[Mapping[int, int]], Sequence[sympy.Expr]], on: Sequence[int]
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
            if expanded(entry - added) != 0:
                return None
    return middle, halves


def _along(normal: Sequence[sympy.Expr], field: Field) -> sympy.Expr:
    return _sum(slope * rate for slope, rate in zip(normal, field, strict=True) if slope != 0 and rate != 0)


def _sum(terms: Iterable[sympy.Expr]) -> sympy.Expr:
    return sympy.Add(*terms)


def _solved(matrix: Matrix, right: Field) -> Field | None:
    """The solution of a linear system by elimination; None if the matrix is singular."""
    rows = [[*row, entry] for row, entry in zip(matrix, right, strict=True)]
    size = len(rows)
    for k in range(size):
        # A row with few entries keeps expressions small: mostly each surface has a contact of its own.
        usable = [i for i in range(k, size) if expanded(rows[i][k]) != 0]
        if not usable:
            return None
        best = min(usable, key=lambda i: sum(entry != 0 for entry in rows[i][:size]))
        rows[k], rows[best] = rows[best], rows[k]
        pivot = rows[k]
        for i in range(size):
            if i != k and rows[i][k] != 0:
                factor = rows[i][k] * power(pivot[k], -ONE)
                rows[i] = [
                    ZERO if j == k else entry - factor * pivot[j] if pivot[j] != 0 else entry
                    for j, entry in enumerate(rows[i])
                ]
    return [rows[k][size] * power(rows[k][k], -ONE) for k in range(size)]
