"""The series of a mode for runs abreast: every number in them is one number of each run.

What makes a series of one run fast is how its columns lie side by side. Here each column fills a register by
itself, so a column needs no place among others, and the recurrences are written plainly. An affine mode has
no table here: that would be one of each run.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.propagators.desingularised import write_desingularised
from hybrid.compiler.propagators.equations import Boundary, Equations, equations_of
from hybrid.compiler.propagators.rooted import regular_roots, write_rooted
from hybrid.compiler.propagators.writing import (
    Body,
    harmonics_of,
    names_of_state,
    seeds_of,
    write_series,
)
from hybrid.compiler.statements.code import Code, Statement, at, call, get, less, put, several, when
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.coefficients import ONE_THEN_ZERO, ORDER, OUT, o
from hybrid.compiler.taylor.convolutions import InMemory, InRegisters
from hybrid.compiler.taylor.loops import StateLoop, TangentLoop
from hybrid.compiler.taylor.series import NoSeries, Recurrences
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
    seeds, trace = seeds_of(symbols), divergence(field, symbols.variables)
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


class AbreastSums(InRegisters):
    """The sums of convolutions, each in a register of its own."""

    nothing = 0.0

    def __init__(self, block: Recurrences) -> None:
        self.block = block

    inner = InMemory.inner

    def keep(self) -> list[Statement]:
        """Keep the newest coefficients."""
        return self._kept("p", list(self.block.pairs.values()))

    def _names(self, letter: str) -> list[Code]:
        return [get(f"{self.block.prefix}{letter}{i}") for i in range(len(self.block.pairs))]

    def _totals(self) -> Iterator[Code]:
        return iter(self._names("t"))

    def _kept(self, letter: str, values: Sequence[Any]) -> list[Statement]:
        return [put(*each) for each in zip(self._names(letter), values, strict=True)]

    def _next(self, order: Any) -> list[Statement]:
        names = self._names("t") + self._names("u")
        if not names:
            return []
        lefts = several([left for left, _ in self.block.pairs])
        rights = several([self.block.beside(i) for i in range(len(self.block.pairs))])
        return [put(several(names), call("convolved", OUT, order, lefts, rights, 0))]

    def _ends(self, order: Any, distance: int) -> list[Statement]:
        first, last = list[Statement](), list[Statement]()
        sums, newest = self._names("tu"[distance - 1]), self._names("p")
        for i, (left, _) in enumerate(self.block.pairs):
            first.append(put(sums[i], sums[i] + at("out", distance, left) * newest[i]))
            other = at("out", distance, self.block.beside(i))
            last.append(put(sums[i], sums[i] + at("out", o - 1, left) * other))
        # The two terms may be one.
        return [*first, when(less(2 * distance, order), last)] if first else []


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

    def write_front(self, width: int, others: dict[int, Any]) -> None:
        """Keep ``others``: each column is written by itself."""
        self.others = others

    @cached_property
    def sums(self) -> AbreastSums:
        """How the convolutions are summed."""
        return AbreastSums(self.block)

    def _known(self, statements: Sequence[Statement]) -> list[Statement]:
        """What is done once the components of an order are known."""
        values = list(self.block.pairs.values())
        columns = self.others | {column: values[place] for place, column in self.factors.items()}
        components = [put(at("out", o, target), name) for target, name in self.names.items()]
        stored = [put(at("out", o, column), value) for column, value in columns.items()]
        return [*components, *statements, *stored, *self._rates()]


class AbreastTangents(TangentLoop):
    """Statements for the series of the tangent vectors of each run, one vector after the other."""

    width, whole, nothing = 1, 1, 0.0

    def _lanes(self, rate: Expression) -> Any:
        return self.block.coefficient(rate)

    def _spread(self) -> list[Statement]:
        return []

    def _begin(self) -> list[Statement]:
        first, found = (get("g") + 1) * len(self.names), list[Statement]()
        for i, name in enumerate(self.names):
            found += [put(name, at("x", first + i)), self._keep(0, get("v") + i, name)]
        return found

    def _convolved(self, blocks: Sequence[tuple[int, Any, list[Expression]]]) -> Code:
        pairs = [(left, self.block.beside(i, k)) for i, left, rights in blocks for k in range(len(rights))]
        lefts, rights = zip(*pairs, strict=True)
        return call("convolved", OUT, o + 1, several(lefts), several(rights), 1)

    def _row(self, block: int, names: Sequence[Code]) -> list[Statement]:
        return [self._keep(o, self.block.beside(block, k), name) for k, name in enumerate(names)]

    def _keep(self, order: Any, column: Any, value: Any) -> Statement:
        return put(at("out", order, column), value)


class AbreastBody(Body):
    """The body of a mode for runs abreast; ``watched`` are the guards as functions of time and state."""

    register = 1
    recurrences = AbreastRecurrences
    state_loop = AbreastLoop
    tangent_loop = AbreastTangents

    def __init__(self, watched: Sequence[Expression], symbols: Symbols, *others: Any) -> None:
        self.watched = watched
        super().__init__(symbols, *others)

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
