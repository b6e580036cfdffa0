"""Radau IIA against exact answers: stiff problems, exponents, contacts with huge damping."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import hybrid
import lyapunov
from hybrid import Guard, HybridSystem, Mode, RadauIIA, Transition
from models import impact_oscillator
from tests.reference.load import reference

TABLEAU = RadauIIA.tableau
A, B, C = TABLEAU.a[1:, 1:], TABLEAU.b, TABLEAU.c[1:]


def tolerance(value):
    return RadauIIA(rtol=value, atol=value)


def test_simplifying_assumptions():
    """B(5) and C(3), which with B's order prove the order 5; and the last stage is the end of the step."""
    for q in range(1, 6):
        assert B @ C ** (q - 1) == pytest.approx(1 / q, rel=1e-14)
    for q in range(1, 4):
        np.testing.assert_allclose(A @ C ** (q - 1), C**q / q, rtol=1e-13)
    for q in range(1, 3):
        np.testing.assert_allclose((B * C ** (q - 1)) @ A, B * (1 - C**q) / q, atol=1e-15)
    np.testing.assert_array_equal(A[-1], B)


def test_the_estimate_vanishes_on_quadratics_and_its_filter_has_the_real_eigenvalue():
    c = TABLEAU.c
    for power in range(3):
        assert TABLEAU.error @ c**power == pytest.approx(0, abs=1e-15)
    assert abs(TABLEAU.error @ c**3) > 1e-3
    (real,) = [value.real for value in np.linalg.eigvals(A) if abs(value.imag) < 1e-12]
    assert TABLEAU.error[0] == pytest.approx(real, rel=1e-13)


def test_interpolant_is_the_collocation_polynomial():
    """Exact for quadratic derivatives, passes through both ends, independent of the slope at the start."""
    theta = np.linspace(0, 1, 7)
    basis = np.array([(1 - theta) ** 3, 3 * theta * (1 - theta) ** 2, 3 * theta**2 * (1 - theta), theta**3])
    weights = basis.T @ TABLEAU.interpolant
    np.testing.assert_array_equal(weights[:, 0], 0)
    np.testing.assert_allclose(weights[-1], TABLEAU.quadrature, atol=1e-15)
    for power in range(3):
        np.testing.assert_allclose(weights[:, 1:] @ C**power, theta ** (power + 1) / (power + 1), atol=1e-14)


def relaxation():
    """``x' = lam (x - s(t)) + s'(t)`` of Prothero and Robinson, whose slow solution is ``s = sin``."""
    return HybridSystem(
        state=("x",),
        parameters={"lam": -1e6},
        modes=[Mode("m", lambda t, x, p: (p.lam * (x.x - np.sin(t)) + np.cos(t),))],
        transitions=[],
    )


@pytest.mark.parametrize("lam", [-1e2, -1e4, -1e6, -1e10])
def test_prothero_robinson(lam):
    arc = hybrid.simulate(relaxation(), (0.0,), (0.0, 10.0), parameters={"lam": lam}, solver=tolerance(1e-9))
    assert len(arc.t) < 1200
    times = np.linspace(0, 10, 400)
    np.testing.assert_allclose([arc(t)[0] for t in times], np.sin(times), atol=5e-9)


@pytest.mark.parametrize("x0", [1.0, 0.0, -1e3])
def test_a_fast_transient_is_resolved_and_then_forgotten(x0):
    lam = -1e8
    system = HybridSystem(
        state=("x",),
        parameters={},
        modes=[Mode("m", lambda t, x, p: (lam * (x.x - np.cos(t)),))],
        transitions=[],
    )

    def exact(t):
        slow = (lam**2 * np.cos(t) - lam * np.sin(t)) / (1 + lam**2)
        return slow + (x0 - lam**2 / (1 + lam**2)) * np.exp(lam * t)

    arc = hybrid.simulate(system, (x0,), (0.0, 10.0), solver=tolerance(1e-7))
    times = np.concatenate([np.geomspace(1e-11, 1e-2, 200), np.linspace(0.1, 10, 200)])
    np.testing.assert_allclose([arc(t)[0] for t in times], exact(times), rtol=5e-7, atol=5e-7)
    assert len(arc.t) < 500


def test_van_der_pol():
    mu = 1e6
    system = HybridSystem(
        state=("x", "v"),
        parameters={"mu": mu},
        modes=[Mode("m", lambda t, x, p: (x.v, p.mu * ((1 - x.x**2) * x.v - x.x)))],
        transitions=[],
    )
    expected = solve_ivp(
        lambda t, y: (y[1], mu * ((1 - y[0] ** 2) * y[1] - y[0])),
        (0, 2),
        (2, -0.66),
        method="Radau",
        rtol=1e-9,
        atol=1e-11,
        jac=lambda t, y: np.array([[0, 1], [-mu * (2 * y[0] * y[1] + 1), mu * (1 - y[0] ** 2)]]),
    )
    arc = hybrid.simulate(system, (2.0, -0.66), (0.0, 2.0), solver=tolerance(1e-8))
    np.testing.assert_allclose(arc.x[-1], expected.y[:, -1], rtol=1e-7)
    assert len(arc.t) < 5000


