"""Checksums of the files of the cache."""

from __future__ import annotations

import hashlib


def sealed(name: str, content: bytes) -> bytes:
    """The content of a file behind its checksum, which also depends on the name of the file."""
    return _digest(name, content) + content


def unsealed(name: str, found: bytes) -> bytes | None:
    """The content of a file; None if it is damaged, or is that of another file."""
    size = hashlib.sha256().digest_size
    digest, content = found[:size], found[size:]
    return content if digest == _digest(name, content) else None


def _digest(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()
