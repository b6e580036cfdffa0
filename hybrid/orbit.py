"""Periodic orbits by Newton shooting, with the saltated fundamental matrix as the Jacobian."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.arc import HybridArc
from hybrid.compile import compile_system
from hybrid.errors import ArgumentError
from hybrid.interrupt import CTRL_C, interrupted_status
from hybrid.run import check_solver, start
from hybrid.simulate import simulate
from hybrid.solvers import DOP853, RungeKutta
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system import HybridSystem, as_system

# Newton steps are halved down to this part before they are taken as they are.
SHORTEST_STEP = 1 / 64
# A shorter period, as a share of the guess, is no orbit.
SHORTEST_PERIOD = 1e-3
# Jumps of a guess that are looked at in the search for a point away from them.
MOST_JUMPS_LOOKED_AT = 10_000


@attrs.frozen(eq=False, repr=False)
class PeriodicOrbit:
    """A periodic orbit, or the best that Newton's method came to.

    Attributes
    ----------
    system, parameters
        The model, and the overriding parameter values.
    x0, mode, t0
        A point of the orbit ``(n,)``, its mode, and the time there.
    period
        Time until the orbit closes: for a forced system ``periods`` forcing periods.
    multipliers
        Floquet multipliers ``(n,)``, largest first; an autonomous orbit has one that is 1.
    fundamental
        The saltated fundamental matrix over the period ``(n, n)``, whose eigenvalues they are; for an
        autonomous system from the point, away from jumps, where the shooting was done (elsewhere on the orbit
        it is a similar matrix).
    residual
        Distance between the two ends over the period, in the units of the state.
    iterations
        Newton iterations used.
    signature
        Names of the modes in the order they are visited.
    status
        Whether Newton's method converged, and how far it got if not.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    x0: np.ndarray
    mode: str
    t0: float
    period: float
    multipliers: np.ndarray
    fundamental: np.ndarray
    residual: float
    iterations: int
    signature: tuple[str, ...]
    status: Status

    def __repr__(self) -> str:
        return (
            f"<PeriodicOrbit period {self.period:.9g}, largest multiplier {abs(self.multipliers[0]):.6g}, "
            f"residual {self.residual:.1e}, {self.status.code.name}>"
        )

    def arc(self, solver: RungeKutta | None = None) -> HybridArc:
        """The orbit over one period."""
        span = (self.t0, self.t0 + self.period)
        return simulate(self.system, self.x0, span, mode=self.mode, parameters=self.parameters, solver=solver)


