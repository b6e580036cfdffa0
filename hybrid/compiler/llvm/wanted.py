"""The functions that are to be compiled, and what they call that has been compiled before."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from hybrid.compiler.llvm.calls import NUMBER, WHOLE


@attrs.frozen
class OwnFunction:
    """A function of the user: the address of its machine code, and the number of values that it writes."""

    address: int
    size: int


@attrs.frozen
class CaseTable:
    """The cases of a function that are compiled already: where the address of each, by index, is stored.

    They take the arguments of the function.
    """

    address: int


NO_CALLS: Mapping[str, OwnFunction | CaseTable] = {}


@attrs.frozen
class Signature:
    """Names and types of the arguments of a function; an integer is an array with that number of axes."""

    names: tuple[str, ...]
    types: tuple[Any, ...]


VECTOR_SIGNATURE = Signature(("index", "t", "x", "p", "out"), (WHOLE, NUMBER, 1, 1, 1))
MATRIX_SIGNATURE = Signature(("index", "t", "x", "p", "out"), (WHOLE, NUMBER, 1, 1, 2))
SERIES_SIGNATURE = Signature(("index", "t", "x", "p", "order", "out"), (WHOLE, NUMBER, 1, 1, WHOLE, 2))


@attrs.frozen
class Function:
    """A function to be compiled.

    Attributes
    ----------
    name
        Its name in the machine code.
    signature
        Names and types of its arguments.
    cases
        Indices, with the statements for them; a case without indices is run for every index.
    fused
        Whether multiplications and additions may be fused.
    loops
        The level of LLVM's passes for its loops (``hybrid.compiler.llvm.machine``).
    body
        What writes its instructions; ``hybrid.compiler.llvm.lowering.Body`` for None.
    """

    name: str
    signature: Signature
    cases: Sequence[Any]
    fused: bool = False
    loops: int = 0
    body: Any = None
