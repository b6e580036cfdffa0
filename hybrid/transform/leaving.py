"""The transitions that leave a cell: over its surfaces, along them, and those that the author wrote."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from typing import Any, cast

import attrs

from hybrid.errors import ModelError
from hybrid.expression.evaluation import expressed, scalar
from hybrid.expression.graph import replaced
from hybrid.expression.nodes import ZERO, Expression, Number
from hybrid.expression.operations import And, Less, Not, Or
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import Resolved, Switches
from hybrid.expression.tabulated import in_branches
from hybrid.expression.tracing import Symbols, TraceError, model_symbols, trace
from hybrid.system.clocks import Clock
from hybrid.system.elements import Function, Guard, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import Variables
from hybrid.transform import corners, rests
from hybrid.transform.cells import Cell, Choice, Pieces
from hybrid.transform.edges import Edge, Outgoing, all_of
from hybrid.transform.landings import landed, on_side
from hybrid.transform.naming import Names, copy_name
from hybrid.transform.ticks import timed


class Leaving:
    """The transitions that leave the cells of a system, one cell at a time.

    ``pieces`` are those of each mode, ``outgoing`` the author's transitions, ``names`` those of cells.
    """

    def __init__(
        self,
        system: HybridSystem,
        surfaces: Surfaces,
        names: Names,
        outgoing: Sequence[Outgoing],
        pieces: Sequence[Pieces],
    ) -> None:
        self.original, self.variables = system, system.variables
        self.surfaces, self.names, self.outgoing, self.pieces = surfaces, names, outgoing, pieces
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        self.heights: dict[int, Function] = {}

    def name_of(self, cell: Cell) -> str:
        """Name of the mode of a cell."""
        own = self.original.modes[cell.mode].name
        sides = self.names.cell(self.surfaces.known, cell.sides)
        several = len(self.original.modes) > 1
        return f"{own}: {sides}" if sides and several else sides or own

    def edges(self, cell: Cell) -> Iterator[Edge]:
        """Every transition that leaves a cell."""
        for number, side in cell.sides:
            if side:
                yield from self._arrivals(cell, number, side)
            else:
                yield from self._departures(cell, number)
        for outgoing in self.outgoing:
            if outgoing.transition.source == self.original.modes[cell.mode].name:
                yield from self._copies(cell, outgoing)

    def _arrivals(self, cell: Cell, number: int, side: int) -> Iterator[Edge]:
        """The transitions of a state that reaches a surface from one side."""
        pieces = self.pieces[cell.mode]
        height, time = self._height(number), timed(self.surfaces, number)
        free = pieces.ties.free(dict(cell.branches))
        crossing: Any = time.clock(side, self.names.words) if time else Guard(height, -side)
        beyond, turns = {**dict(cell.sides), number: -2 * side}, False
        for choice in pieces.choices(beyond):
            sides = {**dict(cell.branches), **choice.sides}
            extra = self._on(choice.chosen)
            if pieces.rests(sides, number):
                for resting in pieces.choices({**sides, number: 0}):
                    more = [*extra, *self._on(resting.chosen)]
                    yield self._edge(cell, resting.cell, Guard(height, -side, when=all_of(more)))
                continue
            joined = free and not corners.are_apart(pieces, sides, [*free, number])
            passes = not pieces.jumps(sides, number) or not (joined or pieces.may_attract(sides, number))
            limit = None if time or joined else rests.cell_of(pieces, cell, sides, number)
            if time or not passes:
                yield self._edge(cell, choice.cell, self._at_start(number, side, extra))
            if passes:
                yield self._edge(cell, choice.cell, attrs.evolve(crossing, when=all_of(extra)), limit=limit)
                continue
            if joined:
                turns = True
                continue
            at = pieces.between(sides, number)
            up, down = (at.arrives_from_below, at.crosses_up), (at.arrives_from_above, at.crosses_down)
            arrives, crosses = up if side < 0 else down
            for sliding in pieces.choices({**sides, number: 0}):
                more = [self._condition(arrives), *extra, *self._on(sliding.chosen)]
                yield self._edge(cell, sliding.cell, Guard(height, -side, when=all_of(more)))
            onwards = [self._condition(crosses), *extra]
            yield self._edge(cell, choice.cell, Guard(height, -side, when=all_of(onwards)), limit=limit)
        if turns:
            yield from self._turns(cell, crossing, corners.arrivals(free, number, side))

    def _at_start(self, number: int, side: int, extra: list[Expression]) -> Guard:
        """The guard that excludes a start on the wrong side of a surface."""
        if timed(self.surfaces, number) is None:
            return Guard(self._height(number), -side, when=all_of(extra), at_start=True)
        # A tick at the start does not fire, so its instant belongs to one side: no rounding is allowed for.
        beyond = [*self._on([(number, -side)]), *extra]
        return Guard(scalar(Number(-side)), -side, when=all_of(beyond), at_start=True)

    def _turns(
        self, cell: Cell, guard: Guard | Clock, ways: Sequence[corners.Corner], leaving: int = -1
    ) -> Iterator[Edge]:
        """The transitions at an intersection of surfaces, to each cell that is consistent there.

        The run ends if none is. ``leaving`` is a surface that the state is about to leave.
        """
        pieces, source = self.pieces[cell.mode], self.name_of(cell)
        asked = corners.reaches_end(pieces, cell, ways[0], leaving)
        possible = []
        for k, corner in enumerate(ways):
            moved = pieces.ties.along(dict(cell.branches), {n: 2 * s for n, s in corner.items()})
            left = [number for number in cell.sliding if moved[number]]
            reset = Reset(corners.projection(pieces, cell, left)) if left else None
            for choice in pieces.choices({**dict(cell.sides), **moved}):
                sides = {**dict(cell.branches), **choice.sides}
                if not corners.may_slide(pieces, sides):
                    continue
                when = corners.consistent(pieces, sides, [*corner], leaving if k == 0 else None)
                possible.append(reduce(And, [*when, *self._on(choice.chosen)]))
                fires = attrs.evolve(cast(Any, guard), when=all_of([*asked, possible[-1]]))
                yield self._edge(cell, choice.cell, fires, reset)
        where = self.names.cell(self.surfaces.known, [(number, 0) for number in ways[0]])
        end = attrs.evolve(cast(Any, guard), when=all_of([*asked, Not(reduce(Or, possible))]))
        yield Edge(Transition(source, None, end, name=f"{source}: no way on at {where}"), None)

    def _edge(
        self,
        cell: Cell,
        target: Cell,
        guard: Guard | Clock,
        reset: Reset | None = None,
        limit: Cell | None = None,
    ) -> Edge:
        source, to = self.name_of(cell), self.name_of(target)
        name = f"{source}->{to} at the start" if guard.at_start else f"{source}->{to}"
        rest = None if limit is None else self.name_of(limit)
        return Edge(Transition(source, to, guard, reset, name=name, accumulates_to=rest), target, limit)

    def _departures(self, cell: Cell, number: int) -> Iterator[Edge]:
        """The transitions of a state that slides along a surface and leaves it."""
        pieces, source, sides = self.pieces[cell.mode], self.name_of(cell), dict(cell.branches)
        led, free = number in pieces.ties.at(sides), pieces.ties.free(sides)
        near = pieces.beside(sides, number)
        is_off = rests.is_off(pieces, number) if led else self._condition(near.is_off)
        for side, choice in rests.around(pieces, cell, number):
            when = all_of([is_off, *self._on(choice.chosen)])
            yield self._edge(cell, choice.cell, Guard(self._height(number), side, when=when, at_start=True))
        if led or pieces.rests(sides, number):
            return
        surface = pieces.between(sides, number)
        apart = corners.are_apart(pieces, sides, free)
        if apart or number == free[0]:
            attracts = (
                self._function(surface.attraction) if apart else scalar(corners.attraction(pieces, sides))
            )
            at_start = Guard(attracts, -1, at_start=True)
            for guard, name in (at_start, "two-fold at start"), (Guard(attracts, -1), "two-fold"):
                yield Edge(Transition(source, None, guard, name=f"{source}: {name}"), None)
        if apart:
            left = pieces.ties.along(sides, {number: 2})
            reset = Reset(corners.projection(pieces, cell, [*left]))
            for side in (1, -1):
                speed = self._function(surface.speed_above if side > 0 else surface.speed_below)
                beyond = pieces.ties.along(sides, {number: 2 * side})
                for choice in pieces.choices({**dict(cell.sides), **beyond}):
                    when = all_of(self._on(choice.chosen))
                    yield self._edge(cell, choice.cell, Guard(speed, side, when=when), reset)
            return
        for side in (1, -1):
            speed = self._function(surface.speed_above if side > 0 else surface.speed_below)
            yield from self._turns(cell, Guard(speed, 0), corners.exits(free, number, side), number)

    def _height(self, number: int) -> Function:
        if number not in self.heights:
            self.heights[number] = scalar(self.surfaces.known[number].height)
        return self.heights[number]

    def _function(self, function: Function) -> Function:
        """A derived scalar function by its expression, which can be pickled."""
        return scalar(self._condition(function))

    def _condition(self, function: Function) -> Expression:
        [condition] = trace(function, self.variables.components, self.variables.parameter_names)
        return condition

    def _on(self, chosen: Sequence[tuple[int, int]]) -> list[Expression]:
        """Conditions that the state lies on these sides."""
        return [on_side(self.asked(number), side) for number, side in chosen]

    def asked(self, number: int) -> Expression:
        """What has the sign of a height; of one of time alone also at the instants at which its sides end."""
        time = timed(self.surfaces, number)
        return time.height if time else self.surfaces.known[number].height

    def _after_reset(self, height: Expression, after: Sequence[Expression]) -> Expression:
        return replaced(height, dict(zip(self.symbols.x, after, strict=True)))

    def _copies(self, cell: Cell, outgoing: Outgoing) -> Iterator[Edge]:
        """A user's transition in one cell: one for each side that the state may land on."""
        transition = outgoing.transition
        own = self.names.cell(self.surfaces.known, cell.sides)
        new: dict[str, Any] = {"source": self.name_of(cell), "part_of": transition.name}
        guard = self._smooth_guard(cell, outgoing)
        if transition.target is None:
            ends = attrs.evolve(transition, guard=guard, name=copy_name(transition.name, own), **new)
            yield Edge(ends, None)
            return
        asked = [] if guard.when is None else [self._truth(guard.when)]
        limit = self._limit(cell, transition)
        new["accumulates_to"] = None if limit is None else self.name_of(limit)
        landings = [
            (chosen, after, target, conditions)
            for chosen, after in self._after(cell, outgoing)
            for target, conditions in self._landed(cell, transition.target, after)
        ]
        for chosen, after, target, conditions in landings:
            more = [*self._on(chosen), *conditions]
            when = all_of([*asked, *more]) if more else guard.when
            to = self.names.cell(self.surfaces.known, target.sides)
            copy = attrs.evolve(
                transition,
                target=self.name_of(target),
                guard=attrs.evolve(cast(Any, guard), when=when),
                reset=transition.reset if after == outgoing.reset else Reset(expressed(after or ())),
                name=copy_name(transition.name, own, to if len(landings) > 1 else ""),
                **new,
            )
            yield Edge(copy, target, limit)

    def _truth(self, condition: Function) -> Expression:
        """A user's condition, positive or true, as a truth value."""
        [value] = traced("a condition of a guard", condition, self.variables, self.symbols)
        return Less(ZERO, value)

    def _smooth_guard(self, cell: Cell, outgoing: Outgoing) -> Guard | Clock:
        """The guard of a user's transition with the branches of a cell; as it is if it has none."""
        guard = outgoing.transition.guard
        if outgoing.guard is None or isinstance(guard, Clock):
            return guard
        result = Switches([outgoing.guard], self.surfaces).resolved(_upper(cell.branches))
        assert isinstance(result, Resolved), "a cell decides every switch of its guards"
        if not result.used:
            return guard
        return attrs.evolve(guard, function=scalar(result.entries[0]), gradient=None)

    def _after(
        self, cell: Cell, outgoing: Outgoing
    ) -> Iterator[tuple[tuple[tuple[int, int], ...], list[Expression] | None]]:
        """The states after a user's reset, for each choice of the branches that it has."""
        if outgoing.reset is None:
            yield (), None
            return
        switches = Switches(outgoing.reset, self.surfaces)
        waiting: list[dict[int, int]] = [{}]
        while waiting:
            chosen = waiting.pop()
            result = switches.resolved({**_upper(cell.sides), **chosen})
            if isinstance(result, int):
                waiting += [{**chosen, result: +1}, {**chosen, result: -1}]
            else:
                yield tuple(chosen.items()), outgoing.reset if not result.used else [*result.entries]

    def _landed(
        self, cell: Cell, target: str, after: list[Expression] | None
    ) -> Iterator[tuple[Cell, list[Expression]]]:
        """The cells of the target mode that a jump may lead to, with its conditions."""
        choices = self._landings(cell, target, after)
        pieces = self.pieces[self.original.mode_index(target)]
        return landed(pieces, choices, self.asked, lambda each: self._after_reset(each, after or ()))

    def _landings(self, cell: Cell, target: str, after: list[Expression] | None) -> list[Choice]:
        """The cells of the target mode that the state after a reset may lie in."""

        def decide(number: int) -> int | None:
            return None if after is None else self._side_after(cell, number, after)

        landings = self.pieces[self.original.mode_index(target)].choices({}, decide)
        if after is None and len(landings) > 1:
            raise ModelError(
                f"split: a reset into mode {target!r} cannot be traced, so it is not known on which side of "
                "its switches the state lands. Write the reset with NumPy functions (np.where, np.abs)."
            )
        return landings

    def _side_after(self, cell: Cell, number: int, after: Sequence[Expression]) -> int | None:
        """The side of a surface on which a state lands from a cell, if it is always the same."""
        height = self._after_reset(self.surfaces.known[number].height, after)
        if not height.mask:
            # On the surface itself the flow decides.
            return None if float(height) == 0 else -1 if float(height) < 0 else 1
        match = self.surfaces.match(height)
        if match is None:
            return None
        same, orientation = match
        sides = dict(cell.sides)
        side = sides[same] if same in sides else self.surfaces.implied(same, sides)
        return None if side is None else side * orientation

    def _limit(self, cell: Cell, transition: Transition) -> Cell | None:
        """A cell for the limit of chatter, on the sides of the cell; its starts lead on from there."""
        if transition.accumulates_to is None:
            return None
        return self._landings(cell, transition.accumulates_to, [*self.symbols.x])[0].cell


def traced(what: str, function: Function, variables: Variables, symbols: Symbols) -> list[Expression]:
    """A function of the author's as expressions in one branch of each table; ModelError if it has none."""
    try:
        found = trace(function, variables.components, variables.parameter_names)
    except TraceError as error:
        why = f"split: {what} cannot be traced, so its kinks and jumps cannot be found: {error}."
        raise ModelError(why) from error
    return in_branches(found, symbols.x)


def _upper(sides: Sequence[tuple[int, int]]) -> dict[int, int]:
    """Sides with the branch above on each surface along which the state slides."""
    return {number: side or 2 for number, side in sides}
