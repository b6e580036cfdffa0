"""How a system is split: cells become modes, their surfaces guards."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import reduce
from itertools import islice, product
from typing import Any, cast

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.expression.evaluation import Program, expressed, scalar
from hybrid.expression.graph import replaced
from hybrid.expression.nodes import ZERO, Expression, Number, Symbol
from hybrid.expression.operations import And, Less, Not, Or
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import Resolved, Switches
from hybrid.expression.tabulated import in_branches
from hybrid.expression.tracing import TraceError, model_symbols, trace
from hybrid.system.clocks import Clock
from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.elements import Function, Guard, Mode, Reset, Transition
from hybrid.system.functions import field_function, moving_field
from hybrid.system.graph import HybridSystem, watched_by
from hybrid.system.growth import Place
from hybrid.transform import corners, rests
from hybrid.transform.cells import Cell, Choice, Pieces
from hybrid.transform.edges import Edge, Outgoing, all_of
from hybrid.transform.landings import landed, on_side
from hybrid.transform.naming import Names, copy_name
from hybrid.transform.stages import Stages, numbered
from hybrid.transform.ticks import timed
from hybrid.transform.titles import titles_of

# Parts may differ from the field by so much of its largest value: other orders of the same sums.
AGREEMENT = 1e-9
# Sizes of the states at which they are compared.
SIZES = (0.1, 1.0, 10.0)
# A system of more modes than this is made in stages. Of the many modes around a mode a run visits few.
MOST_WHOLE = 12


class Splitter(Stages):
    """Makes the modes and transitions of the split system, cell by cell."""

    def __init__(self, system: HybridSystem, modes: Mapping[str, Any] | None = None) -> None:
        super().__init__()
        self.original, self.called = system, modes
        self.watched = watched_by(system)
        self.heights: dict[int, Function] = {}
        self.variables = system.variables
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        self.surfaces = Surfaces(self.symbols)
        self.names = Names(self.variables, titles_of(modes, self.variables, self.surfaces))
        self.outgoing = [Outgoing.of(i, each, self.variables) for i, each in enumerate(system.transitions)]
        self.pieces = [self._pieces(i, mode) for i, mode in enumerate(system.modes)]
        self.known: dict[Cell, tuple[Mode, list[Edge]]] = {}
        self.made: dict[Cell, None] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _begun, (self.original, self.called)

    def begin(self) -> HybridSystem:
        """The whole system if it is small; else its first stage."""
        first = [choice.cell for pieces in self.pieces for choice in islice(pieces.cells({}), MOST_WHOLE)]
        self._check_values()
        self._make(first, MOST_WHOLE + 1)
        if len(self.made) > MOST_WHOLE:
            # A run makes the modes around its start.
            self.made = dict.fromkeys(first[:1])
            return self.current
        self.names.titles.check({*self._titles()}, self.current.mode_names)
        return self.current

    def _titles(self) -> Iterator[str]:
        """The names that the author gave and that cells have, each as often as it is used."""
        known = self.surfaces.known
        for cell in self.made:
            yield from self.names.titles.of(
                cell.sides, lambda number, side: self.names.side(known, number, side)
            )[0]

    def extend(self, transition: str, place: Place, known: Collection[str]) -> bool:
        """Make the mode to which a transition leads; the place does not matter."""
        with self.lock:
            self._make([self.frontier[transition]], 1)
        return True

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Make the modes in which a run may start; whether there were any to be made."""
        values = self._values(t, x, parameters)
        with self.lock:
            cells = [
                self._cell_at(pieces, values)
                for pieces, own in zip(self.pieces, self.original.modes, strict=True)
                if mode is None or mode == own.name
            ]
            missing = [cell for cell in cells if cell not in self.made]
            self._make(missing, len(missing))
        return bool(missing)

    def _values(self, t: float, x: np.ndarray, parameters: np.ndarray) -> dict[Symbol, float]:
        return dict(
            zip((self.symbols.t, *self.symbols.x, *self.symbols.p), (t, *x, *parameters), strict=True)
        )

    def _cell_at(self, pieces: Pieces, values: dict[Symbol, float]) -> Cell:
        """The cell in which a point lies; above the surfaces that it lies on."""
        [choice] = pieces.cells({}, lambda number: self._side(number, values))
        return choice.cell

    def _check_values(self) -> None:
        """A ModelError if the field of a cell differs from the user's at a sample point in it."""
        parameters = self.original.parameter_values()
        for pieces, mode in zip(self.pieces, self.original.modes, strict=True):
            for size, (t, point) in product(SIZES, sample_points(self.original.dimension)):
                x = size * point
                cell = self._cell_at(pieces, self._values(t, x, parameters))
                fields = field_function(mode, self.variables).value, pieces.flow(dict(cell.branches))
                whole, part = (evaluate(self.variables, each, t, x, parameters) for each in fields)
                if whole is None or part is None:
                    continue
                scale = max(np.abs(whole).max(), np.abs(part).max())
                if np.abs(whole - part).max() > AGREEMENT * scale:
                    raise ModelError(
                        f"split: the part {self.name_of(cell)!r} of mode {mode.name!r} has other values than "
                        f"its field at t = {t}, x = {x}: {part}, not {whole}. Please report this model."
                    )

    def _side(self, number: int, values: dict[Symbol, float]) -> int:
        [height] = Program([self._asked(number)]).run(values)
        return 1 if height >= 0 else -1

    def _make(self, cells: Sequence[Cell], most: int) -> None:
        """Make these cells, and others that can be reached from them, nearest first."""
        waiting, made = deque(cells), 0
        while waiting and (made < most or waiting[0] in cells):
            cell = waiting.popleft()
            if cell in self.made:
                continue
            self.made[cell] = self.stage = None
            made += 1
            for edge in self._leaving(cell):
                waiting += [each for each in (edge.limit, edge.target) if each is not None]

    def _leaving(self, cell: Cell) -> list[Edge]:
        """The transitions that leave a cell."""
        if cell not in self.known:
            edges = [*self._edges(cell)]
            self.known[cell] = self._mode(cell), edges
        return self.known[cell][1]

    def _assembled(self) -> HybridSystem:
        """The system of all cells that have been made."""
        transitions: list[Transition] = []
        used = set[str]()
        for cell in self.made:
            for edge in self._leaving(cell):
                transition = edge.transition
                name = next(each for each in numbered(transition.name) if each not in used)
                used.add(name)
                # Names of earlier stages stay: a run in another thread may still be on such a stage.
                if edge.target is None or edge.target in self.made:
                    limit = transition.accumulates_to
                    if edge.limit is not None and edge.limit not in self.made:
                        self.frontier[name], limit = edge.limit, None
                    transitions.append(attrs.evolve(transition, name=name, accumulates_to=limit))
                    continue
                self.frontier[name] = edge.target
                onward = transition.source, None, transition.guard
                transitions.append(Transition(*onward, name=name, part_of=transition.part_of))
        modes = [self.known[cell][0] for cell in self.made]
        notes = (*self.original.notes, *self.names.notes)
        growth = self if self.frontier else None
        made: dict[str, Any] = {"modes": modes, "transitions": transitions, "notes": notes, "growth": growth}
        return attrs.evolve(self.original, **made, derived_from=self.watched)

    def name_of(self, cell: Cell) -> str:
        """Name of the mode of a cell."""
        own = self.original.modes[cell.mode].name
        sides = self.names.cell(self.surfaces.known, cell.sides)
        several = len(self.original.modes) > 1
        return f"{own}: {sides}" if sides and several else sides or own

    def _traced(self, what: str, function: Function) -> list[Expression]:
        try:
            found = trace(function, self.variables.components, self.variables.parameter_names)
        except TraceError as error:
            why = f"split: {what} cannot be traced, so its kinks and jumps cannot be found: {error}."
            raise ModelError(why) from error
        return in_branches(found, self.symbols.x)

    def _pieces(self, index: int, mode: Mode) -> Pieces:
        field = self._traced(f"the field of mode {mode.name!r}", field_function(mode, self.variables).value)
        watched = [
            each.guard
            for each in self.outgoing
            if each.transition.source == mode.name and each.guard is not None
        ]
        return Pieces(index, field, watched, self.variables, self.surfaces)

    def _mode(self, cell: Cell) -> Mode:
        original = self.original.modes[cell.mode]
        if not cell.branches:
            return attrs.evolve(original, name=self.name_of(cell), part_of=original.name)
        flow = self.pieces[cell.mode].flow(dict(cell.branches))
        return Mode(self.name_of(cell), moving_field(flow, self.variables), part_of=original.name)

    def _edges(self, cell: Cell) -> Iterator[Edge]:
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
        return [on_side(self._asked(number), side) for number, side in chosen]

    def _asked(self, number: int) -> Expression:
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
        [value] = self._traced("a condition of a guard", condition)
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
        return landed(pieces, choices, self._asked, lambda each: self._after_reset(each, after or ()))

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


def _begun(system: HybridSystem, modes: Mapping[str, Any] | None) -> Splitter:
    """The splitter of a system that has been pickled."""
    splitter = Splitter(system, modes)
    splitter.begin()
    return splitter


def _upper(sides: Sequence[tuple[int, int]]) -> dict[int, int]:
    """Sides with the branch above on each surface along which the state slides."""
    return {number: side or 2 for number, side in sides}
