"""All kernels of a copy of the sources, compiled in this process once.

A fork that changes one file imports and compiles again only the modules that contain it.
"""

from __future__ import annotations

import sys
from pathlib import Path

LIBRARY = ("hybrid", "lyapunov", "models")
KERNELS = ("hybrid.kernels", "lyapunov.kernels", "lyapunov.study.kernels")


class CompiledKernels:
    """The kernels in ``folder``, and what their files in the cache are called."""

    def __init__(self, folder: Path) -> None:
        sys.path.insert(0, str(folder))
        # A file may change twice within the precision of the times that tell old byte code.
        sys.dont_write_bytecode = True
        from hybrid.__main__ import ALL_KERNELS
        from hybrid.compiler.cache import loader, store

        self._models = store._compiler()
        self._keys = {module: loader.kernels_key(module) for module in ALL_KERNELS}
        for module in ALL_KERNELS:
            loader.compiled(module)
        loader.kernels_key.cache_clear()
        loader.sources_key.cache_clear()
        # Kernels of another package count as changed by any kernel of ours.
        self._sources = {
            name: loader._own_sources(name) for name in list(sys.modules) if name.startswith(KERNELS)
        }

    def change(self, path: Path) -> None:
        """Forget the modules that contain a file, and call all that does not depend on it as before."""
        from hybrid.compiler.cache import loader, second_process, store

        changed = {
            name
            for name, sources in self._sources.items()
            if path in sources or not name.startswith(KERNELS[0])
        }
        forget(*changed)
        new_key = loader.kernels_key

        def key(module: str = loader.DRIVER) -> str:
            return new_key(module) if module in changed else self._keys[module]

        vars(loader)["kernels_key"] = key
        vars(store)["_compiler"] = lambda: self._models
        # The second process would call the files otherwise.
        vars(second_process)["start"] = lambda modules: None


def forget(*names: str) -> None:
    """Let the next import of these modules read their files again."""
    for name in names:
        package, _, last = name.rpartition(".")
        del sys.modules[name]
        if package in sys.modules:
            vars(sys.modules[package]).pop(last, None)


def forget_all() -> None:
    """The same for the whole library."""
    forget(*(name for name in list(sys.modules) if name.partition(".")[0] in LIBRARY))
