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
import sympy
from sympy.core.parameters import distribute

from hybrid.symbolic.expressions import (
    ONE,
    ZERO,
    And,
    Atan2,
    Ceiling,
    Equal,
    Floor,
    Less,
    LessEqual,
    Level,
    Not,
    Or,
    Remainder,
    Select,
    Sign,
    Step,
    Truncate,
    TruncatedRemainder,
    WholeQuotient,
)
from hybrid.symbolic.nodes import (
    MOST_EXPANDED,
    contains,
    is_larger_than,
    mentions,
    nodes,
    nodes_of,
    once,
    replaced,
    symbols_of,
)
from hybrid.symbolic.ranges import has_one_sign, range_of

# Functions that change by their derivatives, other than sums, products and positive powers.
GRADUAL = (sympy.sin, sympy.cos, sympy.exp, sympy.sinh, sympy.cosh, sympy.log)
ROUNDING = (Floor, Ceiling, Truncate)
REMAINDERS = (Remainder, TruncatedRemainder)
JUMPS = (Less, LessEqual, Sign, Step, *ROUNDING, *REMAINDERS, Atan2)
UNKNOWN = frozenset((sympy.nan, sympy.zoo, sympy.oo))
# A constant smaller than this fraction of the terms it is the sum of counts as rounding.
SMALL = 1e-12
# Floats are recognised as multiples of pi divided by this number.
PARTS_OF_PI = 12


def jumps_of(field: Iterable[sympy.Expr], states: Sequence[sympy.Symbol]) -> list[str]:
    """Surfaces where a field is not proved continuous in the states, in words (``x[0]`` is the first)."""
    found: dict[str, None] = {}
    with distribute(True):
        for entry in field:
            for surface in _surfaces(entry, states):
                found[surface] = None
    return [*found]


def _surfaces(entry: sympy.Expr, states: Sequence[sympy.Symbol]) -> list[str]:
    if not contains(entry, (*JUMPS, WholeQuotient)):
        return []
    quotients = nodes_of(WholeQuotient, entry)
    entry = replaced(entry, {each: Floor(each.args[0] / each.args[1]) for each in quotients})
    entry = _with_exact_turns(entry)
    jumps = (node for node in nodes_of(JUMPS, entry) if mentions(node, states) and _may_jump(node))
    atoms = sorted(jumps, key=sympy.default_sort_key)
    names = {atom: sympy.Dummy(real=True) for atom in atoms}
    return [_told(atom) for atom in atoms if not _is_continuous(entry, atom, names)]


def _may_jump(atom: sympy.Expr) -> bool:
    """Whether an atom may have surfaces where it jumps: an angle turns only left of the origin."""
    if isinstance(atom, Level):
        return False
    if isinstance(atom, Atan2) and range_of(atom.args[1]).positive:
        return False
    surface, _ = _sides(atom, ZERO)
    # The surface of a whole number is one of many, and this is its own.
    return surface is None or isinstance(atom, (*ROUNDING, *REMAINDERS)) or not has_one_sign(surface)


def _is_continuous(entry: sympy.Expr, atom: sympy.Expr, names: Mapping[sympy.Expr, sympy.Dummy]) -> bool:
    """Whether the entry is proved to have the same value on both sides of an atom's jump."""
    step = sympy.Dummy(integer=True)
    surface, sides = _sides(atom, step)
    if surface is None:
        return False
    # Atoms with the same surface jump together.
    together: list[tuple[sympy.Expr, tuple[sympy.Expr, sympy.Expr]]] = []
    for other in names:
        other_surface, other_sides = _sides(other, step)
        if other is not atom and other_surface is not None:
            ratio = _ratio(other_surface, surface)
            if ratio and type(atom) not in (*ROUNDING, *REMAINDERS):
                together.append((other, other_sides if ratio > 0 else other_sides[::-1]))
    together.append((atom, sides))
    ours = {each for each, _ in together}
    bare = _replaced(surface, {}, names)
    for old, new in _substitutions(bare):
        # The values of some other atoms are known where this atom jumps: q < 1 holds where q = 0.
        known = {
            other: side
            for other in names
            if other not in ours and (side := _known_side(other, step, names, old, new)) is not None
        }
        below, above = (
            _without_choices(_replaced(entry, known | {each: pair[side] for each, pair in together}, names))
            for side in (0, 1)
        )
        if _is_zero((above - below).subs(old, new)):
            return True
    return False


def vanishes_on(expression: sympy.Expr, surface: sympy.Expr) -> bool:
    """Whether an expression is proved to be zero wherever another one is."""
    with distribute(True):
        if _is_zero(expression):
            return True
        return any(_is_zero(expression.subs(old, new)) for old, new in _substitutions(surface))


def _substitutions(surface: sympy.Expr) -> Iterator[tuple[sympy.Expr, sympy.Expr]]:
    """Substitutions ``old, new`` that make a surface's expression zero."""
    variables = [each for each in symbols_of(surface) if each.name == "t" or each.name.startswith("x[")]
    for variable in sorted(variables, key=sympy.default_sort_key):
        # A slope that depends on the state may vanish; the surface may then have another sheet.
        slope = surface.diff(variable)
        if slope != 0 and not mentions(slope, variables) and not contains(slope, sympy.Dummy):
            yield variable, sympy.expand(variable - surface / slope)
    for term in sympy.Add.make_args(surface):
        if not (term.is_number or term.is_Symbol):
            coefficient, factor = term.as_coeff_Mul()
            yield factor, factor - surface / coefficient


