"""What counts as zero: in numbers by the sizes of terms, and as an expression where others are zero."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import numpy as np

from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import in_order, is_positive
from hybrid.expression.nodes import ZERO, Expression, add, multiply, power
from hybrid.expression.operations import Absolute, And, Less, LessEqual, Or
from hybrid.system.growth import Place
from hybrid.transform.pairs.equations import values_at

# What is smaller than this share of its terms is zero: it has been computed with rounding.
NOISE = 1e-14
# The same at other points than that of a run, where Newton's method has found zeros.
NEARLY = 1e-9
# Points at which an expression has to vanish, how far around a state, and the steps of Newton's method.
POINTS, AROUND, MOST_STEPS = 4, 0.3, 20
# A step of Newton's method this small is its last; and how much rather it moves the state than time.
FOUND, SLOWER = 1e-13, 1e-6


def size_of(expression: Expression) -> Expression:
    """The sum of the sizes of the terms of an expression."""
    found: dict[Expression, Expression] = {}
    for each in in_order([expression]):
        if each.is_sum:
            found[each] = add(*(found[part] for part in each.args))
        elif each.is_product:
            found[each] = multiply(*(found[part] for part in each.args))
        elif each.is_power and is_positive(each.args[1]):
            found[each] = power(found[each.args[0]], each.args[1])
        else:
            found[each] = Absolute(each)
    return found[expression]


def not_negative(expression: Expression) -> Expression:
    """The condition that an expression is not negative by more than its noise."""
    return LessEqual(-NOISE * size_of(expression), expression)


def vanishing(expression: Expression) -> Expression:
    """The condition that an expression is zero but for its noise."""
    return LessEqual(Absolute(expression), NOISE * size_of(expression))


def at_first(levels: Sequence[Expression]) -> Expression:
    """The condition that something is not negative from now on, by its value and its derivatives in time.

    The first of these that is not zero decides.
    """
    *first, last = levels
    return reduce(
        lambda later, each: Or(Less(NOISE * size_of(each), each), And(not_negative(each), later)),
        reversed(first),
        not_negative(last),
    )


class Manifold:
    """The points around a state at which some expressions are zero.

    A run that has come there has them zero but for rounding, of which neither value nor size tells anything.
    So what is zero on the whole manifold is known to be zero.

    Parameters
    ----------
    symbols
        Those of the model.
    zero
        The expressions.
    falls
        What has come to zero from above just now, with its rate: it cannot go on if that is negative.
    """

    def __init__(
        self,
        symbols: Any,
        zero: Sequence[Expression],
        place: Place,
        falls: tuple[Expression, Expression] | None = None,
    ) -> None:
        self.symbols, self.place, self.falls = symbols, place, falls
        self.zero = tuple(each for each in zero if each is not ZERO)
        self.known: dict[Expression, bool] = dict.fromkeys(self.zero, True)

    def has(self, expression: Expression) -> bool:
        """Whether an expression vanishes on the manifold."""
        if expression not in self.known and self.points:
            program = self._with_slopes([expression, size_of(expression)])
            self.known[expression] = all(self._is_zero(program, *each) for each in self.points)
        return self.known.get(expression, False)

    @cached_property
    def points(self) -> list[tuple[Place, np.ndarray]]:
        """Some points, each with the sizes of the states and of time."""
        t, x, parameters = self.place
        rng = np.random.default_rng(20240507)
        scale = np.where(x == 0.0, 1.0, np.abs(x))
        found = []
        for _ in range(POINTS):
            there = x + AROUND * scale * rng.uniform(-1.0, 1.0, len(x))
            # Parameters that happen to be equal, or zero, should not count as such.
            values = parameters * (1.0 + AROUND * rng.uniform(-1.0, 1.0, len(parameters)))
            values = np.where(parameters == 0.0, rng.uniform(0.5, 1.0, len(parameters)), values)
            point = self._onto((t + AROUND * max(abs(t), 1.0) * rng.uniform(), there, values), scale)
            if point is not None:
                found.append((point, np.append(np.abs(there) + scale, max(abs(t), 1.0))))
        return found

    def _onto(self, place: Place, scale: np.ndarray) -> Place | None:
        """A point of the manifold, by Newton's method; None if it finds none."""
        t, x, parameters = place
        # A forcing may turn many times: the state is moved rather than time.
        units = np.append(scale, SLOWER * max(abs(t), 1.0))
        for _ in range(MOST_STEPS if self.zero else 0):
            values = values_at(self.symbols, self._program, (t, x, parameters)).reshape(len(self.zero), -1)
            value, slopes = values[:, 0], values[:, 1:] * units
            if not np.isfinite(values).all():
                return None
            step = units * np.linalg.lstsq(slopes, -value, rcond=None)[0]
            t, x = t + float(step[-1]), x + step[:-1]
            if (np.abs(step[:-1]) <= FOUND * scale).all() and abs(step[-1]) <= FOUND * max(abs(t), 1.0):
                return t, x, parameters
        return None if self.zero else place

    @cached_property
    def _program(self) -> Program:
        return self._with_slopes(self.zero)

    def _is_zero(self, program: Program, place: Place, scale: np.ndarray) -> bool:
        values = values_at(self.symbols, program, place)
        value, slopes, size = values[0], values[1 : len(scale) + 1], values[len(scale) + 1]
        largest = size + np.abs(slopes) @ scale
        return bool(np.isfinite(largest)) and abs(value) <= NEARLY * largest

    def _with_slopes(self, expressions: Sequence[Expression]) -> Program:
        """Each expression with its derivatives in the state and in time."""
        rows = jacobian_of(expressions, self.symbols.variables)
        return Program([each for value, row in zip(expressions, rows, strict=True) for each in (value, *row)])
