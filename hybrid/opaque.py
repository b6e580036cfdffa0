"""Model functions that could not be traced: compiled as they are, on terms that keep them what they are."""

from __future__ import annotations

import dis
from collections.abc import Callable, Mapping
from types import FunctionType
from typing import TYPE_CHECKING, Any

import attrs

from hybrid.errors import ModelError

if TYPE_CHECKING:
    from hybrid.emitted import Emitted

# In generated code, by which arrays are handed to these functions.
READONLY = "readonly"
LONGEST_REASON = 300


@attrs.frozen
class OpaqueFunction:
    """A model function that is compiled as it is.

    Attributes
    ----------
    title
        How an error text about it begins: ``"Mode 'flight': field"``.
    function
        The user's function.
    reason
        What stopped tracing.
    """

    title: str
    function: Callable[..., Any]
    reason: str


def check_plain(title: str, function: Callable[..., Any]) -> None:
    """ModelError unless a function can be compiled as it is and stays what it is.

    Compiled code raises fewer errors than Python does (``math.sqrt(-1.0)`` is nan), so a function that
    catches errors would go another way.
    """
    if not isinstance(function, FunctionType):
        raise ModelError(
            f"{title} cannot be traced, and is compiled as it is only if it is a plain function; got "
            f"{function!r}. Write it with NumPy functions (np.sin, np.maximum), so that it can be traced, "
            "or as a function (def or lambda) of (t, x, p) alone."
        )
    if any(instruction.opname == "PUSH_EXC_INFO" for instruction in dis.get_instructions(function)):
        raise ModelError(
            f"{title} cannot be traced, and what catches errors (try, with) cannot be compiled as it is: "
            "compiled arithmetic gives nan where Python raises. Write it without try, with NumPy functions: "
            "np.sqrt(np.maximum(x.q, 0)), say."
        )


def namespace_of(emitted: Emitted) -> dict[str, Any]:
    """The generated roles, with the functions that they call compiled by their first call."""
    from numba import njit

    from hybrid.whole import WholeNumberCompiler, readonly

    compiled = njit(error_model="numpy", boundscheck=True, pipeline_class=WholeNumberCompiler)
    namespace: dict[str, Any] = {
        name: compiled(_own_copy(value.function)) if isinstance(value, OpaqueFunction) else value
        for name, value in emitted.opaque.items()
    }
    namespace[READONLY] = readonly
    exec(compile(emitted.source, "<hybrid model>", "exec"), namespace)
    return namespace


def _own_copy(function: Callable[..., Any]) -> FunctionType:
    """The function with defaults that are floats where they are large whole numbers."""
    from hybrid.whole import LARGEST_INDEX

    assert isinstance(function, FunctionType)
    defaults = tuple(
        float(value) if type(value) is int and abs(value) > LARGEST_INDEX else value
        for value in function.__defaults__ or ()
    )
    copy = FunctionType(
        function.__code__, function.__globals__, function.__name__, defaults, function.__closure__
    )
    copy.__module__ = function.__module__
    return copy


def refusal_of(emitted: Emitted, namespace: Mapping[str, Any], error: Exception) -> ModelError:
    """What to tell of an error of the compiler: which function, what was met, what to write instead."""
    told = [(value, _error_alone(emitted, namespace, name)) for name, value in _functions(emitted)]
    found = [(value, alone) for value, alone in told if alone is not None]
    if not found:
        values = ", ".join(value.title for value, _ in told)
        return ModelError(
            f"{values}: what it returns cannot be compiled: {_short(error)}. Return a tuple or an array of "
            "numbers."
        )
    opaque, alone = found[0]
    assert alone is not None
    return ModelError(
        f"{opaque.title} can neither be traced nor compiled as it is. Tracing stopped: {opaque.reason}. "
        f"The compiler stopped: {_short(alone)}. Write it with NumPy functions on numbers (np.sin, "
        "np.maximum, np.where), tuples in place of lists, and no other libraries."
    )


def _functions(emitted: Emitted) -> list[tuple[str, OpaqueFunction]]:
    return [(name, value) for name, value in emitted.opaque.items() if isinstance(value, OpaqueFunction)]


def _error_alone(emitted: Emitted, namespace: Mapping[str, Any], name: str) -> Exception | None:
    """The error of compiling one function by itself, for numbers, then for complex ones if it takes them."""
    from numba import complex128, float64, typeof, types

    state = emitted.opaque.get("State")
    parameters = emitted.opaque["Parameters"]
    assert isinstance(parameters, type)
    p = typeof(parameters(*(0.0 for _ in parameters._fields)))  # type: ignore[attr-defined]
    for scalar in (float64, complex128):
        if scalar is complex128 and f"{name}(complex(" not in emitted.source:
            continue
        if isinstance(state, type):
            fields = state._fields  # type: ignore[attr-defined]
            x = typeof(state(*(0.0 if scalar is float64 else 0j for _ in fields)))
        else:
            x = types.Array(scalar, 1, "C", readonly=True)
        try:
            namespace[name].compile((scalar, x, p))
        except Exception as error:
            return error
    return None


def _short(error: Exception) -> str:
    """The line of a compiler's text that says what it met."""
    lines = [line.strip(" |>") for line in str(error).splitlines()]
    empty = ("Failed in", "During", "File", "There are", "Overload", "- Of", "raised from", "<source", "^")
    telling = [line for line in lines if line and not line.startswith(empty)]
    if not telling:
        return f"{type(error).__name__}: it gives no reason" if not str(error) else f"{lines[0]}"
    text = telling[0]
    if text.endswith("signature:") and len(telling) > 1:
        text = f"{text} {telling[1]}"
    text = text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]} ..."
    return f"{type(error).__name__}: {text.rstrip('.')}"