def _known_side(
    atom: sympy.Expr,
    step: sympy.Symbol,
    names: Mapping[sympy.Expr, sympy.Dummy],
    old: sympy.Expr,
    new: sympy.Expr,
) -> sympy.Expr | None:
    """The value of an atom after a substitution, or None if its side is still unknown."""
    if isinstance(atom, (*ROUNDING, *REMAINDERS, Atan2)):
        return None
    surface, sides = _sides(atom, step)
    assert surface is not None, "the kinds of atoms that remain have a surface"
    height = sympy.expand(_replaced(surface, {}, names).subs(old, new))
    if not (height.is_number and height.is_real) or height == 0:
        return None
    return sides[1] if height.is_positive else sides[0]


def _sides(atom: sympy.Expr, step: sympy.Symbol) -> tuple[sympy.Expr | None, tuple[sympy.Expr, sympy.Expr]]:
    """An expression that vanishes where the atom jumps, and the atom's values below and above."""
    nothing = (ZERO, ZERO)
    if isinstance(atom, Atan2):
        return atom.args[0], (-sympy.pi, sympy.pi)
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


@once
def _with_exact_turns(expression: sympy.Expr) -> sympy.Expr:
    """The expression with exact multiples of pi for their floats in sines, cosines and tangents."""
    if not expression.args:
        return expression
    args = [_with_exact_turns(argument) for argument in expression.args]
    if isinstance(expression, sympy.sin | sympy.cos | sympy.tan):
        exact = {number: _turns(number) for number in nodes_of(sympy.Float, args[0])}
        args = [replaced(args[0], exact)]
    return expression.func(*args)


def _turns(number: sympy.Float) -> sympy.Expr:
    parts = round(float(number) / math.pi * PARTS_OF_PI)
    value = parts * math.pi / PARTS_OF_PI
    return (
        sympy.Rational(parts, PARTS_OF_PI) * sympy.pi if abs(value - number) <= 1e-15 * abs(value) else number
    )


def _ratio(one: sympy.Expr, other: sympy.Expr) -> float:
    """The ratio of two expressions if it is constant, else 0."""
    if one == other:
        return 1.0
    ratio = sympy.cancel(one / other)
    return float(ratio) if ratio.is_number and ratio.is_real and ratio.is_finite else 0.0


def _replaced(
    expression: sympy.Expr,
    values: Mapping[sympy.Expr, sympy.Expr],
    names: Mapping[sympy.Expr, sympy.Dummy],
) -> sympy.Expr:
    """The expression with values for some atoms, and symbols for all other atoms."""
    return replaced(expression, {**names, **values})


@once
def _without_choices(expression: sympy.Expr) -> sympy.Expr:
    """The expression with choices and connectives as polynomials in their conditions, which are 0 or 1.

    An equality counts as false, because it holds only on a surface and not beside it.
    """
    if not expression.args:
        return expression
    args = [_without_choices(argument) for argument in expression.args]
    if isinstance(expression, Select):
        condition, a, b = args
        condition = _truth(expression.args[0], condition)
        return condition * a + (1 - condition) * b
    if isinstance(expression, And | Or):
        a, b = (_truth(raw, arg) for raw, arg in zip(expression.args, args, strict=True))
        return a * b if isinstance(expression, And) else a + b - a * b
    if isinstance(expression, Not):
        return 1 - _truth(expression.args[0], args[0])
    if isinstance(expression, Equal):
        return ZERO if symbols_of(expression) else expression
    return expression.func(*args)


def _truth(raw: sympy.Expr, value: sympy.Expr) -> sympy.Expr:
    """0 or 1 for a condition; a number counts as true, since it is zero only on a surface."""
    is_truth = isinstance(raw, And | Or | Not | Equal | Less | LessEqual | sympy.Dummy)
    if is_truth or value in (ZERO, ONE):
        return value
    return ONE


def _is_zero(expression: sympy.Expr) -> bool:
    if is_larger_than(MOST_EXPANDED, expression) or not UNKNOWN.isdisjoint(nodes(expression)):
        return False
    expanded = sympy.expand(expression)
    if expanded == 0:
        return True
    scale = max(abs(float(c)) for c in _coefficients(expression))
    return all(abs(float(c)) <= SMALL * scale for c in _coefficients(expanded))


def _coefficients(expression: sympy.Expr) -> list[sympy.Expr]:
    """Numerical coefficients of the terms of a sum; 1 for a term without a number."""
    return [term.as_coeff_Mul()[0] for term in sympy.Add.make_args(expression) if term != 0]


def _told(atom: sympy.Expr) -> str:
    if isinstance(atom, ROUNDING):
        return f"{atom.args[0]} is a whole number"
    if isinstance(atom, REMAINDERS):
        return f"{atom.args[0]} is a multiple of {atom.args[1]}"
    if isinstance(atom, Atan2):
        return f"the angle of ({atom.args[1]}, {atom.args[0]}) turns from pi to -pi"
    if isinstance(atom, Less | LessEqual):
        return f"{atom.args[1]} = {atom.args[0]}"
    return f"{atom.args[0]} = 0"


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


def may_be_abrupt(expression: sympy.Expr, variables: Iterable[sympy.Symbol]) -> bool:
    """Whether an expression may jump in disguise, or change like a jump: ``x/abs(x)``, ``tanh(1e12*x)``."""
    for node in nodes(expression):
        if node.is_Atom or node.is_Add or node.is_Mul or isinstance(node, GRADUAL):
            continue
        gradual = node.is_Pow and node.exp.is_positive
        if not gradual and mentions(node, variables):
            return True
    return False
