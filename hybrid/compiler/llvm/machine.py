"""Functions as machine code for this processor: optimised and emitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from llvmlite import binding, ir

from hybrid.compiler.interrupts import between_passes
from hybrid.compiler.llvm.engine import HASTE, PLAIN, SPEED, target
from hybrid.compiler.llvm.lowering import lower
from hybrid.compiler.llvm.wanted import NO_CALLS, CaseTable, Function, OwnFunction

# Functions with more instructions than this, as written, are optimised and emitted in haste: the time of LLVM
# grows faster than their length, and they run no slower.
LONG = 10000
# Levels of LLVM's passes for functions without loops, with some, and for those that consist of loops over
# statements that do not wait for one another.
NO_LOOPS, LOOPS, NOTHING_BUT_LOOPS = 0, 2, 3
# Functions that runs call rarely are emitted as they are written if one has more instructions than this.
LONG_FOR_RARE = 2000


def _optimise(module: Any, loops: int, level: int) -> None:
    """Run the passes that compiled functions with such loops profit from, at most those of a level.

    Their vectors are written as vectors and nothing is left to inline. So without loops a few passes give
    code as fast as all passes of LLVM's highest level do, in half the time. What does not change in a loop is
    to leave it, and loops over statements are to become vectors.
    """
    options = binding.create_pipeline_tuning_options(speed_level=min(loops, level))
    options.loop_vectorization = loops == NOTHING_BUT_LOOPS
    options.loop_unrolling, options.slp_vectorization = False, False
    builder = binding.create_pass_builder(target(), options)
    if loops != NO_LOOPS:
        builder.getModulePassManager().run(module, builder)
        return
    passes = binding.create_new_module_pass_manager()
    passes.add_sroa_pass()
    passes.add_simplify_cfg_pass()
    passes.add_instruction_combine_pass()
    passes.add_new_gvn_pass()
    passes.run(module, builder)


@between_passes()
def machine_code(
    functions: Sequence[Function],
    calls: Mapping[str, OwnFunction | CaseTable] = NO_CALLS,
    *,
    rare: bool = False,
) -> bytes:
    """The contents of an object file with these functions.

    ``calls`` are what they call of the user's functions and of tables of cases. Functions that are called
    rarely are not worth as much time of the compiler.
    """
    module = ir.Module("model")
    module.triple = binding.get_default_triple()
    module.data_layout = str(target().target_data)
    for written in functions:
        lower(module, written, calls)
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    longest = max(sum(len(block.instructions) for block in each.blocks) for each in module.functions)
    code: bytes
    if rare and longest > LONG_FOR_RARE:
        code = target(PLAIN).emit_object(parsed)
        return code
    level = HASTE if longest > LONG else SPEED
    _optimise(parsed, max(each.loops for each in functions), level)
    code = target(level).emit_object(parsed)
    return code
