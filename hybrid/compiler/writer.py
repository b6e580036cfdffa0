"""The functions of a model as statements, with their derivatives, and those that stay opaque."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import attrs

from hybrid.compiler.cases import body_text
from hybrid.compiler.jacobians import cells, place_of
from hybrid.compiler.opaque import SLOPES, OpaqueFunction, check_plain
from hybrid.compiler.rows import with_place_of_row
from hybrid.compiler.statements.code import Code, Statement, at, put
from hybrid.compiler.statements.values import assignments, unprintable
from hybrid.compiler.surfaces import surfaces
from hybrid.compiler.traced import Traces, expressions_of
from hybrid.compiler.written import Written, called, item
from hybrid.errors import ModelError
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.nodes import ONE, ZERO, Expression
from hybrid.expression.plain import plain
from hybrid.expression.tracing import Symbols, TraceError, model_symbols
from hybrid.system.checks import derivative_has_time_column
from hybrid.system.derivatives import complex_step_error
from hybrid.system.functions import CONDITION, GUARD, ModelFunction

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem

Result = TypeVar("Result")


class Writer:
    """Writes the statements of model functions, and gathers those that stay opaque."""

    def __init__(self, system: HybridSystem, traces: Traces) -> None:
        self.system, self.traces = system, traces
        self.symbols: Symbols = model_symbols(system.dimension, len(system.parameters))
        self.opaque: dict[str, OpaqueFunction] = {}
        # A system that grows has most of its functions from its last stage.
        self._known: dict[Any, Any] = {} if system.growth is None else system.growth.written

    def remembered(self, key: Any, make: Callable[[], Result]) -> Result:
        """What ``make`` returns; the same as the last time for the same key.

        A key may hold identities: the system, or what makes it grow, keeps its functions.
        """
        if key not in self._known:
            self._known[key] = make()
        found: Result = self._known[key]
        return found

    def text(
        self,
        name: str,
        source: Any,
        statements: Sequence[Statement] | Callable[[], Sequence[Statement]],
        *,
        roll: bool = True,
    ) -> str:
        """Statements as text, or those that are made; written once for the object that they come from."""
        # The object is kept with the text: the key is its identity.
        found, _ = self.remembered(
            ("text", name, id(source)),
            lambda: (body_text(statements() if callable(statements) else statements, roll=roll), source),
        )
        return found

    def write(self, function: ModelFunction) -> Written:
        """Statements for a function and its derivative."""
        return self.remembered(("written", *function.identity), lambda: self._write(function))

    def _write(self, function: ModelFunction) -> Written:
        targets = [at("out", i) for i in range(function.size or 1)]
        try:
            own = self.traced(function)
            may_be_plain = function.kind == GUARD and function.derivative is None
            expressions = [*map(plain, own)] if may_be_plain else own
            jacobian = jacobian_of(expressions[: function.kept], self.symbols.variables)
            memory = function.memory_rows(self.system.dimension + 1)
            jacobian += [[ONE if entry else ZERO for entry in row] for row in memory]
            _check_printable(entry for row in jacobian for entry in row if entry is not ZERO)
        except ModelError as error:
            return self._write_opaque(function, targets, error)
        given = function.derivative is not None
        derivative = self._given_derivative(function) if given else cells(jacobian, place_of(function.size))
        value, is_plain = assignments(targets, expressions), expressions != own
        return Written(value, derivative, expressions, jacobian, given, is_plain)

    def condition(self, function: ModelFunction) -> Written:
        """Statements for the condition of a guard, whose truth values are 1 and 0."""
        return self.remembered((CONDITION, *function.identity), lambda: self._condition(function))

    def _condition(self, function: ModelFunction) -> Written:
        try:
            [value] = self.traced(function)
        except ModelError as reason:
            return Written(self._opaque_value(function, [at("out", 0)], reason), [])
        return Written(assignments([at("out", 0)], [value]), [], [value])

    def surfaces(self, traced: Sequence[Expression | None]) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The zero sets of all guards, as `hybrid.compiler.surfaces.surfaces` numbers them."""
        scaled = self.remembered("surfaces", dict[Expression, Any])
        return surfaces([each.guard.function for each in self.system.transitions], traced, scaled)

    def identity(self) -> Written:
        """The reset of a transition that has none."""
        return self.remembered("identity", self._identity)

    def _identity(self) -> Written:
        n = self.system.dimension
        value = assignments([at("out", i) for i in range(n)], self.symbols.x)
        return Written(value, [put(at("out", i, i), 1.0) for i in range(n)], [*self.symbols.x])

    def traced(self, function: ModelFunction, *, derivative: bool = False) -> list[Expression]:
        """Expressions of a function or of its derivative; ModelError if it has none that can be compiled."""
        expressions = expressions_of(self.system, function, self.traces, derivative=derivative)
        expressions = with_place_of_row(expressions, len(self.system.parameters))
        _check_printable(expressions)
        return expressions

    def _write_opaque(self, function: ModelFunction, targets: Sequence[Code], reason: ModelError) -> Written:
        value = self._opaque_value(function, targets, reason)
        if function.derivative is not None:
            return Written(value, self._given_derivative(function))
        error = complex_step_error(self.system.variables, function)
        if error is not None:
            raise ModelError(
                f"{function.title} cannot be differentiated. Tracing stopped: {reason}. The complex step "
                f"stopped: {type(error).__name__}: {error}. Write it with NumPy functions (np.sin, "
                f"np.maximum) or give its derivative as {function.derivative_name}=."
            ) from (reason.__cause__ or error)
        return Written(value, self._complex_step(function, reason))

    def _opaque_value(
        self, function: ModelFunction, targets: Sequence[Code], reason: ModelError
    ) -> list[Statement]:
        name = self._opaque_name(function, reason)
        values = [item("r", i) if i < function.returned else 0.0 for i in range(len(targets))]
        return [called("r", name), *map(put, targets, values)]

    def _complex_step(self, function: ModelFunction, reason: ModelError) -> list[Statement]:
        name, columns = self._opaque_name(function, reason), self.system.dimension + 1
        self.opaque[name] = attrs.evolve(self.opaque[name], slopes=True)
        statements = [called(f"r{j}", f"{name}{SLOPES}", j) for j in range(columns)]
        statements += [
            put(place_of(function.size)(i, j), item(f"r{j}", i))
            for i in range(function.kept)
            for j in range(columns)
        ]
        return statements + self._memory_cells(function)

    def _given_derivative(self, function: ModelFunction) -> list[Statement]:
        n = self.system.dimension
        try:
            entries = self.traced(function, derivative=True)
        except ModelError as reason:
            return self._opaque_derivative(function, reason)
        width = len(entries) // function.rows
        zeros = [ZERO] * (n + 1 - width)
        rows = [[*entries[i * width : (i + 1) * width], *zeros] for i in range(function.rows)]
        return cells(rows, place_of(function.size))

    def _opaque_derivative(self, function: ModelFunction, reason: ModelError) -> list[Statement]:
        width = self.system.dimension + derivative_has_time_column(self.system.variables, function)
        name = self._opaque_name(function, reason, width)
        statements = [called("r", name)]
        statements += [
            put(place_of(function.size)(i, j), item("r", i * width + j))
            for i in range(function.kept)
            for j in range(width)
        ]
        return statements + self._memory_cells(function)

    def _memory_cells(self, function: ModelFunction) -> list[Statement]:
        """Statements for the rows of a derivative that are not those of the user's function."""
        rows = function.memory_rows(self.system.dimension + 1)
        return [
            put(place_of(function.size)(i, j), entry)
            for i, row in enumerate(rows, function.kept)
            for j, entry in enumerate(row)
            if entry
        ]

    def _opaque_name(self, function: ModelFunction, reason: ModelError, width: int | None = None) -> str:
        """Name of a function that stays opaque; with ``width``, of its derivative of so many columns."""
        title, called = function.title, function.function
        shape = () if function.size is None else (function.returned,)
        completed = function.completed is not None
        if width is not None and function.derivative is not None:
            title, called = function.derivative_title, function.derivative
            shape, completed = (*shape, width), False
        for name, known in self.opaque.items():
            if known.function is called and known.shape == shape:
                return name
        name, names, why = f"model_{len(self.opaque)}", tuple(self.system.parameters), str(reason).rstrip(".")
        opaque = OpaqueFunction(
            title, called, why, self.system.variables.components, names, shape, completed=completed
        )
        check_plain(title, called)
        self.opaque[name] = opaque
        return name


def _check_printable(expressions: Iterable[Expression]) -> None:
    missing = unprintable(expressions)
    if missing is not None:
        raise TraceError(f"the function {missing} has no compiled form")
