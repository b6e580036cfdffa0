"""Results of tracing systems, stored on disk, so that the next process need not wait for them."""

from __future__ import annotations

import hashlib
import json
import sys
from functools import cache
from pathlib import Path

import cattrs
import numpy as np
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from hybrid.compiler.cache.folder import PACKAGE, cache_folder, keep, kept, path_in_cache, source_key
from hybrid.compiler.cache.loader import kernels_key, sources_in
from hybrid.compiler.emitted import Emitted


def models_folder() -> Path:
    """Folder of stored models, named by a hash of the kernels and of the code that compiles models."""
    return cache_folder(f"models-{_compiler()}")


def kept_of_model(file: str) -> bytes | None:
    """Content of a file with stored results for a model; None if missing or damaged."""
    return kept(path_in_cache(f"models-{_compiler()}", file))


def read(key: str) -> Emitted | None:
    """What was found out about the system of this key; None if missing or damaged."""
    return _read(kept_of_model(_file(key)))


def write(key: str, emitted: Emitted) -> None:
    """Store what was found out about the system of this key."""
    text = json.dumps(_converter().unstructure(emitted), default=int)
    keep(models_folder() / _file(key), text.encode())


def read_text(key: str, part: str) -> str | None:
    """The text of a part that was left out of what was written; None if missing or damaged."""
    content = kept_of_model(_text_file(key, part))
    return None if content is None else content.decode()


def write_text(key: str, part: str, text: str) -> None:
    """Store the text of a part that was left out."""
    keep(models_folder() / _text_file(key, part), text.encode())


def _text_file(key: str, part: str) -> str:
    return f"text_{_digest(f'{part} {key}')}.txt"


def _file(key: str) -> str:
    return f"emitted_{_digest(key)}.json"


@cache
def _compiler() -> str:
    paths = sources_in(PACKAGE / "compiler" / "llvm")
    return source_key(kernels_key(), *(path.read_text(encoding="utf-8") for path in paths))


def _digest(key: str) -> str:
    return hashlib.sha256(f"{_tracer()}\n{key}".encode()).hexdigest()


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
        return _converter().structure(json.loads(content), Emitted)
    except (ValueError, LookupError, TypeError, AttributeError, cattrs.BaseValidationError):
        return None


@cache
def _converter() -> cattrs.Converter:
    """What turns records into plain data, and back; functions that were not traced stay here."""
    converter = cattrs.Converter()
    left = override(omit=True)
    converter.register_unstructure_hook(Emitted, make_dict_unstructure_fn(Emitted, converter, opaque=left))
    converter.register_structure_hook(Emitted, make_dict_structure_fn(Emitted, converter, opaque=left))
    return converter
