"""Clocks: transitions that fire at known times, in the place of a guard."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ModelError, shown
from hybrid.system.members import groups_in, is_component_name
from hybrid.system.portable import Portable
from hybrid.system.variables import PARAMETERS, named_values

# A number, the name of a parameter or of what resets alone change, or a function of ``p``, which has both.
Quantity = Any


def as_quantity(kind: str, name: str, value: Any) -> Quantity:
    """A quantity as the user gave it, checked as far as it can be without parameters."""
    if callable(value) or is_component_name(value):
        return value
    number = None if isinstance(value, bool | str) else arguments.floats(value)
    if number is None or number.shape != () or not math.isfinite(number):
        raise ModelError(
            f"{kind}: {name} must be a finite number, the name of a parameter, or a function of p; got "
            f"{shown(value)}."
        )
    return float(number)


def read(quantity: Quantity, x: Any, p: Any) -> Any:
    """The value of a quantity at a state and parameters."""
    if isinstance(quantity, float):
        return quantity
    if isinstance(quantity, str) and quantity in p._fields:
        return getattr(p, quantity)
    given = Given(x, p)
    return getattr(given, quantity) if isinstance(quantity, str) else quantity(given)


class Given:
    """What the quantities of a clock read by name: parameters, and what resets alone change of the state."""

    __slots__ = ("p", "x")

    def __init__(self, x: Any, p: Any) -> None:
        self.x, self.p = x, p

    def __getattr__(self, name: str) -> Any:
        fields = getattr(self.x, "_fields", ())
        if name in groups_in(fields):
            # Members have parameters, and components besides.
            both = named_values(PARAMETERS, (*self.p._fields, *fields), (*self.p, *self.x))
            return getattr(both, name)
        held = name not in self.p._fields and name in fields
        return getattr(self.x if held else self.p, name)

    def __iter__(self) -> Any:
        return iter(self.p)

    def __len__(self) -> int:
        return len(self.p)

    def __getitem__(self, place: Any) -> Any:
        return self.p[place]


@attrs.frozen(eq=False)
class NumberOf:
    """One of the numbers of a clock as a function of ``(t, x, p)``."""

    clock: Any
    place: int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The number; it does not depend on time."""
        return self.clock._numbers(x, p)[self.place]


def function_of_number(clock: Clock, place: int) -> NumberOf:
    """The number of a clock in a place as a function, always the same object."""
    return clock._functions.setdefault(place, NumberOf(clock, place))


def numbers_of(clock: Clock, x: Any, p: Any) -> tuple[Any, ...]:
    """The numbers of a clock at a state and parameters."""
    return clock._numbers(x, p)


def ticks_of(clock: Clock, x: Any, p: Any) -> tuple[Sequence[float], Any]:
    """The numbers of a clock as kernels get them, and the row of a schedule that each belongs to, if any."""
    return clock._ticks(x, p)


def fault_of(clock: Clock, numbers: Sequence[float], moving: bool = False) -> str:
    """What is wrong with the numbers of a clock, in words; empty if they are right.

    Of those that resets change, ``moving``, a duration may be zero or negative: then it is over at once.
    """
    return clock._fault(numbers, moving)


def in_few_words(quantity: Quantity) -> str:
    """A quantity in few words."""
    if isinstance(quantity, float):
        return f"{quantity:.6g}"
    return quantity if isinstance(quantity, str) else "f(p)"


