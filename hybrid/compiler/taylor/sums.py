"""The text of sums in which as little as possible waits for something else.

A processor multiplies and adds in one instruction, several of them at once, but each takes as long as three
or four. What a chain of them takes, from one order of a series to the next, is its length.
"""

from __future__ import annotations

from typing import NamedTuple


class Term(NamedTuple):
    """A term of a sum: when it is known, its text, and whether it is a product.

    The time is a number of operations, and what decides between terms that are known after as many.
    """

    ready: tuple[int, int]
    text: str
    is_product: bool


def added(terms: list[Term]) -> str:
    """Text of a sum: what is known first is added first, and sums that do not need each other run on."""
    while len(terms) > 1:
        one, other, *rest = sorted(terms, key=lambda term: term.ready)
        depth, late = max(other.ready, (one.ready[0] + one.is_product, one.ready[1]))
        both = f"({one.text} + {other.text})" if rest else f"{one.text} + {other.text}"
        terms = [*rest, Term((depth + 1, late), both, False)]
    return terms[0].text
