"""The statements of matrices of derivatives, most of whose cells are zero in a large system."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import product
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
    return _with_zeros(statements, ((j,) for j in range(n + 1)))


def zeros_first(statements: Sequence[Statement], n: int) -> list[Statement]:
    """Statements for all cells of a matrix ``(n, n + 1)``; a loop writes zeros if there are many."""
    if n * (n + 1) - len(set(written_cells(statements))) < MANY_ZEROS:
        return _with_zeros(statements, product(range(n), range(n + 1)))
    row = [loop("j", 0, n + 1, [put(at("out", get("i"), get("j")), 0.0)])]
    return [loop("i", 0, n, row), *statements]


def with_time(statements: Sequence[Statement], n: int) -> list[Statement]:
    """Statements for the Jacobian of a field: cells that are zero are left alone, but for those of time."""
    return _with_zeros(statements, ((i, n) for i in range(n)))


def _with_zeros(statements: Sequence[Statement], places: Iterable[tuple[int, ...]]) -> list[Statement]:
    """Statements that write zero to those of these cells that no other statement writes."""
    known = set(written_cells(statements))
    return [*statements, *(put(at("out", *place), 0.0) for place in places if place not in known)]


def slope_columns(statements: Sequence[Statement], n: int) -> tuple[tuple[int, ...], ...]:
    """By row, the columns of the state that these statements write."""
    columns: list[list[int]] = [[] for _ in range(n)]
    for row, column in sorted(written_cells(statements)):
        if column < n:
            columns[row].append(column)
    return tuple(map(tuple, columns))
