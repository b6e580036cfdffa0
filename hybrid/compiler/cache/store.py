"""Results of tracing systems, stored on disk, so that the next process need not wait for them."""

from __future__ import annotations

import hashlib
import json
import sys
from functools import cache
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.cache.folder import PACKAGE, cache_folder, keep, kept, path_in_cache, source_key
from hybrid.compiler.cache.loader import kernels_key, sources_in
from hybrid.compiler.emitted import Emitted, Programs, Propagator, Series


def models_folder() -> Path:
    """Folder of stored models, named by a hash of the kernels and of the code that compiles models."""
    return cache_folder(f"models-{_compiler()}")


def kept_of_model(file: str) -> bytes | None:
    """Content of a file with stored results for a model; None if missing or damaged."""
    return kept(path_in_cache(f"models-{_compiler()}", file))


def read(operations: str) -> Emitted | None:
    """Stored results of tracing the system with these operations; None if missing or damaged."""
    return _read(kept_of_model(_file(operations)))


def write(operations: str, emitted: Emitted) -> None:
    """Store the results of tracing the system with these operations."""
    text = json.dumps(attrs.asdict(emitted), default=int)
    keep(models_folder() / _file(operations), text.encode())


def _file(operations: str) -> str:
    return f"emitted_{_digest(operations)}.json"


@cache
def _compiler() -> str:
    paths = sources_in(PACKAGE / "compiler" / "llvm")
    return source_key(kernels_key(), *(path.read_text(encoding="utf-8") for path in paths))


def _digest(operations: str) -> str:
    return hashlib.sha256(f"{_tracer()}\n{operations}".encode()).hexdigest()


@cache
def _tracer() -> str:
    """Sources of this package and versions on which the results of tracing depend."""
    kernels = PACKAGE / "kernels"
    # The name of the folder already depends on the kernels.
    sources = [path for path in sources_in(PACKAGE) if kernels not in path.parents]
    digest = hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()
    return " ".join([digest, sys.version, np.__version__])


def _read(content: bytes | None) -> Emitted | None:
    if content is None:
        return None
    try:
        found: dict[str, Any] = json.loads(content)
        of_transitions = ("affine_guard", "guard_in_series", "surface", "orientation")
        of_modes = ("abrupt", "autonomous", "discontinuities", "traced_field", "steep", "steep_inside")
        parts = (
            "first_forcing",
            "forcing_component",
            "forcing_kind",
            "first_residue",
            "residue_component",
        )
        for name in (*of_transitions, *of_modes, "timed_guard", "timed_reset", "jumping_reset", *parts):
            found[name] = tuple(found[name])
        for name in ("crossing", "read_by"):
            found[name] = tuple(map(tuple, found[name]))
        found["slope_columns"] = tuple(tuple(map(tuple, rows)) for rows in found["slope_columns"])
        names = ("rows", "checked", "numbers", "first")
        rows, checked, numbers, first = (found["programs"][name] for name in names)
        found["programs"] = Programs(
            tuple(map(tuple, rows)), tuple(checked), tuple(map(float, numbers)), tuple(first)
        )
        found["propagators"] = tuple(map(_propagator, found["propagators"]))
        return Emitted(**found)
    except (ValueError, LookupError, TypeError):
        return None


def _propagator(found: dict[str, Any]) -> Propagator:
    series = Series(**{**found["series"], "statements": (), "tangent_statements": ()})
    return Propagator(**{**found, "series": series, "guards": tuple(found["guards"])})
