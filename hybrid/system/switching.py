"""Which switching functions, such as ``np.sign``, a field applies to the state inside of its mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from hybrid.system.derivatives import sample_points
from hybrid.system.elements import Function
from hybrid.system.variables import Variables

COMPARISONS = ("less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "maximum", "minimum")
EXTREMES = ("fmax", "fmin", "clip")
OF_ONE = ("sign", "absolute", "fabs", "heaviside")
COUNTS = ("floor", "ceil", "trunc", "rint", "remainder", "fmod", "floor_divide")
SWITCHING = frozenset((*COMPARISONS, *EXTREMES, *OF_ONE, *COUNTS))
# NumPy's own names for what a model writes.
WRITTEN = {
    "absolute": "abs",
    "fabs": "abs",
    "remainder": "mod",
    "rint": "round",
    "fmax": "maximum",
    "fmin": "minimum",
    "less": "<",
    "less_equal": "<=",
    "greater": ">",
    "greater_equal": ">=",
    "equal": "==",
    "not_equal": "!=",
}
# Two functions have the same surface if their ratio varies by less than this from point to point.
SAME = 1e-9
Log = list[tuple[str, tuple[float, ...]]]


def switching_inside(
    variables: Variables, field: Function, guards: Sequence[Function], values: np.ndarray
) -> list[str]:
    """Names of the switching functions that a field applies to the state, in order.

    Those that switch where a guard of the mode vanishes are left out: the mode ends there. Functions that
    fail at a point are left out there.

    Parameters
    ----------
    guards
        Guards of the transitions that leave the mode.
    values
        Parameter vector ``(m,)``.
    """
    points = [(t, size * x) for size in (1.0, 0.1) for t, x in sample_points(variables.dimension)]
    logs = [_applied(variables, field, t, x, values) for t, x in points]
    most = max(logs, key=len)
    known = [_values(variables, guard, points, values) for guard in guards]
    found = []
    for k, (name, _) in enumerate(most):
        # The calls are the same at every point, unless the field branches in Python.
        same = [log[k][1] if len(log) == len(most) and log[k][0] == name else () for log in logs]
        surfaces = {tuple(heights) for heights in zip(*filter(None, same), strict=False)}
        inside = any(
            len(surface) != len(points) or not any(_proportional(surface, each) for each in known)
            for surface in surfaces
        )
        if inside or not surfaces:
            found.append(WRITTEN.get(name, name))
    return list(dict.fromkeys(found))


def _applied(variables: Variables, field: Function, t: float, x: np.ndarray, values: np.ndarray) -> Log:
    log: Log = []
    probes = np.array([_Probe(float(each), log) for each in x], dtype=object)
    try:
        with np.errstate(all="ignore"):
            field(t, variables.state_view(probes), variables.parameter_view(values))
    except Exception:  # whatever the cause, it is known what was applied before
        pass
    return log


def _values(variables: Variables, function: Function, points: Any, values: np.ndarray) -> list[float]:
    found = []
    for t, x in points:
        try:
            with np.errstate(all="ignore"):
                found.append(float(function(t, variables.state_view(x), variables.parameter_view(values))))
        except Exception:  # whatever the cause, the guard has no value there
            found.append(np.nan)
    return found


def _proportional(heights: Sequence[float], others: Sequence[float]) -> bool:
    with np.errstate(all="ignore"):
        ratios = np.array(heights) / np.array(others)
    # Where only the other one vanishes, the ratio is infinite.
    return bool(np.ptp(ratios) <= SAME * np.abs(ratios).max() < np.inf)


class _Probe(NDArrayOperatorsMixin):
    """A number that remembers the switching functions applied to it.

    A floor of a number with two plus signs in front is a level, as `hybrid.split` writes it: it does not jump
    inside of its mode.
    """

    __slots__ = ("log", "signs", "value")
    __class__ = property(lambda self: np.float64)

    def __init__(self, value: Any, log: Log, signs: int = 0) -> None:
        self.value, self.log, self.signs = value, log, signs

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        if any(type(each) is np.ndarray for each in inputs):
            # Entry by entry: NumPy comes back with single numbers.
            return np.frompyfunc(ufunc, ufunc.nin, 1)(*map(_objects, inputs))
        numbers = [_number(each) for each in inputs]
        is_level = ufunc is np.floor and self.signs == 2
        if ufunc.__name__ in SWITCHING and not is_level:
            self.log.append((ufunc.__name__, _heights(ufunc.__name__, numbers)))
        signs = self.signs + 1 if ufunc is np.positive else 0
        return _Probe(getattr(ufunc, method)(*numbers, **options), self.log, signs)

    def __array_function__(self, function: Callable[..., Any], types: Any, args: Any, kwargs: Any) -> Any:
        plain = [*map(_plain, args)]
        if function is np.clip and len(plain) == 3:
            self.log.append(("clip", _heights("clip", plain)))
        if function in (np.round, np.around):
            self.log.append(("rint", _heights("rint", plain)))
        result = function(*plain, **{name: _plain(each) for name, each in kwargs.items()})
        return _Probe(result, self.log) if np.ndim(result) == 0 else result

    def __getattr__(self, name: str) -> Any:
        # np.cos of an object array calls the method cos of each element.
        ufunc = None if name.startswith("__") else getattr(np, name, None)
        if isinstance(ufunc, np.ufunc):
            return lambda *others: ufunc(self, *others)
        raise AttributeError(name)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __float__(self) -> float:
        return float(self.value)

    def __int__(self) -> int:
        return int(self.value)

    def __round__(self, digits: int | None = None) -> Any:
        return np.round(self, digits or 0)

    def __hash__(self) -> int:
        return hash(self.value)


def _objects(value: Any) -> Any:
    return value if isinstance(value, np.ndarray) else np.array(value, dtype=object)


def _number(value: Any) -> Any:
    return value.value if type(value) is _Probe else value


def _plain(value: Any) -> Any:
    return [_number(each) for each in value] if isinstance(value, list | tuple) else _number(value)


def _heights(name: str, numbers: Sequence[Any]) -> tuple[float, ...]:
    """What vanishes where a function switches."""
    if name in COUNTS:
        return (np.nan,)
    if name == "clip":
        return float(numbers[0] - numbers[1]), float(numbers[0] - numbers[2])
    return (float(numbers[0]) - (0.0 if name in OF_ONE else float(numbers[1])),)
