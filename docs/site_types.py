"""Types of parameters and attributes on the site, where a docstring leaves them to the annotations.

``conf.py`` connects `add_types`, which runs before numpydoc reads the docstring.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import types
import typing
from collections.abc import Callable, Iterator
from itertools import zip_longest
from typing import Any

# The packages whose names have a page.
PACKAGES = (
    *("hybrid", "lyapunov", "models"),
    *("hybrid.measures", "hybrid.testing", "hybrid.plot", "lyapunov.plot"),
)
SECTIONS = ("Parameters", "Other Parameters", "Attributes")
UNDERLINE = re.compile(r"-{3,}\s*")
NAME = re.compile(r"[A-Za-z_][\w.]*")
# What readers call the things that annotations name in short, or by a class of the library's own.
KNOWN = {
    "ArrayLike": "ArrayLike",
    "Clock": "Every | At | After | Delay",
    "Output": "Callable",
    "Quantity": "float | str | Callable",
    "Axes": "matplotlib.axes.Axes",
    "Figure": "matplotlib.figure.Figure",
    "np.ndarray": "numpy.ndarray",
    "os.PathLike": "PathLike",
    "typing.Any": "Any",
}
# The laws that a mapping, or a list of names, has become.
LAWS = ("tuple[Law, ...]", "Mapping[str, Any] | Iterable[str]")


def add_types(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Write the types into the lines of a docstring, where Sphinx collects it."""
    lines[:] = typed(thing, lines)


def classes() -> dict[str, str]:
    """The full names of all public classes by their short ones."""
    return {
        name: f"{package}.{name}"
        for package in PACKAGES
        for name in importlib.import_module(package).__all__
        if inspect.isclass(getattr(importlib.import_module(package), name))
    }


def typed(thing: Any, lines: list[str]) -> list[str]:
    """The lines of the docstring of a class or a function, with a type behind each name that has none."""
    found, written = annotations_of(thing), list[str]()
    for line, is_entry in _entries(lines):
        written += _with_types(line, found) if is_entry and " : " not in line else [line]
    return written


def untyped(lines: list[str]) -> list[str]:
    """The entries of parameters and attributes that have no type."""
    return [line for line, is_entry in _entries(lines) if is_entry and " : " not in line]


def _entries(lines: list[str]) -> Iterator[tuple[str, bool]]:
    """Each line, and whether it names parameters or attributes."""
    section = ""
    for line, below in zip_longest(lines, lines[1:], fillvalue=""):
        if UNDERLINE.fullmatch(below):
            section = line
        heading = line == section or UNDERLINE.fullmatch(line)
        yield line, bool(section in SECTIONS and line.strip() and not line[0].isspace() and not heading)


def _with_types(line: str, found: dict[str, str]) -> list[str]:
    """The entry of names that share a description: one line if they have one type, else one line each."""
    names = [name.strip() for name in line.split(",")]
    kinds = [found.get(name.lstrip("*"), "") for name in names]
    if not all(kinds):
        return [line]
    if len(set(kinds)) == 1:
        return [f"{line} : {kinds[0]}"]
    return [f"{name} : {kind}" for name, kind in zip(names, kinds, strict=True)]


def annotations_of(thing: Any) -> dict[str, str]:
    """The types of parameters and attributes by name, as readers see them; ``optional`` means a default."""
    module = vars(sys.modules.get(getattr(thing, "__module__", ""), types))
    found = {}
    for owner in reversed(thing.__mro__ if inspect.isclass(thing) else ()):
        around = vars(sys.modules[owner.__module__])
        for name, annotation in vars(owner).get("__annotations__", {}).items():
            found[name] = _shown(annotation, around)
        for name, each in vars(owner).items():
            function = getattr(each, "fget", None) or getattr(each, "func", None)
            if inspect.isfunction(function) and "return" in function.__annotations__:
                found[name] = _shown(function.__annotations__["return"], around)
    for name, parameter in _parameters(thing).items():
        if parameter.annotation is parameter.empty:
            continue
        shown = _shown(parameter.annotation, module)
        # What a converter takes may be anything; what it makes of that says more.
        kind = found.get(name, shown) if shown in ("Any", "object") else shown
        has_default = parameter.default is not parameter.empty
        found[name] = kind.removesuffix(" | None") + ", optional" if has_default else kind
    return found


def _parameters(thing: Any) -> dict[str, inspect.Parameter]:
    try:
        return dict(inspect.signature(thing).parameters)
    except (TypeError, ValueError):
        # Of values and of some built-in classes.
        return {}


def _shown(annotation: Any, around: dict[str, Any]) -> str:
    """An annotation as text, in which short names of unions and functions are written out."""
    text = annotation if isinstance(annotation, str) else _text(annotation)
    return NAME.sub(lambda name: _name(name[0], around), text).replace(*LAWS)


def _name(name: str, around: dict[str, Any]) -> str:
    if name in KNOWN:
        return KNOWN[name]
    meant = around.get(name)
    is_alias = isinstance(meant, types.UnionType | types.GenericAlias) or typing.get_origin(meant) is not None
    return _text(meant) if is_alias else name


def _text(kind: Any) -> str:
    """A type as Python's own words: `float | str | Callable`."""
    if isinstance(kind, str):
        return kind
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (types.UnionType, typing.Union):
        return " | ".join(map(_text, parts))
    if origin is Callable:
        return "Callable"
    if origin is typing.Literal:
        return " | ".join(map(repr, parts))
    if kind is types.NoneType:
        return "None"
    if origin is not None:
        inside = ", ".join("..." if part is ... else _text(part) for part in parts)
        return f"{_text(origin)}[{inside}]"
    return getattr(kind, "__name__", str(kind).removeprefix("typing."))
