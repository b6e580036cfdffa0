"""Import kernels with their compiled code kept under a name that follows from all their sources."""

from __future__ import annotations

import importlib
from functools import cache
from pathlib import Path
from types import ModuleType

from hybrid.cache import announced, cache_directory, compiled_into, source_key

MESSAGE = "hybrid: compiling the kernels, once for all models (about 20 s) ..."


@cache
def load_kernels(module: str = "hybrid.kernels.drive") -> ModuleType:
    """The kernel module of that name, compiled now or taken from the cache."""
    sources = sorted((Path(__file__).parent / "kernels").glob("*.py"))
    texts = [path.read_text(encoding="utf-8") for path in sources]
    with compiled_into(cache_directory() / f"kernels-{source_key(*texts)}"), announced(MESSAGE):
        return importlib.import_module(module)
