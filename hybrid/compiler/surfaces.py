"""Guards that are the same function up to a constant factor, and therefore have the same zero set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from hybrid.expression.graph import is_larger_than, terms_of
from hybrid.expression.nodes import Expression, order_of, split
from hybrid.expression.polynomials import coefficients_of

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted
    from hybrid.system.graph import HybridSystem

# Expressions with more terms are not expanded.
MOST_TERMS = 200
# Digits to which quotients of coefficients are compared.
DIGITS = 12


def surfaces(
    functions: Iterable[Callable[..., Any]],
    expressions: Iterable[Expression | None],
    scaled: dict[Expression, tuple[Any, int]],
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The number of the zero set of each guard, and the sign of the guard's factor.

    ``expressions`` are None for functions that could not be traced: these are compared as objects. A guard
    that is constant has no zero set that another could share.
    ``scaled`` keeps what is found of each expression.
    """
    known: dict[Any, int] = {}
    numbers, signs = [], []
    for i, (function, expression) in enumerate(zip(functions, expressions, strict=True)):
        if expression is not None and expression not in scaled:
            scaled[expression] = _without_factor(expression)
        key, sign = (id(function), 1) if expression is None else scaled[expression]
        numbers.append(known.setdefault((i, "constant") if key is None else key, len(known)))
        signs.append(sign)
    return tuple(numbers), tuple(signs)


def _without_factor(expression: Expression) -> tuple[Any, int]:
    """An expression divided by its leading coefficient, and the sign of that coefficient.

    None instead if it is a constant.
    """
    if not expression.mask:
        return None, 1
    if is_larger_than(MOST_TERMS, expression):
        # Expanding it would take too long.
        coefficients = {rest: factor for factor, rest in map(split, terms_of(expression))}
    else:
        coefficients = dict(coefficients_of(expression))
    terms = sorted(coefficients, key=order_of)
    leading = float(coefficients[terms[0]])
    scaled = tuple((term, f"{float(coefficients[term]) / leading:.{DIGITS}e}") for term in terms)
    return scaled, 1 if leading > 0.0 else -1


def is_paired(system: HybridSystem, emitted: Emitted, index: int) -> bool:
    """Whether the mode of a transition has another one across the same surface in another direction."""
    own = system.transitions[index]
    towards = own.guard.direction * emitted.orientation[index]
    return any(
        other.source == own.source
        and own.clock is None
        and other.clock is None
        and emitted.surface[i] == emitted.surface[index]
        and other.guard.direction * emitted.orientation[i] != towards
        for i, other in enumerate(system.transitions)
    )
