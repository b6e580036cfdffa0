"""Placeholders for numbers, which record the Python operators and NumPy functions applied to them.

Operators and functions on a traced number build a record instead of computing (NEP 13 and NEP 18). An algebra
determines the record: SymPy expressions in ``hybrid.symbolic.tracing``, or a plain list of operations in
``hybrid.compiler.operations``, which does not need SymPy. Model functions behave the same with both. Neither
algebra can follow a branch taken in Python, because the value it depends on is unknown.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Protocol

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from hybrid.errors import ModelError
from hybrid.symbolic.branches import refused_branch
from hybrid.system.variables import PARAMETERS, STATE, named_values

# NumPy's universal functions that can be traced; ``hybrid.symbolic.ufuncs`` has a rule for each.
UFUNCS = frozenset(
    {
        "add", "subtract", "multiply", "divide", "floor_divide", "remainder", "fmod", "power", "float_power",
        "negative", "positive", "absolute", "fabs", "sign", "square", "reciprocal", "sqrt", "cbrt", "exp",
        "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
        "arctan2", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh", "hypot", "deg2rad", "radians",
        "rad2deg", "degrees", "floor", "ceil", "trunc", "maximum", "minimum", "fmax", "fmin", "clip",
        "heaviside", "less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "logical_and",
        "logical_or", "logical_not", "bitwise_and", "bitwise_or", "invert",
    }
)  # fmt: skip
# Name of np.where in an algebra.
WHERE = "where"
# These form sums of products, which NumPy does on object arrays with the operators of the scalars.
CONTRACTIONS = ("matmul", "vecdot", "matvec", "vecmat")


class Algebra(Protocol):
    """The results of operations on traced numbers."""

    def number(self, value: Any) -> Any:
        """Content of a traced number with a known value; TypeError or ValueError if it is not a number."""
        ...

    def combined(self, name: str, contents: tuple[Any, ...]) -> Any:
        """Content of the result of a function in ``UFUNCS``, or of ``WHERE``."""
        ...

    def expression(self, content: Any) -> Any:
        """The expression of a content, for callers that ask for it."""
        ...


_ALGEBRA: ContextVar[Algebra] = ContextVar("_ALGEBRA")
# Operations that could not be followed since the function was called, in order.
_REFUSALS: ContextVar[list[TraceError]] = ContextVar("_REFUSALS")


@contextmanager
def in_terms_of(algebra: Algebra) -> Iterator[None]:
    """Make traced numbers use an algebra within this block."""
    token = _ALGEBRA.set(algebra)
    try:
        yield
    finally:
        _ALGEBRA.reset(token)


class TraceError(ModelError):
    """Tracing cannot follow a model function; the text names the cause and what to write instead."""


def refusal(text: str) -> TraceError:
    """A TraceError that is also recorded, since the model function may catch it and continue."""
    error = TraceError(text)
    _REFUSALS.get([]).append(error)
    return error


NEEDS_NUMBER = (
    "a number is needed where tracing has a symbol: use np.sin in place of math.sin (and so on), and "
    "np.zeros_like(x) in place of np.zeros to fill an array"
)
NEEDS_COPY = "it writes into its argument: take a copy first, x = x.copy()"


class Traced(NDArrayOperatorsMixin):
    """A placeholder for a number, which behaves like a NumPy scalar."""

    __slots__ = ("content",)

    def __init__(self, content: Any) -> None:
        self.content = content

    # Untraced calls get np.float64, so isinstance must give the same answer here.
    __class__ = property(lambda self: np.float64)

    @property
    def expression(self) -> Any:
        """The expression of this number."""
        return _ALGEBRA.get().expression(self.content)

    @property
    def real(self) -> Traced:
        """The number itself, which is real."""
        return self

    @property
    def imag(self) -> float:
        """Zero."""
        return 0.0

    def conjugate(self) -> Traced:
        """The number itself, which is real."""
        return self

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if method == "__call__" and not options and not any(isinstance(i, np.ndarray) for i in inputs):
            return _lifted(_known(ufunc))(*inputs)
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _apply_function(function, args, kwargs)

    def __getattr__(self, name: str) -> Any:
        # np.cos of an object array, such as np.array([x.q, x.v]), calls the method cos of each element.
        if name in UFUNCS:
            return lambda *others: _lifted(name)(self, *others)
        text = f"a traced number has no attribute {name!r}"
        if not name.startswith("__") and hasattr(np.float64, name):
            refusal(text)
        raise AttributeError(text)

    def __bool__(self) -> bool:
        raise refusal(refused_branch(sys._getframe(1)))

    def __float__(self) -> float:
        raise refusal(NEEDS_NUMBER)

    def __int__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __complex__(self) -> complex:
        raise refusal(NEEDS_NUMBER)

    def __index__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __trunc__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __floor__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __ceil__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __round__(self, digits: int | None = None) -> int:
        raise refusal(NEEDS_NUMBER)

    def __hash__(self) -> int:
        raise refusal("a number is needed as a key: a lookup in a table by the state cannot be traced")

    def __format__(self, specification: str) -> str:
        if specification:
            raise refusal(NEEDS_NUMBER)
        return repr(self)

    def __repr__(self) -> str:
        return f"Traced({self.expression})"


class TracedArray(np.ndarray):
    """An object array of traced numbers, on which NumPy's functions act element by element."""

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise refusal(NEEDS_COPY)
        super().__setitem__(key, value)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if function in FUNCTIONS:
            return _apply_function(function, args, kwargs)
        # NumPy does the other functions on object arrays; single traced numbers count as such arrays.
        try:
            return _wrapped(super().__array_function__(function, (TracedArray,), args, kwargs))
        except TraceError:
            raise
        except Exception as error:
            raise refusal(
                f"np.{function.__name__} cannot be traced: {type(error).__name__}: {error}"
            ) from error


