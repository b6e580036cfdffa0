"""The published and exactly solvable cases, through simulation, saltation, orbits and exponents."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from tests.cases import systems
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)

SWITCHED = reference("switched_linear")
FRICTION = reference("stick_slip")
SALTATION = reference("saltation")

runs = pytest.mark.parametrize("run", SWITCHED, ids=lambda run: str(run["x0"]))


def in_order(multipliers):
    return sorted(map(complex, multipliers), key=lambda m: (round(m.real, 9), m.imag))


class TestSwitchedLinear:
    @runs
    def test_switching_times_and_sensitivities(self, run):
        arc = hybrid.simulate(
            systems.switched_linear(),
            run["x0"],
            (0.0, run["t_end"]),
            mode="first",
            tangent=True,
            solver=TIGHT,
        )
        np.testing.assert_allclose([jump.t for jump in arc.jumps], run["switching_times"], atol=1e-12)
        np.testing.assert_allclose(arc.x[-1], run["x_end"], atol=1e-10)
        np.testing.assert_allclose(arc.fundamental, run["sensitivity"], atol=1e-9)


@pytest.fixture(scope="module")
def rides():
    """The block on the belt over more than two periods."""
    span = (0.0, 2.4 * FRICTION["period"])
    return hybrid.simulate(systems.stick_slip(), TestStickSlip.START, span, mode="stick", solver=TIGHT)


class TestStickSlip:
    START = (0.5, 0.2)

    def test_release_does_not_stick_again_at_once(self, rides):
        """The slip starts on the guard of sticking with zero relative speed."""
        release, catch, again = rides.jumps[:3]
        assert release.t == pytest.approx(2.5, rel=1e-10)
        assert catch.t - release.t == pytest.approx(FRICTION["slip"], rel=1e-8)
        assert again.t - catch.t == pytest.approx(FRICTION["stick"], rel=1e-8)

    def test_state_at_the_catch(self, rides):
        np.testing.assert_allclose(rides.jumps[1].x_plus, [FRICTION["x_restick"], 0.2], atol=1e-8)

    def test_largest_displacement(self, rides):
        t = np.linspace(2.6, 4.0, 20001)
        assert rides(t)[:, 0].max() == pytest.approx(FRICTION["x_largest"], abs=1e-8)

    def test_release_is_smooth_and_the_catch_loses_a_direction(self, rides):
        release, catch = rides.jumps[:2]
        np.testing.assert_allclose(release.saltation, np.eye(2), atol=1e-8)
        assert np.linalg.matrix_rank(catch.saltation, tol=1e-8) == 1

    def test_orbit(self):
        orbit = hybrid.periodic_orbit(systems.stick_slip(), self.START, mode="stick", period=12.0)
        assert orbit.period == pytest.approx(FRICTION["period"], rel=1e-8)
        np.testing.assert_allclose(in_order(orbit.multipliers), [0.0, 1.0], atol=1e-8)

    def test_a_lost_direction_has_exponent_minus_infinity(self):
        result = lyapunov.lyapunov_spectrum(
            systems.stick_slip(), self.START, mode="stick", interval=FRICTION["period"], intervals=20
        )
        assert result.exponents[0] == pytest.approx(0.0, abs=1e-3)
        assert result.exponents[1] == -math.inf


class TestSaltation:
    def test_constant_fields(self):
        found = hybrid.saltation_matrix(systems.constant_fields(), "left->right", 0.0, (0.0, 0.0))
        np.testing.assert_allclose(found, SALTATION["constant_fields"], atol=1e-15)

    def test_landing_on_an_incline(self):
        """The same projection for positions and velocities, whatever the velocity of landing."""
        angle = SALTATION["incline"]["angle"]
        system = systems.incline()
        for velocity in ((0.0, -2.0), (1.0, -3.0), (-0.5, -1.0)):
            landing = (-math.cos(angle), math.sin(angle), *velocity)
            found = hybrid.saltation_matrix(system, "landing", 0.0, landing, parameters={"a": angle})
            np.testing.assert_allclose(found, SALTATION["incline"]["saltation"], atol=1e-12)


class TestJerk:
    """Piecewise-linear chaos with a continuous field."""

    START = (-1.0, 0.1, 0.0)

    def test_saltation_is_the_identity(self):
        arc = hybrid.simulate(systems.jerk(), self.START, (0.0, 50.0), mode="left")
        assert len(arc.jumps) > 5
        for jump in arc.jumps:
            np.testing.assert_allclose(jump.saltation, np.eye(3), atol=1e-9)

    def test_spectrum(self):
        """Linz and Sprott (1999) print (0.0362, 0, -0.6362), from a run of unknown length."""
        result = lyapunov.lyapunov_spectrum(
            systems.jerk(), self.START, mode="left", interval=2.0, intervals=40_000
        )
        np.testing.assert_allclose(result.exponents, [0.0369, 0.0, -0.6369], atol=6e-3)
        assert result.exponents.sum() == pytest.approx(-0.6, abs=1e-6)
