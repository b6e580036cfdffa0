"""Search for jumps of a field in its expression; jumps proved to have size zero are left out.

If a field jumps on a surface in state space, tangent vectors change there as at a transition, but no
saltation matrix is known. A jump at a fixed time, independent of the state, leaves tangent vectors unchanged.
"""

from __future__ import annotations

import dis
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import (
    MOST_EXPANDED,
    contains,
    in_order,
    is_larger_than,
    mentions,
    nodes,
    nodes_of,
    once,
    replaced,
    rewritten,
    symbols_of,
    terms_of,
    with_arguments,
)
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol, multiply, number, order_of, split
from hybrid.expression.operations import (
    And,
    Atan2,
    Ceiling,
    Cos,
    Cosh,
    Equal,
    Exp,
    Floor,
    Less,
    LessEqual,
    Log,
    Not,
    Or,
    Remainder,
    Round,
    Select,
    Sign,
    Sin,
    Sinh,
    Step,
    Tan,
    Truncate,
    TruncatedRemainder,
    WholeQuotient,
)
from hybrid.expression.polynomials import coefficients_of, expanded, ratio
from hybrid.expression.ranges import has_one_sign, range_of
from hybrid.expression.surfaces import moves
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.text import text

# Functions that change by their derivatives, other than sums, products and positive powers.
GRADUAL = (Sin, Cos, Exp, Sinh, Cosh, Log)
ROUNDING = (Floor, Ceiling, Truncate, Round)
REMAINDERS = (Remainder, TruncatedRemainder)
JUMPS = (Less, LessEqual, Sign, Step, *ROUNDING, *REMAINDERS, Atan2)
# A constant smaller than this fraction of the terms it is the sum of counts as rounding.
SMALL = 1e-12
# Multiples of pi divided by this number are told from other floats.
PARTS_OF_PI = 12
# The whole number at which a floor jumps.
STEP = Symbol("step")


def jumps_of(field: Iterable[Expression], states: Sequence[Symbol]) -> list[str]:
    """Surfaces where a field is not proved continuous in the states, in words (``x[0]`` is the first)."""
    found: dict[str, None] = {}
    for entry in field:
        found |= dict.fromkeys(_surfaces(entry, states))
    return [*found]


def has_jumps(field: Iterable[Expression], states: Sequence[Symbol]) -> bool:
    """Whether a field is not proved continuous in the states; the first surface that is found decides.

    The shortest entries come first: proofs take long in long ones.
    """
    shortest = sorted(field, key=lambda entry: len(in_order([entry])))
    return any(True for entry in shortest for _ in _surfaces(entry, states))


def _surfaces(entry: Expression, states: Sequence[Symbol]) -> Iterator[str]:
    if not contains(entry, (*JUMPS, Tabulated, WholeQuotient)):
        return
    floors = nodes_of((WholeQuotient, Round), entry)
    entry = replaced(entry, {each: each.in_other_terms(*each.args) for each in floors})
    jumps = (node for node in nodes_of((*JUMPS, Tabulated), entry) if moves(node, states) and _may_jump(node))
    atoms = sorted(jumps, key=order_of)
    names = {atom: Symbol(f"jump {i}") for i, atom in enumerate(atoms)}
    yield from (_told(atom) for atom in atoms if not _is_continuous(entry, atom, names))


def _may_jump(atom: Expression) -> bool:
    """Whether an atom may have surfaces where it jumps: an angle turns only left of the origin."""
    if isinstance(atom, Atan2) and range_of(atom.args[1]).positive:
        return False
    if isinstance(atom, Tabulated):
        return atom.jumps
    surface, _ = _sides(atom, ZERO)
    # The surface of a whole number is one of many, and this is its own.
    return surface is None or isinstance(atom, (*ROUNDING, *REMAINDERS)) or not has_one_sign(surface)


def _is_continuous(entry: Expression, atom: Expression, names: Mapping[Expression, Symbol]) -> bool:
    """Whether the entry is proved to have the same value on both sides of an atom's jump."""
    surface, sides = _sides(atom, STEP)
    if surface is None:
        return False
    # Atoms with the same surface jump together.
    together: list[tuple[Expression, tuple[Expression, Expression]]] = []
    for other in names:
        other_surface, other_sides = _sides(other, STEP)
        if other is not atom and other_surface is not None:
            ratio = _ratio(other_surface, surface)
            if ratio and type(atom) not in (*ROUNDING, *REMAINDERS):
                together.append((other, other_sides if ratio > 0 else other_sides[::-1]))
    together.append((atom, sides))
    ours = {each for each, _ in together}
    bare = _substituted(surface, names)
    for old, new in _substitutions(bare):
        # The values of some other atoms are known where this atom jumps: q < 1 holds where q = 0.
        known = {
            other: side
            for other in names
            if other not in ours and (side := _known_side(other, names, old, new)) is not None
        }
        below, above = (
            _without_choices(
                _substituted(entry, {**names, **known, **{each: pair[side] for each, pair in together}})
            )
            for side in (0, 1)
        )
        if _is_zero(_substituted(above - below, {old: new})):
            return True
    return False


