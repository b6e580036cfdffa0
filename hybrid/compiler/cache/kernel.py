"""Compiled kernels as Python calls them, and the file in which those of a module are stored."""

from __future__ import annotations

import ctypes
import json
import struct
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from hybrid.compiler.llvm.engine import load
from hybrid.kernels.types.kinds import (
    INTEGER,
    NOTHING,
    REAL,
    TRUTH,
    Array,
    Number,
    kind_named,
    text_of,
    width_of,
    words_of,
)

# Behind the name of a kernel: its function that takes a table of words, see ``hybrid.kernels.types.export``.
BY_WORDS = "_by_words"
CALL = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_char_p)
# What a word is as a result.
RESULTS = {
    text_of(INTEGER): int,
    text_of(TRUTH): bool,
    text_of(REAL): lambda word: struct.unpack("d", struct.pack("q", word))[0],
    NOTHING: lambda word: None,
}


class Kernel:
    """A compiled kernel. Its machine code is loaded when it is first needed; calls release the GIL.

    Parameters
    ----------
    name
        Name of the kernel in its module.
    code
        The contents of its object file.
    result, arguments
        The kinds of its signature, as text.
    """

    def __init__(self, name: str, code: bytes, result: str, arguments: list[str]) -> None:
        self.name, self._code, self._result = name, code, result
        kinds = [kind_named(each) for each in arguments]
        # How each argument is converted: an address has None, and numbers are left to the table.
        self._converters = [
            words_of(f"argument {i} of {name}", kind) if isinstance(kind, Array) else kind
            for i, kind in enumerate(kinds)
        ]
        self._table = struct.Struct("".join("d" if kind == REAL else width_of(kind) * "q" for kind in kinds))

    def __call__(self, *values: Any) -> Any:
        """Call the kernel; arrays are passed by their addresses."""
        words: list[Any] = []
        for value, converter in zip(values, self._converters, strict=True):
            if converter is None:
                words.append(value.address)
            elif isinstance(converter, Number):
                words.append(value)
            else:
                words += converter(value)
        return self._read(self._call(self._table.pack(*words)))

    @property
    def address(self) -> int:
        """Address of the function that other kernels call."""
        address: int = self._loaded[self.name].address
        return address

    @cached_property
    def _loaded(self) -> dict[str, Any]:
        names = [self.name, self.name + BY_WORDS] if self._result in RESULTS else [self.name]
        return load(self._code, names)

    @cached_property
    def _call(self) -> Any:
        return CALL(self._loaded[self.name + BY_WORDS].address)

    @cached_property
    def _read(self) -> Any:
        return RESULTS[self._result]


def file_of(codes: Mapping[str, tuple[bytes, str, list[str]]]) -> bytes:
    """The contents of a file with kernels: for each name the code, the result and the arguments."""
    index = [[name, len(code), result, arguments] for name, (code, result, arguments) in codes.items()]
    return json.dumps(index).encode() + b"\n" + b"".join(code for code, _, _ in codes.values())


def kernels_in(content: bytes) -> dict[str, Kernel]:
    """The kernels of a file, by name."""
    index, _, codes = content.partition(b"\n")
    kernels, place = {}, 0
    for name, length, result, arguments in json.loads(index):
        kernels[name] = Kernel(name, codes[place : place + length], result, arguments)
        place += length
    return kernels
