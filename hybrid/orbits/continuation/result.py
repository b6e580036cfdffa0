"""A place on a branch as a periodic orbit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import attrs
import numpy as np

from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.order import order_status
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import moment, share_of
from hybrid.orbits.continuation.route import Route
from hybrid.orbits.orbit import PeriodicOrbit, first_start, shift_over, turns_over, unaged
from hybrid.simulation.arc import HybridArc
from hybrid.solvers import Solver
from hybrid.status import SUCCESS


@attrs.define(eq=False)
class Points:
    """Which point of each orbit of a branch stands for it.

    Of a forced system it is the one at the phase of the time ``t0``. Of an autonomous one it keeps its share
    of the time of its stretch: on the ``route`` of the first orbit where that has its point, on others in the
    middle of the stretch that is the longest on the first orbit with that route.
    """

    t0: float
    shares: dict[Route, tuple[int, float]] = attrs.field(factory=dict)

    def at(self, orbit: Pass) -> tuple[int, float]:
        """The stretch, and the share of its time before the point."""
        loop = orbit.loop
        if orbit.family.forced:
            return share_of(orbit, self.t0)
        route = orbit.family.route
        if route not in self.shares:
            self.shares[route] = (int(np.argmax(np.diff(loop.times))), 0.5)
        return self.shares[route]


def orbit_of(orbit: Pass, points: Points) -> PeriodicOrbit:
    """The orbit as a result, from the point that stands for it."""
    [found] = unaged([whole_orbit_of(orbit, points)])
    return found


def arc_of(orbit: Pass, points: Points, solver: Solver) -> HybridArc:
    """The arc of the orbit over one period, from the point that stands for it."""
    [found] = unaged([_start_from(orbit, *points.at(orbit), points.t0, has_matrix=False)])
    return found.arc(solver)


def whole_orbit_of(orbit: Pass, points: Points) -> PeriodicOrbit:
    """The orbit from the point that stands for it, with the age if the family has one.

    Events that meet at one instant are listed as the arc of the orbit shows them.
    """
    i, share = points.at(orbit)
    found = _start_from(orbit, i, share, points.t0)
    if orbit.has_meetings:
        other = orbit.in_order_of(found.arc())
        i = next(j for j, flow in enumerate(other.flows) if flow is orbit.flows[i])
        found, orbit = _start_from(other, i, share, points.t0), other
    return attrs.evolve(found, status=order_status(orbit) or SUCCESS)


def _start_from(orbit: Pass, i: int, share: float, t0: float, *, has_matrix: bool = True) -> PeriodicOrbit:
    """The orbit from a share of a stretch; if it jumps there, from after or before these jumps or later."""
    found, stays = _orbit_from(orbit, i, share, t0, has_matrix), np.diff(orbit.loop.times)
    if share > 0.0 or orbit.landings[i - 1] is None or not orbit.family.forced:
        return found

    def points() -> Iterator[tuple[PeriodicOrbit, Sequence[str]]]:
        yield found, []
        k, names = (i - 1) % len(stays), orbit.family.route[i - 1].fired
        while stays[k] <= CLOSED * orbit.loop.period:
            k = (k - 1) % len(stays)
            names = (*orbit.family.route[k].fired, *names)
        yield _orbit_from(orbit, k, 1.0, t0, has_matrix), names
        yield _orbit_from(orbit, i, found.moment / float(stays[i]), t0 + found.moment, has_matrix), []

    return first_start(points())


def _orbit_from(orbit: Pass, i: int, share: float, t0: float, has_matrix: bool) -> PeriodicOrbit:
    """The orbit from a share of a stretch, or from a time if the system is forced.

    Its fundamental matrix is nan unless it is to have one.
    """
    family, loop = orbit.family, orbit.loop
    (t, x), mode = moment(orbit, i, share), mode_at(orbit, i, share)
    multipliers = orbit.multipliers
    with np.errstate(divide="ignore"):
        moduli = np.log(np.abs(multipliers))
    stretches = [*family.route[i:], *family.route[:i]]
    targets = [stretch.mode for stretch in [*stretches[1:], stretches[0]]]
    fired = [name for stretch in stretches for name in stretch.fired]
    _, residuals = orbit.equations(orbit, orbit.units(np.ones(len(loop.values))))
    return PeriodicOrbit(
        system=family.system,
        parameters=family.all_parameters(loop.values),
        x0=x,
        mode=mode,
        t0=t0 if family.forced else t,
        period=orbit.period,
        multipliers=multipliers,
        log_moduli=moduli,
        fundamental=fundamental_at(orbit, i, share) if has_matrix else np.full((family.n,) * 2, np.nan),
        residual=float(np.abs(residuals).max()),
        iterations=0,
        signature=(
            mode_at(orbit, i, share),
            *(m for m, s in zip(targets, stretches, strict=True) if s.fired),
        ),
        transitions=tuple(fired),
        status=SUCCESS,
        turns=turns_over(family.system, orbit.change),
        shift=shift_over(family.system, orbit.change),
    )


def mode_at(orbit: Pass, i: int, share: float) -> str:
    """The mode at a share of the time of a stretch; within a chatter, the one that the run is in."""
    stretch, arc = orbit.family.route[i], orbit.flows[i].arc
    if not stretch.within or arc is None:
        return stretch.mode
    t = arc.t[0] + share * (arc.t[-1] - arc.t[0])
    return str(arc.mode[max(int(np.searchsorted(arc.t, t, side="right")) - 1, 0)])


def fundamental_at(orbit: Pass, i: int, share: float) -> np.ndarray:
    """The saltated fundamental matrix ``(n, n)`` over the period from a point within a stretch.

    It is nan if the stretch cannot be run in two parts, as beside a touch, or a jump has no derivative.
    """
    family, loop = orbit.family, orbit.loop
    (t, x), mode = moment(orbit, i, share), mode_at(orbit, i, share)
    n, stretch, (begin, end) = family.n, family.route[i], loop.times[i : i + 2]
    before = attrs.evolve(stretch, end_mode=mode)
    after = attrs.evolve(stretch, mode=mode, within=stretch.within if mode == stretch.mode else ())
    try:
        first = family.flow(before, loop.x[i], float(begin), t, loop.values).slopes[:, :n]
        last = family.flow(after, x[:n], t, float(end), loop.values).slopes[:, :n]
    except ArithmeticError:
        return np.full((n, n), np.nan)
    # Where a guard is crossed without speed a saltation matrix is infinite.
    with np.errstate(all="ignore"):
        matrix = orbit.saltations[i] @ last
        for each in [*orbit.maps[i + 1 :], *orbit.maps[:i]]:
            matrix = each @ matrix
        return np.asarray(first @ matrix)
