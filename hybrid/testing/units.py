"""The same system with state and time in other units: runs must be the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import attrs

from hybrid.compiler.compiled import compile_system
from hybrid.system.elements import Guard, Reset
from hybrid.system.functions import WholeReset
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import PARAMETERS, STATE, named_values
from hybrid.testing.case import Case, as_case, discard
from hybrid.testing.invariance import compare
from hybrid.testing.variants import free_name

UNITS = "The units of the state and of the time do not matter"

# Units are powers of two up to this exponent, so that they do not change rounding.
LARGEST_EXPONENT = 40


@attrs.frozen(eq=False)
class Measured:
    """A system whose units are parameters.

    Attributes
    ----------
    system
        The system; with its parameters as declared it equals the original.
    state, time
        Names of the parameters that hold the units of the state and of the time.
    """

    system: HybridSystem
    state: str
    time: str


_MEASURED: WeakKeyDictionary[HybridSystem, Measured] = WeakKeyDictionary()


def measured(system: HybridSystem) -> Measured:
    """The system with its units as parameters, cached."""
    if system not in _MEASURED:
        _MEASURED[system] = _measured(system)
    return _MEASURED[system]


def check_units(case: Case) -> None:
    """Other units of state and time, with the absolute tolerance in those units, give the same run.

    Raises
    ------
    PropertyError
        If the run changes.
    """
    as_case(case)
    if compile_system(case.system).emitted.opaque:
        discard("a model function cannot be traced, so it cannot be changed")
    run, variant = case.run, measured(case.system)
    exponent = round(LARGEST_EXPONENT * (2.0 * case.fraction - 1.0))
    state, time = 2.0**exponent, 2.0 ** (-exponent // 2)
    solver = attrs.evolve(case.solver, atol=state * case.solver.atol, max_step=time * case.solver.max_step)
    start = time * case.t0, [state * value for value in case.x0], case.mode
    arc = case.simulate(
        time * run.t1,
        system=variant.system,
        start=start,
        extra={variant.state: state, variant.time: time},
        solver=solver,
    )
    compare(
        case,
        UNITS,
        attrs.evolve(arc, x=arc.x / state),
        [jump.transition for jump in arc.jumps],
        str(arc.mode[-1]),
        f"a threshold that has a unit; states are multiplied by {state:.3g}, times by {time:.3g}.",
    )


def _measured(system: HybridSystem) -> Measured:
    names = tuple(system.parameters)
    state, time = free_name(system, "unit_of_state"), free_name(system, "unit_of_time")
    n = system.dimension

    def original(function: Callable[..., Any]) -> Callable[..., Any]:
        """A model function of the state and the time in other units."""

        def called(t: Any, x: Any, p: Any) -> Any:
            unit = getattr(p, state)
            if isinstance(system.state, int):
                place = x / unit
            else:
                place = named_values(STATE, system.state, [x[i] / unit for i in range(n)])
            return function(t / getattr(p, time), place, named_values(PARAMETERS, names, p[: len(names)]))

        return called

    def faster(field: Callable[..., Any]) -> Callable[..., Any]:
        rates = original(field)
        return lambda t, x, p: [rate * (getattr(p, state) / getattr(p, time)) for rate in rates(t, x, p)]

    def longer(reset: Callable[..., Any]) -> Callable[..., Any]:
        values = original(WholeReset(reset, system.state))
        return lambda t, x, p: [value * getattr(p, state) for value in values(t, x, p)]

    def period(p: Any) -> Any:
        declared = system.period
        if callable(declared):
            declared = declared(named_values(PARAMETERS, names, p[: len(names)]))
        return getattr(p, time) * declared

    transitions = [
        attrs.evolve(
            transition,
            guard=Guard(
                original(transition.guard.function),
                transition.guard.direction,
                when=None if transition.guard.when is None else original(transition.guard.when),
                at_start=transition.guard.at_start,
            ),
            reset=None if transition.reset is None else Reset(longer(transition.reset.function)),
        )
        for transition in system.transitions
    ]
    modes = [attrs.evolve(mode, field=faster(mode.field), jacobian=None) for mode in system.modes]
    parameters = {**system.parameters, state: 1.0, time: 1.0}
    changed = attrs.evolve(
        system,
        parameters=parameters,
        modes=modes,
        transitions=transitions,
        period=None if system.period is None else period,
    )
    return Measured(changed, state, time)
