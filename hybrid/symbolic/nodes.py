"""Queries on expressions that visit each node once, however often the node is used.

An expression is a graph: a value that a function uses twice is one node with two uses. SymPy's own ``has``,
``atoms``, ``xreplace`` and traversals walk the graph as a tree. A value used twice in each of forty rounds of
a loop gives 2^40 branches there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeVar

import sympy
from sympy.core.parameters import distribute

Function = TypeVar("Function", bound=Callable[..., Any])
# A tree with more operations than this is not expanded: the time may grow with the square of its size.
MOST_EXPANDED = 2000

# Facts that SymPy looks for in the tree below an expression.
SIGNS = ("zero", "nonzero", "positive", "negative", "nonnegative", "nonpositive")
KINDS = ("finite", "infinite", "integer", "noninteger", "even", "odd", "rational", "irrational", "algebraic")
REALS = ("real", "extended_real", "complex", "hermitian")
FACTS = (*SIGNS, *(f"extended_{sign}" for sign in SIGNS if sign != "zero"), *KINDS, "transcendental")

ARCS = (sympy.asin, sympy.acos, sympy.atanh, sympy.acosh)

_remembered: list[Any] = []
# _seen, by identity: expressions seen so far, each with the one object that represents all equal ones.
_seen: dict[int, tuple[sympy.Basic, sympy.Basic]] = {}
_standing: dict[Any, sympy.Basic] = {}


def once(function: Function) -> Function:
    """Cache the results of a function of nodes, until `forget`."""
    remembering: Any = lru_cache(maxsize=None)(function)
    _remembered.append(remembering)
    return remembering


def forget() -> None:
    """Clear the caches, after a model has been traced."""
    for function in _remembered:
        function.cache_clear()
    _seen.clear()
    _standing.clear()


def interned(expression: Any) -> Any:
    """The expression with equal nodes merged into one object, shared with earlier calls.

    SymPy compares equal expressions that are different objects branch by branch, as trees.
    """
    found = _seen.get(id(expression))
    if found is not None:
        return found[1]
    args = expression.args
    if args:
        own = [interned(each) for each in args]
        same = all(new is old for new, old in zip(own, args, strict=True))
        key = (expression.func, *map(id, own))
        standing = _standing.get(key)
        if standing is None:
            standing = expression if same else expression.func(*own, evaluate=False)
            if isinstance(standing, ARCS):
                # SymPy asks for the modulus of their arguments, from which it takes the sign without end
                # where it keeps a factor -1 outside of sums.
                ask_no_more(standing)
            _standing[key] = standing
    else:
        standing = _standing.setdefault(expression, expression)
    _seen[id(expression)] = expression, standing
    return standing


def ask_no_more(expression: sympy.Basic) -> None:
    """Let SymPy take signs and kinds of a large expression that it does not know yet as unknown.

    SymPy looks for them when the expression becomes a factor or a base, branch by branch in the tree below.
    """
    if expression._assumptions is expression.default_assumptions:
        expression._assumptions = expression.default_assumptions.copy()
    for fact in FACTS:
        expression._assumptions.setdefault(fact, None)
    for fact in REALS:
        expression._assumptions.setdefault(fact, True)


def nodes(*expressions: sympy.Basic) -> Iterator[sympy.Basic]:
    """Every node of the expressions, each once."""
    seen: set[sympy.Basic] = set()
    waiting = [*expressions]
    while waiting:
        node = waiting.pop()
        if node not in seen:
            seen.add(node)
            yield node
            waiting.extend(node.args)


def nodes_of(kinds: Any, *expressions: sympy.Basic) -> set[Any]:
    """The nodes of a class, or of any of several classes."""
    return {node for node in nodes(*expressions) if isinstance(node, kinds)}


@once
def symbols_of(expression: sympy.Basic) -> frozenset[sympy.Symbol]:
    """The symbols of an expression."""
    if isinstance(expression, sympy.Symbol):
        return frozenset((expression,))
    return frozenset().union(*map(symbols_of, expression.args))


def mentions(expression: sympy.Basic, symbols: Iterable[sympy.Symbol]) -> bool:
    """Whether an expression contains any of the symbols."""
    return not symbols_of(expression).isdisjoint(symbols)


@once
def contains(expression: sympy.Basic, kinds: Any) -> bool:
    """Whether an expression contains a node of these classes."""
    return isinstance(expression, kinds) or any(contains(each, kinds) for each in expression.args)


@once
def degree_of(expression: sympy.Basic, variables: frozenset[sympy.Symbol]) -> int | None:
    """Degree as a polynomial in the variables, without cancellation; None if it is not a polynomial."""
    if not mentions(expression, variables):
        return 0
    if isinstance(expression, sympy.Symbol):
        return 1
    degrees = [degree_of(each, variables) for each in expression.args]
    known = [each for each in degrees if each is not None]
    if isinstance(expression, sympy.Pow) and expression.exp.is_Integer and expression.exp.is_positive:
        return None if degrees[0] is None else degrees[0] * int(expression.exp)
    if len(known) == len(degrees) and (expression.is_Mul or getattr(expression, "keeps_degree", False)):
        return sum(known)
    return max(known) if len(known) == len(degrees) and expression.is_Add else None


@once
def operations_of(expression: sympy.Basic) -> int:
    """Number of operations of an expression written out as a tree."""
    args = expression.args
    return max(1, len(args) - 1) + sum(map(operations_of, args)) if args else 0


def is_larger_than(most: int, expression: sympy.Basic) -> bool:
    """Whether an expression, written out as a tree, has more than ``most`` operations."""
    return operations_of(expression) > most


def replaced(expression: sympy.Expr, values: Mapping[sympy.Expr, sympy.Expr]) -> sympy.Expr:
    """An expression with some of its nodes replaced."""
    return interned(_replaced(interned(expression), values, {}))


def _replaced(
    node: sympy.Expr, values: Mapping[sympy.Expr, sympy.Expr], known: dict[sympy.Expr, sympy.Expr]
) -> sympy.Expr:
    if node in values:
        return values[node]
    if not node.args:
        return node
    made = known.get(node)
    if made is None:
        args = [_replaced(each, values, known) for each in node.args]
        changed = any(new is not old for new, old in zip(args, node.args, strict=True))
        made = known[node] = rebuilt(node, args) if changed else node
    return made


def expanded(expression: sympy.Expr) -> sympy.Expr:
    """The expression with its products written out."""
    with distribute(True):
        return expression.expand()


def rebuilt(node: sympy.Expr, args: Sequence[sympy.Expr]) -> sympy.Expr:
    """A node with other arguments.

    A function and a power take a factor -1 out of what they apply to, or ask for its sign. They do so again
    and again where SymPy keeps such a factor outside of sums. Large trees are left as they are.
    """
    plain = not isinstance(node, sympy.Function | sympy.Pow)
    if plain or is_larger_than(MOST_EXPANDED, node):
        return node.func(*args)
    with distribute(True):
        return node.func(*args)
