"""Files and folders that results are written to while they are made: complete whenever they can be seen."""

from __future__ import annotations

import os
import uuid
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from hybrid import arguments
from hybrid.errors import ArgumentError, HybridError


def check_facts(path: Path, known: Mapping[str, str], facts: Mapping[str, str]) -> None:
    """Check that a store was made by this call, of which these facts are known.

    Raises
    ------
    ArgumentError
        If it was not; the text names the differences.
    """
    names = [*known, *(name for name in facts if name not in known)]
    differences = [
        f"{name} was {arguments.shown(known.get(name, '(none)'))}, "
        f"and is now {arguments.shown(facts.get(name, '(none)'))}"
        for name in names
        if known.get(name) != facts.get(name)
    ]
    if differences:
        raise ArgumentError(
            f"store: {str(path)!r} was made by another call: {'; '.join(differences)}. "
            "Name another store, or repeat the call that made this one."
        )


def as_path(path: object, name: str = "store") -> Path:
    """A path, or an ArgumentError."""
    wanted = "be the path of a folder"
    text = os.fspath(path) if isinstance(path, str | os.PathLike) else ""
    if not isinstance(text, str) or not text:
        raise arguments.refusal(name, wanted, path)
    try:
        os.lstat(text)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except (OSError, ValueError) as error:  # no file can have such a name
        raise arguments.refusal(name, wanted, path) from error
    return Path(text)


def text_of(path: Path) -> str:
    """The text of a file; empty if there is none."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")


def replace(path: Path, content: bytes) -> None:
    """Write a file that is complete whenever it can be seen, also after a loss of power."""
    part = _temporary(path)
    try:
        _write(part, content)
        os.replace(part, path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
    flush_folder(path.parent)


def write_new(path: Path, content: bytes) -> None:
    """Write a complete file, unless another process was first."""
    part = _temporary(path)
    try:
        _write(part, content)
        with suppress(FileExistsError):
            os.link(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
    flush_folder(path.parent)


def _write(path: Path, content: bytes) -> None:
    with path.open("xb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def flush_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk."""
    # Windows cannot open folders.
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def unwritable(path: Path, failure: OSError) -> HybridError:
    """The error of a store that cannot be written."""
    return HybridError(
        f"store: {str(path)!r} cannot be written: {failure}. All parts that were complete before are kept. "
        "Mend the cause, and call again: only what is missing is computed."
    )
