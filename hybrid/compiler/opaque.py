"""Model functions that could not be traced: compiled unchanged, with checks that they stay correct."""

from __future__ import annotations

import dis
import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from types import FunctionType
from typing import Any

import attrs

from hybrid.compiler.cache.loader import import_numba
from hybrid.compiler.interrupts import between_passes
from hybrid.errors import ModelError
from hybrid.system.derivatives import COMPLEX_STEP
from hybrid.system.functions import checked_changes
from hybrid.system.labels import plain_name
from hybrid.system.members import member_name
from hybrid.system.variables import PARAMETERS, STATE, plain_class

LONGEST_REASON = 300
# In code, behind the name of a function: its derivative along one of the variables.
SLOPES = "_slopes"


@attrs.frozen
class OpaqueFunction:
    """A model function that is compiled as it is.

    Code calls it by a name: ``r = model_0(t, x, p)`` gives all its numbers in one row, and
    ``r = model_0_slopes(t, x, p, j)`` their derivatives along state ``j``, or along time for ``j = n``.

    Attributes
    ----------
    title
        How an error text about it begins: ``"Mode 'flight': field"``.
    function
        The user's function.
    reason
        What stopped tracing.
    state, parameters
        Names of the states, or their number, and names of the parameters.
    shape
        Shape of what it returns.
    slopes
        Whether its derivatives are asked for, which are taken by the complex step.
    completed
        Whether it may return a dict of the components that change: a reset.
    """

    title: str
    function: Callable[..., Any]
    reason: str
    state: int | tuple[str, ...]
    parameters: tuple[str, ...]
    shape: tuple[int, ...]
    slopes: bool = False
    completed: bool = False

    def __attrs_post_init__(self) -> None:
        components = () if isinstance(self.state, int) else self.state
        if any(map(member_name, (*components, *self.parameters))):
            raise ModelError(
                f"{self.title} cannot be traced, as the functions of a system with repeats must be: "
                f"{self.reason}. Write it with NumPy functions on numbers (np.sin, np.maximum, np.where)."
            )

    @property
    def size(self) -> int:
        """Number of values that the function returns."""
        return math.prod(self.shape)


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


def compiled_functions(name: str, opaque: OpaqueFunction) -> dict[str, Any]:
    """A function and its derivative, compiled, by their names in code; they never raise.

    They fill their last argument, with nan if the function raises an error, which nobody could be told.

    Raises
    ------
    ModelError
        If numba cannot compile the function.
    """
    import_numba()
    with between_passes():
        return _compiled(name, opaque)


def _compiled(name: str, opaque: OpaqueFunction) -> dict[str, Any]:
    from numba import cfunc, float64, int64, njit, void

    from hybrid.kernels.types.kinds import VECTOR
    from hybrid.kernels.types.numba_door.model_functions import compiler_for, readonly
    from hybrid.kernels.types.numba_door.numba_types import numba_type

    pipeline = compiler_for(_completion(opaque.state) if opaque.completed else None)
    compiled = njit(error_model="numpy", boundscheck=True, pipeline_class=pipeline)
    function = compiled(opaque.function)
    scope: dict[str, Any] = {"function": function, "readonly": readonly}
    if isinstance(opaque.state, tuple):
        scope["State"] = plain_class(STATE, opaque.state)
    scope["Parameters"] = plain_class(PARAMETERS, opaque.parameters)
    exec(_text(opaque), scope)
    vector = numba_type(VECTOR)
    signatures = {"value": void(float64, vector, vector, vector)}
    if opaque.slopes:
        signatures["slopes"] = void(float64, vector, vector, int64, vector)
    names = {"value": name, "slopes": name + SLOPES}
    try:
        return {
            names[each]: cfunc(signature, error_model="numpy")(scope[each])
            for each, signature in signatures.items()
        }
    except Exception as error:
        raise _refusal(opaque, scope, error) from None


