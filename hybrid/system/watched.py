"""Values that model functions take from elsewhere, and whether they are still what they were.

A model function may read globals, closures, attributes of objects and modules, and tables, itself or through
the functions that it calls. What has been compiled holds for the values that were read then.
"""

from __future__ import annotations

import dis
import functools
import json
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType, WrapperDescriptorType
from typing import Any

import numpy as np

# Code of the library, and of what is installed, does not change.
LIBRARY = Path(__file__).parents[1]
STANDARD = Path(json.__file__).parents[1]
# A new object of these types is no change if it is equal.
PLAIN = {bool, int, float, complex, str, bytes, np.float64, np.int64, np.bool_}
MISSING = object()


class Wrapper:
    """Base of the library's functions that call functions of the user's: they read what these read."""

    __slots__ = ()

    @property
    def called(self) -> tuple[Callable[..., Any], ...]:
        """The user's functions."""
        raise NotImplementedError


CALLABLE = (FunctionType, MethodType, functools.partial, Wrapper)


class Watched:
    """Values that were read, each with the place where it was read.

    It holds for ever if nothing was read. That is also the case after pickling: a process that reads a model
    begins anew.
    """

    def __init__(self, functions: Iterable[Callable[..., Any] | None] = ()) -> None:
        self._cells: list[tuple[Any, str, Any]] = []
        self._items: list[tuple[dict[str, Any], str, Any]] = []
        self._attributes: list[tuple[Any, str, Any]] = []
        self._arrays: list[tuple[np.ndarray, bytes]] = []
        self._lists: list[tuple[Any, list[Any]]] = []
        self._seen: dict[Any, Any] = {}
        for function in functions:
            self._read_by(function)
        self._seen.clear()
        self._cells = _distinct(self._cells)
        self._items = _distinct(self._items)
        self._attributes = _distinct(self._attributes)

    def __reduce__(self) -> tuple[Any, ...]:
        return Watched, ()

    def holds(self) -> bool:
        """Whether all values are still what they were. This takes some microseconds, longer for tables."""
        # Loops, as every run asks: over an empty list they cost nothing. Most values are the same object.
        for cell, _, value in self._cells:
            found = _content(cell)
            if found is not value and not _same(found, value):
                return False
        for names, name, value in self._items:
            found = names.get(name, MISSING)
            if found is not value and not _same(found, value):
                return False
        for owner, name, value in self._attributes:
            found = getattr(owner, name, MISSING)
            if found is not value and not _same(found, value):
                return False
        for array, content in self._arrays:
            if array.tobytes() != content:
                return False
        return not self._lists or all(_same_items(_items(held), items) for held, items in self._lists)

    def joined(self, other: Watched) -> Watched:
        """These values and others."""
        both = Watched()
        for name, own in vars(self).items():
            setattr(both, name, own + getattr(other, name) if isinstance(own, list) else own)
        return both

    def numbers(self) -> dict[str, float]:
        """The plain numbers that were read from modules and closures, by name."""
        places = [entry[-2:] for entry in (*self._cells, *self._items, *self._attributes)]
        return {
            name: float(value)
            for name, value in places
            if isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool)
        }

    def _read_by(self, function: Any, owner: Any = None) -> None:
        """What a function reads; ``owner`` is the object whose method it is."""
        if isinstance(function, functools.partial):
            for value in (function.func, *function.args, *function.keywords.values()):
                self._read(value, frozenset())
        elif isinstance(function, MethodType):
            self._read_by(function.__func__, function.__self__)
        elif isinstance(function, Wrapper):
            for each in function.called:
                self._read_by(each)
        elif isinstance(function, FunctionType):
            self._read_by_code(function, owner)
        elif isinstance(getattr(function, "py_func", None), FunctionType):
            self._read_by(function.py_func)
        elif function is not None:
            # The call of what is written in C, such as `len`, reads nothing, and has a call like itself.
            call = type(function).__call__
            if not isinstance(call, WrapperDescriptorType):
                self._read_by(call, function)

    def _read_by_code(self, function: FunctionType, owner: Any) -> None:
        key = (id(function), id(owner))
        if key in self._seen or is_installed(function.__code__.co_filename):
            return
        self._seen[key] = function, owner
        names, attributes = _names_in(function.__code__)
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
            value = _content(cell)
            self._cells.append((cell, name, value))
            self._read(value, attributes)
        for name in names & function.__globals__.keys():
            value = function.__globals__[name]
            if not _is_library(value):
                self._items.append((function.__globals__, name, value))
                self._read(value, attributes)
        for value in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()):
            self._read(value, attributes)
        if owner is not None:
            self._read(owner, attributes)

    def _read(self, value: Any, attributes: frozenset[str]) -> None:
        """What is read of a value by functions that ask for these attributes."""
        key = (id(value), attributes)
        if value is None or type(value) in PLAIN or key in self._seen:
            return
        self._seen[key] = value
        if isinstance(value, np.ndarray) and value.dtype != object:
            self._arrays.append((value, value.tobytes()))
        elif isinstance(value, list | tuple | dict | set | np.ndarray):
            items = _items(value)
            if not isinstance(value, tuple):
                # A tuple keeps its items; what these hold is watched below.
                self._lists.append((value, items))
            for each in items:
                self._read(each, attributes)
        elif isinstance(value, ModuleType):
            if not _is_library(value):
                self._read_attributes(value, attributes)
        elif isinstance(value, CALLABLE) or hasattr(value, "py_func"):
            self._read_by(value)
        else:
            self._read_object(value, attributes)

    def _read_attributes(self, owner: Any, attributes: frozenset[str]) -> None:
        held = vars(owner)
        for name in attributes & held.keys():
            self._attributes.append((owner, name, getattr(owner, name)))
            self._read(getattr(owner, name), attributes)

    def _read_object(self, value: Any, attributes: frozenset[str]) -> None:
        """What is read of an object or a class: values that it holds, through its methods too."""
        if hasattr(value, "__dict__"):
            self._read_attributes(value, attributes)
        kinds = value.__mro__ if isinstance(value, type) else type(value).__mro__
        for name in attributes | {"__call__"}:
            found = next((vars(kind)[name] for kind in kinds if name in vars(kind)), None)
            if isinstance(found, property):
                self._read_by(found.fget, value)
            elif isinstance(found, FunctionType):
                self._read_by(found, value)
            elif isinstance(found, staticmethod | classmethod):
                self._read_by(found.__func__, value)
            elif hasattr(type(found), "__set__") and hasattr(value, name):  # a slot
                self._attributes.append((value, name, getattr(value, name)))
                self._read(getattr(value, name), attributes)


