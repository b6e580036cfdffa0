"""The folder that stores compiled code between processes, and the messages about it."""

from __future__ import annotations

import atexit
import getpass
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from hybrid.compiler.cache.seal import sealed, unsealed

# Folder of this package.
PACKAGE = Path(__file__).parents[2]
_SAID: set[str] = set()


def cache_directory() -> Path:
    """Folder of the compiled code: ``$HYBRID_CACHE_DIR``, or the user's cache folder of the platform.

    This process runs the code in the folder. So the folder must belong to the user, and nobody else may
    write to it. If this does not hold, or if the folder cannot be written to, a private folder is used
    instead, and one line says so.
    """
    return _usable(_chosen_folder())


def _chosen_folder() -> Path:
    chosen = os.environ.get("HYBRID_CACHE_DIR")
    if chosen:
        return Path(chosen)
    import platformdirs

    return Path(platformdirs.user_cache_dir("hybrid-systems", appauthor=False))


def cache_folder(name: str) -> Path:
    """A folder of that name in the cache, under the same conditions as ``cache_directory``."""
    return _usable(cache_directory() / name, name)


def path_in_cache(folder: str, file: str) -> Path:
    """Path from which a file of the cache is read.

    It is in the chosen folder if the file is there and the folder can be trusted, even on a disk that is full
    or cannot be written to; else where it would be stored.
    """
    chosen = _chosen_folder()
    path = chosen / folder / file
    if path.exists() and _distrust(chosen) is None and _distrust(chosen / folder) is None:
        return path
    return cache_folder(folder) / file


@cache
def _usable(folder: Path, name: str = "") -> Path:
    objection = _objection(folder)
    if objection is None:
        return folder
    private = _private_folder() / name
    say(f"hybrid: compiled code is stored in {private}, not in {folder}: {objection}.")
    return private


def _objection(folder: Path) -> str | None:
    """Why a folder cannot be used; None if it can. Creates the folder if it does not exist."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        distrust = _distrust(folder)
        if distrust is not None:
            return distrust
        with tempfile.TemporaryFile(dir=folder) as draft:
            draft.write(b"room")
    except OSError as error:
        return error.strerror or str(error)
    return None


def _distrust(folder: Path) -> str | None:
    """Why what is in a folder must not be run; None if only this user can have put it there."""
    if hasattr(os, "geteuid"):
        found = folder.stat()
        if found.st_uid != os.geteuid():
            return "it belongs to another user"
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return "others can write to it (chmod go-w)"
    return None


@cache
def _private_folder() -> Path:
    """A folder that only this user can write to; the same in every process, if possible."""
    user = os.geteuid() if hasattr(os, "geteuid") else getpass.getuser()
    lasting = Path(tempfile.gettempdir()) / f"hybrid-systems-{user}"
    if not lasting.is_symlink() and _objection(lasting) is None:
        return lasting
    passing = Path(tempfile.mkdtemp(prefix="hybrid-systems-"))
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    return passing


def source_key(*texts: str) -> str:
    """Short hash of texts."""
    digest = hashlib.sha256()
    for text in texts:
        digest.update(text.encode())
    return digest.hexdigest()[:24]


def keep(path: Path, content: bytes) -> bool:
    """Write a file with its checksum, atomically: other processes may be reading or writing it.

    If the file cannot be written, one line says so, and the next process does the work again.
    """
    draft = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:16]}")
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        draft.write_bytes(sealed(path.name, content))
        draft.replace(path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        say(f"hybrid: compiled code cannot be saved: {error.strerror or error}.")
        return False
    return True


def kept(path: Path) -> bytes | None:
    """Content of a file that was written by ``keep``; None if it is missing or damaged, which a line says."""
    try:
        found = path.read_bytes()
    except OSError:
        return None
    content = unsealed(path.name, found)
    if content is None:
        say(f"hybrid: compiled code in {path.parent} is damaged; it is compiled again.")
    return content


def say(message: str) -> None:
    """Print a line to standard error, at most once per process."""
    if message not in _SAID:
        _SAID.add(message)
        print(message, file=sys.stderr, flush=True)


@contextmanager
def announced(message: str, after: float = 1.0) -> Iterator[None]:
    """Print ``message`` as ``say`` does, if the block takes longer than ``after`` seconds."""
    timer = threading.Timer(after, say, [message])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
