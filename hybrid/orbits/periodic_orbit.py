"""Periodic orbits by Newton shooting, with the saltated fundamental matrix as the Jacobian."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.interrupts import CTRL_C
from hybrid.errors import ArgumentError
from hybrid.orbits.newton import Point
from hybrid.orbits.orbit import PeriodicOrbit, unaged
from hybrid.orbits.shooting import Shooting
from hybrid.orbits.undeclared import hinted
from hybrid.orbits.waits import waits_change
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.periods import check_time
from hybrid.simulation.plan import check_solver
from hybrid.solvers import DOP853, Solver
from hybrid.system.clocks import Every, numbers_of
from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.growth import growing
from hybrid.transform.aged import aged, with_age


@growing
def periodic_orbit(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    t0: float = 0.0,
    periods: int = 1,
    period: float | None = None,
    solver: Solver | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 30,
) -> PeriodicOrbit:
    """Periodic orbit near a guess, stable or not.

    A forced system (one that declares a period) closes after ``periods`` forcing periods from ``t0``. An
    autonomous system closes after an unknown time near the guess ``period``; the returned point is the
    solver's own point, away from jumps, that is nearest to the guess.

    A conserved quantity makes orbits come in families, one orbit per value. Quantities that the system
    declares with ``laws=Laws(conserved=...)`` are held at their values at the guess, and the status names
    them. An orbit that is still one of many, since a multiplier is 1 besides that of the flow, says so.

    Parameters
    ----------
    system, parameters
        As for :func:`hybrid.simulate`.
    x0, mode
        Guess of a point of the orbit ``(n,)``, and the mode there; at the guess its mode is entered. If the
        orbit of a forced system jumps at ``t0``, its point is the state before or after the jump: the one
        that is in the mode of the guess and nearer to it, if a run may start there. No run starts just before
        a tick of a clock.
    t0, periods
        Time at the guess, and number of forcing periods (forced systems).
    period
        Guess of the period (autonomous systems).
    solver
        By default ``DOP853(rtol=1e-12, atol=1e-14)``, where :func:`hybrid.simulate` has ``Taylor``: Newton's
        method needs tighter tolerances than one run.
    tolerance
        Newton's method stops when the residual of each component is below ``tolerance`` times the distance
        that this component moves over the period, or is at the level of rounding.
    max_iterations
        Largest number of Newton steps.

    Returns
    -------
    PeriodicOrbit
        It closes up to whole turns of angles and shifts of cyclic components, and counters go on counting. If
        Newton's method did not converge the status says how far it came. The status is ``AMBIGUOUS_ORDER``
        where two events come at one instant and each order has a derivative of its own. An equilibrium of a
        forced system counts as an orbit, because it repeats after each forcing period; an equilibrium of an
        autonomous system does not.

    Raises
    ------
    ArgumentError
        If ``period`` is given for a forced system, missing for an autonomous one, or another argument does
        not fit the system; if a clock, such as `hybrid.Every`, does not repeat after the orbit's period.

    References
    ----------
    R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, section 7.3,
    doi:10.1007/978-1-4419-1740-9.

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> orbit.status.ok
    True
    """
    as_system("system", system)
    periods = arguments.count("periods", periods, 1)
    max_iterations = arguments.count("max_iterations", max_iterations, 0)
    state = with_age(system, system.variables.state_values("x0", x0))
    system = aged(system)
    guess, counters = np.split(state, [system.tangent_dimension])
    t0 = arguments.number("t0", t0)
    tolerance = arguments.positive("tolerance", tolerance, "be above 0 and below 1")
    if not tolerance < 1.0:
        raise arguments.refusal("tolerance", "be above 0 and below 1", tolerance)
    method = DOP853(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    shooting = Shooting(system, mode, parameters, method, counters)
    forcing = system.forcing_period(parameters)
    if forcing is not None:
        if period is not None:
            raise ArgumentError(
                f"period is for autonomous systems; this one has the forcing period {forcing}. Use periods=."
            )
        check_time("t0", t0, forcing)
        point = Point(guess, t0, periods * forcing)
        compile_system(system)
        _check_clocks(system, state, parameters, t0, point.period)
        with CTRL_C:
            shooting, point = _settled(shooting, point)
            return _shown(hinted(shooting, shooting.forced(point, tolerance, max_iterations), point))
    ticking = [each.name for each in system.transitions if each.clock and each.clock.reads_time]
    if ticking:
        raise ArgumentError(
            f"system: the clock of transition {ticking[0]!r} makes it depend on time, so it has orbits only "
            "of a forcing period. Declare HybridSystem(period=...)."
        )
    if period is None:
        raise ArgumentError("An autonomous system needs a guess of its period: give period=.")
    length = arguments.positive("period", period)
    if not np.isfinite(t0 + 2 * length):
        raise arguments.refusal("period", "be a time that the clock can reach twice", length)
    compile_system(system)
    with CTRL_C:
        shooting, point = _settled(shooting, Point(guess, t0, length))
        return _shown(hinted(shooting, shooting.autonomous(point, tolerance, max_iterations), point))


def _settled(shooting: Shooting, guess: Point) -> tuple[Shooting, Point]:
    """The search from a point, periods after the guess, from which as many are under way one period later.

    A guess that says nothing of delays has nothing under way. It stays the guess if no such point comes.
    """
    system, found, point = shooting.system, shooting, guess
    for _ in system.under_way:
        arc = found.follow(point, point.period, found.mode)
        if not arc.status.ok:
            break
        if not waits_change(system, arc):
            return found, point
        state, counters = np.split(arc.x[-1], [system.tangent_dimension])
        found = attrs.evolve(found, mode=str(arc.mode[-1]), counters=counters)
        point = attrs.evolve(point, x=state)
    return shooting, guess


def _check_clocks(
    system: HybridSystem, x: np.ndarray, parameters: Mapping[str, float] | None, t0: float, length: float
) -> None:
    """ArgumentError if a clock does not tick at the same phases again after the length of an orbit."""
    transition = out_of_phase(system, x, parameters, t0, length)
    if transition is not None and transition.clock is not None:
        raise ArgumentError(
            f"periods: the clock of transition {transition.name!r} ticks {transition.clock.told}, not at the "
            f"same phases again after {length:.6g}, so no orbit closes then. Choose periods= or the system's "
            "period= such that it does; the times of At never come again."
        )


def out_of_phase(
    system: HybridSystem, x: np.ndarray, parameters: Mapping[str, float] | None, t0: float, length: float
) -> Transition | None:
    """A transition whose clock does not tick at the same phases again after a time; None if there is none."""
    variables = system.variables
    view, p = variables.state_view(x), variables.parameter_view(system.parameter_values(parameters).tolist())
    for transition in system.transitions:
        clock = transition.clock
        if clock is None or not clock.reads_time:
            continue
        numbers = np.array(numbers_of(clock, view, p), dtype=float)
        if clock.number == Every.number:
            ratio = length / numbers[0]
            # The period and the length are rounded, each by some operations.
            repeats = abs(ratio - round(ratio)) <= 8 * np.finfo(float).eps * ratio
        else:
            repeats = not np.any((t0 < numbers) & (numbers <= t0 + length))
        if not repeats:
            return transition
    return None


def _shown(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit as a result, with a status that says so if the search was interrupted."""
    [orbit] = unaged([orbit])
    if not CTRL_C.is_set():
        return orbit
    return attrs.evolve(orbit, status=interrupted_status("the best point so far"))
