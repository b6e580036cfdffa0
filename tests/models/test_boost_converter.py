"""The boost converter compared with its map from tick to tick, in closed form."""

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

import hybrid
from models import boost_converter

P = dict(boost_converter().parameters)
TIGHT = hybrid.Taylor(rtol=1e-13, atol=1e-15)


def image(x, p):
    """``(i, v)`` from one tick to the next, with the switch opened once."""
    i, v = x
    on = (p["I_ref"] - i) / (p["E"] / p["L"] + p["m_c"])
    i, v = i + p["E"] / p["L"] * on, v * np.exp(-on / (p["R"] * p["C"]))
    values, vectors = np.linalg.eig([[0.0, -1 / p["L"]], [1 / p["C"], -1 / (p["R"] * p["C"])]])
    rest = np.array([p["E"] / p["R"], p["E"]])
    shares = np.linalg.solve(vectors, np.array([i, v]) - rest) * np.exp(values * (p["T"] - on))
    return (vectors @ shares + rest).real


def jacobian(x, p, h=1e-6):
    steps = np.diag(h * np.abs(x))
    return np.column_stack([(image(x + e, p) - image(x - e, p)) / (2 * e.sum()) for e in steps])


def fixed_point(p):
    return fsolve(lambda x: image(x, p) - x, (0.5 * p["I_ref"], 15.0), xtol=1e-13)


@pytest.mark.parametrize("slope", [0.0, 3000.0])
def test_ticks(slope):
    p = {**P, "m_c": slope, "I_ref": 1.0}
    x = np.array([0.4, 14.0])
    arc = hybrid.simulate(
        boost_converter(),
        (*x, 0.0),
        (0.0, 20 * P["T"]),
        parameters={"m_c": slope, "I_ref": 1.0},
        solver=TIGHT,
    )
    ticks = arc.jumps["tick"]
    assert [jump.transition for jump in arc.jumps] == ["peak", "tick"] * 20
    for k, jump in enumerate(ticks, 1):
        x = image(x, p)
        assert jump.t == pytest.approx(k * P["T"], rel=4e-16)
        np.testing.assert_allclose(jump.x_plus, [*x, 0.0], rtol=1e-9)


@pytest.mark.parametrize(("I_ref", "slope"), [(0.8, 0.0), (1.2, 0.0), (1.2, 3000.0)])
def test_multipliers(I_ref, slope):
    p = {**P, "I_ref": I_ref, "m_c": slope}
    x = fixed_point(p)
    orbit = hybrid.periodic_orbit(boost_converter(), (*x, 0.0), parameters={"I_ref": I_ref, "m_c": slope})
    np.testing.assert_allclose(orbit.x0, [*x, 0.0], rtol=1e-9, atol=1e-12)
    expected = sorted([*np.linalg.eigvals(jacobian(x, p)), 0.0], key=abs)
    np.testing.assert_allclose(sorted(orbit.multipliers, key=abs), expected, atol=1e-7)


def test_the_period_doubles():
    """The peak at which the map's multiplier is -1; a ramp moves it up."""

    def least(I_ref, slope):
        p = {**P, "I_ref": I_ref, "m_c": slope}
        return np.linalg.eigvals(jacobian(fixed_point(p), p)).real.min() + 1.0

    flips = []
    for slope, (low, high) in ((0.0, (1.0, 2.2)), (1500.0, (1.5, 2.45))):
        start = fixed_point({**P, "I_ref": low, "m_c": slope})
        orbit = hybrid.periodic_orbit(
            boost_converter(), (*start, 0.0), parameters={"I_ref": low, "m_c": slope}
        )
        (flip,) = hybrid.continue_orbit(orbit, "I_ref", (low, high)).bifurcations
        assert flip.kind == "flip"
        assert flip.value == pytest.approx(brentq(least, low, high, args=(slope,)), rel=1e-6)
        flips.append(flip.value)
    assert flips[0] == pytest.approx(1.7060, abs=1e-4)
    assert flips[1] > flips[0] + 0.5


@pytest.mark.parametrize("duty", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_large_capacitor(duty, share):
    """A deviation of the current grows as in the textbook: -D / (1 - D) without a ramp."""
    v, m_1 = P["E"] / (1 - duty), P["E"] / P["L"]
    m_2 = (v - P["E"]) / P["L"]
    m_c = share * m_2
    i = 2.0 - (m_1 + m_c) * duty * P["T"]
    given = {"C": 1e6, "I_ref": 2.0, "m_c": m_c}
    arc = hybrid.simulate(
        boost_converter(), (i, v, 0.0), (0.0, P["T"]), parameters=given, tangent=True, solver=TIGHT
    )
    assert arc.x[-1, 0] == pytest.approx(i, abs=1e-9)
    assert arc.fundamental[0, 0] == pytest.approx(-(m_2 - m_c) / (m_1 + m_c), abs=1e-8)


def test_a_clock_pulse_finds_the_switch_closed():
    arc = hybrid.simulate(boost_converter(), (0.0, 10.0, 0.0), (0.0, 5e-4), parameters={"I_ref": 3.0})
    assert [jump.transition for jump in arc.jumps][:4] == ["stay", "stay", "peak", "tick"]
    assert arc.jumps["peak"][0].t == pytest.approx(3.0 / (P["E"] / P["L"]), rel=1e-12)
