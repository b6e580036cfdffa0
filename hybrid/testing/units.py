"""The same system with state and time in other units: runs must be the same."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.solvers import Solver
from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.derived_clock import DerivedClock
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import WholeReset
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import finished
from hybrid.system.laws import Laws
from hybrid.system.moving import moving_numbers
from hybrid.system.variables import PARAMETERS, STATE, named_values
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard
from hybrid.testing.invariance import compare
from hybrid.testing.variants import free_name

UNITS = "The units of the state and of the time do not matter"

# Units are powers of two up to this exponent, so that they do not change rounding.
LARGEST_EXPONENT = 40
# The unit of the state in one mode alone, in those of the other modes.
UNIT_OF_ONE = 2.0**-10


@attrs.frozen(eq=False)
class Measured:
    """A system whose units are parameters.

    Attributes
    ----------
    system
        The system; with its parameters as declared it equals the original.
    state
        Names of the parameters that hold the units of the state in each mode.
    time
        Name of the parameter that holds the unit of the time.
    """

    system: HybridSystem
    state: tuple[str, ...]
    time: str


_MEASURED: WeakKeyDictionary[HybridSystem, Measured] = WeakKeyDictionary()


def measured(system: HybridSystem) -> Measured:
    """The system with its units as parameters, cached."""
    if system not in _MEASURED:
        _MEASURED[system] = _measured(finished(system))
    return _MEASURED[system]


def check_units(case: Case) -> None:
    """Other units of state and time, with the absolute tolerance in those units, give the same run.

    So does another unit of the state in one mode alone, with resets that convert the state.

    Raises
    ------
    PropertyError
        If the run changes.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_units
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_units(case)
    """
    as_case(case)
    if compile_system(case.system).emitted.opaque:
        discard("a model function cannot be traced, so it cannot be changed")
    exponent = round(LARGEST_EXPONENT * (2.0 * case.fraction - 1.0))
    unit, time = 2.0**exponent, 2.0 ** (-exponent // 2)
    solver = attrs.evolve(case.solver, atol=unit * case.solver.atol, max_step=time * case.solver.max_step)
    modes = case.system.mode_names
    told = f"states are multiplied by {unit:.3g}, times by {time:.3g}"
    _compare_measured(case, dict.fromkeys(modes, unit), time, solver, told)
    free = [name for name in modes if name not in _modes_of_limits(case.system)]
    if len(modes) > 1 and free:
        one = free[int(case.fraction * len(free))]
        units = dict.fromkeys(modes, 1.0) | {one: 1.0 / UNIT_OF_ONE}
        told = f"states in mode {one!r} alone are multiplied by {units[one]:.3g}"
        _compare_measured(case, units, 1.0, case.solver, told)


def _compare_measured(case: Case, units: Mapping[str, float], time: float, solver: Solver, told: str) -> None:
    """Fail if the run is another one with these ``units`` of the state by mode and this unit of the time."""
    variant = measured(case.system)
    end = time * case.run.t1
    assert case.mode is not None, "a case without a mode has no run"
    k = case.system.tangent_dimension
    own = [*(units[case.mode] * value for value in case.x0[:k]), *case.x0[k:]]
    start = time * case.t0, own, case.mode
    extra = dict(zip(variant.state, (units[name] for name in case.system.mode_names), strict=True))
    arc = case.simulate(
        end,
        system=variant.system,
        start=start,
        extra={**extra, variant.time: time},
        solver=solver,
    )
    last = str(arc.mode[-1])
    fired = [jump.transition for jump in arc.jumps]
    hint = f"a threshold that has a unit; {told}."
    x = np.hstack([arc.x[:, :k] / units[last], arc.x[:, k:]])
    compare(case, UNITS, attrs.evolve(arc, x=x), fired, last, hint)


def _modes_of_limits(system: HybridSystem) -> set[str]:
    """Modes that the limit of a chatter joins: it has no reset that could convert the state."""
    pairs = [{each.source, each.accumulates_to} for each in system.transitions if each.accumulates_to]
    return {name for pair in pairs for name in pair if name is not None}


def _measured(system: HybridSystem) -> Measured:
    names = tuple(system.parameters)
    units = {name: free_name(system, f"unit_of_state_{i}") for i, name in enumerate(system.mode_names)}
    time = free_name(system, "unit_of_time")
    k = system.tangent_dimension

    def original(function: Callable[..., Any], mode: str) -> Callable[..., Any]:
        """A model function of the time and of the state in a mode in other units."""

        def called(t: Any, x: Any, p: Any) -> Any:
            unit = getattr(p, units[mode])
            if isinstance(system.state, int):
                place = x / unit
            else:
                place = named_values(STATE, system.state_names, (*(each / unit for each in x[:k]), *x[k:]))
            return function(t / getattr(p, time), place, named_values(PARAMETERS, names, p[: len(names)]))

        return called

    def faster(mode: Mode) -> Callable[..., Any]:
        rates, unit = original(mode.field, mode.name), units[mode.name]
        return lambda t, x, p: [rate * (getattr(p, unit) / getattr(p, time)) for rate in rates(t, x, p)]

    def converted(transition: Transition) -> Reset | None:
        source, target = transition.source, transition.target or transition.source
        if transition.reset is None and source == target:
            return None
        reset = (lambda t, x, p: x) if transition.reset is None else transition.reset.function
        values = original(WholeReset(reset, system.variables.components), source)

        def reset_in_units(t: Any, x: Any, p: Any) -> list[Any]:
            found, unit = list(values(t, x, p)), getattr(p, units[target])
            # A counter has no unit.
            return [*(value * unit for value in found[:k]), *found[k:]]

        return Reset(reset_in_units)

    def period(p: Any) -> Any:
        declared = system.period
        if callable(declared):
            declared = declared(named_values(PARAMETERS, names, p[: len(names)]))
        return getattr(p, time) * declared

    def slower(clock: Clock, mode: str) -> Callable[..., Any]:
        own = original(lambda t, x, p: numbers_of(clock, x, p), mode)

        def numbers(x: Any, p: Any) -> list[Any]:
            return [getattr(p, time) * number for number in own(0.0, x, p)]

        return numbers

    def guard(transition: Transition) -> Guard | Clock:
        own, when = transition.guard, transition.guard.when
        if isinstance(own, Clock):
            asked = None if when is None else original(when, transition.source)
            moving = moving_numbers(transition, system.variables)
            return DerivedClock(own, slower(own, transition.source), asked, own.age, moving)
        return Guard(
            original(own.function, transition.source),
            own.direction,
            when=None if when is None else original(when, transition.source),
            at_start=own.at_start,
        )

    changed = attrs.evolve(
        system,
        parameters={**system.parameters, **dict.fromkeys(units.values(), 1.0), time: 1.0},
        modes=[attrs.evolve(mode, field=faster(mode), jacobian=None) for mode in system.modes],
        transitions=[
            attrs.evolve(each, guard=guard(each), reset=converted(each)) for each in system.transitions
        ],
        period=None if system.period is None else period,
        units={},
        outputs={},
        laws=Laws(),
    )
    return Measured(changed, tuple(units.values()), time)
