"""How model functions that could not be traced are compiled: whole numbers do not wrap around in silence.

Python's whole numbers have no largest one, numba's have 64 bits. Here a result that does not fit raises an
error; a number too large for an index is a float from the start, and so is every power of whole numbers.
"""

# Numba compares signatures with annotations when it overloads a function, so there are no annotations here.
# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, allow-incomplete-defs

from __future__ import annotations

import math
import operator
from typing import Any

from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.imputils import impl_ret_borrowed
from numba.core.ir_utils import build_definitions, guard
from numba.core.untyped_passes import IRProcessing
from numba.extending import intrinsic, overload

# Whole numbers above this are not used as indices.
LARGEST_INDEX = 2**31
# Larger than any whole number of 64 bits.
TOO_LARGE = 9.2e18
# Python computes powers up to this one as products, too.
MOST_FACTORS = 100
TEXT = "a whole number beyond 2**63"


def _fits(a, b):
    """Whether two numbers are Python integers, so that their result may not fit into 64 bits."""
    return isinstance(a, types.Integer) and isinstance(b, types.Integer) and types.uint64 not in (a, b)


def _checked(name, whole, other):
    """A function of two numbers: ``whole`` for two integers, ``other`` for all other numbers."""

    def stub(a, b):
        return other(a, b)

    def implementation(a, b):
        if _fits(a, b):
            return whole
        if name.endswith("pow") and isinstance(a, types.Complex) and not isinstance(b, types.Complex):
            return _complex_power
        return lambda a, b: other(a, b)

    stub.__name__ = stub.__qualname__ = name
    overload(stub)(implementation)
    return stub


def _sum(a, b):
    if abs(float(a) + float(b)) > TOO_LARGE:
        raise OverflowError(TEXT)
    return a + b


def _difference(a, b):
    if abs(float(a) - float(b)) > TOO_LARGE:
        raise OverflowError(TEXT)
    return a - b


def _product(a, b):
    if abs(float(a) * float(b)) > TOO_LARGE:
        raise OverflowError(TEXT)
    return a * b


def _power(a, b):
    return float(a) ** float(b)


def _complex_power(a, b):
    """As in Python by products, which keep a small imaginary part, and with it the complex step."""
    n = int(b)
    if n != b or abs(n) > MOST_FACTORS:
        return a ** complex(b, 0.0)
    power, factor, left = complex(1.0, 0.0), a, abs(n)
    while left > 0:
        if left % 2 == 1:
            power *= factor
        factor *= factor
        left //= 2
    return 1.0 / power if n < 0 else power


def _quotient(a, b):
    if b == 0:
        raise ZeroDivisionError("division by zero")
    return a / b


def _whole_quotient(a, b):
    if b == 0:
        raise ZeroDivisionError("division by zero")
    return a // b


def _remainder(a, b):
    if b == 0:
        raise ZeroDivisionError("division by zero")
    return a % b


def _shift(a, b):
    if b < 0 or b > 62 or abs(float(a)) * 2.0**b > TOO_LARGE:
        raise OverflowError(TEXT)
    return a << b


WHOLE = {
    "add": _sum,
    "sub": _difference,
    "mul": _product,
    "pow": _power,
    "truediv": _quotient,
    "floordiv": _whole_quotient,
    "mod": _remainder,
    "lshift": _shift,
}
OPERATIONS = {}
for _name, _of_whole in WHOLE.items():
    for _prefix in ("", "i"):
        _operator = getattr(operator, _prefix + _name)
        OPERATIONS[_operator] = _checked(f"whole_{_prefix}{_name}", _of_whole, _operator)


def _rounding(function):
    """A function that converts a float to a whole number."""

    def stub(a):
        return function(a)

    def implementation(a):
        def of_float(a):
            if not abs(a) <= TOO_LARGE:
                raise OverflowError(TEXT)
            return function(a)

        return of_float if isinstance(a, types.Float) else (lambda a: function(a))

    overload(stub)(implementation)
    return stub


ROUNDINGS = {function: _rounding(function) for function in (int, math.floor, math.ceil, math.trunc)}


@intrinsic
def readonly(typing_context, array):
    """The array as a read-only array."""

    def same(context, builder, signature, arguments):
        return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])

    return array.copy(readonly=True)(array), same


@register_pass(mutates_CFG=False, analysis_only=False)
class _CheckWholeNumbers(FunctionPass):
    """Replace operations that could wrap around."""

    _name = "check_whole_numbers"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        """Whether an operation was replaced."""
        func_ir, changed = state.func_ir, False
        for block in func_ir.blocks.values():
            body: list[object] = []
            for statement in block.body:
                if isinstance(statement, ir.Assign):
                    changed |= _replace(func_ir, statement, body)
                body.append(statement)
            block.body = body
        if changed:
            func_ir._definitions = build_definitions(func_ir.blocks)
        return changed


def _replace(func_ir, statement, body):
    """Replace the value of one assignment if need be; what it needs before goes to ``body``."""
    value, place = statement.value, statement.loc
    if isinstance(value, ir.Const | ir.Global | ir.FreeVar):
        known = value.value
        if type(known) is int and abs(known) > LARGEST_INDEX:
            statement.value = ir.Const(float(known), place)
            return True
        return _replace_rounding(statement, known)
    if not isinstance(value, ir.Expr):
        return False
    if value.op == "getattr":
        owner = guard(func_ir.get_definition, value.value)
        module = getattr(owner, "value", None)
        return _replace_rounding(statement, getattr(module, value.attr, None) if module is math else None)
    if value.op in ("binop", "inplace_binop") and value.fn in OPERATIONS:
        function = ir.Var(statement.target.scope, f"$whole.{len(body)}.{place.line}.{id(statement)}", place)
        stub = OPERATIONS[value.fn]
        body.append(ir.Assign(ir.Global(stub.__name__, stub, place), function, place))
        statement.value = ir.Expr.call(function, (value.lhs, value.rhs), (), place)
        return True
    return False


def _replace_rounding(statement, function):
    stub = ROUNDINGS.get(function) if callable(function) else None
    if stub is None:
        return False
    statement.value = ir.Global("rounding", stub, statement.loc)
    return True


class WholeNumberCompiler(CompilerBase):
    """Numba's passes and one more, which replaces arithmetic on whole numbers.

    A subclass may name another one, which comes before it.
    """

    first_pass: Any = None

    def define_pipelines(self):
        """The one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.add_pass_after(_CheckWholeNumbers, IRProcessing)
        if self.first_pass is not None:
            pipeline.add_pass_after(self.first_pass, IRProcessing)
        pipeline.finalize()
        return [pipeline]
