"""The slider-crank with clearance against motion and impacts computed without the library, and its energy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hybrid import Contact, mechanics, simulate
from hybrid.testing import Case, check_contact_forces, check_gaps, check_impacts
from models import slider_crank
from models.slider_crank import CORNERS, PARAMETERS

P = PARAMETERS
# The start of the paper, and one with a tilt.
LINE, TILTED = (0.0, 0.0, 0.0, 150.0, -75.0, 0.0), (0.0, 0.0, 0.005, 150.0, -75.0, 0.0)


def masses(x):
    both = (P["m2"] / 2 + P["m3"]) * P["l1"] * P["l2"]
    crank = P["J1"] + (P["m1"] / 4 + P["m2"] + P["m3"]) * P["l1"] ** 2
    rod = P["J2"] + (P["m2"] / 4 + P["m3"]) * P["l2"] ** 2
    turned = both * np.cos(x[1] - x[0])
    return np.array([[crank, turned, 0.0], [turned, rod, 0.0], [0.0, 0.0, P["J3"]]]), both


def rates(_, x):
    M, both = masses(x)
    sin = both * np.sin(x[1] - x[0])
    h = [
        sin * x[4] ** 2 - P["g"] * (P["m1"] / 2 + P["m2"] + P["m3"]) * P["l1"] * np.cos(x[0]),
        -sin * x[3] ** 2 - P["g"] * (P["m2"] / 2 + P["m3"]) * P["l2"] * np.cos(x[1]),
        0.0,
    ]
    return [*x[3:], *np.linalg.solve(M, h)]


def corner(name, x):
    """Position of a corner and its derivatives (2, 3) in the angles."""
    along, up = CORNERS[name]
    lengths = [(P["l1"], x[0]), (P["l2"], x[1])]
    turned = np.array([along * P["a"], up * P["b"]])
    cos, sin = np.cos(x[2]), np.sin(x[2])
    own = np.array([[cos, -sin], [sin, cos]]) @ turned
    place = sum(r * np.array([np.cos(a), np.sin(a)]) for r, a in lengths) + own
    slopes = [r * np.array([-np.sin(a), np.cos(a)]) for r, a in lengths]
    return place, np.array([*slopes, [-own[1], own[0]]]).T


def gap(name, x):
    return P["b"] + P["c"] - CORNERS[name][1] * corner(name, x)[0][1]


def test_the_motion_to_the_first_impact():
    touches = [lambda t, x, name=name: gap(name, x) for name in CORNERS]
    for each in touches:
        each.terminal, each.direction = True, -1
    free = solve_ivp(
        rates, (0.0, 0.01), TILTED, method="DOP853", events=touches, rtol=1e-12, atol=1e-13, dense_output=True
    )
    arc = simulate(slider_crank(), TILTED, (0.0, 0.004))
    first = arc.jumps[0]
    assert first.t == pytest.approx(free.t[-1], abs=1e-11)
    np.testing.assert_allclose(first.x_minus, free.y[:, -1], rtol=1e-9, atol=1e-9)
    [hit] = [name for name, times in zip(CORNERS, free.t_events, strict=True) if len(times)]
    assert arc.jumps[hit][0].t == first.t
    t = np.linspace(0.0, first.t, 9)[:-1]
    np.testing.assert_allclose(arc(t), free.sol(t).T, rtol=1e-9, atol=1e-9)


def test_an_impact_with_friction():
    """The corner slips on: the impulse of friction is mu times that of the guide."""
    arc = simulate(slider_crank(), TILTED, (0.0, 0.004), parameters={"mu": 0.1})
    first = arc.jumps[0]
    x, before = first.x_minus[:3], first.x_minus[3:]
    [name] = [each for each in CORNERS if abs(gap(each, x)) < 1e-10]
    slopes = corner(name, x)[1]
    along, across = slopes[0], -CORNERS[name][1] * slopes[1]
    assert across @ before < 0.0
    push = np.linalg.solve(masses(x)[0], across - 0.1 * np.sign(along @ before) * along)
    after = before - (1 + P["e"]) * (across @ before) / (across @ push) * push
    assert np.sign(along @ after) == np.sign(along @ before)
    np.testing.assert_allclose(first.x_plus[3:], after, rtol=1e-9)


def test_masses_and_forces_are_those_of_the_energies():
    def kinetic(t, x, p):
        return np.array([x.w1, x.w2, x.w3]) @ _mass_rows(t, x, p) @ np.array([x.w1, x.w2, x.w3]) / 2

    def potential(t, x, p):
        crank = p.g * (p.m1 / 2 + p.m2 + p.m3) * p.l1 * np.sin(x.theta1)
        return crank + p.g * (p.m2 / 2 + p.m3) * p.l2 * np.sin(x.theta2)

    system = slider_crank()
    names = system.state_names
    by_energies = mechanics(
        coordinates=names[:3],
        velocities=names[3:],
        kinetic=kinetic,
        potential=potential,
        parameters=P,
        contacts=[Contact("far", gap=lambda t, x, p: 1.0 + x.theta3)],
    )
    one, other = (simulate(each, TILTED, (0.0, 0.002)) for each in (system, by_energies))
    assert len(one.jumps) == len(other.jumps) == 0
    np.testing.assert_allclose(one.x[-1], other.x[-1], rtol=1e-10, atol=1e-12)


def _mass_rows(t, x, p):
    both = (p.m2 / 2 + p.m3) * p.l1 * p.l2 * np.cos(x.theta2 - x.theta1)
    crank = p.J1 + (p.m1 / 4 + p.m2 + p.m3) * p.l1**2
    rod = p.J2 + (p.m2 / 4 + p.m3) * p.l2**2
    return np.array([[crank, both, 0.0], [both, rod, 0.0], [0.0, 0.0, p.J3]])


def test_energy_stays_without_losses():
    arc = simulate(slider_crank(), TILTED, (0.0, 0.02), parameters={"e": 1.0, "mu": 0.0})
    assert arc.status.ok
    assert len(arc.jumps) > 10
    np.testing.assert_allclose(arc["energy"], arc["energy"][0], rtol=1e-9)


def test_energy_never_grows_and_gaps_stay_open():
    arc = simulate(slider_crank(), TILTED, (0.0, 0.02))
    assert len(arc.jumps) > 20
    assert (np.diff(arc["energy"]) < 1e-10 * arc["energy"][0]).all()
    assert arc["energy"][-1] < 0.995 * arc["energy"][0]
    for name in CORNERS:
        assert arc[f"{name}.gap"].min() > -1e-9


def test_both_corners_of_a_side_hit_at_the_start_of_the_paper():
    arc = simulate(slider_crank(), LINE, (0.0, 0.02))
    first = arc.jumps["rear top+front top"][0]
    assert first.t == arc.jumps[0].t
    rate = [corner("rear top", x[:3])[1][1] @ x[3:] for x in (first.x_minus, first.x_plus)]
    assert rate[1] == pytest.approx(-P["e"] * rate[0], rel=1e-9)
    np.testing.assert_allclose(arc["theta3"], 0.0, atol=1e-9)
    # Its bounces end in sliding along the guide, which presses harder with the corner that friction loads.
    slides = arc.mode == "rear top slips -, front top slips -"
    assert slides.any()
    normal, tangential = (
        np.array([arc[f"{name}.{what}"][slides] for name in ("rear top", "front top")])
        for what in ("normal", "tangential")
    )
    np.testing.assert_allclose(tangential, P["mu"] * normal, rtol=1e-9)
    moment = P["a"] * (normal[0] - normal[1]) - P["b"] * tangential.sum(axis=0)
    np.testing.assert_allclose(moment, 0.0, atol=1e-6 * P["a"] * normal.max())


@pytest.mark.parametrize("check", [check_gaps, check_contact_forces, check_impacts])
def test_a_run_keeps_what_contacts_must(check):
    system = slider_crank()
    check(Case(system, system.parameters, "free", TILTED, 0.0, 0.015))