def pendulum():
    return HybridSystem(
        state=("q", "v"),
        parameters={},
        modes=[Mode("m", lambda t, x, p: (x.v, np.cos(t) - 0.3 * x.v - np.sin(x.q)))],
        transitions=[],
    )


@pytest.mark.parametrize("value", [1e-5, 1e-8])
def test_tangents_agree_with_an_explicit_pair(value):
    span = (0.0, 10.0)
    exact = hybrid.simulate(
        pendulum(), (1.0, 0.0), span, tangent=True, solver=hybrid.DOP853(rtol=1e-13, atol=1e-14)
    )
    arc = hybrid.simulate(pendulum(), (1.0, 0.0), span, tangent=True, solver=tolerance(value))
    np.testing.assert_allclose(arc.x[-1], exact.x[-1], atol=value)
    np.testing.assert_allclose(arc.fundamental, exact.fundamental, atol=10 * value)


def test_tangents_of_a_stiff_mode_agree_with_differences():
    system = HybridSystem(
        state=("x", "v"),
        parameters={"mu": 1e3},
        modes=[Mode("m", lambda t, x, p: (x.v, p.mu * ((1 - x.x**2) * x.v - x.x)))],
        transitions=[],
    )
    x0, span, epsilon = np.array([2.0, -0.66]), (0.0, 0.5), 1e-5
    solver = tolerance(1e-11)
    fundamental = hybrid.simulate(system, x0, span, tangent=True, solver=solver).fundamental
    for column, shift in enumerate(epsilon * np.eye(2)):
        ends = [hybrid.simulate(system, x0 + sign * shift, span, solver=solver).x[-1] for sign in (1, -1)]
        np.testing.assert_allclose(
            fundamental[:, column], (ends[0] - ends[1]) / (2 * epsilon), rtol=1e-6, atol=1e-7
        )


def damped_oscillator():
    return HybridSystem(
        state=("x", "v"),
        parameters={"k": 1.0, "c": 1.0},
        modes=[Mode("m", lambda t, x, p: (x.v, np.cos(t) - p.c * x.v - p.k * x.x))],
        transitions=[],
        period=lambda p: 2 * np.pi,
    )


def rates_of(k, c):
    """The two real exponents; the small one is computed without cancellation."""
    fast = -(c + math.sqrt(c**2 - 4 * k)) / 2
    return np.array([k / fast, fast])


@pytest.mark.parametrize("c", [1e2, 1e4, 1e6, 1e8])
def test_exponents_however_negative(c):
    """Intervals as short as the fast decay separate the two directions."""
    result = lyapunov.lyapunov_spectrum(
        damped_oscillator(),
        (0.0, 0.0),
        parameters={"c": c, "k": c},
        interval=10 / c,
        intervals=300,
        transient=30,
        solver=tolerance(1e-9),
    )
    np.testing.assert_allclose(result.exponents, rates_of(c, c), rtol=1e-7)
    assert result.exponents.sum() == pytest.approx(-c, rel=1e-12)


@pytest.mark.parametrize("c", [1e2, 1e4, 1e6])
def test_slow_exponent_over_periods_of_the_forcing(c):
    """The fast direction vanishes before an interval ends, but the sum rule still includes it."""
    result = lyapunov.lyapunov_spectrum(
        damped_oscillator(),
        (0.0, 0.0),
        parameters={"c": c, "k": c},
        k=1,
        intervals=30,
        transient=3,
        solver=tolerance(1e-9),
    )
    slow, fast = rates_of(c, c)
    assert result.exponents[0] == pytest.approx(slow, rel=1e-8)
    assert result.sum_rule - result.exponents[0] == pytest.approx(fast, rel=1e-8)


# A mass that a moving field throws onto a wall of spring and damper, far overdamped.
FORCE, WEIGHT, OMEGA = 2.0, 1.0, 2.0


def damped_wall():
    def drive(t):
        return FORCE * np.cos(OMEGA * t) - WEIGHT

    return HybridSystem(
        state=("x", "v"),
        parameters={"k": 1e5, "c": 1e4},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, drive(t))),
            Mode("contact", lambda t, x, p: (x.v, drive(t) - p.c * x.v - p.k * x.x)),
        ],
        transitions=[
            Transition("flight", "contact", Guard(lambda t, x, p: x.x, direction=-1), name="touch"),
            Transition("contact", "flight", Guard(lambda t, x, p: x.x, direction=+1), name="release"),
        ],
        period=lambda p: 2 * np.pi / OMEGA,
    )


