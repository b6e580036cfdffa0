"""Runs the code of compiled functions twice: by a plain interpreter and as machine code."""

import ctypes
import json
import operator
from collections import defaultdict

import numpy as np

from hybrid.compiler.cases import cases_in
from hybrid.compiler.llvm.engine import load
from hybrid.compiler.llvm.functions import SIGNATURES
from hybrid.compiler.llvm.machine import machine_code
from hybrid.compiler.llvm.wanted import SERIES_SIGNATURE, VECTOR_SIGNATURE, Function
from hybrid.compiler.statements.code import at
from hybrid.compiler.statements.values import assignments
from hybrid.expression.vocabulary import named
from tests.hybrid import in_python

OF_MATH = (
    *("acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "copysign", "cos", "cosh", "exp", "expm1"),
    *("hypot", "log", "log10", "log1p", "log2", "sin", "sinh", "sqrt", "tan", "tanh"),
)
# Of numbers and, where that has a meaning, of lanes: arrays of four.
OPERATIONS = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": lambda a, b: np.divide(a, b),
    "//": operator.floordiv,
    "**": lambda a, b: np.float64(a) ** b,
    "%": lambda a, b: np.float64(a) % b,
    "neg": operator.neg,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "and": lambda a, b: a and b,
    "or": lambda a, b: a or b,
    "not": operator.not_,
    "abs": abs,
    "max": max,
    "several": lambda *numbers: numbers,
    "item": lambda numbers, place: numbers[place],
    "table": in_python.table,
    **{name: getattr(np, name) for name in OF_MATH},
    **{f"np.{name}": getattr(np, name) for name in ("floor", "ceil", "trunc", "rint", "fmod")},
    **{name: named(name) for name in ("erf", "erfc")},
    **{
        name: getattr(in_python, name)
        for name in (
            *("load", "store", "store_down", "store_row", "four", "four_times", "divided_dot_product"),
            *("convolve", "convolve_pairs", "convolved", "convolved_pairs", "add_ends", "add_ends_of_pairs"),
            *("combine", "combine_tangents", "spread_tangents"),
        )
    },
}


class Interpreter:
    """Runs statements; ``names`` are the arguments and all variables, ``calls`` are a user's functions."""

    def __init__(self, names, calls):
        self.names, self.operations = names, OPERATIONS | calls

    def run(self, statements):
        for statement in statements:
            match statement:
                case "set", place, term:
                    self.put(place, self.value(term))
                case "do", term:
                    self.value(term)
                case "for", name, start, stop, step, body:
                    self.repeat(name, range(*map(self.value, (start, stop, step))), body)
                case "repeat", name, count, body:
                    # Its turns do not wait for one another, so the last one may come first.
                    self.repeat(name, reversed(range(count)), body)
                case "when", condition, body, other:
                    self.run(body if self.value(condition) else other)
                case "whole", name, number:
                    self.names[name] = number
                case "array", name, _:
                    self.names[name] = {}
                case _:
                    raise ValueError(f"{statement} is no statement")

    def repeat(self, name, turns, body):
        for turn in turns:
            self.names[name] = turn
            self.run(body)

    def put(self, place, value):
        match place:
            case "get", name:
                self.names[name] = value
            case "at", array, *indices:
                self.names[array][tuple(map(self.value, indices))] = value
            case "several", *places:
                for each, part in zip(places, value, strict=True):
                    self.put(each, part)

    def value(self, term):
        match term:
            case int():
                return term
            case float():
                return np.float64(term)
            case "get", name:
                return self.names[name]
            case "at", array, *indices:
                return self.names[array][tuple(map(self.value, indices))]
            case "listed", numbers, index:
                return self.value(numbers[self.value(index)])
            case "length", array:
                return len(self.names[array])
            case "if", condition, one, other:
                return self.value(one if self.value(condition) else other)
            case operation, *terms:
                return self.operations[operation](*map(self.value, terms))


def interpreted(cases, kind, calls=None):
    """A function that runs the statements of the case that holds its index."""

    def call(*arguments):
        names = dict(zip(kind.names, arguments, strict=True))
        for indices, statements in cases:
            if not indices or arguments[0] in indices:
                with np.errstate(all="ignore"):
                    Interpreter(names, calls or {}).run(statements)

    return call


def both(*bodies, kind=SERIES_SIGNATURE, fused=False):
    """Two functions that run the body with their index, by the interpreter and as machine code."""
    cases = [((index,), body) for index, body in enumerate(bodies)]
    code = machine_code([Function("function", kind, cases, fused, "'repeat'" in repr(bodies))])
    return interpreted(cases, kind), called(load(code, ["function"])["function"])


def functions_in(text, calls=None):
    """The functions in a text of a model, by name, run by the interpreter."""
    cases = defaultdict(list)
    for name, (indices, body) in cases_in(text):
        cases[name].append((indices, json.loads(body)))
    kinds = {name: SIGNATURES.get(name, VECTOR_SIGNATURE) for name in cases}
    return {name: interpreted(cases[name], kinds[name], calls) for name in cases}


def values_of(expressions, x=(), p=(), t=0.0):
    """Values of expressions, from the code that would be compiled."""
    out = np.zeros(len(expressions))
    statements = assignments([at("out", i) for i in range(len(out))], expressions)
    numbers = [np.array(each, dtype=float) for each in (x, p)]
    interpreted([((), statements)], VECTOR_SIGNATURE)(0, np.float64(t), *numbers, out)
    return out


def called(compiled):
    """A compiled function that can be called with numbers and arrays."""

    def call(*arguments):
        words = [word for argument in arguments for word in _words(argument)]
        kinds = [ctypes.c_double if isinstance(word, float) else ctypes.c_int64 for word in words]
        ctypes.CFUNCTYPE(None, *kinds)(compiled.address)(*words)

    return call


def _words(argument):
    """The words of an argument: a number, or an array's address and lengths."""
    if not isinstance(argument, np.ndarray):
        return [argument]
    return [argument.ctypes.data, *argument.shape]