def _known(ufunc: np.ufunc) -> str:
    if ufunc.__name__ not in UFUNCS:
        raise refusal(f"np.{ufunc.__name__} cannot be traced")
    return str(ufunc.__name__)


def _lifted(name: str) -> Callable[..., Traced]:
    def combine(*arguments: Any) -> Traced:
        contents = tuple(map(_content, arguments))
        try:
            return Traced(_ALGEBRA.get().combined(name, contents))
        except Exception as error:
            raise refusal(f"np.{name}: {type(error).__name__}: {error}") from error

    return combine


def _content(value: Any) -> Any:
    if isinstance(value, Traced):
        return value.content
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return _content(value[()])
    try:
        return _ALGEBRA.get().number(value)
    except (TypeError, ValueError, OverflowError):
        raise refusal(f"{value!r} is not a number") from None


def _plain(value: Any) -> np.ndarray:
    """``value`` as an object array of the base class, so that NumPy does not call back here."""
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
        elementwise = np.frompyfunc(_lifted(_known(ufunc)), ufunc.nin, 1, identity=ufunc.identity)
    out = options.pop("out", None)
    if out is not None:  # x += 1 on an array
        options["out"] = tuple(array.view(np.ndarray) for array in out)
    options.pop("dtype", None)
    result = getattr(elementwise, method)(*map(_plain, inputs), **options)
    return _wrapped(result) if out is None else out[0]


def _where(condition: Any, *choices: Any) -> Any:
    if len(choices) != 2:
        raise refusal("np.where needs both values to be traced: np.where(condition, a, b)")
    return _wrapped(np.frompyfunc(_lifted(WHERE), 3, 1)(*map(_plain, (condition, *choices))))


def _clipped(a: Any, a_min: Any = None, a_max: Any = None, **bounds: Any) -> Any:
    low, high = bounds.get("min", a_min), bounds.get("max", a_max)
    if low is not None:
        a = np.maximum(a, low)
    return a if high is None else np.minimum(a, high)


def _select(conditions: Any, choices: Any, default: Any = 0) -> Any:
    if len(conditions) != len(choices):
        raise refusal("np.select needs one choice per condition")
    value = default
    for condition, choice in reversed([*zip(conditions, choices, strict=True)]):
        value = _where(condition, choice, value)
    return value


def _piecewise(x: Any, conditions: Any, functions: Any, *args: Any, **kwargs: Any) -> Any:
    if isinstance(conditions, Traced):
        conditions = [conditions]
    extra = len(functions) - len(conditions)
    if extra not in (0, 1):
        raise refusal("np.piecewise needs one function per condition, and at most one more")
    values = [each(x, *args, **kwargs) if callable(each) else each for each in functions]
    # The last condition that holds decides, as in NumPy.
    value = values[-1] if extra else 0
    for condition, other in zip(conditions, values, strict=False):
        value = _where(condition, other, value)
    return value


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    np.where: _where,
    np.clip: _clipped,
    np.select: _select,
    np.piecewise: _piecewise,
}


def _apply_function(function: Any, args: Any, kwargs: Any) -> Any:
    if function in FUNCTIONS:
        return FUNCTIONS[function](*args, **kwargs)
    # NumPy can do other functions, such as np.sum((a, b)), only on object arrays.
    plain = (_plain(argument) if _holds_traced(argument) else argument for argument in args)
    try:
        return _wrapped(function(*plain, **kwargs))
    except TraceError:
        raise
    except Exception as error:
        raise refusal(f"np.{function.__name__} cannot be traced: {type(error).__name__}: {error}") from error


def _holds_traced(argument: Any) -> bool:
    if isinstance(argument, list | tuple):
        return any(_holds_traced(item) for item in argument)
    return isinstance(argument, Traced | TracedArray)


def values_of(
    function: Callable[..., Any],
    state: tuple[str, ...] | int,
    parameters: tuple[str, ...],
    algebra: Algebra,
    symbols: tuple[Any, Iterable[Any], Iterable[Any]],
) -> list[Any]:
    """Contents of a model function's values, as a flat list, for given contents of ``t``, ``x`` and ``p``.

    Raises
    ------
    TraceError
        If the function cannot be followed. The error is raised even if the function caught it and continued,
        because the values it returns are then not those it returns for numbers.
    """
    t, states, values = symbols
    x: Any = np.array([Traced(content) for content in states], dtype=object).view(TracedArray)
    x.flags.writeable = False
    if not isinstance(state, int):
        x = named_values(STATE, state, x)
    p = named_values(PARAMETERS, parameters, map(Traced, values))
    refusals: list[TraceError] = []
    token = _REFUSALS.set(refusals)
    try:
        with in_terms_of(algebra):
            contents = [_content(value) for value in _plain(function(Traced(t), x, p)).ravel()]
    finally:
        _REFUSALS.reset(token)
    if refusals:
        raise refusals[0]
    return contents
