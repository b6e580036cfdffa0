"""Hypothesis strategies for states, parameter values and whole cases of a system."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver
from hybrid.system.derivatives import evaluate
from hybrid.system.functions import field_function
from hybrid.system.graph import HybridSystem, as_system, check_mode, laws_of
from hybrid.system.labels import named
from hybrid.system.laws import Laws
from hybrid.system.members import for_each
from hybrid.testing.case import TIGHT, Case
from hybrid.testing.engine import LIBRARY, Engine
from hybrid.testing.starts import start_in, start_touching
from hybrid.transform.contacts.growth import contacts_of

# A range ``(low, high)``, a fixed number, or a strategy of numbers.
Range = tuple[float, float] | float | SearchStrategy[float]
Ranges = Mapping[str, Range]

# For tests with cases: runs take longer than Hypothesis expects of an example, its phase that explains a
# failure runs many more of them, and one failure, the smallest, is told.
run_settings = settings(
    deadline=None,
    phases=(Phase.explicit, Phase.reuse, Phase.generate, Phase.shrink),
    report_multiple_bugs=False,
    suppress_health_check=(HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much),
)

# Values lie on a grid of this many steps to either side, so that they print short and shrink to the middle.
GRID = 500
RANGES = "map names to ranges, or be a strategy"
STARTS_TRIED = 8

# Counters that a range does not give begin with numbers up to this.
MOST_COUNTED = 10


def states(
    system: HybridSystem, ranges: Ranges | SearchStrategy[Any] | None = None
) -> SearchStrategy[tuple[float, ...]]:
    """States ``(n,)`` of a system, as tuples.

    Parameters
    ----------
    system
        The model.
    ranges
        By component: a range ``(low, high)``, a number to keep the component fixed, or a strategy; -2 to 2 by
        default, and 0 of what delays have under way. Or one strategy for the whole state.

    Raises
    ------
    ArgumentError
        If a component does not exist, or a range is invalid.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import states
    >>> from hypothesis import given
    >>> @given(states(models.bouncing_ball(), {"q": (0.0, 2.0), "v": 0.0}))
    ... def test_ranges(x):
    ...     assert 0.0 <= x[0] <= 2.0 and x[1] == 0.0
    >>> test_ranges()
    """
    return _states("ranges", system, ranges)


def _states(name: str, system: HybridSystem, ranges: Any) -> SearchStrategy[tuple[float, ...]]:
    """The strategy of states from the ranges in the argument ``name``."""
    names = as_system("system", system).state_names
    if isinstance(ranges, SearchStrategy):
        return ranges.map(lambda x: _drawn_state(name, len(names), x))
    given = for_each(named(name, ranges, RANGES), names)
    for each in given:
        arguments.known(f"{name}: State component", each, names, "State components")
    # Nothing is under way, unless the author says so.
    chosen = dict.fromkeys(system.under_way, 0.0) | given
    return st.tuples(
        *(
            st.integers(0, MOST_COUNTED).map(float)
            if each in system.counters and each not in chosen
            else _values(f"{name}: Range of {each!r}", chosen.get(each, (-2.0, 2.0)))
            for each in names
        )
    )


def parameters(
    system: HybridSystem, ranges: Ranges | SearchStrategy[Any] | None = None
) -> SearchStrategy[dict[str, float]]:
    """Values of all parameters of a system, by name.

    Parameters
    ----------
    system
        The model.
    ranges
        By name: a range ``(low, high)``, a number to keep the parameter fixed, or a strategy; within a fifth
        of the declared value by default, and half way at most to the next declared ones, so that thresholds
        keep their order. Or one strategy of dictionaries.

    Raises
    ------
    ArgumentError
        If a parameter does not exist, or a range is invalid.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import parameters
    >>> from hypothesis import given
    >>> ball = models.bouncing_ball()
    >>> @given(parameters(ball, {"e": (0.5, 0.9), "g": 9.81}))
    ... def test_ranges(values):
    ...     assert 0.5 <= values["e"] <= 0.9 and values["g"] == 9.81
    >>> test_ranges()
    """
    return _parameters("ranges", system, ranges)


def _parameters(name: str, system: HybridSystem, ranges: Any) -> SearchStrategy[dict[str, float]]:
    """The strategy of parameter values from the ranges in the argument ``name``."""
    declared = dict(as_system("system", system).parameters)
    if isinstance(ranges, SearchStrategy):
        return ranges.map(lambda values: _drawn_parameters(name, declared, values))
    chosen = for_each(named(name, ranges, RANGES), tuple(declared))
    for each in chosen:
        arguments.known(f"{name}: Parameter", each, declared, "Parameters")
    drawn = {
        each: _values(f"{name}: Range of {each!r}", chosen[each])
        if each in chosen
        else _around(value, declared.values())
        for each, value in declared.items()
    }
    return st.fixed_dictionaries(drawn)


def cases(
    system: HybridSystem,
    *,
    states: Ranges | SearchStrategy[Any] | None = None,
    parameters: Ranges | SearchStrategy[Any] | None = None,
    t_span: tuple[float, float] | None = None,
    mode: str | None = None,
    passable: Iterable[str] = (),
    solver: Solver = TIGHT,
    engine: Engine = LIBRARY,
    laws: Laws | None = None,
) -> SearchStrategy[Case]:
    """Runs of a system for the properties, each starting in a mode whose guards allow the start.

    Starts are where the invariants of the system are not negative, and on the surfaces of its ``equal``.

    Parameters
    ----------
    system
        The model.
    states, parameters
        Ranges or strategies, as for :func:`states` and :func:`parameters`.
    t_span
        Runs start in the first half of this span and last at least a fifth of the remaining time. By default
        two forcing periods from 0, or about as long as the state needs to cross its default ranges ten times.
    mode
        Mode to start in; by default any mode that allows the state.
    passable
        Names of transitions whose guard the state may cross and stay in the same mode, as with a membrane.
    solver
        Method and tolerances, which should be tight: a run that depends on them cannot be judged.
    engine
        Computes runs and derivatives.
    laws
        What the author knows, beside the laws that the system carries.

    Raises
    ------
    ArgumentError
        If a name does not exist, or a range or the span is invalid.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import cases, check_jumps, run_settings
    >>> from hypothesis import given
    >>> @given(cases(models.bouncing_ball(), states={"q": (0.1, 2.0), "v": (-3.0, 3.0)}))
    ... @run_settings
    ... def test_jumps(case):
    ...     check_jumps(case)
    """
    if mode is not None:
        check_mode(as_system("system", system), mode)
    state, values = _states("states", system, states), _parameters("parameters", system, parameters)
    through = tuple(
        arguments.known("passable: Transition", name, system.transition_names, "Transitions")
        for name in arguments.items("passable", passable, "be names of transitions")
    )
    begin, end = _time_span(t_span) if t_span is not None else (0.0, None)
    known = laws_of(system, laws)
    solver = check_solver(solver)
    arguments.instance("engine", engine, Engine, "Subclass hybrid.testing.Engine.")

    growth = contacts_of(system)
    count = 0 if growth is None else len(growth.contacts)

    @st.composite
    def drawn_case(draw: Any) -> Case:
        begins, lasts = draw(st.integers(0, GRID)) / (2 * GRID), 0.2 + 0.8 * draw(st.integers(0, GRID)) / GRID
        fraction = draw(st.integers(1, 99)) / 100
        if count:
            touching, still = draw(st.sampled_from(_touches(count))), draw(st.booleans())
        choice = 0 if count else draw(st.integers(0, len(system.modes) - 1))
        names = [
            each.name
            for each in (*system.modes[choice:], *system.modes[:choice])
            if mode in (None, each.name, each.part_of)
        ]
        for _ in range(STARTS_TRIED):
            p, x0 = draw(values), draw(state)
            last = default_duration(system, p) if end is None else end
            t0 = begin + (last - begin) * begins
            t1 = t0 + (last - t0) * lasts
            case = Case(system, p, None, x0, t0, t1, fraction, through, solver, engine, known)
            if count:
                found = start_touching(case, touching, still)
                if found is not None and mode in (None, found.mode):
                    return found
                continue
            for name in names:
                start = start_in(case, name)
                if start is not None:
                    return attrs.evolve(case, mode=name, x0=start)
        return case

    return drawn_case()


def _touches(count: int) -> list[tuple[int, ...]]:
    """The contacts that are closed at a start: none, each alone, all."""
    alone = [(i,) for i in range(count)]
    return [(), *alone, *([tuple(range(count))] if count > 1 else [])]


def default_duration(system: HybridSystem, values: Mapping[str, float]) -> float:
    """Two forcing periods, or about as long as the state needs to cross its default ranges ten times."""
    period = system.forcing_period(values)
    if period is not None:
        return 2.0 * period
    rng = np.random.default_rng(20240507)
    vector = system.parameter_values(values)
    times: list[float] = []
    for mode in system.modes:
        for x in rng.uniform(-2.0, 2.0, (8, system.dimension)):
            f = evaluate(system.variables, field_function(mode, system.variables).value, 0.0, x, vector)
            if f is not None:
                times += [2.0 / abs(rate) for rate in f if rate != 0.0]
    return 10.0 * float(np.median(times)) if times else 10.0


def _values(name: str, given: Any) -> SearchStrategy[float]:
    if isinstance(given, SearchStrategy):
        return given.map(lambda value: arguments.number(f"{name}: a value drawn", value))
    if np.ndim(given) == 0:
        return st.just(arguments.number(name, given))
    wanted = "be (low, high), a number or a strategy"
    ends = arguments.numbers(name, given, wanted)
    if ends.shape != (2,) or not np.isfinite(ends).all() or ends[0] > ends[1]:
        raise arguments.refusal(name, wanted, given)
    low, high = ends.tolist()
    half = 0.5 * (high - low)
    return _grid(0.5 * (low + high), half, half)


def _drawn_state(name: str, n: int, value: Any) -> tuple[float, ...]:
    """A state that a user's strategy has drawn."""
    wanted = f"draw states of {n} finite numbers"
    x = arguments.numbers(name, value, wanted)
    if x.shape != (n,) or not np.isfinite(x).all():
        raise arguments.refusal(name, wanted, value)
    return tuple(x.tolist())


