"""The same system written differently: its runs must not change."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import WholeReset
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import finished
from hybrid.system.laws import Laws
from hybrid.system.variables import PARAMETERS, named_values

AGAIN = " (copy)"


@attrs.frozen(eq=False)
class Altered:
    """A system whose parameters can scale guards, change resets off the guard and cut flows.

    Each mode exists twice with the same field. Crossing the plane ``w . x = c`` leads from one copy to the
    other without a reset. While ``w`` is zero the plane is never crossed.

    Attributes
    ----------
    system
        The altered system; with its parameters as declared it behaves as the original.
    resets_stay
        Whether the original guards and resets are kept because a model function cannot be traced.
    normal, multiples
        Names of the parameters for ``w``, and for the multiples of the guard added to each reset, ``(n,)``.
    offset, factor
        Names of the parameters for ``c``, and for the factor of all guards.
    cuts
        Names of the transitions at the plane.
    original
        Maps each name of a mode or transition, and the name of its copy, to the name in the original.
    """

    system: HybridSystem
    resets_stay: bool
    normal: tuple[str, ...]
    multiples: tuple[str, ...]
    offset: str
    factor: str
    cuts: frozenset[str]
    original: Mapping[str, str]

    def extension(self, multiples: np.ndarray) -> dict[str, float]:
        """Parameters that add multiples ``(n,)`` of the guard to each reset."""
        return dict(zip(self.multiples, multiples, strict=True))

    def cut(self, normal: np.ndarray, offset: float) -> dict[str, float]:
        """Parameters that cut flows where they cross the plane ``normal . x = offset``."""
        return {**dict(zip(self.normal, normal, strict=True)), self.offset: offset}

    def scaled(self, factor: float) -> dict[str, float]:
        """Parameters that multiply every guard by a positive factor."""
        return {self.factor: factor}


_ALTERED: WeakKeyDictionary[HybridSystem, Altered] = WeakKeyDictionary()
_RENAMED: WeakKeyDictionary[HybridSystem, HybridSystem] = WeakKeyDictionary()
_REORDERED: WeakKeyDictionary[HybridSystem, HybridSystem] = WeakKeyDictionary()


def altered(system: HybridSystem) -> Altered:
    """The system with parameters to alter it, cached."""
    if system not in _ALTERED:
        _ALTERED[system] = _altered(finished(system))
    return _ALTERED[system]


def renamed(system: HybridSystem) -> HybridSystem:
    """The system with its modes and transitions renamed to reverse their alphabetical order, cached."""
    if system not in _RENAMED:
        # A mode that has been split, which the system may start in, keeps its name.
        start = system.start
        _RENAMED[system] = attrs.evolve(
            finished(system),
            start=new_name(system.mode_names, start) if start in system.mode_names else start,
            units={},
            outputs={},
            laws=Laws(),
            modes=[attrs.evolve(mode, name=new_name(system.mode_names, mode.name)) for mode in system.modes],
            transitions=[
                attrs.evolve(
                    transition,
                    name=new_name(system.transition_names, transition.name),
                    source=new_name(system.mode_names, transition.source),
                    target=transition.target and new_name(system.mode_names, transition.target),
                    accumulates_to=transition.accumulates_to
                    and new_name(system.mode_names, transition.accumulates_to),
                )
                for transition in system.transitions
            ],
        )
    return _RENAMED[system]


def new_name(names: tuple[str, ...], name: str) -> str:
    """The name of a mode or transition in the renamed system."""
    return f"{len(names) - sorted(names).index(name):03d} {name}"


def reordered(system: HybridSystem) -> HybridSystem:
    """The system with its transitions in reverse order, cached."""
    if system not in _REORDERED:
        _REORDERED[system] = attrs.evolve(finished(system), transitions=system.transitions[::-1])
    return _REORDERED[system]


def _altered(system: HybridSystem) -> Altered:
    stay = bool(compile_system(system).emitted.opaque)
    components = range(system.dimension)
    normal = tuple(free_name(system, f"cut_normal_{i}") for i in components)
    multiples = tuple(free_name(system, f"multiple_of_guard_{i}") for i in components)
    offset, factor = free_name(system, "cut_offset"), free_name(system, "factor_of_guards")

    def plane(t: Any, x: Any, p: Any) -> Any:
        return sum((getattr(p, name) * x[i] for i, name in enumerate(normal)), 0.0) - getattr(p, offset)

    modes: list[Mode] = []
    cuts: list[Transition] = []
    transitions: list[Transition] = []
    unaware = _unaware_of_more(system)

    def whole(reset: Callable[..., Any]) -> Callable[..., Any]:
        return WholeReset(reset, system.variables.components)

    for mode in system.modes:
        field = mode
        if not stay:
            field = attrs.evolve(mode, field=unaware(mode.field), jacobian=unaware(mode.jacobian))
        modes += [field, attrs.evolve(field, name=mode.name + AGAIN)]
        there, back = f"into {mode.name + AGAIN}", f"back into {mode.name}"
        cuts += [
            Transition(mode.name, mode.name + AGAIN, Guard(plane, +1), name=there),
            Transition(mode.name + AGAIN, mode.name, Guard(plane, -1), name=back),
        ]
    holding = {mode.name for mode in system.modes if mode.holds is not None}
    for transition in system.transitions:
        changed = transition if stay else _freed(transition, unaware, whole, factor, multiples)
        if transition.reset is None and not holding.isdisjoint({transition.source, transition.target}):
            # A state that is off what a mode holds by rounding goes on; one that a reset gives has landed.
            changed = attrs.evolve(changed, reset=None)
        again = attrs.evolve(changed, name=changed.name + AGAIN, source=changed.source + AGAIN)
        if transition.source == transition.target:
            again = attrs.evolve(again, target=again.source)
        transitions += [changed, again]
    names = (*system.mode_names, *system.transition_names)
    added = dict.fromkeys((*normal, *multiples), 0.0) | {offset: 1.0, factor: 1.0}
    return Altered(
        attrs.evolve(
            system,
            parameters={**system.parameters, **added},
            modes=modes,
            transitions=[*cuts, *transitions],
            units={},
            outputs={},
            laws=Laws(),
        ),
        stay,
        normal,
        multiples,
        offset,
        factor,
        frozenset(cut.name for cut in cuts),
        {name: name for name in names} | {name + AGAIN: name for name in names},
    )


def free_name(system: HybridSystem, name: str) -> str:
    """A name like this one that neither a parameter nor a component of the state has."""
    taken = {*system.parameters, *system.state_names}
    return next(free for i in range(len(taken) + 1) if (free := name + "_" * i) not in taken)


def _unaware_of_more(system: HybridSystem) -> Callable[[Any], Any]:
    """Return a wrapper that passes a model function only the parameters of the original system."""
    names = tuple(system.parameters)

    def unaware(function: Callable[..., Any] | None) -> Callable[..., Any] | None:
        if function is None:
            return None
        return lambda t, x, p: function(t, x, named_values(PARAMETERS, names, p[: len(names)]))

    return unaware


def _freed(
    transition: Transition,
    unaware: Callable[[Any], Any],
    whole: Callable[[Any], Any],
    factor: str,
    multiples: tuple[str, ...],
) -> Transition:
    """A transition with a factor on its guard, and with multiples of the guard added to its reset."""
    g, gradient = unaware(transition.guard.function), unaware(transition.guard.gradient)
    reset = None if transition.reset is None else unaware(whole(transition.reset.function))

    def scaled_guard(t: Any, x: Any, p: Any) -> Any:
        return getattr(p, factor) * g(t, x, p)

    def scaled_gradient(t: Any, x: Any, p: Any) -> list[Any]:
        return [getattr(p, factor) * slope for slope in gradient(t, x, p)]

    def map_off_guard(t: Any, x: Any, p: Any) -> list[Any]:
        values = x if reset is None else reset(t, x, p)
        added = g(t, x, p)
        return [value + getattr(p, name) * added for value, name in zip(values, multiples, strict=True)]

    # The zeros of a clock are its ticks, whatever the factor.
    guard = transition.clock or Guard(
        scaled_guard,
        transition.guard.direction,
        when=unaware(transition.guard.when),
        at_start=transition.guard.at_start,
        gradient=None if gradient is None else scaled_gradient,
    )
    return attrs.evolve(
        transition,
        guard=guard,
        # A marker stays one, and where a run ends nothing is reset.
        reset=None if transition.is_marker or transition.target is None else Reset(map_off_guard),
    )
