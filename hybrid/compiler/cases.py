"""The text of functions of an index: one case for each body of statements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

# Statements of one case, and the condition on the index under which they are run.
Case = tuple[str, tuple[str, ...]]
_INDENT = "    "


def function_of_index(name: str, branches: Iterable[Sequence[str]]) -> str:
    """Source of a function with a branch for each index; indices share one if their statements are equal."""
    indices: dict[tuple[str, ...], list[int]] = {}
    for index, statements in enumerate(branches):
        indices.setdefault(tuple(statements), []).append(index)
    cases = ((" or ".join(f"index == {place}" for place in places), body) for body, places in indices.items())
    return function_text(name, [(condition, body) for condition, body in cases if body])


def function_text(name: str, cases: Sequence[Case]) -> str:
    """Source of a function; a single case without a condition is run for every index."""
    order = "order, " if "series" in name else ""
    lines = [f"def {name}(index, t, x, p, {order}out):"]
    for place, (condition, body) in enumerate(cases):
        if condition:
            lines.append(f"{_INDENT}{'if' if place == 0 else 'elif'} {condition}:")
        depth = _INDENT * (2 if condition else 1)
        lines += [f"{depth}{statement}" for statement in body]
    if not cases:
        lines.append(f"{_INDENT}pass")
    return "\n".join(lines) + "\n"


def cases_of(source: str, name: str) -> list[Case]:
    """The cases of a function in a text of such functions."""
    lines = source.splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith(f"def {name}(")) + 1
    cases: list[tuple[str, list[str]]] = []
    for line in lines[begin:]:
        if not line.strip():
            break
        if line.startswith(2 * _INDENT):
            cases[-1][1].append(line.removeprefix(2 * _INDENT))
        elif line.strip() != "pass":
            cases.append((line.strip().partition(" ")[2].removesuffix(":"), []))
    return [(condition, tuple(body)) for condition, body in cases]