def _text(opaque: OpaqueFunction) -> str:
    """The functions ``value`` and ``slopes``, which call the user's with what it expects."""
    state, step = opaque.state, repr(COMPLEX_STEP)
    n = state if isinstance(state, int) else len(state)
    p = f"Parameters({', '.join(f'p[{i}]' for i in range(len(opaque.parameters)))})"
    shift = f"{step} if column == {{}} else 0.0"
    if isinstance(state, int):
        x, lines = f"readonly(x[:{n}])", [f"z = x[:{n}].astype(np.complex128)"]
        lines.append(f"if column < {n}: z[column] = complex(x[column], {step})")
        z = "readonly(z)"
    else:
        x, lines = f"State({', '.join(f'x[{i}]' for i in range(n))})", []
        z = f"State({', '.join(f'complex(x[{i}], {shift.format(i)})' for i in range(n))})"
    value = [f"v = function(t, {x}, {p})"]
    slopes = [*lines, f"v = function(complex(t, {shift.format(n)}), {z}, {p})"]
    for place in range(opaque.size):
        entry = "v" + "".join(f"[{i}]" for i in _indices(place, opaque.shape))
        value.append(f"out[{place}] = {entry}")
        slopes.append(f"out[{place}] = {entry}.imag / {step}")
    written = [("value", "t, x, p, out", value)]
    if opaque.slopes:
        written.append(("slopes", "t, x, p, column, out", slopes))
    text = "import numpy as np\n"
    for name, arguments, body in written:
        text += f"def {name}({arguments}):\n    try:\n"
        text += "".join(f"        {line}\n" for line in body)
        text += (
            f"    except Exception:\n        for i in range({opaque.size}):\n            out[i] = np.nan\n"
        )
    return text


def _indices(place: int, shape: tuple[int, ...]) -> list[int]:
    indices: list[int] = []
    for length in reversed(shape):
        place, index = divmod(place, length)
        indices.insert(0, index)
    return indices


@lru_cache(maxsize=256)
def _completion(state: int | tuple[str, ...]) -> Callable[[list[tuple[Any, Any]]], list[Any]]:
    """How the items of a dict that a reset returns become all components of the state."""

    def completed(items: list[tuple[Any, Any]]) -> list[Any]:
        if any(key is None for key, _ in items):
            raise ModelError("the names in the dict that a reset returns must be written as they are")
        changed = {plain_name(key): value for key, value in items}
        return [changed.get(name, name) for name in checked_changes(changed, state)]

    return completed


def _refusal(opaque: OpaqueFunction, scope: Mapping[str, Any], error: Exception) -> ModelError:
    """The text for an error of the compiler: the function, the problem, and what to write instead."""
    alone = _error_alone(opaque, scope)
    if alone is None:
        return ModelError(
            f"{opaque.title}: what it returns cannot be compiled: {_short(error)}. Return a tuple or an "
            "array of numbers."
        )
    return ModelError(
        f"{opaque.title} can neither be traced nor compiled as it is. Tracing stopped: {opaque.reason}. "
        f"The compiler stopped: {_short(alone)}. Write it with NumPy functions on numbers (np.sin, "
        "np.maximum, np.where), tuples in place of lists, and no other libraries."
    )


def _error_alone(opaque: OpaqueFunction, scope: Mapping[str, Any]) -> Exception | None:
    """The error of compiling the function by itself, for numbers, then for complex ones if it takes them."""
    from numba import complex128, float64, typeof, types

    p = typeof(scope["Parameters"](*(0.0 for _ in opaque.parameters)))
    for scalar in (float64, complex128)[: 1 + opaque.slopes]:
        if isinstance(opaque.state, tuple):
            x = typeof(scope["State"](*(0.0 if scalar is float64 else 0j for _ in opaque.state)))
        else:
            x = types.Array(scalar, 1, "C", readonly=True)
        try:
            scope["function"].compile((scalar, x, p))
        except Exception as error:
            return error
    return None


def _short(error: Exception) -> str:
    """The line of the compiler's text that names the problem."""
    lines = [line.strip(" |>") for line in str(error).splitlines()]
    empty = ("Failed in", "During", "File", "There are", "Overload", "- Of", "raised from", "<source", "^")
    telling = [line for line in lines if line and not line.startswith(empty)]
    if not lines:
        return f"it failed with {type(error).__name__}"
    text = (telling or lines)[0].rstrip(".")
    if text.endswith("signature:") and len(telling) > 1:
        text = f"{text} {telling[1]}"
    text = text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]} ..."
    return f"{type(error).__name__}: {text}"
