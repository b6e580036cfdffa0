"""Affine fields whose solutions are polynomials in time: one step is a whole flight."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy

from hybrid.compiler.emitted import Propagator
from hybrid.compiler.propagators.equations import ELEMENTARY, Equations, columns_of_guards
from hybrid.compiler.propagators.writing import write_series
from hybrid.kernels.types.codes import EXACT, HIGHEST_ORDER
from hybrid.symbolic.derivatives import partial_derivatives
from hybrid.symbolic.nodes import contains, degree_of, mentions, replaced, symbols_of
from hybrid.symbolic.tracing import Symbols

# Matrices are scaled up by at most the inverse of this.
SMALLEST = 1e-300
# Powers of a scaled matrix below this are zero but for rounding.
VANISHED = 1e-13


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


def _polynomial(guard: sympy.Expr, symbols: Symbols) -> int:
    """Degree of a guard that is a polynomial in state and time, at least 1; zero for any other."""
    degree = degree_of(guard, frozenset(symbols.variables))
    return 0 if degree is None else max(1, degree)


def _degree(field: Sequence[sympy.Expr], jacobian: Sequence[Sequence[sympy.Expr]], symbols: Symbols) -> int:
    """Degree of the solutions in time if they are polynomials, else 0."""
    if any(contains(entry, ELEMENTARY) and mentions(entry, (symbols.t,)) for entry in field):
        return 0
    if not _may_be_nilpotent(jacobian):
        return 0
    # x^(k + 1) = J x^(k) + d^k f/dt^k
    rate, forcing = list(field), list(field)
    for degree in range(1, 2 * len(field) + 4):
        forcing = [row[0] for row in partial_derivatives(forcing, [symbols.t])]
        rate = [
            (push + sympy.Add(*(a * r for a, r in zip(row, rate, strict=True)))).expand()
            for row, push in zip(jacobian, forcing, strict=True)
        ]
        if all(entry == 0 for entry in rate):
            return degree
    return 0


def _may_be_nilpotent(matrix: Sequence[Sequence[sympy.Expr]]) -> bool:
    """Whether a matrix of parameters may be nilpotent, tested at one random set of values."""
    names = sorted({name for row in matrix for entry in row for name in symbols_of(entry)}, key=str)
    drawn = np.random.default_rng(1).uniform(1.0, 2.0, len(names))
    values = dict(zip(names, map(sympy.Float, drawn), strict=True))
    try:
        numbers = np.array([[float(replaced(entry, values)) for entry in row] for row in matrix])
    except (TypeError, ValueError):
        return True
    scaled = numbers / max(np.abs(numbers).max(), SMALLEST)
    power = np.linalg.matrix_power(scaled, len(matrix))
    return not np.abs(power).max() > VANISHED