def _names_in(code: CodeType) -> tuple[frozenset[str], frozenset[str]]:
    """The globals and the attributes that a function asks for, with those of its inner functions."""
    names, attributes = set[str](), set[str]()
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            names.add(str(step.argval))
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            attributes.add(str(step.argval))
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            more_names, more_attributes = _names_in(inner)
            names |= more_names
            attributes |= more_attributes
    return frozenset(names), frozenset(attributes)


def is_of_library(function: Any) -> bool:
    """Whether a function is the library's own, as those are that it derives."""
    if isinstance(function, Wrapper):
        return all(map(is_of_library, function.called))
    code = getattr(function, "__code__", getattr(type(function).__call__, "__code__", None))
    return code is not None and Path(code.co_filename).is_relative_to(LIBRARY)


@cache
def is_installed(filename: str) -> bool:
    """Whether code belongs to an installed package, to Python or to this library."""
    path = Path(filename)
    return (
        filename == "<built in>"
        or "site-packages" in path.parts
        or any(path.is_relative_to(folder) for folder in (LIBRARY, STANDARD))
    )


def _is_library(value: Any) -> bool:
    """Whether a value is a module that is installed, such as ``np``."""
    return isinstance(value, ModuleType) and is_installed(getattr(value, "__file__", None) or "<built in>")


def _distinct(entries: list[Any]) -> list[Any]:
    """Entries without those of a place that an earlier one has."""
    return list({tuple(map(id, entry[:-1])): entry for entry in reversed(entries)}.values())


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not yet assigned
        return MISSING


def _items(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [*value.keys(), *value.values()]
    return value.ravel().tolist() if isinstance(value, np.ndarray) else [*value]


def _same(one: Any, other: Any) -> bool:
    return one is other or (type(one) is type(other) and type(one) in PLAIN and bool(one == other))


def _same_items(some: list[Any], others: list[Any]) -> bool:
    return len(some) == len(others) and all(map(_same, some, others))
