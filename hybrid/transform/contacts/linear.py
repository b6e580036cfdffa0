"""Linear equations between expressions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid.expression.nodes import ZERO, Expression, add, multiply, node
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


def solved(
    rows: Sequence[Sequence[Expression]], columns: Sequence[Vector], values: np.ndarray
) -> list[Vector]:
    """The solutions ``X`` of ``A X = B``, by Gauss's elimination.

    Parameters
    ----------
    rows
        Those of ``A``.
    columns
        Those of ``B``.
    values
        ``A`` at a state: the largest values become pivots.
    """
    size = len(rows)
    left, right, pivots = _eliminated(rows, columns, values)
    found: list[Vector] = [[ZERO] * size for _ in columns]
    for k in reversed(range(size)):
        row = pivots[k]
        for column, solution in enumerate(found):
            known = node(dot(left[row][k + 1 :], solution[k + 1 :]))
            solution[k] = (right[row][column] - known) / left[row][k]
    return found


def determinant(rows: Sequence[Sequence[Expression]], values: np.ndarray) -> Expression:
    """The determinant of ``A`` but for a sign: positive where ``A`` has these ``values``."""
    left, _, pivots = _eliminated(rows, [], values)
    # The row operations change no determinant, and the order of the rows only its sign.
    positive = np.linalg.det(np.array(values, dtype=float)[pivots]) > 0.0
    product = multiply(*(left[row][k] for k, row in enumerate(pivots)))
    return product if positive else -product


def _eliminated(
    rows: Sequence[Sequence[Expression]], columns: Sequence[Vector], values: np.ndarray
) -> tuple[list[Vector], list[Vector], list[int]]:
    """``A`` and ``B`` by rows after elimination, and the rows of the pivots."""
    size = len(rows)
    left = [[node(each) for each in row] for row in rows]
    right = [[node(column[i]) for column in columns] for i in range(size)]
    numbers = np.array(values, dtype=float)
    waiting, pivots = [*range(size)], []
    for k in range(size):
        allowed = [i for i in waiting if left[i][k] is not ZERO]
        pivot = allowed[int(np.argmax(np.abs(numbers[allowed, k])))]
        waiting.remove(pivot)
        pivots.append(pivot)
        for i in waiting:
            if left[i][k] is ZERO:
                continue
            share = left[i][k] / left[pivot][k]
            numbers[i] -= numbers[pivot] * (numbers[i, k] / numbers[pivot, k])
            for entries in (left, right):
                entries[i] = [
                    a if b is ZERO else a - multiply(share, b)
                    for a, b in zip(entries[i], entries[pivot], strict=True)
                ]
    return left, right, pivots
