"""Where the state lies after a jump into a mode that is split: on a side of a surface, or on the surface.

On the surface the flow decides, as it does for a run that starts there. So a block that was held and is
let go begins to move, or sticks, at once: it enters no part that it leaves at the same instant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from hybrid.expression.nodes import ZERO, Expression
from hybrid.expression.operations import And, Equal, Less, LessEqual, Not, Or
from hybrid.expression.tracing import trace
from hybrid.system.elements import Function
from hybrid.system.variables import Variables
from hybrid.transform.cells import Cell, Choice, Pieces
from hybrid.transform.ticks import timed

# An expression as it is after the reset.
After = Callable[[Expression], Expression]


def landed(
    pieces: Pieces, choices: Sequence[Choice], height_of: Callable[[int], Expression], after: After
) -> Iterator[tuple[Cell, list[Expression]]]:
    """The cells that a jump may lead to, each with its conditions on the state before the jump.

    Parameters
    ----------
    pieces
        Those of the mode that is entered.
    choices
        The cells on either side of the surfaces of which it is not known on which side the state lands.
    height_of
        What has the sign of the height of a surface.
    """
    for cell, conditions in _possible(pieces, choices, height_of, after):
        # A reset to a number decides conditions now.
        if ZERO not in conditions:
            yield cell, [each for each in conditions if each.mask]


def _possible(
    pieces: Pieces, choices: Sequence[Choice], height_of: Callable[[int], Expression], after: After
) -> Iterator[tuple[Cell, list[Expression]]]:
    for choice in choices:
        if len(choice.chosen) != 1 or not _is_plain(pieces, choice):
            yield choice.cell, [on_side(after(height_of(number)), side) for number, side in choice.chosen]
            continue
        [(number, side)] = choice.chosen
        height = after(height_of(number))
        down, stays = _flow(pieces, choice, number, after)
        on_it, above = Equal(height, ZERO), [Not(each) for each in (down, stays) if each is not None]
        if side < 0:
            yield choice.cell, [Or(Less(height, ZERO), And(on_it, down))]
            continue
        at_it = And(on_it, _all(above))
        yield choice.cell, [Or(Less(ZERO, height), at_it)]
        if stays is not None:
            [sliding] = pieces.choices({**choice.sides, number: 0})
            yield sliding.cell, [And(on_it, And(Not(down), stays))]


def on_side(height: Expression, side: int) -> Expression:
    """The condition that a height is not below zero, or that it is."""
    return LessEqual(ZERO, height) if side > 0 else Less(height, ZERO)


def _all(conditions: Sequence[Expression]) -> Expression:
    first, *others = conditions
    for each in others:
        first = And(first, each)
    return first


def _is_plain(pieces: Pieces, choice: Choice) -> bool:
    """Whether a state on the surface of a choice lies on no other one, and may slide in one cell at most."""
    [(number, _)] = choice.chosen
    sides = choice.sides
    if any(side not in (-1, 1) for side in sides.values()) or timed(pieces.surfaces, number) is not None:
        return False
    if pieces.rests(sides, number):
        return False
    return not _may_slide(pieces, choice, number) or len(pieces.choices({**sides, number: 0})) == 1


def _may_slide(pieces: Pieces, choice: Choice, number: int) -> bool:
    return pieces.jumps(choice.sides, number) and pieces.may_attract(choice.sides, number)


def _flow(pieces: Pieces, choice: Choice, number: int, after: After) -> tuple[Expression, Expression | None]:
    """Whether a state on a surface goes down from it, and whether it stays there; None if none does."""
    surface = pieces.between(choice.sides, number)

    def speed(function: Function) -> Expression:
        return after(_traced(function, pieces.variables))

    below, above = speed(surface.speed_below), speed(surface.speed_above)
    up = Less(ZERO, above)
    down = And(Not(up), Less(below, ZERO))
    stays = And(Not(up), LessEqual(ZERO, below)) if _may_slide(pieces, choice, number) else None
    return down, stays


def _traced(function: Function, variables: Variables) -> Expression:
    [expression] = trace(function, variables.components, variables.parameter_names)
    return expression
