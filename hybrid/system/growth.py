"""Systems that grow: modes that are made when a run reaches them.

A system that has been split may have thousands of modes, of which a run visits a few. It begins with some of
them. A transition into a mode that has not been made yet ends the run with `Unexplored`; the call is then
repeated with a larger system. Systems stay immutable: each is one stage of its growth.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, cast
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid.arguments import misplaced_refusal, misplaced_tolerances

P = ParamSpec("P")
R = TypeVar("R")


# Time, state and parameters.
Place = tuple[float, np.ndarray, np.ndarray]


class Growth(Protocol):
    """What makes further modes of a system.

    Attributes
    ----------
    original
        The user's system.
    written
        What the compiler has made of the functions of earlier stages.
    """

    original: Any
    written: dict[Any, Any]

    @property
    def told(self) -> Mapping[str, str]:
        """By transition: why a run ends there, in words."""
        return {}

    @property
    def ambiguous(self) -> Mapping[str, str]:
        """By transition: names of what happens there at once, if another order would lead elsewhere."""
        return {}

    @property
    def current(self) -> Any:
        """The system with all modes that have been made so far."""
        ...

    def leads_on(self, transition: str) -> bool:
        """Whether a transition leads to a mode that the system lacks."""
        ...

    def extend(self, transition: str, place: Place, known: Collection[str]) -> bool:
        """Make what follows a transition that has ended a run at a place; False if nothing does.

        ``known`` are the transitions of the stage that ran: another thread may have made more since.
        """
        ...

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Make the modes in which a run may start; whether there were any to be made."""
        ...

    def mode_at(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> str | None:
        """The mode in which a run starts that is asked to start in ``mode``; None if the guards tell it."""
        return mode


class Finished(Growth):
    """The growth of a system that is made from one stage of another, and stays as it is.

    Transitions that stood for modes to be made end its runs.

    Attributes
    ----------
    of
        What made the modes of the stage; it knows what they stand for.
    """

    original = None

    def __init__(self, of: Growth | None = None) -> None:
        self.written: dict[Any, Any] = {}
        self.of = of

    def __reduce__(self) -> tuple[Any, ...]:
        return Finished, ()

    @property
    def current(self) -> None:
        """The system that has this growth."""
        return None

    def leads_on(self, transition: str) -> bool:
        """Any transition that ends a run may have stood for modes to be made."""
        return True

    def extend(self, transition: str, place: Place, known: Collection[str]) -> bool:
        """Nothing is made."""
        return False

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Nothing is made."""
        return False


def finished(system: Any) -> Any:
    """A system with the modes that it has; nothing that is made from it has more."""
    if system.growth is None or isinstance(system.growth, Finished):
        return system
    if system not in _FINISHED:
        _FINISHED[system] = attrs.evolve(system, growth=Finished(system.growth))
    return _FINISHED[system]


def stage_of(system: Any) -> Any:
    """The latest stage of a system that grows; others are their own."""
    found = None if system.growth is None else system.growth.current
    return system if found is None else found


def grows(value: object) -> bool:
    """Whether an object can make further modes of a system."""
    methods = ("leads_on", "extend", "place")
    is_object = not isinstance(value, type) and isinstance(getattr(value, "written", None), dict)
    return is_object and all(callable(getattr(value, name, None)) for name in methods)


# One object for each stage, so that what is compiled for one call serves the next.
_FINISHED: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()


class Unexplored(Exception):
    """A run needs modes that have been made only now."""


def growing(function: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Any, P], R]:
    """Repeat a call until its system has all modes that the call needs.

    The first argument is the system; a result therefore belongs to a system that has every mode it visits.
    """
    misplaced = misplaced_tolerances(function)

    @wraps(function)
    def call(system: Any, *args: P.args, **kwargs: P.kwargs) -> R:
        if not misplaced.isdisjoint(kwargs):
            raise misplaced_refusal(function, misplaced, kwargs)
        # The function itself refuses what is no system.
        growth = None if isinstance(system, type) else getattr(system, "growth", None)
        while growth is not None:
            try:
                return function(stage_of(system), *args, **kwargs)
            except Unexplored:
                continue
        return function(system, *args, **kwargs)

    return cast("Callable[Concatenate[Any, P], R]", call)
