"""The series of a mode for runs abreast: every number in them is one number of each run.

What makes a series of one run fast is how its columns lie side by side. Here each column fills a register by
itself, so a column needs no place among others, and the recurrences are written plainly. An affine mode has
no table here: that would be one of each run.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.propagators.desingularised import write_desingularised
from hybrid.compiler.propagators.equations import Boundary, Equations, equations_of
from hybrid.compiler.propagators.rooted import regular_roots, write_rooted
from hybrid.compiler.propagators.writing import (
    Body,
    each_order,
    harmonics_of,
    names_of_state,
    seeds_of,
    write_series,
)
from hybrid.compiler.statements.code import Statement, at, call, get, loop, put, several
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.convolutions import below_highest
from hybrid.compiler.taylor.loops import GROUPS, VECTORS, StateLoop
from hybrid.compiler.taylor.series import ONE_THEN_ZERO, ORDER, OUT, NoSeries, Recurrences, o
from hybrid.expression.derivatives import derivative, directional, divergence
from hybrid.expression.graph import all_replaced, degree_of, is_negative, is_whole, replaced
from hybrid.expression.nodes import Expression, Symbol, add, multiply
from hybrid.expression.operations import Absolute
from hybrid.expression.tabulated import tables_of_time
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import DESINGULARISED, EXACT, ROOTED, RUNGE_KUTTA

# Rows below those of a series: the values at the end, what they are sums of, and a row for each guard.
ROWS_OF_END = 2
# A longer system keeps its loops over components: here each has statements of its own.
MOST_STATES = 32


def write_abreast(
    field: Sequence[Expression] | None,
    boundaries: Sequence[Boundary],
    symbols: Symbols,
    found: Propagator,
) -> Series | None:
    """The series of a mode with the propagator ``found`` for runs abreast; None if it has none.

    All its guards are columns. In the row of a guard, behind the ends, are the magnitudes of its gradient in
    state and time, and what its value is a sum of.
    """
    guards = [boundary.guard for boundary in boundaries if boundary.guard is not None]
    if field is None or len(guards) < len(boundaries) or tables_of_time(*field, *guards):
        return None
    if len(symbols.x) > MOST_STATES or found.kind == RUNGE_KUTTA:
        return None
    if found.degree > 0 and not all(found.guards):
        # Of such a guard the polynomials of the state tell no end.
        return None
    if not all(_follows(guard, symbols) for guard in guards):
        return None
    try:
        return _written(equations_of(field, boundaries, symbols), guards, found.kind)
    except (NoSeries, RecursionError):
        return None


def _follows(guard: Expression, symbols: Symbols) -> bool:
    """Whether the series of a guard is known to converge wherever those of the state do.

    It is a polynomial of the state and of harmonics of time. Any other function may have a pole, or a pulse,
    that the last terms of its own series say nothing of.
    """
    driving = harmonics_of([guard], symbols)
    variables = frozenset((symbols.t, *symbols.x, *driving.values()))
    return degree_of(replaced(guard, driving), variables) is not None


def _written(mode: Equations, guards: Sequence[Expression], kind: int) -> Series:
    around, symbols = mode.boundaries, mode.symbols

    def body(*arguments: Any) -> Body:
        return AbreastBody(guards, *arguments)

    if kind == DESINGULARISED:
        [(z, order)] = mode.bases.items()
        return write_desingularised(mode.field, around, guards, z, order, symbols, body)
    if kind == ROOTED:
        return write_rooted(mode.field, around, guards, regular_roots(mode), symbols, body)
    if kind == EXACT:
        return _with_forcing(mode.field, guards, symbols, body)
    return write_series(mode.field, guards, symbols, body)


def _with_forcing(
    field: Sequence[Expression], guards: Sequence[Expression], symbols: Symbols, body_of: Any
) -> Series:
    """The series of a field whose sines and exponentials of time are states."""
    driving = harmonics_of([*field, *guards], symbols)
    body = body_of(symbols, guards, [*driving.values()], lambda _: ONE_THEN_ZERO)
    seeds, trace = seeds_of(symbols), divergence(field, symbols.x)
    begun = [get(f"start{i}") for i in range(len(driving))]
    body.preamble += assignments(begun, list(driving))
    columns, starts = names_of_state(symbols)
    moved = all_replaced(field, driving)
    turning = [replaced(derivative(function, symbols.t), driving) for function in driving]
    return body.assemble(
        [*symbols.x, *driving.values()],
        [*columns, *body.rows.values()],
        [*starts, *begun],
        [*moved, *turning],
        all_replaced(guards, driving),
        trace,
        directional(moved, seeds),
        seeds,
    )


def magnitude(expression: Expression, variables: Sequence[Symbol]) -> Expression:
    """What a value is a sum of: rounding is a share of this, even where the sum cancels."""
    if expression.is_sum:
        return add(*(magnitude(term, variables) for term in expression.args))
    if expression.is_product:
        return multiply(*(magnitude(factor, variables) for factor in expression.args))
    if expression.is_power and is_whole(expression.exponent) and not is_negative(expression.exponent):
        return magnitude(expression.base, variables) ** expression.exponent
    if not expression.args:
        return Absolute(expression)
    moved = (Absolute(derivative(expression, each)) * Absolute(each) for each in variables)
    return add(Absolute(expression), *moved)


class AbreastRecurrences(Recurrences):
    """The recurrences of one tangent vector of each run."""

    def beside(self, *place: int) -> Any:
        """The column of a factor in a block."""
        return get("v") + get(f"{self.prefix}b{place[0]}") + place[1]


class AbreastLoop(StateLoop):
    """The loop of the state.

    Attributes
    ----------
    others
        Coefficients by column, besides those of ``y``: the guards.
    factors
        By number of a convolution: the column of its second factor, for those that have none else.
    """

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.others: dict[int, Any] = {}
        self.factors: dict[int, int] = {}

    def first(self) -> list[Statement]:
        """Statements for order zero."""
        begin = [put(name, start) for name, start in zip(self.names.values(), self.starts, strict=True)]
        return [*begin, *self._state(), *self.block.first, *self._stored(), *self._rates()]

    def higher(self) -> list[Statement]:
        """Statements for order ``o``; ``shrink`` is 1/o."""
        block = self.block
        step = [put(name, get("shrink") * self._rate(i)) for i, name in enumerate(self.names.values())]
        rights = [block.beside(i) for i in range(len(block.pairs))]
        inner = [block.inner(i) for i in range(len(rights))]
        sums = products(inner, [left for left, _ in block.pairs], rights)
        # The term with a first factor that is a component of the state is known by now.
        led = [
            put(inner[i], inner[i] + block.led[pair] * at("out", 0, rights[i]))
            for i, pair in enumerate(block.pairs)
            if pair in block.led
        ]
        return [*sums, *step, *led, *self._state(), *block.higher, *self._stored(), *self._rates()]

    def _state(self) -> list[Statement]:
        return [put(at("out", o, target), name) for target, name in self.names.items()]

    def _stored(self) -> list[Statement]:
        values = list(self.block.pairs.values())
        columns = self.others | {column: values[place] for place, column in self.factors.items()}
        return [put(at("out", o, column), value) for column, value in columns.items()]


class AbreastTangents:
    """Statements for the series of the tangent vectors of each run, one after the other."""

    def __init__(self, seeds: Sequence[Symbol], block: Recurrences) -> None:
        self.components, self.block = len(seeds), block
        self.values: list[Any] = []
        block.rows |= {seed: get("v") + i for i, seed in enumerate(seeds)}

    def compute(self, rates: Sequence[Expression]) -> None:
        """Write the recurrences of the rates; this also requests the series of the state that they need."""
        self.values = [self.block.coefficient(rate) for rate in rates]

    @property
    def columns(self) -> int:
        """Number of columns that a tangent vector needs."""
        return self.components + len(self.block.pairs)

    def first(self) -> list[Statement]:
        """Statements for order zero, and for order one of the vectors themselves."""
        begun = [
            put(at("out", 0, get("v") + i), at("x", (get("g") + 1) * self.components + i))
            for i in range(self.components)
        ]
        return self._each([*begun, *self.block.first, *self._stored(), *self._later(1, 1.0)])

    def higher(self) -> list[Statement]:
        """Statements for order ``o``, and for order ``o + 1`` of the vectors themselves."""
        block, names, lefts, rights = self.block, list[Any](), list[Any](), list[Any]()
        for i, (left, factors) in enumerate(block.blocks.items()):
            for place in range(len(factors)):
                names.append(block.inner(i, place))
                lefts.append(left)
                rights.append(block.beside(i, place))
        # All orders of the other factors are known: those of the state.
        sums = products(names, lefts, rights, whole=1)
        later = [put(get("later"), 1.0 / (o + 1))]
        each = [*sums, *block.higher, *self._stored(), *self._later(o + 1, get("later"))]
        return below_highest([*later, *self._each(each)])

    def _stored(self) -> list[Statement]:
        block = self.block
        return [
            put(at("out", o, block.beside(i, place)), block.pairs[left, right])
            for i, (left, rights) in enumerate(block.blocks.items())
            for place, right in enumerate(rights)
        ]

    def _later(self, order: Any, scale: Any) -> list[Statement]:
        return [put(at("out", order, get("v") + i), scale * value) for i, value in enumerate(self.values)]

    def _each(self, statements: Any) -> list[Statement]:
        return [loop("g", 0, GROUPS, [put(get("v"), VECTORS + get("g") * self.columns), *statements])]

    def places(self) -> dict[str, int]:
        """By name: where the operands of products with a common factor begin, counted from ``v``."""
        found, place = {}, self.components
        for i, rights in enumerate(self.block.blocks.values()):
            found[f"{self.block.prefix}b{i}"] = place
            place += len(rights)
        return found


class AbreastBody(Body):
    """The body of a mode for runs abreast; ``watched`` are the guards as functions of time and state."""

    register = 1
    recurrences = AbreastRecurrences
    tangent_loop = AbreastTangents

    def __init__(self, watched: Sequence[Expression], symbols: Symbols, *others: Any) -> None:
        self.watched = watched
        super().__init__(symbols, *others)

    def _groups(self) -> Statement:
        return put(GROUPS, call("length", "x") // self.n - 1)

    def _orders(self, moved: Any, carried: Any) -> list[Statement]:
        return [*moved.first(), *carried.first(), each_order([*moved.higher(), *carried.higher()])]

    def _state(
        self,
        prefix: str,
        names: Sequence[Symbol | None],
        columns: list[int],
        starts: list[Any],
        rates: Sequence[Expression],
        guards: Sequence[Expression],
    ) -> AbreastLoop:
        block = self._block(prefix)
        block.expect(names, rates)
        moved = AbreastLoop(names, columns, rates, starts, block)
        moved.others = {self.n + place: block.coefficient(guard) for place, guard in enumerate(guards)}
        return moved

    def _place_pairs(self, moved: Any) -> dict[str, int]:
        """The column of the second factor of each convolution, by name; it has a new one if it has none."""
        block, places = moved.block, dict[str, int]()
        for place, (_, right) in enumerate(block.pairs):
            known = block.rows.get(right)
            if not isinstance(known, int):
                known = self.allot()
                moved.factors[place] = known
            places[f"{block.prefix}c{place}"] = known
        return places

    def _sizes(self) -> list[Statement]:
        """Statements for the row of each guard."""
        found, variables = list[Statement](), [*self.symbols.x, self.symbols.t]
        for place, guard in enumerate(self.watched):
            sizes = [Absolute(derivative(guard, each)) for each in variables]
            sizes.append(magnitude(guard, variables))
            row = ORDER + (ROWS_OF_END + 1 + place)
            found += assignments([at("out", row, i) for i in range(len(sizes))], sizes)
        return found


def products(
    names: Sequence[Any], lefts: Sequence[Any], rights: Sequence[Any], whole: int = 0
) -> list[Statement]:
    """The statement for sums of products of two columns, without the first term, if there are any.

    The last term, with order ``o`` of the left column, is left out unless they are to be ``whole``.
    """
    if not names:
        return []
    sums = call("sums_of_products", OUT, o, several(lefts), several(rights), whole)
    return [put(several(names), sums)]
