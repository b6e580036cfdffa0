"""Checks of arguments: each returns the value in the library's form, or raises an ArgumentError.

Every error text begins with the name of the argument and says what is allowed and what was given. Strings,
booleans and complex numbers are not accepted as numbers.
"""

from __future__ import annotations

import functools
import inspect
import sys
from collections.abc import Callable, Iterable, Mapping, Set
from math import inf, isfinite, ulp
from numbers import Real
from typing import Any, ParamSpec, TypeVar
from unicodedata import normalize

import numpy as np

from hybrid.errors import ArgumentError, unknown_name
from hybrid.errors import shown as shown

Kind = TypeVar("Kind")
Given = ParamSpec("Given")
SOLVER_OPTIONS = ("rtol", "atol", "max_step", "max_steps")
# Of these a list is known to hold real numbers, without looking at each.
_PLAIN = {float, int}
LARGEST_COUNT = int(np.iinfo(np.int64).max)


def refusal(name: str, wanted: str, value: object) -> ArgumentError:
    """The error for a value that is not allowed; ``wanted`` says what is."""
    return ArgumentError(f"{name} must {wanted}; got {shown(value)}.{without_units(value)}")


def has_units(value: object) -> bool:
    """Whether a value, its data or an item of it carries units, as those of pint and astropy do.

    NumPy would drop the units: 1000 mm would become 1000.
    """
    if _is_quantity(value):
        return True
    if isinstance(value, Mapping):
        return any(map(_is_quantity, value.values()))
    if isinstance(value, list | tuple):
        return any(map(_is_quantity, value))
    xarray = sys.modules.get("xarray")
    return xarray is not None and isinstance(value, xarray.DataArray) and _is_quantity(value.data)


def _is_quantity(value: object) -> bool:
    kind = type(value)
    return hasattr(kind, "to") and (hasattr(kind, "units") or hasattr(kind, "unit"))


def without_units(value: object) -> str:
    """What to do with a value that carries units; empty for others."""
    if not has_units(value):
        return ""
    return " Give plain numbers in the units of the model, such as value.to('m').magnitude."


def number(name: str, value: object) -> float:
    """A finite number."""
    found = _as_float(value)
    if found is None:
        raise refusal(name, "be a number", value)
    if not isfinite(found):
        raise refusal(name, "be finite", found)
    return found


def positive(name: str, value: object, wanted: str = "be positive", *, infinite: bool = False) -> float:
    """A number above zero; infinity only if ``infinite``."""
    found = _as_float(value)
    if found is None or not found > 0 or not (infinite or isfinite(found)):
        raise refusal(name, wanted, value)
    return found


def not_negative(name: str, value: object, wanted: str = "be at least 0", *, infinite: bool = False) -> float:
    """A number of at least zero; infinity only if ``infinite``."""
    found = _as_float(value)
    if found is None or not found >= 0 or not (infinite or isfinite(found)):
        raise refusal(name, wanted, value)
    return found


def result(what: str, value: float) -> float:
    """A result that must be finite and not zero; else the arguments are too far apart for floats."""
    if not isfinite(value) or value == 0.0:
        raise ArgumentError(
            f"{what} is {value}: the arguments are too large, too small or too far apart for floating point. "
            "Use other units."
        )
    return value


def count(name: str, value: object, least: int, most: int = LARGEST_COUNT, of: str = "") -> int:
    """A whole number from ``least`` to ``most``; ``of`` says what ``most`` is."""
    whole = whole_number(value)
    if whole is None or not least <= whole <= most:
        bounded = most < LARGEST_COUNT or (whole is not None and whole > most)
        allowed = f"from {least} to {most}{of}" if bounded else f"of at least {least}"
        raise refusal(name, f"be a whole number {allowed}", value)
    return whole


def whole_number(value: object) -> int | None:
    """A whole number as an int; None for anything else."""
    # NumPy's duration is a subclass of its integers.
    if not isinstance(value, int | np.integer) or isinstance(value, bool | np.timedelta64):
        return None
    return int(value)


def index(name: str, value: object, length: int) -> int:
    """An index of a sequence, which may count from its end, as one that counts from the begin."""
    whole = whole_number(value)
    if whole is None or not -length <= whole < length:
        raise refusal(name, f"be a whole number from {-length} to {length - 1}", value)
    return whole % length


