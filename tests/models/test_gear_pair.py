"""The gear pair with backlash: free motion and contact loss in closed form, and the bent resonance."""

import math

import mpmath as mp
import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid.measures import amplitude, maximum, mean
from models import gear_pair

TIGHT = hybrid.Taylor(rtol=1e-12, atol=1e-14)
ZETA, F, E = 0.05, 0.1, 0.05
UNDAMPED = {"zeta": 0.0, "e": 0.0}


def linear(w):
    """Amplitude about ``1 + F`` while the teeth stay in contact."""
    return E * w**2 / np.hypot(1.0 - w**2, 2 * ZETA * w)


def losses():
    """Frequencies at which the teeth begin to separate: the linear amplitude is the load."""
    # With s = w^2: E^2 s^2 = F^2 ((1 - s)^2 + 4 zeta^2 s).
    return np.sqrt(np.sort(np.roots([F**2 - E**2, F**2 * (4 * ZETA**2 - 2.0), F**2])))


@pytest.mark.parametrize("V", [0.01, 0.1, 0.6])
def test_free_motion_under_load(V):
    """Contact about the load, then a flight: a parabola that comes back before the back sides are met."""
    contact, flight = 2 * math.pi - 2 * math.atan(V / F), 2 * V / F
    arc = hybrid.simulate(
        gear_pair(),
        (1.0, V),
        (0.0, contact + flight),
        mode="drive",
        parameters=UNDAMPED,
        tangent=True,
        solver=TIGHT,
    )
    assert arc.jumps[0].transition == "separate"
    assert arc.jumps.t[0] == pytest.approx(contact, abs=1e-10)
    np.testing.assert_allclose(arc.x[-1], (1.0, V), rtol=0, atol=1e-10)
    assert maximum("x")(arc) == pytest.approx(1.0 + F + math.hypot(F, V), abs=1e-10)
    # A motion that starts faster is later by this after one period.
    slower = 2 / F - 2 * F / (F**2 + V**2)
    np.testing.assert_allclose(arc.fundamental[:, 1], [-slower * V, 1.0 - slower * F], atol=1e-8)
    assert np.linalg.det(arc.fundamental) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("V", [0.05, 0.5, 20.0])
def test_free_motion_without_load(V):
    """Both sides are struck in turn; the gap is crossed at one speed."""
    period = 2 * math.pi + 4 / V
    arc = hybrid.simulate(
        gear_pair(), (0.0, V), (0.0, period), parameters={**UNDAMPED, "F": 0.0}, solver=TIGHT
    )
    assert [jump.transition for jump in arc.jumps] == ["mesh", "separate", "strike back", "leave back"]
    times = np.array([1 / V, 1 / V + math.pi, 3 / V + math.pi, 3 / V + 2 * math.pi])
    np.testing.assert_allclose(arc.jumps.t, times, rtol=0, atol=1e-10 * period)
    assert amplitude("x")(arc) == pytest.approx(1.0 + V, rel=1e-10)


@pytest.mark.parametrize("name", ["separate", "mesh", "strike back", "leave back"])
def test_the_force_is_continuous(name):
    system = gear_pair()
    x = (1.0 if name in ("separate", "mesh") else -1.0, -0.3 if name in ("separate", "strike back") else 0.3)
    saltation = hybrid.saltation_matrix(system, name, 0.2, x)
    np.testing.assert_allclose(saltation, np.eye(2), atol=1e-14)


@pytest.fixture(scope="module")
def resonance():
    above = hybrid.periodic_orbit(gear_pair(), (1.0 + F, 0.0), parameters={"w": 1.6})
    outputs = {"amplitude": amplitude("x"), "peak force": maximum("force"), "load": mean("force")}
    return hybrid.continue_orbit(above, "w", (0.4, 1.6), outputs=outputs)


def test_teeth_separate_where_the_linear_response_is_the_load(resonance):
    grazings = sorted(each.value for each in resonance.of("grazing"))
    np.testing.assert_allclose(grazings, losses(), rtol=0, atol=1e-8)


def test_the_linear_part_of_the_resonance(resonance):
    low, high = losses()
    contact = np.array([len(resonance.orbit(i).transitions) == 0 for i in range(len(resonance))])
    w = resonance.parameter[contact]
    assert np.all((w < low + 1e-9) | (w > high - 1e-9))
    np.testing.assert_allclose(resonance["amplitude"][contact], linear(w), rtol=0, atol=1e-10)
    np.testing.assert_allclose(resonance["peak force"][contact], F + linear(w), rtol=0, atol=1e-10)


