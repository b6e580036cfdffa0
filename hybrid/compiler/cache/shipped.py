"""Kernels that come with the package: compiled when its wheel was built, for many processors at once.

A wheel has the machine code of one or several bases of a family of processors. The best one runs as fast, to
a few hundredths, as code for the one processor; the oldest one runs everywhere. The files are named by a hash
of the sources of the kernels, so files that do not belong to the sources beside them are never loaded.
"""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import attrs
from llvmlite import binding

from hybrid.compiler.cache.folder import PACKAGE, kept

FOLDER = PACKAGE / "machine_code"


TEXT = """\
Compiled kernels of hybrid-systems, for {system} on {machine}:

{rows}

The first one that the processor can run is loaded, if the sources beside it are unchanged. Elsewhere (another
operating system or processor, edited sources, another processor named by HYBRID_CPU) the first run compiles
the kernels, once, into the folder of compiled code: a minute or two. The functions of a model are always
compiled for the processor at hand.
"""


@attrs.frozen
class Base:
    """The oldest processor that the code runs on.

    Parameters
    ----------
    name
        LLVM's name of it.
    needs
        LLVM's names of the instructions that a processor of the family may lack.
    """

    name: str
    needs: frozenset[str] = frozenset()

    def runs_here(self) -> bool:
        """Whether the processor of this machine has the instructions."""
        found = binding.get_host_cpu_features()
        return all(found.get(each, False) for each in self.needs)

    def environment(self) -> dict[str, str]:
        """Environment variables with which code is made for this processor."""
        return {"HYBRID_CPU": self.name}


_X86_64 = (
    Base("x86-64-v3", frozenset({"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"})),
    Base("x86-64"),
)
_ARM64 = (Base("generic"),)
# Of each family, the best base first.
BASES = {"x86_64": _X86_64, "AMD64": _X86_64, "arm64": _ARM64, "aarch64": _ARM64}


def bases() -> tuple[Base, ...]:
    """The bases of this machine's family, the best first; none if the family is not known."""
    return BASES.get(platform.machine(), ())


@cache
def base() -> Base | None:
    """The best base that this machine runs, or that ``HYBRID_CPU`` names; None if there is none."""
    chosen = os.environ.get("HYBRID_CPU")
    fitting = (each for each in bases() if chosen in (None, "", each.name) and each.runs_here())
    return next(fitting, None)


def shipped(module: str, key: str) -> bytes | None:
    """The contents of the file of a module's kernels; None if none came with the package for this processor.

    ``key`` is the hash of the kernels' sources.
    """
    return kept(path_in(FOLDER, module, key)) if base() else None


def is_shipped(module: str, key: str) -> bool:
    """Whether kernels of a module came with the package, for these sources and this processor."""
    return base() is not None and path_in(FOLDER, module, key).exists()


def path_in(folder: Path, module: str, key: str, wanted: Base | None = None) -> Path:
    """Path of the file of a module's kernels in a folder of a wheel, by default for this machine."""
    found = wanted or base()
    return folder / f"{module}.{sys.platform}-{found.name if found else 'none'}-{key}.o"


def description(contained: Sequence[Base]) -> str:
    """What a wheel says of its machine code: which processors it is for, and what others do."""
    rows = [
        f"{each.name}: processors with {', '.join(sorted(each.needs))}"
        if each.needs
        else f"{each.name}: all {platform.machine()} processors"
        for each in contained
    ]
    return TEXT.format(system=sys.platform, machine=platform.machine(), rows="\n".join(rows))
