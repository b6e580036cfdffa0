"""A periodic orbit, as the search for it leaves it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.closing import ROUNDING_OF_TIME
from hybrid.orbits.continuation.place import place_on
from hybrid.orbits.labelled import described_orbit, labelled_orbit, tabled_orbit
from hybrid.orbits.sensitivity import OrbitSensitivity, sensitivity_of
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.plan import check_solver
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver, Taylor
from hybrid.status import Status, StatusCode
from hybrid.system.entries import has_age
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import whole_turns
from hybrid.transform.aged import original_of

if TYPE_CHECKING:
    import xarray

# Share of the period after which a run is clear of the guards of jumps at its start.
MOMENT = 1e-8


@attrs.frozen(eq=False, repr=False)
class PeriodicOrbit:
    """A periodic orbit, or the best point that Newton's method reached.

    Where ``closes`` is false there is no orbit. Multipliers, logarithms and the fundamental matrix are
    then those of the run over the period from the best point; they say nothing of the stability of an orbit.
    What builds on orbits (`continue_orbit`, `sensitivity`,
    `lyapunov.floquet_exponents`) refuses such a point.

    With the status ``AMBIGUOUS_ORDER`` there is an orbit, on which two events come at one instant. A small
    disturbance decides which of them comes first, and each order has a derivative of its own. Multipliers,
    logarithms and the fundamental matrix are those of the order in ``transitions``.

    Attributes
    ----------
    system, parameters
        The model, and the values of all its parameters, by name. If the point lies in a mode that an
        `hybrid.After` leaves, it is the model with the time since the entry as one more component, ``age``.
    x0, mode, t0
        A point of the orbit ``(n,)``, its mode, and the time there.
    period
        Time until the orbit closes: for a forced system ``periods`` forcing periods.
    multipliers
        Floquet multipliers ``(n,)``, largest first; an autonomous orbit has one that is 1, and there is one
        more that is 1 for each cyclic component, along which orbits lie side by side. These say nothing of
        the stability. Each has its own relative accuracy, however small: they come from the factors of the
        fundamental matrix along the orbit.
    log_moduli
        Natural logarithms of the moduli of the multipliers ``(n,)``, also of those out of the range of
        floating-point numbers; minus infinity for a multiplier of zero.
    fundamental
        The saltated fundamental matrix over the period ``(n, n)``, whose eigenvalues the multipliers are; for
        an autonomous system from the point, away from jumps, where the shooting was done (elsewhere on the
        orbit it is a similar matrix).
    residual
        Distance between the two ends over the period, in the units of the state.
    iterations
        Newton iterations used.
    signature
        Names of the modes in the order they are visited.
    transitions
        Names of the transitions in the order they fire.
    status
        Whether Newton's method converged, and how far it got if not; ``AMBIGUOUS_ORDER`` for an orbit whose
        derivative depends on the order of two events.
    turns
        Whole turns of each angle of the system over the period, by name.
    shift
        By how much each cyclic component of the system is larger after the period, by name.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> round(orbit.period, 6), np.abs(orbit.multipliers).round(4)
    (6.283185, array([0.5843, 0.5843]))
    >>> bool(orbit.residual < 1e-10), orbit.signature
    (True, ('flight', 'flight'))
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    x0: np.ndarray
    mode: str
    t0: float
    period: float
    multipliers: np.ndarray
    log_moduli: np.ndarray
    fundamental: np.ndarray
    residual: float
    iterations: int
    signature: tuple[str, ...]
    transitions: tuple[str, ...]
    status: Status
    turns: Mapping[str, int] = attrs.field(factory=dict)
    shift: Mapping[str, float] = attrs.field(factory=dict)

    def __repr__(self) -> str:
        return described_orbit(self)

    def _repr_html_(self) -> str:
        """The orbit for a notebook."""
        return tabled_orbit(self)

    def to_xarray(self) -> xarray.Dataset:
        """The numbers of the orbit. Multipliers are complex: ``.to_zarr`` saves them, netCDF cannot."""
        return labelled_orbit(self)

    @property
    def closes(self) -> bool:
        """Whether there is an orbit."""
        return closes(self.status)

    @property
    def forcing_periods(self) -> int:
        """Number of forcing periods until the orbit closes; 0 for an autonomous system."""
        forcing = self.system.forcing_period(self.parameters)
        return 0 if forcing is None else max(1, round(self.period / forcing))

    def sensitivity(self, names: Iterable[str], *, solver: Solver | None = None) -> OrbitSensitivity:
        """Derivatives in parameters: of the point, ``.x0 (n, m)``, ``.period (m,)``, ``.multipliers (n, m)``.

        They are those at fixed values of the quantities that the system declares with
        ``laws=Laws(conserved=...)``: such orbits come in families, one orbit per value.

        Parameters
        ----------
        names
            Names of the parameters.
        solver
            Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.

        Raises
        ------
        ArgumentError
            If the orbit has not converged, a parameter does not exist, or the orbit is not isolated: a
            multiplier is 1, besides the one along an autonomous orbit and one per conserved quantity.
        """
        if not self.closes:
            raise ArgumentError(f"The orbit has not converged: {self.status.message}")
        given = arguments.items("names", names, "be names of parameters", least=1)
        for name in given:
            arguments.known("names: Parameter", name, self.system.parameters, "Parameters")
        method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
        place = place_on(self, tuple(given), np.ones(len(given)), method)
        found, age = sensitivity_of(place, self.t0), place.family.system.age
        if age is None or self.system.age is not None:
            return found
        x0 = np.delete(found.x0, age, axis=0)
        return attrs.evolve(found, x0=x0, multipliers=found.multipliers[:-1])

    def arc(self, solver: Solver | None = None) -> HybridArc:
        """The orbit over one period; if it jumps at its point, from just after these jumps."""
        end = self.t0 + self.period
        arc = self._run(self.x0, self.t0, end, self.mode, solver)
        if arc.status.ok and not self._jumps_at_ends(arc, solver):
            return arc
        start = self._first_moment(solver)
        after = float(start.t[-1])
        later = self._run(start.x[-1], after, after + self.period, str(start.mode[-1]), solver)
        # Rounding may put a jump at the point to either side of the end.
        jumps = len(start.jumps) > 0 or bool(np.any(np.abs(later.jumps.t - end) <= after - self.t0))
        return later if jumps and start.status.ok else arc

    def _jumps_at_ends(self, arc: HybridArc, solver: Solver | None) -> bool:
        """Whether a run around jumps at its start or at its end, or would a moment later."""
        away = np.minimum(arc.jumps.t - self.t0, self.t0 + self.period - arc.jumps.t)
        if np.any(away <= self.moment):
            return True
        end = float(arc.t[-1])
        return len(self._run(arc.x[-1], end, end + self.moment, str(arc.mode[-1]), solver).jumps) > 0

    @property
    def moment(self) -> float:
        """A time after which a run is clear of the guards of jumps at its start."""
        return max(MOMENT * self.period, ROUNDING_OF_TIME * math.ulp(abs(self.t0) + self.period))

    def _first_moment(self, solver: Solver | None) -> HybridArc:
        return self._run(self.x0, self.t0, self.t0 + self.moment, self.mode, solver)

    def _run(self, x: np.ndarray, t: float, end: float, mode: str, solver: Solver | None) -> HybridArc:
        return simulate(self.system, x, (t, end), mode=mode, parameters=self.parameters, solver=solver)


