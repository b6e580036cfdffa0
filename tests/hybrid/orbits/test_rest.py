"""Components that hardly move over a period: carried somewhere, or at rest."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, periodic_orbit


def beside_a_swing(rate):
    """A component with this rate beside one that swings."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("on", lambda t, x, p: (rate(x), np.cos(t) - x.v))],
        period=2 * np.pi,
    )


def beside_kicks(rate):
    """A component with this rate beside one that is kicked once per period."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("on", lambda t, x, p: (rate(x), 1 - x.v))],
        transitions=[
            Transition(
                "on",
                "on",
                Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.25)), +1),
                Reset(lambda t, x, p: (x.q, 0.3 * x.v)),
            )
        ],
        period=1.0,
    )


@pytest.mark.parametrize("guess", [0.0, 0.1, 0.2, 0.3, 0.4, 0.45, 0.49, 0.5, 0.6, 1.0, 2.0, 10.0, 100.0])
def test_a_drift_is_no_orbit_from_any_guess(guess):
    system = beside_a_swing(lambda x: 1 / (1 + x.q**4))
    assert periodic_orbit(system, (guess, 0.5)).status.code == StatusCode.NOT_CONVERGED


@pytest.mark.parametrize("pace", [1e-17, 1e-12, 1e-9, 1e-6])
@pytest.mark.parametrize("place", [1.0, 1e6])
def test_a_steady_drift_is_no_orbit_however_slow(pace, place):
    system = beside_a_swing(lambda x: pace + 0 * x.q)
    assert periodic_orbit(system, (place, 0.5)).status.code == StatusCode.NOT_CONVERGED


@pytest.mark.parametrize("place", [0.0, 1.0, 1e6])
def test_a_component_without_motion_rests_anywhere(place):
    orbit = periodic_orbit(beside_a_swing(lambda x: 0 * x.q), (place, 0.5))
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, (place, 0.5), rtol=1e-10)


@pytest.mark.parametrize("pace", [1e-17, 1e-12, 1e-6, 1.0])
def test_a_rest_is_found_at_any_pace(pace):
    orbit = periodic_orbit(beside_a_swing(lambda x: pace * np.cos(x.q)), (1.4, 0.5))
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, (np.pi / 2, 0.5), rtol=1e-10)


@pytest.mark.parametrize("pace", [1e-12, 1e-6, 1.0])
def test_what_the_mean_of_a_swing_does_not_carry_rests(pace):
    orbit = periodic_orbit(beside_a_swing(lambda x: pace * x.v * x.q), (0.5, 0.5))
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, 0.5, rtol=1e-10)


@pytest.mark.parametrize("pace", [1e-6, 1.0])
@pytest.mark.parametrize("t0", [0.0, 0.25])
class TestJumps:
    def test_a_rest_beside_jumps_is_found(self, t0, pace):
        orbit = periodic_orbit(beside_kicks(lambda x: pace * (0.3 - x.q)), (0.2, 0.5), t0=t0)
        assert orbit.status.ok
        assert orbit.x0[0] == pytest.approx(0.3, rel=1e-10)

    def test_a_drift_beside_jumps_is_no_orbit(self, t0, pace):
        orbit = periodic_orbit(beside_kicks(lambda x: pace / (1 + x.q**4)), (0.3, 0.5), t0=t0)
        assert orbit.status.code == StatusCode.NOT_CONVERGED
