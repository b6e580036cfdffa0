"""The tables of a system: their numbers lie behind its parameters, and their knots in time end steps.

So the code of a model is the same whatever its tables hold.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator

import numpy as np

from hybrid.compiler.traced import Traces, expressions_of
from hybrid.errors import ModelError
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import nodes_of
from hybrid.expression.nodes import Expression
from hybrid.expression.pieces import Pieces
from hybrid.expression.tabulated import Tabulated, has_knots_in_time
from hybrid.expression.tracing import model_symbols
from hybrid.system.functions import condition_function, field_function, guard_function
from hybrid.system.graph import HybridSystem

# The name of a table in generated text, before it is known where its numbers begin.
NAME = re.compile(r"\bT[0-9a-f]{16}\b")
# The rounding of an affine argument and of its inverse, as a share of the terms, with a margin.
MARGIN = 16.0 * float(np.finfo(float).eps)
# Halvings that bring an interval of this size down to two neighbouring numbers, unless these are next to 0.
MOST_HALVINGS = 64


class Tables:
    """The places of the tables of a system behind its parameters, in the order of the first question."""

    def __init__(self, parameters: int) -> None:
        self.end = parameters
        self.places: dict[Pieces, int] = {}

    def place(self, pieces: Pieces) -> int:
        """Where the numbers of a table begin."""
        if pieces not in self.places:
            self.places[pieces] = self.end
            self.end += len(pieces.numbers)
        return self.places[pieces]

    def located(self, text: str) -> str:
        """Generated text with the places of tables for their names."""
        return NAME.sub(lambda found: str(self.place(Pieces.known[found[0]])), text)

    def packed(self) -> str:
        """The numbers of all tables as text."""
        numbers = [pieces.numbers for pieces in self.places]
        return base64.b64encode(np.concatenate(numbers).tobytes()).decode() if numbers else ""


def unpacked(text: str) -> np.ndarray:
    """The numbers of all tables."""
    return np.frombuffer(base64.b64decode(text))


class Knots:
    """The times at which tables of time in the functions of each mode have their points.

    Attributes
    ----------
    first
        By mode: the first of its knots, and behind them the number of all.
    """

    def __init__(self, system: HybridSystem) -> None:
        self.system = system
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        traces: Traces = {}
        self.tables = [[*_tables_in_time(system, index, traces)] for index in range(len(system.modes))]
        counts = [sum(len(node.pieces.knots) for node in tables) for tables in self.tables]
        self.first = np.cumsum([0, *counts], dtype=np.int64)
        self._fixed: np.ndarray | None = None
        if not any(node.mask & self.symbols.p.mask for tables in self.tables for node in tables):
            self._fixed = self._found(system.parameter_values())

    def at(self, values: np.ndarray) -> np.ndarray:
        """The times ``(N,)``, increasing within each mode, at parameter values; infinity stands for none."""
        return self._found(values) if self._fixed is None else self._fixed

    def _found(self, values: np.ndarray) -> np.ndarray:
        nothing = np.empty(0)
        found = [
            np.concatenate([nothing, *(self._times(node, values) for node in tables)])
            for tables in self.tables
        ]
        return np.concatenate([np.sort(each) for each in found])

    def _times(self, node: Tabulated, values: np.ndarray) -> np.ndarray:
        """The first times at which the argument of a table has reached its knots, in floating point."""
        knots = node.pieces.knots
        if node.args[0] is self.symbols.t:
            return knots
        program, known = Program(node.args), dict(zip(self.symbols.p, values, strict=False))

        def argument(t: np.ndarray) -> np.ndarray:
            return np.asarray(program.run({**known, self.symbols.t: t})[0], dtype=float)

        start, end = argument(np.array([0.0, 1.0]))
        slope = end - start
        if not (np.isfinite(slope) and slope != 0.0):
            return np.full(len(knots), np.inf)
        times = (knots - start) / slope
        around = MARGIN * (np.abs(knots) + np.abs(start) + np.abs(end)) / abs(slope)
        low, high = times - around, times + around
        for _ in range(MOST_HALVINGS):
            middle = 0.5 * (low + high)
            # A falling argument leaves a piece right behind its knot, where that piece still holds.
            reached = argument(middle) >= knots if slope > 0.0 else argument(middle) < knots
            low, high = np.where(reached, low, middle), np.where(reached, middle, high)
        return high


def _tables_in_time(system: HybridSystem, index: int, traces: Traces) -> Iterator[Tabulated]:
    """The tables of time in the field of a mode, and in the guards and conditions that leave it."""
    mode = system.modes[index]
    leaving = [each for each in system.transitions if each.source == mode.name]
    functions = [field_function(mode, system.dimension), *map(guard_function, leaving)]
    functions += [each for each in map(condition_function, leaving) if each is not None]
    found: dict[tuple[Expression, bytes], Tabulated] = {}
    for function in functions:
        try:
            expressions = expressions_of(system, function, traces)
        except ModelError:
            continue
        for node in nodes_of(Tabulated, *expressions):
            if has_knots_in_time(node):
                found.setdefault((node.args[0], node.pieces.knots.tobytes()), node)
    yield from found.values()
