"""Rectifiers with ideal diodes against closed forms and against SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from hybrid import Pair, complementarity, periodic_orbit, simulate
from tests.hybrid.transform.pairs.circuits import battery, bridge, half_wave, oscillator, smoothed


def reference(rate, x0, times, **events):
    """The solution of one equation that SciPy integrates with small steps and tight tolerances."""
    options = {"rtol": 1e-11, "atol": 1e-12, "max_step": 0.02}
    found = solve_ivp(rate, (0.0, times[-1]), [x0], "DOP853", t_eval=times, **options, **events)
    return found.y[0]


@pytest.fixture(scope="module")
def coil():
    return simulate(half_wave(), (0.0,), (0.0, 20.0))


@pytest.fixture(scope="module")
def bridged():
    return simulate(bridge(), (0.0,), (0.0, 12.0))


class TestCoil:
    """x' = sin t - x + z with w = x: the current is known until it stops."""

    @staticmethod
    def current(t):
        return (np.sin(t) - np.cos(t) + np.exp(-t)) / 2.0

    def test_the_conduction_angle(self, coil):
        angle = brentq(self.current, 3.2, 6.0, xtol=1e-15)
        expected = [angle + 2.0 * np.pi * k for k in range(3)]
        np.testing.assert_allclose([each.t for each in coil.jumps["diode.w"]], expected, atol=1e-12)
        back = [2.0 * np.pi * k for k in (1, 2, 3)]
        np.testing.assert_allclose([each.t for each in coil.jumps["diode.z"]], back, atol=1e-12)

    def test_the_current(self, coil):
        t = np.linspace(0.0, 3.9, 50)
        np.testing.assert_allclose(coil(t, "i"), self.current(t), atol=1e-12)

    def test_a_blocked_current_is_zero_and_nothing_else(self, coil):
        t = np.linspace(3.95, 6.28, 50)
        assert set(coil(t, "i")) == {0.0}
        np.testing.assert_allclose(coil(t, "diode.z"), -np.sin(t), atol=1e-12)

    def test_names(self, coil):
        assert list(dict.fromkeys(map(str, coil.mode))) == ["free", "diode blocks"]
        assert set(coil["diode.w"] * coil["diode.z"]) == {0.0}

    def test_an_orbit_that_stops_forgets_its_start(self):
        orbit = periodic_orbit(half_wave(), (0.0,))
        assert orbit.status.ok
        np.testing.assert_allclose(orbit.multipliers, 0.0, atol=1e-14)


def test_a_diode_with_a_resistance_before_a_capacitor():
    p = smoothed().parameters
    arc = simulate(smoothed(), (0.0,), (0.0, 12.0))
    times = np.linspace(0.0, 12.0, 60)

    def rate(t, v):
        return (max((p["V"] * np.sin(t) - v[0]) / p["Rs"], 0.0) - v[0] / p["R"]) / p["C"]

    np.testing.assert_allclose(arc(times, "v"), reference(rate, 0.0, times), atol=1e-8)


class TestBridge:
    def test_the_voltage(self, bridged):
        p, times = bridge().parameters, np.linspace(0.0, 12.0, 60)

        def rate(t, v):
            return (max((p["V"] * abs(np.sin(t)) - v[0]) / p["Rs"], 0.0) - v[0] / p["R"]) / p["C"]

        assert bridged.status.ok
        np.testing.assert_allclose(bridged(times, "v"), reference(rate, 0.0, times), atol=1e-8)

    def test_what_no_equation_tells_is_no_number(self, bridged):
        idle = np.isin(bridged.mode, ["d3", "d4"])
        assert idle.any()
        # All diodes block: their currents are zero, and the voltages between source and load float.
        assert np.isnan(bridged["d4.z"][idle]).all()
        np.testing.assert_allclose(bridged["d1.z"][idle], 0.0, atol=1e-12)
        assert not np.isnan(bridged["d4.z"][np.isin(bridged.mode, ["d1+d3", "d2+d4"])]).any()
        assert any("not determined" in each for each in bridged.system.notes)


