"""Where clocks and the functions of a model meet: the row of a schedule that fires, and numbers that move.

The row is one number behind the parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hybrid.compiler.written import Written
from hybrid.expression.graph import Group, all_replaced, mentions
from hybrid.expression.nodes import Expression, Symbol
from hybrid.expression.tracing import ROW
from hybrid.system.graph import HybridSystem

NOWHERE = -1


def with_place_of_row(expressions: Sequence[Expression], parameters: int) -> list[Expression]:
    """The expressions with the entry behind so many ``parameters`` in the place of the row."""
    if not any(mentions(each, (ROW,)) for each in expressions):
        return [*expressions]
    return all_replaced(expressions, {ROW: _place(parameters)})


def place_of_row(written: Iterable[Written], parameters: int) -> int:
    """The place of the row in what functions get as parameters; ``NOWHERE`` if none of them asks."""
    group = Group((_place(parameters),))
    asked = any(mentions(each, group) for function in written for each in function.expressions or ())
    return parameters if asked else NOWHERE


def moving_places(system: HybridSystem) -> dict[str, tuple[int, ...]]:
    """The fields of ``Emitted`` that tell which numbers of clocks resets may change."""
    pairs = [
        (first + place, i)
        for i, (first, places) in enumerate(zip(system.first_tick, system.moving, strict=False))
        for place in places
    ]
    return {"moving": tuple(place for place, _ in pairs), "mover": tuple(i for _, i in pairs)}


def _place(parameters: int) -> Symbol:
    found: Symbol = Symbol(f"p[{parameters}]")
    return found
