"""Import kernels with their compiled code kept under a name that follows from all their sources."""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from hybrid.cache import announced, cache_directory, compiled_into, source_key

DRIVER = "hybrid.kernels.drive"
MESSAGE = "hybrid: compiling the kernels, once for all models (under a minute) ..."


@cache
def load_kernels(module: str = DRIVER) -> ModuleType:
    """The kernel module of that name, compiled now or taken from the cache."""
    with compiled_into(cache_directory() / f"kernels-{_kernels_key()}"), announced(MESSAGE):
        return importlib.import_module(module)


@cache
def _kernels_key() -> str:
    """Key of all kernel sources together, read once for all modules that are loaded."""
    sources = sorted((Path(__file__).parent / "kernels").glob("*.py"))
    return source_key(*(path.read_text(encoding="utf-8") for path in sources))


def address(kernel: Any) -> Any:
    """A compiled kernel as a first-class function for an argument or for a structure."""
    from numba.core.types import WrapperAddressProtocol

    (signature,) = kernel.nopython_signatures
    compiled = kernel.overloads[signature.args]
    pointer = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)

    class Address(WrapperAddressProtocol):
        address = int(pointer)

        def __wrapper_address__(self) -> int:
            return self.address

        def signature(self) -> Any:
            return signature

    return Address()
