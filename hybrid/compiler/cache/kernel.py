"""Compiled kernels as Python calls them, and the file in which those of a module are stored."""

from __future__ import annotations

import ctypes
import json
import struct
import threading
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from hybrid.compiler.llvm.engine import load
from hybrid.kernels.types.kinds import (
    BY_WORDS,
    INTEGER,
    NOTHING,
    REAL,
    SEVERAL,
    TRUTH,
    Array,
    Number,
    kind_named,
    text_of,
    width_of,
    words_of,
)

CALL = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_char_p)
# What a word is as a result.
RESULTS = {
    text_of(INTEGER): int,
    text_of(TRUTH): bool,
    text_of(REAL): lambda word: struct.unpack("d", struct.pack("q", word))[0],
    NOTHING: lambda word: None,
}


class Code:
    """The machine code of a module, which is loaded when the first of its functions is needed.

    Threads that need it load it once: what a second load replaces would be freed while it runs.
    """

    def __init__(self, content: bytes, names: list[str]) -> None:
        self._content, self._names = content, names
        self._loading, self._functions = threading.Lock(), dict[str, Any]()

    @property
    def functions(self) -> dict[str, Any]:
        """The functions by name, each with its ``address``."""
        with self._loading:
            if not self._functions:
                self._functions = load(self._content, self._names)
        return self._functions


class Kernel:
    """A compiled kernel; calls release the GIL.

    Parameters
    ----------
    name
        Name of the kernel in its module.
    code
        The machine code of the module.
    result, arguments
        The kinds of its signature, as text.
    """

    def __init__(self, name: str, code: Code, result: str, arguments: list[str]) -> None:
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

    @cached_property
    def address(self) -> int:
        """Address of the function that other kernels call."""
        address: int = self._code.functions[self.name].address
        return address

    @cached_property
    def _call(self) -> Any:
        return CALL(self._code.functions[self.name + BY_WORDS].address)

    @cached_property
    def _read(self) -> Any:
        return RESULTS[self._result]


def file_of(signatures: Mapping[str, list[str]], code: bytes) -> bytes:
    """The contents of a file with kernels: the result and the arguments of each, and their code."""
    return json.dumps(signatures).encode() + b"\n" + code


def kernels_in(content: bytes) -> dict[str, Kernel]:
    """The kernels of a file, by name."""
    index, _, code = content.partition(b"\n")
    signatures = json.loads(index)
    by_words = [
        name + BY_WORDS
        for name, (result, *kinds) in signatures.items()
        if result in RESULTS and SEVERAL not in kinds
    ]
    shared = Code(code, [*signatures, *by_words])
    return {name: Kernel(name, shared, result, kinds) for name, (result, *kinds) in signatures.items()}
