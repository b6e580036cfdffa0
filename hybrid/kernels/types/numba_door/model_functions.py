"""How numba compiles a model function that could not be traced.

It is compiled as it is, with two changes of what numba has read. A power of a complex number is computed by
products, as in Python: they keep a small imaginary part, and with it the complex step. A dict that a reset
returns becomes the tuple of all components.
"""

import operator
from functools import lru_cache
from typing import Any

from numba.core import ir, types
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.imputils import impl_ret_borrowed
from numba.core.ir_utils import build_definitions
from numba.core.untyped_passes import IRProcessing
from numba.extending import intrinsic, overload

# Place of the state among the arguments of a model function.
STATE_ARGUMENT = 1
# Python computes powers up to this one as products, too.
MOST_FACTORS = 100
POWERS = (operator.pow, operator.ipow)


@intrinsic
def readonly(typing_context, array):
    """The array as a read-only array."""

    def same(context, builder, signature, arguments):
        return impl_ret_borrowed(context, builder, signature.return_type, arguments[0])

    return array.copy(readonly=True)(array), same


def power(a, b):
    """``a ** b``."""
    return a**b


def power_by_products(a, b):
    """A power of a complex number, by products where the exponent is a whole number."""
    n = int(b)
    if n != b or abs(n) > MOST_FACTORS:
        return a ** complex(b, 0.0)
    product, factor, left = complex(1.0, 0.0), a, abs(n)
    while left > 0:
        if left % 2 == 1:
            product *= factor
        factor *= factor
        left //= 2
    return 1.0 / product if n < 0 else product


@overload(power)
def _power(a, b):
    if isinstance(a, types.Complex) and not isinstance(b, types.Complex):
        return power_by_products
    return lambda a, b: a**b


class _Change(FunctionPass):
    """A pass that changes single assignments of the function that numba has read."""

    def __init__(self):
        super().__init__()

    def change_of(self, state):
        """The change: a function of an assignment and of the list for those before it; whether it changed."""
        raise NotImplementedError

    def run_pass(self, state):
        """Whether an assignment was changed."""
        func_ir, changed = state.func_ir, False
        change = self.change_of(state)
        for block in func_ir.blocks.values():
            body: list[Any] = []
            for statement in block.body:
                if isinstance(statement, ir.Assign):
                    changed |= change(statement, body)
                body.append(statement)
            block.body = body
        if changed:
            func_ir._definitions = build_definitions(func_ir.blocks)
        return changed


def _new_variable(statement, body, what, value):
    """A variable of that value, which is assigned before the statement, in ``body``."""
    place = statement.loc
    name = f"${what}.{len(body)}.{place.line}.{id(statement)}"
    variable = ir.Var(statement.target.scope, name, place)
    body.append(ir.Assign(value, variable, place))
    return variable


@register_pass(mutates_CFG=False, analysis_only=False)
class _PowersByProducts(_Change):
    """Replace the operator of powers by ``power``."""

    _name = "powers_by_products"

    def change_of(self, state):
        """One for all functions."""
        return _replace_power


def _replace_power(statement, body):
    value = statement.value
    is_power = isinstance(value, ir.Expr) and value.op in ("binop", "inplace_binop") and value.fn in POWERS
    if is_power:
        function = _new_variable(statement, body, "power", ir.Global("power", power, statement.loc))
        statement.value = ir.Expr.call(function, (value.lhs, value.rhs), (), statement.loc)
    return is_power


@register_pass(mutates_CFG=False, analysis_only=False)
class _CompleteChanges(_Change):
    """Replace the dicts that the function returns by tuples of all components."""

    _name = "complete_changes"

    def change_of(self, state):
        """One for the variables that this function may return."""
        func_ir, complete = state.func_ir, state.pipeline.complete
        returned = _returned(func_ir)

        def change(statement, body):
            is_dict = getattr(statement.value, "op", "") == "build_map" and statement.target.name in returned
            if is_dict:
                _complete(func_ir, statement, body, complete)
            return is_dict

        return change


def _returned(func_ir):
    """Names of the variables whose values the function may return."""
    waiting = [
        block.terminator.value.name
        for block in func_ir.blocks.values()
        if isinstance(block.terminator, ir.Return)
    ]
    found = set()
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found.add(name)
        for value in func_ir._definitions.get(name, []):
            if isinstance(value, ir.Var):
                waiting.append(value.name)
            elif getattr(value, "op", "") == "cast":
                waiting.append(value.value.name)
            elif getattr(value, "op", "") == "phi":
                waiting += [each.name for each in value.incoming_values]
    return found


def _complete(func_ir, statement, body, complete):
    """Make the dict of one assignment the tuple of all components."""
    changed = []
    for key, value in statement.value.items:
        keys = {getattr(each, "value", None) for each in func_ir._definitions.get(key.name, [])}
        changed.append((keys.pop() if len(keys) == 1 else None, value))
    place = statement.loc
    state = ir.Arg(func_ir.arg_names[STATE_ARGUMENT], STATE_ARGUMENT, place)
    before = _new_variable(statement, body, "state", state)
    whole = [
        each
        if isinstance(each, ir.Var)
        else _new_variable(statement, body, each, ir.Expr.getattr(before, each, place))
        for each in complete(changed)
    ]
    statement.value = ir.Expr.build_tuple(whole, place)


class ModelFunctionCompiler(CompilerBase):
    """Numba's passes, and those that change what it has read."""

    complete = None

    def define_pipelines(self):
        """The one pipeline."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.add_pass_after(_PowersByProducts, IRProcessing)
        if self.complete is not None:
            pipeline.add_pass_after(_CompleteChanges, IRProcessing)
        pipeline.finalize()
        return [pipeline]


@lru_cache(maxsize=256)
def compiler_for(complete=None):
    """Numba's passes for a model function.

    For a reset that may return a dict, ``complete`` is a function of its items: pairs of a key, None if that
    is not written as it is, and a value. It returns for each component its value, or its name if it stays.
    """
    if complete is None:
        return ModelFunctionCompiler
    return type("Completing", (ModelFunctionCompiler,), {"complete": staticmethod(complete)})
