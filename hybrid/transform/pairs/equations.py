"""The equations ``x' = a + B z``, ``w = q + D z`` as expressions, and what clocks switch in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ArgumentError, ModelError
from hybrid.expression.derivatives import directional, jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import all_replaced, mentions, nodes_of
from hybrid.expression.linear import Vector
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import Switches
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.tracing import TraceError, model_symbols, trace
from hybrid.system.clocks import Every
from hybrid.system.growth import Place
from hybrid.system.variables import PAIRS, STATE, Variables, named_values
from hybrid.transform.naming import Names
from hybrid.transform.pairs.pair import Pair
from hybrid.transform.ticks import Timed, timed
from hybrid.transform.titles import titles_of

# By the number of a surface, -1 below it and 1 above it.
Sides = tuple[tuple[int, int], ...]
# Rows of a smaller singular value, or entries, relative to the largest, are rounding.
ROUNDING = 1e-9


@attrs.frozen(eq=False)
class Numbers:
    """The equations at a state.

    Attributes
    ----------
    a, B, q, D
        ``(n,)``, ``(n, m)``, ``(m,)``, ``(m, m)``.
    slopes
        ``(m, n + 1)``: the derivatives of ``q`` in the state, and in time.
    """

    a: np.ndarray
    B: np.ndarray
    q: np.ndarray
    D: np.ndarray
    slopes: np.ndarray


@attrs.frozen(eq=False)
class Configuration:
    """The equations while no clock ticks.

    Attributes
    ----------
    sides
        Of the surfaces that clocks cross.
    a
        The rates without ``z``.
    B
        By pair: the rates for a unit of its ``z``.
    q
        By pair: ``w`` without ``z``.
    D
        By pair: ``w`` for a unit of each ``z``.
    """

    symbols: Any
    sides: Sides
    a: Vector
    B: list[Vector]
    q: Vector
    D: list[Vector]

    def at(self, place: Place) -> Numbers:
        """The equations in numbers."""
        values = values_at(self.symbols, self._program, place)
        n, m = len(self.a), len(self.q)
        a, B, q, D, slopes = np.split(values, np.cumsum([n, n * m, m, m * m]))
        return Numbers(a, B.reshape(m, n).T, q, D.reshape(m, m), slopes.reshape(m, n + 1))

    def is_monotone(self, place: Place) -> bool:
        """Whether no two motions can begin at one state, at the parameters of a place.

        The squared distance of two motions, with a matrix ``P``, grows no faster than the distance itself if
        ``z`` adds nothing to it: if ``D`` is positive semidefinite and ``P B = C^T``, with ``C = D_x q``, for
        the ``z`` of which ``z D z`` is zero. Passive circuits have that; ``P`` is the energy.
        """
        varies = [*_flat(self.B), *_flat([row[:-1] for row in self._slopes])]
        if any(mentions(each, self.symbols.variables) for each in varies):
            return False
        found = self.at(place)
        B, C = found.B, found.slopes[:, :-1]
        values, vectors = np.linalg.eigh(found.D + found.D.T)
        size = np.abs(values).max()
        if values[0] < -ROUNDING * size:
            return False
        free = vectors[:, values <= ROUNDING * size]
        joint = free.T @ C @ B @ free
        size = np.abs(joint).max(initial=0.0)
        if np.abs(joint - joint.T).max(initial=0.0) > ROUNDING * size:
            return False
        least = np.linalg.eigvalsh(joint)[:1]
        ranks = {rank_of(each) for each in (joint, B @ free, C.T @ free)}
        return bool((least >= -ROUNDING * size).all()) and len(ranks) == 1

    def rates(self, expressions: Sequence[Expression], field: Vector) -> Vector:
        """The rates of expressions along a field."""
        return directional(
            expressions, {self.symbols.t: ONE, **dict(zip(self.symbols.x, field, strict=True))}
        )

    @cached_property
    def _program(self) -> Program:
        return Program([*self.a, *_flat(self.B), *self.q, *_flat(self.D), *_flat(self._slopes)])

    @cached_property
    def _slopes(self) -> list[list[Expression]]:
        return jacobian_of(self.q, self.symbols.variables)


class Equations:
    """What the author gives, as expressions.

    Parameters
    ----------
    rates
        ``f(t, x, z, p)``.
    modes
        Names that the author gives to what clocks switch.

    Raises
    ------
    ModelError
        If a function cannot be traced, has the wrong number of values, is not affine in ``z``, or switches on
        anything but a clock.
    """

    def __init__(
        self,
        variables: Variables,
        rates: Callable[..., Any],
        pairs: Sequence[Pair],
        modes: Mapping[str, Any] | None,
    ) -> None:
        self.variables, self.pairs = variables, pairs
        self.symbols = model_symbols(variables.dimension, len(variables.parameter_names))
        self.surfaces = Surfaces(self.symbols)
        self.names = Names(variables, titles_of(modes, variables, self.surfaces))
        self.given = self._entries(rates)
        self._switches = Switches(self.given, self.surfaces)
        self.clocks: dict[int, Timed] = {}
        self._known: dict[Sides, Configuration] = {}
        self._find_clocks()
        self.check_names()

    def _entries(self, rates: Callable[..., Any]) -> list[Expression]:
        """``a``, the columns of ``B``, ``q`` and the rows of ``D`` in one list."""
        n = self.variables.dimension
        rows = self._traced("complementarity: rates", rates)
        if len(rows) != n:
            raise ModelError(
                f"complementarity: rates must return {n} values, one for each component of the state; got "
                f"{len(rows)}."
            )
        titles = ["complementarity: rates"] * n
        for pair in self.pairs:
            values = self._traced(f"{pair.title}: w", pair.w)
            if len(values) != 1:
                raise ModelError(f"{pair.title}: w must return one number; got {len(values)}.")
            rows += values
            titles.append(f"{pair.title}: w")
        z = self._unknowns
        slopes = jacobian_of(rows, z)
        for title, own in zip(titles, slopes, strict=True):
            if any(mentions(each, z) for each in own):
                raise ModelError(
                    f"{title} must be affine in z, a sum of multiples of its entries. Give a pair to what "
                    "depends on z otherwise, or write the equations with from_equations."
                )
        known = all_replaced(rows, dict.fromkeys(z, ZERO))
        across = [slopes[i][k] for k in range(len(z)) for i in range(n)]
        return [*known[:n], *across, *known[n:], *_flat(slopes[n:])]

    @property
    def _unknowns(self) -> tuple[Symbol, ...]:
        n, count = self.variables.dimension, len(self.pairs)
        return tuple(model_symbols(n + count, len(self.variables.parameter_names)).x[n:])

    def _traced(self, what: str, function: Callable[..., Any]) -> list[Expression]:
        n, names = self.variables.dimension, tuple(each.name for each in self.pairs)
        own = self.variables.components

        def joined(t: Any, values: Any, p: Any) -> Any:
            x = values[:n] if isinstance(own, int) else named_values(STATE, own, [*values[:n]])
            return function(t, x, named_values(PAIRS, names, [*values[n:]]), p)

        try:
            found = trace(joined, n + len(names), self.variables.parameter_names)
        except TraceError as error:
            raise ModelError(
                f"{what} cannot be traced, and the modes are derived from it: {error}."
            ) from error
        if any(each.jumps for each in nodes_of(Tabulated, *found)):
            raise ModelError(
                f"{what} reads a table that jumps. A source that jumps is written with np.where on np.mod of "
                "time, which makes a clock of it."
            )
        return found

    def _find_clocks(self) -> None:
        """Find all surfaces that clocks cross; an error for any other."""
        waiting: list[dict[int, int]] = [{}]
        while waiting:
            sides = waiting.pop()
            found = self._switches.resolved(sides)
            if not isinstance(found, int):
                continue
            clock = timed(self.surfaces, found)
            if clock is None:
                name = self.names.side(self.surfaces.known, found, 0)
                raise ModelError(
                    f"complementarity: rates or pairs have a kink or a jump at {name}. Give it a pair "
                    "(np.maximum(u, 0) is w = z - u, with z in its place), or a clock: np.where on np.mod of "
                    "time."
                )
            self.clocks[found] = clock
            waiting += [{**sides, found: 1}, {**sides, found: -1}]

    def sides_at(self, place: Place) -> Sides:
        """What the clocks have switched at a time."""
        heights = Program([each.height for each in self.clocks.values()])
        values = values_at(self.symbols, heights, place)
        return tuple((number, 1 if v > 0 else -1) for number, v in zip(self.clocks, values, strict=True))

    def all_sides(self) -> Iterator[Sides]:
        """All that clocks may switch."""
        for chosen in product((1, -1), repeat=len(self.clocks)):
            yield tuple(zip(self.clocks, chosen, strict=True))

    def clock(self, number: int, side: int) -> Every:
        """What ticks where time leaves a side."""
        return self.clocks[number].clock(side, self.names.words)

    def named(self, sides: Sides) -> str:
        """What the name of a mode says of clocks."""
        return self.names.cell(self.surfaces.known, sides)

    def check_factors(self, parameters: np.ndarray) -> None:
        """An ArgumentError if a factor of ``z`` in ``w`` is zero at parameters, and not at others.

        The modes are made for equations in which it is there, and serve all parameters.
        """
        place = 0.0, np.ones(self.variables.dimension), parameters
        for sides in self.all_sides():
            own = self.configuration(sides)
            for pair, row, values in zip(self.pairs, own.D, own.at(place).D, strict=True):
                for other, factor, value in zip(self.pairs, row, values, strict=True):
                    if value == 0.0 and factor is not ZERO:
                        raise ArgumentError(
                            f"parameters: the factor of z.{other.name} in w of {pair.name!r} is zero at "
                            "these values, which makes other equations of the model than values beside. "
                            "Leave the term out of w, or give the parameters other values."
                        )

    def check_names(self) -> None:
        """A ModelError if a name that the author gives is that of nothing that clocks switch."""
        known, titles = self.surfaces.known, self.names.titles
        if titles.given and not self.clocks:
            raise ModelError(
                "complementarity: modes are names of what clocks switch, and these equations have no clock. "
                "Leave them out; Pair(says=) has a part in the names of modes."
            )
        words = {
            title
            for sides in self.all_sides()
            for title in titles.of(sides, lambda number, side: self.names.side(known, number, side))[0]
        }
        titles.check(words, [self.named(sides) for sides in self.all_sides()])

    def configuration(self, sides: Sides) -> Configuration:
        """The equations on some sides.

        Raises
        ------
        ModelError
            If what ``w`` has of ``z`` depends on the state or on time.
        """
        if sides not in self._known:
            found = self._switches.resolved(dict(sides))
            assert not isinstance(found, int), "all surfaces have been found"
            n, m, entries = self.variables.dimension, len(self.pairs), iter(found.entries)
            a = [next(entries) for _ in range(n)]
            B = [[next(entries) for _ in range(n)] for _ in range(m)]
            q = [next(entries) for _ in range(m)]
            D = [[next(entries) for _ in range(m)] for _ in range(m)]
            for pair, row in zip(self.pairs, D, strict=True):
                if any(mentions(each, self.symbols.variables) for each in row):
                    raise ModelError(
                        f"{pair.title}: w must have z with factors that do not depend on the state, and "
                        "change with clocks alone. Multiply w by what it is divided by, or write the modes "
                        "as a HybridSystem."
                    )
            self._known[sides] = Configuration(self.symbols, sides, a, B, q, D)
        return self._known[sides]


def values_at(symbols: Any, program: Program, place: Place) -> np.ndarray:
    """The values of expressions at a state."""
    t, x, parameters = place
    values = dict(zip((symbols.t, *symbols.x, *symbols.p), (t, *x, *parameters), strict=True))
    with np.errstate(all="ignore"):
        return np.array([float(each) for each in program.run(values)])


def _flat(rows: Sequence[Sequence[Expression]]) -> list[Expression]:
    return [each for row in rows for each in row]


def rank_of(matrix: np.ndarray) -> int:
    """The rank of a matrix, whatever the units of its rows and columns."""
    if not matrix.size or not np.isfinite(matrix).all():
        return 0
    for axis in (0, 1):
        sizes = np.abs(matrix).max(axis=axis, keepdims=True)
        matrix = matrix / np.where(sizes > 0.0, sizes, 1.0)
    singular = np.linalg.svd(matrix, compute_uv=False)
    return int(np.count_nonzero(singular > ROUNDING * singular[0])) if singular[0] > 0.0 else 0