def first_start(points: Iterable[tuple[PeriodicOrbit, Sequence[str]]]) -> PeriodicOrbit:
    """The first of some points of an orbit from which a run makes the jumps at once that it is to make there.

    On a guard or a tick a state may be no start: a clock does not tick at the start of a run, and a guard of
    time alone that is zero there fires, also after its jump.
    """
    for orbit, names in points:
        if [str(name) for name in orbit._first_moment(None).jumps.transition] == list(names):
            break
    return orbit


def closes(status: Status) -> bool:
    """Whether a status is that of an orbit."""
    return status.ok or status.code == StatusCode.AMBIGUOUS_ORDER


def unaged(orbits: Sequence[PeriodicOrbit]) -> list[PeriodicOrbit]:
    """The orbits without the age, if the age counts for nothing at all of their points.

    It then has no part in their states, and the multiplier zero.
    """
    age = orbits[0].system.age if orbits else None
    if age is None or any(has_age(orbit.system, orbit.mode) for orbit in orbits):
        return [*orbits]
    return [
        attrs.evolve(
            orbit,
            system=original_of(orbit.system),
            x0=np.delete(orbit.x0, age),
            multipliers=orbit.multipliers[:-1],
            log_moduli=orbit.log_moduli[:-1],
            fundamental=np.delete(np.delete(orbit.fundamental, age, axis=0), age, axis=1),
        )
        for orbit in orbits
    ]


def turns_over(system: HybridSystem, change: np.ndarray) -> dict[str, int]:
    """Whole turns of each angle in a change of the state, which leaves out the counters, by name."""
    lengths = system.turn_lengths[: len(change)]
    turns = dict(zip(system.state_names, whole_turns(change, lengths).tolist(), strict=False))
    return {name: int(turns[name]) for name in system.angles}


def shift_over(system: HybridSystem, change: np.ndarray) -> dict[str, float]:
    """Change of each cyclic component in a change of the state, which leaves out the counters, by name."""
    changes = dict(zip(system.state_names, change.tolist(), strict=False))
    return {name: float(changes[name]) for name in system.cyclic}
