"""The elements of a graph: guards, resets, modes and transitions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ModelError, shown
from hybrid.system.clocks import Clock
from hybrid.system.portable import Portable

Function = Callable[..., Any]
# Node of the graph that means the end of a run.
END = "(end)"


def _callable(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if not callable(value):
        owner = type(instance).__name__
        raise ModelError(f"{owner}: {attribute.name} must be a function of (t, x, p); got {shown(value)}.")


def _optional_callable(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None:
        _callable(instance, attribute, value)


def _optional_name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if value is not None:
        _nonempty_name(instance, attribute, value)


def _nonempty_name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    if not isinstance(value, str) or not value:
        raise ModelError(
            f"{type(instance).__name__}: {attribute.name} must be a non-empty string; got {shown(value)}."
        )


@attrs.frozen
class Guard(Portable):
    """A scalar function ``g(t, x, p)``; the transition fires when ``g`` crosses zero in ``direction``.

    Parameters
    ----------
    function
        ``g(t, x, p)``, one scalar.
    direction
        -1 fires from positive to negative, +1 from negative to positive, 0 in both directions.
    gradient
        Optional ``(D_x g, D_t g)`` as a function of ``(t, x, p)`` that returns ``n + 1`` values, or
        ``n`` if the guard does not depend on time, with a column for every component of ``x``. Derived from
        ``function`` if omitted.
    when
        Optional condition ``c(t, x, p)``, a scalar or a comparison: a crossing fires only if the condition
        is positive (or true) there, and is ignored otherwise. The condition is evaluated only at crossings,
        and on entry to the mode if the state is already on or beyond the guard. It need not be continuous.
    at_start
        If True, crossings are not searched for: the transition fires only if a run starts in the mode with
        the state beyond the guard by more than rounding. ``direction`` says which side is beyond. Of several
        that a start lies beyond, each fires, in listed order, while the run stays in the mode.

    Raises
    ------
    ModelError
        If a given function is not callable, ``direction`` is not -1, 0 or +1, or ``at_start`` is not a bool
        or is True while ``direction`` is 0.

    Examples
    --------
    >>> import hybrid
    >>> ground = hybrid.Guard(lambda t, x, p: x.q, direction=-1)
    >>> ground.direction
    -1
    >>> hard = hybrid.Guard(lambda t, x, p: x.q, direction=-1, when=lambda t, x, p: x.v < -1.0)
    """

    function: Function = attrs.field(validator=_callable)
    direction: int = attrs.field(default=0)
    gradient: Function | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    when: Function | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    at_start: bool = attrs.field(default=False, kw_only=True)

    @at_start.validator
    def _check_at_start(self, attribute: attrs.Attribute[bool], value: object) -> None:
        if not isinstance(value, bool):
            raise ModelError(f"Guard: at_start must be True or False; got {shown(value)}.")
        if value and self.direction == 0:
            raise ModelError(
                "Guard: at_start=True needs direction -1 or +1, the side that the mode excludes."
            )

    @direction.validator
    def _check_direction(self, attribute: attrs.Attribute[int], value: object) -> None:
        if arguments.whole_number(value) not in (-1, 0, 1):
            raise ModelError(
                f"Guard: direction must be -1 (falling), 0 (both) or +1 (rising); got {shown(value)}."
            )


@attrs.frozen
class Reset(Portable):
    """The map ``R(t, x, p)`` applied at the crossing.

    It returns one value per state, or a dict of those that change. The state that it receives lies beyond the
    guard, by a few units in the last place.

    Parameters
    ----------
    function
        ``R(t, x, p)``, ``n`` values, or a dict of the components that change, such as ``{"v": -p.e * x.v}``.
        It gives held components and counters too; a counter stays a whole number.
    jacobian
        Optional ``(t, x, p)`` function that returns the rows of ``D_x R``, each of ``n`` values, or of
        ``n + 1`` with ``D_t R`` last. Derived from ``function`` if omitted. Rows and columns of counters are
        not used.

    Raises
    ------
    ModelError
        If a given function is not callable.

    Examples
    --------
    >>> import hybrid
    >>> bounce = hybrid.Reset(lambda t, x, p: {"v": -p.e * x.v})
    >>> both = hybrid.Reset(lambda t, x, p: (0.0, -p.e * x.v))
    """

    function: Function = attrs.field(validator=_callable)
    jacobian: Function | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)


@attrs.frozen
class Mode(Portable):
    """A smooth vector field ``f(t, x, p)``: a node of the graph.

    Parameters
    ----------
    name
        Name by which transitions refer to the mode.
    field
        ``f(t, x, p)``, one value per state: the time derivative of the state. What the system declares as
        held or as a counter has none.
    jacobian
        Optional ``(t, x, p)`` function that returns the rows of ``D_x f``, one per value of the field, each
        of ``n`` values, a column for every component of ``x``, or of ``n + 1`` with ``D_t f`` last. Derived
        from ``field`` if omitted.
    holds
        Optional ``(t, x, p)`` function that returns what the mode keeps at zero, such as the length of a taut
        rope less its own and the rate of it. Tangent vectors that begin in the mode are projected onto the
        directions that it allows; the exponents and multipliers of the others are minus infinity and zero.
    part_of
        Name of the mode that this one is a part of, in a system that has been split; else None.

    Raises
    ------
    ModelError
        If the name is empty or a given function is not callable.

    Examples
    --------
    >>> import hybrid
    >>> flight = hybrid.Mode("flight", lambda t, x, p: (x.v, -p.g))
    >>> flight.name
    'flight'
    """

    name: str = attrs.field(validator=_nonempty_name)
    field: Function = attrs.field(validator=_callable)
    jacobian: Function | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    holds: Function | None = attrs.field(default=None, kw_only=True, validator=_optional_callable)
    part_of: str | None = attrs.field(default=None, kw_only=True, validator=_optional_name)


def _as_guard(value: Any) -> Guard | Clock:
    if isinstance(value, Guard | Clock):
        return value
    raise ModelError(
        f"Transition: guard must be a Guard or a clock; got {shown(value)}. Write Guard(function, "
        "direction=...), Every(period), At(times), After(duration) or Delay(trigger, duration)."
    )


def _as_reset(value: Any) -> Reset | None:
    if value is None or isinstance(value, Reset):
        return value
    raise ModelError(
        f"Transition: reset must be a Reset or None (identity); got {shown(value)}. Write Reset(function)."
    )


@attrs.frozen
class Transition(Portable):
    """An edge of the graph: from a source mode to a target mode, with a guard and a reset.

    A transition from a mode to itself without a reset changes nothing: it only marks a crossing, as a
    section does.

    Parameters
    ----------
    source, target
        Names of modes. If the target is ``None``, the run ends where the transition fires, with the status
        ``TERMINAL``.
    guard
        When the transition fires: a `Guard`, or a clock, one of `Every`, `At`, `After` and `Delay`.
    reset
        Map of the state at the jump; ``None`` is the identity.
    accumulates_to
        Mode in which the run continues after infinitely many jumps in finite time (chatter), of this
        transition alone or of several in turn. If several fire in turn, only one of them has to name the
        mode. If none does, the run ends at the limit.
    name
        Defaults to ``"source->target"``, and to ``"source->(end)"`` without a target.
    part_of
        Name of the transition that this one is a copy of, in a system that has been split; None for one
        between two parts of a mode, and in other systems.

    Raises
    ------
    ModelError
        If guard or reset are of the wrong type, a name is empty, there is a reset but no target, or
        ``accumulates_to`` is the mode that the transition leads from and back to.

    Examples
    --------
    >>> import hybrid
    >>> ground = hybrid.Guard(lambda t, x, p: x.q, direction=-1)
    >>> rebound = hybrid.Reset(lambda t, x, p: {"v": -p.e * x.v})
    >>> bounce = hybrid.Transition("flight", "flight", ground, rebound, name="bounce")
    >>> landing = hybrid.Transition("flight", "rest", ground)
    >>> bounce.name, landing.name, landing.is_marker
    ('bounce', 'flight->rest', False)
    """

    source: str = attrs.field(validator=_nonempty_name)
    target: str | None = attrs.field(validator=_optional_name)
    guard: Guard | Clock = attrs.field(converter=_as_guard)
    reset: Reset | None = attrs.field(default=None, converter=_as_reset)
    accumulates_to: str | None = attrs.field(default=None, kw_only=True, validator=_optional_name)
    name: str = attrs.field(kw_only=True, validator=_nonempty_name)
    part_of: str | None = attrs.field(default=None, kw_only=True, validator=_optional_name)

    @reset.validator
    def _check_reset(self, attribute: attrs.Attribute[Reset | None], value: object) -> None:
        if value is not None and self.target is None:
            raise ModelError(
                f"Transition {self.source}->{END}: a reset has no effect without a target. "
                "Omit the reset, or name a target mode."
            )

    @accumulates_to.validator
    def _check_limit(self, attribute: attrs.Attribute[str | None], value: object) -> None:
        if value is not None and self.target is None:
            raise ModelError(
                f"Transition {self.source}->{END}: accumulates_to={value!r} is for transitions whose jumps "
                "may accumulate, and this one ends the run. Omit it, or name a target mode."
            )

        if value is not None and value == self.source == self.target:
            raise ModelError(
                f"Transition {self.source}->{self.target}: accumulates_to={value!r} is the mode in which the "
                "jumps accumulate: there they would begin again. Name a mode whose field stays on the guard."
            )

    @name.default
    def _default_name(self) -> str:
        target = END if self.target is None else self.target
        if not (isinstance(self.source, str) and isinstance(target, str)):
            return ""  # their validators, which run later, say so
        return f"{self.source}->{target}"

    @property
    def clock(self) -> Clock | None:
        """The clock that the transition has in the place of a guard, if it has one."""
        return self.guard if isinstance(self.guard, Clock) else None

    @property
    def is_searched(self) -> bool:
        """Whether crossings of the guard are searched for: not those of a clock, or of a start alone."""
        return isinstance(self.guard, Guard) and not self.guard.at_start

    @property
    def is_marker(self) -> bool:
        """Whether the transition changes neither mode nor state, and only marks a crossing."""
        return self.source == self.target and self.reset is None
