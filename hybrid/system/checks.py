"""Trial calls of every model function when a system is made, so that mistakes show up early."""

from __future__ import annotations

import inspect
import numbers
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.system.derivatives import check_derivative, evaluate, sample_points
from hybrid.system.functions import CONDITION, ModelFunction, WholeReset
from hybrid.system.periodicity import Period, angle_fault_at, cyclic_fault_at, period_at, period_fault
from hybrid.system.rows import fires, plain_firing
from hybrid.system.variables import Variables
from hybrid.system.watched import is_of_library

SAMPLE_TIME = np.float64(0.7548776662466927)
# Multiples of an irrational number modulo 1 give every component another value, away from kinks and
# symmetries.
SAMPLE_STRIDE = 0.6180339887498949


# Size of counters at the sample points, whose components are near 1.
COUNTS = 3


def check_functions(variables: Variables, functions: Sequence[ModelFunction], period: Period) -> None:
    """Call every model function at a few generic points and check the returned values.

    An arithmetic failure there (a logarithm of a negative number, a division by zero) is not an error,
    because the points are arbitrary. Given derivatives are compared with their functions. Every function is
    also compared with itself: called again, and one declared period later.

    Raises
    ------
    ModelError
        If a function has the wrong arity, asks for a name that does not exist, fails, is not pure, or returns
        the wrong number or kind of values; or if a given derivative or the period is wrong.
    """
    for function in functions:
        _check_function(variables, function)
    if callable(period):
        _check_period_function(variables, period)
    _check_period(variables, functions, period)


def check_angles(variables: Variables, functions: Sequence[ModelFunction], lengths: np.ndarray) -> None:
    """Compare every function of the user's with itself a turn further, at a few generic points.

    Raises
    ------
    ModelError
        If one differs.
    """
    for function in authored(functions) if np.any(lengths) else ():
        for t, x in sample_points(variables.dimension):
            fault = angle_fault_at(variables, function, t, x, variables.defaults, lengths)
            if fault is not None:
                raise ModelError(fault)


def authored(functions: Sequence[ModelFunction]) -> list[ModelFunction]:
    """The functions that an author wrote, without those that the library derives."""
    return [each for each in functions if not is_of_library(each.function)]


def check_cyclic(variables: Variables, functions: Sequence[ModelFunction], cyclic: np.ndarray) -> None:
    """Compare functions with themselves after a shift along each component that is ``cyclic (n,)``.

    Raises
    ------
    ModelError
        If one differs, or a reset does not shift with the component.
    """
    for function in functions if np.any(cyclic) else ():
        for t, x in sample_points(variables.dimension):
            fault = cyclic_fault_at(variables, function, t, x, variables.defaults, cyclic)
            if fault is not None:
                raise ModelError(fault)


def sample_state(variables: Variables) -> np.ndarray:
    """The fixed state ``(n,)`` of the trial call, with components in (1/2, 3/2)."""
    fractions: np.ndarray = np.mod(SAMPLE_STRIDE * np.arange(1, variables.dimension + 1), 1.0)
    return 0.5 + fractions


def trial(variables: Variables, title: str, function: Callable[..., Any], *, of_jump: bool = False) -> Any:
    """What a function of ``(t, x, p)``, or of ``(t, minus, plus, p)``, returns at a generic point.

    None if the arithmetic fails there.

    Raises
    ------
    ModelError
        If the function has the wrong arity, asks for a name that does not exist, or fails.
    """
    t, x, p = _arguments(variables)
    if of_jump:
        value = _call(title, function, (t, x, x, p), "t, minus, plus, p")
    else:
        value = _call(title, function, (t, x, p))
    return None if value is None else value[0]


def check_number(variables: Variables, owner: str, function: Callable[..., Any]) -> None:
    """Call a function of ``(t, x, p)`` that gives one number, at the generic points of model functions.

    Raises
    ------
    ModelError
        If the function has the wrong arity, asks for a name that does not exist, fails, is not pure, or does
        not return one number.
    """
    called = ModelFunction(owner, "function", function, "", None, None)
    value = _call(called.title, function, _arguments(variables))
    if value is None:
        _check_division(variables, called)
        return
    if not _is_number(value[0]):
        raise ModelError(f"{called.title} must return one number; got {arguments.shown(value[0])}.")
    _check_pure(variables, called)


