"""What makes the results of a sweep: facts by name, so that two sweeps can be told apart and by what."""

from __future__ import annotations

import dis
import functools
import importlib.util
import json
import platform
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import blake2b
from itertools import chain
from pathlib import Path
from types import CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.cache.loader import kernels_key
from hybrid.system.graph import HybridSystem

# Hexadecimal digits of a hash in facts and attributes.
DIGITS = 16
# Of so many functions and files what is found is kept.
KEPT = 1024
# The functions of models are named in a model, so their code counts; that of the library does not.
PACKAGES = tuple(Path(__file__).parents[2] / name for name in ("hybrid", "lyapunov"))
STANDARD = Path(json.__file__).parents[1]


def facts_of(task: Callable[..., Any]) -> dict[str, str]:
    """All that decides the results of a task at a point, by name.

    A task may have an attribute ``facts`` that maps names to values. Otherwise the facts are the code of the
    function, and the values that the function takes from elsewhere: closure, defaults, global names.
    """
    given, found = getattr(task, "facts", None), {"task": name_of(task)}
    if given is None:
        found["code of the task"] = _hash(_own_code(task))
    return {**found, **facts_from(_taken(task) if given is None else given)}


def facts_from(given: Mapping[str, Any]) -> dict[str, str]:
    """Values that decide a result, by name, as texts; and what the library and its kernels are."""
    return {
        **{str(name): _described(value, set()) for name, value in given.items()},
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "hybrid": version(),
        "kernels": kernels_key()[:DIGITS],
    }


def model_hash(system: HybridSystem) -> str:
    """A text that stands for a model, as in the attribute of that name of a sweep."""
    return _hash(_described(system, set()))


def attributes_of(task: Callable[..., Any]) -> dict[str, Any]:
    """Attributes of a dataset that say what made it, the parameters and versions included."""
    facts = facts_of(task)
    made_by = {"task": facts["task"], "task_hash": _hash(json.dumps(facts))}
    system, given = model_of(task), getattr(task, "facts", None) or {}
    if system is not None:
        # The text of a model takes long to write, and the model is often one of the facts.
        text = facts["model"] if given.get("model") is system else _described(system, set())
        made_by["model"] = system.name or "unnamed"
        made_by["model_hash"] = _hash(text)
        made_by["model_parameters"] = json.dumps(dict(system.parameters))
    made_by |= {
        name: value if isinstance(value, str | int | float) else json.dumps(value, default=repr)
        for name, value in given.items()
        if not isinstance(value, HybridSystem) and value is not None
    }
    versions = {"python": platform.python_version(), "numpy": np.__version__, "hybrid": version()}
    return made_by | {f"{name}_version": each for name, each in versions.items()}


def model_of(task: Callable[..., Any]) -> HybridSystem | None:
    """The model that a task works on, if it shows one: its attribute ``system``, or a value that it takes."""
    system = getattr(task, "system", None)
    if isinstance(system, HybridSystem):
        return system
    found = [value for value in _taken(task).values() if isinstance(value, HybridSystem)]
    return found[0] if len(found) == 1 else None


def name_of(task: Callable[..., Any]) -> str:
    """Name of a task with its module."""
    if isinstance(task, functools.partial):
        return name_of(task.func)
    named = task if hasattr(task, "__qualname__") else type(task)
    return f"{named.__module__}.{named.__qualname__}"


def version() -> str:
    """Version of this library."""
    return str(getattr(sys.modules["hybrid"], "__version__", "unknown"))


def _hash(text: str) -> str:
    return blake2b(text.encode("utf-8", "surrogatepass")).hexdigest()[:DIGITS]


