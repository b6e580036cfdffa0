"""The functions of a model, each with its optional derivative and its names in error texts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import attrs

from hybrid.errors import ModelError, unknown_name
from hybrid.system.clocks import function_of_number
from hybrid.system.elements import Mode, Transition
from hybrid.system.labels import plain_name
from hybrid.system.members import shared_names, spread
from hybrid.system.moving import moving_numbers
from hybrid.system.variables import STATE, Variables

CONDITION = "when"
GUARD = "guard"
CLOCK = "clock"
NUMBER = "number of the clock"
# Functions without a derivative.
VALUES_ALONE = (CONDITION, NUMBER)


@attrs.frozen
class WholeReset:
    """A user's reset with all components as its value, also where it returns a dict of those that change.

    ``state`` holds the names of all components, or their number.
    """

    function: Callable[..., Any]
    state: tuple[str, ...] | int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The values after the reset, in order."""
        value = self.function(t, x, p)
        if not isinstance(value, dict):
            return value
        changed = {plain_name(name): each for name, each in value.items()}
        if not isinstance(self.state, int):
            changed = spread("a dict of what changes", changed, shared_names(self.state), ModelError)
        names = checked_changes(changed, self.state)
        return tuple(changed.get(name, before) for name, before in zip(names, x, strict=True))


def checked_changes(changed: Iterable[Any], state: tuple[str, ...] | int) -> tuple[str, ...]:
    """The names of the state, if all names of changed components are among them.

    Raises
    ------
    ModelError
        If a name does not exist, or the components have none.
    """
    if isinstance(state, int):
        raise ModelError(
            f"a dict of what changes needs names, and the {state} components of this state have none. Return "
            "all components in order, or name them with state=."
        )
    for name in changed:
        if name not in state:
            raise ModelError(unknown_name("State component", name, state, STATE))
    return state


@attrs.frozen
class WholeField:
    """A user's field with the rates of all components: ``still`` components at the end have the rate 0."""

    function: Callable[..., Any]
    still: int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The rates, in order."""
        return (*self.function(t, x, p), *(0.0,) * self.still)


@attrs.frozen
class MovingField:
    """A field with the rates of all components, without those of the components that have none."""

    function: Callable[..., Any]
    moving: int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The rates, in order."""
        return self.function(t, x, p)[: self.moving]


def moving_field(flow: Callable[..., Any], variables: Variables) -> Callable[..., Any]:
    """The field of a mode whose rates of all components are given."""
    return flow if variables.moving == variables.dimension else MovingField(flow, variables.moving)


@attrs.frozen
class WholeDerivative:
    """A user's derivative of which the first ``kept`` rows count; ``memory`` follows."""

    function: Callable[..., Any]
    kept: int
    memory: Callable[[int], list[list[float]]]

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The rows, in order."""
        rows = [*self.function(t, x, p)][: self.kept]
        return [*rows, *self.memory(len(rows[0]))]


@attrs.frozen
class ModelFunction:
    """One model function: a field, a guard, the condition of a guard, or a reset.

    Parameters
    ----------
    owner
        Mode or transition of the function, as error texts begin: ``"Mode 'flight'"``.
    kind, derivative_name
        Names of the function and its derivative, for example ``"field"`` and ``"jacobian"``.
    function, derivative
        The user's functions of ``(t, x, p)``; ``derivative`` is None if the library derives it, and for a
        condition, which has no derivative.
    size
        Number of values, or None for a scalar.
    still
        How many of the values the user's function does not return, the last ones, which are 0: the rates of
        the components of a field that are held or count.
    counted
        How many of the values, the last ones, are counters after a reset: no derivative is taken of them.
    schedules
        Those whose columns the function may read.
    completed
        Names of the state's components, or their number, if the function may return those that change alone:
        that of a reset. Else None.
    """

    owner: str
    kind: str
    function: Callable[..., Any]
    derivative_name: str
    derivative: Callable[..., Any] | None
    size: int | None
    completed: tuple[str, ...] | int | None = None
    still: int = 0
    counted: int = 0
    schedules: tuple[Any, ...] = ()

    @property
    def value(self) -> Callable[..., Any]:
        """The function, which always returns all values."""
        if self.still:
            return WholeField(self.function, self.still)
        return self.function if self.completed is None else WholeReset(self.function, self.completed)

    @property
    def slopes(self) -> Callable[..., Any] | None:
        """The given derivative with a row for every value; those of counters are never the user's."""
        if self.derivative is None or not (self.still or self.counted):
            return self.derivative
        return WholeDerivative(self.derivative, self.kept, self.memory_rows)

    @property
    def returned(self) -> int:
        """Number of values that the user's function returns, and of rows of a derivative that is given."""
        return self.rows - self.still

    @property
    def kept(self) -> int:
        """Number of rows of the derivative that are those of the user's function, the first ones."""
        return self.rows - self.still - self.counted

    def memory_rows(self, columns: int) -> list[list[float]]:
        """The rows of the derivative behind those: zero for rates, of the identity for counters.

        So a jump leaves the last components of a tangent vector, which are zero, as they are, and counters
        change no determinant.
        """
        one = float(self.counted > 0)
        places = range(self.kept, self.rows)
        return [[one if j == i else 0.0 for j in range(columns)] for i in places]

    @property
    def identity(self) -> tuple[int, int, int | None]:
        """A key for what is known of the function, valid for as long as the function is kept.

        What the user gives need not be hashable.
        """
        return id(self.function), id(self.derivative), self.size

    @property
    def rows(self) -> int:
        """Number of rows of the derivative."""
        return 1 if self.size is None else self.size

    @property
    def title(self) -> str:
        """Beginning of error texts about the function."""
        return f"{self.owner}: {self.kind}"

    @property
    def derivative_title(self) -> str:
        """Beginning of error texts about the derivative."""
        return f"{self.owner}: {self.derivative_name}"


