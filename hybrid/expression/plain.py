"""The plain form of a guard: the same sign everywhere, and a gradient that shows its surface.

The gradient of ``e**3`` vanishes where ``e`` is zero, that of ``cbrt(e)`` is infinite there, and those of
``sign(e)`` and of ``where(e > 0, 2, -1)`` say nothing of ``e`` at all.
"""

from __future__ import annotations

from typing import NamedTuple

from hybrid.expression.graph import contains
from hybrid.expression.linear import equations_of_solution
from hybrid.expression.nodes import ONE, ZERO, Expression, add, multiply
from hybrid.expression.operations import (
    JUMPING,
    Absolute,
    CubeRoot,
    Floor,
    Less,
    LessEqual,
    Select,
    Sign,
    Step,
)
from hybrid.expression.ranges import range_of


class Choice(NamedTuple):
    """A value ``above``, where a height is positive, and another one ``below``."""

    height: Expression
    above: Expression
    below: Expression


def plain(guard: Expression) -> Expression:
    """``e`` for an odd power or cubic root of it, ``floor(e) + 1/2``, and a choice by ``e`` of two signs."""
    if equations_of_solution(guard) is not None:
        # Its gradient follows from its equations, which a multiple of it does not solve.
        return guard
    if isinstance(guard, CubeRoot) or _is_odd_power(guard):
        return plain(guard.args[0])
    if guard.is_sum and len(guard.args) == 2 and isinstance(guard.args[0], Floor):
        whole, share = guard.args
        if share.is_number and 0.0 < float(share) < 1.0:
            return plain(whole.args[0])
    choice = _choice(guard)
    # Where the height jumps too, it matters what the choice is at zero.
    if choice is not None and not contains(choice.height, JUMPING):
        above, below = range_of(choice.above), range_of(choice.below)
        if above.positive and below.negative:
            return plain(choice.height)
        if above.negative and below.positive:
            return plain(-choice.height)
    return _plain_product(guard) if guard.is_product else guard


def _is_odd_power(expression: Expression) -> bool:
    if not expression.is_power:
        return False
    exponent = expression.args[1]
    return bool(exponent.is_number and float(exponent) % 2.0 == 1.0)


def _plain_product(guard: Expression) -> Expression:
    """A product of the plain forms of its factors, without sizes of these and what is positive.

    If no factor changes, the product is plain.
    """
    factors = [plain(each) for each in guard.args]
    bases = [base for each in factors for base in (each, -each)]
    kept = [each for each in factors if not _is_size_of(each, bases)]
    if len(kept) == len(factors) and all(map(Expression.__eq__, kept, guard.args)):
        return guard
    return multiply(*(each for each in kept if each.is_number or not range_of(each).positive))


def _is_size_of(factor: Expression, bases: list[Expression]) -> bool:
    """Whether a factor is the absolute value of one of some bases, or a power of it."""
    size = factor.args[0] if factor.is_power and factor.args[1].is_number else factor
    return isinstance(size, Absolute) and size.args[0] in bases


def _choice(expression: Expression) -> Choice | None:
    """An expression as a choice between two by the sign of a height, if it is one with sums and factors."""
    if isinstance(expression, Select) and isinstance(expression.args[0], Less | LessEqual):
        low, high = expression.args[0].args
        return Choice(high - low, *expression.args[1:])
    if isinstance(expression, Less | LessEqual):
        low, high = expression.args
        return Choice(high - low, ONE, ZERO)
    if isinstance(expression, Step | Sign):
        return Choice(expression.args[0], ONE, ZERO if isinstance(expression, Step) else -ONE)
    if not (expression.is_sum or expression.is_product):
        return None
    join = add if expression.is_sum else multiply
    found = [(i, choice) for i, each in enumerate(expression.args) if (choice := _choice(each)) is not None]
    if len(found) != 1:
        return None
    [(place, choice)] = found
    others = [each for i, each in enumerate(expression.args) if i != place]
    return Choice(choice.height, join(*others, choice.above), join(*others, choice.below))
