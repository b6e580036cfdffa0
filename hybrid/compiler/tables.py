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
from hybrid.expression.derivatives import derivative
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import nodes_of
from hybrid.expression.nodes import Expression
from hybrid.expression.pieces import Pieces
from hybrid.expression.tabulated import Tabulated, has_knots_in_time, repeat_of
from hybrid.expression.tracing import model_symbols
from hybrid.system.functions import condition_function, field_function, guard_function
from hybrid.system.graph import HybridSystem

# The name of a table in the text of code, before it is known where its numbers begin.
NAME = re.compile(r'"(T[0-9a-f]{16})"')
# The rounding of an affine argument and of its inverse, as a share of the terms, with a margin.
MARGIN = 16.0 * float(np.finfo(float).eps)
# The least argument below 0 that no rounding makes 0.
LEAST = float(np.finfo(float).tiny)


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
        """The text of code with the places of tables for their names."""
        return NAME.sub(lambda found: str(self.place(Pieces.known[found[1]])), text)

    def packed(self) -> str:
        """The numbers of all tables as text."""
        numbers = [pieces.numbers for pieces in self.places]
        return base64.b64encode(np.concatenate(numbers).tobytes()).decode() if numbers else ""


def unpacked(text: str) -> np.ndarray:
    """The numbers of all tables."""
    return np.frombuffer(base64.b64decode(text))


class Knots:
    """The times at which tables of time in the functions of each mode have their points.

    They come in groups: those that come once, and for each period those that come again and again.
    """

    def __init__(self, system: HybridSystem) -> None:
        self.system = system
        self.symbols = model_symbols(system.dimension, len(system.parameters))
        traces: Traces = {}
        self.groups: list[tuple[Expression | None, list[Tabulated]]] = []
        first = [0]
        for index in range(len(system.modes)):
            own: dict[Expression | None, list[Tabulated]] = {}
            for node in _tables_in_time(system, index, traces):
                own.setdefault(repeat_of(node), []).append(node)
            self.groups += own.items()
            first.append(len(self.groups))
        self.first_group = np.array(first, dtype=np.int64)
        self._fixed: dict[str, np.ndarray] | None = None
        if not any(node.mask & self.symbols.p.mask for _, tables in self.groups for node in tables):
            self._fixed = self._found(system.parameter_values())

    def at(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """The fields of a model that hold the knots, at parameter values; infinity stands for none."""
        return self._found(values) if self._fixed is None else self._fixed

    def _found(self, values: np.ndarray) -> dict[str, np.ndarray]:
        repeats, groups, bounds = [], [], []
        for repeat, tables in self.groups:
            length = 0.0 if repeat is None else self._number(repeat, values)
            repeats.append(length if 0.0 < length < np.inf else 0.0)
            if repeat is None:
                found = [self._times(node, values) for node in tables]
                knots, before = (np.concatenate(each) for each in zip(*found, strict=True))
            else:
                found = [self._times_in_period(node, values, length) for node in tables]
                knots = np.concatenate([*(times for times, _ in found), [length]])
                before = knots - np.concatenate([*(bands for _, bands in found), [0.0]])
            order = np.argsort(knots)
            groups.append(knots[order])
            # A step ends before each of the knots that are still to come.
            bounds.append(np.minimum.accumulate(before[order][::-1])[::-1])
        knots = np.concatenate([np.empty(0), *groups])
        return {
            "first_group": self.first_group,
            "repeat": np.array(repeats, dtype=float),
            "first_knot": np.cumsum([0, *map(len, groups)], dtype=np.int64),
            "knots": knots,
            "before_knots": np.concatenate([np.empty(0), *bounds]),
        }

    def _number(self, expression: Expression, values: np.ndarray, t: float = 0.0) -> float:
        known = dict(zip(self.symbols.p, values, strict=False))
        return float(Program([expression]).run({**known, self.symbols.t: t})[0])

    def _times_in_period(
        self, node: Tabulated, values: np.ndarray, length: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Times in a period at which ``(a t + b) % T`` is at a knot or begins again, and their rounding."""
        inner, within = node.args[0].args
        around = self._number(within, values)
        start, end = (self._number(inner, values, t) for t in (0.0, 1.0))
        knots = np.append(node.pieces.knots[(node.pieces.knots > 0.0) & (node.pieces.knots < around)], 0.0)
        with np.errstate(all="ignore"):
            times = ((knots - start) / (end - start)) % length
            bands = MARGIN * (np.abs(knots) + abs(start)) / abs(end - start)
        begins = times == 0.0
        times[begins] = length
        times[~(times > 0.0)] = np.inf
        bands = np.where(start == 0.0, 0.0, bands)
        # A falling argument leaves a piece right behind its knot, also at the start of the first period.
        soon = MARGIN * length if end < start and np.any(begins) else np.inf
        times, bands = np.append(times, soon), np.append(bands, MARGIN * length)
        return times, bands

    def _times(self, node: Tabulated, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first times at which ``a t + b`` has certainly reached the knots, and the last before them.

        Each function rounds ``a t + b`` in its own way. In between, the piece depends on this rounding, so no
        step looks there.
        """
        knots, t = node.pieces.knots, self.symbols.t
        if node.args[0] is t:
            return knots, np.nextafter(knots, -np.inf)
        start, slope = self._number(node.args[0], values), self._number(derivative(node.args[0], t), values)
        if not (np.isfinite(start) and np.isfinite(slope) and slope != 0.0):
            return np.full(len(knots), np.inf), np.full(len(knots), np.inf)
        times, bands = (knots - start) / slope, MARGIN * (np.abs(knots) + abs(start)) / abs(slope)
        # A falling argument leaves a piece right behind its knot, where that piece still holds.
        behind = times + bands if slope > 0.0 else times + np.maximum(bands, LEAST / -slope)
        return behind, np.nextafter(times - bands, -np.inf)


def _tables_in_time(system: HybridSystem, index: int, traces: Traces) -> Iterator[Tabulated]:
    """The tables of time in the field of a mode, and in the guards and conditions that leave it."""
    mode = system.modes[index]
    leaving = [each for each in system.transitions if each.source == mode.name]
    functions = [field_function(mode, system.variables), *map(guard_function, leaving)]
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
