"""The smooth pieces of a mode whose functions have kinks and jumps, and the fields on the surfaces between.

A *cell* is a part of a mode in which every switching function keeps one branch: a side for each surface that
matters there, -1 below, 1 above, and 0 on a surface along which the state slides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Any

import attrs

from hybrid.errors import ModelError
from hybrid.expression.continuity import vanishes_on
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.evaluation import expressed, scalar
from hybrid.expression.graph import all_replaced, nodes_of
from hybrid.expression.nodes import ZERO, Expression, Power, add
from hybrid.expression.polynomials import is_zero
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import Resolved, Switches
from hybrid.system.elements import Function
from hybrid.system.variables import Variables
from hybrid.transform import additive
from hybrid.transform.naming import Names
from hybrid.transform.rounding import combined
from hybrid.transform.shares import bilinear, stable_shares
from hybrid.transform.surface import SwitchingSurface
from hybrid.transform.ties import Sides, Ties
from hybrid.transform.titles import Titles


@attrs.frozen
class Cell:
    """A part of a mode: the sides of the surfaces around it.

    Attributes
    ----------
    mode
        Index of the mode in the system that is split.
    sides
        By surface, -1, 0 or 1.
    branches
        Sides that decide every switch. A cell may extend across a surface that changes nothing there: the
        sides of one of its parts are as good as those of the others.
    """

    mode: int
    sides: tuple[tuple[int, int], ...]
    branches: tuple[tuple[int, int], ...] = attrs.field(eq=False)

    @property
    def sliding(self) -> tuple[int, ...]:
        """The surfaces along which the state slides."""
        return tuple(number for number, side in self.sides if side == 0)


@attrs.frozen
class Choice:
    """A cell that some sides lead to.

    Attributes
    ----------
    chosen
        Missing sides that lead to this cell and not to another.
    sides
        All sides, which decide every switch.
    """

    cell: Cell
    chosen: tuple[tuple[int, int], ...]
    sides: dict[int, int]


@attrs.frozen
class Shares:
    """The bilinear field on the intersection of two surfaces, and the shares of their sides, -1 to 1.

    Attributes
    ----------
    flow
        The field.
    of
        By surface, the share of its sides: -1 below, 1 above.
    unique
        Positive where the shares are real and not close to the other solution for them.
    """

    flow: Function
    of: dict[int, Expression]
    unique: Expression


class Pieces:
    """Cells and fields of one mode.

    Parameters
    ----------
    mode
        Index of the mode.
    field, watched
        Its field, and the other functions that must be smooth in each cell, as expressions.
    """

    def __init__(
        self,
        mode: int,
        field: Sequence[Expression],
        watched: Sequence[Expression],
        variables: Variables,
        surfaces: Surfaces,
    ) -> None:
        self.mode = mode
        self.size = len(field)
        self.switches = Switches([*field, *watched], surfaces)
        self.variables = variables
        self.surfaces = surfaces
        self._fields: dict[Any, Function] = {}
        self._between: dict[Any, SwitchingSurface] = {}
        self._shares: dict[Any, Shares | None] = {}
        self._rests: dict[Any, bool] = {}
        defaults = dict(zip(surfaces.symbols.p, variables.parameters.values(), strict=True))
        self.ties = Ties(self.switches, self.size, surfaces, defaults)

    def cells(self, sides: Sides, decide: Callable[[int], int | None] | None = None) -> Iterator[Choice]:
        """The cells where these sides hold; sides that are missing and matter are chosen both ways.

        Sides of surfaces that do not matter are left out.

        Parameters
        ----------
        decide
            Gives a missing side if there is no choice.
        """
        known = dict(sides)
        waiting: list[dict[int, int]] = [{}]
        while waiting:
            chosen = waiting.pop()
            result = self._asked({**known, **chosen})
            if isinstance(result, int):
                side = decide(result) if decide else None
                if side is None:
                    waiting += [{**chosen, result: +1}, {**chosen, result: -1}]
                else:
                    known[result] = side
                    waiting.append(chosen)
                continue
            yield Choice(self._merged(result), tuple(chosen.items()), {**known, **chosen})

    def choices(self, sides: Sides, decide: Callable[[int], int | None] | None = None) -> list[Choice]:
        """As `cells`, but a side that makes no difference in the end is not chosen."""
        found = [*self.cells(sides, decide)]
        if len({choice.cell for choice in found}) == 1:
            return [attrs.evolve(found[0], chosen=())]
        return found

    def _merged(self, sides: dict[int, int]) -> Cell:
        """The cell with these sides, and with what lies across those of its surfaces that change nothing."""
        branches = sides
        for number, side in sorted(sides.items()):
            if side and number in sides:
                sides = self._joined(sides, number, branches)
        return Cell(self.mode, tuple(sorted(sides.items())), tuple(sorted(branches.items())))

    def _joined(self, sides: dict[int, int], number: int, branches: dict[int, int]) -> dict[int, int]:
        """Sides without a surface across which every function stays the same; all sides if some do not.

        Both parts must lie where the sides of the other part, except for this surface, hold too.
        """
        rest = {other: side for other, side in sides.items() if other != number}
        beyond = self._asked({**rest, number: -2 * sides[number]})
        if isinstance(beyond, int) or self._entries(beyond) != self._entries(branches):
            return sides
        others = {other: side for other, side in beyond.items() if other != number}
        here, there = {**rest, number: sides[number]}, {**others, number: -sides[number]}
        if self._holds(others, here) and self._holds(rest, there):
            return self._essential({**rest, **others})
        return sides

    def _holds(self, wanted: Sides, sides: Sides) -> bool:
        """Whether some sides follow from others."""
        return all(sides.get(k) == s or self.surfaces.implied(k, sides) == s for k, s in wanted.items())

    def _entries(self, sides: Sides) -> list[tuple[Expression, ...]]:
        """Every function with the branches of some sides, at each vertex of a sliding cell."""
        return [tuple(self._resolved(vertex)) for vertex in self.ties.vertices(sides)]

    def _essential(self, sides: dict[int, int]) -> dict[int, int]:
        """The sides that do not follow from the others."""
        for number in sorted(sides):
            others = {k: s for k, s in sides.items() if k != number}
            if self.surfaces.implied(number, others) == sides[number]:
                sides = others
        return sides

    def _asked(self, sides: Sides) -> dict[int, int] | int:
        """The sides that matter and do not follow from others, -1, 0 or 1; or a surface that is missing."""
        used: dict[int, int] = {}
        for vertex in self.ties.vertices(sides):
            result = self.switches.resolved(vertex)
            if isinstance(result, int):
                return result
            used |= result.used
        used |= {number: 0 for number in used if sides.get(number) == 0}
        return self._essential(used)

    def flow(self, sides: Sides) -> Function:
        """The field on these sides, with the sliding fields derived."""
        key = tuple(sorted(sides.items()))
        if key not in self._fields:
            self._fields[key] = self._flow(sides)
        return self._fields[key]

    def _flow(self, sides: Sides) -> Function:
        on = self.ties.free(sides)
        if not on:
            return expressed(self._vertex_field(sides))
        if len(on) == 1 and self.rests(sides, on[0]):
            return expressed(self._held(self._vertex_field({**sides, on[0]: 2}), on[0]))
        shares = self.shares(sides)
        if shares is not None:
            return shares.flow
        field = self._additive_field(sides, on)
        return self.between(sides, on[-1]).sliding_field if field is None else expressed(field)

    def _additive_field(self, sides: Sides, on: Sequence[int]) -> list[Expression] | None:
        symbols, known = self.surfaces.symbols, self.surfaces.known
        gradients = jacobian_of([known[number].height for number in on], symbols.variables)
        return additive.sliding_field(
            lambda own: self._vertex_field(self.ties.moved(sides, own)), on, gradients
        )

    def _vertex_field(self, sides: Sides) -> list[Expression]:
        return self._resolved(sides)[: self.size]

    def _resolved(self, sides: Sides) -> list[Expression]:
        return [*self._all_decided(sides).entries]

    def _all_decided(self, sides: Sides) -> Resolved:
        """Every function on these sides; an error if they leave a switch open.

        They do where further surfaces pass through an intersection: to cross one is to cross others.
        """
        result = self.switches.resolved(sides)
        if isinstance(result, int):
            names, known = Names(self.variables, Titles((), self.surfaces)), self.surfaces.known
            meeting = [names.side(known, number, 0) for number, side in sides.items() if side in (-2, 0, 2)]
            raise ModelError(
                f"split: the surface {names.side(known, result, 0)} passes through the intersection of "
                f"{' and '.join(meeting)}, where a state may slide. Write its switch without the others "
                "(np.sign(a**2 - b**2) in place of np.sign(abs(a) - abs(b))), or make its sides modes."
            )
        return result

    def between(self, sides: Sides, number: int) -> SwitchingSurface:
        """A surface with the flows on either side of it, all other sides as given."""
        key = number, tuple(sorted((k, s) for k, s in sides.items() if k != number))
        if key not in self._between:
            height = scalar(self.surfaces.known[number].height)
            below, above = (self.flow(self.ties.moved(sides, {number: side})) for side in (-2, 2))
            self._between[key] = SwitchingSurface(self.variables, below, above, height)
        return self._between[key]

    def beside(self, sides: Sides, number: int) -> SwitchingSurface:
        """A surface with the flows on either side of it in a cell where the state slides on no other one.

        What a flow along several surfaces does across them is zero up to rounding, and tells no size.
        """
        return self.between(next(self.ties.vertices(sides, besides=number)), number)

    def jumps(self, sides: Sides, number: int) -> bool:
        """Whether the field is not proved to be continuous across a surface, all other sides as given."""
        height = self.surfaces.known[number].height
        return any(
            not vanishes_on(change, height) for changes in self.changes(sides, number) for change in changes
        )

    def may_attract(self, sides: Sides, number: int) -> bool:
        """Whether the speeds through a surface may differ on its two sides."""
        [normal] = jacobian_of([self.surfaces.known[number].height], self.surfaces.symbols.x)
        return any(
            not is_zero(add(*(slope * change for slope, change in zip(normal, changes, strict=True))))
            for changes in self.changes(sides, number)
        )

    def rests(self, sides: Sides, number: int) -> bool:
        """Whether a state that reaches a surface stays there, though the field does not jump.

        From both sides its speed through the surface falls to zero like a root: with a slope it would never
        get there.
        """
        key = number, tuple(sorted((k, s) for k, s in sides.items() if k != number))
        if key not in self._rests:
            self._rests[key] = self._proved_to_rest(sides, number)
        return self._rests[key]

    def _proved_to_rest(self, sides: Sides, number: int) -> bool:
        slides = any(side == 0 for other, side in sides.items() if other != number)
        if slides or self.jumps(sides, number):
            return False
        height = self.surfaces.known[number].height
        [[*normal, own]] = jacobian_of([height], self.surfaces.symbols.variables)
        for side in (-2, 2):
            field = self._vertex_field({**sides, number: side})
            speed = add(own, *(slope * rate for slope, rate in zip(normal, field, strict=True)))
            if not self._roots(speed, number) or not vanishes_on(speed, height):
                return False
        return True

    def _roots(self, expression: Expression, number: int) -> list[Expression]:
        """Roots in an expression whose slope is infinite on a surface."""
        height = self.surfaces.known[number].height
        return [
            each
            for each in nodes_of(Power, expression)
            if each.exponent.is_number and 0 < each.exponent.value < 1 and vanishes_on(each.base, height)
        ]

    def _held(self, field: Sequence[Expression], number: int) -> list[Expression]:
        """A field on a surface: roots of the height are zero, whatever rounding leaves of the height."""
        roots = [root for entry in field for root in self._roots(entry, number)]
        return all_replaced(field, dict.fromkeys(roots, ZERO))

    def _bare_field(self, sides: Sides) -> list[Expression]:
        return [*self._all_decided(sides).bare[: self.size]]

    def changes(self, sides: Sides, number: int) -> Iterator[list[Expression]]:
        """The change of the field from below a surface to above it, at each vertex of the other sides."""
        for vertex in self.ties.vertices(sides, besides=number):
            below, above = (self._bare_field(self.ties.moved(vertex, {number: side})) for side in (-2, 2))
            yield [a - b for b, a in zip(below, above, strict=True)]

    def _is_additive(self, sides: Sides, one: int, other: int) -> bool:
        """Whether the jumps across two surfaces simply add up."""
        corners = (self.ties.moved(sides, {one: i, other: j}) for i, j in product((-2, 2), repeat=2))
        a, b, c, d = map(self._vertex_field, corners)
        pieces = zip(a, b, c, d, strict=True)
        return all(combined((1, w), (-1, x), (-1, y), (1, z)) == 0 for w, x, y, z in pieces)

    def shares(self, sides: Sides) -> Shares | None:
        """The shares of the sides of two surfaces whose jumps do not add up; None on other cells."""
        on = self.ties.free(sides)
        if len(on) != 2:
            return None
        key = tuple(sorted(sides.items()))
        if key not in self._shares:
            self._shares[key] = None if self._is_additive(sides, *on) else self._bilinear(sides, *on)
        return self._shares[key]

    def _bilinear(self, sides: Sides, one: int, other: int) -> Shares:
        """The field on an intersection: each side has a share, and the shares of corners are products.

        They are those at which both heights stand still, of two solutions the stable one.
        """
        symbols = self.surfaces.symbols
        corners = {
            (i, j): self._vertex_field(self.ties.moved(sides, {one: i, other: j}))
            for i, j in product((-2, 2), repeat=2)
        }
        field = [bilinear(*each) for each in zip(*corners.values(), strict=True)]
        speeds = []
        for number in (one, other):
            # The rate of the height is linear in the field: its coefficients are the rates along theirs.
            [[*normal, own]] = jacobian_of([self.surfaces.known[number].height], symbols.variables)
            rates = [
                sum((slope * each[k] for slope, each in zip(normal, field, strict=True)), ZERO)
                for k in range(4)
            ]
            speeds.append([rates[0] + own, *rates[1:]])
        a, b, unique = stable_shares(*speeds)
        flow = expressed([c0 + c1 * a + c2 * b + c3 * (a * b) for c0, c1, c2, c3 in field])
        return Shares(flow, {one: a, other: b}, unique)
