"""Cells in which a state rests where surfaces meet, such as the bottom of a groove with dry friction.

There the jumps of both surfaces accumulate: the state comes to rest on both in finite time.
"""

from __future__ import annotations

from collections.abc import Iterator

from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.nodes import ZERO, Expression, Number
from hybrid.expression.operations import Absolute, Less
from hybrid.transform import corners
from hybrid.transform.cells import Cell, Choice, Pieces
from hybrid.transform.surface import SLIDING_BAND
from hybrid.transform.ties import Sides


def cell_of(pieces: Pieces, cell: Cell, sides: Sides, number: int) -> Cell | None:
    """The cell where a state rests if crossings of a surface accumulate with those of another one.

    None if there is no such cell, or more than one.

    Parameters
    ----------
    sides
        Of the cell beyond the surface; they decide every switch.
    """
    found = {
        choice.cell
        for other, side in cell.sides
        if side and other != number and _may_rest(pieces, sides, number, other)
        for choice in pieces.choices({**dict(cell.sides), number: 0, other: 0})
    }
    return found.pop() if len(found) == 1 else None


def _may_rest(pieces: Pieces, sides: Sides, one: int, other: int) -> bool:
    """Whether a chatter between two surfaces may lead to where they meet, and its mode there is known.

    One is tied to the other, and jumps across it bring it back; or the state slides along both, and each
    changes the speed through the other, so that the state may spiral to where they meet.
    """
    at = {**sides, one: 0, other: 0}
    if not pieces.ties.are_decided(at):
        return False
    ties, free = pieces.ties.at(at), pieces.ties.free(at)
    apart = corners.are_apart(pieces, at, free)
    tied = next((number for number in (one, other) if number in ties), None)
    if tied is None:
        return not apart and len(free) == 2 and corners.may_slide(pieces, at)
    jumps = any(pieces.jumps(vertex, tied) for vertex in pieces.ties.vertices(at))
    return apart and jumps and pieces.may_attract(at, ties[tied][0])


def around(pieces: Pieces, cell: Cell, number: int) -> Iterator[tuple[int, Choice]]:
    """The sides of a surface on which a cell slides or rests, and the cells there.

    The state may be on either side of the other surfaces that the cell rests on with this one.
    """
    ties = pieces.ties.at(dict(cell.branches))
    velocity = ties[number][0] if number in ties else number
    meeting = {velocity, *(n for n, (by, _) in ties.items() if by == velocity)}
    rest = {n: side for n, side in cell.sides if n not in meeting}
    for side in (1, -1):
        for choice in pieces.choices({**rest, number: 2 * side}):
            yield side, choice


def is_off(pieces: Pieces, number: int) -> Expression:
    """Whether a state is too far from a surface to rest on it: by more than a small share of its terms."""
    height = pieces.surfaces.known[number].height
    [normal] = jacobian_of([height], pieces.surfaces.symbols.x)
    terms = (Absolute(slope * x) for slope, x in zip(normal, pieces.surfaces.symbols.x, strict=True))
    return Less(Number(SLIDING_BAND) * sum(terms, ZERO), Absolute(height))
