"""Generated functions as machine code for this processor: optimised and emitted."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence

from llvmlite import binding, ir

from hybrid.compiler.llvm.engine import SPEED, target
from hybrid.compiler.llvm.lowering import NO_CALLS, CaseTable, OwnFunction, Signature, lower


def machine_code(
    functions: Sequence[tuple[ast.FunctionDef, Signature, bool]],
    calls: Mapping[str, OwnFunction | CaseTable] = NO_CALLS,
) -> bytes:
    """The contents of an object file with these functions.

    The truth value of each function says whether its multiplications and additions may be fused; ``calls``
    are what they call of the user's functions and of tables of cases.
    """
    module = ir.Module("model")
    module.triple = binding.get_default_triple()
    module.data_layout = str(target().target_data)
    for written, signature, fused in functions:
        lower(module, written, signature, fused=fused, calls=calls)
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    tuning = binding.create_pipeline_tuning_options(speed_level=SPEED)
    tuning.loop_vectorization = True
    passes = binding.create_pass_builder(target(), tuning)
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = target().emit_object(parsed)
    return code
