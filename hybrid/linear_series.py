"""Series of modes that are linear in the state and in harmonic forcing, from a table.

With ``y = (x, h, 1)``, ``h`` the sines, cosines and exponentials that drive it, such a mode is ``y' = M y``
with a constant matrix, and its Taylor coefficients are ``M^o / o!`` times what a step starts from. These
matrices are computed once a run: after that no order waits for the one before it.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import sympy

from hybrid.constants import Constants
from hybrid.kernels.codes import NARROW
from hybrid.series_loops import indented, padded
from hybrid.trace import Symbols

# Beyond this a table is larger than the fastest memory, and products with it cost more than recurrences.
LARGEST = 16


@attrs.frozen
class LinearForm:
    """``y' = M y`` and guards ``C y`` of ``y = (x, h, 1)``.

    Attributes
    ----------
    starts
        What ``y`` is at the time ``t``.
    rates
        The rows of ``M``, in the parameters.
    guards
        The rows of ``C``.
    """

    starts: list[sympy.Expr]
    rates: list[list[sympy.Expr]]
    guards: list[list[sympy.Expr]]

    def trace(self, n: int) -> sympy.Expr:
        """Divergence of the field."""
        return sympy.Add(*(self.rates[i][i] for i in range(n)))


def linear_form(
    field: Sequence[sympy.Expr],
    guards: Sequence[sympy.Expr],
    harmonics: dict[sympy.Expr, sympy.Symbol],
    symbols: Symbols,
) -> LinearForm | None:
    """The linear form of an affine mode, if it has one; ``harmonics`` stand for what it is driven by."""
    variables = [*symbols.x, *harmonics.values()]
    turning = [function.diff(symbols.t) for function in harmonics]
    rows = [_row(entry.xreplace(harmonics), variables, symbols.t) for entry in (*field, *turning, *guards)]
    if len(variables) >= LARGEST or any(row is None for row in rows):
        return None
    starts = [*symbols.x, *harmonics, sympy.Integer(1)]
    whole = [row for row in rows if row is not None]
    one = [sympy.Integer(0)] * len(starts)
    return LinearForm(starts, [*whole[: len(variables)], one], whole[len(variables) :])


def _row(entry: sympy.Expr, variables: Sequence[sympy.Symbol], time: sympy.Symbol) -> list[sympy.Expr] | None:
    """Coefficients of the variables, then the constant term; None if it is not affine in them alone."""
    # The derivative of a sign is zero too.
    if not entry.is_polynomial(*variables):
        return None
    slopes = [entry.diff(variable) for variable in variables]
    rest = entry.xreplace(dict.fromkeys(variables, sympy.Integer(0)))
    if any(each.has(time, *variables) for each in (*slopes, rest)):
        return None
    return [*slopes, rest]


def table_statements(
    form: LinearForm, n: int, constants: Constants, starts: Sequence[str]
) -> tuple[list[str], int, int]:
    """Statements for the series, the columns of their table, and those that four tangent vectors need.

    ``table`` and ``vectors`` are the first columns of both, ``starts`` what ``y`` starts from.
    """
    size, guards = len(form.starts), len(form.guards)
    front = padded(n + guards + 2)
    unknown = range(size - 1)
    entries = [f"z{i}" for i in range(n)] + [_sum(row, constants) for row in form.guards] + ["0.0"]
    entries += [f"{constants.name(form.trace(n))} if o == 1 and c == {size - 1} else 0.0"]
    entries += ["0.0"] * (front - len(entries))
    step = [f"r{i} = {_sum(form.rates[i], constants)}" for i in unknown]
    lines = [
        # What the table was made of does not change in a run.
        "if out[order + 2, table] != 1.0:",
        f"    for c in range({size}):",
        *indented(indented(f"z{i} = 1.0 if c == {i} else 0.0" for i in range(size))),
        "        for o in range(order + 1):",
        *indented(
            indented(
                indented(
                    [
                        *(f"out[o, table + c*{front} + {i}] = {entry}" for i, entry in enumerate(entries)),
                        "later = 1.0/(o + 1)",
                        *step,
                        *(f"z{i} = later*r{i}" for i in unknown),
                        f"z{size - 1} = 0.0",
                    ]
                )
            )
        ),
        "    out[order + 2, table] = 1.0",
        f"combine(out, order, table, {front}, ({', '.join(starts)},))",
        f"spread_tangents(x, {n}, out, vectors, {NARROW * n})",
        "for g in range(groups):",
        f"    combine_tangents(out, order, table, {front}, vectors + g*{NARROW * n}, {n})",
    ]
    return lines, size * front, NARROW * n


def _sum(row: Sequence[sympy.Expr], constants: Constants) -> str:
    terms = [f"{constants.name(each)}*z{i}" for i, each in enumerate(row) if each != 0]
    return " + ".join(terms) or "0.0"
