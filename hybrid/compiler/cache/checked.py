"""Numba's cache of machine code with checksums: damaged code is compiled again."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from numba.core import caching, ccallback, dispatcher

from hybrid.compiler.cache.folder import say
from hybrid.compiler.cache.seal import sealed, unsealed


class DamagedError(Exception):
    """A file of the cache does not match its checksum."""


class _CheckedFile(caching.IndexDataCacheFile):
    """An index and the files of data that it names, all with checksums."""

    def _dump(self, obj: Any) -> bytes:
        data: bytes = super()._dump(obj)
        return data

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as file:
            file.write(sealed(name, self._dump(data)))

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as file:
            content = unsealed(name, file.read())
        if content is None:
            raise DamagedError(name)
        return pickle.loads(content)

    def _save_index(self, overloads: Any) -> None:
        self._save_data(self._index_name, (self._version, self._source_stamp, overloads))

    def _load_index(self) -> Any:
        try:
            version, stamp, overloads = self._load_data(self._index_name)
        except FileNotFoundError:
            return {}
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}


class _InFolder(caching.CompileResultCacheImpl):
    """Looks only into the chosen folder."""

    _locator_classes = [caching.UserProvidedCacheLocator]  # noqa: RUF012


class _CheckedCache(caching.FunctionCache):
    """The compiled code of one function on disk. If the cache fails, the function is compiled as usual."""

    _impl_class = _InFolder

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        plain = self._cache_file
        self._cache_file = _CheckedFile(self._cache_path, self._impl.filename_base, plain._source_stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            say(f"hybrid: compiled code in {self._cache_path} is damaged; it is compiled again.")
            with suppress(OSError):
                self._cache_file.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except Exception as error:
            reason = getattr(error, "strerror", None) or error
            say(f"hybrid: compiled code cannot be saved: {reason}.")


def _cache_of(function: Any) -> Any:
    """The cache of a function; a cache that stores nothing if no folder can be used."""
    try:
        return _CheckedCache(function)
    except (RuntimeError, OSError):
        return caching.NullCache()


@contextmanager
def checked_contents() -> Iterator[None]:
    """Make numba use this cache for functions decorated inside the block."""
    users: list[Any] = [dispatcher, ccallback]
    before = [user.FunctionCache for user in users]
    for user in users:
        user.FunctionCache = _cache_of
    try:
        yield
    finally:
        for user, each in zip(users, before, strict=True):
            user.FunctionCache = each
