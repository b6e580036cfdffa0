"""Machine code for this processor: the target that it is made for, and loading it into this process."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache
from typing import Any

import attrs
from llvmlite import binding

from hybrid.compiler.interrupts import between_passes
from hybrid.compiler.llvm.registers import Vectors
from hybrid.kernels.types.codes import NARROW, WIDE

# LLVM's highest level of optimisation, the lowest one that keeps numbers in registers, and none at all.
SPEED, HASTE, PLAIN = 3, 1, 0


@attrs.frozen(eq=False)
class Compiled:
    """A function of loaded machine code; ``needs`` keeps the code and the functions that it calls alive."""

    address: int
    needs: Any = attrs.field(repr=False)


def cpu() -> tuple[str, str]:
    """LLVM's name of the processor that code is made for, and its features.

    This is the processor of this machine, or the one that the environment variable ``HYBRID_CPU`` names: code
    for ``x86-64``, for example, gives the same last digits on every processor of that family. Code for a
    processor with more instructions than this machine's does not run here.
    """
    chosen = os.environ.get("HYBRID_CPU")
    if chosen:
        return chosen, ""
    return binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()


@cache
def vectors() -> Vectors:
    """The vector registers of the processor: with AVX-512 there are 32 of eight numbers, else 16 of four.

    Others than sums need two of them.
    """
    name, features = cpu()
    if "+avx512f" in features or name == "x86-64-v4":
        return Vectors(WIDE, 30)
    # In halves, four numbers take two of the registers.
    in_halves = name in ("x86-64", "x86-64-v2")
    return Vectors(NARROW, 6 if in_halves else 14)


def _new_target(level: int = SPEED) -> Any:
    """LLVM's description of the processor, and how much it optimises for it."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = cpu()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=name,
        features=features,
        opt=level,
        reloc="default",
        codemodel="jitdefault",
        jit=True,
    )


target = cache(_new_target)


@cache
def processor() -> str:
    """LLVM's version and the processor, on which machine code depends."""
    version = ".".join(map(str, binding.llvm_version_info))
    return " ".join([version, *cpu()])


@between_passes()
def load(code: bytes, names: Sequence[str], needs: Sequence[Any] = ()) -> dict[str, Compiled]:
    """The functions of an object file, ready to be called; ``needs`` are objects that must outlive them."""
    # Each engine needs its own target, since it frees the target when it is freed itself.
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _new_target())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return {name: Compiled(engine.get_function_address(name), (engine, *needs)) for name in names}