def _drawn_parameters(name: str, declared: Mapping[str, float], value: Any) -> dict[str, float]:
    """All parameters, from those that a user's strategy has drawn."""
    if not isinstance(value, Mapping):
        raise arguments.refusal(name, "draw mappings of names to numbers", value)
    drawn = named(name, value)
    for each in drawn:
        arguments.known(f"{name}: Parameter", each, declared, "Parameters")
    return {**declared, **{each: arguments.number(f"{name}[{each!r}]", drawn[each]) for each in drawn}}


def _around(value: float, declared: Iterable[float]) -> SearchStrategy[float]:
    """Values within a fifth of a declared one, half way at most to the next declared ones.

    Drawn values keep the order of the declared ones: a lower threshold stays below an upper one. A share,
    such as a restitution of 0.9, stays a share.
    """
    others = {*declared, *((1.0,) if 0.0 < value < 1.0 else ())}
    below = min((0.5 * (value - each) for each in others if each < value), default=np.inf)
    above = min((0.5 * (each - value) for each in others if each > value), default=np.inf)
    return _grid(value, min(below, 0.2 * abs(value)), min(above, 0.2 * abs(value)))


def _grid(centre: float, below: float, above: float) -> SearchStrategy[float]:
    """Values that reach as far as this below the centre and above it."""
    if below == 0.0:
        return st.just(centre)
    digits = 5 - int(np.floor(np.log10(below)))

    def value(i: int) -> float:
        return round(centre + (above if i > 0 else below) * i / GRID, digits) if i else centre

    return st.integers(-GRID, GRID).map(value)


def _time_span(t_span: Any) -> tuple[float, float]:
    begin, end = arguments.time_span("t_span", t_span)
    if not begin < end:
        raise ArgumentError(f"t_span must be (t0, t1) with t0 < t1; got {arguments.shown(t_span)}.")
    return begin, end
