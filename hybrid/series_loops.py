"""The loops over orders that recurrences run in: state first, then all tangent vectors order by order."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy

from hybrid.kernels.codes import NARROW
from hybrid.series import Recurrences


def indented(statements: Iterable[str]) -> list[str]:
    """One level deeper."""
    return [f"    {statement}" for statement in statements]


def padded(width: int) -> int:
    """The width of a block, filled up to whole vectors."""
    return -(-width // NARROW) * NARROW


def padded_for_all(width: int) -> str:
    """Text of the padded width of a block for all ``count`` tangent vectors."""
    return f"(count*{width} + {NARROW - 1})//{NARROW}*{NARROW}"


def inner_sums(block: Recurrences) -> list[str]:
    """Statements that name the inner sums, which stand where the coefficients of this order will be."""
    return [
        f"{block.prefix}s{i}_{place} = out[o, {block.prefix}b{i} + {place}]"
        for i, rights in enumerate(block.blocks.values())
        for place in range(len(rights))
    ]


def state_loop(
    targets: Sequence[str], rates: Sequence[sympy.Expr], starts: Sequence[str], block: Recurrences
) -> list[str]:
    """Statements for the series of ``y' = rates`` from ``starts``, in the columns ``targets``."""
    values = [block.coefficient(rate) for rate in rates]
    carried = [f"{block.prefix}r{i} = {value}" for i, value in enumerate(values)]
    return [
        "o = 0",
        *(f"out[0, {target}] = {start}" for target, start in zip(targets, starts, strict=True)),
        *block.first,
        *carried,
        "for o in range(1, order + 1):",
        *indented(
            [
                "shrink = 1.0/o",
                *(f"out[o, {target}] = shrink*{block.prefix}r{i}" for i, target in enumerate(targets)),
                *(
                    f"convolve(out, o, {left}, {block.prefix}b{i}, {padded(len(rights))})"
                    for i, (left, rights) in enumerate(block.blocks.items())
                ),
                *inner_sums(block),
                *block.higher,
                *carried,
            ]
        ),
    ]


def tangent_loop(n: int, rates: Sequence[sympy.Expr], block: Recurrences) -> list[str]:
    """Statements for the series of ``count`` tangent vectors: all of them order by order.

    The blocks of all vectors lie side by side, so that each factor is multiplied with all at once.
    """
    values = [block.coefficient(rate) for rate in rates]
    prefix = block.prefix
    each = [
        "v = n + i*n",
        *(f"{prefix}b{i} = first{i} + i*{len(rights)}" for i, rights in enumerate(block.blocks.values())),
    ]
    later = [f"out[o + 1, v + {i}] = shrink*{value}" for i, value in enumerate(values)]
    return [
        "o = 0",
        "shrink = 1.0",
        "for i in range(count):",
        *indented([*each, *(f"out[0, v + {i}] = x[v + {i}]" for i in range(n)), *block.first, *later]),
        "for o in range(1, order + 1):",
        *indented(
            [
                "shrink = 1.0/(o + 1)",
                *(
                    f"convolve(out, o, {left}, first{i}, {padded_for_all(len(rights))})"
                    for i, (left, rights) in enumerate(block.blocks.items())
                ),
                "for i in range(count):",
                *indented([*each, *inner_sums(block), *block.higher, *later]),
            ]
        ),
    ]
