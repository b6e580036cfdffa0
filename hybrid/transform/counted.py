"""Jumps of fields at times that parameters move, as events with a count of those that have passed.

A field that jumps at a time ``T(p)`` contributes ``(f_minus - f_plus) dT/dp`` to the derivative in a
parameter: the saltation term of a guard ``t - T(p)``. In a system whose parameters are components of the
state (`extended`), such a jump becomes that guard. The field reads a counter in its place, which the reset
changes; so the field is smooth between events.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import count, pairwise
from typing import Any

import attrs
import numpy as np

from hybrid.expression.evaluation import Program, expressed, scalar
from hybrid.expression.graph import Group, all_replaced, in_order, mentions
from hybrid.expression.nodes import HALF, ONE, ZERO, Expression, Symbol, add, number
from hybrid.expression.operations import (
    Ceiling,
    Floor,
    Less,
    LessEqual,
    Level,
    Remainder,
    Round,
    Select,
    Sign,
    Step,
    Truncate,
    TruncatedRemainder,
    WholeQuotient,
)
from hybrid.expression.pieces import Pieces, items
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.tracing import TraceError, model_symbols, trace
from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.derived_clock import DerivedClock
from hybrid.system.elements import Guard, Reset, Transition
from hybrid.system.functions import WholeReset
from hybrid.system.graph import HybridSystem, watched_below
from hybrid.system.moving import moving_numbers
from hybrid.system.variables import STATE, named_values

# Functions that jump, in terms of the two that count: a floor and a comparison.
IN_FLOORS: dict[type[Expression], Callable[..., Expression]] = {
    Ceiling: lambda u: -Floor(-u),
    Round: Round.in_other_terms,
    Truncate: lambda u: Select(Less(u, ZERO), -Floor(-u), Floor(u)),
    WholeQuotient: WholeQuotient.in_other_terms,
    Remainder: lambda a, b: a - b * Floor(a / b),
    TruncatedRemainder: lambda a, b: a - b * Truncate(a / b),
}
# A piece of a table that is narrower than this share of its place is a jump.
NARROW = 16.0 * np.finfo(float).eps
BINARY = (Less, LessEqual, Sign, Step)
JUMPS: tuple[Any, ...] = (*BINARY, Floor, Tabulated, *IN_FLOORS)


@attrs.frozen
class Count:
    """How many jumps of one function have passed, a counter.

    Attributes
    ----------
    symbol
        The counter.
    now
        The number at a point, from the function itself.
    thresholds
        What passes zero upwards where the count grows by one, and downwards where it falls by one. With each
        comes the condition for that; None if there always is a next jump.
    value
        The function, from the count.
    """

    symbol: Symbol
    now: Expression
    thresholds: tuple[tuple[Expression, Expression | None], ...]
    value: Expression


@attrs.frozen(eq=False)
class Counted:
    """A system whose fields count their jumps in time; ``original`` is the one that it was made from.

    Attributes
    ----------
    events
        Names of the transitions that count.
    counts
        In the order of their counters, each behind those that it depends on.
    """

    original: HybridSystem
    system: HybridSystem
    events: frozenset[str]
    counts: tuple[Count, ...]

    def events_in(self, mode: str) -> tuple[str, ...]:
        """Those of one mode."""
        leaving = (each.name for each in self.system.transitions if each.source == mode)
        return tuple(name for name in leaving if name in self.events)

    def state(self, t: float, x: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
        """The state at which the counts of a point are right, from a state of the original."""
        symbols, p = model_symbols(len(x), len(parameters)), parameters.values()
        values = dict(zip((symbols.t, *symbols.x, *symbols.p), (t, *x, *p), strict=True))
        for each in self.counts:
            [values[each.symbol]] = Program([each.now]).run(values)
        return np.append(x, [float(values[each.symbol]) for each in self.counts])


def counted(system: HybridSystem, moved: int) -> Counted:
    """The system in which the jumps of fields at times that the last ``moved`` components move are events.

    Those components are parameters, and do not move in time. Jumps at times that depend on other components
    stay as they are, and so do all jumps if a field cannot be traced or the state has no names.
    """
    same = Counted(system, system, frozenset(), ())
    if isinstance(system.state, int):
        return same
    try:
        fields = [trace(mode.field, system.variables.components, system.parameters) for mode in system.modes]
    except TraceError:
        return same
    counting = _Counting(system, moved)
    entries = counting.counted([entry for field in fields for entry in field])
    if not counting.counts:
        return same
    lengths = np.cumsum([0, *map(len, fields)])
    parts = [entries[first:last] for first, last in pairwise(lengths)]
    return counting.made(parts)


class _Counting:
    def __init__(self, system: HybridSystem, moved: int) -> None:
        self.original, self.n = system, system.dimension
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        last = system.tangent_dimension
        self.moved = {*tuple(self.symbols.x)[last - moved : last]}
        self.others = Group(each for each in self.symbols.x if each not in self.moved)
        self.counts: list[Count] = []

    def counted(self, entries: list[Expression]) -> list[Expression]:
        """The entries with counts in the place of jumps in time, innermost jumps first."""
        while moved := [node for node in in_order(entries) if self._is_moved(node)]:
            node = next(node for node in in_order(moved) if self._jumps_in_time(node))
            rule = IN_FLOORS.get(type(node))
            value = rule(*node.args) if rule is not None else self._count(node).value
            entries = all_replaced(entries, {node: value})
        return entries

    def _is_moved(self, node: Expression) -> bool:
        """Whether a node jumps at times that only the moved components decide."""
        counters = [each.symbol for each in self.counts]
        moves = mentions(node, (*self.moved, *counters)) and not mentions(node, self.others)
        return moves and self._jumps_in_time(node)

    def _jumps_in_time(self, node: Expression) -> bool:
        counters = [each.symbol for each in self.counts]
        if not isinstance(node, JUMPS) or isinstance(node, Level) or node.args[0] in counters:
            return False
        return mentions(node, (self.symbols.t, *counters)) and not (
            isinstance(node, Tabulated) and not node.jumps
        )

    def _count(self, node: Expression) -> Count:
        made = self._new(node, Symbol(f"x[{self.n + len(self.counts)}]"))
        self.counts.append(made)
        return made

    def _new(self, node: Expression, c: Symbol) -> Count:
        if isinstance(node, BINARY):
            u = node.args[1] - node.args[0] if isinstance(node, Less | LessEqual) else node.args[0]
            holds = LessEqual(ZERO, u) if isinstance(node, LessEqual) else Less(ZERO, u)
            value = 2 * c - 1 if isinstance(node, Sign) else c
            return Count(c, Select(holds, ONE, ZERO), ((u, Less(c, HALF)), (u, Less(HALF, c))), value)
        [u] = node.args
        if isinstance(node, Floor):
            return Count(c, node, ((u - c - 1, None), (u - c, None)), c)
        assert isinstance(node, Tabulated)
        knots, rows = _without_narrow(node.pieces.knots, node.pieces.derived(node.derived))
        beyond, away = (u - _item(c, each) for each in ([*knots, knots[-1]], [knots[0], *knots]))
        value = add(*(_item(c, rows[:, k]) * away**k for k in range(rows.shape[1])))
        number_of_piece = Tabulated(u, Pieces(knots, rows).places())
        conditions = Less(c, number(len(knots) - 0.5)), Less(HALF, c)
        return Count(c, number_of_piece, ((beyond, conditions[0]), (away, conditions[1])), value)

    def made(self, fields: list[list[Expression]]) -> Counted:
        """The system with these fields."""
        original = self.original
        taken = {*original.state_names, *original.parameters, *original.transition_names}
        free = (name for k in count(1) if (name := f"count{k}") not in taken)
        names = [next(free) for _ in self.counts]
        own = {mode.name: self._read_by(field) for mode, field in zip(original.modes, fields, strict=True)}
        transitions = [self._transition(each, own) for each in original.transitions]
        events = [each for name in original.mode_names for each in self._events(name, own[name], names)]
        system = attrs.evolve(
            original,
            counters=(*original.counters, *names),
            modes=[
                attrs.evolve(mode, field=expressed(field), jacobian=None, part_of=mode.part_of or mode.name)
                for mode, field in zip(original.modes, fields, strict=True)
            ],
            transitions=[*transitions, *events],
            # A count is no function of the phase.
            period=None,
            derived_from=watched_below(original),
        )
        return Counted(original, system, frozenset(each.name for each in events), tuple(self.counts))

    def _read_by(self, field: Iterable[Expression]) -> set[int]:
        """The places of the counts that a field reads, and of those that these counts depend on."""
        read, places = [*field], set[int]()
        for place, each in reversed([*enumerate(self.counts)]):
            if any(mentions(entry, (each.symbol,)) for entry in read):
                places.add(place)
                read += [each.now, *(height for height, _ in each.thresholds)]
        return places

    def _events(self, mode: str, own: set[int], names: list[str]) -> Iterator[Transition]:
        """The transitions that count in a mode; they lead to a part of the same mode, and enter none."""
        for place in sorted(own):
            each, name = self.counts[place], names[place]
            for (height, condition), way in zip(each.thresholds, (1, -1), strict=True):
                yield Transition(
                    mode,
                    mode,
                    Guard(scalar(height), way, when=None if condition is None else scalar(condition)),
                    Reset(expressed(self._after(place, way))),
                    name=f"{mode}: {name} {'up' if way > 0 else 'down'}",
                )

    def _after(self, place: int, way: int) -> list[Expression]:
        """The state after one count has changed: those that depend on the count are counted anew."""
        changed: dict[Symbol, Expression] = {self.counts[place].symbol: self.counts[place].symbol + way}
        for each in self.counts[place + 1 :]:
            if mentions(each.now, changed):
                [changed[each.symbol]] = all_replaced([each.now], changed)
        return [*self.symbols.x, *(changed.get(each.symbol, each.symbol) for each in self.counts)]

    def _counted_anew(self, places: Iterable[int]) -> Callable[..., Any]:
        """The counts, of which those in some places are right at the point where a mode is entered."""
        found: dict[Expression, Expression] = {}
        for place in sorted(places):
            [found[self.counts[place].symbol]] = all_replaced([self.counts[place].now], found)
        return expressed([found.get(each.symbol, each.symbol) for each in self.counts])

    def _transition(self, transition: Transition, own: Mapping[str, set[int]]) -> Transition:
        guard, reset = transition.guard, transition.reset
        when = None if guard.when is None else self._function(guard.when)
        moved: Guard | Clock
        if isinstance(guard, Clock):

            def numbers(x: Any, p: Any, clock: Clock = guard) -> tuple[Any, ...]:
                return numbers_of(clock, self._own(x), p)

            moving = moving_numbers(transition, self.original.variables)
            moved = DerivedClock(guard, numbers, when, guard.age, moving)
        else:
            moved = Guard(self._function(guard.function), guard.direction, when=when, at_start=guard.at_start)
        entered = transition.target in own and transition.target != transition.source
        counts = self._counted_anew(own[transition.target or ""] if entered else ())
        values = (
            self._function(WholeReset(reset.function, self.original.variables.components)) if reset else None
        )

        def after(t: Any, x: Any, p: Any) -> tuple[Any, ...]:
            found = tuple(x[: self.n] if values is None else values(t, x, p))
            return (*found, *counts(t, x, p))

        new = Reset(after) if reset is not None or entered else None
        return attrs.evolve(transition, guard=moved, reset=new, part_of=transition.part_of or transition.name)

    def _function(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of the original system as one of the counted state."""
        return lambda t, x, p: function(t, self._own(x), p)

    def _own(self, x: Any) -> Any:
        """The state of the original system."""
        return named_values(STATE, self.original.state_names, x[: self.n])


def _without_narrow(knots: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Knots and pieces without the pieces that are no wider than rounding: their two ends are one jump."""
    wide = np.diff(knots, append=np.inf) > NARROW * np.abs(knots)
    return knots[wide], rows[[0, *(1 + np.flatnonzero(wide))]]


def _item(c: Symbol, numbers: Any) -> Expression:
    """One of several numbers, by the count."""
    found: Expression = Tabulated(c, items(np.array(numbers, dtype=float)))
    return found
