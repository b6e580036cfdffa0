"""Names that the author gives to parts of a split system, in the place of the sides of surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.expression.graph import nodes_of
from hybrid.expression.nodes import Expression, number
from hybrid.expression.operations import Absolute, And, Equal, Less, LessEqual, Not, Or
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.text import text
from hybrid.expression.tracing import TraceError, trace
from hybrid.system.labels import named
from hybrid.system.variables import Variables

WANTED = "map names to conditions: functions of (t, x, p), or sides of modes as text"
COMPARISONS = (Less, LessEqual, Equal)
# Sides of surfaces by their numbers: below, on it, above.
Sides = Mapping[int, int]


@attrs.frozen
class Verdict:
    """Whether a condition holds in a cell, None if its sides do not tell, and the sides that it stands for.

    A name takes the place of these sides: they are those of the cell wherever the condition holds.
    """

    holds: bool | None
    told: frozenset[int] = frozenset()


@attrs.frozen(eq=False)
class Title:
    """A name, and the condition under which a part of a mode has it.

    The condition is an expression, or the sides of a cell in the words of its automatic name.
    """

    name: str
    condition: Expression | tuple[str, ...]


@attrs.frozen(eq=False)
class Titles:
    """All names that the author gives."""

    given: tuple[Title, ...]
    surfaces: Surfaces

    def of(
        self, sides: Sequence[tuple[int, int]], words: Callable[[int, int], str]
    ) -> tuple[list[str], set[int]]:
        """The names of a cell, and the surfaces whose sides they stand for; ``words`` names a side."""
        names, told = [], set[int]()
        for title in self.given:
            verdict = self._verdict(title.condition, dict(sides), words)
            if verdict.holds:
                names.append(title.name)
                told |= verdict.told
        return names, told

    def _verdict(self, condition: Any, sides: Sides, words: Callable[[int, int], str]) -> Verdict:
        if isinstance(condition, Expression):
            return self._truth(condition, sides)
        own = {words(each, side): each for each, side in sides.items()}
        holds = all(each in own for each in condition)
        return Verdict(holds, frozenset(own[each] for each in condition) if holds else frozenset())

    def _truth(self, node: Expression, sides: Sides) -> Verdict:
        if node.is_number:
            return Verdict(bool(float(node)))
        if isinstance(node, COMPARISONS):
            return self._comparison(node, sides)
        if isinstance(node, Not):
            inner = self._truth(node.args[0], sides).holds
            # What does not hold may not hold on several sides, which stay in the name.
            return Verdict(None if inner is None else not inner)
        found = [self._truth(each, sides) for each in node.args]
        truths = {each.holds for each in found}
        if isinstance(node, And):
            holds = False if False in truths else None if None in truths else True
            return Verdict(holds, frozenset().union(*(each.told for each in found)))
        return Verdict(True if True in truths else None if None in truths else False)

    def _comparison(self, node: Expression, sides: Sides) -> Verdict:
        one, other = node.args
        height = one - other
        if height.is_number:
            place, side = None, (float(height) > 0) - (float(height) < 0)
        else:
            match = self.surfaces.match(height)
            if match is None:
                return Verdict(None)
            place, orientation = match
            own = sides[place] if place in sides else self.surfaces.implied(place, sides)
            if own is None:
                return Verdict(None)
            side = own * orientation
        if isinstance(node, Equal):
            holds = side == 0
        else:
            holds = side < 0 or (side == 0 and isinstance(node, LessEqual))
        # With <= the surface itself belongs to it, and stays in the name there.
        lost = isinstance(node, LessEqual) and side == 0
        return Verdict(holds, frozenset() if place is None or lost else frozenset((place,)))

    def check(self, used: set[str], modes: Sequence[str]) -> None:
        """ModelError if a name is not ``used`` by one of all the modes of a system.

        Raises
        ------
        ModelError
            It says which comparison is no switch of the equations, if there is one.
        """
        for title in self.given:
            if title.name in used:
                continue
            told = ", ".join(map(repr, modes))
            if isinstance(title.condition, Expression):
                for node in nodes_of(COMPARISONS, title.condition):
                    height = node.args[0] - node.args[1]
                    if not height.is_number and self.surfaces.match(height) is None:
                        raise ModelError(
                            f"modes[{title.name!r}] compares what is no switch of the equations, so that "
                            f"no mode ends there. Compare what they switch on: modes are {told}."
                        )
            raise ModelError(f"modes[{title.name!r}] holds in no mode. Modes: {told}.")


def titles_of(given: Any, variables: Variables, surfaces: Surfaces) -> Titles:
    """The names that the argument ``modes`` gives.

    Raises
    ------
    ModelError
        If a name is no text, or a condition is no comparison.
    """
    found = []
    for name, condition in named("modes", given, WANTED).items():
        if not isinstance(name, str) or not name:
            raise arguments.refusal("modes: a name", "be a non-empty text", name)
        found.append(Title(name, _condition(f"modes[{name!r}]", condition, variables)))
    return Titles(tuple(found), surfaces)


def _condition(title: str, given: Any, variables: Variables) -> Expression | tuple[str, ...]:
    if isinstance(given, str) and given.strip():
        return tuple("".join(each.split()) for each in given.split(", "))
    if not callable(given):
        wanted = "be a condition, a function of (t, x, p), or the sides of a mode as text"
        raise arguments.refusal(title, wanted, given)
    try:
        found = trace(given, variables.components, variables.parameter_names)
    except TraceError as error:
        raise ModelError(f"{title} cannot be traced: {error}.") from error
    except ModelError as error:
        raise ModelError(f"{title}: {error}") from error
    [condition] = found if len(found) == 1 else [None]
    if not isinstance(condition, (*COMPARISONS, And, Or, Not)):
        raise ModelError(
            f"{title} must return a comparison, such as x.q < 1, or several joined by & and |; got "
            f"{'several values' if condition is None else text(condition)}."
        )
    return _without_moduli(condition)


def _without_moduli(node: Expression) -> Expression:
    """The condition with two comparisons in the place of one of an absolute value."""
    if isinstance(node, And | Or | Not):
        return type(node)(*(_without_moduli(each) for each in node.args))
    one, other = node.args
    if isinstance(node, Less | LessEqual):
        kind, inside = type(node), And if isinstance(one, Absolute) else Or
        modulus, level = (one, other) if isinstance(one, Absolute) else (other, one)
        if isinstance(modulus, Absolute):
            u, minus = modulus.args[0], number(-1.0) * level
            if isinstance(one, Absolute):
                return inside(kind(u, level), kind(minus, u))
            return inside(kind(level, u), kind(u, minus))
    return node
