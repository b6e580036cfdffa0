"""A delay: a clock that ticks so long after each jump of other transitions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import attrs

from hybrid import arguments
from hybrid.errors import ModelError
from hybrid.system.clocks import Clock, Quantity, as_quantity, check_when, in_few_words

# Each place is a component of the state, and resets move them all: more would take minutes to compile.
MOST_PLACES = 100


def _as_trigger(value: Any) -> tuple[str, ...]:
    names = (value,) if isinstance(value, str) else value
    found = tuple(arguments.items("Delay: trigger", names, "be the name of a transition, or several names"))
    for i, each in enumerate(found):
        arguments.instance(f"Delay: trigger[{i}]", each, str, "Give the names of transitions.")
    if not found or "" in found:
        raise ModelError("Delay: trigger must name at least one transition; got an empty name or none.")
    return tuple(dict.fromkeys(found))


def _as_duration(value: Any) -> Quantity:
    return as_quantity("Delay", "duration", value)


def _as_places(value: Any) -> int:
    places = arguments.count("Delay: places", value, 1)
    if places > MOST_PLACES:
        raise arguments.refusal("Delay: places", f"be at most {MOST_PLACES}", value)
    return places


@attrs.frozen
class Delay(Clock):
    """A clock that ticks so long after each jump of other transitions, in the place of a guard.

    Each jump of a transition that ``trigger`` names begins a wait. Several may be under way; those that end
    at the same instant each fire. A wait that ends in a mode that no transition with this trigger and
    duration leaves is over: its tick is missed. Such transitions of different modes share their waits.

    What is under way is part of the state. The system has more components for it, behind those of its author
    and 0 in a start that leaves them out: nothing is under way. ``system.under_way`` has their names.

    Parameters
    ----------
    trigger
        Name of the transition that is followed, or several names. It may be the transition itself, or one
        with a clock.
    duration
        A number in units of time, at least 0, the name of a parameter or of what resets alone change (a held
        component, a counter), or a function of ``p``, which has both. It counts as it is right after the jump
        of the trigger. With 0, or less from a reset, the transition fires at once after that jump.
    places
        How many may be under way. One more ends the run with the status ``DELAY_FULL``.
    when
        Optional condition ``c(t, x, p)``, as that of a `Guard`: a tick without it is passed over.

    Raises
    ------
    ModelError
        If a name is empty, the duration is negative or not finite, ``places`` is no number from 1 on, or
        ``when`` is not a function. In a system, if the trigger does not exist or ends the run, or the
        duration reads a component that has a field.

    Examples
    --------
    >>> import hybrid
    >>> relay = hybrid.HybridSystem(
    ...     state=("y",),
    ...     counters=("n",),
    ...     modes=[hybrid.Mode("run", lambda t, x, p: (1.0,))],
    ...     transitions=[
    ...         hybrid.Transition(
    ...             "run",
    ...             "run",
    ...             hybrid.Guard(lambda t, x, p: x.y - 1.0, direction=+1),
    ...             hybrid.Reset(lambda t, x, p: {"y": 0.0}),
    ...             name="spike",
    ...         ),
    ...         hybrid.Transition(
    ...             "run",
    ...             "run",
    ...             hybrid.Delay("spike", 1.5),
    ...             hybrid.Reset(lambda t, x, p: {"n": x.n + 1}),
    ...             name="arrive",
    ...         ),
    ...     ],
    ... )
    >>> arc = hybrid.simulate(relay, {"y": 0.5}, (0.0, 4.0))
    >>> [round(jump.t, 9) for jump in arc.jumps["arrive"]], arc["n"][-1].item()
    ([2.0, 3.0, 4.0], 3.0)
    """

    trigger: tuple[str, ...] = attrs.field(converter=_as_trigger)
    duration: Quantity = attrs.field(converter=_as_duration)
    places: int = attrs.field(default=8, kw_only=True, converter=_as_places)
    when: Callable[..., Any] | None = attrs.field(default=None, kw_only=True, validator=check_when)
    number: ClassVar[int] = 5
    reads_time: ClassVar[bool] = False

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """The duration."""
        return (self.duration,)

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        return f"{in_few_words(self.duration)} after {' or '.join(map(repr, self.trigger))}"

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since the tick after a jump at time 0."""
        return t - numbers[0]

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the duration."""
        [duration] = numbers
        right = 0.0 <= duration < math.inf
        return "" if right else f"duration must be finite and not negative; got {duration:.6g}"
