"""Queries on expressions that visit each node once, however often the node is used."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache, reduce
from operator import attrgetter
from typing import Any, TypeVar

from hybrid.expression.nodes import COUNTLESS, ONE, Expression, Function, Number, Symbol

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


def terms_of(expression: Expression) -> tuple[Expression, ...]:
    """The terms of a sum; an expression that is none is one term."""
    return expression.args if expression.is_sum else (expression,)


def factors_of(expression: Expression) -> tuple[Expression, ...]:
    """The factors of a product; an expression that is none is one factor."""
    return expression.args if expression.is_product else (expression,)


def base_and_exponent(factor: Expression) -> tuple[Expression, Expression]:
    """What a factor is a power of, and which."""
    return factor.args if factor.is_power else (factor, ONE)  # type: ignore[return-value]


def is_whole(expression: Expression) -> bool:
    """Whether an expression is a whole number."""
    return isinstance(expression, Number) and expression.is_whole


def is_positive(expression: Expression) -> bool:
    """Whether an expression is a number above zero."""
    return isinstance(expression, Number) and expression.value > 0


def is_negative(expression: Expression) -> bool:
    """Whether an expression is a number below zero."""
    return isinstance(expression, Number) and expression.value < 0


def in_order(
    expressions: Iterable[Expression],
    parts: Callable[[Expression], Iterable[Expression]] = attrgetter("args"),
) -> list[Expression]:
    """Every node of the expressions once, each behind the nodes that it is computed from: its ``parts``."""
    found: dict[Expression, None] = {}
    waiting: list[Any] = [*reversed([*expressions])]
    while waiting:
        each = waiting.pop()
        if type(each) is tuple:
            found[each[0]] = None
        elif each not in found:
            if each.args:
                waiting.append((each,))
                waiting += [part for part in reversed([*parts(each)]) if part not in found]
            else:
                found[each] = None
    return [*found]


def listing(expressions: Sequence[Expression]) -> tuple[list[Any], list[int]]:
    """Expressions as a list of operations, each on the results of others before it, and their places."""
    places: dict[Expression, int] = {}
    rows: list[Any] = []
    for each in in_order(expressions):
        places[each] = len(rows)
        row = type(each), [places[part] for part in each.args], each.attached
        rows.append(row if each.args else each)
    return rows, [places[each] for each in expressions]


def listed(rows: Sequence[Any], places: Sequence[int]) -> tuple[Expression, ...]:
    """The expressions of a ``listing``."""
    found: list[Expression] = []
    for row in rows:
        if isinstance(row, Expression):
            found.append(row)
            continue
        kind, parts, attached = row
        found.append(kind(*(found[place] for place in parts), *attached))
    return tuple(found[place] for place in places)


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


class Group(tuple[Symbol, ...]):
    """Symbols that are asked for together, again and again."""

    @cached_property
    def mask(self) -> int:
        """The bits of all of them."""
        return reduce(lambda mask, symbol: mask | symbol.mask, self, 0)


def mentions(expression: Expression, symbols: Iterable[Symbol]) -> bool:
    """Whether an expression contains any of the symbols; of a `Group` in no time."""
    group = symbols if isinstance(symbols, Group) else Group(symbols)
    return expression.mask & group.mask != 0


def contains(expression: Expression, kinds: type[Function] | tuple[type[Function], ...]) -> bool:
    """Whether an expression contains a function of these classes."""
    if not isinstance(kinds, tuple):
        return expression.traits & kinds.own_trait != 0
    return any(expression.traits & kind.own_trait for kind in kinds)


@once
def degree_of(expression: Expression, variables: frozenset[Symbol]) -> int | None:
    """Degree as a polynomial in the variables, without cancellation; None if it is not a polynomial."""
    found: dict[Expression, int | None] = {}
    group = Group(variables)
    for each in in_order([expression]):
        found[each] = _degree(each, found, group)
    return found[expression]


def _degree(node: Expression, found: Mapping[Expression, int | None], variables: Group) -> int | None:
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


def with_arguments(node: Expression, args: Sequence[Expression]) -> Expression:
    """The node computed from other nodes; itself if they are the same."""
    same = all(new is old for new, old in zip(args, node.args, strict=True))
    return node if same else node.rebuilt(args)


def rewritten(
    expression: Expression,
    rule: Callable[[Expression, list[Expression]], Expression],
    values: Mapping[Any, Expression] | None = None,
) -> Expression:
    """The expression with each node as ``rule`` makes it of the node and of its rewritten arguments.

    ``values`` are known before.
    """
    found: dict[Expression, Expression] = dict(values or {})
    for node in in_order([expression]):
        if node not in found:
            found[node] = rule(node, [found[each] for each in node.args])
    return found[expression]


def replaced(expression: Expression, values: Mapping[Any, Expression]) -> Expression:
    """An expression with some of its nodes replaced."""
    return all_replaced([expression], values)[0]


def all_replaced(expressions: Iterable[Expression], values: Mapping[Any, Expression]) -> list[Expression]:
    """Expressions with some of their nodes replaced; what they share is replaced once."""
    known: dict[Expression, Expression] = dict(values)
    # A node that holds another has all of its symbols, and all of its functions.
    masks, traits = {key.mask for key in known}, {key.traits for key in known}
    mask, trait = (each.pop() if len(each) == 1 else 0 for each in (masks, traits))
    expressions = [*expressions]
    waiting = expressions[::-1]
    while waiting:
        node = waiting[-1]
        if node in known:
            waiting.pop()
        elif not node.args or mask & ~node.mask or trait & ~node.traits:
            known[node] = waiting.pop()
        else:
            missing = [each for each in node.args if each not in known]
            if missing:
                waiting += missing
            else:
                known[waiting.pop()] = with_arguments(node, [known[each] for each in node.args])
    return [known[each] for each in expressions]
