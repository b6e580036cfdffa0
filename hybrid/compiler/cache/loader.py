"""Compiled kernels: shipped with the package, from the cache, or compiled now.

Files are named by a hash of all sources of the kernels, so machine code of other sources is never loaded.

Numba is imported only to compile them.
"""

from __future__ import annotations

import ast
import gc
import importlib
import importlib.util
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import SimpleNamespace

from hybrid.compiler.cache import second_process, shipped
from hybrid.compiler.cache.folder import (
    PACKAGE,
    announced,
    cache_folder,
    keep,
    kept,
    path_in_cache,
    source_key,
)
from hybrid.compiler.cache.kernel import file_of, kernels_in
from hybrid.compiler.interrupts import between_passes
from hybrid.compiler.llvm.engine import cpu, processor
from hybrid.display.progress import Progress, is_watched, progress_bar
from hybrid.expression.branches import PARSER
from hybrid.kernels.types.kinds import text_of

DRIVER = "hybrid.kernels.drive"
LIMITS = "hybrid.kernels.limit.go"
# While this process compiles the driver, a second one compiles what every run needs too, and then what most
# runs never call. While the run goes on it compiles all others, which a later call may need.
IN_SECOND = (
    "hybrid.kernels.jumps.jump",
    "hybrid.kernels.jumps.plain",
    "hybrid.kernels.abreast.pool",
    "hybrid.kernels.jumps.corner",
    "hybrid.kernels.runs.initial_mode",
    "hybrid.kernels.guards.isolate",
    LIMITS,
)
# All kernels of this package that Python calls or passes on, slowest to compile first.
ALL_KERNELS = (
    DRIVER,
    "hybrid.kernels.jumps.jump",
    "hybrid.kernels.jumps.plain",
    "hybrid.kernels.abreast.pool",
    LIMITS,
    "hybrid.kernels.steps.radau",
    "hybrid.kernels.steps.runge_kutta",
    "hybrid.kernels.jumps.corner",
    "hybrid.kernels.events.bounds",
    "hybrid.kernels.steps.field.explained",
    "hybrid.kernels.guards.isolate",
    "hybrid.kernels.arithmetic.tangent",
    "hybrid.kernels.steps.field.jumps",
    "hybrid.kernels.steps.field.late",
    "hybrid.kernels.runs.sections",
    "hybrid.kernels.runs.many",
    "hybrid.kernels.runs.settle",
    "hybrid.kernels.steps.dense",
    "hybrid.kernels.evaluate",
    "hybrid.kernels.runs.initial_mode",
    "hybrid.kernels.steps.step",
)
# The modules that decide the form of the files.
FORM = (PACKAGE / "compiler" / "cache" / "kernel.py", PACKAGE / "compiler" / "cache" / "seal.py")
# Compiles the modules that it is given.
IN_ANOTHER_PROCESS = """\
import sys
from hybrid.compiler.cache.loader import load_kernels
for module in sys.argv[1:]:
    load_kernels(module)
"""
TITLE = "hybrid: compiling the kernels, once for all models"
# Seconds between two looks at which of them are done.
LOOK = 0.5


# Threads that need the same kernels compile and load them once: what a second load replaces would be freed
# while it runs.
_LOADING = threading.RLock()
_LOADED: dict[str, SimpleNamespace] = {}


def load_kernels(module: str = DRIVER) -> SimpleNamespace:
    """The kernels that a module exports, by name, compiled now or loaded from the cache.

    A bar shows the compilation in a terminal or a notebook; elsewhere a line on standard error announces it,
    once per process.
    """
    if module not in _LOADED:
        with _LOADING:
            if module not in _LOADED:
                _LOADED[module] = loaded(module)
    return _LOADED[module]


def loaded(module: str) -> SimpleNamespace:
    """As ``load_kernels``, for a module that this process has not loaded, or loads anew."""
    content = _on_disk(module)
    if content is None:
        with _shown(module):
            if module == DRIVER:
                others = dict.fromkeys((*IN_SECOND, *ALL_KERNELS))
                missing = [each for each in others if each != DRIVER and not is_kept(each)]
                second_process.start(IN_ANOTHER_PROCESS, missing)
            elif module in IN_SECOND:
                second_process.wait_for(lambda: is_kept(module))
                content = _on_disk(module)
            if content is None:
                content = compiled(module)
                keep(_path(module), content)
    return SimpleNamespace(**kernels_in(content))


