"""Affine fields whose solutions are polynomials in time: one step is a whole flight."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.compiler.emitted import Propagator
from hybrid.compiler.propagators.equations import Equations, columns_of_guards
from hybrid.compiler.propagators.writing import write_series
from hybrid.expression.graph import degree_of, replaced
from hybrid.expression.nodes import ZERO, Expression, Symbol
from hybrid.expression.tabulated import tables_of_time
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import EXACT, HIGHEST_ORDER


def polynomial(mode: Equations) -> Propagator | str:
    """Solutions that are polynomials in time, exact in one step of any length."""
    if mode.bases or not mode.is_affine or not mode.has_elementary_forcing:
        return "it is not affine in the state with an elementary forcing"
    of_state = _degree(mode.field, mode.jacobian, mode.symbols)
    if not 0 < of_state <= HIGHEST_ORDER:
        return "its solutions are no polynomials in time"
    # A quadratic guard is a polynomial in time here. Flat roots of higher ones are lost in rounding.
    powers = [0 if b.guard is None else _polynomial(b.guard, mode.symbols) for b in mode.boundaries]
    held = [0 < power <= 2 and of_state * power <= HIGHEST_ORDER for power in powers]
    degree = of_state * max([1, *(power for power, is_held in zip(powers, held, strict=True) if is_held)])
    written = write_series(mode.field, columns_of_guards(mode.boundaries, held), mode.symbols)
    return Propagator(EXACT, degree, f"polynomials of degree {degree}", written, tuple(held))


def _polynomial(guard: Expression, symbols: Symbols) -> int:
    """Degree of a guard that is a polynomial in state and time, at least 1; zero for any other."""
    degree = degree_of(guard, frozenset(symbols.variables))
    return 0 if degree is None else max(1, degree)


def _with_powers(entry: Expression, t: Symbol) -> Expression:
    """An expression with powers of time for the tables that are polynomials of time on each step."""
    return replaced(entry, {each: t ** (each.pieces.degree - each.derived) for each in tables_of_time(entry)})


def _degree(field: Sequence[Expression], jacobian: Sequence[Sequence[Expression]], symbols: Symbols) -> int:
    """Degree of the solutions in time if no component acts back on itself, else 0.

    Then each rate is the integral of forcing and of components that come before it. A matrix whose entries
    cancel may be nilpotent without that; its series is exact, too.
    """
    clock = frozenset({symbols.t})
    forcing = [degree_of(_with_powers(entry, symbols.t), clock) for entry in field]
    # Components are done once all that act on them are done.
    acts_on: list[list[int]] = [[] for _ in field]
    waiting = []
    for i, row in enumerate(jacobian):
        sources = [j for j, entry in enumerate(row) if entry is not ZERO]
        waiting.append(len(sources))
        for j in sources:
            acts_on[j].append(i)
    degrees = [0 if entry is ZERO else 1 + (known or 0) for entry, known in zip(field, forcing, strict=True)]
    ready = [i for i, count in enumerate(waiting) if count == 0]
    for j in ready:
        for i in acts_on[j]:
            degrees[i] = max(degrees[i], degrees[j] + 1)
            waiting[i] -= 1
            if waiting[i] == 0:
                ready.append(i)
    return max(1, *degrees) if len(ready) == len(field) and None not in forcing else 0
