"""Model functions as SymPy expressions, found by calling them once on symbols.

A symbol stands in for every number, wrapped so that Python's operators and NumPy's functions build an
expression where they would compute (NEP 13 and NEP 18). What they cannot follow is a decision taken in
Python, which depends on a value that is not there yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import attrs
import numpy as np
import sympy
from numpy.lib.mixins import NDArrayOperatorsMixin
from sympy.core.parameters import distribute

from hybrid.errors import ModelError
from hybrid.names import PARAMETERS, STATE, named_values
from hybrid.symbolic import Select, number
from hybrid.ufuncs import CONTRACTIONS, RULES


class TraceError(ModelError):
    """Tracing cannot follow a model function; the text says what stopped it and what to write instead."""


NEEDS_NUMBER = (
    "a number is needed where tracing has a symbol: use np.sin in place of math.sin (and so on), and "
    "np.zeros_like(x) in place of np.zeros to fill an array"
)
NEEDS_DECISION = (
    "a branch cannot be traced: use np.where or np.maximum (in place of if, and, max), or make it a mode "
    "with a guard"
)


class Traced(NDArrayOperatorsMixin):
    """A number that is not known yet: a SymPy expression that behaves as a NumPy scalar."""

    __slots__ = ("expression",)

    def __init__(self, expression: sympy.Expr) -> None:
        self.expression = expression

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "__call__" and not options and not any(isinstance(i, np.ndarray) for i in inputs):
            return _lifted(_rule(ufunc))(*inputs)
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _apply_function(function, args, kwargs)

    def __getattr__(self, name: str) -> Any:
        # np.cos of an object array, np.array([x.q, x.v]) say, calls the method cos of each element.
        if name in RULES:
            return lambda *others: _lifted(RULES[name])(self, *others)
        raise AttributeError(f"a traced number has no attribute {name!r}")

    def __bool__(self) -> bool:
        raise TraceError(NEEDS_DECISION)

    def __float__(self) -> float:
        raise TraceError(NEEDS_NUMBER)

    def __int__(self) -> int:
        raise TraceError(NEEDS_NUMBER)

    def __complex__(self) -> complex:
        raise TraceError(NEEDS_NUMBER)

    def __index__(self) -> int:
        raise TraceError(NEEDS_NUMBER)

    def __repr__(self) -> str:
        return f"Traced({self.expression})"


class TracedArray(np.ndarray):
    """An object array of traced numbers, on which NumPy's functions act element by element."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if function in FUNCTIONS:
            return _apply_function(function, args, kwargs)
        # NumPy does the rest on object arrays, and mixes in single numbers if told they belong there
        return _wrapped(super().__array_function__(function, (TracedArray,), args, kwargs))


def _rule(ufunc: np.ufunc) -> Callable[..., sympy.Expr]:
    try:
        return RULES[ufunc.__name__]
    except KeyError:
        raise TraceError(f"np.{ufunc.__name__} cannot be traced") from None


def _lifted(rule: Callable[..., sympy.Expr]) -> Callable[..., Traced]:
    return lambda *arguments: Traced(rule(*map(_expression, arguments)))


def _expression(value: Any) -> sympy.Expr:
    if isinstance(value, Traced):
        return value.expression
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return _expression(value[()])
    try:
        return number(value)
    except (TypeError, ValueError):
        raise TraceError(f"{value!r} is not a number") from None


def _plain(value: Any) -> np.ndarray:
    """``value`` as an object array that NumPy handles by itself, without asking us again."""
    if isinstance(value, Traced):
        array = np.empty((), dtype=object)
        array[()] = value
        return array
    return np.asarray(value, dtype=object).view(np.ndarray)


def _wrapped(value: Any) -> Any:
    return value.view(TracedArray) if isinstance(value, np.ndarray) else value


