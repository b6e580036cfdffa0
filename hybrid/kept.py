"""What tracing found out about a system, kept on disk, so that the next process need not wait for SymPy.

A model function may depend on anything: constants, closures, globals, what it calls. None of that is looked
at. The function is called again, as tracing would call it, on numbers that only list what is done with them;
the list is all that tracing ever learns of the function. The same lists give the same expressions, and these
the same code.
"""

from __future__ import annotations

import hashlib
import json
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.cache import cache_folder, keep, kept, source_key
from hybrid.emitted import Emitted, Programs, Propagator, Series
from hybrid.load import kernels_key, sources_in
from hybrid.roles import roles
from hybrid.traced import TraceError, values_of

if TYPE_CHECKING:
    from hybrid.roles import Role
    from hybrid.system import HybridSystem


class Operations:
    """Traced numbers as places in a list of operations; what has been done before is not listed twice."""

    def __init__(self) -> None:
        self.places: dict[tuple[Any, ...], int] = {}

    def listed(self, *operation: Any) -> int:
        """Place of an operation."""
        return self.places.setdefault(operation, len(self.places))

    def number(self, value: Any) -> int:
        """Place of a number, to the last bit."""
        return self.listed("number", float(value).hex())

    def combined(self, name: str, contents: tuple[int, ...]) -> int:
        """Place of a function's value."""
        return self.listed(name, *contents)

    def expression(self, content: int) -> Any:
        """A function that asks for expressions is to be traced by SymPy each time."""
        raise TraceError("there is no expression where operations are only listed")


def traced_or_kept(system: HybridSystem) -> Emitted:
    """What `emit` makes of a system, or what it made of the same one before."""
    operations = operations_of(system)
    if operations is None:
        return _traced(system)
    path = models_folder() / f"emitted_{_digest(operations)}.json"
    before = _read(path)
    if before is not None:
        return before
    emitted = _traced(system)
    if not emitted.opaque:
        text = json.dumps(attrs.asdict(emitted), default=int)
        keep(path, f"{_checksum(text)}\n{text}".encode())
    return emitted


def models_folder() -> Path:
    """Folder of what is kept of models, named after what makes machine code of them."""
    return cache_folder(f"models-{_compiler()}")


@cache
def _compiler() -> str:
    paths = sources_in(Path(__file__).parent / "compiler")
    return source_key(kernels_key(), *(path.read_text(encoding="utf-8") for path in paths))


def operations_of(system: HybridSystem) -> str | None:
    """All that emitting depends on, as text: names, graph, and the operations of every function.

    None if they cannot be listed: a function fails, or asks for more than the results of operations.
    """
    try:
        functions = [_listed(system, role) for role in roles(system)]
        period = _listed_period(system)
    except Exception:
        return None
    graph = [
        [
            transition.name,
            transition.source,
            transition.target,
            transition.accumulates_to,
            int(transition.guard.direction),
            transition.guard.at_start,
            transition.guard.when is None,
            transition.reset is None,
        ]
        for transition in system.transitions
    ]
    return json.dumps([system.state, [*system.parameters], [*system.mode_names], graph, functions, period])


def _listed(system: HybridSystem, role: Role) -> list[Any]:
    """Owner and name of a role, and for its function and its derivative the operations and the results."""
    names = tuple(system.parameters)
    lists: list[Any] = []
    for function in (role.function, role.derivative):
        if function is None:
            lists.append(None)
            continue
        operations = Operations()
        t = operations.listed("t")
        x = [operations.listed("x", i) for i in range(system.dimension)]
        p = [operations.listed("p", i) for i in range(len(names))]
        values = values_of(function, system.state, names, operations, (t, x, p))
        lists.append([[*operations.places], values])
    return [role.owner, role.name, *lists]


def _listed_period(system: HybridSystem) -> Any:
    """The declared period: a number, or the operations that make one."""
    period: Any = system.period
    if not callable(period):
        return None if period is None else float(period).hex()
    operations = Operations()
    p = [operations.listed("p", i) for i in range(len(system.parameters))]
    names = tuple(system.parameters)
    try:
        values = values_of(lambda t, x, p: period(p), 1, names, operations, (-1, [-1], p))
    except Exception:
        return "cannot be traced"
    return [[*operations.places], values]


def _digest(operations: str) -> str:
    return hashlib.sha256(f"{_tracer()}\n{operations}".encode()).hexdigest()


@cache
def _tracer() -> str:
    """What does the tracing: this package and what it stands on."""
    import importlib.metadata

    package = Path(__file__).parent
    kernels = package / "kernels"
    # The folder is named after the kernels.
    sources = [path for path in sources_in(package) if kernels not in path.parents]
    digest = hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()
    versions = [importlib.metadata.version(package) for package in ("sympy", "mpmath")]
    return " ".join([digest, sys.version, np.__version__, *versions])


def _traced(system: HybridSystem) -> Emitted:
    """What emitting finds; SymPy is imported only now."""
    from hybrid.emit import emit

    return emit(system)


def _read(path: Path) -> Emitted | None:
    checksum, _, text = (kept(path) or b"").decode(errors="replace").partition("\n")
    if checksum != _checksum(text):
        return None
    try:
        found: dict[str, Any] = json.loads(text)
        of_transitions = ("affine_guard", "guard_in_series", "surface", "orientation")
        of_modes = ("affine_mode", "autonomous", "discontinuities", "traced_field")
        parts = ("first_forcing", "forcing_component", "first_residue", "residue_component")
        for name in (*of_transitions, *of_modes, "timed_guard", *parts):
            found[name] = tuple(found[name])
        names = ("rows", "checked", "numbers", "first")
        rows, checked, numbers, first = (found["programs"][name] for name in names)
        found["programs"] = Programs(
            tuple(map(tuple, rows)), tuple(checked), tuple(map(float, numbers)), tuple(first)
        )
        found["propagators"] = tuple(map(_propagator, found["propagators"]))
        return Emitted(**found)
    except (ValueError, LookupError, TypeError):
        return None


def _propagator(found: dict[str, Any]) -> Propagator:
    series = Series(**{**found["series"], "statements": (), "tangent_statements": ()})
    return Propagator(found["kind"], found["degree"], found["reason"], series, tuple(found["guards"]))


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
