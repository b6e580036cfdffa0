"""Kinds of values that kernels take, and the machine words in which Python hands them over.

Nothing here needs the compiler: a process that finds all machine code on disk never imports it.
"""

import re
import struct
from ctypes import addressof, c_char
from typing import Any, NamedTuple

import numpy as np


class Number(NamedTuple):
    """A number of a NumPy type: an integer, a float or a truth value."""

    dtype: str


class Array(NamedTuple):
    """A contiguous array of numbers."""

    dtype: str
    ndim: int


class Pair(NamedTuple):
    """Two numbers, as the result of a function that only kernels call."""

    number: Number


class Function(NamedTuple):
    """A function: the kind of its result, None if there is none, and the kinds of its arguments."""

    result: Any
    arguments: tuple[Any, ...]


INTEGER, REAL, TRUTH = Number("int64"), Number("float64"), Number("bool")
VECTOR, MATRIX, CUBE = (Array("float64", ndim) for ndim in (1, 2, 3))
INDICES, INDEX_MATRIX = (Array("int64", ndim) for ndim in (1, 2))
# Behind the name of a kernel: its function that takes a table of words (``export``).
BY_WORDS = "_by_words"
# Kinds without a name of their own, as text.
NOTHING, TWO_NUMBERS, SEVERAL, ADDRESS = "nothing", "two numbers", "several values", "address"


def function(result, *arguments):
    """The kind of a function."""
    return Function(result, arguments)


def is_bundle(kind):
    """Whether a kind is a NamedTuple of values, annotated with kinds: only kernels pass one to each other."""
    return isinstance(kind, type) and issubclass(kind, tuple)


def text_of(kind):
    """A kind as text; structures and functions are addresses to those who pass them on."""
    if kind is None:
        return NOTHING
    if isinstance(kind, Number):
        return kind.dtype
    if isinstance(kind, Array):
        return f"{kind.dtype}[{kind.ndim}]"
    if is_bundle(kind):
        return SEVERAL
    return TWO_NUMBERS if isinstance(kind, Pair) else ADDRESS


def kind_named(text):
    """The kind of an argument whose text this is; None for an address."""
    array = re.fullmatch(r"(\w+)\[(\d)\]", text)
    if array:
        return Array(array[1], int(array[2]))
    return None if text == ADDRESS else Number(text)


def words_of(name, kind):
    """The function that turns a value of this kind into words; ``name`` is for its error text.

    Structures are made for every run, so the function is quick.
    """
    if isinstance(kind, Array):
        return _array_words(name, kind)
    if kind == REAL:
        return lambda value: struct.unpack("q", struct.pack("d", value))
    if isinstance(kind, Number):
        return lambda value: (int(value),)
    return lambda value: (value.address,)


def address_of(array):
    """Address of the first entry of an array."""
    if array.size and array.flags.writeable:
        # Ten times as fast as the array's own interface.
        return addressof(c_char.from_buffer(array))
    return array.__array_interface__["data"][0]


def _array_words(name, kind):
    dtype, ndim = np.dtype(kind.dtype), kind.ndim

    def words(value):
        fits = isinstance(value, np.ndarray) and value.ndim == ndim and value.flags.c_contiguous
        if not fits or value.dtype != dtype:
            raise TypeError(f"{name} must be a contiguous array of type {kind}; got {value!r}.")
        return (address_of(value), *value.shape)

    return words


def width_of(kind):
    """Number of words of a kind."""
    return 1 + (kind.ndim if isinstance(kind, Array) else 0)
