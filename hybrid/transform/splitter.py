"""How a system is split: cells become modes, and grow from those that runs reach."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import islice, product
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import Symbol
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.tracing import model_symbols
from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.elements import Mode, Transition
from hybrid.system.functions import field_function, moving_field
from hybrid.system.graph import HybridSystem, watched_by
from hybrid.system.growth import Place
from hybrid.transform.cells import Cell, Pieces
from hybrid.transform.edges import Edge, Outgoing
from hybrid.transform.leaving import Leaving, traced
from hybrid.transform.naming import Names
from hybrid.transform.stages import Stages, numbered
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
        self.variables = system.variables
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        self.surfaces = Surfaces(self.symbols)
        self.names = Names(self.variables, titles_of(modes, self.variables, self.surfaces))
        self.outgoing = [Outgoing.of(i, each, self.variables) for i, each in enumerate(system.transitions)]
        self.pieces = [self._pieces(i, mode) for i, mode in enumerate(system.modes)]
        self.leaving = Leaving(system, self.surfaces, self.names, self.outgoing, self.pieces)
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
                    name = self.leaving.name_of(cell)
                    raise ModelError(
                        f"split: the part {name!r} of mode {mode.name!r} has other values than "
                        f"its field at t = {t}, x = {x}: {part}, not {whole}. Please report this model."
                    )

    def _side(self, number: int, values: dict[Symbol, float]) -> int:
        [height] = Program([self.leaving.asked(number)]).run(values)
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
            edges = [*self.leaving.edges(cell)]
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

    def _pieces(self, index: int, mode: Mode) -> Pieces:
        field = traced(
            f"the field of mode {mode.name!r}",
            field_function(mode, self.variables).value,
            self.variables,
            self.symbols,
        )
        watched = [
            each.guard
            for each in self.outgoing
            if each.transition.source == mode.name and each.guard is not None
        ]
        return Pieces(index, field, watched, self.variables, self.surfaces)

    def _mode(self, cell: Cell) -> Mode:
        original = self.original.modes[cell.mode]
        if not cell.branches:
            return attrs.evolve(original, name=self.leaving.name_of(cell), part_of=original.name)
        flow = self.pieces[cell.mode].flow(dict(cell.branches))
        return Mode(self.leaving.name_of(cell), moving_field(flow, self.variables), part_of=original.name)


def _begun(system: HybridSystem, modes: Mapping[str, Any] | None) -> Splitter:
    """The splitter of a system that has been pickled."""
    splitter = Splitter(system, modes)
    splitter.begin()
    return splitter
