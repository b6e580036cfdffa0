"""A boost converter with an ideal diode, in discontinuous conduction."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from hybrid import continue_orbit, periodic_orbit, simulate
from lyapunov import lyapunov_spectrum
from tests.hybrid.transform.pairs.circuits import boost

P = boost().parameters


def flow(A, b, t, x):
    """State and derivative of an affine field after a time."""
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[:2, 2] = A, b
    moved = expm(whole * t)
    return moved[:2, :2] @ x + moved[:2, 2], moved[:2, :2]


@pytest.fixture(scope="module")
def system():
    return boost()


@pytest.fixture(scope="module")
def orbit(system):
    found = periodic_orbit(system, (0.0, 40.0), mode="on: free")
    assert found.status.ok
    return found


class TestPeriod:
    """One period by hand: the switch is closed, the diode conducts, the current has stopped."""

    charges = np.array([P["V"] / P["L"], 0.0])
    closed = np.array([[0.0, 0.0], [0.0, -1.0 / (P["R"] * P["C"])]])
    open = np.array([[0.0, -1.0 / P["L"]], [1.0 / P["C"], -1.0 / (P["R"] * P["C"])]])

    def by_hand(self, x):
        """The state after a period, its derivative, and when the current stops."""
        on = P["D"] * P["T"]
        x, first = flow(self.closed, self.charges, on, x)

        def left(t):
            return flow(self.open, self.charges, t, x)[0][0]

        stops = brentq(left, 1e-7, P["T"] - on, xtol=1e-18)
        x, second = flow(self.open, self.charges, stops, x)
        before, after = self.open @ x + self.charges, np.array([0.0, -x[1] / (P["R"] * P["C"])])
        jump = np.eye(2) + np.outer(after - before, [1.0, 0.0]) / before[0]
        share = np.exp(-(P["T"] - on - stops) / (P["R"] * P["C"]))
        derivative = np.diag([1.0, share]) @ jump @ second @ first
        return np.array([0.0, share * x[1]]), derivative, on + stops

    def test_a_period(self, system):
        arc = simulate(system, (0.0, 40.0), (0.0, P["T"]), mode="on: free")
        after, _, stops = self.by_hand(np.array([0.0, 40.0]))
        assert arc.jumps["diode.w"][0].t == pytest.approx(stops, rel=1e-11)
        np.testing.assert_allclose(arc.x[-1], after, rtol=1e-12)

    def test_the_current_that_has_stopped_is_zero(self, system):
        arc = simulate(system, (0.0, 40.0), (0.0, 20 * P["T"]), mode="on: free")
        stopped = arc.mode == "off: diode blocks"
        assert stopped.sum() > 20
        np.testing.assert_allclose(arc["i"][stopped], 0.0, atol=1e-15)
        # What the diode blocks is what the output has above the input.
        np.testing.assert_allclose(arc["diode.z"][stopped], arc["v"][stopped] - P["V"], rtol=1e-12)

    def test_the_gain(self, orbit):
        # The averaged gain leaves out the ripple of the output.
        K = 2.0 * P["L"] / (P["R"] * P["T"])
        gain = (1.0 + np.sqrt(1.0 + 4.0 * P["D"] ** 2 / K)) / 2.0
        assert orbit.x0[1] / P["V"] == pytest.approx(gain, rel=2e-3)

    def test_the_multipliers(self, orbit):
        after, derivative, _ = self.by_hand(orbit.x0)
        np.testing.assert_allclose(after, orbit.x0, atol=1e-8)
        expected = np.sort(np.abs(np.linalg.eigvals(derivative)))
        np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), expected, atol=1e-9)

    def test_the_exponents(self, system, orbit):
        spectrum = lyapunov_spectrum(system, orbit.x0, mode="on: free", interval=P["T"], intervals=200)
        largest = np.log(np.abs(orbit.multipliers).max()) / P["T"]
        assert spectrum.exponents[0] == pytest.approx(largest, rel=1e-4)
        assert spectrum.exponents[1] == -np.inf


def test_the_start_tells_what_is_switched(system):
    assert simulate(system, (1.0, 20.0), (0.0, 1e-6)).mode[0] == "on: free"
    assert simulate(system, (1.0, 20.0), (5e-5, 5.1e-5)).mode[0] == "off: free"
    assert simulate(system, (0.0, 20.0), (5e-5, 5.1e-5)).mode[0] == "off: diode blocks"
    wrong = simulate(system, (1.0, 20.0), (0.0, 1e-6), mode="off: free")
    assert wrong.mode[-1] == "on: free"


def test_a_branch_from_discontinuous_to_continuous_conduction(orbit):
    branch = continue_orbit(orbit, "R", (5.0, 150.0))
    borders = [each for each in branch.bifurcations if each.kind == "border"]
    assert branch.status.ok
    assert borders
    # The current just does not stop where K = D (1 - D)^2, but for the ripple of the output.
    R = 2.0 * P["L"] / (P["T"] * P["D"] * (1.0 - P["D"]) ** 2)
    assert borders[0].value == pytest.approx(R, rel=0.02)
