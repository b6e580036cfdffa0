"""The statements of matrices of derivatives, most of whose cells are zero in a large system."""

from __future__ import annotations

import re

# A cell of a matrix, and how the statement for a cell that is zero ends.
CELL = re.compile(r"\bout\[(\d+), (\d+)\]")
ZERO = "] = 0.0"
# So many zeros are written by a loop.
MANY_ZEROS = 50


def zeros_first(statements: list[str], n: int) -> list[str]:
    """Statements for a matrix ``(n, n + 1)``; many entries that are zero are written by a loop."""
    others = [each for each in statements if not each.endswith(ZERO)]
    if len(statements) - len(others) < MANY_ZEROS:
        return statements
    loop = [f"for i in range({n}):", f"    for j in range({n + 1}):", "        out[i, j] = 0.0"]
    return [*loop, *others]


def without_zeros(statements: list[str], n: int) -> list[str]:
    """Statements for the Jacobian of a field but for the zeros left of the last column, that of time."""
    return [each for each in statements if not each.endswith(ZERO) or f", {n}] = " in each]


def slope_columns(statements: list[str], n: int) -> tuple[tuple[int, ...], ...]:
    """By row, the columns of the state that these statements write."""
    cells = [map(int, cell.groups()) for each in statements if (cell := CELL.match(each))]
    columns: list[list[int]] = [[] for _ in range(n)]
    for row, column in cells:
        if column < n:
            columns[row].append(column)
    return tuple(map(tuple, columns))
