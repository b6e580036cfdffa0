"""The state on the boundary between two basins, by edge tracking."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import out_of_phase
from hybrid.shared import shares
from hybrid.simulation.interrupt import interrupted_status
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.asked import AskedOfRuns
from hybrid.sweep.attractors.attractor import Attractor, unaged
from hybrid.sweep.attractors.attractors import as_flag
from hybrid.sweep.attractors.closing import BACK, closed
from hybrid.sweep.attractors.destinations import ENDS, Begin, Destinations
from hybrid.sweep.attractors.edge import (
    EQUILIBRIUM,
    NO_EDGE,
    NOT_PERIODIC,
    NOT_SETTLED,
    PERIODIC,
    EdgeState,
)
from hybrid.sweep.attractors.setup import Setup, setup_of
from hybrid.sweep.attractors.tracking import Tracking, TwoStarts
from hybrid.system.graph import HybridSystem, as_system, check_mode
from hybrid.system.growth import growing
from hybrid.transform.aged import original_of, with_age, without_age

# A trajectory wanders in a set of constant size if its last quarter is as large as the one before, up to this
# share, and has so many points.
ALIKE, FEWEST = 0.2, 64
Saddle = Equilibrium | PeriodicOrbit


@growing
@shares(AskedOfRuns)
def edge_state(
    system: HybridSystem,
    one: ArrayLike | Mapping[str, float] | Attractor,
    other: ArrayLike | Mapping[str, float] | Attractor,
    *,
    rounds: int = 100,
    progress: bool | None = None,
    **asked: Unpack[AskedOfRuns],
) -> EdgeState:
    """The saddle on the boundary between the basins of two attractors, by edge tracking.

    Bisection between two starts that lead to different attractors brings them together on both sides of the
    boundary. Their runs follow the boundary, until they part. Where they were still together, in one mode,
    bisection begins again, and so on. The trajectory between the two settles on the attractor within the
    boundary, the edge state, which is unstable in one direction. Once its points come back, Newton's method
    closes the orbit. Impacts and changes of mode on the way need no care.

    A start that does not lead to the attractor of ``one`` counts as the far side, also if it leads to a third
    attractor or if its run ends. The status says so, and ``other`` is then what the far side leads to at
    last.

    Parameters
    ----------
    system
        As for :func:`hybrid.simulate`.
    one, other
        States ``(n,)`` on the two sides, or attractors of :func:`hybrid.attractors`, whose first points are
        taken. The states on the line between them must be allowed by a mode.
    mode
        Mode at the starts. By default that of the attractors, or the one whose guards allow the state, for
        each state between the starts as well. So the starts may be in different modes. Later pairs are taken
        where both runs are in one mode.
    interval
        Time between two points of an autonomous system, which is followed at equal times; by default the time
        scale of its field.
    rounds
        Largest number of bisections that are followed by runs.
    progress
        Whether to show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    EdgeState
        With the saddle as a :class:`hybrid.PeriodicOrbit` or a :class:`hybrid.Equilibrium`, if the trajectory
        has come to one. After Ctrl-C it holds the trajectory so far.

    Raises
    ------
    ArgumentError
        If an argument does not fit the model, or a state between the starts violates every mode; if the model
        depends on time without a declared period, or has a clock that does not tick in step with the period.

    References
    ----------
    J. D. Skufca, J. A. Yorke, B. Eckhardt, "Edge of chaos in a parallel shear flow", Physical Review Letters
    96 (2006) 174101, doi:10.1103/PhysRevLett.96.174101. P. M. Battelino, C. Grebogi, E. Ott, J. A. Yorke,
    E. D. Yorke, "Multiple coexisting attractors, basin boundaries and basic sets", Physica D 32 (1988) 296,
    doi:10.1016/0167-2789(88)90057-7.

    Examples
    --------
    >>> import hybrid
    >>> wells = hybrid.HybridSystem(
    ...     state=("x", "v"),
    ...     modes=[hybrid.Mode("roll", lambda t, x, p: (x.v, x.x - x.x**3 - 0.2 * x.v))],
    ... )
    >>> edge = hybrid.edge_state(wells, (-1.0, 0.2), (1.2, 0.1))
    >>> edge.kind, bool(abs(edge.x).max() < 1e-9)
    ('equilibrium', True)
    """
    as_system("system", system)
    rounds, mode = arguments.count("rounds", rounds, 1), asked["mode"]
    shown = as_flag(progress)
    starts = [_start(system, name, each, mode) for name, each in (("one", one), ("other", other))]
    setup = setup_of(system, starts[0].x[None], asked)
    _check_times(setup, starts[0])
    destinations = Destinations(setup)
    with CTRL_C:
        for each in (one, other):
            if isinstance(each, Attractor):
                # The run that the attractor was found by tells more of it than one that begins there.
                destinations.of(Begin(_state(system, each.start), mode))
        found = [destinations.of(each) for each in starts]
        if found[0] == found[1] or max(found) < 0:
            return _no_edge(destinations, starts, found)
        # The near side has an attractor.
        exchanged = found[0] < 0
        first, second = starts[::-1] if exchanged else starts
        near, far = found[::-1] if exchanged else found
        common = first.mode if first.mode == second.mode else None
        tracking = Tracking(destinations, near, far, TwoStarts(first.x, second.x, common))
        with progress_bar(rounds, "Edge state", shown, "round") as bar:
            done, saddle = _tracked(tracking, rounds, bar)
        return _result(tracking, saddle, done, exchanged=exchanged)


def _check_times(setup: Setup, start: Begin) -> None:
    """ArgumentError if a run that begins at ``t0`` is not what a run does that comes by a period later."""
    anew = "Edge tracking begins runs anew at t0."
    if not setup.forced:
        timed = setup.begin(start.x, start.mode).model.timed
        if np.any(timed == 1):
            mode = setup.system.mode_names[int(np.argmax(timed))]
            raise ArgumentError(
                f"system: mode {mode!r} may depend on time, and no forcing period is declared. {anew} "
                "Declare HybridSystem(period=...)."
            )
        return
    late = out_of_phase(setup.system, start.x, setup.parameters, setup.t0, setup.interval)
    if late is not None and late.clock is not None:
        raise ArgumentError(
            f"system: the clock of transition {late.name!r} ticks {late.clock.told}, not at the same phases "
            f"again after the forcing period {setup.interval:.6g}. {anew} Declare a period that is a "
            "multiple of both."
        )


def _start(system: HybridSystem, name: str, given: Any, mode: str | None) -> Begin:
    if mode is not None:
        check_mode(system, mode)
    if not isinstance(given, Attractor):
        return Begin(_state(system, system.variables.state_values(name, given)), mode)
    if not len(given.points):
        raise arguments.refusal(name, "be an attractor with points", given)
    own = arguments.known(f"{name}: Mode", str(given.mode[0]), system.mode_names, "Modes")
    return Begin(_state(system, given.points[0]), own if mode is None else mode)


def _state(system: HybridSystem, x: np.ndarray) -> np.ndarray:
    """A state with the age, if the system has one; an attractor may have it already."""
    return with_age(system, x) if len(x) == system.dimension else x


def _tracked(tracking: Tracking, rounds: int, bar: Progress) -> tuple[int, Saddle | None]:
    """Follow the boundary to a saddle: the number of rounds, and the saddle if there is one."""
    for done in range(rounds):
        tracking.bisect()
        saddle = closed(tracking) if done and not CTRL_C.is_set() else None
        if saddle is not None or CTRL_C.is_set() or not tracking.follow():
            return done, saddle
        bar.update()
    return rounds, None


def _no_edge(destinations: Destinations, starts: list[Begin], found: list[int]) -> EdgeState:
    """The result for two starts that lead to one attractor, or to none."""
    told = "Both starts lead to the same attractor"
    if found[0] < 0:
        told = "Neither start leads to an attractor"
    status = Status(
        StatusCode.NOT_CONVERGED,
        f"{told}: no boundary between two basins lies between them.",
        "Move one of the starts, or raise periods= for runs that take long to settle.",
    )
    if CTRL_C.is_set():
        status = interrupted_status("the starts")
    bracket = np.array([each.x for each in starts])
    return _edge(destinations, NO_EDGE, Begin(bracket[0], starts[0].mode), bracket, found, status)


def _result(tracking: Tracking, saddle: Saddle | None, done: int, *, exchanged: bool) -> EdgeState:
    """The result of a trajectory; the sides are exchanged if it began from the other start."""
    pair, kind = tracking.pair, _kind(tracking, saddle)
    bracket, found = np.array([pair.one, pair.other]), [tracking.near, tracking.far]
    if exchanged:
        bracket, found = bracket[::-1], found[::-1]
    at = Begin(tracking.middle(pair.one, pair.other), pair.mode)
    made = _edge(tracking.destinations, kind, at, bracket, found, _status(tracking, kind, saddle, done))
    made = attrs.evolve(
        made,
        points=without_age(made.system, tracking.points),
        modes=np.array(tracking.modes, dtype=str),
        rounds=done,
    )
    if isinstance(saddle, PeriodicOrbit):
        x0 = without_age(made.system, saddle.x0)
        return attrs.evolve(made, orbit=saddle, x=x0, mode=saddle.mode, t0=saddle.t0)
    if isinstance(saddle, Equilibrium):
        return attrs.evolve(made, equilibrium=saddle, x=without_age(made.system, saddle.x), mode=saddle.mode)
    return made


def _edge(
    destinations: Destinations, kind: str, at: Begin, bracket: np.ndarray, found: list[int], status: Status
) -> EdgeState:
    """A result without a trajectory."""
    setup = destinations.setup
    system = original_of(setup.system)
    leads: list[Attractor | None] = [None, None]
    for i, each in enumerate(found):
        if each >= 0:
            [leads[i]] = unaged((destinations.found[each].attractor,), setup.system)[0]
    return EdgeState(
        system=system,
        parameters={**system.parameters, **setup.parameters},
        kind=kind,
        x=without_age(system, at.x),
        mode=at.mode or "",
        t0=setup.t0,
        orbit=None,
        equilibrium=None,
        points=np.empty((0, system.dimension)),
        modes=np.empty(0, dtype=str),
        bracket=without_age(system, bracket),
        one=leads[0],
        other=leads[1],
        rounds=0,
        status=status,
    )


def _kind(tracking: Tracking, saddle: Saddle | None) -> str:
    """What the trajectory has come to."""
    if saddle is not None:
        return EQUILIBRIUM if isinstance(saddle, Equilibrium) else PERIODIC
    if len(tracking.points) < FEWEST or tracking.lost:
        return NOT_SETTLED
    *_, before, last = np.array_split(tracking.points, 4)
    sizes = np.array([[each.min(axis=0), each.max(axis=0)] for each in (before, last)])
    change = np.abs(sizes[1] - sizes[0]).max(axis=0)
    # What hardly moves has settled.
    scale = np.maximum(np.ptp(sizes[1], axis=0), BACK * tracking.extent)
    return NOT_PERIODIC if np.all(change <= ALIKE * scale) else NOT_SETTLED


def _status(tracking: Tracking, kind: str, saddle: Saddle | None, done: int) -> Status:
    """How the search ended, with what was met on the way."""
    if CTRL_C.is_set():
        return interrupted_status("the edge trajectory so far")
    third = tracking.met - {tracking.near, tracking.far}
    noted = ""
    if third or tracking.far == ENDS:
        what = "runs that end" if ENDS in (*third, tracking.far) else "a third attractor"
        noted = (
            f" Between the starts there are others that lead to {what}: `one` and `other` are what the two "
            "sides of this state lead to."
        )
    trajectory = f"The edge trajectory of {counted(len(tracking.points), 'point')}"
    if saddle is not None:
        what = "an equilibrium" if kind == EQUILIBRIUM else "a periodic orbit"
        return Status(StatusCode.SUCCESS, f"{trajectory} has settled on {what}.{noted}")
    if kind == NOT_PERIODIC:
        return Status(
            StatusCode.SUCCESS,
            f"{trajectory} wanders in a set of constant size, and Newton's method finds no orbit with one "
            f"unstable direction near it. More rounds= would look for a longer one.{noted}",
        )
    if tracking.lost:
        return Status(
            StatusCode.NOT_CONVERGED,
            f"{trajectory} breaks off: the runs from the two sides are at no point near each other in one "
            f"mode.{noted}",
            "The boundary may lie on a guard. Take other starts, another t0= if a jump happens at that "
            "phase, or a shorter interval=.",
        )
    return Status(
        StatusCode.NOT_CONVERGED,
        f"{trajectory} has not settled after {done} rounds.{noted}",
        "Raise rounds=.",
    )
