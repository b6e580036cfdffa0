"""Surfaces that a state stays on for want of speed: positions whose velocities are kept at zero.

The rate of a position ``h`` vanishes on the surface ``v = 0`` of its velocity. A state on both surfaces that
is kept on that of the velocity stays on the other: ``h`` is *tied* to ``v``. Filippov's combinations of the
fields around such a meeting that keep ``v`` must be one field, else nothing says how the state goes on.

A tied state slides along ``v = 0`` between the two corners to which it could leave: those in which ``h``
moves away from its surface as ``v`` does. So the side of ``h`` goes along with that of ``v``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from hybrid.expression.continuity import vanishes_on
from hybrid.expression.derivatives import derivative, jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import mentions
from hybrid.expression.nodes import ZERO, Expression, Symbol, add
from hybrid.expression.polynomials import is_zero
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import Resolved, Switches
from hybrid.expression.tracing import Symbols

# By number of a surface: -1 below, 1 above, 0 sliding along it; -2 and 2 on it, with the branch of that side.
Sides = Mapping[int, int]


class Ties:
    """Which surfaces are tied to which, in one mode.

    Parameters
    ----------
    switches
        The functions of the mode, its field first.
    size
        Number of entries of the field.
    defaults
        Values of the parameters, which give the sign of a factor such as one over a mass.
    """

    def __init__(
        self, switches: Switches, size: int, surfaces: Surfaces, defaults: Mapping[Symbol, float]
    ) -> None:
        self.switches = switches
        self.size = size
        self.surfaces = surfaces
        self.defaults = defaults
        self._known: dict[Any, dict[int, tuple[int, int]]] = {}

    def at(self, sides: Sides) -> dict[int, tuple[int, int]]:
        """By tied surface that of its velocity; and 1, or -1 if the position falls where that is positive."""
        on = [number for number, side in sides.items() if side == 0]
        if len(on) < 2:
            return {}
        key = tuple(sorted(sides.items()))
        if key not in self._known:
            fields = self._fields(sides)
            led = {number: self._leader(fields, number, on) for number in on} if fields else {}
            ties = {number: by for number, by in led.items() if by is not None}
            self._known[key] = ties if self._are_unique(sides, ties) else {}
        return self._known[key]

    def free(self, sides: Sides) -> list[int]:
        """The surfaces along which a state slides, without those that are tied to others."""
        tied = self.at(sides)
        return [number for number, side in sides.items() if side == 0 and number not in tied]

    def along(self, sides: Sides, to: Sides) -> dict[int, int]:
        """New sides of some surfaces, and of those that are tied to them."""
        ties = self.at({**sides, **dict.fromkeys(to, 0)})
        return {number: sign * to[by] for number, (by, sign) in ties.items() if by in to} | dict(to)

    def moved(self, sides: Sides, to: Sides) -> dict[int, int]:
        """Sides with some of them changed; what is tied to them goes along."""
        return {**sides, **self.along(sides, to)}

    def vertices(self, sides: Sides, besides: int | None = None) -> Iterator[dict[int, int]]:
        """The sides with each zero replaced by both signs, except for one surface."""
        on = [number for number in self.free(sides) if number != besides]
        for signs in product((-2, 2), repeat=len(on)):
            yield self.moved(sides, dict(zip(on, signs, strict=True)))

    def are_decided(self, sides: Sides) -> bool:
        """Whether all corners around some surfaces decide every switch."""
        return bool(self._fields(sides))

    def _fields(self, sides: Sides) -> list[Sequence[Expression]]:
        """The fields of all corners around some surfaces; none if a corner leaves a switch open."""
        resolved = [self.switches.resolved(corner) for corner in _corners(sides)]
        fields: list[Sequence[Expression]] = [
            each.entries[: self.size] for each in resolved if isinstance(each, Resolved)
        ]
        return fields if len(fields) == len(resolved) else []

    def _leader(
        self, fields: Sequence[Sequence[Expression]], number: int, on: Sequence[int]
    ) -> tuple[int, int] | None:
        """The surface, of those that the state is on, where the speed through another one vanishes."""
        symbols, known = self.surfaces.symbols, self.surfaces.known
        [[*normal, own]] = jacobian_of([known[number].height], symbols.variables)
        first, *others = (add(own, _dot(normal, field)) for field in fields)
        if not all(is_zero(speed - first) for speed in others):
            return None
        for other in on:
            share = ZERO if other == number else _share(first, known[other].height, symbols)
            sign = np.sign(Program([share]).run(self.defaults)[0])
            if sign:
                return other, int(sign)
        return None

    def _are_unique(self, sides: Sides, ties: Mapping[int, tuple[int, int]]) -> bool:
        """Whether all combinations of the fields around a meeting that keep the velocity are one field.

        They are if the fields of all its corners lie on one line.
        """
        for velocity in {by for by, _ in ties.values()}:
            meeting = {velocity, *(number for number, (by, _) in ties.items() if by == velocity)}
            heights = [self.surfaces.known[number].height for number in meeting]
            [normal] = jacobian_of([self.surfaces.known[velocity].height], self.surfaces.symbols.x)
            others = {number: side or 2 * (number not in meeting) for number, side in sides.items()}
            first, *fields = self._fields(others)
            changes = [[b - a for a, b in zip(first, field, strict=True)] for field in fields]
            line = max(changes, key=lambda each: not is_zero(_dot(normal, each)))
            for change in changes:
                for entry, along in zip(change, line, strict=True):
                    aside = entry * _dot(normal, line) - along * _dot(normal, change)
                    if not any(vanishes_on(aside, height) for height in heights):
                        return False
        return True


def _corners(sides: Sides) -> Iterator[dict[int, int]]:
    """The sides with each zero replaced by both signs."""
    on = [number for number, side in sides.items() if side == 0]
    for signs in product((-2, 2), repeat=len(on)):
        yield {**sides, **dict(zip(on, signs, strict=True))}


def _share(expression: Expression, height: Expression, symbols: Symbols) -> Expression:
    """The factor, made of parameters, that takes an affine height to an expression; 0 if there is none."""
    for variable in symbols.x:
        slope = derivative(height, variable)
        share = ZERO if slope is ZERO else derivative(expression, variable) / slope
        if share is not ZERO and not mentions(share, symbols.variables):
            return share if is_zero(expression - share * height) else ZERO
    return ZERO


def _dot(normal: Sequence[Expression], field: Sequence[Expression]) -> Expression:
    return add(*(slope * rate for slope, rate in zip(normal, field, strict=True)))
