"""Every model function fits the units that the system declares; this needs no run."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import combinations
from math import isclose, isfinite, isinf, nan
from typing import Any

import attrs
import numpy as np

from hybrid.display.tables import NO_UNIT
from hybrid.expression.operations import FUNCTIONS, OfNumber
from hybrid.expression.values import values_of
from hybrid.expression.vocabulary import TRUTHS, WHERE, named
from hybrid.system.functions import CONDITION
from hybrid.system.graph import HybridSystem, as_system, functions_of
from hybrid.system.watched import is_of_library
from hybrid.testing.errors import PropertyError, discard
from hybrid.transform.contacts.contact import Contact
from hybrid.transform.contacts.growth import contacts_of
from hybrid.transform.contacts.statuses import FREE
from hybrid.transform.pairs.growth import pairs_of

DIMENSIONS = "The units of every function fit"

# Title of the field of free flight, which masses and forces make.
FREE_FIELD = f"Mode {FREE!r}: field"

# A message lists at most this many faults, and this many arguments for each value.
MOST_FAULTS, MOST_NAMES = 5, 8
# Exponents and sizes of units are compared up to rounding.
ROUNDING = 1e-9
# Factors in the code without a unit.
PURE = (0.5, 1.0, 2.0)
# Nm, Ns and Nms are products, but pint reads Nm as "number meter", a unit of yarn.
NEWTON = re.compile(r"\b([kMm]?N)(?=[ms])(m?)(s?)\b(?!\s*(?:\^|\*\*|[²³⁻]))")

# The arguments of these functions have one unit.
ALIKE = {
    "add": "{0} is added to {1}",
    "subtract": "{1} is subtracted from {0}",
    WHERE: "a choice between {0} and {1}",
    **{name: f"{name} of {{0}} and {{1}}" for name in ("remainder", "fmod", "hypot", "arctan2", "clip")},
    **{name: f"{name} of {{0}} and {{1}}" for name in ("maximum", "minimum", "fmax", "fmin")},
    **dict.fromkeys((name for name in TRUTHS if "logical" not in name), "{0} is compared with {1}"),
}
OF_NUMBERS = {each.numpy.__name__ for each in FUNCTIONS if OfNumber in each.__bases__}
GIVING_NUMBERS = {"arctan2", "sign", "heaviside"} | OF_NUMBERS | TRUTHS
KEEPING = {"negative", "positive", "absolute", "fabs", "conjugate", "floor", "ceil", "trunc", "rint"}
POWERS = {"square": 2.0, "sqrt": 0.5, "cbrt": 1.0 / 3.0, "reciprocal": -1.0}
TURNED = dict.fromkeys(("radians", "deg2rad"), "rad/deg") | dict.fromkeys(("degrees", "rad2deg"), "deg/rad")


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


@cache
def unit_of(text: str) -> Any:
    """The unit of pint that a text names; None if pint cannot read the text."""
    written = "1" if text.strip() in NO_UNIT else text.replace("Ohm", "ohm")
    written = NEWTON.sub(lambda found: f"({'*'.join(filter(None, found.groups()))})", written)
    registry = _registry()
    try:
        # Inside a product pint takes degC as a difference of temperatures, which is measured in K.
        unit = registry.parse_units(f"({written})*rad") / registry.parse_units("rad")
        unit = registry.parse_units(str(unit).replace("delta_degree_Celsius", "kelvin"))
    except Exception:
        return None
    return None if "number_meter" in str(unit) else unit


@cache
def _factor(unit: Any) -> float | None:
    """The number that a unit without a dimension stands for, such as pi/180; None if it has a dimension."""
    if any(abs(exponent) > ROUNDING for exponent in unit.dimensionality.values()):
        return None
    return float((1.0 * unit).to_base_units().magnitude)


@attrs.frozen
class Quantity:
    """What is known of the unit of a value."""

    # The unit of pint; None if not even the dimension is known.
    unit: Any
    # Whether the size of the unit is known.
    sized: bool = True
    # The value of a number in the code, nan if it is one of several; None for other values. Such a number may
    # have any unit.
    literal: float | None = None
    # The arguments that the value is computed from.
    names: tuple[str, ...] = ()

    def fits(self, other: Quantity) -> bool:
        """Whether the two may be added, as far as their units are known."""
        if self.literal is not None or other.literal is not None or self.unit is None or other.unit is None:
            return True
        factor, sized = _factor(self.unit / other.unit), self.sized and other.sized
        return factor is not None and (not sized or isclose(factor, 1.0, rel_tol=ROUNDING))

    def told(self, before: str = "") -> str:
        """The unit in short symbols with ``before`` in front of it, and the arguments."""
        unit = f"{self.unit:~D}".replace(" ** ", "^").replace("Δ", "")
        names = f" ({', '.join(self.names)})" if self.names else ""
        return (before + unit if unit else "a pure number") + names


class UnitAlgebra:
    """Traced numbers as quantities; ``faults`` lists the operations whose units do not fit."""

    def __init__(self) -> None:
        self.faults: list[str] = []

    def number(self, value: Any) -> Quantity:
        """A number in the code."""
        return Quantity(unit_of(""), literal=float(value))

    def expression(self, content: Quantity) -> Quantity:
        """The content itself."""
        return content

    def combined(self, name: str, contents: tuple[Quantity, ...]) -> Quantity:
        """The unit of a function of NumPy."""
        literals = [each.literal for each in contents]
        if None not in literals:
            with np.errstate(all="ignore"):
                return self.number(named(name)(*literals))
        names = dict.fromkeys(each for content in contents for each in content.names)
        return attrs.evolve(self._result(name, contents), names=tuple(names)[:MOST_NAMES])

    def looked_up(self, pieces: Any, content: Quantity, derived: int) -> Quantity:
        """The unit of a table's values is not known."""
        return Quantity(None)

    def _result(self, name: str, contents: tuple[Quantity, ...]) -> Quantity:
        pure, first = Quantity(unit_of("")), contents[0]
        common = self._common(name, contents[name == WHERE :]) if name in ALIKE else Quantity(None)
        if name in OF_NUMBERS and not first.fits(pure):
            self.faults.append(f"{name} of {first.told()}")
        if name in GIVING_NUMBERS:
            return pure
        if name in KEEPING:
            return first
        if name in ("multiply", "divide", "floor_divide"):
            return _product(first, contents[1], 1 if name == "multiply" else -1)
        if name in ("power", "float_power"):
            return _power(first, contents[1])
        if name in POWERS:
            return _power(first, self.number(POWERS[name]))
        if name in TURNED and first.unit is not None:
            # An angle without a unit may be one in degrees.
            return Quantity(first.unit * unit_of(TURNED[name]), first.sized and first.unit != pure.unit)
        return common

    def _common(self, name: str, contents: tuple[Quantity, ...]) -> Quantity:
        """The unit of values that are added, compared or chosen from."""
        for one, other in combinations(contents, 2):
            if not one.fits(other):
                self.faults.append(ALIKE[name].format(one.told(), other.told()))
                return Quantity(None)
        others = [each for each in contents if each.literal is None]
        if others:
            return max(others, key=lambda each: (each.unit is not None, each.sized))
        literals = {each.literal for each in contents}
        return attrs.evolve(contents[0], literal=literals.pop() if len(literals) == 1 else nan)