def derivative_has_time_column(variables: Variables, function: ModelFunction) -> bool:
    """Whether a given derivative returns ``n + 1`` columns; False if it fails at the sample point."""
    assert function.derivative is not None
    value = _call(function.derivative_title, function.derivative, _arguments(variables))
    if value is None:
        return False
    return int(np.asarray(value[0]).size) == function.returned * (variables.dimension + 1)


def _arguments(variables: Variables) -> tuple[Any, ...]:
    p = variables.parameter_view(variables.defaults)
    return SAMPLE_TIME, variables.state_view(sample_state(variables)), p


def _check_function(variables: Variables, function: ModelFunction) -> None:
    arguments = _arguments(variables)
    called = function.function if function.still else function.value
    with fires(plain_firing(0, function.schedules)):
        value = _call(function.title, called, arguments)
    if value is not None:
        _check_value(variables, function, value[0])
        _check_pure(variables, function)
        _check_counters(variables, function)
    else:
        _check_division(variables, function)
    if function.derivative is not None:
        _check_derivative(variables, function, arguments)


def _check_pure(variables: Variables, function: ModelFunction) -> None:
    """Check that the same arguments give the same values in repeated calls."""
    values, points = variables.defaults, [*sample_points(variables.dimension)]
    passes = [[evaluate(variables, function.value, t, x, values) for t, x in points] for _ in range(2)]
    for (t, x), first, second in zip(points, *passes, strict=True):
        if first is not None and second is not None and not np.array_equal(first, second):
            raise ModelError(
                f"{function.title} returned {first.tolist()} and, called again with the same arguments "
                f"(t = {t:.6g}, x = {x.tolist()}), {second.tolist()}. A model function must be pure: no "
                "random numbers, no counters, no memory of earlier calls."
            )


def _check_counters(variables: Variables, function: ModelFunction) -> None:
    """Check that a reset makes whole numbers of counters that are whole numbers."""
    first = variables.tangent_dimension
    for t, x in sample_points(variables.dimension) if function.counted else ():
        x[first:] = np.round(COUNTS * x[first:])
        values = evaluate(variables, function.value, t, x, variables.defaults)
        for name, value in zip(variables.counters, () if values is None else values[first:], strict=False):
            if not value.is_integer():
                raise ModelError(
                    f"{function.title} gives counter {name!r} the value {value:.6g} "
                    f"{variables.described(t, x, variables.defaults)}. Counters are whole numbers; a number "
                    "of another kind that resets change is a held component."
                )


def _check_division(variables: Variables, function: ModelFunction) -> None:
    """Check that Python does not divide by zero everywhere.

    The state, the time and the parameters are NumPy's numbers, whose quotients never raise an error.
    """
    p = variables.parameter_view(variables.defaults)
    for t, x in sample_points(variables.dimension):
        try:
            with np.errstate(all="ignore"):
                function.value(np.float64(t), variables.state_view(x), p)
        except ZeroDivisionError as error:
            failure = error
        except Exception:  # for another reason, at this point
            return
        else:
            return
    raise ModelError(
        f"{function.title} divides by zero at every point that was tried: {failure}. Check the plain numbers "
        "in its denominators."
    ) from failure


def _check_derivative(variables: Variables, function: ModelFunction, arguments: tuple[Any, ...]) -> None:
    assert function.derivative is not None
    value = _call(function.derivative_title, function.derivative, arguments)
    if value is not None:
        _check_derivative_shape(variables, function, value[0])
        check_derivative(variables, function)


def _check_period_function(variables: Variables, period: Callable[..., Any]) -> None:
    title = "HybridSystem: period"
    value = _call(title, period, (variables.parameter_view(variables.defaults),), "p")
    if value is not None and not _is_number(value[0]):
        raise ModelError(f"{title} must return a number; got {arguments.shown(value[0])}.")


def _check_period(variables: Variables, functions: Sequence[ModelFunction], period: Period) -> None:
    """Check the declared period at the default parameters."""
    values = variables.defaults
    try:
        declared = period_at(period, variables, values)
    except (ArithmeticError, ValueError):  # a run at these parameters reports the error
        return
    fault = None if declared is None else period_fault(variables, functions, values, declared)
    if fault is not None:
        raise ModelError(fault)


