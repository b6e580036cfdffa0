"""Placeholders for numbers, which record the Python operators and NumPy functions applied to them.

Operators and functions on a traced number build a record instead of computing (NEP 13 and NEP 18). An algebra
determines the record: expressions in ``hybrid.expression.tracing``, the names that are read in
``hybrid.expression.reads``. Model functions behave the same with all. None can follow a branch taken in
Python, because the value it depends on is unknown.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from types import FrameType
from typing import Any, Protocol

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from hybrid.errors import ModelError, shown
from hybrid.expression.branches import refused_branch
from hybrid.expression.nodes import Expression
from hybrid.expression.pieces import Pieces, items, lines
from hybrid.expression.text import text
from hybrid.expression.ufuncs import UFUNCS
from hybrid.expression.vocabulary import (
    BITWISE,
    CONTRACTIONS,
    FOREIGN,
    INSTEAD,
    NEEDS_CHOICE,
    NEEDS_COPY,
    NEEDS_FLOATS,
    NEEDS_NUMBER,
    NEEDS_TABLE,
    NEEDS_WHOLE_NUMBER,
    OF_TRUTHS,
    REDUCTIONS,
    TRUTHS,
    WHERE,
    named,
)
from hybrid.system.rows import Firing, fires
from hybrid.system.variables import PARAMETERS, STATE, named_values


class Algebra(Protocol):
    """The results of operations on traced numbers."""

    def number(self, value: Any) -> Any:
        """Content of a traced number with a known value; TypeError or ValueError if it is not a number."""

    def combined(self, name: str, contents: tuple[Any, ...]) -> Any:
        """Content of the result of a function in ``UFUNCS``, or of ``WHERE``."""

    def looked_up(self, pieces: Pieces, content: Any, derived: int) -> Any:
        """Content of the value of a table, or of a derivative of some order."""

    def expression(self, content: Any) -> Any:
        """The expression of a content, for callers that ask for it."""


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


class Traced(NDArrayOperatorsMixin):
    """A placeholder for a number, which behaves like a NumPy scalar."""

    __slots__ = ("content", "is_truth")

    def __init__(self, content: Any, *, is_truth: bool = False) -> None:
        self.content = content
        # Whether the untraced value is a boolean.
        self.is_truth = is_truth

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
        if ufunc is np.divmod and method == "__call__":
            return np.floor_divide(*inputs), np.remainder(*inputs)
        if method == "__call__" and not options and not any(isinstance(i, np.ndarray) for i in inputs):
            # NumPy adds the items of a list of booleans, as np.sum does, to count them.
            counts = ufunc is np.add and all(map(_is_truth, inputs)) and _is_numpy(sys._getframe(2))
            return _lifted(_known(ufunc), counts=counts)(*inputs)
        return _apply(ufunc, method, inputs, options)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> Any:
        return _apply_function(function, args, kwargs)

    def __getattr__(self, name: str) -> Any:
        # np.cos of an object array, such as np.array([x.q, x.v]), calls the method cos of each element.
        ufunc = getattr(np, name, None)
        if isinstance(ufunc, np.ufunc):
            return lambda *others: _lifted(_known(ufunc))(self, *others)
        text = f"a traced number has no attribute {name!r}"
        # NumPy itself looks for attributes of arrays, and does the same with a number that has none.
        if not (name.startswith("__") or _is_numpy(sys._getframe(1))) and hasattr(np.float64, name):
            refusal(text)
        raise AttributeError(text)

    def __bool__(self) -> bool:
        raise refusal(refused_branch(sys._getframe(1)))

    def __float__(self) -> float:
        module = str(sys._getframe(1).f_globals.get("__name__"))
        raise refusal(NEEDS_TABLE if module.startswith("scipy.interpolate") else NEEDS_NUMBER)

    def __int__(self) -> int:
        raise refusal(f"{NEEDS_WHOLE_NUMBER} np.trunc(x)")

    def __complex__(self) -> complex:
        raise refusal(NEEDS_NUMBER)

    def __index__(self) -> int:
        raise refusal(NEEDS_NUMBER)

    def __trunc__(self) -> int:
        raise refusal(f"{NEEDS_WHOLE_NUMBER} np.trunc(x)")

    def __floor__(self) -> int:
        raise refusal(f"{NEEDS_WHOLE_NUMBER} np.floor(x)")

    def __ceil__(self) -> int:
        raise refusal(f"{NEEDS_WHOLE_NUMBER} np.ceil(x)")

    def __round__(self, digits: int | None = None) -> Any:
        return _rounded(self, digits or 0)

    def __hash__(self) -> int:
        raise refusal("a number is needed as a key: a lookup in a table by the state cannot be traced")

    def __format__(self, specification: str) -> str:
        if specification:
            raise refusal(NEEDS_NUMBER)
        return repr(self)

    def __repr__(self) -> str:
        found = self.expression
        return f"Traced({text(found) if isinstance(found, Expression) else found})"


class TracedArray(np.ndarray):
    """An object array of traced numbers, on which NumPy's functions act element by element."""

    def __getitem__(self, key: Any) -> Any:
        if _is_condition(key):
            raise refusal(NEEDS_CHOICE)
        return super().__getitem__(key)

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            raise refusal(NEEDS_COPY)
        if _is_condition(key):
            if np.shape(key) != self.shape or np.ndim(value):
                raise refusal(NEEDS_CHOICE)
            key, value = ..., _where(key, value, self)
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
            raise _unknown(function.__name__, f": {type(error).__name__}: {error}") from error


