"""What to write in place of a branch in Python's own words, which tracing cannot follow."""

from __future__ import annotations

import ast
import linecache
from functools import reduce
from itertools import islice, pairwise
from threading import Lock
from types import FrameType
from typing import Any

# Python 3.11 reports an error if two threads build syntax trees at the same time.
PARSER = Lock()
CANNOT = "a branch cannot be traced"
OTHERWISE = (
    "make its sides modes joined by a guard, or write np.where(condition, a, b) in place of if, "
    "& and | in place of and, or, and np.maximum, np.minimum in place of max, min"
)
# Longer pieces of code are not shown.
LONGEST = 160
EXTREMES = {"max": "np.maximum", "min": "np.minimum", "amax": "np.maximum", "amin": "np.minimum"}


def refused_branch(frame: FrameType | None) -> str:
    """Text of the error for a branch that is taken in a frame, with the code to write instead."""
    while frame is not None and str(frame.f_globals.get("__name__")).startswith("numpy"):
        frame = frame.f_back
    found = None if frame is None else _replacement(frame)
    if found is None:
        return f"{CANNOT}: {OTHERWISE}"
    line, old, new = found
    return f"{CANNOT}: in place of ``{old}`` (line {line}) write ``{new}``, or make its sides modes"


def _replacement(frame: FrameType) -> tuple[int, str, str] | None:
    """Line, code and new code of the branch that a frame is about to take; None if that is not known."""
    code = frame.f_code
    place = next(islice(code.co_positions(), frame.f_lasti // 2, None), None)
    if place is None or None in place:
        return None
    line, _, column, _ = place
    try:
        with PARSER:
            tree = ast.parse("".join(linecache.getlines(code.co_filename, frame.f_globals)))
    except SyntaxError:
        return None
    following: dict[ast.AST, ast.AST] = {}
    # Nodes come from the outside in: an ``if`` before the parts of its condition.
    for node in ast.walk(tree):
        for name in ("body", "orelse"):
            block = getattr(node, name, None)
            if isinstance(block, list):
                following |= dict(pairwise(block))
        if isinstance(node, ast.expr | ast.stmt) and _is_branch(node) and _holds(node, line, column):
            if any(isinstance(each, ast.In | ast.NotIn) for each in ast.walk(node)):
                # NumPy has no operator for a search in a tuple.
                return None
            old, new = _shown(node), _rewritten(node, following.get(node))
            if new is not None and len(old) <= LONGEST and len(new) <= LONGEST:
                return node.lineno, old, new
    return None


def _holds(node: ast.expr | ast.stmt, line: int | None, column: int | None) -> bool:
    """Whether a place lies in the part of a branch that decides."""
    part = getattr(node, "test", node)
    place = (line, column)
    return (part.lineno, part.col_offset) <= place < (part.end_lineno, part.end_col_offset)


def _is_branch(node: ast.AST) -> bool:
    if isinstance(node, ast.Call):
        return _extreme(node) is not None
    if isinstance(node, ast.Compare):
        return len(node.ops) > 1
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not)
    return isinstance(node, ast.If | ast.IfExp | ast.BoolOp)


def _shown(node: ast.AST) -> str:
    return f"if {ast.unparse(node.test)}:" if isinstance(node, ast.If) else ast.unparse(node)


def _rewritten(node: ast.AST, following: ast.AST | None) -> str | None:
    match node:
        case ast.Call():
            return _extreme(node)
        case ast.IfExp():
            return ast.unparse(_chosen(node.test, node.body, node.orelse))
        case ast.If():
            return _statement(node, following)
        case _:
            return _condition(node)


def _extreme(node: ast.Call) -> str | None:
    """The largest or least of several values, two at a time; None for another call."""
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    match node.args:
        case [ast.List(elts=values) | ast.Tuple(elts=values)]:
            pass
        case values:
            pass
    if name not in EXTREMES or len(values) < 2 or node.keywords:
        return None
    written = [ast.unparse(each) for each in values]
    return reduce(lambda a, b: f"{EXTREMES[name]}({a}, {b})", written)


def _condition(node: ast.AST) -> str:
    """A condition with the operators that NumPy has."""
    match node:
        case ast.BoolOp():
            sign = " & " if isinstance(node.op, ast.And) else " | "
            return sign.join(_bracketed(each) for each in node.values)
        case ast.UnaryOp(op=ast.Not()):
            return f"~{_bracketed(node.operand)}"
        case ast.Compare() if len(node.ops) > 1:
            sides = [node.left, *node.comparators]
            pairs = [ast.Compare(a, [op], [b]) for a, op, b in zip(sides, node.ops, sides[1:], strict=False)]
            return " & ".join(f"({ast.unparse(each)})" for each in pairs)
        case _:
            return ast.unparse(node)


def _bracketed(node: ast.AST) -> str:
    return f"({_condition(node)})"


def _chosen(test: ast.expr, a: ast.expr, b: ast.expr) -> ast.expr:
    """The choice between two values, entry by entry if both are tuples."""
    if isinstance(a, ast.Tuple) and isinstance(b, ast.Tuple) and len(a.elts) == len(b.elts):
        pairs = zip(a.elts, b.elts, strict=True)
        entries = [c if ast.dump(c) == ast.dump(d) else _chosen(test, c, d) for c, d in pairs]
        return ast.Tuple(entries, ast.Load())
    if _is_literal_dict(a) and _is_literal_dict(b):
        return _chosen_changes(test, a, b)
    with PARSER:
        condition = ast.parse(_condition(test), mode="eval").body
    where = ast.Attribute(ast.Name("np", ast.Load()), "where", ast.Load())
    return ast.Call(where, [condition, a, b], [])


def _is_literal_dict(node: ast.expr) -> bool:
    return isinstance(node, ast.Dict) and all(isinstance(key, ast.Constant) for key in node.keys)


def _chosen_changes(test: ast.expr, a: Any, b: Any) -> ast.expr:
    """The choice between two dicts of components that a reset changes; what one lacks stays as it is."""
    sides = [{key.value: value for key, value in zip(d.keys, d.values, strict=True)} for d in (a, b)]
    entries = {
        name: [side.get(name, ast.Attribute(ast.Name("x"), str(name))) for side in sides]
        for name in {**sides[0], **sides[1]}
    }
    chosen = [c if ast.dump(c) == ast.dump(d) else _chosen(test, c, d) for c, d in entries.values()]
    return ast.Dict([ast.Constant(name) for name in entries], chosen)


def _statement(node: ast.If, following: ast.AST | None) -> str | None:
    """An ``if`` statement with one assignment, or one ``return``, on each side, written as one statement."""
    result = _joined(node, following)
    return None if result is None else ast.unparse(ast.fix_missing_locations(result))


def _joined(node: ast.If, following: ast.AST | None) -> ast.stmt | None:
    other: ast.AST | None = node.orelse[0] if len(node.orelse) == 1 else None
    if isinstance(other, ast.If):
        other = _joined(other, following)
    elif not node.orelse:
        other = following
    match node.body, other:
        case [ast.Return(value=a)], ast.Return(value=b) if a is not None and b is not None:
            return ast.Return(_chosen(node.test, a, b))
        case [ast.Assign(targets=[x], value=a)], ast.Assign(targets=[y], value=b) if node.orelse and ast.dump(
            x
        ) == ast.dump(y):
            return ast.Assign([x], _chosen(node.test, a, b))
        case [ast.Assign(targets=[x], value=a)], _ if not node.orelse and isinstance(x, ast.Name):
            return ast.Assign([x], _chosen(node.test, a, ast.Name(x.id)))
        case [ast.AugAssign(target=x, op=ast.Add() | ast.Sub() as sign, value=a)], _ if not node.orelse:
            return ast.AugAssign(x, sign, _chosen(node.test, a, ast.Constant(0.0)))
        case _:
            return None
