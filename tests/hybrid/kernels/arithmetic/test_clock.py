"""An autonomous run does not depend on its start time; the clock of a run loses no digits."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.kernels.arithmetic import clock

SHIFTS = [2.0**20, -(2.0**20), 2.0**30]
SOLVERS = [hybrid.Taylor(), hybrid.DOP853(), hybrid.RadauIIA()]


def neuron(peak):
    """Exponential integrate-and-fire neuron with adaptation: its spikes need steps of 1e-12 ms."""
    return HybridSystem(
        name="neuron",
        state=("v", "w"),
        parameters={"I": 1000.0, "b": 80.5},
        modes=[
            Mode(
                "rest",
                lambda t, x, p: (
                    (-30 * (x.v + 70.6) + 60 * np.exp((x.v + 50.4) / 2) - x.w + p.I) / 281,
                    (4 * (x.v + 70.6) - x.w) / 144,
                ),
            )
        ],
        transitions=[
            Transition(
                "rest",
                "rest",
                Guard(lambda t, x, p: x.v - peak, +1),
                Reset(lambda t, x, p: (-70.6, x.w + p.b)),
                name="spike",
            )
        ],
    )


BALL, NEURON, BLOCK = models.bouncing_ball(), neuron(0.0), models.stick_slip()


@pytest.mark.parametrize("shift", SHIFTS)
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize(
    ("system", "x0", "span"),
    [
        (BALL, (1.0, 0.0), 3.0),
        (BALL, (1.0, 0.0), 6.0),
        (NEURON, (-70.6, 0.0), 128.0),
        (BLOCK, (0.5, 0.2), 16.0),
    ],
    ids=["ball", "chatter", "neuron", "block"],
)
def test_a_shift_of_time_changes_nothing(system, x0, span, solver, shift):
    late = hybrid.simulate(system, x0, (shift, shift + span), solver=solver, tangent=True)
    if late.status.ok:
        span = late.t[-1] - late.t[0]
    early = hybrid.simulate(system, x0, (0.0, span), solver=solver, tangent=True)
    assert early.status.ok or early.jumps[-1].kind == "limit"
    assert len(early.jumps) > 1
    # The ends of the spans are rounded to numbers of 1e-7, which times that lost digits would differ by.
    assert late.status.code == early.status.code
    np.testing.assert_array_equal(late.jumps.transition, early.jumps.transition)
    np.testing.assert_array_equal(late.jumps.kind, early.jumps.kind)
    np.testing.assert_allclose(late.jumps.x_minus, early.jumps.x_minus, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(late.x[-1], early.x[-1], rtol=1e-10)
    np.testing.assert_allclose(late.fundamental, early.fundamental, rtol=1e-11, atol=1e-12)
    times = np.arange(1, 64) / 64 * min(span, 4.0)
    # The interpolant of a Runge-Kutta step is a sum of terms larger than the state.
    places = late.t[0] + times
    np.testing.assert_allclose(late(places), early(places - late.t[0]), rtol=1e-10, atol=1e-12)


def test_spikes_go_on_as_they_began():
    arc = hybrid.simulate(
        NEURON, (-70.6, 0.0), (0.0, 2e5), parameters={"b": 0.0}, samples=[2e5], keep_jumps=True
    )
    assert arc.status.ok
    intervals = np.diff(arc.jumps.t)
    assert len(intervals) > 10_000
    # Each reported time is rounded, but the rounding does not accumulate.
    np.testing.assert_allclose(intervals[-100:], intervals[500], atol=6e-11)
    late = arc.jumps.t[500:]
    np.testing.assert_allclose(late - late[0], np.arange(len(late)) * np.mean(intervals[500:]), atol=1e-9)


def test_forcing_without_a_period_is_limited_by_the_rounding_of_time():
    """At a late time the forcing cannot resolve the steps of 1e-12 that the neuron needs."""

    def field(t, x, p):
        rate, slope = NEURON.modes[0].field(t, x, p)
        return rate + 1e-3 * np.cos(t), slope

    forced = HybridSystem(
        state=NEURON.state,
        parameters=NEURON.parameters,
        modes=[Mode("rest", field)],
        transitions=NEURON.transitions,
    )
    early = hybrid.simulate(forced, (-70.6, 0.0), (0.0, 100.0))
    assert early.status.ok
    late = hybrid.simulate(forced, (-70.6, 0.0), (1e9, 1e9 + 100.0))
    assert late.status.code == hybrid.StatusCode.STEP_TOO_SMALL
    assert "period=" in late.status.remedy
    periodic = HybridSystem(
        state=NEURON.state,
        parameters=NEURON.parameters,
        modes=[Mode("rest", field)],
        transitions=NEURON.transitions,
        period=2 * np.pi,
    )
    assert hybrid.simulate(periodic, (-70.6, 0.0), (1e9, 1e9 + 100.0)).status.ok


@njit
def sum_in_two_parts(a, b):
    return clock.sum_in_two_parts(a, b)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_sum_in_two_parts_is_exact(a, b):
    total, lost = sum_in_two_parts(a, b)
    assert total == a + b
    assert Fraction(total) + Fraction(lost) == Fraction(a) + Fraction(b)
