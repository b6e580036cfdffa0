"""The compiled functions of a model, from their text or from the cache of an earlier process."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.compiler.cache.folder import keep, source_key
from hybrid.compiler.cache.store import kept_of_model, models_folder
from hybrid.compiler.cases import Case, cases_in, function_text
from hybrid.compiler.llvm.abreast import ABREAST_SIGNATURE, AbreastBody
from hybrid.compiler.llvm.engine import load, processor
from hybrid.compiler.llvm.machine import LOOPS, NO_LOOPS, NOTHING_BUT_LOOPS, machine_code
from hybrid.compiler.llvm.wanted import (
    MATRIX_SIGNATURE,
    SERIES_SIGNATURE,
    VECTOR_SIGNATURE,
    CaseTable,
    Function,
    OwnFunction,
)
from hybrid.compiler.opaque import compiled_functions
from hybrid.compiler.parts import PARTS, SLOPES
from hybrid.compiler.statements.code import bodies_in

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted
    from hybrid.compiler.llvm.engine import Compiled

# Between the name of a function and the number of a case of it.
CASE = "_case_"
# The case of indices without statements.
NOTHING: Case = (), "[]"
# Number of texts whose machine code stays in memory after their systems are deleted.
MOST_SOURCES = 128
SIGNATURES = {
    "field_jacobian": MATRIX_SIGNATURE,
    "reset_jacobian": MATRIX_SIGNATURE,
    "series": SERIES_SIGNATURE,
    "tangent_series": SERIES_SIGNATURE,
    "series_abreast": ABREAST_SIGNATURE,
    "tangent_series_abreast": ABREAST_SIGNATURE,
}
# In series, multiplications and additions may be fused. In a guard, fusing could make a difference of equal
# terms nonzero.
FUSED = ("series", "tangent_series", "series_abreast", "tangent_series_abreast")
# What runs call once for an event, not on every step.
RARE = PARTS[SLOPES]
# The least share of the work in loops over statements of functions that consist of such loops.
IN_LOOPS = 0.9
# What writes the instructions of these functions.
BODIES = dict.fromkeys(("series_abreast", "tangent_series_abreast"), AbreastBody)


def own_functions(emitted: Emitted) -> dict[str, tuple[Any, int]]:
    """Functions that cannot be traced, compiled as they are: by name, the code and the size of its result.

    Raises
    ------
    ModelError
        If a function cannot be compiled.
    """
    own: dict[str, tuple[Any, int]] = {}
    for name, opaque in emitted.opaque.items():
        own |= {each: (code, opaque.size) for each, code in compiled_functions(name, opaque).items()}
    return own


def compiled_part(text: str, part: str, own: Mapping[str, tuple[Any, int]]) -> dict[str, Compiled]:
    """The compiled functions of a part of ``PARTS`` by name; ``own`` are those of ``own_functions``."""
    if not own:
        return shared_functions(text, PARTS[part])
    # The user's functions have addresses of this process, so code that calls them is not cached.
    calls = {name: OwnFunction(code.address, size) for name, (code, size) in own.items()}
    code = _code(text, PARTS[part], calls)
    return load(code, PARTS[part], needs=[each for each, _ in own.values()])


def compiled_stage(text: str, part: str, known: dict[Any, Any], size: int) -> dict[str, Compiled]:
    """The compiled functions of a part, for a stage of a system that grows.

    Each case of a function is compiled by itself, once for all stages; ``known`` keeps them. For each name a
    stage adds a table of the ``size`` addresses of its cases, and a function that calls them by the table.
    """
    cases: dict[str, list[Case]] = {name: [NOTHING] for name in PARTS[part]}
    for name, case in cases_in(text):
        cases[name].insert(-1, case)
    new = dict.fromkeys(
        (name, body) for name, each in cases.items() for _, body in each if (name, body) not in known
    )
    if new:
        named = {f"{name}{CASE}{number}": (name, body) for number, (name, body) in enumerate(new)}
        source = "".join(function_text(name, [((), body)]) for name, (_, body) in named.items())
        compiled = shared_functions(source, tuple(named))
        known |= {key: compiled[name] for name, key in named.items()}
    tables: dict[str, CaseTable] = {}
    needs: list[Any] = []
    for name, each in cases.items():
        addresses = np.full(size, known[name, NOTHING[1]].address, dtype=np.int64)
        for indices, body in each:
            addresses[[*indices]] = known[name, body].address
            needs.append(known[name, body])
        needs.append(addresses)
        tables[f"{name}{CASE}"] = CaseTable(addresses.ctypes.data)
    source = "".join(function_text(name, [((), f'[["do",["{name}{CASE}"]]]')]) for name in PARTS[part])
    return load(_code(source, PARTS[part], tables), PARTS[part], needs)


@lru_cache(maxsize=MOST_SOURCES)
def shared_functions(source: str, names: tuple[str, ...]) -> dict[str, Compiled]:
    """The compiled functions of a text that calls no user function, shared by all systems with it."""
    file = f"model_{source_key(source, processor())}.o"
    code = kept_of_model(file)
    if code is None:
        code = _code(source, names, {})
        keep(models_folder() / file, code)
    return load(code, names)


def _code(source: str, names: Sequence[str], calls: Mapping[str, OwnFunction | CaseTable]) -> bytes:
    cases: dict[str, list[Any]] = {name: [] for name in names}
    for name, (indices, body) in cases_in(source):
        cases[name].append((indices, json.loads(body)))
    loops = _loops(body for each in cases.values() for _, body in each)
    kinds = {name: name.partition(CASE)[0] for name in names}
    wanted = [
        Function(
            name,
            SIGNATURES.get(kind, VECTOR_SIGNATURE),
            cases[name],
            kind in FUSED,
            loops,
            BODIES.get(kind),
        )
        for name, kind in kinds.items()
    ]
    return machine_code(wanted, calls, rare=all(kind in RARE for kind in kinds.values()))


def _loops(bodies: Iterable[Any]) -> int:
    """The level of passes for the loops of functions with these statements."""
    in_loops = straight = 0
    level = NO_LOOPS
    rest = [statement for body in bodies for statement in body]
    while rest:
        statement = rest.pop()
        inner = bodies_in(statement)
        rest += [each for body in inner for each in body]
        if statement[0] == "repeat":
            _, _, turns, body = statement
            in_loops += turns * _size(body)
        elif statement[0] == "for":
            level = LOOPS
        elif not inner:
            straight += _size(statement)
    return NOTHING_BUT_LOOPS if in_loops > IN_LOOPS * (in_loops + straight) else level


def _size(term: Any) -> int:
    """The number of operations and places of values in a term."""
    return 1 + sum(map(_size, term)) if isinstance(term, list) else 0