def periodic_orbit(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    t0: float = 0.0,
    periods: int = 1,
    period: float | None = None,
    solver: RungeKutta | None = None,
    tolerance: float = 1e-10,
    max_iterations: int = 30,
) -> PeriodicOrbit:
    """Periodic orbit near a guess, stable or not.

    A forced system (one that declares a period) closes after ``periods`` forcing periods from ``t0``. An
    autonomous one closes after an unknown time near the guess ``period``; the point returned is the one
    nearest to the guess among the solver's own.

    Parameters
    ----------
    system, parameters
        As for :func:`hybrid.simulate`.
    x0, mode
        Guess of a point of the orbit ``(n,)``, and the mode there.
    t0, periods
        Time at the guess, and number of forcing periods (forced systems).
    period
        Guess of the period (autonomous systems).
    solver
        By default ``DOP853(rtol=1e-12, atol=1e-14)``.
    tolerance
        Newton's method stops where the residual is below ``tolerance`` times the size of the state.
    max_iterations
        Most Newton steps.

    Returns
    -------
    PeriodicOrbit
        With a status that says how far it got if it did not converge.

    Raises
    ------
    ArgumentError
        If a forced system is given ``period``, an autonomous one is not, or another argument does not fit.

    References
    ----------
    R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, section 7.3,
    doi:10.1007/978-1-4419-1740-9.

    Examples
    --------
    >>> import models
    >>> orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> orbit.status.ok
    True
    """
    as_system("system", system)
    periods = arguments.count("periods", periods, 1)
    max_iterations = arguments.count("max_iterations", max_iterations, 0)
    guess = arguments.state("x0", x0, system)
    t0 = arguments.number("t0", t0)
    tolerance = arguments.positive("tolerance", tolerance)
    method = DOP853(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    shooting = _Shooting(system, mode, parameters, method)
    forcing = system.forcing_period(parameters)
    if forcing is not None:
        if period is not None:
            raise ArgumentError(
                f"period is for autonomous systems; this one has the forcing period {forcing}. Use periods=."
            )
        point = _Point(guess, t0, periods * forcing)
        compile_system(system)
        with CTRL_C:
            return _kept(shooting.newton(point, None, tolerance, max_iterations))
    if period is None:
        raise ArgumentError("An autonomous system needs a guess of its period: give period=.")
    length = arguments.positive("period", period)
    compile_system(system)
    with CTRL_C:
        return _kept(shooting.autonomous(_Point(guess, t0, length), tolerance, max_iterations))


def _kept(orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit, with a status that says so if the search was interrupted."""
    if not CTRL_C.is_set():
        return orbit
    return attrs.evolve(orbit, status=interrupted_status("the best point so far"))


@attrs.frozen(eq=False)
class _Point:
    """Unknowns of the shooting: a state, the time there, and the time to close."""

    x: np.ndarray
    t: float
    period: float


@attrs.frozen(eq=False)
class _Shot:
    """What one integration over the period gives."""

    point: _Point
    mode: str
    end: np.ndarray
    end_mode: str
    fundamental: np.ndarray
    field: np.ndarray
    end_field: np.ndarray
    status: Status

    @property
    def gap(self) -> np.ndarray:
        return self.end - self.point.x

    @property
    def size(self) -> float:
        """The residual, infinite where the two ends are in different modes."""
        whole = self.status.ok and self.end_mode == self.mode and bool(np.all(np.isfinite(self.fundamental)))
        return float(np.linalg.norm(self.gap)) if whole else np.inf


@attrs.frozen(eq=False)
class _Shooting:
    system: HybridSystem
    mode: str | None
    parameters: Mapping[str, float] | None
    solver: RungeKutta

    def shoot(self, point: _Point) -> _Shot:
        n = self.system.dimension
        trajectory = start(
            self.system,
            point.x,
            point.t,
            mode=self.mode,
            parameters=self.parameters,
            solver=self.solver,
            tangent=np.eye(n),
        )
        mode, field = trajectory.mode, trajectory.field()
        code = trajectory.advance(point.t + point.period, trajectory.no_record())
        return _Shot(
            point,
            mode,
            trajectory.x,
            trajectory.mode,
            trajectory.tangent_matrix,
            field,
            trajectory.field(),
            trajectory.status(code),
        )

    def newton(
        self, point: _Point, plane: np.ndarray | None, tolerance: float, max_iterations: int
    ) -> PeriodicOrbit:
        """Newton's method from ``point``; the period is unknown too if ``plane``, a normal, is given."""
        anchor = point.x
        shot, iterations = self.shoot(point), 0
        while iterations < max_iterations and not self._closed(shot, tolerance):
            if not np.isfinite(shot.size):
                break
            step = self._step(shot, plane, anchor)
            iterations += 1
            better = self._along(shot, step)
            if better is None:
                break
            shot = better
        return self._result(shot, iterations, tolerance)

    def _closed(self, shot: _Shot, tolerance: float) -> bool:
        return shot.size <= tolerance * max(float(np.linalg.norm(shot.point.x)), 1e-300)

    def _step(self, shot: _Shot, plane: np.ndarray | None, anchor: np.ndarray) -> tuple[np.ndarray, float]:
        """Newton step of the state and of the period."""
        n = len(anchor)
        matrix = shot.fundamental - np.eye(n)
        if plane is None:
            return np.linalg.lstsq(matrix, -shot.gap, rcond=None)[0], 0.0
        bordered = np.block([[matrix, shot.end_field[:, None]], [plane[None, :], np.zeros((1, 1))]])
        right = np.append(-shot.gap, -plane @ (shot.point.x - anchor))
        step = np.linalg.lstsq(bordered, right, rcond=None)[0]
        return step[:n], float(step[n])

    def _along(self, shot: _Shot, step: tuple[np.ndarray, float]) -> _Shot | None:
        """The first shot along the step, halved as often as allowed, that closes better; else None."""
        part = 1.0
        while part >= SHORTEST_STEP:
            period = shot.point.period + part * step[1]
            if period > 0:
                trial = self._tried(attrs.evolve(shot.point, x=shot.point.x + part * step[0], period=period))
                if trial is not None and trial.size < shot.size:
                    return trial
            part /= 2
        return None

    def _tried(self, point: _Point) -> _Shot | None:
        """A shot, or None from a point that no mode allows."""
        try:
            return self.shoot(point)
        except ArgumentError:
            return None

    def autonomous(self, guess: _Point, tolerance: float, max_iterations: int) -> PeriodicOrbit:
        """Newton's method from the point of the guess's orbit farthest from jumps, then back to the guess.

        At a jump the end of the shot would depend discontinuously on the period.
        """
        shift = self._quiet_time(guess)
        shooting, moved = self._moved(guess, shift)
        normal = shooting.shoot(moved).field
        orbit = shooting.newton(moved, normal, tolerance, max_iterations)
        if orbit.status.ok and orbit.period < SHORTEST_PERIOD * guess.period:
            # Every point closes after no time at all.
            status = Status(
                StatusCode.NOT_CONVERGED,
                f"The period shrank from {guess.period:.3g} to {orbit.period:.3g}: a point, no orbit.",
                "Start nearer to the orbit, with a better guess of its period.",
            )
            return attrs.evolve(orbit, status=status)
        if not orbit.status.ok:
            return orbit
        return self._nearest(orbit, guess)

    def _quiet_time(self, guess: _Point) -> float:
        """Time after the guess at which neither it nor one period later is close to a jump."""
        arc = self._follow(guess, 2 * guess.period, self.mode, max_jumps=MOST_JUMPS_LOOKED_AT)
        jumps = np.concatenate([[0.0], arc.jumps.t - guess.t])
        candidates = np.linspace(0, guess.period, 201)[1:-1]
        distance = np.minimum(
            np.abs(candidates[:, None] - jumps).min(axis=1),
            np.abs(candidates[:, None] + guess.period - jumps).min(axis=1),
        )
        return float(candidates[np.argmax(distance)])

    def _moved(self, guess: _Point, shift: float) -> tuple[_Shooting, _Point]:
        arc = self._follow(guess, shift, self.mode)
        shooting = attrs.evolve(self, mode=str(arc.mode[-1]))
        return shooting, _Point(arc.x[-1], guess.t + shift, guess.period)

    def _nearest(self, orbit: PeriodicOrbit, guess: _Point) -> PeriodicOrbit:
        """The same orbit from the point of its arc, both sides of jumps included, nearest to the guess."""
        arc = orbit.arc(self.solver)
        i = int(np.argmin(np.linalg.norm(arc.x - guess.x, axis=1)))
        return attrs.evolve(orbit, x0=arc.x[i], mode=str(arc.mode[i]), t0=float(arc.t[i]))

    def _result(self, shot: _Shot, iterations: int, tolerance: float) -> PeriodicOrbit:
        finite = bool(np.all(np.isfinite(shot.fundamental)))
        values = np.linalg.eigvals(shot.fundamental) if finite else np.full(len(shot.end), np.nan)
        values = values[np.argsort(-np.abs(values), kind="stable")]
        return PeriodicOrbit(
            system=self.system,
            parameters=dict(self.parameters or {}),
            x0=shot.point.x,
            mode=shot.mode,
            t0=shot.point.t,
            period=shot.point.period,
            multipliers=values,
            fundamental=shot.fundamental,
            residual=float(np.linalg.norm(shot.gap)),
            iterations=iterations,
            signature=self._signature(shot),
            status=self._status(shot, iterations, tolerance),
        )

    def _signature(self, shot: _Shot) -> tuple[str, ...]:
        arc = self._follow(shot.point, shot.point.period, shot.mode)
        return (shot.mode, *(jump.target for jump in arc.jumps if jump.target is not None))

    def _follow(self, point: _Point, span: float, mode: str | None, max_jumps: int = 100_000) -> HybridArc:
        """The arc from a point over a time, without tangent vectors."""
        return simulate(
            self.system,
            point.x,
            (point.t, point.t + span),
            mode=mode,
            parameters=self.parameters,
            solver=self.solver,
            max_jumps=max_jumps,
        )

    def _status(self, shot: _Shot, iterations: int, tolerance: float) -> Status:
        if self._closed(shot, tolerance):
            return SUCCESS
        if not shot.status.ok:
            return shot.status
        if shot.end_mode != shot.mode:
            reason = f"the orbit ends in mode {shot.end_mode!r} and starts in {shot.mode!r}"
        else:
            reason = f"the residual is {np.linalg.norm(shot.gap):.3g} after {iterations} iterations"
        return Status(
            StatusCode.NOT_CONVERGED,
            f"Newton's method did not converge: {reason}.",
            "Start nearer to the orbit (simulate first if it is stable), or raise max_iterations.",
        )
