"""The code of functions of an index: one case for each body of statements, as text.

A case has two lines: the name of its function with the indices, and the statements as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence

from hybrid.compiler.statements.code import Statement
from hybrid.compiler.statements.rolled import rolled

# The indices of a case, and its statements as JSON. A case without indices is run for every index.
Case = tuple[tuple[int, ...], str]


def body_text(statements: Sequence[Statement], *, roll: bool = True) -> str:
    """Statements as text, with loops for those that repeat if these may ``roll``; empty if there are none."""
    written = rolled(statements) if roll else statements
    return json.dumps(written, separators=(",", ":")) if statements else ""


def cases_of_index(bodies: Iterable[str]) -> list[Case]:
    """The cases of a function, given the text of its statements for each index; equal ones share a case."""
    indices: dict[str, list[int]] = {}
    for index, body in enumerate(bodies):
        if body:
            indices.setdefault(body, []).append(index)
    return [(tuple(places), body) for body, places in indices.items()]


def function_text(name: str, cases: Iterable[Case]) -> str:
    """A function as text."""
    return "".join(f"{' '.join(map(str, (name, *indices)))}\n{body}\n" for indices, body in cases)


def cases_in(text: str) -> Iterator[tuple[str, Case]]:
    """The cases in a text, each with the name of its function."""
    lines = text.splitlines()
    for head, body in zip(lines[::2], lines[1::2], strict=True):
        name, *indices = head.split()
        yield name, (tuple(map(int, indices)), body)