def test_the_mesh_carries_the_load_on_average(resonance):
    """Over a period the velocity comes back, so the mean force is the load, separation or not."""
    np.testing.assert_allclose(resonance["load"], F, rtol=0, atol=1e-10)


def test_the_resonance_bends_to_low_frequencies(resonance):
    """Two folds with an unstable part between them; the highest amplitude lies below the linear resonance."""
    upper, lower = sorted((each.value for each in resonance.of("fold")), reverse=True)
    assert losses()[0] < upper < 0.85
    assert lower < 0.75
    assert resonance.parameter[np.argmax(resonance["amplitude"])] < 0.75
    unstable = resonance.parameter[~resonance.stable]
    assert lower - 1e-9 <= unstable.min()
    assert unstable.max() <= upper + 1e-9


def orbit_with_separation(w):
    """One contact and one flight per period, both in closed form: the phase of separation and its speed."""
    with mp.workdps(30):
        damped = mp.sqrt(1 - mp.mpf(ZETA) ** 2)
        period = 2 * mp.pi / w

        def response(stiffness, t):
            """Particular solution of ``x'' + 2 zeta x' + stiffness x = E w^2 cos(w t)`` and its rate."""
            z = E * w**2 / (stiffness - w**2 + 2j * ZETA * w) * mp.expj(w * t)
            return mp.re(z), mp.re(1j * w * z)

        def contact(t, v, stay):
            """Compression and rate after a stay in contact that began at ``t`` with the speed ``v``."""
            (p, q), (r, s) = response(1, t), response(1, t + stay)
            a, b = -F - p, v - q
            decay, c, d = mp.exp(-ZETA * stay), mp.cos(damped * stay), mp.sin(damped * stay)
            x = decay * (a * c + (b + ZETA * a) / damped * d)
            rate = decay * (b * c - (ZETA * b + a) / damped * d)
            return F + r + x, s + rate

        def flight(t, v, stay):
            (p, q), (r, s) = response(0, t), response(0, t + stay)
            drift = F / (2 * mp.mpf(ZETA))
            b, decay = v - q - drift, mp.exp(-2 * ZETA * stay)
            return r - p + drift * stay + b * (1 - decay) / (2 * ZETA), s + drift + b * decay

        def closing(t, stay, v):
            x, out = contact(t, v, stay)
            y, back = flight(t + stay, out, period - stay)
            return x, y, back - v

        return closing, period


@pytest.mark.parametrize("w", [0.9, 1.2])
def test_a_forced_orbit_that_separates(w, resonance):
    i = int(np.argmin(np.abs(resonance.parameter - w)))
    orbit = hybrid.periodic_orbit(
        gear_pair(), resonance.x0[i], mode=str(resonance.mode[i]), parameters={"w": w}
    )
    jumps = orbit.arc(TIGHT).jumps
    mesh = next(jump for jump in jumps if jump.transition == "mesh")
    separate = next(jump for jump in jumps if jump.transition == "separate")
    closing, period = orbit_with_separation(w)
    stay = (separate.t - mesh.t) % float(period)
    with mp.workdps(30):
        t, stay, v = mp.findroot(closing, (mesh.t, stay, mesh.x_minus[1]))
    assert float((mesh.t - t + period / 2) % period - period / 2) == pytest.approx(0.0, abs=1e-9)
    assert mesh.x_minus[1] == pytest.approx(float(v), abs=1e-9)


def test_changing_stiffness():
    """It drives the gears like an error does: the linear response is that of ``kappa F`` once per tooth."""
    small = {"e": 0.0, "kappa": 1e-5, "w": 0.6}
    orbit = hybrid.periodic_orbit(gear_pair(), (1.0 + F, 0.0), parameters=small)
    expected = 1e-5 * F / math.hypot(1.0 - 0.6**2, 2 * ZETA * 0.6)
    assert amplitude("x")(orbit.arc(TIGHT)) == pytest.approx(expected, rel=1e-4)


def test_exponents():
    """The multipliers of the orbit at resonance multiply to what the damping leaves."""
    result = lyapunov.lyapunov_spectrum(gear_pair(), (1.2, 0.0), parameters={"w": 0.95}, intervals=300)
    assert result.exponents.sum() == pytest.approx(-2 * ZETA, abs=1e-9)
