"""The functions of a model, each with its optional derivative and its names in error texts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import attrs

from hybrid.errors import ModelError, unknown_name
from hybrid.system.elements import Mode, Transition
from hybrid.system.labels import plain_name
from hybrid.system.variables import STATE

CONDITION = "when"
CLOCK = "clock"


@attrs.frozen
class WholeReset:
    """A user's reset with all components as its value, also where it returns a dict of those that change.

    ``state`` holds the names of the components, or their number.
    """

    function: Callable[..., Any]
    state: tuple[str, ...] | int

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The values after the reset, in order."""
        value = self.function(t, x, p)
        if not isinstance(value, dict):
            return value
        changed = {plain_name(name): each for name, each in value.items()}
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

    @property
    def value(self) -> Callable[..., Any]:
        """The function, which always returns all values."""
        return self.function if self.completed is None else WholeReset(self.function, self.completed)

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


def field_function(mode: Mode, dimension: int) -> ModelFunction:
    """The field of a mode."""
    return ModelFunction(f"Mode {mode.name!r}", "field", mode.field, "jacobian", mode.jacobian, dimension)


def guard_function(transition: Transition) -> ModelFunction:
    """The guard of a transition; of a clock, the time since its nearest tick."""
    guard = transition.guard
    owner = f"Transition {transition.name!r}"
    kind = "guard" if transition.clock is None else CLOCK
    return ModelFunction(owner, kind, guard.function, "gradient", guard.gradient, None)


def condition_function(transition: Transition) -> ModelFunction | None:
    """The condition of a transition's guard; None without a condition."""
    if transition.guard.when is None:
        return None
    return ModelFunction(f"Transition {transition.name!r}", CONDITION, transition.guard.when, "", None, None)


def reset_function(transition: Transition, state: tuple[str, ...] | int) -> ModelFunction | None:
    """The reset of a transition; None for the identity."""
    reset = transition.reset
    if reset is None:
        return None
    owner, n = f"Transition {transition.name!r}", _dimension(state)
    return ModelFunction(owner, "reset", reset.function, "jacobian", reset.jacobian, n, state)


def _dimension(state: tuple[str, ...] | int) -> int:
    return state if isinstance(state, int) else len(state)


def functions_in(
    modes: Sequence[Mode], transitions: Sequence[Transition], state: tuple[str, ...] | int
) -> Iterator[tuple[int, ModelFunction]]:
    """Every model function with the index of its mode or transition, fields first."""
    for index, mode in enumerate(modes):
        yield index, field_function(mode, _dimension(state))
    for index, transition in enumerate(transitions):
        yield index, guard_function(transition)
        condition = condition_function(transition)
        if condition is not None:
            yield index, condition
        reset = reset_function(transition, state)
        if reset is not None:
            yield index, reset