def vanishes_on(expression: Expression, surface: Expression) -> bool:
    """Whether an expression is proved to be zero wherever another one is."""
    if _is_zero(expression):
        return True
    return any(_is_zero(_substituted(expression, {old: new})) for old, new in _substitutions(surface))


def _substitutions(surface: Expression) -> Iterator[tuple[Expression, Expression]]:
    """Substitutions ``old, new`` that make a surface's expression zero."""
    variables = [each for each in symbols_of(surface) if each.label == "t" or each.label.startswith("x[")]
    for variable in sorted(variables, key=order_of):
        # A slope that depends on the state may vanish; the surface may then have another sheet.
        slope = derivative(surface, variable)
        if slope is not ZERO and all(each.label.startswith("p[") for each in symbols_of(slope)):
            yield variable, expanded(variable - surface / slope)
    for term in terms_of(surface):
        if not (term.is_number or term.is_symbol):
            coefficient, product = split(term)
            yield product, product - surface / coefficient


def _known_side(
    atom: Expression,
    names: Mapping[Expression, Symbol],
    old: Expression,
    new: Expression,
) -> Expression | None:
    """The value of an atom after a substitution, or None if its side is still unknown."""
    if isinstance(atom, (*ROUNDING, *REMAINDERS, Atan2, Tabulated)):
        return None
    surface, sides = _sides(atom, STEP)
    assert surface is not None, "the kinds of atoms that remain have a surface"
    height = expanded(_substituted(_substituted(surface, names), {old: new}))
    if not height.is_number or not abs(height.value) > 0:
        return None
    return sides[1] if height.value > 0 else sides[0]


def _sides(atom: Expression, step: Expression) -> tuple[Expression | None, tuple[Expression, Expression]]:
    """An expression that vanishes where the atom jumps, and the atom's values below and above."""
    nothing = (ZERO, ZERO)
    if isinstance(atom, Atan2):
        return atom.args[0], (number(-math.pi), number(math.pi))
    if isinstance(atom, Less | LessEqual):
        a, b = atom.args
        return b - a, (ZERO, ONE)
    if isinstance(atom, Sign):
        return atom.args[0], (-ONE, ONE)
    if isinstance(atom, Step):
        return atom.args[0], (ZERO, ONE)
    if isinstance(atom, ROUNDING):
        surface = atom.args[0] - step
        if isinstance(atom, Ceiling):
            return surface, (step, step + 1)
        # Truncation jumps like the floor at positive arguments and like the ceiling at negative ones.
        return (surface, (step - 1, step)) if isinstance(atom, Floor) else (None, nothing)
    if isinstance(atom, Remainder):
        a, b = atom.args
        return a - step * b, (b, ZERO)
    return None, nothing


def _substituted(expression: Expression, values: Mapping[Any, Expression]) -> Expression:
    """The expression with others in the place of some parts, and without whole turns of harmonics."""
    return rewritten(expression, _without_turns, values)


def _without_turns(node: Expression, args: list[Expression]) -> Expression:
    if isinstance(node, Sin | Cos | Tan) and args[0] is not node.args[0]:
        return _of_turns(type(node), args[0])
    return with_arguments(node, args)


def _of_turns(function: type[Sin | Cos | Tan], angle: Expression) -> Expression:
    """A harmonic without whole numbers of turns, exact where the angle is a simple part of a turn."""
    count = coefficients_of(angle).get(STEP, 0) / math.pi
    half_turns = round(count)
    if count and abs(count - half_turns) <= SMALL * abs(count):
        angle = expanded(angle - number(count * math.pi) * STEP)
        if half_turns % 2 and function is not Tan:
            # The sign is not known, and 0 has none.
            value = _of_turns(function, angle)
            return value if value is ZERO else multiply(value, Cos(number(math.pi) * STEP))
    value = function(angle)
    parts = float(angle) / math.pi * PARTS_OF_PI if angle.is_number else 0.5
    if value.is_number and abs(parts - round(parts)) <= SMALL * abs(parts):
        doubled = round(2.0 * float(value))
        return number(0.5 * doubled) if abs(2.0 * float(value) - doubled) < SMALL else value
    return value


def _ratio(one: Expression, other: Expression) -> float:
    """The ratio of two expressions if it is constant, else 0."""
    found = ratio(one, other)
    return 0.0 if found is None or not math.isfinite(found.value) else float(found)