def _is_numpy(frame: FrameType) -> bool:
    """Whether a frame runs code of NumPy."""
    return str(frame.f_globals.get("__name__")).startswith("numpy.")


def _unknown(name: str, reason: str = "") -> TraceError:
    """The refusal of a NumPy function, with what to write instead if that is known."""
    if name in INSTEAD:
        reason = f": write {INSTEAD[name]}"
    return refusal(f"np.{name} cannot be traced{reason}")


def _known(ufunc: np.ufunc) -> str:
    if named(ufunc.__name__) is not ufunc:
        raise refusal(f"{ufunc.__name__} is not a function of NumPy: {FOREIGN}")
    if ufunc.__name__ not in UFUNCS | BITWISE:
        raise _unknown(ufunc.__name__)
    return str(ufunc.__name__)


def _lifted(name: str, *, counts: bool = False) -> Callable[..., Traced]:
    """The function of that name for traced numbers; ``counts`` if a sum of booleans is their number."""

    def combine(*arguments: Any) -> Traced:
        operation, is_truth = _operation(name, arguments, counts)
        contents = tuple(map(_content, arguments))
        try:
            return Traced(_ALGEBRA.get().combined(operation, contents), is_truth=is_truth)
        except Exception as error:
            raise refusal(f"np.{name}: {type(error).__name__}: {error}") from error

    return combine


def _operation(name: str, arguments: tuple[Any, ...], counts: bool) -> tuple[str, bool]:
    """What a function does with its arguments, some of which may be booleans; whether it gives a boolean."""
    if not all(map(_is_truth, arguments[name == WHERE :])):
        if name in BITWISE:
            raise refusal("&, |, ^ and ~ join conditions: write (x.q > 0) & (x.v > 0)")
        return name, name in TRUTHS
    if name == WHERE or counts:
        return name, not counts
    kind = _of_booleans(name)
    if kind is None or kind not in (np.bool_, np.float64):
        done = "does not compute" if kind is None else f"computes in {kind}"
        raise refusal(
            f"NumPy {done} np.{name} of a boolean: write np.where(condition, 1.0, 0.0) in its place"
        )
    return OF_TRUTHS.get(name, name), kind == np.bool_


@cache
def _of_booleans(name: str) -> np.dtype[Any] | None:
    """The type that NumPy gives a function of booleans; None if it has none."""
    ufunc = named(name)
    try:
        found: np.dtype[Any] = ufunc.resolve_dtypes((np.dtype(bool),) * ufunc.nin + (None,) * ufunc.nout)[-1]
    except TypeError:
        return None
    return found


def _is_truth(value: Any) -> bool:
    if type(value) is Traced:
        return value.is_truth
    return isinstance(
        value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value, bool | np.bool_
    )


def _is_condition(key: Any) -> bool:
    """Whether an index is a condition that depends on symbols."""
    return type(key) is Traced or (isinstance(key, np.ndarray) and key.dtype == object)


def _content(value: Any) -> Any:
    if isinstance(value, Traced):
        return value.content
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return _content(value[()])
    try:
        return _ALGEBRA.get().number(value)
    except (TypeError, ValueError, OverflowError):
        raise refusal(f"{shown(value)} is not a number") from None


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
        lifted = _lifted(_known(ufunc), counts=method in REDUCTIONS and ufunc is np.add)
        elementwise = np.frompyfunc(lifted, ufunc.nin, 1, identity=ufunc.identity)
        if method in REDUCTIONS and ufunc.__name__ in TRUTHS:
            # The result of a single item is a boolean, too.
            inputs = (np.frompyfunc(_lifted("not_equal"), 2, 1)(_plain(inputs[0]), 0), *inputs[1:])
    out = options.pop("out", None)
    if out is not None and not isinstance(out[0], Traced):  # x += 1 on an array; a number becomes another
        if any(array.dtype != object for array in out):
            raise refusal(NEEDS_FLOATS)
        options["out"] = tuple(array.view(np.ndarray) for array in out)
    options.pop("dtype", None)
    result = getattr(elementwise, method)(*map(_plain, inputs), **options)
    return out[0] if "out" in options else _wrapped(result)


def _where(condition: Any, *choices: Any) -> Any:
    if len(choices) != 2:
        raise refusal("np.where needs both values to be traced: np.where(condition, a, b)")
    return _wrapped(np.frompyfunc(_lifted(WHERE), 3, 1)(*map(_plain, (condition, *choices))))


