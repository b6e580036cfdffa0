"""The kind of motion at one frequency, from its section and its first exponent."""

from types import SimpleNamespace

import numpy as np
import pytest

import models
from hybrid import DOP853, Taylor
from lyapunov.study.runs import PORTRAIT_PERIODS, STARTS, Regime, Settings, study_regime

SPREAD = np.array([[0.0, 1.0], [0.5, 1.0], [0.2, 1.5]])


def regime(exponent, error, points):
    spectrum = SimpleNamespace(exponents=np.array([exponent, -1.0]), standard_error=np.array([error, 0.1]))

    class Section(SimpleNamespace):
        def __len__(self):
            return len(self.x)

    return Regime(7.4, (spectrum,), None, None, Section(x=np.array(points)), None)


@pytest.mark.parametrize(
    ("exponent", "error", "points", "kind"),
    [
        (0.2, 0.01, SPREAD, "chaotic"),
        (-0.2, 0.01, SPREAD, "periodic"),
        (0.015, 0.01, SPREAD, "quasi-periodic"),
        (-0.015, 0.01, SPREAD, "quasi-periodic"),
        # Estimates of regular motion may have no error at all.
        (9e-5, 0.0, SPREAD, "quasi-periodic"),
        (2e-4, 0.0, SPREAD, "chaotic"),
        # A section of one point is that of a periodic orbit, whatever the noise of the exponent.
        (0.2, 0.01, [[0.3, 0.7], [0.3 + 9e-7, 0.7], [0.3, 0.7 - 9e-7]], "periodic"),
        (0.2, np.nan, SPREAD, "undecided"),
        (0.2, 0.01, np.empty((0, 2)), "undecided"),
    ],
)
def test_kind_of_motion(exponent, error, points, kind):
    assert regime(exponent, error, points).kind == kind


@pytest.mark.parametrize(
    ("solver", "tight"),
    [
        (Taylor(rtol=1e-9, atol=1e-11), Taylor(rtol=1e-12, atol=1e-14)),
        (DOP853(rtol=1e-6, atol=1e-8), DOP853(rtol=1e-9, atol=1e-11)),
        # A solver cannot do better than rounding.
        (DOP853(rtol=1e-12, atol=1e-14), DOP853(rtol=1e-13, atol=1e-16)),
    ],
)
def test_neighbouring_orbits_have_a_tighter_solver(solver, tight):
    found = Settings(solver=solver).two_orbit_solver
    assert type(found) is type(tight)
    assert found.rtol == pytest.approx(tight.rtol, rel=1e-12)
    assert found.atol == pytest.approx(tight.atol, rel=1e-12)


def test_an_impact_is_two_jumps():
    spectra = tuple(SimpleNamespace(jumps_per_interval=each) for each in (2.0, 1.0, 0.5))
    assert Regime(7.4, spectra, None, None, None, None).impacts_per_period == (1.0, 0.5, 0.25)


def test_a_regime_at_one_frequency():
    """All exponents from the first start and the largest from the others; the section half a period later."""
    settings = Settings(intervals=12, transient=60, solver=Taylor(rtol=1e-7, atol=1e-9))
    found = study_regime(models.vibroimpact(), 7.40, settings)
    assert [len(spectrum.exponents) for spectrum in found.spectra] == [4] + [1] * (len(STARTS) - 1)
    assert {spectrum.intervals for spectrum in found.spectra} == {12}
    assert found.two_orbit.intervals == 12
    period = 2 * np.pi / 7.40
    np.testing.assert_allclose(found.section.t, (np.arange(12) + 1.5) * period, rtol=1e-12)
    np.testing.assert_allclose(
        [found.arc.t[0], found.arc.t[-1]], [0.5 * period, (0.5 + PORTRAIT_PERIODS) * period]
    )
    np.testing.assert_allclose(found.arc(1.5 * period), found.section.x[0], atol=1e-6)
    np.testing.assert_allclose(found.orbit.x0, (-0.00765806, -0.00411675, 0.05565196, -0.35621583), atol=1e-7)
    assert found.omega == 7.40
