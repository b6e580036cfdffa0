"""Surfaces where switching functions switch, and what the sides of some say about others."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import attrs

from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import is_larger_than, mentions
from hybrid.expression.implications import MOST_TERMS, follows
from hybrid.expression.nodes import HALF, ONE, Expression, Symbol, number
from hybrid.expression.operations import Floor, Level
from hybrid.expression.polynomials import coefficients_of
from hybrid.expression.text import text
from hybrid.expression.tracing import Symbols

QUARTER = number(0.25)
# Digits to which coefficients of surfaces are compared.
DIGITS = 12


@attrs.frozen
class Sawtooth:
    """The fraction of ``over / by``, cut where the remainder of ``over`` by ``by`` passes ``cut``.

    ``above`` is the side of a surface, -1 or 1, on which the remainder exceeds ``cut``.
    """

    over: Expression
    by: Expression
    cut: Expression
    above: int

    @property
    def argument(self) -> Expression:
        """What the fraction is of."""
        return self.over / self.by

    @property
    def level(self) -> Expression:
        """Where the fraction is cut, between 0 and 1."""
        return self.cut / self.by


@attrs.frozen
class Surface:
    """A surface ``height = 0``.

    Attributes
    ----------
    height
        Positive above the surface, negative below it.
    core, level
        The surface lies where ``core``, a sum without constant that is written down as text, has the value
        ``level``. Surfaces with the same core are parallel. The height grows with the core.
    argument
        For a floor its argument, whose fraction is below 1/2 above the surface; else None.
    pulse
        For both ends of a pulse, the sawtooth that it is cut from.
    """

    height: Expression
    core: str
    level: float
    argument: Expression | None = None
    pulse: Sawtooth | None = None


class Surfaces:
    """The surfaces that have been found so far, numbered; a surface that is written twice is one."""

    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols
        self.known: list[Surface] = []
        self.pulses: dict[str, Sawtooth] = {}
        # By arguments of floors that come from remainders: what is divided, and by what.
        self.quotients: dict[Expression, tuple[Expression, Expression]] = {}
        self._implied: dict[Any, int | None] = {}

    def find(self, height: Expression, argument: Expression | None = None) -> tuple[int, int]:
        """Number of the surface where an expression vanishes, and 1 if it is positive above, else -1."""
        core, level, orientation = core_of(height, self.symbols)
        number = self._number(core, level)
        if number is not None:
            return number, orientation
        if orientation < 0:
            height, argument = -height, None if argument is None else -argument
        self.known.append(Surface(height, core, level, argument, self.pulses.get(core)))
        return len(self.known) - 1, orientation

    def is_timed(self, u: Expression) -> bool:
        """Whether an expression is affine in time, and else made of numbers and parameters."""
        t, states = self.symbols.t, self.symbols.x
        return mentions(u, (t,)) and not mentions(u, states) and not mentions(derivative(u, t), (t,))

    def sawtooth(self, number: int) -> Sawtooth | None:
        """The sawtooth that a surface cuts; of a floor, at its half."""
        surface = self.known[number]
        if surface.argument is None:
            return surface.pulse
        over, by = self.quotients.get(surface.argument, (surface.argument, ONE))
        return Sawtooth(over, by, by / 2, -1)

    def match(self, height: Expression) -> tuple[int, int] | None:
        """As `find`, but None if the surface has not been found before."""
        core, level, orientation = core_of(height, self.symbols)
        number = self._number(core, level)
        return None if number is None else (number, orientation)

    def _number(self, core: str, level: float) -> int | None:
        for place, surface in enumerate(self.known):
            close = abs(surface.level - level) <= 10.0**-DIGITS * max(abs(level), abs(surface.level))
            if surface.core == core and close:
                return place
        return None

    def implied(self, number: int, sides: Mapping[int, int]) -> int | None:
        """The side of a surface that the sides of other surfaces imply; None if they imply none.

        Parameters
        ----------
        sides
            By number of a surface: -1 below, 1 above, 0 on it; -2 and 2 on it, with the branch of that side.
        """
        nearest = self._nearest(number, sides)
        key = number, frozenset(nearest.items())
        if key not in self._implied:
            given = [fact for other, side in nearest.items() for fact in _facts(self.known[other], side)]
            surface = self.known[number]
            side = self._by_parallels(surface, nearest)
            found = (each for each in (1, -1) if follows(_linear(surface), each, given))
            self._implied[key] = side or next(found, None)
        return self._implied[key]

    def _nearest(self, number: int, sides: Mapping[int, int]) -> dict[int, int]:
        """The sides of the other surfaces, of parallel ones only those that say most."""
        found: dict[tuple[str, int], tuple[float, int, int]] = {}
        for other, side in sides.items():
            if other == number:
                continue
            surface, direction = self.known[other], side if side in (-1, 1) else 0
            bound = direction * surface.level, other, side
            found[surface.core, direction] = max(found.get((surface.core, direction), bound), bound)
        return {other: side for _, other, side in found.values()}

    def _by_parallels(self, surface: Surface, sides: Mapping[int, int]) -> int | None:
        """The side of a surface that those of parallel ones imply."""
        for other, side in sides.items():
            beside = self.known[other]
            above = beside.level - surface.level
            if beside.core == surface.core and (above > 0 or side == 1) and above >= 0 and side != -1:
                return 1
            if beside.core == surface.core and (above < 0 or side == -1) and above <= 0 and side != 1:
                return -1
        return None


def is_negative(factor: Expression) -> bool:
    """Whether a number or a product is negative if its symbols are positive."""
    return (factor.is_number or factor.is_product) and factor.leads_with_minus


def _linear(surface: Surface) -> Expression:
    """What has the sign of a height and is linear in a floor, if the surface belongs to one."""
    if surface.argument is not None:
        return Floor(surface.argument) + HALF - surface.argument
    if surface.pulse is not None:
        u = surface.pulse.argument
        return surface.pulse.above * (u - Floor(u) - surface.pulse.level)
    return surface.height


def _facts(surface: Surface, side: int) -> list[tuple[Expression, int]]:
    """Expressions, and their signs on a side of a surface; 0 where they vanish.

    On a side of the surface of a floor, fractions are between 0 and 1/2, or between 1/2 and 1, and the floor
    is its level. The same is taken for the branch of that side on the surface itself.
    """
    facts = [(surface.height, side)]
    u = surface.argument if surface.pulse is None else surface.pulse.argument
    if u is None or side == 0:
        return facts
    direction = 1 if side > 0 else -1
    floor = Floor(u)
    facts += [(_linear(surface), direction), (u - floor, 1), (floor + 1 - u, 1)]
    if surface.argument is not None:
        shift = direction * QUARTER
        facts += [(floor - Level(u + shift), 0), (floor + 1 + Level(-u - shift), 0)]
    return facts


def core_of(height: Expression, symbols: Symbols) -> tuple[str, float, int]:
    """Text of a height without its constant and leading factor, the level, and the sign of the factor."""
    if is_larger_than(MOST_TERMS, height):
        return text(height), 0.0, 1
    coefficients = dict(coefficients_of(height))
    constant = float(coefficients.pop(ONE, 0))
    leading = next((float(coefficients[x]) for x in symbols.x if x in coefficients), None)
    terms = sorted((text(term), float(factor)) for term, factor in coefficients.items())
    factor = terms[0][1] if leading is None else leading
    core = " + ".join(f"{each / factor:.{DIGITS}e}*{term}" for term, each in terms)
    return core, -constant / factor, 1 if factor > 0 else -1


def moves(expression: Expression, variables: Collection[Symbol]) -> bool:
    """Whether an expression changes with variables, other than by jumps of floors to their next levels.

    What changes by such jumps alone has no surface of its own, and may be zero on whole steps.
    """
    waiting, seen = [expression], {expression}
    while waiting:
        node = waiting.pop()
        if isinstance(node, Level) or not mentions(node, variables):
            continue
        if node.is_symbol:
            return True
        waiting += [each for each in node.args if each not in seen]
        seen.update(node.args)
    return False
