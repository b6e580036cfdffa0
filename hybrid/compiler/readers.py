"""What depends on a component of the state, as the expressions of a model say."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hybrid.compiler.written import Written
from hybrid.expression.graph import mentions, symbols_of
from hybrid.expression.nodes import Expression, Symbol
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import BY_FLOW, BY_GUARD, BY_NOTHING
from hybrid.system.graph import HybridSystem


def readers(
    system: HybridSystem,
    fields: Sequence[Written],
    guards: Sequence[Written],
    conditions: Sequence[Written],
    resets: Sequence[Written],
    symbols: Symbols,
) -> tuple[tuple[int, ...], ...]:
    """By mode and component: what depends on it there besides its own rate and its own row of resets."""
    return tuple(
        _in_mode(system, mode.name, field, guards, conditions, resets, symbols)
        for mode, field in zip(system.modes, fields, strict=True)
    )


def _in_mode(
    system: HybridSystem,
    mode: str,
    field: Written,
    guards: Sequence[Written],
    conditions: Sequence[Written],
    resets: Sequence[Written],
    symbols: Symbols,
) -> tuple[int, ...]:
    leaving = [i for i, transition in enumerate(system.transitions) if transition.source == mode]
    places = range(system.dimension)
    decided = _symbols_in(each for i in leaving for each in (guards[i], conditions[i]))
    moved = [_symbols_in([field], place) for place in places]
    thrown = [_symbols_in((resets[i] for i in leaving), place) for place in places]

    def reader(place: int) -> int:
        symbol = symbols.x[place]
        if decided is None or symbol in decided:
            return BY_GUARD
        others = [rows[other] for rows in (moved, thrown) for other in places if other != place]
        return BY_FLOW if any(each is None or symbol in each for each in others) else BY_NOTHING

    return tuple(map(reader, places))


def _symbols_in(functions: Iterable[Written], row: int | None = None) -> set[Symbol] | None:
    """The symbols in functions, or in one row of each; None if one could not be traced."""
    found: set[Symbol] = set()
    for each in functions:
        if each.expressions is None:
            return None
        found |= symbols_of(*(each.expressions if row is None else each.expressions[row : row + 1]))
    return found


def is_free(expressions: Iterable[Expression] | None, variables: Sequence[Symbol]) -> bool:
    """Whether expressions are known, and depend on none of the variables."""
    return expressions is not None and not any(mentions(expression, variables) for expression in expressions)
