"""The converter compared with matrix exponentials: orbit, loss of stability, saturated ramps.

State ``(v, i, tau)``: a tick sets the phase of the ramp, which adds the multiplier 0.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
import lyapunov
from models import buck_converter
from tests.reference.load import complex_pairs, reference

TIGHT = hybrid.DOP853(rtol=1e-13, atol=1e-15)
L, C, R, T = 20e-3, 47e-6, 22.0, 400e-6

converters = pytest.mark.parametrize(
    "converter", reference("buck_converter"), ids=lambda converter: f"{converter['E']:g} V"
)


def in_order(multipliers):
    return sorted(map(complex, multipliers), key=lambda m: (round(m.real, 9), m.imag))


@converters
def test_one_ramp(converter):
    arc = hybrid.simulate(
        buck_converter(),
        (*converter["x0"], 0.0),
        (0.0, 1.2 * T),
        mode="off",
        parameters={"E": converter["E"]},
        solver=TIGHT,
    )
    close, ramp_ends = arc.jumps[:2]
    assert close.t / T == pytest.approx(converter["off_fraction"], abs=1e-10)
    assert ramp_ends.t == pytest.approx(T, rel=1e-12)
    np.testing.assert_allclose(ramp_ends.x_plus, [*converter["x0"], 0.0], atol=1e-9)
    # Without the phase of the ramp this is the matrix of the converter driven by time.
    np.testing.assert_allclose(close.saltation[:2, :2], converter["saltation"], atol=1e-9)


@converters
def test_orbit(converter):
    v, i = converter["x0"]
    given = {"mode": "off", "parameters": {"E": converter["E"]}}
    orbit = hybrid.periodic_orbit(buck_converter(), (v + 1e-4, i + 1e-5, 0.0), **given)
    assert orbit.period == pytest.approx(T, rel=1e-14)
    np.testing.assert_allclose(orbit.x0, (v, i, 0.0), atol=1e-12)
    *filter_pair, forgotten = sorted(orbit.multipliers, key=abs, reverse=True)
    assert forgotten == 0.0
    np.testing.assert_allclose(
        in_order(filter_pair), in_order(complex_pairs(converter["multipliers"])), atol=1e-12
    )
    assert np.prod(filter_pair) == pytest.approx(converter["determinant"], rel=1e-12)


@converters
def test_orbit_from_within_a_ramp(converter):
    start, given = (*converter["x0"], 0.0), {"mode": "off", "parameters": {"E": converter["E"]}}
    mid = hybrid.simulate(buck_converter(), start, (0.0, 0.1 * T), **given).x[-1]
    orbit = hybrid.periodic_orbit(buck_converter(), mid, t0=0.1 * T, **given)
    np.testing.assert_allclose(orbit.x0, mid, atol=1e-10)


def test_period_doubling():
    """The input voltage is the root of ``det(M + I) = 0``, with M from matrix exponentials in 30 digits."""
    v, i = 12.0277, 0.60808
    given = {"mode": "off", "parameters": {"E": 24.5165728285633750}}
    orbit = hybrid.periodic_orbit(buck_converter(), (v, i, 0.0), **given)
    np.testing.assert_allclose(
        np.sort(orbit.multipliers.real), [-1.0, -math.exp(-T / (R * C)), 0.0], atol=1e-12
    )


def switchings(E, v, i, ramps):
    """Switching times, starting with the switch off, from the eigenvalues of the filter alone."""
    values, vectors = np.linalg.eig([[-1 / (R * C), 1 / C], [-1 / L, 0.0]])

    def flow(x, on, t):
        rest = on * np.array([E, E / R])
        return rest + ((vectors * np.exp(values * t)) @ np.linalg.solve(vectors, x - rest)).real

    def excess(t, x, on, since):
        return 8.4 * (flow(x, on, t - since)[0] - 11.3) - 3.8 - 4.4 * t / T

    x, on, found = np.array([v, i]), False, []
    for ramp in range(ramps):
        since = 0.0
        for t in np.linspace(0, T, 401)[1:]:
            if (excess(t, x, on, since) < 0) == on:
                continue
            switch = brentq(excess, max(t - T / 400, since), t, args=(x, on, since), xtol=1e-18, rtol=1e-15)
            x, on, since = flow(x, on, switch - since), not on, switch
            found.append(ramp * T + switch)
        x = flow(x, on, T - since)
        if on != (8.4 * (x[0] - 11.3) < 3.8):
            on = not on
            found.append((ramp + 1) * T)
    return found


def test_ramps_on_which_the_switch_stays_as_it_is():
    """At 33 V the control voltage misses whole ramps, above and below, and amplifies errors 1e5-fold."""
    arc = hybrid.simulate(
        buck_converter(), (12.0, 0.6, 0.0), (0.0, 14 * T), mode="off", parameters={"E": 33.0}, solver=TIGHT
    )
    assert {"open", "skip", "saturate"} <= {jump.transition for jump in arc.jumps}
    changes = [jump.t for jump in arc.jumps if jump.source != jump.target]
    np.testing.assert_allclose(changes, switchings(33.0, 12.0, 0.6, 14), atol=1e-9 * T)


def test_exponents_sum_to_the_damping_of_the_filter():
    result = lyapunov.lyapunov_spectrum(
        buck_converter(), (12.0, 0.6, 0.0), mode="off", parameters={"E": 33.0}, intervals=500
    )
    first, second, forgotten = result.exponents * T
    assert first > 0.1
    assert second < -0.1
    assert forgotten == -math.inf
    assert result.exponents[:2].sum() == pytest.approx(-1 / (R * C), rel=1e-9)
