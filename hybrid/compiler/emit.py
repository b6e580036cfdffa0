"""The source of the functions that are compiled for a system.

Each function is one function ``(index, t, x, p, out)``, with the index of a mode or of a transition, that
fills ``out`` and allocates nothing. ``x`` may be longer than the state. Derivatives have ``n + 1``
columns, time last; the Jacobian of a field leaves the cells alone that are proved zero, but for those of
time. The variational field is the one function that reads all of ``x (n (1 + k),)``: the state and ``k``
tangent vectors. It writes their derivatives and, one place further, the divergence of the field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import accumulate
from typing import TYPE_CHECKING, Any, TypeVar

import attrs

from hybrid.compiler.bounds.forcing import forcings
from hybrid.compiler.bounds.program import programs
from hybrid.compiler.bounds.residues import residue_of_guard, residues
from hybrid.compiler.cases import body_text, cases_of_index, function_text
from hybrid.compiler.curvature import curvature
from hybrid.compiler.emitted import NO_SERIES, Emitted, Propagator, Series
from hybrid.compiler.jacobians import (
    cells,
    gradient,
    place_of,
    slope_columns,
    with_time,
    zeros_first,
)
from hybrid.compiler.opaque import SLOPES, OpaqueFunction, check_plain
from hybrid.compiler.parts import PARTS
from hybrid.compiler.places import placed, places_of
from hybrid.compiler.propagators.choice import propagator
from hybrid.compiler.propagators.equations import Boundary, known_positive
from hybrid.compiler.readers import is_free, readers
from hybrid.compiler.rows import moving_places, place_of_row, with_place_of_row
from hybrid.compiler.statements.code import Code, Statement, at, put
from hybrid.compiler.statements.values import assignments, unprintable
from hybrid.compiler.steep import fields_at_crossings, steep_at_guards, steep_inside
from hybrid.compiler.surfaces import surfaces
from hybrid.compiler.tables import Tables
from hybrid.compiler.told import told, where_it_jumps
from hybrid.compiler.traced import Traces, expressions_of, period_of
from hybrid.compiler.written import Written, beyond_guards, called, item, variational
from hybrid.errors import ModelError
from hybrid.expression.continuity import has_jumps, may_be_abrupt
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.graph import forget, nodes_of
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol
from hybrid.expression.operations import JUMPING
from hybrid.expression.periodicity import is_periodic
from hybrid.expression.plain import plain
from hybrid.expression.signs import simplified
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.tracing import Symbols, TraceError, model_symbols
from hybrid.system.checks import derivative_has_time_column
from hybrid.system.derivatives import complex_step_error
from hybrid.system.functions import (
    CONDITION,
    GUARD,
    ModelFunction,
    condition_function,
    field_function,
    guard_function,
    number_functions,
    reset_function,
)

if TYPE_CHECKING:
    from hybrid.system.elements import Transition
    from hybrid.system.graph import HybridSystem

Result = TypeVar("Result")


def emit(system: HybridSystem, traces: Traces | None = None) -> Emitted:
    """Trace and differentiate every function of a system, and write the source of what is compiled.

    ``traces`` holds what has been traced before.

    Raises
    ------
    ModelError
        If a function can neither be traced nor differentiated by the complex step, and comes without
        a derivative.
    """
    try:
        return _emitted(system, {} if traces is None else traces)
    finally:
        forget()


def _emitted(system: HybridSystem, traces: Traces) -> Emitted:
    writer = _Writer(system, traces)
    fields = [writer.write(field_function(mode, system.variables)) for mode in system.modes]
    guards = [writer.write(guard_function(transition)) for transition in system.transitions]
    conditions = [_written_condition(writer, transition) for transition in system.transitions]
    resets = [_written_reset(writer, system, i) for i in range(len(system.transitions))]
    numbers = [writer.condition(each) for each in number_functions(system.transitions, system.variables)]
    boundaries = [_boundaries(system, mode.name, guards, writer.symbols) for mode in system.modes]
    propagators = [
        writer.remembered(
            ("propagator", id(mode.field), tuple(around)),
            partial(propagator, field.expressions, around, writer.symbols),
        )
        for mode, field, around in zip(system.modes, fields, boundaries, strict=True)
    ]
    symbols = writer.symbols
    evaluated = [
        writer.remembered(
            ("beyond", id(mode.field), id(mode.jacobian), tuple(around)),
            partial(beyond_guards, field, around, symbols),
        )
        for mode, field, around in zip(system.modes, fields, boundaries, strict=True)
    ]
    on_the_way = (symbols.t, *symbols.x[: system.tangent_dimension])  # where counters stand still
    # The zeros of a clock are known: nothing is asked of it as a function but its gradient.
    clocks = [transition.clock is not None for transition in system.transitions]
    affine = tuple(
        clock or _is_affine(guard, symbols.variables) for clock, guard in zip(clocks, guards, strict=True)
    )
    crossed = [guard for clock, guard in zip(clocks, guards, strict=True) if not clock]
    traced = [None if guard.expressions is None else guard.expressions[0] for guard in guards]
    n = system.dimension
    steep = [
        writer.remembered(
            ("steep", id(mode.field), tuple(around)),
            partial(steep_at_guards, field.expressions, around, symbols),
        )
        for mode, field, around in zip(system.modes, fields, boundaries, strict=True)
    ]
    crossing, at_crossings = fields_at_crossings(system, fields, steep, guards, resets, boundaries, symbols)
    series = [each.series for each in propagators]
    places = places_of(series, with_room=system.growth is not None)
    abreast = [each.abreast or NO_SERIES for each in propagators]
    beside = places_of(abreast, with_room=system.growth is not None, whole=1)
    text = writer.text
    bodies: dict[str, list[str]] = {
        "field": [
            *(text("value", each, each.value) for each in evaluated),
            *map(body_text, at_crossings),
        ],
        "field_jacobian": [
            text("jacobian", each, partial(with_time, each.derivative, n)) for each in evaluated
        ],
        "variational_field": [text("variational", each, partial(variational, each, n)) for each in evaluated],
        "guard": [text("value", each, each.value) for each in (*guards, *conditions, *numbers)],
        "guard_gradient": [text("gradient", each, partial(gradient, each.derivative, n)) for each in guards],
        "guard_curvature": [
            text(f"curvature {straight}", each, partial(curvature, expression, straight, symbols))
            for each, expression, straight in zip(guards, traced, affine, strict=True)
        ],
        "reset": [text("value", each, each.value) for each in resets],
        "reset_jacobian": [text("slopes", each, partial(zeros_first, each.derivative, n)) for each in resets],
        "series": placed(places, [text("series", each, each.statements) for each in series]),
        "tangent_series": placed(places, [text("tangent", each, each.tangent_statements) for each in series]),
        # Registers of several runs are no entries of arrays, which loops over statements need.
        "series_abreast": placed(
            beside, [text("series", each, each.statements, roll=False) for each in abreast]
        ),
        "tangent_series_abreast": placed(
            beside, [text("tangent", each, each.tangent_statements, roll=False) for each in abreast]
        ),
    }
    surface, orientation = writer.surfaces(traced)
    pulses = [
        forcings(field.expressions, known_positive(around), symbols)
        for field, around in zip(fields, boundaries, strict=True)
    ]
    forcing = [each for of_mode in pulses for each in of_mode]
    residual = [
        residues(field.expressions, _gradients(system, mode.name, guards), symbols)
        for field, mode in zip(fields, system.modes, strict=True)
    ]
    cancelling = [each for of_mode in residual for each in of_mode]
    not_affine = [None if affine[i] else expression for i, expression in enumerate(traced)]
    row = place_of_row([*guards, *conditions, *resets], len(system.parameters))
    tables = Tables(len(system.parameters) + (row >= 0))
    return Emitted(
        texts={
            part: tables.located("".join(function_text(name, cases_of_index(bodies[name])) for name in names))
            for part, names in PARTS.items()
        },
        opaque=writer.opaque,
        affine_guard=affine,
        plain_guard=tuple(guard.plain for guard in guards),
        guard_in_series=_guards_in_series(system, propagators),
        programs=programs(
            not_affine,
            [each.expression for each in forcing],
            [*(each.expression for each in cancelling), *(residue_of_guard(g, symbols) for g in traced)],
            symbols,
            tables,
        ),
        **moving_places(system),
        row=row,
        tables=tables.packed(),
        first_forcing=tuple(accumulate(map(len, pulses), initial=0)),
        forcing_component=tuple(each.component for each in forcing),
        forcing_kind=tuple(each.kind for each in forcing),
        first_residue=tuple(accumulate(map(len, residual), initial=0)),
        residue_component=tuple(each.component for each in cancelling),
        slope_columns=tuple(slope_columns(each.derivative, n) for each in evaluated),
        traced_field=tuple(field.expressions is not None for field in fields),
        surface=surface,
        orientation=orientation,
        abrupt=tuple(
            field.expressions is None
            or any(
                may_be_abrupt(simplified(rate, known_positive(around)), symbols.x)
                for rate in field.expressions
            )
            for field, around in zip(fields, boundaries, strict=True)
        ),
        autonomous=tuple(is_free(field.expressions, (symbols.t,)) for field in fields),
        discontinuities=tuple(
            where_it_jumps(system, i, fields[i], boundaries[i], symbols) for i in range(len(fields))
        ),
        proved_period=_has_proved_period(system, [*fields, *crossed, *conditions, *resets], writer),
        steep=tuple(told(system, powers) for powers in steep),
        steep_inside=tuple(
            told(system, steep_inside(field.expressions, around, symbols))
            for field, around in zip(fields, boundaries, strict=True)
        ),
        crossing=crossing,
        timed_guard=tuple(
            not (clock or is_free(guard.expressions, (symbols.t,)))
            for clock, guard in zip(clocks, guards, strict=True)
        ),
        timed_reset=tuple(not is_free(reset.expressions, (symbols.t,)) for reset in resets),
        read_by=readers(system, fields, guards, conditions, resets, symbols),
        keeps_state=tuple(reset.expressions == [*symbols.x] for reset in resets),
        jumping_reset=tuple(
            reset.expressions is None or has_jumps(reset.expressions, on_the_way) for reset in resets
        ),
        propagators=tuple(map(_without_code, propagators)),
        tangent_start=places.vectors,
        tangent_start_abreast=beside.vectors,
    )


def _without_code(propagator: Propagator) -> Propagator:
    """The propagator without its statements, which are in the texts of the model."""
    return attrs.evolve(
        propagator,
        series=_bare(propagator.series),
        abreast=None if propagator.abreast is None else _bare(propagator.abreast),
    )


def _bare(series: Series) -> Series:
    return attrs.evolve(series, statements=(), tangent_statements=())


class _Writer:
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


def _written_reset(writer: _Writer, system: HybridSystem, index: int) -> Written:
    function = reset_function(system.transitions[index], system.variables)
    return writer.identity() if function is None else writer.write(function)


def _boundaries(
    system: HybridSystem, mode: str, guards: Sequence[Written], symbols: Symbols
) -> list[Boundary]:
    return [
        Boundary(
            None if written.expressions is None else written.expressions[0],
            -transition.guard.direction if _ends_mode(transition) else 0,
            _is_affine(written, symbols.variables),
        )
        for transition, written in zip(system.transitions, guards, strict=True)
        if transition.source == mode and transition.is_searched
    ]


def _gradients(
    system: HybridSystem, mode: str, guards: Sequence[Written]
) -> list[Sequence[Expression] | None]:
    """The gradients of the guards in a mode; None for one that is not traced."""
    pairs = zip(system.transitions, guards, strict=True)
    written = [guard for transition, guard in pairs if transition.source == mode and not transition.clock]
    return [None if guard.jacobian is None or guard.given else guard.jacobian[0] for guard in written]


def _has_proved_period(system: HybridSystem, written: Iterable[Written], writer: _Writer) -> bool:
    """Whether all traced functions are proved to have the declared period, at any parameters."""
    if system.period is None:
        return True
    period = period_of(system, writer.traces)
    if period is None:
        return False
    t = writer.symbols.t
    return all(each.expressions is not None and is_periodic(each.expressions, t, period) for each in written)


def _guards_in_series(system: HybridSystem, propagators: Sequence[Propagator]) -> tuple[bool, ...]:
    """By transition: whether the series of its source mode hold its guard; none follow guards of a start."""
    held = {mode: iter(each.guards) for mode, each in zip(system.mode_names, propagators, strict=True)}
    return tuple(
        transition.is_searched and next(held[transition.source], False) for transition in system.transitions
    )


def _ends_mode(transition: Transition) -> bool:
    """Whether no state beyond the guard stays in the mode."""
    return transition.source != transition.target and transition.guard.when is None


def _written_condition(writer: _Writer, transition: Transition) -> Written:
    function = condition_function(transition)
    return Written([], [], []) if function is None else writer.condition(function)


def _is_affine(written: Written, variables: Sequence[Symbol]) -> bool:
    """Whether the derivative in the variables, which come first, is proved to depend on none of them."""
    if written.expressions is None or written.jacobian is None:
        return False
    # A floor or a sign has slope zero on both sides of its jumps.
    jumps = nodes_of((*JUMPING, Tabulated), *written.expressions)
    entries = [entry for row in written.jacobian for entry in row[: len(variables)]]
    return is_free(jumps, variables) and is_free(entries, variables)
