"""Kernels that come with the package: compiled when its wheel was built, for many processors at once.

Their machine code runs on every processor that has the instructions of the ``Base`` of its family, and was
measured to be as fast there as code for the one processor. The files are named by a hash of the sources of
the kernels, so files that do not belong to the sources beside them are never loaded.
"""

from __future__ import annotations

import os
import platform
import sys
from functools import cache
from pathlib import Path

import attrs
from llvmlite import binding

from hybrid.compiler.cache.folder import PACKAGE, kept

FOLDER = PACKAGE / "machine_code"


@attrs.frozen
class Base:
    """The oldest processor of a family that the code runs on.

    Parameters
    ----------
    name
        LLVM's name of it.
    needs
        LLVM's names of the instructions that a processor of the family may lack.
    """

    name: str
    needs: frozenset[str] = frozenset()

    def environment(self) -> dict[str, str]:
        """Environment variables with which code is made for this processor."""
        return {"HYBRID_CPU": self.name}


_X86_64 = Base("x86-64-v3", frozenset({"avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}))
_ARM64 = Base("generic")
BASES = {"x86_64": _X86_64, "AMD64": _X86_64, "arm64": _ARM64, "aarch64": _ARM64}


def base() -> Base | None:
    """The base of this machine's family; None if the family has none."""
    return BASES.get(platform.machine())


@cache
def _runs_here() -> bool:
    """Whether code for the base of this machine's family is wanted, and has only instructions known here."""
    family = base()
    if family is None or os.environ.get("HYBRID_CPU", family.name) != family.name:
        return False
    found = binding.get_host_cpu_features()
    return all(found.get(each, False) for each in family.needs)


def shipped(module: str, key: str) -> bytes | None:
    """The contents of the file of a module's kernels; None if none came with the package for this processor.

    ``key`` is the hash of the kernels' sources.
    """
    return kept(path_in(FOLDER, module, key)) if _runs_here() else None


def is_shipped(module: str, key: str) -> bool:
    """Whether kernels of a module came with the package, for these sources and this processor."""
    return _runs_here() and path_in(FOLDER, module, key).exists()


def path_in(folder: Path, module: str, key: str) -> Path:
    """Path of the file of a module's kernels in the folder that a wheel contains."""
    family = base()
    name = family.name if family else "none"
    return folder / f"{module}.{sys.platform}-{name}-{key}.o"
