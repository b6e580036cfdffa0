"""Comparison of the compiled functions of a model with the Python functions they were made from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np

from hybrid.compiler.emitted import Emitted
from hybrid.errors import ModelError
from hybrid.expression.pieces import Pieces
from hybrid.expression.values import TraceError, values_of
from hybrid.expression.vocabulary import WHERE, named
from hybrid.system.derivatives import complex_step, evaluate, sample_points
from hybrid.system.functions import GUARD, VALUES_ALONE, ModelFunction
from hybrid.system.graph import HybridSystem, functions_of

EPSILON = float(np.finfo(float).eps)
# Sizes of state and time at which functions are compared, besides those near 1.
SIZES = (1e-3, 30.0, 1e3)
# Values whose relative difference is below this are equal without a closer look.
SAME_VALUE = 16 * EPSILON
# Differences between derivatives by the complex step that are rounding, as a share of their size.
SAME_DERIVATIVE = 1e-7
# Number of evaluations with random roundings, which show the effect of rounding on a function.
SHAKES = 8
# The compiler's elementary functions are not NumPy's. What is traced can be shaken at each operation.
ROUNDED = {True: 1e-13, False: 1e-8}
# Rounding error of a difference of terms, as a share of the largest state.
HIDDEN = 1e-12


class Compiled(Protocol):
    """A compiled system, as far as the comparison needs it."""

    @property
    def system(self) -> HybridSystem:
        """The model."""
        ...

    @property
    def emitted(self) -> Emitted:
        """The generated code and the facts found by tracing."""
        ...

    def value(
        self, function: ModelFunction, index: int, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """A compiled function of the mode or transition of that index, ``(rows,)``."""
        ...

    def derivative(
        self, function: ModelFunction, index: int, t: float, x: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """Its derivative ``(rows, n + 1)``."""
        ...


def check_agreement(compiled: Compiled) -> None:
    """Compare every compiled function with its Python function at points of many sizes.

    Points at which Python raises an error, or a value is not finite, are passed over.

    Raises
    ------
    ModelError
        If a value differs by more than rounding.
    """
    points = [*comparison_points(compiled.system)]
    growth = compiled.system.growth
    known = {} if growth is None else growth.written
    for index, function in functions_of(compiled.system):
        if known.setdefault(("agrees", *function.identity), function) is not function:
            # An earlier stage of the system, or another transition, has this function too.
            continue
        for t, x, values in points:
            fault = disagreement(compiled, function, index, t, x, values)
            if fault is not None:
                raise ModelError(fault)


def compiled_value(
    compiled: Compiled, function: ModelFunction, index: int, t: float, x: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """The compiled function as it runs."""
    return compiled.value(function, index, t, x, values)


Value = Callable[..., np.ndarray]


def comparison_points(system: HybridSystem) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
    """Times, states ``(n,)`` and parameter vectors ``(m,)``: the declared one, and others near to it."""
    declared = system.parameter_values()
    rng = np.random.default_rng(20261122)
    for t, x in sample_points(system.dimension):
        yield t, x, declared
    for size in SIZES:
        for near in (0.0, 0.1):
            signs = rng.choice([-1.0, 1.0], system.dimension)
            x = size * signs * rng.uniform(0.5, 1.5, system.dimension)
            yield size * rng.uniform(0.5, 1.5), x, declared * (1.0 + near * rng.uniform(-1, 1, len(declared)))


def disagreement(
    compiled: Compiled,
    function: ModelFunction,
    index: int,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    value: Value = compiled_value,
) -> str | None:
    """The difference between a compiled function, or its derivative, and Python's, in words; None if equal.

    ``value`` is what evaluates the compiled function.
    """
    system = compiled.system
    found = value(compiled, function, index, t, x, values)
    opaque = _is_opaque(compiled, function.function)
    signs = function.kind == GUARD and compiled.emitted.plain_guard[index]
    text = _difference(system, function.title, function.value, found, t, x, values, opaque, signs)
    if text is not None or function.kind in VALUES_ALONE:
        return text
    if function.slopes is not None:
        found = compiled.derivative(function, index, t, x, values)
        given = evaluate(system.variables, function.slopes, t, x, values)
        width = found.shape[1] if given is None else len(given) // function.rows
        given_columns = found[:, :width].ravel()
        title = function.derivative_title
        return _difference(system, title, function.slopes, given_columns, t, x, values, opaque)
    if not opaque:
        return None
    try:
        wanted = complex_step(system.variables, function, t, x, values)
    except Exception:  # not at this point, then
        return None
    # Size of a row's derivatives, of which those that cancel are judged by the size of the value.
    known = np.isfinite(wanted)
    value_size = np.where(np.isfinite(found), np.abs(found), 0.0) / (np.abs(x).max() or 1.0)
    size = np.where(known, np.abs(wanted), 0.0).max(axis=1) + value_size
    found = compiled.derivative(function, index, t, x, values)
    # Behind these are the rows of held components and of counters.
    known[function.kept :] = False
    wrong = known & ~(np.abs(found - wanted) <= SAME_DERIVATIVE * size[:, None])
    if not np.any(wrong):
        return None
    i, j = (int(k) for k in np.argwhere(wrong)[0])
    what = f"{function.title}: the derivative"
    return _told(system, what, found[i, j], wanted[i, j], t, x, values, "a branch on the type of a number")


def _is_opaque(compiled: Compiled, function: Callable[..., Any]) -> bool:
    return any(value.function is function for value in compiled.emitted.opaque.values())


def _difference(
    system: HybridSystem,
    title: str,
    function: Callable[..., Any],
    found: np.ndarray,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    opaque: bool,
    signs: bool = False,
) -> str | None:
    """How a value differs from Python's; with ``signs``, how its sign does."""
    wanted = evaluate(system.variables, function, t, x, values)
    if wanted is None or len(wanted) != len(found):
        return None
    # A power may vanish where its base does not.
    if signs and not np.any(np.sign(found) * np.sign(wanted) < 0.0):
        return None
    apart = np.abs(found - wanted)
    if np.all(apart <= SAME_VALUE * np.abs(wanted)):
        return None
    band = rounding_band(system, function, t, x, values, wanted)
    # A result that is pure rounding in Python may be 0/0 in another order of operations. An opaque function
    # reports errors as nan.
    lost = ~np.isfinite(found) & (not opaque)
    wrong = ~(apart <= band) & ~lost
    if not np.any(wrong):
        return None
    i = int(np.argmax(wrong))
    if np.isfinite(found[i]):
        cause = (
            "a branch on the type of a number, an error that it catches, a state of its own, a global that "
            "has changed, or whole numbers beyond 64 bits (write floats: 1.0 in place of 1). Model functions "
            "must be pure functions of the values of (t, x, p)"
        )
    else:
        cause = "an index out of range or an error that it raises"
    place = title if len(wanted) == 1 else f"{title}: value {i}"
    return _told(system, place, found[i], wanted[i], t, x, values, cause)


