"""A clock whose numbers are read from a state or parameters that another system adds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import attrs

from hybrid.system.clocks import Clock, Quantity


@attrs.frozen
class DerivedClock(Clock):
    """A clock in a system that was made from another one.

    ``read(x, p)`` gives its numbers, from a state that may hold what were parameters, or in other units.
    Those in the places ``moving`` depend on what resets change.
    ``age`` is the component of the state that is the time since the entry of the mode, if there is one.
    """

    clock: Clock
    read: Callable[[Any, Any], Sequence[Any]]
    when: Callable[..., Any] | None
    age: int | None = None  # type: ignore[misc]
    moving: tuple[int, ...] = ()  # type: ignore[misc]

    @property
    def kind(self) -> str:
        """That of the original."""
        return self.clock.kind

    @property
    def number(self) -> int:  # type: ignore[override]
        """That of the original."""
        return self.clock.number

    @property
    def counts_from_entry(self) -> bool:  # type: ignore[override]
        """As the original."""
        return self.clock.counts_from_entry

    @property
    def reads_time(self) -> bool:  # type: ignore[override]
        """As the original."""
        return self.clock.reads_time

    @property
    def restarts(self) -> bool:  # type: ignore[override]
        """As the original."""
        return self.clock.restarts

    @property
    def schedule(self) -> Any:
        """That of the original."""
        return self.clock.schedule

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Those of the original."""
        return self.clock.quantities

    @property
    def told(self) -> str:
        """When the clock ticks, in few words."""
        return self.clock.told

    def _numbers(self, x: Any, p: Any) -> tuple[Any, ...]:
        """The numbers of the clock at a state and parameters."""
        return tuple(self.read(x, p))

    def _ticks(self, x: Any, p: Any) -> tuple[Sequence[float], Any]:
        """The numbers as kernels get them."""
        return self.clock._in_order(self._numbers(x, p))

    def _since_tick(self, t: Any, numbers: Sequence[Any]) -> Any:
        """Time since the nearest tick."""
        return self.clock._since_tick(t, numbers)

    def _fault(self, numbers: Sequence[float], moving: bool = False) -> str:
        """What is wrong with the numbers, in words."""
        return self.clock._fault(numbers, moving)
