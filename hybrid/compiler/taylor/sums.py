"""Sums with short chains of dependent operations.

A processor multiplies and adds in one instruction and runs several at once, but each result takes three or
four cycles. So the length of the chain sets the time from one order of a series to the next.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Term(NamedTuple):
    """A term of a sum: when it is known, its code, and whether it is a product.

    The time is a number of operations, and a second number that decides between equal ones.
    """

    ready: tuple[int, int]
    code: Any
    is_product: bool


def added(terms: list[Term]) -> Any:
    """Code of a sum: terms known first are added first, and independent partial sums run in parallel."""
    while len(terms) > 1:
        one, other, *rest = sorted(terms, key=lambda term: term.ready)
        depth, late = max(other.ready, (one.ready[0] + one.is_product, one.ready[1]))
        terms = [*rest, Term((depth + 1, late), one.code + other.code, False)]
    return terms[0].code
