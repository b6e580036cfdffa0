"""Where the factors of convolutions lie: side by side, so that whole registers of them are multiplied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from hybrid.kernels.types.codes import WIDE

# From so many convolutions on, a first factor of several is stored once: most of the time goes into reading.
MANY = 64
# Fewest convolutions per layer, on average: two of the widest registers.
LEAST = 2 * WIDE


@attrs.frozen
class Layer:
    """Convolutions whose factors lie side by side.

    Attributes
    ----------
    left, right
        Names of the first columns of both factors: the same name for squares.
    lefts
        Columns of the first factors, copied to the block ``left``; none if a layer before has them there.
    places
        The convolutions, by their numbers.
    """

    left: str
    right: str
    lefts: tuple[Any, ...]
    places: tuple[int, ...]


def layers(lefts: Sequence[Any], squares: Sequence[bool], prefix: str) -> list[Layer]:
    """The layers of convolutions, given the column of each first factor and whether the second is the same.

    Of many convolutions, a layer has at most one for each first factor, in the order of the first layer.
    """
    if not lefts:
        return []
    together = [Layer(f"{prefix}a0", f"{prefix}b0", tuple(lefts), tuple(range(len(lefts))))]
    if len(lefts) < MANY:
        return together
    with_square = {left: place for place, left in enumerate(lefts) if squares[place]}
    others: dict[Any, list[int]] = {left: [] for left in lefts}
    for place, left in enumerate(lefts):
        if not squares[place]:
            others[left].append(place)
    order = sorted(others, key=lambda left: (left not in with_square, -len(others[left])))
    stacked = [[with_square[left] for left in order if left in with_square]]
    stacked += [
        [others[left][depth] for left in order if len(others[left]) > depth]
        for depth in range(max(map(len, others.values())))
    ]
    stacked = [each for each in stacked if each]
    if len(stacked) * LEAST > len(lefts):
        return together
    found: list[Layer] = []
    blocks: dict[str, tuple[Any, ...]] = {}
    for number, places in enumerate(stacked):
        mine = tuple(lefts[place] for place in places)
        known = [name for name, held in blocks.items() if held[: len(mine)] == mine]
        left = known[0] if known else f"{prefix}a{number}"
        right = left if squares[places[0]] else f"{prefix}b{number}"
        blocks.setdefault(left, mine)
        found.append(Layer(left, right, () if known else mine, tuple(places)))
    return found


def columns_of(found: Sequence[Layer]) -> Mapping[str, int]:
    """By name of a block, the number of its columns."""
    sizes: dict[str, int] = {}
    for layer in found:
        for name in (layer.left, layer.right):
            sizes.setdefault(name, len(layer.places))
    return sizes
