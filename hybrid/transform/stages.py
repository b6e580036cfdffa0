"""What systems share that make their modes in stages."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from itertools import chain, count
from threading import RLock
from typing import Any

from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Growth


class Stages(Growth):
    """Keeps the latest stage, and the transitions that stand for what has not been made."""

    def __init__(self) -> None:
        self.lock = RLock()
        self.written: dict[Any, Any] = {}
        self.stage: HybridSystem | None = None
        self.frontier: dict[str, Any] = {}

    @property
    def current(self) -> HybridSystem:
        """The system with all modes that have been made so far."""
        with self.lock:
            self.stage = self.stage or self._assembled()
            return self.stage

    def leads_on(self, transition: str) -> bool:
        """Whether a transition, or the limit of its chatter, leads to what the system lacks."""
        return transition in self.frontier

    @abstractmethod
    def _assembled(self) -> HybridSystem:
        """The system of what has been made."""


def numbered(name: str) -> Iterator[str]:
    """A name, then the same with a number, for the first that is free."""
    return chain([name], (f"{name} ({k})" for k in count(2)))
