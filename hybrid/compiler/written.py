"""The statements of model functions, with what is known of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any

import attrs

from hybrid.compiler.jacobians import cells, place_of
from hybrid.compiler.propagators.equations import Boundary, known_positive
from hybrid.compiler.statements.code import Code, Statement, Term, at, call, get, loop, put
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.roots import is_multiple
from hybrid.expression.graph import all_replaced, is_negative, is_positive, is_whole, mentions, nodes_of
from hybrid.expression.nodes import ZERO, Expression, Power, power
from hybrid.expression.operations import CubeRoot, Less, Maximum, Select
from hybrid.expression.polynomials import ratio
from hybrid.expression.signs import simplified
from hybrid.expression.tracing import Symbols


@attrs.frozen
class Written:
    """Statements for a function and its derivative, but for cells that are proved zero.

    ``expressions`` and ``jacobian`` are the expressions behind them if it was traced. Those of a guard may be
    its ``plain`` form (`hybrid.expression.plain`), which has the same sign.
    """

    value: list[Statement]
    derivative: list[Statement]
    expressions: list[Expression] | None = None
    jacobian: list[list[Expression]] | None = None
    given: bool = False
    plain: bool = False


def called(target: str, name: str, *arguments: Term) -> Statement:
    """The statement that calls a function of the user."""
    return put(get(target), call(name, *map(get, ("t", "x", "p")), *arguments))


def item(name: str, place: int) -> Code:
    """One of the numbers that a function of the user has returned."""
    return call("item", get(name), place)


def beyond_guards(field: Written, boundaries: Sequence[Boundary], symbols: Symbols) -> Written:
    """The field of a mode, with roots of its guards that are zero beyond the guard.

    Inside the mode nothing changes. Where the mode begins and ends, rounding leaves the state on either side
    of the guard: there ``(-x.q)**1.5`` is no number, but ``np.maximum(-x.q, 0)**1.5`` is. The slope of a root
    is zero there too, although that inside the mode may grow without limit towards the guard.
    """
    if field.expressions is None or field.jacobian is None:
        return field
    known, entries = known_positive(boundaries), [entry for row in field.jacobian for entry in row]
    roots = _roots_inside(field.expressions, known, symbols)
    slopes = _slopes_inside(entries, known, symbols)
    if not roots and not slopes:
        return field
    slopes = _roots_inside(entries, known, symbols) | slopes
    n, derivative, expressions = len(symbols.x), field.derivative, all_replaced(field.expressions, roots)
    flat = all_replaced(entries, slopes)
    jacobian = [flat[i * (n + 1) : (i + 1) * (n + 1)] for i in range(n)]
    if not field.given:
        derivative = cells(jacobian, place_of(n))
    value = assignments([at("out", i) for i in range(n)], expressions)
    return Written(value, derivative, expressions, jacobian, field.given)


def _roots_inside(
    expressions: Sequence[Expression], known: Sequence[Expression], symbols: Symbols
) -> dict[Expression, Expression]:
    """Fractional powers of what is never negative in the mode, and what takes their place."""
    found = {}
    for root in nodes_of(Power, *expressions):
        base, exponent = root.args
        if is_whole(exponent) or not mentions(base, symbols.variables):
            continue
        for guard in known:
            factor = ratio(base, guard, symbols.variables)
            if factor is None:
                continue
            extended = Maximum(base, ZERO)
            if not factor.is_number:
                # With a negative factor the root has no value inside the mode, which must show.
                extended = Select(Less(ZERO, factor), extended, base)
            if not is_negative(factor):
                found[root] = power(extended, exponent)
            break
    return found


def _slopes_inside(
    entries: Sequence[Expression], known: Sequence[Expression], symbols: Symbols
) -> dict[Expression, Expression]:
    """Powers of the guards that may be infinite there, and what takes their place: zero at the guard."""
    found: dict[Expression, Expression] = {}
    for each in nodes_of(Power, *entries):
        if is_positive(each.exponent) or not mentions(each.base, symbols.variables):
            continue
        base = each.base.args[0] if isinstance(each.base, CubeRoot) else each.base
        base = simplified(base, known)
        if any(is_multiple(base, guard, symbols) for guard in known):
            found[each] = Select(Less(ZERO, base), each, ZERO)
    return found


def variational(field: Written, n: int) -> list[Statement]:
    """Statements for the field and its Jacobian times any number of tangent vectors, in one pass.

    Entries that are proved zero cost nothing, and what field and Jacobian share is computed once.
    """
    if field.expressions is None or field.jacobian is None or field.given:
        statements = [*field.value, *(("set", _entry_of(place), term) for _, place, term in field.derivative)]
        known: dict[Any, Term] = {
            each[2:]: _entry(*each[2:]) for _, each, _ in field.derivative if each[0] == "at"
        }
    else:
        rows = [(i, j, entry) for i, row in enumerate(field.jacobian) for j, entry in enumerate(row[:n])]
        rows = [(i, j, entry) for i, j, entry in rows if entry is not ZERO]
        known = {(i, j): float(entry) if entry.is_number else _entry(i, j) for i, j, entry in rows}
        moving = [(i, j, entry) for i, j, entry in rows if not entry.is_number]
        targets = [*(at("out", i) for i in range(n)), *(_entry(i, j) for i, j, _ in moving)]
        statements = assignments(targets, [*field.expressions, *(entry for _, _, entry in moving)])
    by_row: list[list[Term]] = [[] for _ in range(n)]
    for i, j in sorted(known):
        if j < n:
            by_row[i].append(known[i, j] * at("x", get("v") + j))
    moved = [put(at("out", get("v") + i), _added(terms)) for i, terms in enumerate(by_row)]
    trace = _added([known[i, i] for i in range(n) if (i, i) in known])
    length = call("length", "x")
    return [*statements, loop("v", n, length, moved, step=n), put(at("out", length), trace)]


def _entry(i: int, j: int) -> Code:
    """The local variable for an entry of the Jacobian."""
    return get(f"a{i}_{j}")


def _entry_of(place: Code) -> Code:
    """The local variable in the place of a cell of ``out``; other places as they are."""
    return _entry(*place[2:]) if place[:2] == ("at", "out") else place


def _added(terms: Sequence[Term]) -> Term:
    return reduce(add, terms) if terms else 0.0
