"""Terms and statements of compiled functions: plain tuples, which are stored as JSON and compiled by LLVM.

A term is a number (a whole one is an index or a count), or a tuple of an operation and its terms:

====================================  ==================================================================
``("get", name)``                     a variable or an argument
``("at", array, i)``, ``(..., i, j)``  an entry of an array
``("listed", numbers, i)``            an entry of a list that is part of the code
``("item", term, i)``                 one of several numbers
``("several", a, b, ...)``            several numbers
``("rounded", a)``                    a term in which nothing is fused
``("if", condition, a, b)``           a choice; only one of the two is computed
``("+", a, b)`` ...                   arithmetic, comparisons, ``"and"``, ``"or"``, ``"not"``, ``"neg"``
``("sin", a)`` ...                    a call of ``hybrid.compiler.llvm.calls``, or of a user's function
====================================  ==================================================================

A statement is one of these:

====================================  ==================================================================
``("set", place, term)``              give a variable, several variables or an entry of an array a value
``("do", term)``                      a call for what it does
``("for", name, start, stop, step,    a loop as over Python's ``range``
body)``
``("repeat", name, count, body)``      a loop whose turns do not wait for one another
``("when", condition, body, other)``  one of two lists of statements
``("whole", name, number)``           a name for a whole number
``("array", name, size)``             an array of this function; all entries have the type of the first one
====================================  ==================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Statement = tuple[Any, ...]
# Positions of arguments that are part of a call itself, counted from zero, and of items.
KNOWN = {
    "item": (1,),
    "table": (1, 2, 3, 4),
    "convolve": (4,),
    "convolve_pairs": (4,),
    "convolved": (4, 5),
    "convolved_pairs": (4, 5),
    "add_ends": (2, 5),
    "add_ends_of_pairs": (2, 5),
    "combine": (3,),
    "combine_tangents": (3, 5),
    "spread_tangents": (1,),
}


class LoweringError(Exception):
    """The code has something that compiled functions do not have."""


class Code(tuple[Any, ...]):
    """A term that is no number; Python's operators on it write further terms."""

    __slots__ = ()

    def __add__(self, other: Any) -> Code:
        return Code(("+", self, other))

    def __radd__(self, other: Any) -> Code:
        return Code(("+", other, self))

    def __sub__(self, other: Any) -> Code:
        return Code(("-", self, other))

    def __rsub__(self, other: Any) -> Code:
        return Code(("-", other, self))

    def __mul__(self, other: Any) -> Code:
        return Code(("*", self, other))

    def __rmul__(self, other: Any) -> Code:
        return Code(("*", other, self))

    def __truediv__(self, other: Any) -> Code:
        return Code(("/", self, other))

    def __rtruediv__(self, other: Any) -> Code:
        return Code(("/", other, self))

    def __floordiv__(self, other: Any) -> Code:
        return Code(("//", self, other))

    def __pow__(self, other: Any) -> Code:
        return Code(("**", self, other))

    def __neg__(self) -> Code:
        return Code(("neg", self))


# A number or a term.
Term = Code | float


def get(name: str) -> Code:
    """A variable or an argument."""
    return Code(("get", name))


def at(array: str, *places: Any) -> Code:
    """An entry of an array."""
    return Code(("at", array, *places))


def call(name: str, *arguments: Any) -> Code:
    """A call, or an operation without a sign of its own in Python."""
    return Code((name, *arguments))


def several(terms: Sequence[Any]) -> Code:
    """Several numbers."""
    return Code(("several", *terms))


def either(condition: Code, a: Any, b: Any) -> Code:
    """``a`` if a condition holds, else ``b``."""
    return Code(("if", condition, a, b))


def less(a: Any, b: Any) -> Code:
    """Whether ``a < b``."""
    return Code(("<", a, b))


def equal(a: Any, b: Any) -> Code:
    """Whether ``a == b``."""
    return Code(("==", a, b))


def put(place: Code, value: Any) -> Statement:
    """Give a variable or an entry of an array a value."""
    return ("set", place, value)


def do(name: str, *arguments: Any) -> Statement:
    """A call for what it does."""
    return ("do", call(name, *arguments))


def loop(name: str, start: Any, stop: Any, body: Sequence[Statement], step: Any = 1) -> Statement:
    """A loop as over Python's ``range``."""
    return ("for", name, start, stop, step, tuple(body))


def when(condition: Code, body: Sequence[Statement], other: Sequence[Statement] = ()) -> Statement:
    """One of two lists of statements; nothing if both are empty."""
    return ("when", condition, tuple(body), tuple(other))


def whole(name: str, value: int) -> Statement:
    """A name for a whole number."""
    return ("whole", name, value)


def bodies_in(statement: Sequence[Any]) -> Sequence[Any]:
    """The lists of statements in a loop over orders or in a branch; nothing for other statements."""
    return {"for": statement[5:], "when": statement[2:]}.get(statement[0], ())