def flag(name: str, value: object) -> bool:
    """True or False."""
    if not isinstance(value, bool | np.bool_):
        raise refusal(name, "be True or False", value)
    return bool(value)


def numbers(name: str, value: object, wanted: str) -> np.ndarray:
    """Numbers as a new array of floats, with their shape."""
    found = floats(value)
    if found is None:
        raise refusal(name, wanted, value)
    return found


def time_span(name: str, value: object) -> tuple[float, float]:
    """A pair of finite times, the second not before the first."""
    if type(value) is tuple and len(value) == 2 and type(value[0]) is type(value[1]) is float:
        t0, t1 = value
    else:
        # A set has no order.
        pair = None if isinstance(value, Set) else floats(value)
        if pair is None or pair.shape != (2,):
            raise refusal(name, "be a pair (t0, t1) of numbers", value)
        t0, t1 = pair.tolist()
    if not (isfinite(t0) and isfinite(t1)):
        raise ArgumentError(f"{name} must be finite; got ({t0}, {t1}).")
    if t1 < t0:
        raise ArgumentError(
            f"{name} must not run backwards; got ({t0}, {t1}). Write ({t1}, {t0}), "
            "or reverse the sign of the fields."
        )
    return t0, t1


def span_around(name: str, value: object, parameter: str, at: float) -> tuple[float, float]:
    """The ends of a range that contains the value ``at`` of a parameter, but for rounding."""
    ends = numbers(name, value, "be (low, high)")
    # The range is a unit: its square has to be a number.
    if ends.shape != (2,) or not np.all(np.abs(ends) < 1e150):
        raise refusal(name, "be (low, high)", value)
    low, high = ends.tolist()
    if within(np.array([at]), low, high) is None or not low < high:
        raise ArgumentError(f"{name} must be (low, high) around {parameter} = {at}; got {shown(value)}.")
    return min(low, at), max(high, at)


def within(times: np.ndarray, t0: float, t1: float) -> np.ndarray | None:
    """Numbers that lie in ``[t0, t1]`` but for the rounding of sums and products, put into it; else None.

    Ten times 0.1 is 1.0 or the number before it, as it is computed: either means the end of a run to 1.0.
    """
    if not times.size:
        return times
    least, most = float(times.min()), float(times.max())
    return _put_within(times, least, most, t0, t1)


def _put_within(times: np.ndarray, least: float, most: float, t0: float, t1: float) -> np.ndarray | None:
    """As `within`, for numbers of which the least and the largest one are known."""
    if t0 <= least and most <= t1:
        return times
    rounding = 4 * ulp(max(abs(t0), abs(t1)))
    return np.clip(times, t0, t1) if t0 - rounding <= least and most <= t1 + rounding else None


def increasing_times(name: str, value: object, t0: float, t1: float) -> np.ndarray:
    """Times ``(N,)`` within ``[t0, t1]`` that never decrease; equal times are allowed."""
    times = numbers(name, value, "be increasing times of shape (N,)")
    found = None
    if times.ndim == 1 and (times.size < 2 or bool((times[1:] >= times[:-1]).all())):
        found = _put_within(times, times.item(0), times.item(-1), t0, t1) if times.size else times
    if found is None:
        raise _fault_of_times(name, times, t0, t1)
    return found


def _fault_of_times(name: str, times: np.ndarray, t0: float, t1: float) -> ArgumentError:
    """What is wrong with times that do not increase within ``[t0, t1]``."""
    if times.ndim != 1:
        return ArgumentError(f"{name} must be increasing times of shape (N,); got shape {times.shape}.")
    finite = np.isfinite(times)
    if not finite.all():
        i = int(np.argmin(finite))
        return ArgumentError(f"{name} must be finite; got {name}[{i}] = {times[i]}.")
    falls = np.flatnonzero(times[1:] < times[:-1])
    if falls.size:
        i = int(falls[0])
        return ArgumentError(
            f"{name} must be increasing times; got {name}[{i}] = {times[i]} before "
            f"{name}[{i + 1}] = {times[i + 1]}. Sort them, with numpy.sort for instance."
        )
    return ArgumentError(
        f"{name} must lie in t_span, [{t0}, {t1}]; got times from {times[0]} to {times[-1]}."
    )


