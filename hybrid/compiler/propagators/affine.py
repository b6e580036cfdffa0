"""Affine fields with polynomial, harmonic or exponential forcing: their series, summed to rounding."""

from __future__ import annotations

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.propagators.equations import Equations
from hybrid.compiler.propagators.writing import OTHERS, groups, harmonics_of, names_of_state, write_series
from hybrid.compiler.statements.code import get
from hybrid.compiler.statements.values import Constants, assignments
from hybrid.compiler.taylor.convolutions import padded
from hybrid.compiler.taylor.linear import LinearForm, linear_form, table_statements
from hybrid.expression.nodes import Expression, Symbol
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import EXACT, WIDE


def affine(mode: Equations) -> Propagator | str:
    """The series of an affine field, exact whatever the tolerances."""
    if mode.bases or not mode.is_affine or not mode.has_elementary_forcing:
        return "it is not affine in the state with an elementary forcing"
    harmonics = harmonics_of(mode.field, mode.symbols)
    form = linear_form(mode.field, mode.guards, harmonics, mode.symbols)
    if form is None:
        written = write_series(mode.field, mode.guards, mode.symbols)
    else:
        written = _write_linear(form, harmonics, len(mode.guards), mode.symbols)
    return Propagator(EXACT, 0, "affine in the state", written, tuple(mode.held))


def _write_linear(
    form: LinearForm, harmonics: dict[Expression, Symbol], guards: int, symbols: Symbols
) -> Series:
    n, constants = len(symbols.x), Constants()
    begun = [get(f"start{i}") for i in range(len(harmonics))]
    starts = [*names_of_state(symbols)[1], *begun, 1.0]
    lines, vectors, table, tangents = table_statements(form, n, constants, starts)
    shared = [*constants.statements(), *assignments(begun, list(harmonics)), *lines]
    front = padded(n + guards + OTHERS, WIDE)
    return Series(tuple(shared), (groups(n), *shared, *vectors), front, table, tangents)
