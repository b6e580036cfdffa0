"""How a reset that could not be traced is compiled if it returns a dict of the components that change.

In numba's representation of the function, a dict that is returned becomes the tuple of all components.
"""

# mypy: allow-untyped-defs, allow-untyped-calls, allow-untyped-decorators, allow-incomplete-defs

from __future__ import annotations

from functools import lru_cache

from numba.core import ir
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.ir_utils import build_definitions

from hybrid.compiler.whole_numbers import WholeNumberCompiler
from hybrid.errors import ModelError
from hybrid.system.functions import checked_changes
from hybrid.system.labels import plain_name

# Place of the state among the arguments of a model function.
STATE_ARGUMENT = 1


@register_pass(mutates_CFG=False, analysis_only=False)
class _CompleteChanges(FunctionPass):
    """Replace the dicts that the function returns by tuples of all components."""

    _name = "complete_changes"

    def __init__(self):
        super().__init__()

    def run_pass(self, state):
        """Whether the function returns a dict."""
        func_ir, changed = state.func_ir, False
        returned = _returned(func_ir)
        for block in func_ir.blocks.values():
            body: list[object] = []
            for statement in block.body:
                is_dict = (
                    isinstance(statement, ir.Assign) and getattr(statement.value, "op", "") == "build_map"
                )
                if is_dict and statement.target.name in returned:
                    _complete(func_ir, statement, body, state.pipeline.components)
                    changed = True
                body.append(statement)
            block.body = body
        if changed:
            func_ir._definitions = build_definitions(func_ir.blocks)
        return changed


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


def _complete(func_ir, statement, body, components):
    """Make the dict of one assignment the tuple of all components; what it needs before goes to ``body``."""
    place, scope = statement.loc, statement.target.scope
    changed = {}
    for key, value in statement.value.items:
        definitions = func_ir._definitions.get(key.name, [])
        keys = {getattr(each, "value", None) for each in definitions}
        if len(keys) != 1:
            raise ModelError("the names in the dict that a reset returns must be written as they are")
        changed[plain_name(keys.pop())] = value

    def new(what, value):
        var = ir.Var(scope, f"$changed.{what}.{len(body)}.{place.line}.{id(statement)}", place)
        body.append(ir.Assign(value, var, place))
        return var

    names = checked_changes(changed, components)
    before = new("state", ir.Arg(func_ir.arg_names[STATE_ARGUMENT], STATE_ARGUMENT, place))
    whole = [
        changed[name] if name in changed else new(name, ir.Expr.getattr(before, name, place))
        for name in names
    ]
    statement.value = ir.Expr.build_tuple(whole, place)


@lru_cache(maxsize=256)
def compiler_for(components):
    """Numba's passes for a model function.

    ``components`` are the names of the state, or their number, for a reset that may return a dict; else None.
    """
    if components is None:
        return WholeNumberCompiler

    return type(
        "Completing", (WholeNumberCompiler,), {"first_pass": _CompleteChanges, "components": components}
    )