def _taken(task: Any) -> dict[str, Any]:
    """Values that a task takes from elsewhere, by name: arguments given in advance, closure, globals."""
    if isinstance(task, functools.partial):
        given = {f"argument {i} of the task": value for i, value in enumerate(task.args)}
        return _taken(task.func) | given | {f"{name!r}": value for name, value in task.keywords.items()}
    if isinstance(task, MethodType):
        return _taken(task.__func__) | {"owner of the task": task.__self__}
    if not isinstance(task, FunctionType):
        return {}
    found: dict[str, Any] = {}
    cells = zip(task.__code__.co_freevars, task.__closure__ or (), strict=True)
    for name, cell in cells:
        try:
            found[f"{name!r}"] = cell.cell_contents
        except ValueError:  # not yet assigned
            continue
    names = _names_in(task.__code__)
    for name in sorted(names):
        value = task.__globals__.get(name)
        if isinstance(value, ModuleType):
            found |= _taken_from_module(name, value, names, set())
        elif value is not None:
            found[f"{name!r}"] = value
    return found | _imported_inside(task.__code__)


def _taken_from_module(title: str, module: ModuleType, names: set[str], seen: set[str]) -> dict[str, Any]:
    """Values of the user's own modules, such as ``module.function``, for the names that a function uses."""
    if _is_installed_module(module) or module.__name__ in seen:
        return {}
    seen = seen | {module.__name__}
    found: dict[str, Any] = {}
    for name in sorted(names & set(vars(module))):
        value = getattr(module, name)
        if isinstance(value, ModuleType):
            found |= _taken_from_module(f"{title}.{name}", value, names, seen)
        else:
            found[f"'{title}.{name}'"] = value
    return found


def _imported_inside(code: CodeType) -> dict[str, str]:
    """The user's own modules that a function imports in its body: a hash of each file.

    The file counts as a whole, because the module may be imported only when the function runs.
    """
    found = {}
    for name in _imports_of(code):
        with suppress(ImportError, ValueError, AttributeError, OSError):
            spec = importlib.util.find_spec(name)
            if spec is not None and spec.has_location and not _is_installed(str(spec.origin)):
                text = Path(str(spec.origin)).read_bytes()
                found[f"module {name!r}"] = blake2b(text).hexdigest()[:DIGITS]
    return found


@functools.lru_cache(KEPT)
def _imports_of(code: CodeType) -> tuple[str, ...]:
    """Names of the modules that a function imports in its body, with those of its inner functions."""
    steps = (each for each in dis.get_instructions(code) if each.opname == "IMPORT_NAME")
    inner = (_imports_of(each) for each in code.co_consts if isinstance(each, CodeType))
    return (*(each.argval for each in steps if isinstance(each.argval, str)), *chain.from_iterable(inner))


def _own_code(task: Any) -> str:
    """The code of a task without the values that it takes from elsewhere."""
    if isinstance(task, functools.partial):
        return _own_code(task.func)
    if isinstance(task, MethodType):
        return _own_code(task.__func__)
    if isinstance(task, FunctionType):
        defaults = _described((task.__defaults__, task.__kwdefaults__), set())
        return _described_code(task.__code__) + defaults
    return _described((task, vars(type(task)).get("__call__")), set())


def _names_in(code: CodeType) -> set[str]:
    """Global names that a function uses, with those of its inner functions."""
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*map(_names_in, inner))


def _described(value: Any, seen: set[int]) -> str:
    """A text that is the same for equal values, in every process."""
    if isinstance(value, str | bytes | int | float | complex | bool | None):
        return repr(value)
    if isinstance(value, np.ndarray | np.generic):
        return _described_array(np.asarray(value), seen)
    if id(value) in seen:
        return "..."
    seen = seen | {id(value)}
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key!r}: {_described(each, seen)}" for key, each in value.items())
        return f"{{{inside}}}"
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(_described(each, seen) for each in value))}}}"
    if isinstance(value, list | tuple):
        return f"({', '.join(_described(each, seen) for each in value)})"
    if isinstance(value, HybridSystem):
        if value.growth is not None:
            # The modes made so far decide nothing.
            names = getattr(value.growth, "called", None)
            told = f" {_described(names, seen)}" if names else ""
            return f"split {_described(value.growth.original, seen)}{told}"
        return f"{value.name or 'unnamed'} {_hash(_described_fields(value, seen))}"
    if isinstance(value, CodeType):
        return _described_code(value)
    if isinstance(value, functools.partial):
        inside = _described((value.func, value.args, value.keywords), seen)
        return f"partial{inside}"
    if isinstance(value, FunctionType):
        return _described_function(value, seen)
    if isinstance(value, MethodType):
        return _described((value.__func__, value.__self__), seen)
    if isinstance(value, type):
        return _described_class(value, seen)
    if attrs.has(type(value)):
        return f"{type(value).__qualname__}{_described_fields(value, seen)}"
    return _described_object(value, seen)


