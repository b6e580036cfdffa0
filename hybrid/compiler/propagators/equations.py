"""The equations of a mode as propagators need them: field, guards, and the guards whose roots the field has.

What a guard says of the states inside its mode is used: where ``x1 - x2 >= 0`` in the whole mode,
``max(x1 - x2, 0)`` is ``x1 - x2`` there.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import attrs

from hybrid.compiler.taylor.roots import is_multiple, singular_bases, with_fractions
from hybrid.expression.derivatives import derivative, partial_derivatives
from hybrid.expression.graph import is_positive, is_whole, mentions, nodes, replaced
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol
from hybrid.expression.operations import Cos, Cosh, Exp, Sin, Sinh
from hybrid.expression.signs import sign_of, simplified
from hybrid.expression.tabulated import tables_of_time
from hybrid.expression.tracing import Symbols

ELEMENTARY = (Sin, Cos, Exp, Sinh, Cosh)


@attrs.frozen
class Boundary:
    """A guard of a mode: its expression, and its sign inside the mode if the mode ends there, else 0."""

    guard: Expression | None
    inside: int
    is_affine: bool = False


def known_positive(boundaries: Iterable[Boundary]) -> list[Expression]:
    """Expressions that are positive or zero in the whole mode, because the mode ends at its guards."""
    return [b.guard if b.inside > 0 else -b.guard for b in boundaries if b.inside and b.guard is not None]


def columns_of_guards(boundaries: Sequence[Boundary], held: Sequence[bool]) -> list[Expression]:
    """The expressions in the columns of the guards; zero for a guard that its interval program bounds."""
    pairs = zip(boundaries, held, strict=True)
    return [b.guard if is_held and b.guard is not None else ZERO for b, is_held in pairs]


@attrs.frozen
class Equations:
    """A mode: its field, its guards, and the facts about them that a series needs.

    Attributes
    ----------
    field
        The rates, simplified by the signs of the guards inside the mode.
    boundaries
        The guards.
    symbols
        Those of time, state and parameters.
    bases
        Guards whose fractional powers the field has, with the order of the root that makes them smooth.
    held
        For each guard, whether the series of the mode hold it.
    """

    field: Sequence[Expression]
    boundaries: Sequence[Boundary]
    symbols: Symbols
    bases: Mapping[Expression, int]
    held: Sequence[bool]

    @cached_property
    def guards(self) -> list[Expression]:
        """The expressions in the columns of the guards."""
        return columns_of_guards(self.boundaries, self.held)

    @cached_property
    def jacobian(self) -> list[list[Expression]]:
        """``D_x f``."""
        return [row[:-1] for row in partial_derivatives(self.field, self.symbols.variables)]

    @cached_property
    def is_affine(self) -> bool:
        """Whether the field is affine in the state, with constant coefficients."""
        return not any(mentions(entry, self.symbols.variables) for row in self.jacobian for entry in row)

    @cached_property
    def has_elementary_forcing(self) -> bool:
        """Whether the field has polynomials, harmonics and exponentials of time only."""
        return all(_elementary(entry, self.symbols) for entry in self.field)


def equations_of(field: Sequence[Expression], boundaries: Sequence[Boundary], symbols: Symbols) -> Equations:
    """The equations of a mode from its traced field and its guards.

    Raises
    ------
    NoSeries
        If the field has a fractional power of an expression that is no guard.
    """
    known = known_positive(boundaries)
    field = [with_fractions(simplified(entry, known), known) for entry in field]
    bases = singular_bases(field, known, symbols)
    held = tuple(_is_held(boundary, bases, symbols) for boundary in boundaries)
    return Equations(field, boundaries, symbols, bases, held)


def _is_held(boundary: Boundary, bases: Iterable[Expression], symbols: Symbols) -> bool:
    """Whether the series of a mode hold the guard: it is affine, or the series may hold its root."""
    guard = boundary.guard
    if guard is None:
        return False
    return boundary.is_affine or any(is_multiple(guard, z, symbols) for z in bases)


def in_terms_of_root(
    boundaries: Sequence[Boundary], z: Expression, root: Symbol, symbols: Symbols
) -> dict[int, Expression]:
    """Guards that are multiples of ``z``, by place: the root with the sign of the guard inside the mode."""
    return {
        place: (boundary.inside or sign_of(boundary.guard, [z]) or 1) * root
        for place, boundary in enumerate(boundaries)
        if boundary.guard is not None and is_multiple(boundary.guard, z, symbols)
    }


def _elementary(entry: Expression, symbols: Symbols) -> bool:
    """Whether time enters only through polynomials and through harmonics and exponentials of linear terms."""
    for node in nodes(replaced(entry, dict.fromkeys(tables_of_time(entry), ONE))):
        if not mentions(node, (symbols.t,)) or node.is_symbol or node.is_sum or node.is_product:
            continue
        if node.is_power and is_whole(node.exponent) and is_positive(node.exponent):
            continue
        if isinstance(node, ELEMENTARY) and not mentions(derivative(node.args[0], symbols.t), (symbols.t,)):
            continue
        return False
    return True
