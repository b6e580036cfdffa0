"""Import kernels; their compiled code is cached in a folder named by a hash of all their sources."""

from __future__ import annotations

import ast
import importlib
import importlib.util
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from hybrid.compiler.cache import second_process
from hybrid.compiler.cache.folder import PACKAGE, announced, cache_folder, source_key
from hybrid.compiler.interrupts import between_passes
from hybrid.symbolic.branches import PARSER

DRIVER = "hybrid.kernels.drive"
# Every run needs these kernels too. A second process compiles them while this one compiles the driver.
EVENTS = ("hybrid.kernels.jumps.jump", "hybrid.kernels.jumps.corner", "hybrid.kernels.events.initial_mode")
# All kernels that Python calls or passes on, slowest to compile first.
ALL_KERNELS = (
    DRIVER,
    "hybrid.kernels.jumps.jump",
    "hybrid.kernels.steps.radau",
    "hybrid.kernels.steps.runge_kutta",
    "hybrid.kernels.jumps.corner",
    "hybrid.kernels.events.bounds",
    "hybrid.kernels.steps.forcing",
    "hybrid.kernels.events.sections",
    "hybrid.kernels.steps.dense",
    "hybrid.kernels.evaluate",
    "hybrid.kernels.events.initial_mode",
    "hybrid.kernels.steps.step",
    "lyapunov.kernels",
    "lyapunov.study.kernels",
)
# The modules that decide the form of the files.
FORM = (PACKAGE / "compiler" / "cache" / "checked.py", PACKAGE / "compiler" / "cache" / "seal.py")
MESSAGE = "hybrid: compiling the kernels, once for all models (under a minute) ..."


@cache
def load_kernels(module: str = DRIVER) -> ModuleType:
    """The kernel module of that name, compiled now or loaded from the cache.

    A line on standard error announces the compilation, once per process.
    """
    kept = is_kept(module)
    if module == DRIVER and not kept:
        second_process.start([each for each in EVENTS if not is_kept(each)])
    with nullcontext() if kept else announced(MESSAGE):
        if module in EVENTS:
            second_process.finish()
        with between_passes():
            _import_numba()
            with compiled_into(_folder(module)):
                return importlib.import_module(module)


# Numba's cache folder is a setting of the whole process, so only one thread may change it at a time.
_LOCK = threading.RLock()


@contextmanager
def compiled_into(folder: Path) -> Iterator[None]:
    """Let numba cache functions decorated inside this block, and no others, in ``folder``.

    Numba's cache entry depends only on the time stamp of the function's own file. Kernels call one another
    across files, so the name of the folder must depend on all their sources.
    """
    from numba import config

    from hybrid.compiler.cache.checked import checked_contents
    from hybrid.kernels.types.options import INTO_FOLDER

    with _LOCK:
        before, outside = vars(config)["CACHE_DIR"], INTO_FOLDER.set(True)
        vars(config)["CACHE_DIR"] = str(folder)
        try:
            with checked_contents():
                yield
        finally:
            vars(config)["CACHE_DIR"] = before
            INTO_FOLDER.reset(outside)


@cache
def _import_numba() -> None:
    """Import numba's array functions without SciPy's linear algebra, which kernels do not need.

    On import, the array functions look for SciPy's BLAS, which takes a fifth of a second. BLAS is available,
    since this package requires SciPy; functions that call BLAS look for it again.
    """
    from numba.np import linalg

    look = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        from numba.np import arraymath
    finally:
        linalg.ensure_blas = look
    vars(arraymath)["ensure_blas"] = look


def _folder(module: str) -> Path:
    return cache_folder(f"kernels-{kernels_key(module)}")


def is_kept(module: str) -> bool:
    """Whether compiled code of a kernel module is on disk."""
    return any(_folder(module).rglob(f"{module.rpartition('.')[2]}.*.nbi"))


def sources_in(folder: Path) -> list[Path]:
    """All modules in a folder and its subfolders."""
    return sorted(folder.rglob("*.py"))


@cache
def kernels_key(module: str = DRIVER) -> str:
    """Hash of all sources of a kernel module: our kernels, and files of its own package if it has another.

    The form of the files in the cache belongs to them, too.
    """
    sources = [*sources_in(PACKAGE / "kernels"), *FORM]
    if not module.startswith("hybrid."):
        sources += sorted(_own_sources(module))
    return source_key(*(path.read_text(encoding="utf-8") for path in sources))


def _own_sources(module: str) -> set[Path]:
    """Files of a module and of all modules that it imports, directly or not, from its own package."""
    package, found, left = module.partition(".")[0], set[Path](), [module]
    while left:
        spec = importlib.util.find_spec(left.pop())
        path = Path(spec.origin) if spec is not None and spec.origin else None
        if path is None or path in found or path.name == "__init__.py":
            continue
        found.add(path)
        with PARSER:
            tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == package:
                left += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                left += [alias.name for alias in node.names if alias.name.partition(".")[0] == package]
    return found


@cache
def entry(kernel: Any) -> Any:
    """The fastest entry point of a compiled kernel; the types of arguments are not checked.

    Numba's own call first looks up the types of all arguments, which takes a third of a millisecond for our
    tuples.
    """
    (compiled,) = kernel.overloads.values()
    return compiled.entry_point


class Absent:
    """A placeholder for a kernel that is never called."""

    address = 0


@cache
def address(kernel: Any) -> Any:
    """A compiled kernel as a first-class function, for use as an argument or in a structure."""
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
