"""The functions of a model, each with its optional derivative and its names in error texts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import attrs

from hybrid.system.elements import Mode, Transition

CONDITION = "when"


@attrs.frozen
class ModelFunction:
    """One model function: a field, a guard, the condition of a guard, or a reset.

    Parameters
    ----------
    owner
        Mode or transition of the function, as error texts begin: ``"Mode 'flight'"``.
    kind, derivative_name
        Names of the function and its derivative, for example ``"field"`` and ``"jacobian"``.
    value, derivative
        The user's functions of ``(t, x, p)``; ``derivative`` is None if the library derives it, and for a
        condition, which has no derivative.
    size
        Number of values, or None for a scalar.
    """

    owner: str
    kind: str
    value: Callable[..., Any]
    derivative_name: str
    derivative: Callable[..., Any] | None
    size: int | None

    @property
    def identity(self) -> tuple[int, int, int | None]:
        """A key for what is known of the function, valid for as long as the function is kept.

        What the user gives need not be hashable.
        """
        return id(self.value), id(self.derivative), self.size

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
    """The guard of a transition."""
    guard = transition.guard
    owner = f"Transition {transition.name!r}"
    return ModelFunction(owner, "guard", guard.function, "gradient", guard.gradient, None)


def condition_function(transition: Transition) -> ModelFunction | None:
    """The condition of a transition's guard; None without a condition."""
    if transition.guard.when is None:
        return None
    return ModelFunction(f"Transition {transition.name!r}", CONDITION, transition.guard.when, "", None, None)


def reset_function(transition: Transition, dimension: int) -> ModelFunction | None:
    """The reset of a transition; None for the identity."""
    reset = transition.reset
    if reset is None:
        return None
    owner = f"Transition {transition.name!r}"
    return ModelFunction(owner, "reset", reset.function, "jacobian", reset.jacobian, dimension)


def functions_in(
    modes: Sequence[Mode], transitions: Sequence[Transition], dimension: int
) -> Iterator[tuple[int, ModelFunction]]:
    """Every model function with the index of its mode or transition, fields first."""
    for index, mode in enumerate(modes):
        yield index, field_function(mode, dimension)
    for index, transition in enumerate(transitions):
        yield index, guard_function(transition)
        condition = condition_function(transition)
        if condition is not None:
            yield index, condition
        reset = reset_function(transition, dimension)
        if reset is not None:
            yield index, reset