def mapping(name: str, value: object, wanted: str = "map names to numbers") -> dict[Any, Any]:
    """A mapping as a new dictionary; empty for None."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise refusal(name, wanted, value)
    return dict(value)


def items(name: str, value: object, wanted: str, *, least: int = 0) -> list[Any]:
    """The items of a collection, ``least`` or more; a string is not a collection here."""
    if not isinstance(value, Iterable) or isinstance(value, str | bytes | bytearray):
        raise refusal(name, wanted, value)
    try:
        found = list(value)
    except Exception as error:  # a zero-dimensional array, or what only promises to be a collection
        raise refusal(name, wanted, value) from error
    if len(found) < least:
        raise refusal(name, wanted, value)
    return found


def instance(name: str, value: object, kind: type[Kind], hint: str = "") -> Kind:
    """An object of a class; ``hint`` says how to get one."""
    if isinstance(value, kind):
        return value
    article = "an" if kind.__name__[0] in "AEIO" else "a"
    text = f"{name} must be {article} {kind.__name__}; got {shown(value)}."
    raise ArgumentError(f"{text} {hint}" if hint else text)


def function(name: str, value: object, signature: str) -> Callable[..., Any]:
    """Something that can be called."""
    if not callable(value):
        raise refusal(name, f"be a function of {signature}", value)
    return value


def one_of(name: str, value: object, allowed: tuple[Any, ...]) -> Any:
    """One of a few values."""
    for each in allowed:
        if value is each or (isinstance(value, str) and value == each):
            return each
    *others, last = (f'"{each}"' if isinstance(each, str) else repr(each) for each in allowed)
    raise refusal(name, f"be {', '.join(others)} or {last}", value)


def known(what: str, value: object, allowed: Iterable[str], kind: str) -> str:
    """A name that exists; in the error text ``what`` comes first and ``kind`` heads the list of names."""
    names = list(allowed)
    if not isinstance(value, str) or value not in names:
        # Python reads names in source text in this form.
        plain = normalize("NFKC", value) if isinstance(value, str) else None
        if plain in names:
            return str(plain)
        raise ArgumentError(unknown_name(what, value, names, kind))
    return value


def without_tolerances(function: Callable[Given, Kind]) -> Callable[Given, Kind]:
    """A function that says where tolerances belong if it is given some: to the solver."""
    misplaced = misplaced_tolerances(function)

    @functools.wraps(function)
    def call(*args: Given.args, **kwargs: Given.kwargs) -> Kind:
        if not misplaced.isdisjoint(kwargs):
            raise misplaced_refusal(function, misplaced, kwargs)
        return function(*args, **kwargs)

    return call


def misplaced_tolerances(function: Callable[..., Any]) -> frozenset[str]:
    """The options of solvers that a function does not have itself."""
    return frozenset(SOLVER_OPTIONS) - inspect.signature(function).parameters.keys()


def misplaced_refusal(
    function: Callable[..., Any], misplaced: Set[str], given: Mapping[str, Any]
) -> ArgumentError:
    """The error for options of a solver that were given to a function: where they belong."""
    name = next(name for name in SOLVER_OPTIONS if name in misplaced and name in given)
    return ArgumentError(
        f"{function.__name__}: {name}= is an option of the solver. Write "
        f"solver=Taylor({name}={shown(given[name])}), or another solver such as DOP853."
    )


def _as_float(value: object) -> float | None:
    """A real number as a float (infinity if it is too large); None for anything else."""
    if type(value) is float:
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool | np.bool_ | np.timedelta64) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return -inf if value < 0 else inf
    except Exception:  # whatever a class of the caller raises when it is converted
        return None


def floats(value: object) -> np.ndarray | None:
    """Real numbers as a new array of floats; None if any item is not a real number."""
    if isinstance(value, np.ndarray):
        if np.ma.is_masked(value) or (type(value) is not np.ndarray and has_units(value)):
            return None
        if value.dtype.kind in "fiu":
            return np.array(value, dtype=float)
        if value.dtype.kind in "mM":  # an array of objects would hold their counts of a unit of time
            return None
    elif isinstance(value, list | tuple) and _PLAIN.issuperset(map(type, value)):
        try:
            return np.array(value, dtype=float)
        except OverflowError:  # an integer beyond the largest float
            pass
    if isinstance(value, bytes | bytearray) or has_units(value):
        return None
    try:
        given = np.array(value, dtype=object)
    except Exception:  # whatever an object of the caller raises when it is converted or iterated
        return None
    found = [_as_float(each) for each in given.ravel()]
    if any(each is None for each in found):
        return None
    return np.array(found, dtype=float).reshape(given.shape)