def _product(one: Quantity, other: Quantity, sign: int) -> Quantity:
    """A product, or a quotient for the sign -1."""
    for each in (one, other):
        if each.literal is not None and (each.literal == 0.0 or isinf(each.literal)):
            return each
    if one.unit is None or other.unit is None or not (_is_pure(one) and _is_pure(other)):
        return Quantity(None)
    return Quantity(one.unit * other.unit if sign > 0 else one.unit / other.unit, one.sized and other.sized)


def _is_pure(factor: Quantity) -> bool:
    """Whether a factor is not a number in the code that may have a unit, or convert one, as 9.81 and 60."""
    return factor.literal is None or abs(factor.literal) in PURE


def _power(base: Quantity, exponent: Quantity) -> Quantity:
    if exponent.literal is not None and isfinite(exponent.literal):
        return base if base.unit is None else Quantity(base.unit**exponent.literal, base.sized)
    pure = Quantity(unit_of(""), base.sized and exponent.sized)
    known = all(each.unit is not None and each.fits(pure) for each in (base, exponent))
    return pure if known else Quantity(None)


def check_dimensions(system: HybridSystem) -> None:
    """Every model function fits the units of the system, which is found by computing with units.

    The values of a field have the units of the state per time, those of a reset the units of the state, a
    period has the unit of time, and an output the one that it is given. What is added or compared has one
    unit; the argument of a sine or of an exponential is a pure number. A parameter without a unit is a pure
    number. A number in the code may have any unit, but for the factors 1, 2 and 1/2. Functions that cannot be
    traced, and texts that pint cannot read, are left out.

    Raises
    ------
    PropertyError
        If units do not fit.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import check_dimensions
    >>> check_dimensions(models.bouncing_ball())
    """
    as_system("system", system)
    missing = [name for name in (*system.state_names, "t") if name not in system.units]
    if missing:
        discard(f"units= lacks {missing[0]}" if system.units else "units= is not given")
    found = [_faults(system, *wanted) for wanted in _wanted(system)]
    if all(faults is None for faults in found):
        discard("no model function can be traced")
    faults = [*dict.fromkeys(fault for faults in found for fault in faults or ())]
    if faults:
        more = [f"and {len(faults) - MOST_FAULTS} more"] if len(faults) > MOST_FAULTS else []
        told = "\n".join(f"  {line}" for line in [*faults[:MOST_FAULTS], *more])
        without = ", ".join(name for name in system.parameters if name not in system.units)
        raise PropertyError(
            f"{DIMENSIONS}: this does not hold for {system.name or 'the system'}.\n{told}\n"
            "  likely: a factor or a power that is missing; degrees where radians are meant (np.radians); or "
            "a wrong unit in units=."
            + (f" Parameters without a unit count as pure numbers: {without}." if without else "")
        )