def _told(
    system: HybridSystem,
    what: str,
    found: float,
    wanted: float,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    cause: str,
) -> str:
    # As many digits as tell the two apart.
    digits = next((n for n in (10, 14) if f"{found:.{n}g}" != f"{wanted:.{n}g}"), 17)
    return (
        f"{what} is {found:.{digits}g} compiled and {wanted:.{digits}g} in Python, "
        f"{system.variables.described(t, x, values)}. "
        f"Likely: {cause}."
    )


def rounding_band(
    system: HybridSystem,
    function: Callable[..., Any],
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    value: np.ndarray,
) -> np.ndarray:
    """Largest difference that rounding alone can make between two ways to compute a function.

    It is computed several times with every result of an operation moved by a few units in the last place
    (Monte Carlo arithmetic), or only its arguments if its operations cannot be seen.
    """
    rng = np.random.default_rng(1)
    try:
        shaken = _shaken_operations(system, function, t, x, values, rng)
        traced = True
    except Exception:
        traced = False
        points = ([_shake(each, rng) for each in (t, x, values)] for _ in range(SHAKES))
        moved = (evaluate(system.variables, function, *point) for point in points)
        shaken = np.array([sample for sample in moved if sample is not None])
    spread = np.ptp(shaken, axis=0) if len(shaken) else np.inf
    # Differences of large terms inside a function whose operations cannot be seen.
    hidden = 0.0 if traced else HIDDEN * np.abs(x).max()
    return np.asarray(ROUNDED[traced] * np.abs(value) + 4.0 * spread + hidden)


def _shake(value: Any, rng: np.random.Generator) -> Any:
    return value * (1.0 + EPSILON * rng.uniform(-2.0, 2.0, np.shape(value)))


def _shaken_operations(
    system: HybridSystem,
    function: Callable[..., Any],
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Values ``(SHAKES, rows)`` of a function, each time with other roundings of its operations."""
    symbols = [_shake(np.broadcast_to(each, (SHAKES, *np.shape(each))), rng).T for each in (t, x, values)]
    with np.errstate(all="ignore"):
        found = values_of(
            function,
            system.variables.components,
            tuple(system.parameters),
            _Shaken(rng),
            tuple(symbols),
        )
    return np.array([np.broadcast_to(each, SHAKES) for each in found], dtype=float).T


class _Shaken:
    """Traced numbers as vectors ``(SHAKES,)`` of floats, with random roundings after every operation."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def number(self, value: Any) -> Any:
        """The number as a float."""
        return np.float64(value)

    def combined(self, name: str, contents: tuple[Any, ...]) -> Any:
        """The value of the function with random last digits."""
        value = np.where(*contents)[()] if name == WHERE else named(name)(*contents)
        return _shake(value, self.rng) if value.dtype.kind == "f" else value

    def looked_up(self, pieces: Pieces, content: Any, derived: int) -> Any:
        """The value of a table with random last digits."""
        return _shake(pieces.at(content, derived), self.rng)

    def expression(self, content: Any) -> Any:
        """There is none."""
        raise TraceError("there is no expression where numbers are computed")
