"""Features of runs: what a caller asks of the last stretch of a run, to tell attractors apart by it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.measures.asked import answer
from hybrid.measures.measure import Measure
from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem

WANTED = "be a function of an arc, several of them, or a mapping of names to functions of an arc"


@attrs.frozen(eq=False)
class Features:
    """Functions of an arc by name, and how far apart attractors are.

    Attributes
    ----------
    functions
        They give one number each of a run that has settled.
    together
        Distances by name within which two runs are together; None if the runs themselves are to say it.
    """

    functions: dict[str, Callable[[HybridArc], float]]
    together: dict[str, float] | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the features, in order."""
        return tuple(self.functions)

    @property
    def apart(self) -> np.ndarray | None:
        """The distances ``(F,)`` of ``together``, if there are any."""
        if self.together is None:
            return None
        return np.array([self.together[name] for name in self.functions])

    def of(self, arc: HybridArc, where: str) -> np.ndarray:
        """The features of a stretch of a run ``(F,)``; some may be infinite or nan.

        Raises
        ------
        ArgumentError
            If a function raises an error, or gives something other than one number.
        """
        found = np.empty(len(self.functions))
        for i, (name, function) in enumerate(self.functions.items()):
            title = f"features[{name!r}]"
            given = answer(title, function, arc, where)
            number = arguments.floats(given)
            if number is None or number.ndim:
                wanted = "give one number of a run (name several numbers in a mapping)"
                raise arguments.refusal(title, wanted, given)
            found[i] = number
        return found

    def units(self, system: HybridSystem) -> list[str]:
        """Units of the features, empty where none is known."""
        return [
            (each.unit(system) or "") if isinstance(each, Measure) else "" for each in self.functions.values()
        ]


def checked_features(features: object, together: object) -> Features | None:
    """What ``features=`` and ``together=`` ask for; None if there are no features."""
    if features is None:
        if together is not None:
            raise ArgumentError(
                f"together is a distance of features; got {arguments.shown(together)} without features=. "
                "Give features=, or leave it out."
            )
        return None
    functions = _by_name(features)
    return Features(functions, None if together is None else _distances(together, functions))


def _by_name(given: object) -> dict[str, Any]:
    if isinstance(given, Mapping):
        named: list[tuple[Any, Any]] = list(given.items())
    elif callable(given):
        named = [(_name(given), given)]
    else:
        listed = arguments.items("features", given, WANTED, least=1)
        named = [(_name(each), each) for each in listed]
    if not named:
        raise arguments.refusal("features", WANTED, given)
    found: dict[str, Any] = {}
    for name, function in named:
        if not isinstance(name, str) or not name:
            raise arguments.refusal("features: each name", "be a text", name)
        arguments.function(f"features[{name!r}]", function, "an arc")
        if name in found:
            raise ArgumentError(
                f"features: two functions have the name {name!r}. Name them in a mapping, such as "
                '{"peak": maximum("x")}.'
            )
        found[name] = function
    return found


def _name(function: object) -> str:
    if isinstance(function, Measure):
        return f"{function.kind} of {function.name}"
    name = str(getattr(function, "__name__", "feature"))
    return "feature" if name == "<lambda>" else name


def _distances(given: object, functions: Mapping[str, object]) -> dict[str, float]:
    wanted = "be a positive distance of features, or map each feature to one"
    if not isinstance(given, Mapping):
        return dict.fromkeys(functions, arguments.positive("together", given, wanted))
    for name in given:
        arguments.known("together: Feature", name, functions, "Features")
    missing = [name for name in functions if name not in given]
    if missing:
        raise ArgumentError(f"together must name every feature; it lacks {', '.join(missing)}.")
    return {name: arguments.positive(f"together[{name!r}]", given[name], wanted) for name in functions}