def _wanted(system: HybridSystem) -> Iterator[tuple[str, Callable[..., Any], dict[str, Quantity]]]:
    """Each function of ``(t, x, p)`` with its title, and with the names and the units of its values."""
    time = Quantity(unit_of(system.units["t"]))
    state = {name: Quantity(unit_of(system.units[name])) for name in system.state_names}
    growth, pairs = contacts_of(system), pairs_of(system)
    if growth is not None:
        yield from _of_contacts(system, growth.contacts, time)
    for _, function in functions_of(system):
        if growth is not None and function.title != FREE_FIELD:
            # Made from what is checked; what pulls a gap back to zero has the pace of the motion as a number.
            continue
        if function.kind == "reset" and is_of_library(function.function):
            # The projection onto a surface, whose gradient may have components of several units.
            continue
        kind, wanted, value = function.kind, {}, function.value
        if kind == "field":
            wanted = {f"the derivative of {name}": _product(unit, time, -1) for name, unit in state.items()}
        elif kind == "reset":
            wanted = {f"the new {name}": unit for name, unit in state.items()}
        title = "condition" if kind == CONDITION else kind
        if kind == "field" and pairs is not None:
            # What draws a state back has the pace of the motion as a number.
            value = pairs.field_of(function.owner)
        yield f"{title} of {function.owner[0].lower()}{function.owner[1:]}", value, wanted
    derived = {} if growth is None else growth.mechanics.outputs
    for name, output in system.outputs.items():
        if name in derived:
            continue
        wanted = {"the value": Quantity(unit_of(system.units[name]))} if name in system.units else {}
        for formula in output.formulas:
            title = output.title(formula)
            yield f"{title[0].lower()}{title[1:]}", formula.function, wanted
    period: Any = system.period
    if callable(period):
        yield "period", lambda t, x, p: period(p), {"the value": time}


def _of_contacts(
    system: HybridSystem, contacts: Sequence[Contact], time: Quantity
) -> Iterator[tuple[str, Callable[..., Any], dict[str, Quantity]]]:
    """The functions of contacts: a slip has the unit of its gap per time, coefficients are pure numbers."""
    for each in contacts:
        title = f"contact {each.name!r}"
        yield f"gap of {title}", each.gap, {}
        gap = _first_value(system, each.gap)
        if each.slip is not None:
            wanted = {} if gap is None else {"the slip": _product(gap, time, -1)}
            yield f"slip of {title}", each.slip, wanted
        for what in ("restitution", "friction", "static"):
            given = getattr(each, what)
            if isinstance(given, str):
                yield f"{what} of {title}", _parameter(given), {"the coefficient": Quantity(unit_of(""))}
            elif callable(given):
                yield f"{what} of {title}", given, {"the coefficient": Quantity(unit_of(""))}


def _parameter(parameter: str) -> Callable[..., Any]:
    """The model function that is a parameter."""
    return lambda t, x, p: getattr(p, parameter)


def _first_value(system: HybridSystem, function: Callable[..., Any]) -> Quantity | None:
    """The unit of a function of one value; None if it cannot be traced."""
    found = _computed(system, function, UnitAlgebra())
    return None if not found else found[0]


def _faults(
    system: HybridSystem, title: str, function: Callable[..., Any], wanted: dict[str, Quantity]
) -> list[str] | None:
    """What does not fit in a function; None if the function cannot be traced."""
    algebra = UnitAlgebra()
    values = _computed(system, function, algebra)
    if values is None:
        return None
    for value, (what, unit) in zip(values, wanted.items(), strict=False):
        if not value.fits(unit):
            algebra.faults.append(f"{what} is {value.told('in ')}, wanted {unit.told()}")
    return [f"{title}: {fault}" for fault in algebra.faults]


def _computed(
    system: HybridSystem, function: Callable[..., Any], algebra: UnitAlgebra
) -> list[Quantity] | None:
    """The values of a function with their units; None if the function cannot be traced."""
    units, names = system.units, tuple(system.parameters)
    before = "" if isinstance(system.state, int) else "x."
    t = Quantity(unit_of(units["t"]), names=("t",))
    x = [Quantity(unit_of(units[name]), names=(before + name,)) for name in system.state_names]
    p = [Quantity(unit_of(units.get(name, "")), names=(f"p.{name}",)) for name in names]
    try:
        return list(values_of(function, system.variables.components, names, algebra, (t, x, p)))
    except Exception:
        return None