@attrs.frozen
class Since:
    """The guard of a clock as a function: the time since the nearest tick."""

    clock: Any

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The time since the nearest tick, negative before it."""
        age = self.clock.age
        return self.clock._since_tick(t if age is None else x[age], self.clock._numbers(x, p))


@attrs.frozen(eq=False)
class Clock(Portable):
    """What clocks have in common: each is a guard whose zeros in time are known, so none is searched for.

    As a guard it is the time since its nearest tick, with the gradient that moves the tick with what its
    numbers depend on.
    """

    # Clocks as the kernels number them.
    number: ClassVar[int] = 0
    direction: ClassVar[int] = 1
    gradient: ClassVar[None] = None
    at_start: ClassVar[bool] = False
    counts_from_entry: ClassVar[bool] = False
    # Whether it counts from each entry, or only from one from another mode.
    restarts: ClassVar[bool] = True
    # The component of the state that is the time since the entry of the mode, if there is one.
    age: ClassVar[int | None] = None
    # Whether it ticks at given times, so that its system depends on time.
    reads_time: ClassVar[bool] = True
    # The places of the numbers that resets may change, where they do not follow from what the author wrote.
    moving: ClassVar[tuple[int, ...] | None] = None

    # The clock as a guard.
    function: Callable[..., Any] = attrs.field(
        init=False, eq=False, repr=False, default=attrs.Factory(Since, takes_self=True)
    )

    _functions: dict[int, NumberOf] = attrs.field(init=False, eq=False, repr=False, factory=dict)

    def __attrs_post_init__(self) -> None:
        # Numbers that depend on parameters are checked by the run.
        if all(isinstance(quantity, float) for quantity in self.quantities):
            fault = self._fault(self.quantities)
            if fault:
                raise ModelError(f"{type(self).__name__}: {fault}.")

    # The table whose columns the reset reads, if there is one.
    schedule: ClassVar[Any] = None

    @property
    def kind(self) -> str:
        """What its author wrote, by name."""
        return type(self).__name__

    @property
    def when(self) -> Callable[..., Any] | None:
        """The condition of a tick, if there is one."""
        raise NotImplementedError

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The numbers of the clock, as they were given."""
        raise NotImplementedError

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        raise NotImplementedError

    def _numbers(self, x: Any, p: Any) -> tuple[Any, ...]:
        """The numbers of the clock at a state and parameters."""
        return tuple([read(quantity, x, p) for quantity in self.quantities])

    def _ticks(self, x: Any, p: Any) -> tuple[Sequence[float], Any]:
        """The numbers as kernels get them, and the row of a schedule that each belongs to, if any."""
        return self._in_order(self._numbers(x, p))

    def _in_order(self, numbers: Sequence[Any]) -> tuple[Sequence[float], Any]:
        """The same from numbers in the order of ``quantities``."""
        return tuple(map(float, numbers)), None

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since the nearest tick, negative before it, at the clock's numbers."""
        raise NotImplementedError

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the numbers of the clock, in words; empty if they are right."""
        raise NotImplementedError


def _as_period(value: Any) -> Quantity:
    return as_quantity("Every", "period", value)


def _as_offset(value: Any) -> Quantity:
    return as_quantity("Every", "offset", value)


def _as_duration(value: Any) -> Quantity:
    return as_quantity("After", "duration", value)


def _as_restarts(value: Any) -> bool:
    return arguments.flag("After: restarts", value)


def check_when(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    """ModelError unless a condition is a function."""
    if value is not None and not callable(value):
        raise ModelError(
            f"{type(instance).__name__}: when must be a function of (t, x, p); got {shown(value)}."
        )


@attrs.frozen
class Every(Clock):
    """A clock that ticks at ``offset + k period`` for every whole number ``k``, in the place of a guard.

    Ticks are exact: no root is searched for, and none drifts however many there are. A tick at the start of
    a run does not fire, one at its end does. A clock fires once at one instant, also if its mode is entered
    at the instant of a tick; clocks that tick together, up to the rounding of their numbers, fire in the
    order in which the transitions are listed.

    Parameters
    ----------
    period, offset
        Numbers in units of time, names of parameters or of what resets alone change (held components,
        counters), or functions of ``p``, which has both; the period is positive.
    when
        Optional condition ``c(t, x, p)``, as that of a `Guard`: a tick without it is passed over.

    Raises
    ------
    ModelError
        If a number is not finite, the period is not positive, or ``when`` is not a function.

    Examples
    --------
    >>> import hybrid
    >>> switch_off = hybrid.Transition("on", "off", hybrid.Every("T", offset=lambda p: p.d * p.T))
    >>> switch_off.guard.period
    'T'
    """

    period: Quantity = attrs.field(converter=_as_period)
    offset: Quantity = attrs.field(default=0.0, converter=_as_offset)
    when: Callable[..., Any] | None = attrs.field(default=None, kw_only=True, validator=check_when)
    number: ClassVar[int] = 1

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Period and offset."""
        return self.period, self.offset

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        return f"every {in_few_words(self.period)}"

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since the nearest tick."""
        period, offset = numbers
        return t - offset - period * np.floor((t - offset) / period + 0.5)

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with period and offset."""
        period, offset = numbers
        if not 0.0 < period < math.inf:
            return f"period must be positive and finite; got {period:.6g}"
        return "" if math.isfinite(offset) else f"offset must be finite; got {offset:.6g}"


@attrs.frozen
class After(Clock):
    """A clock that ticks once, so long after its mode was entered, in the place of a guard.

    The start of a run is an entry. A transition from the mode to itself enters it anew, unless it has no
    reset and so changes nothing; with ``restarts=False`` it does not count as an entry. For derivatives, the
    time since the entry is one more component of the state, the age; orbits and branches whose points lie in
    such a mode show it as their last component but for counters.

    Parameters
    ----------
    duration
        A positive number in units of time, the name of a parameter or of what resets alone change (a held
        component, a counter), or a function of ``p``, which has both. One that a reset makes zero, or shorter
        than the time that has passed, is over at once.
    when
        Optional condition ``c(t, x, p)``, as that of a `Guard`: a tick without it is passed over.
    restarts
        Whether a transition from the mode to itself begins the duration anew, as a watchdog wants it. If
        False, the clock counts from the entry from another mode, or from the start of the run.

    Raises
    ------
    ModelError
        If the duration is not positive and finite, ``when`` is not a function, or ``restarts`` is not a bool.

    Examples
    --------
    >>> import hybrid
    >>> recovered = hybrid.Transition("rest", "rise", hybrid.After("refractory"))
    >>> recovered.guard.duration
    'refractory'
    """

    duration: Quantity = attrs.field(converter=_as_duration)
    when: Callable[..., Any] | None = attrs.field(default=None, kw_only=True, validator=check_when)
    restarts: bool = attrs.field(default=True, kw_only=True, converter=_as_restarts)  # type: ignore[misc]
    counts_from_entry: ClassVar[bool] = True
    reads_time: ClassVar[bool] = False

    @property
    def number(self) -> int:  # type: ignore[override]
        """Of those that count from each entry, or from one from another mode."""
        return 3 if self.restarts else 4

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The duration."""
        return (self.duration,)

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        return f"after {in_few_words(self.duration)}"

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since the tick of a mode that was entered at time 0."""
        return t - numbers[0]

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the duration."""
        [duration] = numbers
        if moving:
            return "" if math.isfinite(duration) else f"duration must be finite; got {duration:.6g}"
        right = 0.0 < duration < math.inf
        return "" if right else f"duration must be positive and finite; got {duration:.6g}"
