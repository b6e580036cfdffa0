"""The impact oscillator compared with closed forms: orbits with one impact, twenty impacts, the exponents."""

import math

import mpmath as mp
import numpy as np
import pytest

import hybrid
import lyapunov
from models import impact_oscillator
from models.one_impact import _free_flow, one_impact_orbits
from tests.reference.load import complex_pairs, reference

REFERENCE = reference("impact_oscillator")
ORBITS = REFERENCE["orbits"]
FLIGHT = REFERENCE["flight"]
NAMES = ("k", "c", "A", "w", "d", "r")
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-13)

every_orbit = pytest.mark.parametrize("orbit", ORBITS, ids=lambda orbit: f"w={orbit['w']}, n={orbit['n']}")


def in_order(multipliers):
    return sorted(multipliers, key=lambda m: (round(m.real, 9), m.imag))


def parameters_of(orbit):
    return {name: orbit[name] for name in NAMES}


def impact_and_section(orbit):
    """Times of the impact and of a section half a flight later, away from the event."""
    impact = orbit["theta"] / orbit["w"]
    return impact, impact + math.pi * orbit["n"] / orbit["w"]


@every_orbit
def test_closed_form_orbit(orbit):
    closed, *others = one_impact_orbits(**parameters_of(orbit), n=orbit["n"])
    assert not others
    np.testing.assert_allclose(closed[:2], (orbit["V"], orbit["theta"]), atol=1e-12)
    np.testing.assert_allclose(in_order(closed.multipliers), complex_pairs(orbit["multipliers"]), atol=1e-12)


def test_published_orbit():
    (orbit,) = one_impact_orbits(1, 0.1, 1, 1, 1, 0.8)
    np.testing.assert_allclose(orbit[:2], (1.695732937595, 0.075952164938), atol=1e-12)


def test_no_orbit_where_the_stop_is_out_of_reach():
    assert one_impact_orbits(1, 0.1, 1, 1, 11, 0.8) == []


def test_closed_form_holds_at_critical_damping():
    (critical,) = one_impact_orbits(1, 2.0, 1, 2, 0.1, 0.8)
    (nearby,) = one_impact_orbits(1, 2.0 + 1e-9, 1, 2, 0.1, 0.8)
    np.testing.assert_allclose(critical[:2], nearby[:2], rtol=1e-7)


@every_orbit
def test_shooting_finds_the_closed_form_orbit(orbit):
    impact, t0 = impact_and_section(orbit)
    parameters = parameters_of(orbit)
    start = hybrid.simulate(
        impact_oscillator(), (orbit["d"], -orbit["r"] * orbit["V"]), (impact, t0), parameters=parameters
    ).x[-1]
    found = hybrid.periodic_orbit(
        impact_oscillator(), start + 1e-3, parameters=parameters, t0=t0, periods=orbit["n"]
    )
    np.testing.assert_allclose(found.x0, start, atol=1e-7)
    np.testing.assert_allclose(in_order(found.multipliers), complex_pairs(orbit["multipliers"]), atol=1e-8)
    assert found.period == pytest.approx(2 * math.pi * orbit["n"] / orbit["w"], rel=1e-14)


def test_twenty_impacts():
    arc = hybrid.simulate(impact_oscillator(), FLIGHT["x0"], (0.0, FLIGHT["t_end"]), solver=TIGHT)
    np.testing.assert_allclose([jump.t for jump in arc.jumps], FLIGHT["t"], rtol=1e-10)
    np.testing.assert_allclose([jump.x_minus[1] for jump in arc.jumps], FLIGHT["v_minus"], rtol=1e-9)
    np.testing.assert_allclose(arc.x[-1], FLIGHT["x_end"], atol=1e-9)


@pytest.mark.parametrize(
    ("solver", "order", "tolerances"),
    [(hybrid.DOP853, 8, (1e-6, 1e-8, 1e-10)), (hybrid.Tsit5, 5, (1e-5, 1e-7, 1e-9))],
)
def test_error_across_impacts_falls_with_the_tolerance(solver, order, tolerances):
    """An event of lower accuracy would limit the error from below."""
    errors = []
    for tolerance in tolerances:
        arc = hybrid.simulate(
            impact_oscillator(),
            FLIGHT["x0"],
            (0.0, FLIGHT["t_end"]),
            solver=solver(rtol=tolerance, atol=tolerance),
        )
        errors.append(np.abs(arc.x[-1] - FLIGHT["x_end"]).max())
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope > order / (order + 1) - 0.15


