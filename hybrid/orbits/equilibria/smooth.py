"""Expressions as a smooth map, with its derivatives along vectors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hybrid.expression.derivatives import close_gates, defined_at_origin, directional, jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import Expression, Symbol

Known = Mapping[Symbol, Any]


def row_lengths(rows: np.ndarray) -> np.ndarray:
    """The length of each row of a matrix ``(k,)``, 1 for a row that is zero."""
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0.0] = 1.0
    return lengths


class Smooth:
    """A map from ``unknowns (N,)`` to the values of expressions ``(k,)``, with exact derivatives.

    ``known`` gives a number to each symbol, to the unknowns among them.
    """

    def __init__(self, expressions: Sequence[Expression], unknowns: Sequence[Symbol]) -> None:
        self.expressions, self.unknowns = [*expressions], [*unknowns]
        self.shape = len(self.expressions), len(self.unknowns)

    def value(self, known: Known) -> np.ndarray:
        """Values ``(k,)``."""
        return np.array(self._run(self._values, known), dtype=float)

    def jacobian(self, known: Known) -> np.ndarray:
        """Derivatives ``(k, N)`` in the unknowns."""
        return np.array(self._run(self._slopes, known), dtype=float).reshape(self.shape)

    def second(self, known: Known, *vectors: np.ndarray) -> np.ndarray:
        """The second derivative along two vectors ``(N,)``, which may be complex: ``(k,)``."""
        return self._along(self._second, known, vectors)

    def third(self, known: Known, *vectors: np.ndarray) -> np.ndarray:
        """The third derivative along three vectors ``(N,)``: ``(k,)``."""
        return self._along(self._third, known, vectors)

    def second_along(self, known: Known, vector: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, N)`` in the unknowns of the derivative along a vector."""
        columns = [self.second(known, vector, unit) for unit in np.eye(self.shape[1])]
        return np.array(columns).reshape(self.shape[::-1]).T

    def _along(self, program: Program, known: Known, vectors: Sequence[np.ndarray]) -> np.ndarray:
        seeds = {
            symbol: entry
            for order, vector in enumerate(vectors)
            for symbol, entry in zip(self._seeds(order), vector, strict=True)
        }
        return np.array(self._run(program, {**known, **seeds}))

    def _run(self, program: Program, known: Known) -> list[Any]:
        with np.errstate(all="ignore"):
            return program.run(known)

    @cached_property
    def _values(self) -> Program:
        return Program(self.expressions)

    @cached_property
    def _slopes(self) -> Program:
        rows = jacobian_of(self.expressions, self.unknowns)
        return Program([entry for row in rows for entry in row])

    @cached_property
    def _second(self) -> Program:
        return Program(self._derived(2))

    @cached_property
    def _third(self) -> Program:
        return Program(self._derived(3))

    def _derived(self, order: int) -> list[Expression]:
        """The expressions differentiated along as many vectors as ``order``."""
        found = self.expressions
        for number in range(order):
            along = directional(found, dict(zip(self.unknowns, self._seeds(number), strict=True)))
            found = [close_gates(defined_at_origin(each)) for each in along]
        return found

    def _seeds(self, order: int) -> list[Symbol]:
        return [Symbol(f"d{order}[{i}]") for i in range(self.shape[1])]
