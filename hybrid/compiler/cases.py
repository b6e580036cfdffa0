"""The text of functions of an index: one case for each body of statements."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

# The indices of a case, and its statements.
Case = tuple[tuple[int, ...], tuple[str, ...]]
_INDENT = "    "


def function_of_index(name: str, branches: Iterable[Sequence[str]]) -> str:
    """Source of a function with a branch for each index; indices share one if their statements are equal."""
    indices: dict[tuple[str, ...], list[int]] = {}
    for index, statements in enumerate(branches):
        indices.setdefault(tuple(statements), []).append(index)
    return function_text(name, [(tuple(places), body) for body, places in indices.items() if body])


def function_text(name: str, cases: Sequence[Case]) -> str:
    """Source of a function; a single case without indices is run for every index."""
    order = "order, " if "series" in name else ""
    lines = [f"def {name}(index, t, x, p, {order}out):"]
    for place, (indices, body) in enumerate(cases):
        if indices:
            condition = " or ".join(f"index == {index}" for index in indices)
            lines.append(f"{_INDENT}{'if' if place == 0 else 'elif'} {condition}:")
        depth = _INDENT * (2 if indices else 1)
        lines += [f"{depth}{statement}" for statement in body]
    if not cases:
        lines.append(f"{_INDENT}pass")
    return "\n".join(lines) + "\n"


def cases_of(source: str, name: str) -> list[Case]:
    """The cases of a function in a text of such functions."""
    lines = source.splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith(f"def {name}(")) + 1
    cases: list[tuple[tuple[int, ...], list[str]]] = []
    for line in lines[begin:]:
        if not line.strip():
            break
        if line.startswith(2 * _INDENT):
            cases[-1][1].append(line.removeprefix(2 * _INDENT))
        elif line.strip() != "pass":
            cases.append((tuple(int(number) for number in re.findall(r"index == (\d+)", line)), []))
    return [(indices, tuple(body)) for indices, body in cases]