def flight(t0, x0, v0):
    def position(t):
        swing = FORCE / OMEGA**2 * (np.cos(OMEGA * t0) - np.cos(OMEGA * t))
        drift = v0 - FORCE / OMEGA * np.sin(OMEGA * t0)
        return x0 + swing + drift * (t - t0) - WEIGHT / 2 * (t - t0) ** 2

    def velocity(t):
        return v0 + FORCE / OMEGA * (np.sin(OMEGA * t) - np.sin(OMEGA * t0)) - WEIGHT * (t - t0)

    return position, velocity


def contact(t0, v0, k, c):
    slow, fast = rates_of(k, c)
    response = FORCE / (k - OMEGA**2 + 1j * OMEGA * c)

    def forced(t, derivative):
        steady = -WEIGHT / k if derivative == 0 else 0.0
        return (response * (1j * OMEGA) ** derivative * np.exp(1j * OMEGA * t)).real + steady

    a, b = np.linalg.solve([[1.0, 1.0], [slow, fast]], [-forced(t0, 0), v0 - forced(t0, 1)])

    def motion(derivative):
        return lambda t: (
            forced(t, derivative)
            + a * slow**derivative * np.exp(slow * (t - t0))
            + b * fast**derivative * np.exp(fast * (t - t0))
        )

    return motion(0), motion(1)


def exact_jumps(k, c, t_end):
    """Times and velocities at which the mass touches the wall and is released, from the closed forms."""
    t, position, velocity = 0.0, *flight(0.0, 1.0, 0.0)
    jumps = []
    while True:
        times = t + np.concatenate([np.geomspace(1e-9, 1e-2, 50), np.linspace(0.011, 10, 5000)])
        signs = np.sign(position(times))
        first = np.flatnonzero(signs[1:] != signs[:-1])[0]
        t = brentq(position, times[first], times[first + 1], xtol=1e-15, rtol=1e-15)
        if t > t_end:
            return np.array(jumps)
        v = velocity(t)
        jumps.append((t, v))
        position, velocity = contact(t, v, k, c) if len(jumps) % 2 else flight(t, 0.0, v)


@pytest.mark.parametrize("c", [1e2, 1e4, 1e6])
def test_contact_with_huge_damping(c):
    """The mass sinks in by about 1/c, which sets where it is released; ``atol`` must be chosen for that."""
    k = 10 * c
    exact = exact_jumps(k, c, 20.0)
    solver = RadauIIA(rtol=1e-8, atol=1e-8 / c)
    arc = hybrid.simulate(
        damped_wall(), (1.0, 0.0), (0.0, 20.0), mode="flight", parameters={"k": k, "c": c}, solver=solver
    )
    assert len(exact) > 8
    np.testing.assert_allclose(arc.jumps.t, exact[:, 0], rtol=1e-9)
    np.testing.assert_allclose(arc.jumps.x_minus[:, 1], exact[:, 1], rtol=1e-7)
    assert len(arc.t) < 10_000


FLIGHT = reference("impact_oscillator")["flight"]


def test_order_across_impacts():
    """Steps scale with the tolerance to the power 1/4, errors with the fifth power of the steps."""
    tolerances, errors = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7), []
    for value in tolerances:
        arc = hybrid.simulate(
            impact_oscillator(), FLIGHT["x0"], (0.0, FLIGHT["t_end"]), solver=tolerance(value)
        )
        errors.append(np.abs(arc.x[-1] - FLIGHT["x_end"]).max())
    assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] > 5 / 4 - 0.1


def test_twenty_impacts():
    arc = hybrid.simulate(impact_oscillator(), FLIGHT["x0"], (0.0, FLIGHT["t_end"]), solver=tolerance(1e-9))
    np.testing.assert_allclose([jump.t for jump in arc.jumps], FLIGHT["t"], rtol=1e-10)
    np.testing.assert_allclose([jump.x_minus[1] for jump in arc.jumps], FLIGHT["v_minus"], rtol=1e-9)


def test_exponents_across_impacts():
    exact = math.log(0.8 * math.exp(-0.1 * math.pi)) / (2 * math.pi)
    result = lyapunov.lyapunov_spectrum(
        impact_oscillator(), (0.0, 0.0), intervals=300, solver=tolerance(1e-8)
    )
    np.testing.assert_allclose(result.exponents, [exact, exact], atol=1e-2)


def test_values_are_checked():
    with pytest.raises(hybrid.ArgumentError, match="RadauIIA: rtol must be positive; got -1"):
        RadauIIA(rtol=-1.0)