def _described_array(value: np.ndarray, seen: set[int]) -> str:
    if value.dtype.kind == "O" or value.size <= 8:
        return f"array{_described(value.tolist(), seen)}"
    digest = blake2b(np.ascontiguousarray(value).tobytes()).hexdigest()[:DIGITS]
    return f"array {value.dtype}{value.shape} {digest}"


def _described_fields(value: Any, seen: set[int]) -> str:
    fields = [field for field in attrs.fields(type(value)) if field.init and field.eq is not False]
    return _described({field.name: getattr(value, field.name) for field in fields}, seen)


@functools.lru_cache(KEPT)
def _described_code(code: CodeType) -> str:
    """Instructions, names and constants; line numbers do not count."""
    constants = [each for each in code.co_consts if each is not None]
    if code.co_consts and isinstance(code.co_consts[0], str) and code.co_flags & 0x3:
        # A docstring comes first, and decides nothing.
        constants = constants[1:] if code.co_consts[0] == constants[0] else constants
    return _described((code.co_code, code.co_names, code.co_varnames, constants), set())


def _described_function(function: FunctionType, seen: set[int]) -> str:
    if _is_installed(function.__code__.co_filename):
        return f"{function.__module__}.{function.__qualname__}"
    parts = [_described_code(function.__code__)]
    parts += [_described((function.__defaults__, function.__kwdefaults__), seen)]
    parts += [f"{name}: {_described(value, seen)}" for name, value in _taken(function).items()]
    return f"{function.__qualname__} {_hash(' '.join(parts))}"


def _described_class(kind: type, seen: set[int]) -> str:
    """A class: its name; of the user's own classes also the code of the methods, and plain values."""
    name = f"{kind.__module__}.{kind.__qualname__}"
    if _is_installed_module(sys.modules.get(kind.__module__)):
        return name
    parts = [_described_class(base, seen) for base in kind.__bases__]
    for own, value in sorted(vars(kind).items()):
        if isinstance(value, staticmethod | classmethod):
            value = value.__func__
        elif isinstance(value, property):
            value = (value.fget, value.fset)
        plain = isinstance(value, str | bytes | int | float | complex | tuple | list | dict | np.ndarray)
        if isinstance(value, FunctionType) or (plain and not own.startswith("__")):
            parts.append(f"{own}: {_described(value, seen)}")
    return f"{name} {_hash(' '.join(parts))}"


def _is_installed_module(module: ModuleType | None) -> bool:
    """Whether a module is built in, installed, or of this library; one without a file is the user's own."""
    if module is None:
        return True
    if module.__name__ == "__main__":
        return False
    places = [getattr(module, "__file__", None), *getattr(module, "__path__", ())]
    return all(_is_installed(place) for place in places if place)


@functools.lru_cache(KEPT)
def _is_installed(filename: str) -> bool:
    """Whether code belongs to an installed package or to this library, whose versions stand for it."""
    path = Path(filename)
    return "site-packages" in path.parts or any(
        path.is_relative_to(folder) for folder in (*PACKAGES, STANDARD)
    )


def _described_object(value: Any, seen: set[int]) -> str:
    """Another object: its class, and what it holds."""
    held = getattr(value, "__dict__", None)
    kind = _described_class(type(value), seen)
    if held is None:
        name = getattr(value, "__qualname__", None) or getattr(value, "__name__", "")
        return f"{kind} {name}".rstrip()
    return f"{kind}{_described(held, seen)}"
