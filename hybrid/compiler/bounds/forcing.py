"""Parts of a vector field that depend on time and parameters alone and could hide a pulse from a solver.

A solver evaluates a field only at certain points: at the stages of a step, or at its start for the series. A
pulse that is narrower than the step can lie between them. Interval arithmetic on the expression of the pulse
detects it, as it detects the crossings of a guard.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs
import sympy
from sympy.codegen.cfunctions import exp2, expm1

from hybrid.compiler.emitted import OF_STATE
from hybrid.symbolic.expressions import Absolute, Maximum
from hybrid.symbolic.nodes import degree_of, mentions, once
from hybrid.symbolic.tracing import Symbols

# Products of more harmonics than these, such as ``cos(t)**100``, are narrow pulses.
MOST_HARMONICS = 4
# Used instead of a component of the state if the forcing is not simply a term of the component's rate.
NO_COMPONENT = -1
# Functions that may be flat to all digits and change a little further on.
SATURATING = (sympy.tanh, sympy.atan, sympy.exp, sympy.erf, sympy.sinh, sympy.cosh, expm1, exp2)


@attrs.frozen
class Forcing:
    """An expression in time and parameters, and the component with this term in its rate or NO_COMPONENT.

    Without an expression, with the component OF_STATE, it stands for parts that saturate in the state.
    """

    expression: sympy.Expr | None
    component: int


def forcings(field: Sequence[sympy.Expr] | None, symbols: Symbols) -> tuple[Forcing, ...]:
    """The largest parts of a field in time and parameters alone, without their harmless terms.

    Empty for a field that was not traced.
    """
    if field is None:
        return ()
    found = dict.fromkeys(each for i, entry in enumerate(field) for each in _parts(entry, i, symbols))
    if not found and any(_saturates(entry, symbols.x) for entry in field):
        found[Forcing(None, OF_STATE)] = None
    return tuple(found)


@once
def _saturates(node: sympy.Expr, states: tuple[sympy.Symbol, ...]) -> bool:
    """Whether an expression may change in the state where its series is flat to all digits.

    ``tanh(v/1e-4)`` is, but for ``v`` close to 0, and so is ``x/sqrt(x**2 + 1e-16)``. Powers of affine
    expressions are not: where these vanish, the field is singular. Nor are quotients of polynomials: their
    series shows poles that are not far closer to the orbit than the tolerance.
    """
    if not mentions(node, states):
        return False
    if isinstance(node, SATURATING):
        return True
    if node.is_Pow and not node.exp.is_Integer:
        bases = node.base.args if isinstance(node.base, Maximum | Absolute) else (node.base,)
        degrees = [degree_of(base, frozenset(states)) for base in bases]
        if any(degree is None or degree > 1 for degree in degrees):
            return True
    return any(_saturates(part, states) for part in node.args)


@once
def _parts(node: sympy.Expr, component: int, symbols: Symbols) -> tuple[Forcing, ...]:
    return tuple(dict.fromkeys(_found_parts(node, component, symbols)))


def _found_parts(node: sympy.Expr, component: int, symbols: Symbols) -> Iterator[Forcing]:
    if not mentions(node, (symbols.t,)):
        return
    own, others = [node], []
    if node.is_Add or (node.is_Mul and mentions(node, symbols.x)):
        own = [part for part in node.args if mentions(part, (symbols.t,)) and not mentions(part, symbols.x)]
        others = [part for part in node.args if mentions(part, symbols.x)]
    elif mentions(node, symbols.x):
        own, others = [], [*node.args]
    if node.is_Add:
        own = [part for part in own if not is_harmless(part, symbols.t)]
    whole = node.func(*own) if len(own) > 1 else own[0] if own else sympy.S.Zero
    within = component if node.is_Add or not others else NO_COMPONENT
    if not is_harmless(whole, symbols.t):
        yield Forcing(whole, within)
    for other in others:
        yield from _parts(other, within, symbols)


def is_harmless(expression: sympy.Expr, t: sympy.Symbol) -> bool:
    """Whether an expression in time has no pulse so narrow that a solver could miss it.

    Polynomials, exponentials of linear functions of time, and products of these with a few sines and cosines
    of polynomials are harmless. Polynomials and exponentials have no pulses. A sine has the same amplitude in
    every period, so a solver never finds it at rest. Every other expression may rest and then have a pulse.
    """
    harmonics = _harmonics(expression, t)
    return harmonics is not None and harmonics <= MOST_HARMONICS


@once
def _harmonics(node: sympy.Expr, t: sympy.Symbol) -> int | None:
    """Largest number of harmonics in a product; None if there are other functions."""
    if node == t or not mentions(node, (t,)):
        return 0
    if node.is_Add or node.is_Mul:
        parts = [_harmonics(part, t) for part in node.args]
        numbers = [part for part in parts if part is not None]
        if len(numbers) < len(parts):
            return None
        return sum(numbers) if node.is_Mul else max(numbers)
    if node.is_Pow and node.exp.is_Integer and node.exp.is_positive:
        factor = _harmonics(node.base, t)
        return None if factor is None else factor * int(node.exp)
    if isinstance(node, sympy.sin | sympy.cos):
        return 1 if degree_of(node.args[0], frozenset((t,))) is not None else None
    if isinstance(node, sympy.exp | sympy.sinh | sympy.cosh):
        return None if mentions(node.args[0].diff(t), (t,)) else 0
    return None
