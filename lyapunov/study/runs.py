"""The computations of the study, one regime at a time; nothing is printed or drawn here."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid import (
    HybridArc,
    HybridSystem,
    PeriodicOrbit,
    Taylor,
    periodic_orbit,
    simulate,
    stroboscopic_section,
)
from hybrid.orbits.sections import Section
from hybrid.solvers import Solver
from lyapunov.spectrum import LyapunovSpectrum, lyapunov_spectrum
from lyapunov.two_orbit import TwoOrbitExponents, two_orbit_exponents

SECTION_POINTS = 2000
PORTRAIT_PERIODS = 60
# The companion starts at 1e-8: a solver whose steps are off by that much would be all that it sees.
TWO_ORBIT_TIGHTER = 1e-3


@attrs.frozen
class Start:
    """A state ``(x1, x2, v1, v2)`` to start from, and what to call it."""

    label: str
    text: str
    x0: tuple[float, float, float, float]


STARTS = (
    Start("I", "on the periodic orbit of 7.40", (-0.00765806, -0.00411675, 0.05565196, -0.35621583)),
    Start("II", "at rest", (0.0, 0.05, 0.0, 0.0)),
    Start("III", "both bodies moving", (0.0, 0.05, 0.3, 0.3)),
)


@attrs.frozen
class Settings:
    """Forcing periods averaged over and skipped before, the method, and whether to show progress."""

    intervals: int = 10_000
    transient: int = 1_000
    solver: Solver = attrs.field(factory=lambda: Taylor(rtol=1e-9, atol=1e-11))
    progress: bool = False

    @property
    def two_orbit_solver(self) -> Solver:
        """The method for two neighbouring orbits, whose small distance must stand out of the error."""
        rtol, atol = self.solver.rtol * TWO_ORBIT_TIGHTER, self.solver.atol * TWO_ORBIT_TIGHTER
        return attrs.evolve(self.solver, rtol=max(rtol, 1e-13), atol=max(atol, 1e-16))


@attrs.frozen(eq=False)
class Regime:
    """All that is computed at one frequency.

    Attributes
    ----------
    omega
        Frequency of the drive, rad/s.
    spectra
        One for each of ``STARTS``: all exponents from the first, the largest alone from the others.
    two_orbit
        The two-orbit estimates from the first start.
    orbit
        Periodic orbit of one forcing period, stable or not, that Newton's method finds from the first start.
    section, arc
        Points once a period, half a period after the drive's peak, and some periods of orbit, where the
        first start led.
    """

    omega: float
    spectra: tuple[LyapunovSpectrum, ...]
    two_orbit: TwoOrbitExponents
    orbit: PeriodicOrbit
    section: Section
    arc: HybridArc

    @property
    def impacts_per_period(self) -> tuple[float, ...]:
        """For each start. An impact is two jumps, into contact and out of it."""
        return tuple(spectrum.jumps_per_interval / 2 for spectrum in self.spectra)

    @property
    def kind(self) -> str:
        """Periodic, quasi-periodic or chaotic, by the first exponent and its standard error."""
        first = self.spectra[0]
        if not len(self.section) or np.isnan(first.standard_error[0]):
            return "undecided"
        # On regular motion the estimate is better than its standard error, which may then be next to nothing.
        value, error = first.exponents[0], max(2 * first.standard_error[0], 1e-4)
        if np.ptp(self.section.x, axis=0).max() < 1e-6 or value < -error:
            return "periodic"
        return "chaotic" if value > error else "quasi-periodic"


def study_regime(system: HybridSystem, omega: float, settings: Settings) -> Regime:
    """Exponents by every method at one frequency, with the orbit to look at.

    Parameters
    ----------
    system
        The vibro-impact system.
    omega
        Frequency of the drive, rad/s.
    settings
        How long and how accurately.
    """
    parameters, solver = {"omega": omega}, settings.solver
    spectra = tuple(
        lyapunov_spectrum(
            system,
            start.x0,
            parameters=parameters,
            k=system.dimension if start is STARTS[0] else 1,
            intervals=settings.intervals,
            transient=settings.transient,
            solver=solver,
            progress=settings.progress,
        )
        for start in STARTS
    )
    two_orbit = two_orbit_exponents(
        system,
        STARTS[0].x0,
        parameters=parameters,
        intervals=settings.intervals,
        transient=settings.transient,
        solver=settings.two_orbit_solver,
        progress=settings.progress,
    )
    # Impacts crowd around phase zero, where they would tear the section.
    period = 2 * np.pi / omega
    half = simulate(
        system, spectra[0].x, (0.0, period / 2), mode=spectra[0].mode, parameters=parameters, solver=solver
    )
    x, mode, t0 = half.x[-1], str(half.mode[-1]), period / 2
    section = stroboscopic_section(
        system,
        x,
        mode=mode,
        parameters=parameters,
        periods=min(settings.intervals, SECTION_POINTS),
        t0=t0,
        solver=solver,
        progress=settings.progress,
    )
    span = (t0, t0 + PORTRAIT_PERIODS * period)
    return Regime(
        omega=omega,
        spectra=spectra,
        two_orbit=two_orbit,
        orbit=periodic_orbit(system, STARTS[0].x0, parameters=parameters),
        section=section,
        arc=simulate(system, x, span, mode=mode, parameters=parameters, solver=solver),
    )