@contextmanager
def _shown(module: str) -> Iterator[None]:
    """Show how many kernels of the first run are compiled, or that this one is, which it does not need."""
    if not is_watched():
        with announced(f"{TITLE} ..."):
            yield
        return
    first = (DRIVER, *IN_SECOND)
    left = {each for each in (first if module in first else (module,)) if not is_kept(each)}
    total, ended = len(first) if module in first else 1, threading.Event()

    def look(bar: Progress) -> None:
        while not ended.wait(LOOK):
            done = set(filter(is_kept, left))
            left.difference_update(done)
            bar.update(len(done))

    with progress_bar(total, TITLE, None, "module", done=total - len(left)) as bar:
        looking = threading.Thread(target=look, args=(bar,), daemon=True)
        looking.start()
        try:
            yield
        finally:
            ended.set()
            looking.join()


def compiled(module: str) -> bytes:
    """Compile the kernels that a module exports; the contents of their file.

    Raises
    ------
    RuntimeError
        If numba compiles for another processor here than the one under whose name they would be kept.
    """
    if not import_numba():
        raise RuntimeError(
            f"HYBRID_CPU: got {cpu()[0]!r}, but numba has compiled functions for another processor in this "
            "process, and compiles for one processor only. Compile the kernels before, by "
            "python -m hybrid compile, or without HYBRID_CPU."
        )
    from hybrid.kernels.types.numba_door.export import exports_of, object_code

    with between_passes(), _without_collection():
        exports = exports_of(importlib.import_module(module))
        signatures = {
            name: [text_of(export.result), *map(text_of, export.arguments)]
            for name, export in exports.items()
        }
        return file_of(signatures, object_code(exports))


@contextmanager
def _without_collection() -> Iterator[None]:
    """Pause the search for garbage: nearly all that a compilation makes is kept until its end."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def import_numba() -> bool:
    """Import numba; whether it compiles for the processor that the kernels are compiled for.

    It does not if it has compiled for another one in this process: its target is made once.
    """
    from hybrid.kernels.types.numba_door.session import choose_processor, import_array_functions

    import_array_functions()
    return not os.environ.get("HYBRID_CPU") or choose_processor(*cpu())


def _path(module: str) -> Path:
    """Where compiled code of a kernel module is stored."""
    return cache_folder(f"kernels-{kernels_key(module)}") / f"{module}.o"


def _place(module: str) -> Path:
    """Where it is read."""
    return path_in_cache(f"kernels-{kernels_key(module)}", f"{module}.o")


def _on_disk(module: str) -> bytes | None:
    content = shipped.shipped(module, sources_key(module))
    return kept(_place(module)) if content is None else content


def is_kept(module: str) -> bool:
    """Whether compiled code of a kernel module is on disk."""
    return is_shipped(module) or _place(module).exists()


def is_shipped(module: str) -> bool:
    """Whether compiled code of a kernel module came with the package, for this processor."""
    return shipped.is_shipped(module, sources_key(module))


def portable(module: str, folder: Path, base: shipped.Base | None = None) -> Path:
    """Path in ``folder`` of a module's kernels that are to be shipped, by default for this machine."""
    return shipped.path_in(folder, module, sources_key(module), base)


def sources_in(folder: Path) -> list[Path]:
    """All modules in a folder and its subfolders."""
    return sorted(folder.rglob("*.py"))


def _source_of(module: str) -> Path | None:
    """File of a module; None if there is no such module."""
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        # The name may be that of a function in a module.
        return None
    return Path(spec.origin) if spec is not None and spec.origin else None


@cache
def kernels_key(module: str = DRIVER) -> str:
    """Hash of all that the machine code of a kernel module depends on: sources, compiler and processor."""
    # Numba itself is imported only when a kernel is compiled.
    from importlib.metadata import version

    return source_key(processor(), version("numba"), sources_key(module))


@cache
def sources_key(module: str = DRIVER) -> str:
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
        path = _source_of(left.pop())
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


class Absent:
    """A placeholder for a kernel that is never called."""

    address = 0
