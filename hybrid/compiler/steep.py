"""Powers below one of a guard: the field is finite where the guard is zero, and its slope is infinite there.

A contact that starts with the square root of its depth is an example. The flow across such a guard has a
derivative if the guard has a speed: the slope grows like ``z**(p - 1)``, and its integral is finite.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from hybrid.compiler.propagators.equations import Boundary, known_positive
from hybrid.compiler.statements.code import Statement, at
from hybrid.compiler.statements.values import assignments
from hybrid.compiler.taylor.roots import is_multiple
from hybrid.compiler.written import Written, beyond_guards
from hybrid.expression.graph import all_replaced, contains, is_whole, mentions, nodes_of, replaced
from hybrid.expression.nodes import ONE, ZERO, Expression, Power, Symbol, order_of
from hybrid.expression.operations import (
    Absolute,
    CubeRoot,
    Less,
    Maximum,
    Minimum,
    Select,
    Sign,
    Step,
)
from hybrid.expression.signs import simplified
from hybrid.expression.tracing import Symbols
from hybrid.kernels.types.codes import NO_MODE

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem

SWITCHES = (Absolute, Maximum, Minimum, Sign, Step, Select)


def steep_powers(expressions: Sequence[Expression], symbols: Symbols) -> list[Expression]:
    """The powers that may have an infinite slope where their base is zero; also those of parameters."""
    found = nodes_of((Power, CubeRoot), *expressions)
    return sorted((node for node in found if _is_steep(node, symbols)), key=order_of)


def _is_steep(node: Expression, symbols: Symbols) -> bool:
    if not mentions(node.args[0], symbols.variables):
        return False
    if isinstance(node, CubeRoot):
        return True
    exponent = node.exponent
    return not is_whole(exponent) and not (exponent.is_number and not 0 < exponent.value < 1)


def steep_at_guards(
    expressions: Sequence[Expression] | None, boundaries: Sequence[Boundary], symbols: Symbols
) -> list[Expression]:
    """The steep powers of the guards at which a mode ends."""
    known = known_positive(boundaries)
    return [
        node
        for node in steep_powers(expressions or [], symbols)
        if any(is_multiple(simplified(node.args[0], known), guard, symbols) for guard in known)
    ]


def steep_inside(
    expressions: Sequence[Expression] | None, boundaries: Sequence[Boundary], symbols: Symbols
) -> list[Expression]:
    """The steep powers of what switches inside of a mode, such as ``abs(v)**0.5``."""
    known = known_positive(boundaries)
    found = []
    for node in steep_powers(expressions or [], symbols):
        base = simplified(node.args[0], known)
        if any(is_multiple(base, guard, symbols) for guard in known):
            continue
        if isinstance(node, CubeRoot) or (contains(base, SWITCHES) and node.exponent.is_number):
            found.append(node)
    return found


def fields_at_crossings(
    system: HybridSystem,
    fields: Sequence[Written],
    steep: Sequence[Sequence[Expression]],
    guards: Sequence[Written],
    resets: Sequence[Written],
    boundaries: Sequence[Sequence[Boundary]],
    symbols: Symbols,
) -> tuple[tuple[tuple[int, int], ...], list[list[Statement]]]:
    """The numbers of the fields before and behind each transition, and the statements of further fields.

    A further field has steep powers that are zero exactly, as they are on the guard of the transition.
    Rounding leaves a guard of the size 1e-16 beside zero, whose fourth root is 1e-4.
    """
    numbers, bodies = [], list[list[Statement]]()

    def number_of(mode: str | None, guard: Written, states: Sequence[Expression] | None) -> int:
        if mode is None:
            return NO_MODE
        index = system.mode_index(mode)
        expressions = fields[index].expressions
        if not steep[index] or expressions is None or guard.expressions is None or states is None:
            return index
        moved, known = dict(zip(symbols.x, states, strict=True)), known_positive(boundaries[index])
        zeros = _zeros(steep[index], guard.expressions[0], moved, known, symbols)
        if not zeros:
            return index
        left = all_replaced(expressions, zeros)
        value = assignments([at("out", i) for i in range(len(left))], left)
        bodies.append(beyond_guards(Written(value, [], left, [], True), boundaries[index], symbols).value)
        return len(fields) + len(bodies) - 1

    for transition, guard, reset in zip(system.transitions, guards, resets, strict=True):
        before = number_of(transition.source, guard, symbols.x)
        numbers.append((before, number_of(transition.target, guard, reset.expressions)))
    return tuple(numbers), bodies


def _zeros(
    steep: Sequence[Expression],
    guard: Expression,
    moved: Mapping[Symbol, Expression],
    known: Sequence[Expression],
    symbols: Symbols,
) -> dict[Expression, Expression]:
    """The steep powers that are zero where a guard is, and their values.

    ``moved`` are the states in terms of those at which the guard is evaluated: a reset may lie between.
    """
    zeros: dict[Expression, Expression] = {}
    for node in steep:
        if is_multiple(replaced(simplified(node.args[0], known), moved), guard, symbols):
            exponent = ONE if isinstance(node, CubeRoot) else node.exponent
            zeros[node] = ZERO if exponent.is_number else Select(Less(ZERO, exponent), ZERO, node)
    return zeros