class TestBattery:
    """Pairs of both degrees: the current of the load stops where the source is below the battery."""

    def test_the_current(self):
        p = battery().parameters
        arc = simulate(battery(), (0.0,), (0.0, 7.0))
        found = [each.t for each in arc.jumps if each.kind != "limit"]
        assert arc.status.ok
        # The current starts where the source reaches the voltage of the battery.
        assert found[0] == pytest.approx(np.arcsin(p["E"] / p["V"]), abs=1e-12)
        # It stops where the sum of its exponential and its particular solution is zero.
        R, L, V, E, t0 = p["R"], p["L"], p["V"], p["E"], found[0]
        Z2 = R * R + L * L

        def particular(t):
            return V * (R * np.sin(t) - L * np.cos(t)) / Z2 - E / R

        def current(t):
            return particular(t) - particular(t0) * np.exp(-(t - t0) * R / L)

        stops = brentq(current, 1.5, 3.14, xtol=1e-15)
        assert found[1] == pytest.approx(stops, abs=1e-12)
        between = np.linspace(t0 + 1e-6, stops, 40)
        np.testing.assert_allclose(arc(between, "i"), current(between), atol=1e-11)
        assert set(arc(np.linspace(stops + 1e-6, np.pi + t0 - 1e-6, 20), "i")) == {0.0}

    def test_without_a_battery_the_current_flows_on(self):
        system = battery()
        p = {**system.parameters, "E": 0.0}
        arc = simulate(system, (1.0,), (0.0, 12.0), parameters={"E": 0.0})
        times = np.linspace(0.0, 12.0, 60)

        def rate(t, i):
            return (p["V"] * abs(np.sin(t)) - p["R"] * i[0]) / p["L"]

        np.testing.assert_allclose(arc(times, "i"), reference(rate, 1.0, times), atol=1e-8)


def test_two_phases_whose_currents_overlap():
    # Both currents are held at zero at times, each by the rate of its own diode, with a common coil.
    R, M = 1.0, np.array([[0.5, 0.2], [0.2, 0.5]])
    inverse = np.linalg.inv(M)

    def source(t):
        return np.array([np.sin(t) + 0.2, np.sin(t - 2.0)])

    def rates(t, x, z, p):
        u = [np.sin(t) + 0.2 - R * (x.a + x.b) + z.a, np.sin(t - 2.0) - R * (x.a + x.b) + z.b]
        return [inverse[i, 0] * u[0] + inverse[i, 1] * u[1] for i in range(2)]

    pairs = [Pair("a", w=lambda t, x, z, p: x.a), Pair("b", w=lambda t, x, z, p: x.b)]
    arc = simulate(complementarity(state=("a", "b"), rates=rates, pairs=pairs), (0.0, 0.0), (0.0, 10.0))
    assert set(map(str, arc.mode)) == {"free", "a", "b", "a+b"}

    # Moreau's time stepping: an implicit Euler step with one complementarity problem.
    h, x = 5e-3, np.zeros(2)
    implicit = np.linalg.inv(M + h * R)
    for k in range(1, 2001):
        free = implicit @ (M @ x + h * source(k * h))
        for active in ([], [0], [1], [0, 1]):
            z = np.zeros(2)
            z[active] = np.linalg.solve((h * implicit)[active][:, active], -free[active])
            x = free + h * implicit @ z
            if (z > -1e-9).all() and (x > -1e-9).all():
                break
        if k % 100 == 0:
            np.testing.assert_allclose(arc(k * h), x, atol=5e-3)


def test_the_oscillator_with_a_bridge_is_a_damped_one():
    # Whichever diodes conduct, the load takes v / R from the oscillator.
    p = oscillator().parameters
    arc = simulate(oscillator(), (10.0, 0.0), (0.0, 5e-3))
    A = np.array([[-1.0 / (p["R"] * p["C"]), -1.0 / p["C"]], [1.0 / p["L"], 0.0]])
    times = np.linspace(0.0, 5e-3, 50)
    expected = np.array([expm(A * t) @ (10.0, 0.0) for t in times])
    assert arc.status.ok
    np.testing.assert_allclose(arc(times), expected, atol=1e-9)
    assert set(map(str, arc.mode)) == {"r1+f1", "f2+r2"}
    np.testing.assert_allclose(arc["f1.z"] + arc["r2.z"], np.abs(arc["v"]) / p["R"], atol=1e-12)
