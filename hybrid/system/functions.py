"""The functions of a model, each with the derivative that may come with it and the words to name it by."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import attrs

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem, Mode, Transition


CONDITION = "when"


@attrs.frozen
class Role:
    """One model function: a field, a guard, the condition of a guard, or a reset.

    Parameters
    ----------
    owner
        Whose it is, as an error text begins: ``"Mode 'flight'"``.
    name, derivative_name
        What the function and its derivative are called: ``"field"`` and ``"jacobian"``.
    function, derivative
        The user's functions of ``(t, x, p)``; ``derivative`` is None where it is to be derived. A condition
        has none.
    size
        Number of values, or None for a scalar.
    """

    owner: str
    name: str
    function: Callable[..., Any]
    derivative_name: str
    derivative: Callable[..., Any] | None
    size: int | None

    @property
    def rows(self) -> int:
        """Number of rows of the derivative."""
        return 1 if self.size is None else self.size

    @property
    def title(self) -> str:
        """How an error text about the function begins."""
        return f"{self.owner}: {self.name}"

    @property
    def derivative_title(self) -> str:
        """How an error text about the derivative begins."""
        return f"{self.owner}: {self.derivative_name}"


def field_role(system: HybridSystem, mode: Mode) -> Role:
    """The field of a mode."""
    return Role(f"Mode {mode.name!r}", "field", mode.field, "jacobian", mode.jacobian, system.dimension)


def guard_role(transition: Transition) -> Role:
    """The guard of a transition."""
    guard = transition.guard
    return Role(f"Transition {transition.name!r}", "guard", guard.function, "gradient", guard.gradient, None)


def condition_role(transition: Transition) -> Role | None:
    """The condition of a guard, None if it has none."""
    if transition.guard.when is None:
        return None
    return Role(f"Transition {transition.name!r}", CONDITION, transition.guard.when, "", None, None)


def reset_role(system: HybridSystem, transition: Transition) -> Role | None:
    """The reset of a transition, None if that is the identity."""
    reset = transition.reset
    if reset is None:
        return None
    owner = f"Transition {transition.name!r}"
    return Role(owner, "reset", reset.function, "jacobian", reset.jacobian, system.dimension)


def indexed_roles(system: HybridSystem) -> Iterator[tuple[int, Role]]:
    """Every model function with the index of its mode or transition, fields first."""
    for index, mode in enumerate(system.modes):
        yield index, field_role(system, mode)
    for index, transition in enumerate(system.transitions):
        yield index, guard_role(transition)
        condition = condition_role(transition)
        if condition is not None:
            yield index, condition
        reset = reset_role(system, transition)
        if reset is not None:
            yield index, reset


def roles(system: HybridSystem) -> Iterator[Role]:
    """Every model function of a system, fields first."""
    return (role for _, role in indexed_roles(system))
