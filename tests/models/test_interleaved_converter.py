"""The converter compared with matrix exponentials, and with closed forms of ripples and shares."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from hybrid import periodic_orbit, simulate
from models import interleaved_converter

T, E, R = (interleaved_converter().parameters[name] for name in ("T", "E", "R"))


def exact(n, duty, start, periods):
    """Currents and voltage ``(n + 1,)`` after whole periods, all switches open at the start."""
    p = interleaved_converter(n).parameters
    L, r, C = p["phase[0].L"], p["phase[0].r"], p["C"]
    A = np.zeros((n + 2, n + 2))
    A[:n, :n], A[:n, n] = -r / L * np.eye(n), -1.0 / L
    A[n, :n], A[n, n] = 1.0 / C, -1.0 / (R * C)
    # The tick at the start of a run does not fire, so the first phase waits for a period.
    first = [i / n if i else 1.0 for i in range(n)]
    closes = [each + k for each in first for k in range(periods)]
    times = np.unique([0.0, *closes, *(each + duty for each in closes), periods])
    times = times[times <= periods]
    x = np.array([*start, 1.0])
    for begin, end in pairwise(times):
        middle = (begin + end) / 2
        for i in range(n):
            A[i, -1] = E / L if middle > first[i] and (middle - i / n) % 1.0 < duty else 0.0
        x = expm((end - begin) * T * A) @ x
    return x[:-1]


@pytest.mark.parametrize(("n", "duty"), [(1, 0.3), (2, 0.35), (3, 0.7)])
def test_a_run_without_feedback_is_a_product_of_matrix_exponentials(n, duty):
    start = {"v": 2.0, "phase.i": 1.0, "phase.w": 0.0}
    arc = simulate(interleaved_converter(n), start, (0.0, 6.5 * T), parameters={"d": duty}, samples=[6 * T])
    found = [*arc["phase.i"][0], arc["v"][0]]
    np.testing.assert_allclose(found, exact(n, duty, [1.0] * n + [2.0], 6), rtol=1e-10)


def settled(n, parameters, t_end=0.02, **start):
    x0 = {"v": 3.0, "phase.i": 6.0 / n, "phase.w": 0.0} | start
    system = interleaved_converter(n)
    x = simulate(system, x0, (0.0, t_end), parameters=parameters, samples=[t_end]).x[-1]
    return periodic_orbit(system, x, parameters=parameters)


@pytest.mark.parametrize(("n", "m"), [(2, 1), (4, 1), (4, 3)])
def test_the_ripple_cancels_where_the_duty_is_a_multiple_of_one_over_the_phases(n, m):
    arc = settled(n, {"d": m / n}).arc()
    for name in ("v", "current"):
        assert np.ptp(arc[name]) < 1e-10 * np.mean(arc[name])
    # That of each phase does not.
    assert np.ptp(arc["phase[0].i"]) > 1.0


@pytest.mark.parametrize(("n", "duty"), [(1, 0.3), (2, 0.3), (3, 0.5), (4, 0.6)])
def test_the_ripple_is_that_of_the_closed_form(n, duty):
    """A capacity without end holds the voltage; coils without resistance have straight currents."""
    system, L, v = interleaved_converter(n), 1e-4, duty * E
    given = {"d": duty, "C": 1e12, "phase.r": 0.0, "R": 1e12}
    arc = simulate(system, {"v": v, "phase.i": 1.0, "phase.w": 0.0}, (0.0, 3 * T), parameters=given)
    late, m = arc.t > 2 * T, np.floor(n * duty)
    total = E * T * (n * duty - m) * (m + 1 - n * duty) / (n * L)
    assert np.ptp(arc["current"][late]) == pytest.approx(total, rel=1e-9)
    each = E * T * duty * (1 - duty) / L
    np.testing.assert_allclose(np.ptp(arc["phase.i"][late], axis=0), each, rtol=1e-9)


def test_phases_share_the_load_as_their_conductances():
    r = np.array([0.02, 0.04, 0.05])
    orbit = settled(3, {"phase.r": r, "d": 0.4}, t_end=0.1)
    assert orbit.status.ok
    arc = orbit.arc()
    steps, middles = np.diff(arc.t), (arc.t[1:] + arc.t[:-1]) / 2
    # Simpson's rule on each step: currents are smooth between jumps.
    currents = arc["phase.i"]
    between = np.array([arc(t, "phase.i") for t in middles])
    means = steps @ (currents[:-1] + 4 * between + currents[1:]) / 6 / steps.sum()
    np.testing.assert_allclose(means * r, (means * r)[0], rtol=1e-8)


@pytest.mark.parametrize(("duty", "on"), [(-0.1, 0.0), (1.2, 1.0)])
def test_a_control_beyond_the_ramp_keeps_the_switches_as_they_are(duty, on):
    start = {"v": 3.0, "phase.i": 1.0, "phase.w": 0.0}
    arc = simulate(interleaved_converter(3), start, (0.0, 5.5 * T), parameters={"d": duty})
    assert not len(arc.jumps["phase.turn off"])
    np.testing.assert_array_equal(arc["phase.on"][-1], on)


def test_feedback_holds_the_voltage():
    """The load changes by a half; the voltage moves less with feedback."""
    apart = []
    for gain in (0.0, 0.1):
        means = [
            np.mean(settled(4, {"k": gain, "R": load, "phase.r": 0.2}).arc()["v"]) for load in (0.5, 0.25)
        ]
        apart.append(means[0] - means[1])
    assert 0.0 < apart[1] < 0.6 * apart[0]