def _clipped(a: Any, a_min: Any = None, a_max: Any = None, **bounds: Any) -> Any:
    low, high = bounds.get("min", a_min), bounds.get("max", a_max)
    if low is not None:
        a = np.maximum(a, low)
    return a if high is None else np.minimum(a, high)


def _rounded(a: Any, decimals: int = 0) -> Any:
    """As NumPy rounds, half to even."""
    scale = 10.0 ** abs(decimals)
    return np.rint(a * scale) / scale if decimals > 0 else np.rint(a / scale) * scale


def looked_up(pieces: Pieces, u: Any, derived: int = 0) -> Any:
    """The values of a table, or of a derivative, at numbers or traced numbers of any shape."""
    if not is_traced(u):
        return pieces.at(u, derived)

    def value(each: Any) -> Traced:
        return Traced(_ALGEBRA.get().looked_up(pieces, _content(each), derived))

    return _wrapped(np.frompyfunc(value, 1, 1)(_plain(u)))


def is_traced(value: Any) -> bool:
    """Whether a value is a traced number, or has any as items."""
    if isinstance(value, list | tuple):
        return any(type(each) is Traced or isinstance(each, TracedArray) for each in value)
    return type(value) is Traced or isinstance(value, TracedArray)


def _interpolated(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Any:
    """``np.interp``: a table of constant points."""
    try:
        points, values = (np.asarray(each, dtype=float) for each in (xp, fp))
        left, right = (None if each is None else float(each) for each in (left, right))
    except TraceError:
        raise refusal("np.interp needs points that are numbers: add up pieces with np.clip") from None
    if period is not None:
        x, points, values, left, right = *_repeated(x, points, values, period), None, None
    if not (np.isfinite(points).all() and np.isfinite(values).all()):
        raise refusal("np.interp needs points and values that are finite: leave the others out")
    if points.shape != values.shape or points.ndim != 1 or not (points.size and np.all(np.diff(points) > 0)):
        raise refusal("np.interp can be traced only for points that increase")
    return looked_up(lines(points, values, left, right), x)


def _repeated(x: Any, points: np.ndarray, values: np.ndarray, period: Any) -> tuple[Any, Any, Any]:
    """Argument, points and values within a period, as NumPy has them: the last point is also before it."""
    if isinstance(period, Traced) or period == 0.0:
        raise refusal(
            "np.interp needs a period that is a number: write np.interp(np.mod(t, T), times, values)"
        )
    length = abs(period)
    order = np.argsort(points % length)
    within, there = (points % length)[order], values[order]
    around = np.concatenate([within[-1:] - length, within, within[:1] + length])
    return x % length, around, np.concatenate([there[-1:], there, there[:1]])


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
    np.round: _rounded,
    np.around: _rounded,
    np.select: _select,
    np.piecewise: _piecewise,
    np.interp: _interpolated,
}


def _apply_function(function: Any, args: Any, kwargs: Any) -> Any:
    if function in FUNCTIONS:
        return FUNCTIONS[function](*args, **kwargs)
    # NumPy does other functions on arrays. If nothing is a number by itself, items of an array were asked.
    single = any(map(_holds_number, (*args, *kwargs.values())))
    given = [_as_arrays(each, items=not single) for each in args]
    named = {name: _as_arrays(each, items=not single) for name, each in kwargs.items()}
    try:
        return function(*given, **named)
    except TraceError:
        raise
    except Exception as error:
        raise _unknown(function.__name__, f": {type(error).__name__}: {error}") from error


def _holds_number(argument: Any) -> bool:
    if isinstance(argument, list | tuple):
        return any(map(_holds_number, argument))
    return isinstance(argument, Traced)


def _as_arrays(argument: Any, *, items: bool) -> Any:
    """The argument with arrays in place of traced numbers; with ``items``, a list of those of an array."""
    if isinstance(argument, list | tuple) or (items and isinstance(argument, TracedArray) and argument.ndim):
        return [_as_arrays(each, items=items) for each in argument]
    return _wrapped(_plain(argument)) if isinstance(argument, Traced) else argument


def values_of(
    function: Callable[..., Any],
    state: tuple[str, ...] | int,
    parameters: tuple[str, ...],
    algebra: Algebra,
    symbols: tuple[Any, Iterable[Any], Iterable[Any]],
    *,
    row: Any = None,
) -> list[Any]:
    """Contents of a model function's values, as a flat list, for given contents of ``t``, ``x`` and ``p``.

    ``row`` is the content of the row of a schedule that fires; the first row if it is left out.

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
        firing = Traced(algebra.number(0.0) if row is None else row)
        with in_terms_of(algebra), fires(Firing(firing, lambda column: looked_up(items(column), firing))):
            contents = [_content(value) for value in _plain(function(Traced(t), x, p)).ravel()]
    finally:
        _REFUSALS.reset(token)
    if refusals:
        raise refusals[0]
    return contents
