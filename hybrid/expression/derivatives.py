"""Derivatives of expressions by the chain rule: all partial derivatives, or one along a vector.

Every node is differentiated once, with the slopes of ``hybrid.expression.operations``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from hybrid.expression.graph import contains, in_order, once, rewritten, with_arguments
from hybrid.expression.linear import LinearEquations, dot, equations_of_solution
from hybrid.expression.nodes import (
    HALF,
    MINUS_ONE,
    ONE,
    ZERO,
    Expression,
    Symbol,
    add,
    is_even_power,
    multiply,
    number,
    power,
    split,
)
from hybrid.expression.operations import (
    Cosh,
    Equal,
    Exp,
    Gate,
    Hypot,
    Log,
    Maximum,
    Select,
    Step,
    Tanh,
)
from hybrid.expression.ranges import range_of

Partials = Mapping[Symbol, Expression]
# A derivative as a sum: each argument, and the factor of its derivative.
Terms = list[tuple[Expression, Expression]]
# A length below this is zero in the slope of a length.
SMALLEST_LENGTH = number(1e-300)


def jacobian_of(expressions: Iterable[Expression], variables: Iterable[Symbol]) -> list[list[Expression]]:
    """Rows of the derivatives of ``expressions`` with respect to ``variables`` (states, then time).

    At a kink ``np.maximum`` and ``np.minimum`` have the mean of both slopes, ``np.abs`` has slope zero,
    and so has the length ``np.hypot`` at the origin. Piecewise constant functions have slope zero.
    """
    rows = partial_derivatives(expressions, list(variables))
    found = in_order(entry for row in rows for entry in row)
    if any(each.is_power and _is_over_length(*each.args) for each in found):
        rows = [[defined_at_origin(entry) for entry in row] for row in rows]
    return [[close_gates(entry) for entry in row] for row in rows]


def partial_derivatives(
    expressions: Iterable[Expression], variables: Sequence[Symbol]
) -> list[list[Expression]]:
    """Rows of the partial derivatives of ``expressions`` with respect to ``variables``."""
    rows = _partials(tuple(expressions), frozenset(variables))
    return [[row.get(each, ZERO) for each in variables] for row in rows]


def derivative(expression: Expression, variable: Symbol) -> Expression:
    """The derivative in one variable."""
    [row] = _partials((expression,), frozenset((variable,)))
    return row.get(variable, ZERO)


def divergence(field: Sequence[Expression], variables: Sequence[Symbol]) -> Expression:
    """Divergence of a field: the sum of the derivatives of each rate in its own variable, the first ones."""
    return add(*(row[i] for i, row in enumerate(partial_derivatives(field, variables))))


@once
def _partials(expressions: tuple[Expression, ...], wanted: frozenset[Symbol]) -> list[Partials]:
    """The nonzero partial derivatives of each expression."""
    mask = 0
    for each in wanted:
        mask |= each.mask
    known: dict[Expression, dict[Symbol, Expression]] = {}
    columns: dict[LinearEquations, dict[Symbol, list[Expression]]] = {}
    ordered, solutions = _with_equations(expressions)
    for node in ordered:
        solves = solutions.get(node)
        if not node.mask & mask:
            known[node] = {}
        elif isinstance(node, Symbol):
            known[node] = {node: ONE}
        elif solves is not None:
            equations, place = solves
            if equations not in columns:
                columns[equations] = _columns(equations, known)
            row = equations.elimination.row_of_inverse(place)
            sums = {v: dot(row, column) for v, column in columns[equations].items()}
            known[node] = {v: total for v, total in sums.items() if total != 0}
        else:
            known[node] = _from_arguments(node, known)
    return [known[each] for each in expressions]


def _with_equations(
    expressions: Iterable[Expression],
) -> tuple[list[Expression], dict[Expression, tuple[LinearEquations, int]]]:
    """Every node behind what its derivative is computed from, and the equations of those that solve some.

    Derivatives are solutions, too: more becomes known while they are made.
    """
    solutions: dict[Expression, tuple[LinearEquations, int]] = {}

    def inputs(node: Expression) -> Iterable[Expression]:
        found = equations_of_solution(node)
        if found is None:
            return node.args
        solutions[node] = found
        return found[0].inputs

    return in_order(expressions, inputs), solutions


def _columns(
    equations: LinearEquations, known: Mapping[Expression, dict[Symbol, Expression]]
) -> dict[Symbol, list[Expression]]:
    """What the partial derivatives of the unknowns of linear equations are solved from."""
    inputs, x = equations.inputs, equations.solution
    return {
        v: equations.column_of_derivative(x, {each: known[each].get(v, ZERO) for each in inputs}.__getitem__)
        for v in {v: None for each in inputs for v in known[each]}
    }


def _from_arguments(
    node: Expression, known: Mapping[Expression, dict[Symbol, Expression]]
) -> dict[Symbol, Expression]:
    """The partial derivatives of a node from those of its arguments."""
    if isinstance(node, Select):
        condition, one, other = node.args
        pair = known[one], known[other]
        found = {v: Select(condition, *(each.get(v, ZERO) for each in pair)) for v in {**pair[0], **pair[1]}}
        return {v: each for v, each in found.items() if each is not ZERO}
    terms: dict[Symbol, list[Expression]] = {}
    for argument, factor in _slopes(node, known):
        for v, part in known[argument].items():
            terms.setdefault(v, []).append(multiply(factor, part))
    sums = {v: add(*each) for v, each in terms.items()}
    return {v: total for v, total in sums.items() if total is not ZERO}


def _slopes(node: Expression, moving: Mapping[Expression, object]) -> Terms:
    """The arguments of a node that vary, each with the derivative of the node in it."""
    decays = _decays(node)
    if decays:
        return decays
    args = node.args
    if node.is_sum:
        return [(each, ONE) for each in args if moving[each]]
    if node.is_product:
        return [
            (each, multiply(*args[:place], *args[place + 1 :]))
            for place, each in enumerate(args)
            if moving[each]
        ]
    return [(each, _slope(node, place)) for place, each in enumerate(args) if moving[each]]


def _slope(node: Expression, place: int) -> Expression:
    """The derivative of a power or a function in one of its arguments."""
    if not node.is_power:
        return node.slope(place)
    base, exponent = node.args
    if place == 0:
        return multiply(exponent, power(base, exponent - 1))
    # A power of zero has slope zero, not 0*inf.
    positive = range_of(base).positive
    return multiply(node, Log(base if positive else Select(Equal(base, ZERO), ONE, base)))


def directional(expressions: Iterable[Expression], seeds: Mapping[Symbol, Expression]) -> list[Expression]:
    """Derivatives along a vector, with one seed per symbol; common factors stay together."""
    expressions = [*expressions]
    along: dict[Expression, Expression] = {}
    slopes: dict[LinearEquations, list[Expression]] = {}
    ordered, solutions = _with_equations(expressions)
    for node in ordered:
        solves = solutions.get(node)
        if isinstance(node, Symbol):
            along[node] = seeds.get(node, ZERO)
        elif solves is not None:
            equations, place = solves
            if equations not in slopes:
                slopes[equations] = equations.derivative(along.__getitem__)
            along[node] = slopes[equations][place]
        elif isinstance(node, Select):
            along[node] = Select(node.args[0], *(along[each] for each in node.args[1:]))
        else:
            moving = {each: None if along[each] is ZERO else each for each in node.args}
            if not any(moving.values()):
                along[node] = ZERO
                continue
            terms = _slopes(node, moving)
            along[node] = add(*(multiply(factor, along[each]) for each, factor in terms))
    return [along[each] for each in expressions]


@once
def _decays(expression: Expression) -> Terms:
    """The derivative of a negative power of exponentials in terms of their arguments; empty for the others.

    Where the exponentials overflow, the power is zero, and so is its derivative. The chain rule would divide
    one infinity by another there. Of ``1/cosh(a)``, the factor of ``a'`` is ``-tanh(a)/cosh(a)``; of
    ``1/(1 + exp(a))`` it is ``-1/(1 + exp(a))/(1 + exp(-a))``.
    """
    if not (expression.is_power and expression.exponent.is_number and expression.exponent.value < 0):
        return []
    base, factor = expression.base, expression.exponent * expression
    if isinstance(base, Cosh):
        return [(base.args[0], factor * Tanh(base.args[0]))]
    terms = [_exponential(term) for term in base.args] if base.is_sum else []
    if not terms or any(size is ZERO for size, _ in terms):
        return []
    return [
        (argument, factor / add(*(b / a * Exp(other - argument) for b, other in terms)))
        for a, argument in terms
        if argument is not ZERO
    ]


def _exponential(term: Expression) -> tuple[Expression, Expression]:
    """``a`` and ``u`` of a term ``a*exp(u)`` with a positive number ``a``; zeros of another term."""
    size, rest = split(term)
    if not size > 0 or not (rest is ONE or isinstance(rest, Exp)):
        return ZERO, ZERO
    return number(size), ZERO if rest is ONE else rest.args[0]


@once
def defined_at_origin(expression: Expression) -> Expression:
    """Make slopes of lengths zero, not 0/0, where the length is zero.

    ``u*hypot(u, w)``, a drag, has the slope ``hypot(u, w) + u*u/hypot(u, w)``, which is 0 at the origin. The
    same for roots of sums of squares.
    """
    return rewritten(expression, _with_length)


def _with_length(node: Expression, args: list[Expression]) -> Expression:
    """A node in which a length that it divides by is not zero."""
    if node.is_power and _is_over_length(*node.args):
        args[0] = Maximum(args[0], SMALLEST_LENGTH)
    return with_arguments(node, args)


def _is_over_length(base: Expression, exponent: Expression) -> bool:
    """Whether a power is one over a length; of a sum, over its root."""
    if isinstance(base, Hypot):
        return exponent is MINUS_ONE
    return exponent is -HALF and base.is_sum and all(map(_is_square, base.args))


def _is_square(term: Expression) -> bool:
    """Whether a term of a sum is an even power, or a positive multiple of one."""
    factor, rest = split(term)
    return factor > 0 and is_even_power(rest)


@once
def close_gates(expression: Expression) -> Expression:
    """Make products zero where a factor switches them off, even if another factor is infinite there.

    The slope of ``max(z, 0)**(1/4)`` is ``max(z, 0)**(-3/4)/4 * Step(z)``: 0 for ``z < 0``, never
    ``inf*0``.
    """
    return rewritten(expression, _closed) if contains(expression, (Step, Select)) else expression


def _closed(node: Expression, args: list[Expression]) -> Expression:
    """A node with closed arguments; a product itself is closed, too."""
    if node.is_product and contains(node, (Step, Select)):
        return _closed_product(args)
    return with_arguments(node, args)


def _closed_product(factors: Sequence[Expression]) -> Expression:
    product = multiply(*(factor for factor in factors if not _switches(factor)))
    for factor in factors:
        if isinstance(factor, Step) and product is not ONE:
            product = Gate(factor.args[0], product)
        elif isinstance(factor, Step):
            product = factor
        elif _switches(factor):
            condition, a, b = factor.args
            product = Select(condition, a * product, b * product)
    return product


def _switches(factor: Expression) -> bool:
    return isinstance(factor, Step) or (isinstance(factor, Select) and ZERO in factor.args[1:])
