"""Guards that are the same function up to a constant factor, and therefore have the same zero set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import sympy

    from hybrid.compiler.emitted import Emitted
    from hybrid.system.graph import HybridSystem

# Expressions with more terms are not expanded; expressions with more nodes are compared as a whole.
MOST_TERMS = 200
MOST_SHOWN = 5000
# Digits to which quotients of coefficients are compared.
DIGITS = 12


def surfaces(
    functions: Iterable[Callable[..., Any]],
    expressions: Iterable[sympy.Expr | None],
    scaled: dict[sympy.Expr, tuple[Any, int]],
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


def _without_factor(expression: sympy.Expr) -> tuple[Any, int]:
    """An expression divided by its leading coefficient, and the sign of that coefficient.

    None instead if it is a constant.
    """
    from hybrid.symbolic.nodes import is_larger_than, symbols_of

    if not symbols_of(expression):
        return None, 1
    if is_larger_than(MOST_SHOWN, expression):
        # The expression itself: expanding it would take too long.
        return expression, 1
    if not is_larger_than(MOST_TERMS, expression):
        expression = expression.expand()
    coefficients = expression.as_coefficients_dict()
    terms = sorted((str(term), float(factor)) for term, factor in coefficients.items())
    leading = terms[0][1]
    scaled = tuple((term, f"{factor / leading:.{DIGITS}e}") for term, factor in terms)
    return scaled, 1 if leading > 0.0 else -1


def is_paired(system: HybridSystem, emitted: Emitted, index: int) -> bool:
    """Whether the mode of a transition has another one across the same surface in another direction."""
    own = system.transitions[index]
    towards = own.guard.direction * emitted.orientation[index]
    return any(
        other.source == own.source
        and emitted.surface[i] == emitted.surface[index]
        and other.guard.direction * emitted.orientation[i] != towards
        for i, other in enumerate(system.transitions)
    )
