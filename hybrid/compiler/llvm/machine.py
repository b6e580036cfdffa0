"""LLVM's instructions as machine code for this processor: optimised, written out, and loaded."""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import attrs
from llvmlite import binding, ir

from hybrid.compiler.llvm.lowering import NO_CALLS, OwnFunction, Signature, lower

# As far as LLVM goes: more does not make generated code faster.
SPEED = 3


@attrs.frozen(eq=False)
class Compiled:
    """A function of loaded machine code; the code and what it calls live as long as this."""

    address: int
    needs: Any = attrs.field(repr=False)


def _new_target() -> Any:
    """The processor of this machine, as LLVM sees it."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=binding.get_host_cpu_features().flatten(),
        opt=SPEED,
        reloc="default",
        codemodel="jitdefault",
        jit=True,
    )


_target = cache(_new_target)


@cache
def processor() -> str:
    """What machine code depends on: LLVM's version and the processor."""
    version = ".".join(map(str, binding.llvm_version_info))
    return " ".join([version, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()])


def machine_code(
    functions: Sequence[tuple[ast.FunctionDef, Signature, bool]], calls: Mapping[str, OwnFunction] = NO_CALLS
) -> bytes:
    """The contents of an object file with these functions.

    The truth value says of each whether it may be fused; ``calls`` are functions of the user's.
    """
    module = ir.Module("model")
    module.triple = binding.get_default_triple()
    module.data_layout = str(_target().target_data)
    for written, signature, fused in functions:
        lower(module, written, signature, fused=fused, calls=calls)
    parsed = binding.parse_assembly(str(module))
    parsed.verify()
    tuning = binding.create_pipeline_tuning_options(speed_level=SPEED)
    tuning.loop_vectorization = True
    passes = binding.create_pass_builder(_target(), tuning)
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = _target().emit_object(parsed)
    return code


def load(code: bytes, names: Sequence[str], needs: Sequence[Any] = ()) -> dict[str, Compiled]:
    """The functions of an object file, ready to be called; ``needs`` is what else must stay for them."""
    # An engine frees its target when it is freed itself.
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _new_target())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: Compiled(engine.get_function_address(name), (engine, *needs)) for name in names}