def field_function(mode: Mode, variables: Variables) -> ModelFunction:
    """The field of a mode, with the rate 0 of components that have none."""
    n, still = variables.dimension, variables.dimension - variables.moving
    owner = f"Mode {mode.name!r}"
    return ModelFunction(owner, "field", mode.field, "jacobian", mode.jacobian, n, still=still)


def guard_function(transition: Transition) -> ModelFunction:
    """The guard of a transition; of a clock, the time since its nearest tick."""
    guard = transition.guard
    owner = f"Transition {transition.name!r}"
    kind = GUARD if transition.clock is None else CLOCK
    return ModelFunction(owner, kind, guard.function, "gradient", guard.gradient, None)


def number_functions(transitions: Sequence[Transition], variables: Variables) -> list[ModelFunction]:
    """The numbers of clocks that resets may change, in the order of the transitions."""
    return [
        ModelFunction(
            f"Transition {each.name!r}", NUMBER, function_of_number(each.clock, place), "", None, None
        )
        for each in transitions
        if each.clock
        for place in moving_numbers(each, variables)
    ]


def condition_function(transition: Transition) -> ModelFunction | None:
    """The condition of a transition's guard; None without a condition."""
    if transition.guard.when is None:
        return None
    owner = f"Transition {transition.name!r}"
    return ModelFunction(
        owner, CONDITION, transition.guard.when, "", None, None, schedules=schedules_of(transition)
    )


def reset_function(transition: Transition, variables: Variables) -> ModelFunction | None:
    """The reset of a transition; None for the identity."""
    reset = transition.reset
    if reset is None:
        return None
    return ModelFunction(
        f"Transition {transition.name!r}",
        "reset",
        reset.function,
        "jacobian",
        reset.jacobian,
        variables.dimension,
        variables.components,
        counted=len(variables.counters),
        schedules=schedules_of(transition),
    )


def schedules_of(transition: Transition) -> tuple[Any, ...]:
    """The schedule that a transition has in the place of a guard, if it has one."""
    schedule = None if transition.clock is None else transition.clock.schedule
    return () if schedule is None else (schedule,)


def functions_in(
    modes: Sequence[Mode], transitions: Sequence[Transition], variables: Variables
) -> Iterator[tuple[int, ModelFunction]]:
    """Every model function with the index of its mode or transition, fields first."""
    for index, mode in enumerate(modes):
        yield index, field_function(mode, variables)
    yield from enumerate(number_functions(transitions, variables))
    for index, transition in enumerate(transitions):
        yield index, guard_function(transition)
        condition = condition_function(transition)
        if condition is not None:
            yield index, condition
        reset = reset_function(transition, variables)
        if reset is not None:
            yield index, reset
