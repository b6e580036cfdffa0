"""The computations of the study, one regime at a time, without printing or drawing."""

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
# The companion starts at 1e-8: with a solver error of that size the distance would show only the error.
TWO_ORBIT_TIGHTER = 1e-3


@attrs.frozen
class Start:
    """A start ``(x1, x2, v1, v2)`` with its label and description."""

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
    """Forcing periods to average over and to skip first, the method, and whether to show progress."""

    intervals: int = 10_000
    transient: int = 1_000
    solver: Solver = attrs.field(factory=lambda: Taylor(rtol=1e-9, atol=1e-11))
    progress: bool = False

    @property
    def two_orbit_solver(self) -> Solver:
        """The method for two neighbouring orbits, whose distance must be well above the solver error."""
        rtol, atol = self.solver.rtol * TWO_ORBIT_TIGHTER, self.solver.atol * TWO_ORBIT_TIGHTER
        return attrs.evolve(self.solver, rtol=max(rtol, 1e-13), atol=max(atol, 1e-16))


@attrs.frozen(eq=False)
class Regime:
    """Results at one frequency.

    Attributes
    ----------
    omega
        Frequency of the drive, rad/s.
    spectra
        One per start of ``STARTS``: all exponents for the first start, the largest one for the others.
    two_orbit
        The two-orbit estimates from the first start.
    orbit
        Periodic orbit of one forcing period, stable or not, found by Newton's method from the first start.
    section, arc
        Section points once per period, half a period after the drive's peak, and an arc of several periods,
        both on the attractor of the first start.
    """

    omega: float
    spectra: tuple[LyapunovSpectrum, ...]
    two_orbit: TwoOrbitExponents
    orbit: PeriodicOrbit
    section: Section
    arc: HybridArc

    @property
    def impacts_per_period(self) -> tuple[float, ...]:
        """Impacts per period for each start. An impact is two jumps: into contact and out of contact."""
        return tuple(spectrum.jumps_per_interval / 2 for spectrum in self.spectra)

    @property
    def kind(self) -> str:
        """Periodic, quasi-periodic or chaotic, by the first exponent and its standard error."""
        first = self.spectra[0]
        if not len(self.section) or np.isnan(first.standard_error[0]):
            return "undecided"
        # On regular motion the standard error may be close to zero, so the threshold has a lower limit.
        value, error = first.exponents[0], max(2 * first.standard_error[0], 1e-4)
        if np.ptp(self.section.x, axis=0).max() < 1e-6 or value < -error:
            return "periodic"
        return "chaotic" if value > error else "quasi-periodic"


def study_regime(system: HybridSystem, omega: float, settings: Settings) -> Regime:
    """Exponents by every method at one frequency, with an arc and a section to plot.

    Parameters
    ----------
    system
        The vibro-impact system.
    omega
        Frequency of the drive, rad/s.
    settings
        Lengths of the runs, and solver.
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
    # Impacts accumulate around phase zero, where they would make the section discontinuous.
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