def _apply(ufunc: np.ufunc, method: str, inputs: tuple[Any, ...], options: dict[str, Any]) -> Any:
    if ufunc.__name__ in CONTRACTIONS:
        elementwise = ufunc
    else:
        elementwise = np.frompyfunc(_lifted(_rule(ufunc)), ufunc.nin, 1, identity=ufunc.identity)
    out = options.pop("out", None)
    if out is not None:  # x += 1 on an array
        options["out"] = tuple(array.view(np.ndarray) for array in out)
    options.pop("dtype", None)
    result = getattr(elementwise, method)(*map(_plain, inputs), **options)
    return _wrapped(result) if out is None else out[0]


def _where(condition: Any, *choices: Any) -> Any:
    if len(choices) != 2:
        raise TraceError("np.where needs both values to be traced: np.where(condition, a, b)")
    return _wrapped(np.frompyfunc(_lifted(Select), 3, 1)(*map(_plain, (condition, *choices))))


def _clipped(a: Any, a_min: Any = None, a_max: Any = None, **bounds: Any) -> Any:
    low, high = bounds.get("min", a_min), bounds.get("max", a_max)
    if low is not None:
        a = np.maximum(a, low)
    return a if high is None else np.minimum(a, high)


FUNCTIONS: dict[Any, Callable[..., Any]] = {np.where: _where, np.clip: _clipped}


def _apply_function(function: Any, args: Any, kwargs: Any) -> Any:
    if function in FUNCTIONS:
        return FUNCTIONS[function](*args, **kwargs)
    # Anything else, np.sum((a, b)) say, NumPy can do on object arrays, if it can do it at all.
    plain = (_plain(argument) if _holds_traced(argument) else argument for argument in args)
    return _wrapped(function(*plain, **kwargs))


def _holds_traced(argument: Any) -> bool:
    if isinstance(argument, list | tuple):
        return any(_holds_traced(item) for item in argument)
    return isinstance(argument, Traced | TracedArray)


@attrs.frozen
class Symbols:
    """The symbols of a traced function, named as generated code reads them."""

    t: sympy.Symbol
    x: tuple[sympy.Symbol, ...]
    p: tuple[sympy.Symbol, ...]

    @property
    def variables(self) -> tuple[sympy.Symbol, ...]:
        """The columns of a derivative: the states, then time."""
        return (*self.x, self.t)


def model_symbols(n: int, m: int) -> Symbols:
    """Real symbols ``t``, ``x[0] ... x[n-1]`` and ``p[0] ... p[m-1]``."""
    x = tuple(sympy.Symbol(f"x[{i}]", real=True) for i in range(n))
    p = tuple(sympy.Symbol(f"p[{i}]", real=True) for i in range(m))
    return Symbols(sympy.Symbol("t", real=True), x, p)


def trace(
    function: Callable[..., Any], state: tuple[str, ...] | int, parameters: Iterable[str]
) -> list[sympy.Expr]:
    """Values of a model function as SymPy expressions in the symbols of `model_symbols`.

    Parameters
    ----------
    function
        ``(t, x, p)`` function of a model: plain Python.
    state
        Names of the state components, or their number.
    parameters
        Names of the parameters.

    Returns
    -------
    list of sympy.Expr
        The values, in one row: one for a scalar, row by row for a matrix.

    Raises
    ------
    TraceError
        If the function decides, indexes or computes by the value of an argument outside of NumPy.
    """
    names = tuple(parameters)
    symbols = model_symbols(state if isinstance(state, int) else len(state), len(names))
    x: Any = np.array([Traced(symbol) for symbol in symbols.x], dtype=object).view(TracedArray)
    x.flags.writeable = False
    if not isinstance(state, int):
        x = named_values(STATE, state, x)
    p = named_values(PARAMETERS, names, map(Traced, symbols.p))
    try:
        with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
            values = function(Traced(symbols.t), x, p)
            expressions = [_expression(value) for value in _plain(values).ravel()]
    except ModelError:
        raise
    except Exception as error:
        raise TraceError(f"{type(error).__name__}: {error}") from error
    for expression in expressions:
        if expression.has(sympy.I, sympy.zoo, sympy.nan):
            raise TraceError(f"it is not a real number everywhere: {expression}")
    return expressions
