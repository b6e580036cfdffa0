"""The source of the functions that are compiled for a system, and the facts that are told of it.

Each function is one function ``(index, t, x, p, out)``, with the index of a mode or of a transition, that
fills ``out`` and allocates nothing. ``x`` may be longer than the state. Derivatives have ``n + 1``
columns, time last; the Jacobian of a field leaves the cells alone that are proved zero, but for those of
time. The variational field is the one function that reads all of ``x (n (1 + k),)``: the state and ``k``
tangent vectors. It writes their derivatives and, one place further, the divergence of the field.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import attrs

from hybrid.compiler.bounds.program import programs
from hybrid.compiler.bounds.residues import residue_of_guard
from hybrid.compiler.cases import body_text, cases_of_index, function_text
from hybrid.compiler.curvature import curvature
from hybrid.compiler.emitted import Emitted, Programs, Propagator, Series
from hybrid.compiler.jacobians import gradient, slope_columns, with_time, zeros_first
from hybrid.compiler.parts import LATER, PARTS
from hybrid.compiler.places import placed
from hybrid.compiler.readers import is_free, readers
from hybrid.compiler.rows import moving_places
from hybrid.compiler.sources import Sources, first_of
from hybrid.compiler.steep import steep_inside
from hybrid.compiler.told import told, where_it_jumps
from hybrid.compiler.traced import Traces
from hybrid.compiler.writer import Writer
from hybrid.compiler.written import Written, variational
from hybrid.expression.continuity import has_jumps, may_be_abrupt
from hybrid.expression.graph import forget
from hybrid.expression.signs import simplified

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem


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
        sources = Sources(system, Writer(system, {} if traces is None else traces))
        found: dict[str, Any] = {name: fact(sources) for name, fact in FACTS.items()}
        return Emitted(**found | moving_places(system), tables=sources.tables.packed())
    finally:
        forget()


def text_of(system: HybridSystem, part: str) -> str:
    """The text of a part that `emit` has left out."""
    assert system.growth is not None
    try:
        return _text(Sources(system, Writer(system, system.growth.written)), part)
    finally:
        forget()


def _texts(a: Sources) -> dict[str, str]:
    texts = {part: _text(a, part) for part in PARTS if part not in LATER}
    # What is shared by all parts of a model is laid out once: the numbers of tables and what is not traced.
    waits = a.system.growth is not None and not a.tables.places and not a.writer.opaque
    return texts if waits else texts | {part: _text(a, part) for part in LATER}


def _text(a: Sources, part: str) -> str:
    cases = {name: cases_of_index(BODIES[name](a)) for name in PARTS[part]}
    return a.tables.located("".join(function_text(name, each) for name, each in cases.items()))


def _values(a: Sources, functions: Sequence[Written]) -> list[str]:
    return [a.writer.text("value", each, each.value) for each in functions]


def _curvatures(a: Sources) -> list[str]:
    return [
        a.writer.text(f"curvature {straight}", each, partial(curvature, expression, straight, a.symbols))
        for each, expression, straight in zip(a.guards, a.traced, a.affine, strict=True)
    ]


def _derivatives(a: Sources, name: str, rows: Any, functions: Sequence[Written]) -> list[str]:
    n = a.system.dimension
    return [a.writer.text(name, each, partial(rows, each.derivative, n)) for each in functions]


def _series(a: Sources, *, tangent: bool, abreast: bool) -> list[str]:
    series, places = (a.abreast, a.places_abreast) if abreast else (a.series, a.places)
    texts = [
        # Registers of several runs are no entries of arrays, which loops over statements need.
        a.writer.text("tangent", each, each.tangent_statements, roll=not abreast)
        if tangent
        else a.writer.text("series", each, each.statements, roll=not abreast)
        for each in series
    ]
    return placed(places, texts)


# By function: what writes its statements for each index.
BODIES: dict[str, Callable[[Sources], list[str]]] = {
    "field": lambda a: [*_values(a, a.evaluated), *map(body_text, a.crossing[1])],
    "field_jacobian": lambda a: _derivatives(a, "jacobian", with_time, a.evaluated),
    "variational_field": lambda a: [
        a.writer.text("variational", each, partial(variational, each, a.system.dimension))
        for each in a.evaluated
    ],
    "guard": lambda a: _values(a, [*a.guards, *a.conditions, *a.numbers]),
    "guard_gradient": lambda a: _derivatives(a, "gradient", gradient, a.guards),
    "guard_curvature": _curvatures,
    "reset": lambda a: _values(a, a.resets),
    "reset_jacobian": lambda a: _derivatives(a, "slopes", zeros_first, a.resets),
    "series": partial(_series, tangent=False, abreast=False),
    "tangent_series": partial(_series, tangent=True, abreast=False),
    "series_abreast": partial(_series, tangent=False, abreast=True),
    "tangent_series_abreast": partial(_series, tangent=True, abreast=True),
}


def _programs(a: Sources) -> Programs:
    not_affine = [None if affine else guard for affine, guard in zip(a.affine, a.traced, strict=True)]
    cancelling = [each.expression for of_mode in a.residues for each in of_mode]
    return programs(
        not_affine,
        [each.expression for of_mode in a.forcings for each in of_mode],
        [*cancelling, *(residue_of_guard(guard, a.symbols) for guard in a.traced)],
        a.symbols,
        a.tables,
    )


def _each(groups: Sequence[Sequence[Any]], name: str) -> tuple[Any, ...]:
    return tuple(getattr(each, name) for group in groups for each in group)


def _abrupt(a: Sources) -> tuple[bool, ...]:
    return tuple(
        field.expressions is None
        or any(may_be_abrupt(simplified(rate, known), a.symbols.x) for rate in field.expressions)
        for field, known in a.rates
    )


def _steep_inside(a: Sources) -> tuple[str, ...]:
    pairs = zip(a.fields, a.boundaries, strict=True)
    return tuple(told(a.system, steep_inside(each.expressions, around, a.symbols)) for each, around in pairs)


def _timed_guard(a: Sources) -> tuple[bool, ...]:
    pairs = zip(a.clocks, a.guards, strict=True)
    return tuple(not (clock or is_free(guard.expressions, (a.symbols.t,))) for clock, guard in pairs)


def _jumping_reset(a: Sources) -> tuple[bool, ...]:
    on_the_way = (a.symbols.t, *a.symbols.x[: a.system.tangent_dimension])  # where counters stand still
    return tuple(each.expressions is None or has_jumps(each.expressions, on_the_way) for each in a.resets)


def _without_code(propagator: Propagator) -> Propagator:
    """The propagator without its statements, which are in the texts of the model."""
    return attrs.evolve(
        propagator,
        series=_bare(propagator.series),
        abreast=None if propagator.abreast is None else _bare(propagator.abreast),
    )


def _bare(series: Series) -> Series:
    return attrs.evolve(series, statements=(), tangent_statements=())


# What is found for each field of `Emitted`, which says what it means. What is not traced is written as
# opaque, and tables are gathered, as texts and programs are made: these come first.
FACTS: dict[str, Callable[[Sources], Any]] = {
    "texts": _texts,
    "programs": _programs,
    "opaque": lambda a: a.writer.opaque,
    "affine_guard": lambda a: a.affine,
    "plain_guard": lambda a: tuple(guard.plain for guard in a.guards),
    "guard_in_series": lambda a: a.guards_in_series,
    "row": lambda a: a.row,
    "first_forcing": lambda a: first_of(a.forcings),
    "forcing_component": lambda a: _each(a.forcings, "component"),
    "forcing_kind": lambda a: _each(a.forcings, "kind"),
    "first_residue": lambda a: first_of(a.residues),
    "residue_component": lambda a: _each(a.residues, "component"),
    "slope_columns": lambda a: tuple(
        slope_columns(each.derivative, a.system.dimension) for each in a.evaluated
    ),
    "traced_field": lambda a: tuple(field.expressions is not None for field in a.fields),
    "surface": lambda a: a.surfaces[0],
    "orientation": lambda a: a.surfaces[1],
    "abrupt": _abrupt,
    "autonomous": lambda a: tuple(is_free(field.expressions, (a.symbols.t,)) for field in a.fields),
    "discontinuities": lambda a: tuple(
        where_it_jumps(a.system, i, a.fields[i], a.boundaries[i], a.symbols) for i in range(len(a.fields))
    ),
    "proved_period": lambda a: a.has_proved_period,
    "steep": lambda a: tuple(told(a.system, powers) for powers in a.steep),
    "steep_inside": _steep_inside,
    "crossing": lambda a: a.crossing[0],
    "timed_guard": _timed_guard,
    "timed_reset": lambda a: tuple(not is_free(reset.expressions, (a.symbols.t,)) for reset in a.resets),
    "read_by": lambda a: readers(a.system, a.fields, a.guards, a.conditions, a.resets, a.symbols),
    "keeps_state": lambda a: tuple(reset.expressions == [*a.symbols.x] for reset in a.resets),
    "jumping_reset": _jumping_reset,
    "propagators": lambda a: tuple(map(_without_code, a.propagators)),
    "tangent_start": lambda a: a.places.vectors,
    "tangent_start_abreast": lambda a: a.places_abreast.vectors,
}
