"""Queries on expressions that visit each node once, however often the node is used."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any, TypeVar

from hybrid.expression.nodes import COUNTLESS, Expression, Function, Symbol, in_order

Cached = TypeVar("Cached", bound=Callable[..., Any])
# Products of tangled sums are not expanded beyond this size: the time may grow with the square of it.
MOST_EXPANDED = 2000

_remembered: list[Any] = []


def once(function: Cached) -> Cached:
    """Cache the results of a function of nodes, until `forget`."""
    remembering: Any = lru_cache(maxsize=None)(function)
    _remembered.append(remembering)
    return remembering


def forget() -> None:
    """Clear the caches, after a model has been compiled."""
    for function in _remembered:
        function.cache_clear()


def nodes(*expressions: Expression) -> Iterator[Expression]:
    """Every node of the expressions, each once."""
    seen: set[Expression] = set()
    waiting = [*expressions]
    while waiting:
        node = waiting.pop()
        if node not in seen:
            seen.add(node)
            yield node
            waiting.extend(node.args)


def nodes_of(kinds: Any, *expressions: Expression) -> set[Any]:
    """The nodes of a class, or of any of several classes."""
    return {node for node in nodes(*expressions) if isinstance(node, kinds)}


def symbols_of(*expressions: Expression) -> frozenset[Symbol]:
    """The symbols of expressions."""
    mask = 0
    for each in expressions:
        mask |= each.mask
    found = []
    while mask:
        lowest = mask & -mask
        found.append(Symbol.known[lowest.bit_length() - 1])
        mask ^= lowest
    return frozenset(found)


def mentions(expression: Expression, symbols: Iterable[Symbol]) -> bool:
    """Whether an expression contains any of the symbols."""
    mask = expression.mask
    return mask != 0 and any(mask & symbol.mask for symbol in symbols)


def contains(expression: Expression, kinds: type[Function] | tuple[type[Function], ...]) -> bool:
    """Whether an expression contains a function of these classes."""
    if not isinstance(kinds, tuple):
        return expression.traits & kinds.own_trait != 0
    return any(expression.traits & kind.own_trait for kind in kinds)


@once
def degree_of(expression: Expression, variables: frozenset[Symbol]) -> int | None:
    """Degree as a polynomial in the variables, without cancellation; None if it is not a polynomial."""
    found: dict[Expression, int | None] = {}
    for each in in_order([expression]):
        found[each] = _degree(each, found, variables)
    return found[expression]


def _degree(
    node: Expression, found: Mapping[Expression, int | None], variables: frozenset[Symbol]
) -> int | None:
    if not mentions(node, variables):
        return 0
    if node.is_symbol:
        return 1
    degrees = [found[each] for each in node.args]
    known = [each for each in degrees if each is not None]
    if node.is_power and node.exponent.is_number:
        whole = node.exponent.is_whole and node.exponent.value > 0
        return degrees[0] * node.exponent.value if whole and degrees[0] is not None else None
    if len(known) < len(degrees):
        return None
    if node.is_product:
        return sum(known)
    return max(known) if node.is_sum else None


def is_larger_than(most: int, expression: Expression) -> bool:
    """Whether an expression, written out as a tree, has more than ``most`` operations."""
    return expression.size > min(most, COUNTLESS - 1)


def replaced(expression: Expression, values: Mapping[Any, Expression]) -> Expression:
    """An expression with some of its nodes replaced."""
    return all_replaced([expression], values)[0]


def all_replaced(expressions: Iterable[Expression], values: Mapping[Any, Expression]) -> list[Expression]:
    """Expressions with some of their nodes replaced; what they share is replaced once."""
    known: dict[Expression, Expression] = dict(values)
    expressions = [*expressions]
    for node in in_order(expressions):
        if node in known:
            continue
        args = [known[each] for each in node.args]
        same = all(new is old for new, old in zip(args, node.args, strict=True))
        known[node] = node if same else node.rebuilt(args)
    return [known[each] for each in expressions]
