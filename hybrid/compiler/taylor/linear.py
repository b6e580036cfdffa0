"""Series of modes that are linear in the state and in harmonic forcing, from a table.

Let ``y = (x, h, 1)``, where ``h`` are the sines, cosines and exponentials that drive the mode. Then the mode
is ``y' = M y`` with a constant matrix ``M``, and its Taylor coefficients are ``M^o / o!`` times ``y`` at the
start of a step. The matrices ``M^o / o!`` are computed once per run, as sums of two floats, so that each is
accurate to its own rounding. After that, no order depends on the one before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs

from hybrid.compiler.statements.code import (
    Code,
    Statement,
    at,
    call,
    do,
    either,
    equal,
    get,
    loop,
    put,
    several,
    when,
)
from hybrid.compiler.statements.values import Constants
from hybrid.compiler.taylor.coefficients import ORDER, OUT, o
from hybrid.compiler.taylor.convolutions import padded
from hybrid.compiler.taylor.loops import GROUPS, TABLE, VECTORS
from hybrid.expression.derivatives import partial_derivatives
from hybrid.expression.graph import degree_of, mentions, replaced
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol, add
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import NARROW

# A larger table does not fit into the fastest memory, and products with it cost more than recurrences.
LARGEST = 16


@attrs.frozen
class LinearForm:
    """``y' = M y`` and guards ``C y`` of ``y = (x, h, 1)``.

    Attributes
    ----------
    starts
        ``y`` at time ``t``.
    rates
        The rows of ``M``, functions of the parameters.
    guards
        The rows of ``C``.
    """

    starts: list[Expression]
    rates: list[list[Expression]]
    guards: list[list[Expression]]

    def trace(self, n: int) -> Expression:
        """Divergence of the vector field."""
        return add(*(self.rates[i][i] for i in range(n)))


def linear_form(
    field: Sequence[Expression],
    guards: Sequence[Expression],
    harmonics: dict[Expression, Symbol],
    symbols: Symbols,
) -> LinearForm | None:
    """The linear form of an affine mode, if it has one; ``harmonics`` are the functions that drive it."""
    variables = [*symbols.x, *harmonics.values()]
    if len(variables) >= LARGEST:
        return None
    turning = [row[0] for row in partial_derivatives(harmonics, [symbols.t])]
    rows = [_row(replaced(entry, harmonics), variables, symbols.t) for entry in (*field, *turning, *guards)]
    if any(row is None for row in rows):
        return None
    starts = [*symbols.x, *harmonics, ONE]
    whole = [row for row in rows if row is not None]
    one = [ZERO] * len(starts)
    return LinearForm(starts, [*whole[: len(variables)], one], whole[len(variables) :])


def _row(entry: Expression, variables: Sequence[Symbol], time: Symbol) -> list[Expression] | None:
    """Coefficients of the variables, then the constant term; None if not affine in them alone."""
    # Derivatives alone do not tell: the derivative of a sign is zero too.
    if degree_of(entry, frozenset(variables)) is None:
        return None
    [slopes] = partial_derivatives([entry], variables)
    rest = replaced(entry, dict.fromkeys(variables, ZERO))
    if any(mentions(each, (time, *variables)) for each in (*slopes, rest)):
        return None
    return [*slopes, rest]


def table_statements(
    form: LinearForm, n: int, constants: Constants, starts: Sequence[Any]
) -> tuple[list[Statement], list[Statement], int, int]:
    """Statements for the series and for tangent vectors, and numbers of columns.

    The two numbers are the columns of the table and of four tangent vectors. In the statements, ``table`` and
    ``vectors`` are the first columns of the two. ``starts`` is ``y`` at the start of a step.
    """
    size, guards = len(form.starts), len(form.guards)
    front, one = padded(n + guards + 2), size - 1
    zs, ls, ms = ([get(f"{name}{i}") for i in range(size)] for name in "zlm")
    nothing, held, flag = get("nothing"), get("held"), at("out", ORDER + 2, TABLE)
    begin = [put(nothing, call("four_times", 0.0))]
    for i in range(size):
        unit = several([either(equal(get("c") + lane, i), 1.0, 0.0) for lane in range(NARROW)])
        begin.append(do("store_row", OUT, ORDER + 2, TABLE, unit))
        begin += [put(zs[i], call("load", OUT, ORDER + 2, TABLE)), put(ls[i], nothing)]
    write = [_entry(zs[i], i, front) for i in range(n)]
    for i, row in enumerate(form.guards):
        write += [put(several([held, get("_")]), _product(row, 1.0, constants)), _entry(held, n + i, front)]
    write += [_entry(nothing, i, front) for i in range(n + guards, front)]
    rs = [get(f"r{i}") for i in range(one)]
    step = [put(several([rs[i], ms[i]]), _product(form.rates[i], o + 1.0, constants)) for i in range(one)]
    for i in range(one):
        step += [put(zs[i], rs[i]), put(ls[i], ms[i])]
    step += [put(zs[one], nothing), put(ls[one], nothing)]
    columns = [*begin, loop("o", 0, ORDER + 1, [*write, *step])]
    trace = put(at("out", 1, TABLE + (one * front + n + guards + 1)), constants.name(form.trace(n)))
    statements = [
        # The table depends only on parameters, which do not change during a run.
        when(call("!=", flag, 1.0), [loop("c", 0, size, columns, step=NARROW), trace, put(flag, 1.0)]),
        do("combine", OUT, ORDER, TABLE, front, several(starts)),
    ]
    here = VECTORS + get("g") * (NARROW * n)
    vectors = [
        do("spread_tangents", get("x"), n, OUT, VECTORS, NARROW * n),
        loop("g", 0, GROUPS, [do("combine_tangents", OUT, ORDER, TABLE, front, here, n)]),
    ]
    return statements, vectors, padded(size) * front, NARROW * n


def _entry(value: Code, place: int, front: int) -> Statement:
    return do("store_down", OUT, o, TABLE + get("c") * front + place, front, value)


def _product(row: Sequence[Expression], by: Any, constants: Constants) -> Code:
    """The product of a row with ``z``, divided by ``by``, as a sum of two floats."""
    places = [i for i, entry in enumerate(row) if entry != 0]
    if not places:
        return several([get("nothing"), get("nothing")])
    factors = several([constants.name(row[i]) for i in places])
    highs, lows = (several([get(f"{name}{i}") for i in places]) for name in "zl")
    return call("divided_dot_product", factors, highs, lows, by)