@once
def _without_choices(expression: Expression) -> Expression:
    """The expression with choices and connectives as polynomials in their conditions, which are 0 or 1.

    An equality counts as false, because it holds only on a surface and not beside it.
    """
    return rewritten(expression, _as_polynomial)


def _as_polynomial(node: Expression, args: list[Expression]) -> Expression:
    if isinstance(node, Select):
        condition, a, b = args
        condition = _truth(node.args[0], condition)
        return condition * a + (1 - condition) * b
    if isinstance(node, And | Or):
        a, b = (_truth(raw, arg) for raw, arg in zip(node.args, args, strict=True))
        return a * b if isinstance(node, And) else a + b - a * b
    if isinstance(node, Not):
        return 1 - _truth(node.args[0], args[0])
    return ZERO if isinstance(node, Equal) else with_arguments(node, args)


def _truth(raw: Expression, value: Expression) -> Expression:
    """0 or 1 for a condition; a number counts as true, since it is zero only on a surface."""
    is_truth = isinstance(raw, And | Or | Not | Equal | Less | LessEqual | Symbol)
    return value if is_truth or value is ZERO or value is ONE else ONE


def _is_zero(expression: Expression) -> bool:
    if is_larger_than(MOST_EXPANDED, expression) or any(
        node.is_number and not math.isfinite(node.value) for node in nodes(expression)
    ):
        return False
    scale = max(abs(split(term)[0]) for term in terms_of(expression))
    return all(abs(factor) <= SMALL * scale for factor in coefficients_of(expression).values())


def _told(atom: Expression) -> str:
    first, *rest = map(text, atom.args)
    if isinstance(atom, ROUNDING):
        return f"{first} is a whole number"
    if isinstance(atom, Tabulated):
        return f"{first} is at a point of a table"
    if isinstance(atom, REMAINDERS):
        return f"{first} is a multiple of {rest[0]}"
    if isinstance(atom, Atan2):
        return f"the angle of ({rest[0]}, {first}) turns from pi to -pi"
    return f"{rest[0]} = {first}" if isinstance(atom, Less | LessEqual) else f"{first} = 0"


# Functions with jumps that compiled code may call.
JUMPING_NAMES = frozenset(
    {
        "argmax", "argmin", "bool", "ceil", "copysign", "digitize", "divmod", "fix", "floor",
        "floor_divide", "fmod", "heaviside", "int", "mod", "piecewise", "remainder", "rint", "round",
        "searchsorted", "select", "sign", "signbit", "trunc", "where",
    }
)  # fmt: skip
# These turn a complex number into a real one, which can be compared.
REAL_PARTS = frozenset({"real", "abs", "absolute", "hypot"})


def may_jump(function: Callable[..., Any], differentiable: bool) -> bool:
    """Whether a function that could not be traced may jump, judged from its bytecode.

    ``differentiable`` says that the function runs on complex numbers. Those have no order, so the function
    can branch on the state only through real parts.
    """
    codes = codes_of(function)
    names = {name for code in codes for name in code.co_names}
    decides = any(_decides(code) for code in codes)
    if differentiable:
        return decides and bool(names & REAL_PARTS)
    return decides or bool(names & JUMPING_NAMES) or _calls_others(function, names)


def codes_of(function: Callable[..., Any]) -> list[CodeType]:
    """The code of a function and of the functions within it."""
    codes = [function.__code__] if isinstance(function, FunctionType) else []
    for code in codes:
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
    return codes


def _decides(code: CodeType) -> bool:
    return any(
        instruction.opname in ("COMPARE_OP", "CONTAINS_OP", "IS_OP")
        or "JUMP_IF" in instruction.opname
        or "_IF_" in instruction.opname
        or (instruction.opname == "BINARY_OP" and instruction.argrepr.strip("=") in ("%", "//"))
        for instruction in dis.get_instructions(code)
    )


def _calls_others(function: Callable[..., Any], names: Iterable[str]) -> bool:
    """Whether the function calls functions other than Python's and NumPy's, whose code is not examined."""
    if not isinstance(function, FunctionType):
        return True
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    used = [function.__globals__[name] for name in names if name in function.__globals__] + cells
    allowed = (ModuleType, BuiltinFunctionType, np.ufunc, type)
    return any(callable(each) and not isinstance(each, allowed) for each in used)


def may_be_abrupt(expression: Expression, variables: Iterable[Symbol]) -> bool:
    """Whether an expression may jump in disguise, or change like a jump: ``x/abs(x)``, ``tanh(1e12*x)``."""
    for node in nodes(expression):
        if not node.args or node.is_sum or node.is_product or isinstance(node, GRADUAL):
            continue
        gradual = node.is_power and node.exponent.is_number and node.exponent.value > 0
        if not gradual and mentions(node, variables):
            return True
    return False
