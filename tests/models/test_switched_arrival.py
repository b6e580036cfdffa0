"""The switched arrival system compared with rational arithmetic and its invariant density."""

from fractions import Fraction

import numpy as np
import pytest

import hybrid
import lyapunov
from models import switched_arrival

EQUAL = (1 / 3, 1 / 3, 1 / 3)
UNEQUAL = (0.5, 0.3, 0.2)
START = (0.0, 0.314, 0.686)


def parameters(rates):
    return dict(zip(("rho1", "rho2", "rho3"), rates, strict=True))


def exact_switches(state, count, rates):
    """Times, targets and states of the first switches, in rational numbers, with buffer 1 filled first."""
    state, filled, t, found = [Fraction(str(x)) for x in state], 0, Fraction(0), []
    for _ in range(count):
        wait, empty = min((state[i] / rates[i], i) for i in range(3) if i != filled)
        state = [x - rate * wait for x, rate in zip(state, rates, strict=True)]
        state[filled] += sum(rates) * wait
        t, filled = t + wait, empty
        found.append((float(t), f"fill{filled + 1}", [float(x) for x in state]))
    return found


@pytest.mark.parametrize("rates", [(Fraction(1, 3),) * 3, (Fraction(1, 2), Fraction(3, 10), Fraction(1, 5))])
def test_fifteen_switches(rates):
    exact = exact_switches(START, 15, rates)
    arc = hybrid.simulate(
        switched_arrival(),
        START,
        (0.0, exact[-1][0] + 1e-6),
        mode="fill1",
        parameters=parameters([float(rate) for rate in rates]),
    )
    times, targets, states = zip(*exact, strict=True)
    assert tuple(jump.target for jump in arc.jumps) == targets
    np.testing.assert_allclose([jump.t for jump in arc.jumps], times, atol=1e-10)
    np.testing.assert_allclose([jump.x_plus for jump in arc.jumps], states, atol=1e-10)


def test_a_switch_stretches_areas():
    for j, rate in enumerate(UNEQUAL, start=1):
        source = f"fill{j % 3 + 1}"
        state = np.insert([0.4, 0.6], j - 1, 0.0)
        found = hybrid.saltation_matrix(
            switched_arrival(), f"{source}->fill{j}", 0.0, state, parameters=parameters(UNEQUAL)
        )
        assert np.linalg.det(found) == pytest.approx(1 - 1 / rate, rel=1e-12)


@pytest.mark.parametrize("end", [3.0, 5.0, 9.0])
def test_with_equal_rates_each_switch_doubles_areas(end):
    """So ``ln 2`` times the switches per unit of time is the first exponent; the others are zero."""
    arc = hybrid.simulate(
        switched_arrival(), START, (0.0, end), mode="fill1", parameters=parameters(EQUAL), tangent=np.eye(3)
    )
    assert len(arc.jumps) > 1
    areas = abs(np.linalg.det(arc.fundamental))
    assert np.log2(areas) == pytest.approx(len(arc.jumps), abs=1e-6)


def test_exponents():
    rates = UNEQUAL
    result = lyapunov.lyapunov_spectrum(
        switched_arrival(), START, mode="fill1", parameters=parameters(rates), interval=1.0, intervals=5000
    )
    exact = sum(2 * rate * (1 - rate) * np.log((1 - rate) / rate) for rate in rates)
    assert abs(result.exponents[0] - exact) <= 3 * result.standard_error[0]
    np.testing.assert_allclose(result.exponents[1:], 0.0, atol=3e-3)
    # A Poisson count of this size has a relative error of 1 %.
    switches = sum(2 * rate * (1 - rate) for rate in rates)
    assert result.jumps_per_interval == pytest.approx(switches, rel=0.03)


def test_shares_of_time_are_the_rates():
    t_end = 3000.0
    arc = hybrid.simulate(
        switched_arrival(), START, (0.0, t_end), mode="fill1", parameters=parameters(UNEQUAL)
    )
    bounds = np.array([0.0, *(jump.t for jump in arc.jumps), t_end])
    mode = np.array(["fill1", *(jump.target for jump in arc.jumps)])
    shares = [np.diff(bounds)[mode == f"fill{j}"].sum() / t_end for j in (1, 2, 3)]
    np.testing.assert_allclose(shares, UNEQUAL, atol=0.02)
    np.testing.assert_allclose(arc.x.sum(axis=1), 1.0, atol=1e-9)


def test_two_buffers_empty_together():
    arc = hybrid.simulate(switched_arrival(), (0.0, 0.5, 0.5), (0.0, 3.0), mode="fill1")
    assert arc.status.code == hybrid.StatusCode.STUCK
    assert arc.t[-1] == pytest.approx(1.5, rel=1e-12)
    np.testing.assert_allclose(arc.x[-1], [1.0, 0.0, 0.0], atol=1e-12)
