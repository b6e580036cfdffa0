"""Where an orbit goes on from an intersection of surfaces: the cells around it are tried one by one.

A cell is consistent at a state on some surfaces if the orbit slides along those on which the cell slides,
and moves to the side of the cell from all others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.evaluation import expressed
from hybrid.expression.nodes import ZERO, Expression, Number, add
from hybrid.expression.operations import Less
from hybrid.expression.polynomials import is_zero
from hybrid.expression.tracing import trace
from hybrid.system.elements import Function
from hybrid.transform.cells import Cell, Pieces
from hybrid.transform.ties import Sides

# A share of a side above this has come to its end if the speed of leaving the surface vanishes.
NEARLY = Number(0.99)

# The sides of the surfaces that a state is on, by number: -1 below, 1 above, 0 sliding.
Corner = dict[int, int]


def arrivals(sliding: Sequence[int], number: int, side: int) -> list[Corner]:
    """The sides to which an orbit may go on that slides along some surfaces and reaches another from a side.

    Sliding along all of them comes first, then along the old ones beyond the new one.
    """
    ways = product(product((0, 1, -1), repeat=len(sliding)), (0, -side))
    return [{**dict(zip(sliding, sides, strict=True)), number: own} for sides, own in ways]


def exits(sliding: Sequence[int], number: int, side: int) -> list[Corner]:
    """The sides to which an orbit may go on that slides along some surfaces and leaves one of them to a side.

    Sliding along all others comes first.
    """
    others = [each for each in sliding if each != number]
    first = {**dict.fromkeys(others, 0), number: side}
    ways = (dict(zip(sliding, sides, strict=True)) for sides in product((0, 1, -1), repeat=len(sliding)))
    return [first, *(way for way in ways if any(way.values()) and way != first)]


def consistent(
    pieces: Pieces, sides: Sides, on: Sequence[int], leaving: int | None = None
) -> list[Expression]:
    """Conditions that all hold where a cell is consistent, at a state on the surfaces ``on``.

    Parameters
    ----------
    sides
        Of the cell; they decide every switch.
    leaving
        A surface from which the orbit moves away with a speed that grows from zero.
    """
    flow = pieces.flow(sides)
    positive = slides(pieces, sides)
    for number in on:
        side = sides[number]
        if side and number != leaving:
            rate = rate_of(pieces, number, flow)
            positive.append(rate if side > 0 else -rate)
    return [Less(ZERO, each) for each in positive]


def reaches_end(pieces: Pieces, cell: Cell, way: Corner, leaving: int) -> list[Expression]:
    """Conditions that the share of the side to which an orbit leaves a surface has come to its end.

    The speed with which the orbit leaves also vanishes where the other solution for the shares comes to it.
    """
    shares = pieces.shares(dict(cell.branches))
    if shares is None or leaving not in shares.of:
        return []
    return [Less(NEARLY, shares.of[leaving] * way[leaving])]


def projection(pieces: Pieces, cell: Cell, left: Sequence[int]) -> Function:
    """The point of the surfaces that an orbit leaves: it slides beside them by rounding."""

    def projected(t: Any, x: Any, p: Any) -> Any:
        for number in left:
            x = pieces.beside(dict(cell.branches), number).projection(t, x, p)
        return x

    return expressed(trace(projected, pieces.variables.components, pieces.variables.parameter_names))


def are_apart(pieces: Pieces, sides: Sides, on: Sequence[int]) -> bool:
    """Whether the speed through each of some surfaces is the same on both sides of every other one.

    Then an orbit enters and leaves each of them as if it were the only one, as do blocks with a dry contact
    each.
    """
    symbols = pieces.surfaces.symbols
    for number in on:
        others = [pieces.surfaces.known[other].height for other in on if other != number]
        normals = jacobian_of(others, symbols.x) if others else []
        for changes in pieces.changes(sides, number):
            for normal in normals:
                terms = (slope * change for slope, change in zip(normal, changes, strict=True))
                if not is_zero(add(*terms)):
                    return False
    return True


def may_slide(pieces: Pieces, sides: Sides) -> bool:
    """Whether an orbit may slide along all surfaces on which a cell does; False if nowhere."""
    on = pieces.ties.free(sides)
    if not all(pieces.jumps(sides, number) and pieces.may_attract(sides, number) for number in on):
        return False
    if len(on) < 2 or pieces.shares(sides) is not None:
        return True
    return may_slide(pieces, pieces.ties.moved(sides, {on[-1]: 2})) and not is_zero(attraction(pieces, sides))


def slides(pieces: Pieces, sides: Sides) -> list[Expression]:
    """Expressions that are all positive where an orbit slides along the surfaces on which a cell does."""
    on = pieces.ties.free(sides)
    if not on:
        return []
    shares = pieces.shares(sides)
    if shares is not None:
        return [attraction(pieces, sides), *(1 - share**2 for share in shares.of.values())]
    rates = [speeds(pieces, sides, number) for number in on]
    if len(on) == 1:
        [(below, above)] = rates
        return [below, -above]
    return [attraction(pieces, sides), *(-below * above for below, above in rates)]


def attraction(pieces: Pieces, sides: Sides) -> Expression:
    """Positive where sliding along the surfaces on which a cell does may be stable.

    It is the determinant of the rates of the heights by the shares of the sides, up to a positive factor and
    its sign. If the jumps add up, that is the product of the attractions of one surface after another.
    """
    shares = pieces.shares(sides)
    if shares is not None:
        return shares.unique
    *rest, last = pieces.ties.free(sides)
    below, above = speeds(pieces, sides, last)
    own = below - above
    return own * attraction(pieces, pieces.ties.moved(sides, {last: 2})) if rest else own


def speeds(pieces: Pieces, sides: Sides, number: int) -> tuple[Expression, Expression]:
    """The rates of a surface's height along the flows below it and above it."""
    beside = (pieces.ties.moved(sides, {number: side}) for side in (-2, 2))
    below, above = (rate_of(pieces, number, pieces.flow(each)) for each in beside)
    return below, above


def rate_of(pieces: Pieces, number: int, flow: Function) -> Expression:
    """The rate of a surface's height along a flow."""
    surfaces, variables = pieces.surfaces, pieces.variables
    field = trace(flow, variables.components, variables.parameter_names)
    [[*normal, own]] = jacobian_of([surfaces.known[number].height], surfaces.symbols.variables)
    terms = (slope * rate for slope, rate in zip(normal, field, strict=True) if slope != 0)
    return sum(terms, ZERO) + own
