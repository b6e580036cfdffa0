"""The statements of a series: columns, loops over the orders, and the nesting of these loops."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from operator import mul
from typing import Any

from hybrid.compiler.emitted import Series
from hybrid.compiler.propagators.equations import ELEMENTARY
from hybrid.compiler.statements.code import (
    Code,
    Statement,
    at,
    call,
    either,
    equal,
    get,
    less,
    loop,
    put,
    whole,
)
from hybrid.compiler.statements.values import Constants, assignments
from hybrid.compiler.taylor.coefficients import ONE_THEN_ZERO, ORDER, o
from hybrid.compiler.taylor.convolutions import padded
from hybrid.compiler.taylor.loops import GROUPS, StateLoop, TangentLoop, reciprocal
from hybrid.compiler.taylor.pairs import columns_of
from hybrid.compiler.taylor.series import PAIRS, Recurrences
from hybrid.expression.derivatives import derivative, directional, divergence
from hybrid.expression.graph import mentions, nodes_of
from hybrid.expression.nodes import ZERO, Expression, Symbol, add, order_of
from hybrid.expression.operations import Absolute
from hybrid.expression.tabulated import tables_of_time
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import FROM_LAST_STEP, FROM_ZERO, NARROW, WIDE

# Columns after those of the guards: the time since the start of the step, the integral of div f. All columns
# up to here are written and evaluated as whole vectors. The root of a desingularised mode comes next.
CLOCK, DIVERGENCE, OTHERS = range(3)
# Smallest start of a guard whose root is taken, as a share of the sizes of the terms of the guard.
FLOOR = 1e-17
# As a share of these sizes: smaller differences between the guard and the square of the root are rounding.
SAME_ROOT = 1e-13


def write_series(
    field: Sequence[Expression],
    guards: Sequence[Expression],
    symbols: Symbols,
    body_of: Callable[..., Body] | None = None,
) -> Series:
    """The series of a field in time, without and with tangent vectors."""
    body = (body_of or Body)(symbols, guards, (), lambda _: ONE_THEN_ZERO)
    seeds = seeds_of(symbols)
    tangents = directional(field, seeds)
    trace = divergence(field, symbols.variables)
    return body.assemble(symbols.x, *names_of_state(symbols), field, guards, trace, tangents, seeds)


def harmonics_of(field: Sequence[Expression], symbols: Symbols) -> dict[Expression, Symbol]:
    """Symbols for harmonics, exponentials and tables of linear functions of time, closed under ``d/dt``.

    On a clock of their own they are states like others: their rates share the factor of all rates.
    """
    found: dict[Expression, Symbol] = {}
    for node in sorted(nodes_of(ELEMENTARY, *field), key=order_of):
        slope = derivative(node.args[0], symbols.t)
        if slope is ZERO or mentions(slope, (symbols.t,)) or mentions(node, symbols.x):
            continue
        for function in PAIRS.get(type(node), (type(node),))[:2]:
            found.setdefault(function(node.args[0]), Symbol(f"h{len(found)}"))
    for table in sorted(tables_of_time(*field), key=order_of):
        for order in range(table.pieces.degree - table.derived + 1):
            found.setdefault(table.differentiated(order), Symbol(f"h{len(found)}"))
    return found


def seeds_of(symbols: Symbols) -> dict[Symbol, Symbol]:
    """The component of a tangent vector that belongs to each state."""
    return {x: Symbol(f"v{i}") for i, x in enumerate(symbols.x)}


def names_of_state(symbols: Symbols) -> tuple[list[int], list[Any]]:
    """Columns of the state, and the initial values of its components."""
    n = len(symbols.x)
    return [*range(n)], [at("x", i) for i in range(n)]


class Body:
    """The body of one mode: allots columns and nests the loops.

    Parameters
    ----------
    others
        Symbols besides the states, each of which has a column.
    time
        The coefficients of time from the first on, as a function of the prefix of the local variables.
    """

    # Columns fill whole registers of so many numbers.
    register = WIDE
    recurrences = Recurrences
    state_loop: Any = StateLoop
    tangent_loop: Any = TangentLoop

    def __init__(
        self,
        symbols: Symbols,
        guards: Sequence[Expression],
        others: Iterable[Symbol],
        time: Callable[[str], Code],
    ) -> None:
        self.symbols, self.time = symbols, time
        self.n = len(symbols.x)
        self.behind_guards = self.n + len(guards)
        self.columns = padded(self.behind_guards + OTHERS, self.register)
        self.rows = {symbol: self.allot() for symbol in others}
        self.constants = Constants()
        self.preamble: list[Statement] = []
        self.at_start: dict[Expression, Any] = {}

    def column(self, place: int) -> int:
        """A column after those of the guards."""
        return self.behind_guards + place

    def start_root(self, root: Code, z: Expression, order: int, place: int, *, goes_on: bool) -> None:
        """Statements for the initial value of the ``root`` of ``z``, which is the guard in a place.

        With a speed of zero too, a root of zero would stay there. So a root that is small starts below the
        rounding of ``z``. It starts at zero only where the kernel knows that the guard is zero and moves on.
        A root that ``goes_on`` starts with its value at the end of the last step. Its error is as small as
        that of the speed of ``z``; near zero, the error of ``z`` itself would make a far larger one.
        """
        sizes = add(*(Absolute(derivative(z, x)) * Absolute(x) for x in self.symbols.x))
        self.at_start[z] = power_of(root, order)
        guard, size, last, origin, apart, least, same = map(
            get, ("z", "size", "last", "origin", "apart", "least", "same")
        )
        close = SAME_ROOT * size
        # A stored value this close to the root is taken as the root, whichever step stored it.
        is_same = call("and", call("<=", apart, close), less(close, guard))
        if goes_on:
            is_same = call("or", is_same, equal(origin, float(FROM_LAST_STEP)))
        extracted = call("sqrt", least) if order == 2 else least ** (1 / order)
        self.preamble += [
            *assignments([guard, size], [z, sizes]),
            put(last, call("abs", at("out", ORDER + 1, self.n + place))),
            put(origin, at("out", ORDER + 2, self.n + place)),
            put(apart, call("abs", power_of(last, order) - guard)),
            put(same, is_same),
            put(least, call("max", guard, FLOOR * size, 1e-300)),
            put(root, either(same, last, extracted)),
            put(root, either(equal(origin, float(FROM_ZERO)), 0.0, root)),
        ]

    def allot(self) -> int:
        """A new column."""
        self.columns += 1
        return self.columns - 1

    def assemble(
        self,
        names: Sequence[Symbol | None],
        columns: list[int],
        starts: list[Any],
        rates: Sequence[Expression],
        guards: Sequence[Expression],
        trace: Expression,
        tangents: Sequence[Expression],
        seeds: dict[Symbol, Symbol],
    ) -> Series:
        """The series without and with tangent vectors.

        Those without know nothing of what only tangent vectors need: the products in their rates, and the
        divergence.
        """
        free = self.columns
        alone = self._state("s", names, columns, starts, rates, guards)
        places = self._place_pairs(alone)
        width, self.columns = self.columns, free
        names, rates = [*names, None], [*rates, trace]
        columns, starts = [*columns, self.column(DIVERGENCE)], [*starts, 0.0]
        moved = self._state("a", names, columns, starts, rates, guards)
        vectors = self.recurrences(
            dict.fromkeys(seeds.values(), 0), None, self.allot, "b", self.constants, moved.block, lanes=True
        )
        vectors.expect(seeds.values(), tangents)
        carried = self.tangent_loop(list(seeds.values()), vectors)
        carried.compute(tangents)
        placed = self._place_pairs(moved) | carried.places()
        shared = [*self.preamble, *self.constants.statements(), *self._sizes(), put(o, 0)]
        return Series(
            (*named(places), *shared, *alone.first(), each_order(alone.higher())),
            (
                *named(placed),
                groups(self.n, self.tangent_loop.width),
                *shared,
                *moved.first(),
                each_order(moved.higher()),
                *carried.statements(),
            ),
            padded(max(width, self.columns), self.register),
            0,
            carried.columns,
        )

    def _sizes(self) -> list[Statement]:
        """Statements for what errors of the guards are judged by, besides the terms of their series."""
        return []

    def _state(
        self,
        prefix: str,
        names: Sequence[Symbol | None],
        columns: list[int],
        starts: list[Any],
        rates: Sequence[Expression],
        guards: Sequence[Expression],
    ) -> Any:
        """The loop of the state and of all other quantities in ``rates``; local names have a prefix."""
        block = self._block(prefix)
        block.expect(names, rates)
        moved = self.state_loop(names, columns, rates, starts, block)
        crossing = {self.n + place: block.coefficient(guard) for place, guard in enumerate(guards)}
        moved.write_front(self.behind_guards + OTHERS, crossing)
        return moved

    def _block(self, prefix: str) -> Recurrences:
        """The recurrences of the state and of what has columns besides; local names have a prefix."""
        state = {x: i for i, x in enumerate(self.symbols.x)}
        time = self.symbols.t, self.time(prefix)
        return Recurrences(
            {**state, **self.rows}, time, self.allot, prefix, self.constants, at_start=self.at_start
        )

    def _place_pairs(self, loop: StateLoop) -> dict[str, int]:
        """Columns for the factors of convolutions; returns those of each block, and of each second factor."""
        block, found, places = loop.block, loop.layers(), dict[str, int]()
        for name, count in columns_of(found).items():
            if block.common_left is not None and name == found[0].left:
                continue
            self.columns = padded(self.columns, WIDE)
            places[name] = self.columns
            self.columns += padded(count)
        for layer in found:
            for column, place in enumerate(layer.places):
                places[f"{block.prefix}c{place}"] = places[layer.right] + column
        return places


def power_of(root: Code, order: int) -> Any:
    """A whole power as a product."""
    return reduce(mul, [root] * order)


def groups(n: int, width: int = NARROW) -> Statement:
    """The statement that computes the number of groups of ``width`` tangent vectors."""
    return put(GROUPS, (call("length", "x") // n + (width - 2)) // width)


def named(places: Mapping[str, int]) -> list[Statement]:
    """Names for columns."""
    return [whole(name, place) for name, place in places.items()]


def each_order(statements: Sequence[Statement]) -> Statement:
    """The loop over all orders above zero."""
    return loop("o", 1, ORDER + 1, [put(get("shrink"), reciprocal(o)), *statements])
