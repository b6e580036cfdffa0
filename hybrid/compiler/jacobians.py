"""The statements of matrices of derivatives, most of whose cells are zero in a large system."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from hybrid.compiler.statements.code import Code, Statement, at, get, loop, put
from hybrid.compiler.statements.values import assignments
from hybrid.expression.nodes import ZERO, Expression

# So many zeros are written by a loop.
MANY_ZEROS = 50


def cells(rows: Sequence[Sequence[Expression]], place: Callable[[int, int], Code]) -> list[Statement]:
    """Statements for the cells of a derivative that are not zero, each in its place."""
    found = [(i, j) for i, row in enumerate(rows) for j, entry in enumerate(row) if entry is not ZERO]
    return assignments([place(*each) for each in found], [rows[i][j] for i, j in found])


def place_of(size: int | None) -> Callable[[int, int], Code]:
    """The places of the cells of a derivative; ``size`` is None for a gradient."""
    return (lambda i, j: at("out", j)) if size is None else (lambda i, j: at("out", i, j))


def written_cells(statements: Iterable[Statement]) -> list[tuple[int, ...]]:
    """The cells of ``out`` that statements write, in order."""
    places: list[Any] = [statement[1] for statement in statements if statement[0] == "set"]
    return [tuple(place[2:]) for place in places if place[:2] == ("at", "out")]


def gradient(statements: Sequence[Statement], n: int) -> list[Statement]:
    """Statements for all cells of a gradient ``(n + 1,)``."""
    known = set(written_cells(statements))
    return [*statements, *(put(at("out", j), 0.0) for j in range(n + 1) if (j,) not in known)]


def zeros_first(statements: Sequence[Statement], n: int) -> list[Statement]:
    """Statements for all cells of a matrix ``(n, n + 1)``; a loop writes zeros if there are many."""
    known = set(written_cells(statements))
    if n * (n + 1) - len(known) < MANY_ZEROS:
        zeros = ((i, j) for i in range(n) for j in range(n + 1) if (i, j) not in known)
        return [*statements, *(put(at("out", i, j), 0.0) for i, j in zeros)]
    row = [loop("j", 0, n + 1, [put(at("out", get("i"), get("j")), 0.0)])]
    return [loop("i", 0, n, row), *statements]


def with_time(statements: Sequence[Statement], n: int) -> list[Statement]:
    """Statements for the Jacobian of a field: cells that are zero are left alone, but for those of time."""
    known = set(written_cells(statements))
    return [*statements, *(put(at("out", i, n), 0.0) for i in range(n) if (i, n) not in known)]


def slope_columns(statements: Sequence[Statement], n: int) -> tuple[tuple[int, ...], ...]:
    """By row, the columns of the state that these statements write."""
    columns: list[list[int]] = [[] for _ in range(n)]
    for row, column in sorted(written_cells(statements)):
        if column < n:
            columns[row].append(column)
    return tuple(map(tuple, columns))
