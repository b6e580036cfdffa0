"""Tables as plain text, and as HTML for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

# What authors write for the unit of numbers such as ratios.
NO_UNIT = ("", "1", "-", "[-]", "–", "—")


def table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: bool = False) -> str:
    """Columns of text; with ``numbers`` all columns but the first are right-aligned."""
    cells = [list(headings), *map(list, rows)]
    widths = [max(len(row[column]) for row in cells) for column in range(len(headings))]
    lines = []
    for row in cells:
        first, *others = zip(row, widths, strict=True)
        aligned = [text.rjust(width) if numbers else text.ljust(width) for text, width in others]
        lines.append("  ".join([first[0].ljust(first[1]), *aligned]).rstrip())
    return "\n".join(lines)


def html_table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """The same columns as an HTML table."""

    def row_of(tag: str, cells: Sequence[str]) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(text)}</{tag}>" for text in cells) + "</tr>"

    body = "".join(row_of("td", row) for row in rows)
    return f"<table><thead>{row_of('th', headings)}</thead><tbody>{body}</tbody></table>"


def with_unit(name: str, unit: str | None) -> str:
    """A name with its unit, if there is one: ``q (m)``. Numbers have none."""
    return f"{name} ({unit})" if unit and unit not in NO_UNIT else name


def measured(number: str, unit: str | None) -> str:
    """A number with its unit, if there is one: ``2.5 m``."""
    return f"{number} {unit}" if unit and unit not in NO_UNIT else number


def counted(number: int, noun: str) -> str:
    """A number with its noun: ``1 jump``, ``2 jumps``."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
