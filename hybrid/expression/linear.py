"""Linear equations between expressions, and what is known of their solutions.

The solution of ``A x = b`` by elimination is a large expression, and the chain rule through it gives a far
larger one. So the equations are remembered with the solution: its derivative along ``v`` solves
``A x_v = b_v - A_v x``, by the same elimination.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid.expression.nodes import ONE, ZERO, Expression, add, multiply, node
from hybrid.expression.operations import Absolute

Vector = list[Expression]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """The sum of products, of numbers or of expressions, without those that are zero."""
    terms = [x * y for x, y in zip(a, b, strict=True) if x != 0 and y != 0]
    if any(isinstance(each, Expression) for each in terms):
        return add(*map(node, terms))
    return sum(terms[1:], terms[0]) if terms else 0.0


def size_of(value: Any) -> Any:
    """The size of a number, or of an expression."""
    return Absolute(value) if isinstance(value, Expression) else abs(value)


@attrs.frozen(eq=False)
class Elimination:
    """Gauss's elimination of a matrix ``A``.

    Attributes
    ----------
    matrix, upper
        ``A`` by rows, and what they are after elimination.
    pivots
        By column: the row that it is eliminated with.
    steps
        Triples ``(row, pivot, share)``, one after another: from the row, this share of the pivot's was taken.
    """

    matrix: list[Vector]
    upper: list[Vector]
    pivots: list[int]
    steps: list[tuple[int, int, Expression]]

    def solution(self, column: Sequence[Expression]) -> Vector:
        """The solution ``x`` of ``A x = b`` for a column ``b``."""
        right = [*column]
        for row, pivot, share in self.steps:
            if right[pivot] is not ZERO:
                right[row] = right[row] - multiply(share, right[pivot])
        found: Vector = [ZERO] * len(right)
        for k in reversed(range(len(right))):
            row = self.pivots[k]
            known = node(dot(self.upper[row][k + 1 :], found[k + 1 :]))
            found[k] = (right[row] - known) / self.upper[row][k]
        if self.steps:
            # A mere quotient may stand in any model: what is made of it must not hang on this one.
            _remember(LinearEquations(self, [*column]), found)
        return found

    def row_of_inverse(self, k: int) -> Vector:
        """Row ``k`` of the inverse: how the unknown ``k`` follows from a column."""
        # The steps of `solution` transposed, the last one first.
        follows: Vector = [ZERO] * len(self.pivots)
        follows[k] = ONE
        row: Vector = [ZERO] * len(self.pivots)
        for j, pivot in enumerate(self.pivots):
            row[pivot] = share = follows[j] / self.upper[pivot][j]
            if share is not ZERO:
                for later in range(j + 1, len(self.pivots)):
                    follows[later] = follows[later] - multiply(share, self.upper[pivot][later])
        for i, pivot, share in reversed(self.steps):
            if row[i] is not ZERO:
                row[pivot] = row[pivot] - multiply(share, row[i])
        return row


@attrs.frozen(eq=False)
class LinearEquations:
    """``A x = b``, with ``A`` eliminated.

    Attributes
    ----------
    elimination, column
        Those of ``A``, and ``b``.
    """

    elimination: Elimination
    column: Vector

    @property
    def inputs(self) -> list[Expression]:
        """What ``A`` and ``b`` are made of."""
        return [*(each for row in self.elimination.matrix for each in row if each is not ZERO), *self.column]

    @property
    def solution(self) -> Vector:
        """The solution ``x``, made anew: kept here it would keep itself alive."""
        return self.elimination.solution(self.column)

    def column_of_derivative(self, x: Vector, slope: Callable[[Expression], Expression]) -> Vector:
        """``b_v - A_v x``, from the solution and the derivative of each input."""
        slopes = [[ZERO if each is ZERO else slope(each) for each in row] for row in self.elimination.matrix]
        return [slope(b) - dot(row, x) for row, b in zip(slopes, self.column, strict=True)]

    def derivative(self, slope: Callable[[Expression], Expression]) -> Vector:
        """The derivative of ``x``, from that of each input."""
        return self.elimination.solution(self.column_of_derivative(self.solution, slope))


# By solution: its equations, and which of the unknowns it is. It lives as long as the solution does.
_known: WeakKeyDictionary[Expression, tuple[LinearEquations, int]] = WeakKeyDictionary()


def equations_of_solution(expression: Expression) -> tuple[LinearEquations, int] | None:
    """The linear equations that an expression solves, and as which unknown; None if none are known."""
    return _known.get(expression)


def _remember(equations: LinearEquations, solution: Vector) -> None:
    """Know these unknowns by their equations, but for those from which the equations are made."""
    reached: set[Expression] = set()
    waiting = equations.inputs
    while waiting:
        each = waiting.pop()
        if each not in reached:
            reached.add(each)
            known = _known.get(each)
            waiting += [*each.args, *(() if known is None else known[0].inputs)]
    for k, each in enumerate(solution):
        if each.args and each not in reached:
            _known.setdefault(each, (equations, k))


def solved(
    rows: Sequence[Sequence[Expression]],
    columns: Sequence[Vector],
    values: np.ndarray | None = None,
    *,
    definite: int = 0,
) -> list[Vector]:
    """The solutions ``X`` of ``A X = B``, by Gauss's elimination.

    Parameters
    ----------
    rows
        Those of ``A``.
    columns
        Those of ``B``.
    values
        ``A`` at a state: the largest values become pivots. It may be left out if all of ``A`` is definite.
    definite
        So many leading rows and columns are a positive definite matrix: its diagonal serves as pivots.
    """
    eliminated = _eliminated(rows, values, definite)
    return [eliminated.solution([node(each) for each in column]) for column in columns]


def determinant(rows: Sequence[Sequence[Expression]], values: np.ndarray) -> Expression:
    """The determinant of ``A`` but for a sign: positive where ``A`` has these ``values``."""
    eliminated = _eliminated(rows, values)
    # The row operations change no determinant, and the order of the rows only its sign.
    positive = np.linalg.det(np.array(values, dtype=float)[eliminated.pivots]) > 0.0
    product = multiply(*(eliminated.upper[row][k] for k, row in enumerate(eliminated.pivots)))
    return product if positive else -product


def _eliminated(
    rows: Sequence[Sequence[Expression]], values: np.ndarray | None, definite: int = 0
) -> Elimination:
    matrix = [[node(each) for each in row] for row in rows]
    upper, numbers = [*matrix], np.eye(len(rows)) if values is None else np.array(values, dtype=float)
    waiting, pivots, steps = [*range(len(rows))], [], []
    for k in range(len(rows)):
        allowed = [k] if k < definite else [i for i in waiting if upper[i][k] is not ZERO]
        pivot = allowed[int(np.argmax(np.abs(numbers[allowed, k])))]
        waiting.remove(pivot)
        pivots.append(pivot)
        for i in waiting:
            if upper[i][k] is ZERO:
                continue
            share = upper[i][k] / upper[pivot][k]
            numbers[i] -= numbers[pivot] * (numbers[i, k] / numbers[pivot, k])
            steps.append((i, pivot, share))
            upper[i] = [
                a if b is ZERO else a - multiply(share, b)
                for a, b in zip(upper[i], upper[pivot], strict=True)
            ]
    return Elimination(matrix, upper, pivots, steps)