def _call(
    title: str, function: Callable[..., Any], arguments: tuple[Any, ...], signature: str = "t, x, p"
) -> tuple[Any] | None:
    """The value in a 1-tuple, or None if the arithmetic fails at the sample point."""
    _check_arity(title, function, arguments, signature)
    try:
        with np.errstate(all="ignore"):
            return (function(*arguments),)
    except ArithmeticError:
        return None
    except ModelError as error:
        raise ModelError(f"{title}: {error}") from error
    except Exception as error:
        if isinstance(error, ValueError) and "math domain" in str(error):
            return None
        if isinstance(error, ValueError) and "read-only" in str(error):
            raise ModelError(
                f"{title} writes into its argument, which is the state of the run: {error}. Take a copy "
                "first, x = x.copy(), or return new values."
            ) from error
        raise ModelError(
            f"{title} fails when called with ({signature}): {type(error).__name__}: {error}."
        ) from error


def _check_arity(
    title: str, function: Callable[..., Any], arguments: tuple[Any, ...], signature: str
) -> None:
    try:
        expected = inspect.signature(function.function if isinstance(function, WholeReset) else function)
    except (TypeError, ValueError):  # some builtins and ufuncs have no signature
        return
    try:
        expected.bind(*arguments)
    except TypeError as error:
        raise ModelError(f"{title} must take ({signature}); got a function of {expected}: {error}.") from None


def _check_value(variables: Variables, function: ModelFunction, value: Any) -> None:
    if function.size is None:
        if function.kind == CONDITION:
            if not _is_number(value):
                raise ModelError(
                    f"{function.title} must return one number, positive where the guard may fire, or True or "
                    f"False; got {arguments.shown(value)}."
                )
            return
        # A boolean has no zero crossing and no slope.
        if isinstance(value, bool | np.bool_) or not _is_number(value):
            raise ModelError(
                f"{function.title} must return one number that changes sign; got {arguments.shown(value)}."
            )
        return
    names = ", ".join(variables.state_names[: function.returned])
    values = _as_sequence(function.title, value, f"one value per state ({names})")
    if len(values) != function.returned:
        what = "time derivative" if function.kind == "field" else "value"
        others = ", ".join(variables.state_names[function.returned :])
        raise ModelError(
            f"{function.title} returned {len(values)} values; the state has {function.returned} "
            f"({names}). Return one {what} per state."
            + (f" What is held or counts has no field: {others}." if others else "")
        )
    _check_numbers(function.title, values)


def _check_derivative_shape(variables: Variables, function: ModelFunction, value: Any) -> None:
    n, m, title = variables.dimension, function.returned, function.derivative_title
    if function.size is None:
        rows = [_as_sequence(title, value, f"{n} or {n + 1} values")]
    else:
        rows = [
            _as_sequence(title, row, f"rows of {n} or {n + 1} values")
            for row in _as_sequence(title, value, f"{m} rows")
        ]
    widths = sorted({len(row) for row in rows})
    if len(rows) != m or len(widths) != 1 or widths[0] not in (n, n + 1):
        wanted = f"{n} or {n + 1} values" if function.size is None else f"{m} rows of {n} or {n + 1} values"
        shape = " or ".join(map(str, widths))
        got = f"{shape} values" if function.size is None else f"{len(rows)} rows of {shape} values"
        raise ModelError(
            f"{title} returned {got}; it must return {wanted}: "
            f"one column per state ({_names(variables)}), and D_t last if there is one more."
        )
    for row in rows:
        _check_numbers(title, row)


def _as_sequence(title: str, value: Any, wanted: str) -> list[Any]:
    # A set has no order, and a generator can be read only once.
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str | bytes) or _is_scalar(value):
        raise ModelError(
            f"{title} must return a tuple or an array of {wanted}; got {arguments.shown(value)}."
        )
    return list(value)


def _is_scalar(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 0


def _check_numbers(title: str, values: list[Any]) -> None:
    for i, value in enumerate(values):
        if not _is_number(value):
            raise ModelError(f"{title}: value {i} is not a number: {arguments.shown(value)}.")


def _is_number(value: Any) -> bool:
    if np.ma.is_masked(value):
        return False
    if isinstance(value, np.ndarray):
        return _is_scalar(value) and value.dtype.kind in "fiub"
    return isinstance(value, numbers.Real | np.bool_) and not isinstance(value, np.timedelta64)


def _names(variables: Variables) -> str:
    return ", ".join(variables.state_names)
