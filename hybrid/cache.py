"""Where compiled code is kept between processes, and what the user sees while it is made the first time."""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_LOCK = threading.RLock()
_SAID: set[str] = set()


def cache_directory() -> Path:
    """Folder of the compiled code: ``$HYBRID_CACHE_DIR``, or the user's cache folder of the platform."""
    chosen = os.environ.get("HYBRID_CACHE_DIR")
    if chosen:
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("hybrid-systems", appauthor=False))


def source_key(*texts: str) -> str:
    """Short hash of source texts and of the compiler's version."""
    import numba

    digest = hashlib.sha256(numba.__version__.encode())
    for text in texts:
        digest.update(text.encode())
    return digest.hexdigest()[:24]


def write_whole(path: Path, text: str) -> None:
    """Write a file whole or not at all: other processes may be doing the same, or reading it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.stem}.{os.getpid()}.{threading.get_ident()}")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)


@contextmanager
def compiled_into(folder: Path) -> Iterator[None]:
    """Let numba keep what is decorated inside this block in ``folder``, and nothing decorated elsewhere.

    Numba stamps a compiled function with the age of its own file only. Kernels call one another across
    files, so the folder must be named after all the sources that go into them.
    """
    from numba import config

    with _LOCK:
        before = vars(config)["CACHE_DIR"]
        vars(config)["CACHE_DIR"] = str(folder)
        try:
            yield
        finally:
            vars(config)["CACHE_DIR"] = before


@contextmanager
def announced(message: str, after: float = 1.0) -> Iterator[None]:
    """Print ``message`` to standard error, once a process, if the block takes longer than ``after``."""

    def say() -> None:
        if message not in _SAID:
            _SAID.add(message)
            print(message, file=sys.stderr, flush=True)

    timer = threading.Timer(after, say)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
