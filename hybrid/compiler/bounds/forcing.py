"""Parts of a vector field that could hide a pulse from a solver, in time alone or in the state.

A component of the state that grows at a constant rate, such as the phase of an oscillator, tells the time as
well, and so does one that only resets change.

A solver evaluates a field only at certain points: at the stages of a step, or at its start for the series. A
pulse that is narrower than the step can lie between them. Interval arithmetic on the expression of the pulse
detects it, as it detects the crossings of a guard.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs

from hybrid.compiler.taylor.roots import is_multiple
from hybrid.expression.continuity import ROUNDING
from hybrid.expression.graph import (
    Group,
    degree_of,
    factors_of,
    is_negative,
    is_positive,
    is_whole,
    mentions,
    nodes,
    nodes_of,
    once,
    terms_of,
)
from hybrid.expression.nodes import ZERO, Expression, Power, Symbol, add, number
from hybrid.expression.operations import (
    Absolute,
    Arccos,
    Arccosh,
    Arcsin,
    Arctan,
    Cos,
    Cosh,
    Equal,
    Exp,
    Exp2,
    Expm1,
    Floor,
    Less,
    LessEqual,
    Log,
    Maximum,
    Minimum,
    Remainder,
    Several,
    Sign,
    Sin,
    Sinh,
    Step,
    Tanh,
    Truncate,
    TruncatedRemainder,
)
from hybrid.expression.signs import simplified
from hybrid.expression.tabulated import Tabulated, has_knots_in_time
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import ARGUMENTS, IN_TIME, TERMS

# Products of more factors that vary than these, such as ``(1 - t**2)**100``, are narrow pulses.
MOST_FACTORS = 8
# Near its largest value a sine or cosine is a parabola, so it counts as two factors.
FACTORS_OF_HARMONIC = 2
# Used instead of a component of the state if the forcing is not simply a term of the component's rate.
NO_COMPONENT = -1
# Functions that are flat to all digits if their argument is far from zero, on one side at least.
EXPONENTIAL = (Exp, Tanh, Sinh, Cosh, Expm1, Exp2)
# Beyond this argument a hyperbolic tangent is constant to all digits.
FLAT = 20.0
# Functions that are constant but for jumps.
JUMPS = (Sign, Step, Less, LessEqual, Equal, *ROUNDING)
# The difference of both sides of a kink or jump, in the place of the change of an argument.
APART = 16
# Terms that fall like this power of the distance from a pulse, or more slowly, are seen from afar.
MOST_FALL = 2.0
# Functions that may be flat to all digits and change a little further on.
SATURATING = (*EXPONENTIAL, Arctan)
# Functions with a branch point, beyond which their series goes on: that of ``arcsin(sin(q))`` is ``q``.
BRANCHING = (Arcsin, Arccos, Arccosh)
# A sum counts as a factor. A single exponential does not, since it makes no product narrower.
SUMS_OF_EXPONENTIALS = (Sinh, Cosh, Expm1)


@attrs.frozen
class Forcing:
    """An expression that may have pulses, and the component with this term in its rate or NO_COMPONENT.

    It depends on times and parameters alone, or is of a ``kind`` in the state, which may be without one: the
    series is compared with a field that saturates.
    """

    expression: Expression | None
    component: int
    kind: int = IN_TIME


@attrs.frozen
class Times:
    """What tells the time in a mode.

    Attributes
    ----------
    passing
        Time, and the components of the state whose rate is a constant other than zero.
    all
        These, and the components that stay as they are.
    state
        The other components.
    """

    passing: Group
    all: Group
    state: Group


def times_of(field: Sequence[Expression], symbols: Symbols) -> Times:
    """The components of the state that tell the time in the mode of a field, and the others."""
    constant = [not mentions(rate, symbols.variables) for rate in field]
    clocks = [x for x, same in zip(symbols.x, constant, strict=True) if same]
    passing = [x for x, rate in zip(symbols.x, field, strict=True) if x in clocks and rate is not ZERO]
    state = Group(x for x, same in zip(symbols.x, constant, strict=True) if not same)
    return Times(Group((symbols.t, *passing)), Group((symbols.t, *clocks)), state)


def forcings(
    field: Sequence[Expression] | None, known: Sequence[Expression], symbols: Symbols
) -> tuple[Forcing, ...]:
    """The largest parts of a field in times and parameters alone, and terms that may be pulses in the state.

    Those in times alone are without their harmless terms.

    Empty for a field that was not traced. ``known`` are guards that are positive in the mode. Its series hold
    the roots of guards.
    """
    if field is None:
        return ()
    roots = frozenset(
        power
        for power in nodes_of(Power, *field)
        if not is_whole(power.exponent)
        and mentions(power.base, symbols.x)
        and any(is_multiple(simplified(power.base, known), guard, symbols) for guard in known)
    )
    times = times_of(field, symbols)
    found = dict.fromkeys(each for i, entry in enumerate(field) for each in _parts(entry, i, times))
    arguments, *terms = _in_state(field, known, times, symbols)
    saturates = any(_saturates(entry, symbols.variables, roots) for entry in field)
    if terms or (saturates and not found):
        found.update(dict.fromkeys([arguments, *terms]))
    return tuple(found)


def _in_state(
    field: Sequence[Expression], known: Sequence[Expression], times: Times, symbols: Symbols
) -> Iterator[Forcing]:
    """The terms of a field that may be pulses in the state, behind the arguments that tell where."""
    terms: list[list[Expression]] = []
    arguments = dict[Expression, None]()
    for entry in field:
        terms.append([])
        for term in terms_of(simplified(entry, known)):
            if not mentions(term, times.state) or is_harmless(term, symbols.variables):
                continue
            found = arguments_of(term, symbols.x)
            arguments.update(dict.fromkeys(found))
            terms[-1] += [term] if found else []
    yield Forcing(Several(*arguments) if arguments else None, NO_COMPONENT, ARGUMENTS)
    for i, own in enumerate(terms):
        if own:
            yield Forcing(add(*own), i, TERMS)


def arguments_of(expression: Expression, variables: tuple[Symbol, ...]) -> list[Expression]:
    """What changes by more than 8 on each step on which a part of an expression may be flat and then change.

    These are the arguments of exponentials, the logarithms of powers, and the sides of kinks and jumps.
    """
    found = [
        argument
        for node in nodes(expression)
        if mentions(node, variables)
        for argument in _own_arguments(node, variables)
    ]
    found += _logarithms(expression, variables)
    return [each for each in dict.fromkeys(found) if mentions(each, variables)]


def _own_arguments(node: Expression, variables: tuple[Symbol, ...]) -> Iterator[Expression]:
    """The arguments of one node, if it is an exponential, a kink or a jump."""
    if isinstance(node, Tabulated):
        yield APART * node.number_of_piece
    elif isinstance(node, Tanh):
        # Far from its switch it is a constant, however much its argument changes.
        yield Maximum(Minimum(node.args[0], number(FLAT)), number(-FLAT))
    elif isinstance(node, EXPONENTIAL):
        yield node.args[0]
    elif node.is_power and mentions(node.exponent, variables):
        yield node.exponent * Log(node.base)
    elif isinstance(node, JUMPS):
        yield APART * node
    elif isinstance(node, Absolute):
        yield APART * Sign(node.args[0])
    elif isinstance(node, Maximum | Minimum):
        yield APART * Sign(node.args[0] - node.args[1])
    elif isinstance(node, Remainder):
        yield APART * Floor(node.args[0] / node.args[1])
    elif isinstance(node, TruncatedRemainder):
        yield APART * Truncate(node.args[0] / node.args[1])


def _logarithms(expression: Expression, variables: tuple[Symbol, ...]) -> Iterator[Expression]:
    """Logarithms of powers that are high, or that fall so fast that no solver sees their tails from afar.

    The tails of a term that falls like ``z**-2``, as gravity does, show wherever the pulse itself matters.
    """
    # Not by recursion: parts that are shared would be visited once for each way that leads to them.
    seen, waiting = set[Expression](), [expression]
    while waiting:
        node = waiting.pop()
        if node in seen or not mentions(node, variables):
            continue
        seen.add(node)
        factors = factors_of(node)
        falls = sum(_growth(each, variables) for each in factors) < -MOST_FALL
        for factor in factors:
            if not factor.is_power or mentions(factor.exponent, variables):
                waiting.extend(factor.args)
                continue
            high = not factor.exponent.is_number or abs(factor.exponent.value) > MOST_FACTORS
            if mentions(factor.base, variables) and (high or (falls and is_negative(factor.exponent))):
                yield factor.exponent * Log(Absolute(factor.base))
            waiting.append(factor.base)


@once
def _growth(node: Expression, variables: tuple[Symbol, ...]) -> float:
    """The power of the distance with which an expression grows, or falls, near a place where it is large.

    A sine is the distance from its zero there.
    """
    if not mentions(node, variables):
        return 0.0
    if node.is_product:
        return sum(_growth(each, variables) for each in node.args)
    if node.is_sum:
        return max(_growth(each, variables) for each in node.args)
    if node.is_power and node.exponent.is_number:
        return float(node.exponent) * _growth(node.base, variables)
    if isinstance(node, Absolute | Maximum | Minimum):
        return max(_growth(each, variables) for each in node.args)
    return 1.0


@once
def _saturates(node: Expression, variables: tuple[Symbol, ...], roots: frozenset[Expression]) -> bool:
    """Whether an expression may change where its series is flat to all digits.

    ``tanh(v/1e-4)`` is, but for ``v`` close to 0, and so are ``x/sqrt(x**2 + 1e-16)``, ``(x/5)**40`` for
    small ``x``, and ``exp(9*(t - 50))`` long before ``t = 50``. The triangle wave ``arcsin(sin(x))`` is all
    but straight. Roots and arcs of affine expressions are not: at their branch points the field is singular.
    Nor are quotients of polynomials of low degree: their series shows poles that are not far closer to the
    orbit than the tolerance.
    """
    if not mentions(node, variables):
        return False
    if isinstance(node, SATURATING):
        return True
    own = frozenset(variables)
    if node.is_product or node.is_power:
        degree = degree_of(node, own)
        if degree is not None and degree > MOST_FACTORS:
            return True
    if node.is_power and (
        mentions(node.exponent, variables)
        or (is_whole(node.exponent) and abs(node.exponent.value) > MOST_FACTORS)
    ):
        return True
    if isinstance(node, BRANCHING) or (node.is_power and not is_whole(node.exponent) and node not in roots):
        base = node.args[0]
        bases = base.args if isinstance(base, Maximum | Absolute) else (base,)
        degrees = [degree_of(base, own) for base in bases]
        if any(degree is None or degree > 1 for degree in degrees):
            return True
    return any(_saturates(part, variables, roots) for part in node.args)


@once
def _parts(node: Expression, component: int, times: Times) -> tuple[Forcing, ...]:
    return tuple(dict.fromkeys(_found_parts(node, component, times)))


def _found_parts(node: Expression, component: int, times: Times) -> Iterator[Forcing]:
    if not mentions(node, times.passing):
        return
    own, others = [node], []
    if node.is_sum or (node.is_product and mentions(node, times.state)):
        own = [
            part for part in node.args if mentions(part, times.passing) and not mentions(part, times.state)
        ]
        others = [part for part in node.args if mentions(part, times.state)]
    elif mentions(node, times.state):
        own, others = [], [*node.args]
    if node.is_sum:
        own = [part for part in own if not is_harmless(part, times.all)]
    whole = node.rebuilt(own) if len(own) > 1 else own[0] if own else ZERO
    within = component if node.is_sum or not others else NO_COMPONENT
    if not is_harmless(whole, times.all):
        yield Forcing(whole, within)
    for other in others:
        yield from _parts(other, within, times)


def is_harmless(expression: Expression, times: tuple[Symbol, ...]) -> bool:
    """Whether an expression in times has no pulse so narrow that a solver could miss it.

    Sums of products of a few factors are harmless, where a factor is linear in the times, and a sine or
    cosine of a polynomial counts as two per degree. Exponentials of linear functions are harmless, too. Such
    functions are not small on most of a step and large elsewhere, unless they grow exponentially. Every other
    expression may rest and then have a pulse.
    """
    factors = _factors(expression, times)
    return factors is not None and factors <= MOST_FACTORS


@once
def _factors(node: Expression, times: tuple[Symbol, ...]) -> int | None:
    """Number of factors of a product that vary, the most in any term of a sum; None for other functions."""
    if not mentions(node, times):
        return 0
    if node in times:
        return 1
    if node.is_sum or node.is_product:
        parts = [_factors(part, times) for part in node.args]
        numbers = [part for part in parts if part is not None]
        if len(numbers) < len(parts):
            return None
        return sum(numbers) if not node.is_sum else max(1, *numbers)
    if node.is_power and is_whole(node.exponent) and is_positive(node.exponent):
        factors = _factors(node.base, times)
        return None if factors is None else factors * node.exponent.value
    if node.is_power and mentions(node.base, times):
        return None
    if isinstance(node, Tabulated):
        # Its knots end steps.
        return node.pieces.degree if has_knots_in_time(node) else None
    # The degree is that of a polynomial: a zero derivative would not prove that the argument has no jumps.
    degree = degree_of(node.exponent if node.is_power else node.args[0], frozenset(times))
    if degree is None:
        return None
    if isinstance(node, Sin | Cos):
        return FACTORS_OF_HARMONIC * degree
    if isinstance(node, Exp | Exp2 | Power) and degree == 1:
        return 0
    return 1 if isinstance(node, SUMS_OF_EXPONENTIALS) and degree == 1 else None
