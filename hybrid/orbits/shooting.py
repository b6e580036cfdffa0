"""The search for a periodic orbit from a guess: shots over the period, and Newton's steps."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.asked import Asked
from hybrid.orbits.continuation.family import Family
from hybrid.orbits.continuation.order import order_status
from hybrid.orbits.continuation.route import accumulating
from hybrid.orbits.held import Held, held_by
from hybrid.orbits.judgement import FAMILY, NEARLY_SINGULAR, POINT_ERROR, TIGHTER, Judgement
from hybrid.orbits.lap import Fired, Lap, lap_of
from hybrid.orbits.newton import ROUNDING_OF_GAP, Newton, Point, Shot, length
from hybrid.orbits.orbit import PeriodicOrbit, closes, shift_over, turns_over
from hybrid.orbits.rest import EPSILON, drift
from hybrid.orbits.waits import waits_change
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.ending import status_of
from hybrid.simulation.holding import drawn_back
from hybrid.simulation.simulate import simulate
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.status import Status, StatusCode
from hybrid.system.entries import are_ageless
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Unexplored, stage_of
from hybrid.system.periodicity import unclosed

# Points, besides the solver's own, that show how far an orbit moves.
SAMPLES = 65
# The smallest gap that Newton's method can reach, in units in the last place of the largest states.
FINEST_GAP = 4
# Newton steps are halved at most to this share.
SHORTEST_STEP = 1 / 64
# A period below this share of the guess is a point, not an orbit.
SHORTEST_PERIOD = 1e-3
# Most jumps of the guess that are examined to find a point away from jumps.
MOST_JUMPS_LOOKED_AT = 10_000
# The guess of a period is changed by this share at most, if the solution then returns that much nearer.
PERIOD_OFF = 0.1
NEARER = 0.5


@attrs.frozen(eq=False)
class Shooting:
    """Searches for orbits of one system, with the conserved quantities that are held.

    Counters are no unknowns: they begin with ``counters``, and end with whatever they have counted. A search
    that goes on at another time than that of the guess gives the orbit's point that was ``asked`` for.
    """

    system: HybridSystem
    mode: str | None
    parameters: Mapping[str, float] | None
    solver: Solver
    counters: np.ndarray
    held: Held | None = None
    asked: Asked | None = None

    def whole(self, point: Point) -> np.ndarray:
        """The state at a point, with the counters."""
        return np.append(point.x, self.counters)

    def shoot(self, point: Point) -> Shot:
        """One run over the period of a point, with the columns of the identity."""
        trajectory, n = self._trajectory(point, self.mode), self.system.tangent_dimension
        mode, field = trajectory.mode, trajectory.field()[:n]
        code = trajectory.advance(point.t + point.period, trajectory.no_record())
        arc = self.follow(point, point.period, mode)
        states = np.vstack([arc.x, arc(np.linspace(arc.t[0], arc.t[-1], SAMPLES))])[:, :n]
        extent, magnitude = np.ptp(states, axis=0), np.abs(states).max(axis=0)
        cyclic, carried = self.system.is_cyclic[:n], None
        extent[cyclic] = 0.0
        at_rest = ~cyclic & (extent <= ROUNDING_OF_GAP * EPSILON * magnitude)
        if np.any(at_rest) and code == StatusCode.SUCCESS and len(arc.jumps) <= MOST_JUMPS_LOOKED_AT:
            again, end = self._trajectory(point, self.mode), point.t + point.period
            carried = drift(again, end, arc.jumps.t, at_rest, magnitude)
        return Shot(
            point,
            mode,
            trajectory.x[:n],
            trajectory.mode,
            trajectory.tangent_matrix,
            field,
            trajectory.field()[:n],
            extent,
            magnitude,
            status_of(trajectory, code),
            self.system,
            carried,
            trajectory.beyond,
            None if self.held is None else self.held.departure(point.t, point.x, magnitude),
            float(np.abs(arc.x).max()),
            more_waits=waits_change(self.system, arc),
        )

    def _trajectory(self, point: Point, mode: str | None) -> Trajectory:
        """A run from a point that carries the columns of the identity."""
        known = self.system.parameter_values(self.parameters)
        trajectory = start(
            self.system,
            drawn_back(self.system, mode, point.t, self.whole(point), known),
            point.t,
            mode=mode,
            parameters=self.parameters,
            solver=self.solver,
            tangent=np.eye(self.system.tangent_dimension),
        )
        # Where the age counts for nothing, its column is zero.
        trajectory.replace_tangents(trajectory.tangent_matrix)
        return trajectory

    def newton(self, point: Point, free_period: bool, tolerance: float, max_iterations: int) -> PeriodicOrbit:
        """Newton's method from ``point``; the period may be unknown too.

        Conserved quantities are held. A period that is given may decide their values, so they are held there
        only where it leaves them free.
        """
        shot = self.shoot(point)
        share = float(np.sqrt(self.solver.rtol))
        values = self.system.parameter_values(self.parameters)
        held = held_by(self.system, values, shot, share, self.whole(shot.point))
        if held is not None and free_period:
            return attrs.evolve(self, held=held)._search(shot, True, tolerance, max_iterations)
        found = self._search(shot, free_period, tolerance, max_iterations)
        if held is None or FAMILY not in found.status.message:
            return found
        other = attrs.evolve(self, held=held)._search(shot, False, tolerance, max_iterations)
        return other if other.closes else found

    def _search(self, shot: Shot, free_period: bool, tolerance: float, max_iterations: int) -> PeriodicOrbit:
        """Newton's method from the first shot."""
        if self.held is not None:
            shot = attrs.evolve(
                shot, departure=self.held.departure(shot.point.t, shot.point.x, shot.magnitude)
            )
        newton, iterations = Newton.begin(shot, self.solver.atol, free_period), 0
        while iterations < max_iterations and shot.whole and newton.measurable(shot):
            if shot.closes(tolerance, FINEST_GAP * EPSILON * shot.magnitude):
                break
            better = self._along(shot, newton)
            iterations += 1
            if better is None:
                break
            newton = newton.advanced(shot, better)
            shot = better
        return self._result(shot, newton, iterations, tolerance)

    def _along(self, shot: Shot, newton: Newton) -> Shot | None:
        """The shot after the step, or after a shorter one, that closes better; None if there is none.

        Where orbits come in families, the step along the family is arbitrary and may be long, so the step
        without it is tried too.
        """
        full, units = newton.step(shot), newton.measure(shot)
        best = self._better(shot, shot, units, full)
        if best.size(units) > NEARER * shot.size(units):
            best = self._better(best, shot, units, newton.step(shot, NEARLY_SINGULAR))
        part = 1.0
        while best is shot and part > SHORTEST_STEP:
            part /= 2
            best = self._better(shot, shot, units, full, part)
        return None if best is shot else best

    def _better(
        self, best: Shot, shot: Shot, units: np.ndarray, step: tuple[np.ndarray, float], part: float = 1.0
    ) -> Shot:
        """The best shot so far, or the one after a part of a step from ``shot`` if that closes better.

        Gaps are compared in ``units (n,)``.
        """
        change, longer = step
        period = shot.point.period + part * longer
        if not period > 0:
            return best
        try:
            trial = self.shoot(attrs.evolve(shot.point, x=shot.point.x + part * change, period=period))
        except ArgumentError:
            # No mode allows the point.
            return best
        # A step through a guard leads to other events.
        crossed = set(trial.beyond) - set(shot.beyond)
        return best if crossed or not trial.size(units) < best.size(units) else trial

    def autonomous(self, guess: Point, tolerance: float, max_iterations: int) -> PeriodicOrbit:
        """Newton's method from the point of the guess's orbit farthest from jumps, then back to the guess.

        At a jump the end of the shot would depend discontinuously on the period.
        """
        shooting, moved = self._moved(guess, self._quietest_time(guess))
        moved = attrs.evolve(moved, period=shooting._time_of_return(moved))
        orbit = shooting.newton(moved, True, tolerance, max_iterations)
        if orbit.period < SHORTEST_PERIOD * guess.period:
            # Every point closes after no time at all.
            status = Status(
                StatusCode.NOT_CONVERGED,
                f"The period shrank from {guess.period:.3g} to {orbit.period:.3g}: a point, no orbit.",
                "Start nearer to the orbit, with a better guess of its period.",
            )
            return attrs.evolve(orbit, status=status)
        if not orbit.closes:
            return orbit
        return self._nearest(orbit, guess)

    def forced(self, guess: Point, tolerance: float, max_iterations: int) -> PeriodicOrbit:
        """Newton's method from a point of the guess's orbit that is not near a jump, the period being known.

        The equation of a shot that begins near a jump depends on which side of the jump the shot begins on.
        """
        shift = self._quiet_time(guess)
        mode = self._trajectory(guess, self.mode).mode
        if shift == 0.0:
            # A step of the search may leave a curved gap, so that the state alone would tell of another mode.
            return attrs.evolve(self, mode=mode).newton(guess, False, tolerance, max_iterations)
        shooting, moved = self._moved(guess, shift)
        asked = Asked(guess, mode, self.counters)
        return attrs.evolve(shooting, asked=asked).newton(moved, False, tolerance, max_iterations)

    def _quiet_time(self, guess: Point) -> float:
        """The first time after the guess with jumps at least half as far as anywhere; 0 without jumps."""
        arc = self.follow(guess, 2 * guess.period, self.mode, max_jumps=MOST_JUMPS_LOOKED_AT)
        if len(arc.jumps) == 0 or not arc.status.ok:
            return 0.0
        candidates, distance = self._quietness(arc, guess, arc.jumps.t - guess.t)
        return float(candidates[np.flatnonzero(distance >= 0.5 * distance.max())[0]])

    def _quietest_time(self, guess: Point) -> float:
        """The time after the guess at which neither it nor one period later is close to a jump."""
        arc = self.follow(guess, 2 * guess.period, self.mode, max_jumps=MOST_JUMPS_LOOKED_AT)
        candidates, distance = self._quietness(arc, guess, np.concatenate([[0.0], arc.jumps.t - guess.t]))
        return float(candidates[np.argmax(distance)])

    def _quietness(self, arc: HybridArc, guess: Point, jumps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Times after the guess, and how far they and those one period later are from jumps."""
        candidates = np.linspace(0, guess.period, 201)[:-1]
        at = np.searchsorted(arc.t, guess.t + candidates, side="right") - 1
        candidates = candidates[are_ageless(self.system, arc.mode[at])]
        distance = np.minimum(
            np.abs(candidates[:, None] - jumps).min(axis=1),
            np.abs(candidates[:, None] + guess.period - jumps).min(axis=1),
        )
        return candidates, distance

    def _moved(self, guess: Point, shift: float) -> tuple[Shooting, Point]:
        arc = self.follow(guess, shift, self.mode)
        state, counters = np.split(arc.x[-1], [self.system.tangent_dimension])
        shooting = attrs.evolve(self, mode=str(arc.mode[-1]), counters=counters)
        return shooting, Point(state, guess.t + shift, guess.period)

    def _time_of_return(self, guess: Point) -> float:
        """The guessed period, or a time near it at which the solution returns much nearer to its start.

        With a wrong period, Newton's method prefers smaller orbits where orbits come in families.
        """
        arc = self.follow(guess, (1 + PERIOD_OFF) * guess.period, self.mode, max_jumps=MOST_JUMPS_LOOKED_AT)
        times = guess.period * (1 + PERIOD_OFF * np.linspace(-1, 1, 2 * SAMPLES - 1))
        if not arc.status.ok:
            return guess.period
        n = self.system.tangent_dimension
        extent = np.ptp(arc.x[:, :n], axis=0)
        apart = [unclosed(self.system, each) for each in arc(guess.t + times)[:, :n] - guess.x]
        gaps = [length(each) for each in apart / np.where(extent > 0, extent, 1.0)]
        nearest = int(np.argmin(gaps))
        return float(times[nearest]) if gaps[nearest] < NEARER * gaps[SAMPLES - 1] else guess.period

    def _nearest(self, orbit: PeriodicOrbit, guess: Point) -> PeriodicOrbit:
        """The same orbit from the point of its arc, away from jumps, that is nearest to the guess.

        Cyclic components have the values of the guess there.
        """
        arc, n = orbit.arc(self.solver), self.system.tangent_dimension
        cyclic = self.system.is_cyclic[:n]
        states = np.where(cyclic, guess.x, arc.x[:, :n])
        extent = np.ptp(states, axis=0)
        # Distances in units of the orbit, so that those of the states do not matter.
        apart = (states - guess.x) / np.where(extent > 0, extent, 1.0)
        times = arc.jumps.t
        # On a jump, rounding would decide whether a run from the point makes it.
        away = np.array([np.all(np.abs(times - t) > POINT_ERROR * orbit.period) for t in arc.t])
        away &= are_ageless(self.system, arc.mode)
        i = int(np.argmin(np.where(away, np.linalg.norm(apart, axis=1), np.inf)))
        x0 = np.append(states[i], arc.x[i, n:])
        return attrs.evolve(orbit, x0=x0, mode=str(arc.mode[i]), t0=float(arc.t[i]))

    def _result(self, shot: Shot, newton: Newton, iterations: int, tolerance: float) -> PeriodicOrbit:
        lap, jumps = self._lap(shot)
        orbit = self._orbit(lap, lap.jumps or jumps, shot)
        finer = attrs.evolve(self, mode=shot.mode, solver=self.solver.tightened(TIGHTER**2)).shoot
        judgement = Judgement(shot, newton, iterations, tolerance, self.solver, finer)
        status = judgement.status
        if closes(status) and lap.orbit is not None and lap.orbit.has_meetings:
            lap = lap.in_order_of(orbit.arc())
            orbit = self._orbit(lap, lap.jumps or jumps, shot)
        if status.ok:
            held = "" if self.held is None else self.held.told
            status = judgement.explained(status, orbit.multipliers, held)
        if status.ok and lap.orbit is not None:
            status = order_status(lap.orbit) or status
        return attrs.evolve(orbit, iterations=iterations, status=status)

    def _orbit(self, lap: Lap, jumps: list[Fired], shot: Shot) -> PeriodicOrbit:
        """A lap as an orbit, from the point that was asked for."""
        eigenvalues = lap.eigenvalues
        orbit = PeriodicOrbit(
            system=self.system,
            parameters=self._all_parameters(),
            x0=self.whole(shot.point),
            mode=shot.mode,
            t0=shot.point.t,
            period=float(shot.point.period),
            multipliers=eigenvalues.values,
            log_moduli=eigenvalues.log_moduli,
            fundamental=lap.fundamental(0),
            residual=length(shot.gap),
            iterations=0,
            signature=(shot.mode, *(jump.target for jump in jumps if jump.target is not None)),
            transitions=tuple(jump.transition for jump in jumps),
            status=shot.status,
            turns=turns_over(self.system, shot.end - shot.point.x),
            shift=shift_over(self.system, shot.end - shot.point.x),
        )
        if self.asked is None or lap.orbit is None:
            return orbit
        return self.asked.answered(orbit, lap, jumps, shot)

    def _lap(self, shot: Shot) -> tuple[Lap, list[Fired]]:
        """The run over the period, stretch by stretch and cut at the time of the guess, and its jumps."""
        point, jumps = shot.point, self.follow(shot.point, shot.point.period, shot.mode).jumps
        stops = [point.t + point.period]
        if self.asked is not None and not any(self.asked.is_at(jump.t) for jump in jumps):
            stops = [self.asked.t, *stops]
        periods = 0 if self.system.forcing_period(self.parameters) is None else 1
        family = Family(
            self.system, (), self._all_parameters(), periods, self.solver, (), least=shot.magnitude
        )
        lap = lap_of(family, lambda: self._trajectory(point, shot.mode), stops, accumulating(jumps))
        return lap, [Fired(jump.t, jump.transition, jump.target) for jump in jumps]

    def _all_parameters(self) -> dict[str, float]:
        values = self.system.parameter_values(self.parameters).tolist()
        return dict(zip(self.system.parameters, values, strict=True))

    def follow(self, point: Point, span: float, mode: str | None, max_jumps: int = 100_000) -> HybridArc:
        """The arc from a point over a time, without tangent vectors.

        Unexplored if it has made modes of a growing system: shots would not have them.
        """
        stage = stage_of(self.system)
        arc = simulate(
            self.system,
            self.whole(point),
            (point.t, point.t + span),
            mode=mode,
            parameters=self.parameters,
            solver=self.solver,
            max_jumps=max_jumps,
        )
        if stage_of(self.system) is not stage:
            raise Unexplored
        return arc
