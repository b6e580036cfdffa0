"""Kinks and jumps of expressions, taken apart: the surfaces where they lie, and the smooth pieces between.

A switching function such as ``sign(u)`` has one surface, where ``u`` vanishes, and one smooth branch on each
side of it. `resolved` puts the branches in place of the functions, outermost choices first: of
``where(a < 0, f, g)`` only the branch taken is looked at further.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce
from operator import truediv
from typing import cast

import attrs

from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import (
    all_replaced,
    base_and_exponent,
    contains,
    factors_of,
    in_order,
    is_larger_than,
    mentions,
    nodes_of,
    replaced,
)
from hybrid.expression.implications import MOST_TERMS, follows
from hybrid.expression.nodes import (
    ONE,
    ZERO,
    Expression,
    Number,
    Power,
    Symbol,
    multiply,
    number,
    power,
)
from hybrid.expression.operations import (
    Absolute,
    Ceiling,
    Cos,
    Equal,
    Floor,
    Less,
    LessEqual,
    Level,
    Maximum,
    Minimum,
    Remainder,
    Round,
    Select,
    Sign,
    Sin,
    Step,
    Truncate,
    TruncatedRemainder,
    Truth,
    WholeQuotient,
)
from hybrid.expression.polynomials import expanded, ratio
from hybrid.expression.ranges import range_of
from hybrid.expression.surfaces import QUARTER, Sawtooth, Surfaces, core_of, is_negative, moves
from hybrid.expression.tracing import Symbols

COMPARISONS = (Less, LessEqual, Equal)
COUNTS = (Floor, Ceiling, Truncate, Round, WholeQuotient, Remainder, TruncatedRemainder)
SWITCHING = (*COMPARISONS, *COUNTS, Sign, Step, Absolute, Maximum, Minimum)


@attrs.frozen
class Resolved:
    """Expressions without switching functions, and the sides of surfaces that were used, each -1 or 1.

    Attributes
    ----------
    bare
        The expressions without protection of fractional powers, which are nan beyond their surface.
    """

    entries: tuple[Expression, ...]
    used: dict[int, int]
    bare: tuple[Expression, ...]


@attrs.define
class _Stage:
    """Expressions with some switches decided: the next switch and what it leads to on either side."""

    entries: tuple[Expression, ...]
    used: dict[int, int]
    atom: Expression | None = None
    number: int = -1
    orientation: int = 0
    beyond: dict[int, _Stage] = attrs.field(factory=dict)
    resolved: Resolved | None = None


class Switches:
    """The switching functions in a few expressions; what has been worked out for some sides is kept.

    Parameters
    ----------
    entries
        In the symbols of ``surfaces``.
    """

    def __init__(self, entries: Sequence[Expression], surfaces: Surfaces) -> None:
        self.surfaces = surfaces
        pulses = tuple(_pulses(entry, surfaces) for entry in entries)
        self._root = self._stage(pulses, {})

    def resolved(self, sides: Mapping[int, int]) -> Resolved | int:
        """Expressions with the branches on given sides; or the first surface whose side is missing.

        Parameters
        ----------
        sides
            By number of a surface: -1 below, 1 above; -2 and 2 on it, with the branch of that side.
        """
        stage = self._root
        while stage.atom is not None:
            side = sides.get(stage.number) or self.surfaces.implied(stage.number, sides)
            if side is None:
                return stage.number
            side = 1 if side > 0 else -1
            if side not in stage.beyond:
                stage.beyond[side] = self._decided(stage, side)
            stage = stage.beyond[side]
        if stage.resolved is None:
            heights = [self.surfaces.known[number].height for number in stage.used]
            guarded = tuple(_guarded(entry, heights) for entry in stage.entries)
            stage.resolved = Resolved(guarded, stage.used, stage.entries)
        return stage.resolved

    def _decided(self, stage: _Stage, side: int) -> _Stage:
        assert stage.atom is not None
        branch = _branch(stage.atom, side * stage.orientation)
        entries = tuple(all_replaced(stage.entries, {stage.atom: branch}))
        return self._stage(entries, {**stage.used, stage.number: side})

    def _stage(self, entries: tuple[Expression, ...], used: dict[int, int]) -> _Stage:
        """The stage that these expressions are in, up to the first switch whose side is not known."""
        while (atom := _first_atom(entries, self.surfaces.symbols)) is not None:
            branch = _rewritten(atom, self.surfaces)
            if branch is None:
                height, argument = _height(atom)
                height, sign = self._simpler(height, used)
                if height is not ONE:
                    argument = argument if argument is None or sign > 0 else -argument
                    place, orientation = self.surfaces.find(height, argument)
                    sign *= orientation
                    if place not in used:
                        return _Stage(tuple(map(_without_truths, entries)), used, atom, place, sign)
                    sign *= used[place]
                branch = _branch(atom, sign)
            entries = tuple(all_replaced(entries, {atom: branch}))
        return _Stage(tuple(map(_without_truths, entries)), used)

    def _simpler(self, height: Expression, used: Mapping[int, int]) -> tuple[Expression, int]:
        """What of a height decides its sign, and the sign of the rest: no factor of known sign, no odd power.

        If no factor is left, the height never changes its sign, though it may touch zero.
        """
        given = [(self.surfaces.known[number].height, side) for number, side in used.items()]
        kept, sign = [], 1
        for factor in factors_of(height):
            known = _sign(factor, given if height.is_product else [])
            base, exponent = base_and_exponent(factor)
            if known:
                sign *= known
            else:
                kept.append(base if isinstance(exponent, Number) and exponent.is_whole else factor)
        return multiply(*kept), sign


def _sign(factor: Expression, given: Sequence[tuple[Expression, int]]) -> int:
    """The sign of a factor wherever it is not zero; 0 if it is not known."""
    found = range_of(factor)
    if found.low.value >= 0.0 or found.high.value <= 0.0:
        return 1 if found.low.value >= 0.0 else -1
    base, exponent = base_and_exponent(factor)
    if follows(base, 1, given):
        return 1
    whole = isinstance(exponent, Number) and exponent.is_whole
    return -1 if whole and follows(base, -1, given) else 0


def _first_atom(entries: Sequence[Expression], symbols: Symbols) -> Expression | None:
    """An innermost switching function; those in the condition of a choice come before its branches."""
    clean: set[Expression] = set()

    def search(node: Expression) -> Expression | None:
        if node in clean or not contains(node, SWITCHING):
            return None
        for argument in node.args:
            found = search(argument)
            if found is not None:
                return found
        if isinstance(node, SWITCHING) and moves(node, symbols.variables):
            return node
        clean.add(node)
        return None

    for entry in entries:
        found = search(entry)
        if found is not None:
            return found
    return None


def _rewritten(atom: Expression, surfaces: Surfaces) -> Expression | None:
    """An atom in terms of simpler ones; None if it is a simple one."""
    if isinstance(atom, Equal):
        # It holds on a surface only, not beside it.
        return ZERO
    if isinstance(atom, WholeQuotient | Round):
        return cast(Expression, atom.in_other_terms(*atom.args))
    if isinstance(atom, Remainder):
        a, b = atom.args
        surfaces.quotients[a / b] = a, b
        return a - b * Floor(a / b)
    if isinstance(atom, TruncatedRemainder):
        a, b = atom.args
        return a - b * Truncate(a / b)
    if isinstance(atom, Truncate):
        [u] = atom.args
        return Select(Less(u, ZERO), Ceiling(u), Floor(u))
    return _fixed(atom, surfaces.symbols)


def _fixed(atom: Expression, symbols: Symbols) -> Expression | None:
    """An atom that never switches, although it is written with variables; None if it may switch."""
    if isinstance(atom, Equal):
        return None
    height, argument = _height(atom)
    height = height if argument is None else argument
    if is_larger_than(MOST_TERMS, height):
        return None
    height = expanded(height)
    if mentions(height, symbols.variables):
        return None
    if isinstance(atom, Maximum | Minimum):
        a, b = atom.args
        return Select(Less(ZERO, height), *((a, b) if isinstance(atom, Maximum) else (b, a)))
    return atom.rebuilt([*([ZERO] if isinstance(atom, Less | LessEqual) else []), height])


def _pulses(entry: Expression, surfaces: Surfaces) -> Expression:
    """An expression whose comparisons of a fraction with a constant have one surface: both ends of a pulse.

    The fraction of ``u``, as in ``mod(t, 4) > 1``, is above ``d`` where ``cos(pi*d) > cos(2*pi*(u - d/2))``.
    As a function of ``u`` the right side does not jump where the fraction does.
    """
    changes = {}
    for atom in nodes_of((Less, LessEqual, Sign, Step), entry):
        height = _height(atom)[0]
        pulse = _pulse(height, surfaces) if contains(height, (Floor, Remainder)) else None
        if pulse is not None:
            changes[atom] = atom.rebuilt([*([ZERO] if isinstance(atom, Less | LessEqual) else []), pulse])
    return replaced(entry, changes) if changes else entry


def _pulse(height: Expression, surfaces: Surfaces) -> Expression | None:
    """A smooth height with the sign of ``g*(u - floor(u)) + c``; None if a height is not of this form."""
    if is_larger_than(MOST_TERMS, height):
        return None
    remainders = nodes_of(Remainder, height)
    quotients = {node: a - b * Floor(a / b) for node in remainders for a, b in [node.args]}
    height = expanded(replaced(height, quotients))
    floors = nodes_of(Floor, height)
    if len(floors) != 1 or contains(height, Level):
        return None
    [floor] = floors
    [u], share, variables = floor.args, Symbol("share"), surfaces.symbols.variables
    slope = -derivative(replaced(height, {floor: share}), share)
    if slope is ZERO or contains(u, SWITCHING) or mentions(slope, (share, *variables)):
        return None
    constant = expanded(height - slope * (u - floor))
    given = (node.args for node in remainders)
    over, by = next(((a, b) for a, b in given if expanded(a / b) is expanded(u)), (u, ONE))
    level = ratio(-constant, slope) if constant is not ZERO else ZERO
    if level is not None and not 0 < level.value < 1:
        return slope if level.value <= 0 else -slope
    cut, timed = -constant * (by / slope), surfaces.is_timed(u)
    steepness = slope
    if timed and not slope.is_number:
        # The period of a sawtooth of time is positive: its clock refuses any other.
        steepness = -slope / by if is_negative(by) else slope / by
    if level is None and (mentions(cut, variables) or not (timed and steepness.is_number)):
        return None
    if level is None:
        level = Minimum(Maximum(cut / by, ZERO), ONE)
        edge: Expression = Cos(number(math.pi) * level)
    else:
        # cos(pi*d), which is zero for half a turn.
        edge = number(math.sin(math.pi * (0.5 - float(level))))
    factor = number(math.copysign(1.0, steepness.value)) if steepness.is_number else slope
    pulse = factor * (edge - Cos(number(2.0 * math.pi) * (u - level / 2)))
    if factor.is_number:
        core, _, orientation = core_of(pulse, surfaces.symbols)
        surfaces.pulses[core] = Sawtooth(over, by, cut, orientation if factor.value > 0 else -orientation)
    return pulse


def heights_of(condition: Expression) -> list[Expression]:
    """Expressions of which one vanishes where a condition, true or positive, changes; innermost first."""
    whole = condition if isinstance(condition, Truth) else Less(ZERO, condition)
    found = []
    for node in in_order([whole]):
        if isinstance(node, COUNTS):
            # It jumps at whole numbers, or at halves.
            found.append(Sin(number(2.0 * math.pi) * reduce(truediv, node.args)))
        elif isinstance(node, SWITCHING) and not isinstance(node, Equal):
            found.append(_height(node)[0])
    return found


def _height(atom: Expression) -> tuple[Expression, Expression | None]:
    """The expression that vanishes where an atom switches; for a floor also its argument."""
    if isinstance(atom, Less | LessEqual):
        a, b = atom.args
        return b - a, None
    if isinstance(atom, Maximum | Minimum):
        a, b = atom.args
        return a - b, None
    [u] = atom.args
    if isinstance(atom, Floor | Ceiling):
        # Positive in the first half of each step from a whole number to the next, negative in the second.
        return Sin(number(2.0 * math.pi) * u), u
    return u, None


def _branch(atom: Expression, side: int) -> Expression:
    """What an atom is where the expression of `_height` has the sign ``side``."""
    if isinstance(atom, Less | LessEqual | Step):
        return ONE if side > 0 else ZERO
    if isinstance(atom, Sign):
        return number(side)
    if isinstance(atom, Maximum | Minimum):
        a, b = atom.args
        return a if (side > 0) == isinstance(atom, Maximum) else b
    [u] = atom.args
    if isinstance(atom, Absolute):
        return u if side > 0 else -u
    # The floor has the same value up to a quarter beyond both ends of its half of a step.
    level = Level(u + QUARTER if side > 0 else u - QUARTER)
    return level if isinstance(atom, Floor) else level + 1


def _without_truths(expression: Expression) -> Expression:
    """The expression with numbers that serve as conditions taken as true: they are zero on a surface only."""
    changes = {}
    for node in nodes_of(Select, expression):
        condition, a, _ = node.args
        if not isinstance(condition, Truth) and condition.mask and not contains(condition, SWITCHING):
            changes[node] = a
    return replaced(expression, changes) if changes else expression


def _guarded(expression: Expression, heights: Sequence[Expression]) -> Expression:
    """The expression with fractional powers of heights made zero beyond their surface, where they are nan.

    A step may evaluate a point slightly outside of its mode.
    """
    changes = {}
    for node in nodes_of(Power, expression):
        base, exponent = node.args
        if exponent.is_number and not exponent.is_whole and _is_multiple(base, heights):
            changes[node] = power(Maximum(base, ZERO), exponent)
    return replaced(expression, changes) if changes else expression


def _is_multiple(base: Expression, heights: Sequence[Expression]) -> bool:
    """Whether a base, or a factor of it, vanishes where a height does."""
    parts = [base, *(base_and_exponent(factor)[0] for factor in factors_of(base))]
    return any(ratio(part, height) is not None for part in parts for height in heights)
