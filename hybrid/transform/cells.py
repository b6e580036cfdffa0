"""The smooth pieces of a mode whose functions have kinks and jumps, and the fields on the surfaces between.

A *cell* is a part of a mode in which every switching function keeps one branch: a side for each surface that
matters there, -1 below, 1 above, and 0 on a surface along which the state slides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import attrs
import sympy
from sympy.core.parameters import distribute

from hybrid.symbolic.continuity import vanishes_on
from hybrid.symbolic.derivatives import jacobian_of
from hybrid.symbolic.evaluation import expressed, scalar
from hybrid.symbolic.expressions import ZERO
from hybrid.symbolic.switches import Surfaces, resolved
from hybrid.symbolic.tracing import trace
from hybrid.system.elements import Function
from hybrid.system.variables import Variables
from hybrid.transform.surface import SwitchingSurface, surface_between

# By number of a surface: -1 below, 1 above, 0 sliding along it; -2 and 2 on it, with the branch of that side.
Sides = Mapping[int, int]


@attrs.frozen
class Cell:
    """A mode of the system that is split, and the sides of the surfaces that matter in the cell."""

    mode: int
    sides: tuple[tuple[int, int], ...]

    @property
    def sliding(self) -> tuple[int, ...]:
        """The surfaces along which the state slides."""
        return tuple(number for number, side in self.sides if side == 0)


@attrs.frozen
class Choice:
    """A cell with the sides that had to be chosen to reach it, by surface."""

    cell: Cell
    chosen: tuple[tuple[int, int], ...]


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
        field: Sequence[sympy.Expr],
        watched: Sequence[sympy.Expr],
        variables: Variables,
        surfaces: Surfaces,
    ) -> None:
        self.mode = mode
        self.field = [*field]
        self.watched = [*watched]
        self.variables = variables
        self.surfaces = surfaces
        self._fields: dict[Any, Function] = {}
        self._between: dict[Any, SwitchingSurface] = {}

    def cells(self, sides: Sides, decide: Callable[[int], int | None] | None = None) -> list[Choice]:
        """The cells where these sides hold; sides that are missing and matter are chosen both ways.

        Sides of surfaces that do not matter are left out.

        Parameters
        ----------
        decide
            Gives a missing side if there is no choice.
        """
        found: list[Choice] = []
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
            found.append(Choice(Cell(self.mode, tuple(sorted(result.items()))), tuple(chosen.items())))
        return found

    def _asked(self, sides: Sides) -> dict[int, int] | int:
        """The sides that matter and do not follow from others, each -1, 0 or 1; or a surface that is missing."""
        used: dict[int, int] = {}
        for vertex in _vertices(sides):
            result = resolved([*self.field, *self.watched], vertex, self.surfaces)
            if isinstance(result, int):
                return result
            used |= result.used
        used |= {number: 0 for number in used if sides.get(number) == 0}
        return {
            number: side
            for number, side in used.items()
            if self.surfaces.implied(number, {k: s for k, s in used.items() if k != number}) is None
        }

    def functions(self, sides: Sides) -> list[sympy.Expr]:
        """The watched functions; on a surface along which the state slides, as above it."""
        vertex = {number: side or 2 for number, side in sides.items()}
        return self._resolved(vertex)[len(self.field) :]

    def flow(self, sides: Sides) -> Function:
        """The field on these sides, with the sliding fields derived."""
        key = tuple(sorted(sides.items()))
        if key not in self._fields:
            self._fields[key] = self._flow(sides)
        return self._fields[key]

    def _flow(self, sides: Sides) -> Function:
        on = [number for number, side in sides.items() if side == 0]
        if not on:
            return expressed(self._vertex_field(sides))
        if len(on) == 2 and not self._is_additive(sides, *on):
            return self._bilinear(sides, *on)
        last = on[-1]
        sliding = self.between(sides, last).sliding_field
        return expressed(trace(sliding, self.variables.state, self.variables.parameter_names))

    def _vertex_field(self, sides: Sides) -> list[sympy.Expr]:
        return self._resolved(sides)[: len(self.field)]

    def _resolved(self, sides: Sides) -> list[sympy.Expr]:
        result = resolved([*self.field, *self.watched], sides, self.surfaces)
        assert not isinstance(result, int), "the side of a surface is missing"
        return [*result.entries]

    def between(self, sides: Sides, number: int) -> SwitchingSurface:
        """A surface with the flows on either side of it, all other sides as given."""
        key = number, tuple(sorted((k, s) for k, s in sides.items() if k != number))
        if key not in self._between:
            height = scalar(self.surfaces.known[number].height)
            below, above = (self.flow({**sides, number: side}) for side in (-2, 2))
            self._between[key] = surface_between(self.variables, below, above, height)
        return self._between[key]

    def jumps(self, sides: Sides, number: int) -> bool:
        """Whether the field is not proved to be continuous across a surface, all other sides as given."""
        height = self.surfaces.known[number].height
        return any(
            not vanishes_on(above - below, height)
            for vertex in _vertices(sides, besides=number)
            for below, above in self._across(vertex, number)
        )

    def _across(self, vertex: Sides, number: int) -> Iterator[tuple[sympy.Expr, sympy.Expr]]:
        fields = [self._vertex_field({**vertex, number: side}) for side in (-2, 2)]
        return zip(*fields, strict=True)

    def may_attract(self, sides: Sides, number: int) -> bool:
        """Whether the speeds through a surface may differ on its two sides."""
        return any(self.between(vertex, number).may_attract() for vertex in _vertices(sides, besides=number))

    def _is_additive(self, sides: Sides, one: int, other: int) -> bool:
        """Whether the jumps across two surfaces simply add up."""
        a, b, c, d = (self._vertex_field({**sides, one: i, other: j}) for i, j in product((-2, 2), repeat=2))
        pieces = zip(a, b, c, d, strict=True)
        return all((w - x - y + z).expand() == 0 for w, x, y, z in pieces)

    def _bilinear(self, sides: Sides, one: int, other: int) -> Function:
        """The field on an intersection: each side has a share, and the shares of corners are products.

        With the rates ``g = p0 + p1 a + p2 b + p3 a b`` and ``h = q0 + q1 a + q2 b + q3 a b`` of the two
        heights, ``-1 <= a, b <= 1``, the stable one of the two solutions of ``g = h = 0`` is that where the
        determinant of the derivatives in ``a`` and ``b`` is positive.
        """
        symbols = self.surfaces.symbols
        corners = {
            (i, j): self._vertex_field({**sides, one: i, other: j}) for i, j in product((-2, 2), repeat=2)
        }
        with distribute(False):
            field = [_coefficients(*each) for each in zip(*corners.values(), strict=True)]
            speeds = []
            for number in (one, other):
                # The rate of the height is linear in the field: its coefficients are the rates along theirs.
                [[*normal, own]] = jacobian_of([self.surfaces.known[number].height], symbols.variables)
                rates = [
                    sum((slope * each[k] for slope, each in zip(normal, field, strict=True)), ZERO)
                    for k in range(4)
                ]
                speeds.append([rates[0] + own, *rates[1:]])
            (p0, p1, p2, p3), (q0, q1, q2, q3) = speeds
            square, linear, constant = (
                q2 * p3 - q3 * p2,
                q0 * p3 + q2 * p1 - q1 * p2 - q3 * p0,
                q0 * p1 - q1 * p0,
            )
            root = (linear**2 - 4 * square * constant) ** sympy.Rational(1, 2)
            b = -2 * constant / (linear + root)
            a = -(p0 + p2 * b) / (p1 + p3 * b)
            return expressed([c0 + c1 * a + c2 * b + c3 * (a * b) for c0, c1, c2, c3 in field])


def _coefficients(mm: sympy.Expr, mp: sympy.Expr, pm: sympy.Expr, pp: sympy.Expr) -> tuple[sympy.Expr, ...]:
    """Coefficients of 1, a, b and ab of the bilinear function with these values where a, b are -1 or 1."""
    four = sympy.Integer(4)
    return (
        (mm + mp + pm + pp) / four,
        (pm + pp - mm - mp) / four,
        (mp + pp - mm - pm) / four,
        (mm + pp - mp - pm) / four,
    )


def _vertices(sides: Sides, besides: int | None = None) -> Iterator[dict[int, int]]:
    """The sides with each zero replaced by both signs, except for one surface."""
    on = [number for number, side in sides.items() if side == 0 and number != besides]
    for signs in product((-2, 2), repeat=len(on)):
        yield {**sides, **dict(zip(on, signs, strict=True))}