def test_areas_contract_as_the_damping_and_the_impacts_say():
    """``det Phi = r^(2 N) exp(-c t)`` after N impacts on any orbit, here a chaotic one."""
    c, r, t_end = 0.1, 0.8, 20.0
    parameters = {"c": c, "w": 2.8, "d": 0.0, "r": r}
    arc = hybrid.simulate(
        impact_oscillator(), (-0.1, 0.0), (0.0, t_end), parameters=parameters, tangent=True, solver=TIGHT
    )
    assert len(arc.jumps) > 3
    exact = r ** (2 * len(arc.jumps)) * math.exp(-c * t_end)
    assert np.linalg.det(arc.fundamental) == pytest.approx(exact, rel=1e-7)


def test_exponents_of_the_published_orbit():
    exact = math.log(0.8 * math.exp(-0.1 * math.pi)) / (2 * math.pi)
    result = lyapunov.lyapunov_spectrum(impact_oscillator(), (0.0, 0.0), intervals=2000)
    np.testing.assert_allclose(result.exponents, [exact, exact], atol=3e-3)
    assert result.exponents.sum() == pytest.approx(2 * exact, abs=1e-3)


@pytest.mark.parametrize("beyond", [1e-3, 1e-5, 1e-7, 1e-8])
def test_near_grazing_an_orbit_listed_has_no_impact_on_its_way(beyond):
    """Just beyond grazing every maximum between impacts is close to the stop, and some exceed it."""
    p = {"k": 0.1, "c": 1.1, "w": 1.0, "d": 1.0, "r": 0.8}
    p["A"] = (1 + beyond) * p["d"] * math.hypot(p["k"] - p["w"] ** 2, p["c"] * p["w"])
    listed = [(n, orbit) for n in range(1, 19) for orbit in one_impact_orbits(**p, n=n)]
    assert len(listed) >= 6
    for n, orbit in listed:
        t, end = orbit.theta / p["w"], 2 * math.pi * n / p["w"]
        after = (p["d"], -p["r"] * orbit.V)
        arc = hybrid.simulate(impact_oscillator(), after, (t, t + end + 1.0), parameters=p, solver=TIGHT)
        assert arc.jumps[0].t - t == pytest.approx(end, abs=1e-3), n


@pytest.mark.parametrize("factor", [1e-9, 1e-3, 1e6])
def test_orbits_with_one_impact_in_any_units_of_time(factor):
    slow = one_impact_orbits(1.0, 0.1, 0.5, 0.8, 1.0, 0.7)
    fast = one_impact_orbits(factor**2, 0.1 * factor, 0.5 * factor**2, 0.8 * factor, 1.0, 0.7)
    assert len(slow) == len(fast) == 1
    assert pytest.approx(factor * slow[0].V, rel=1e-12) == fast[0].V
    np.testing.assert_allclose(fast[0].multipliers, slow[0].multipliers, rtol=1e-12)


@pytest.mark.parametrize("c", [-3.0, 0.0, 2.0, 2.0000001, 3.0, 300.0])
@pytest.mark.parametrize("k", [1.0, -1.0])
def test_the_free_flow_is_the_exponential_of_its_matrix(k, c):
    """With strong damping the hyperbolic functions alone are beyond the range of floats."""
    exact = mp.expm(5 * mp.matrix([[0, 1], [-k, -c]]))
    np.testing.assert_allclose(
        _free_flow(k, c, 5.0), np.array(exact.tolist(), dtype=float), rtol=1e-11, atol=1e-13
    )


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ({"k": 0.0}, "singular"),
        ({"c": 0.0, "w": 0.5}, "singular"),  # the free oscillator closes by itself
        ({"c": 0.0, "w": 1.0}, "divide by zero"),
        ({"A": 1e300}, "overflow"),
        ({"k": -1e300}, "overflow"),
        ({"d": 1e300}, "out of range"),
    ],
)
def test_where_the_closed_form_fails_the_error_says_so(values, why):
    given = {"k": 1.0, "c": 0.1, "A": 0.5, "w": 0.8, "d": 1.0, "r": 0.7, **values}
    with pytest.raises(hybrid.ArgumentError, match=f"^one_impact_orbits: the closed form .*{why}"):
        one_impact_orbits(**given)
