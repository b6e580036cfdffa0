"""An autonomous run does not depend on its start time; the clock of a run loses no digits."""

import math
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
from hybrid.kernels.types.kinds import INDICES, VECTOR
from hybrid.kernels.types.structure import Structure

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
    early = hybrid.simulate(system, x0, (0.0, span), solver=solver, tangent=True)
    late = hybrid.simulate(system, x0, (shift, shift + span), solver=solver, tangent=True)
    assert early.status.ok or early.jumps[-1].kind == "limit"
    assert len(early.jumps) > 1
    assert late.status.code == early.status.code
    np.testing.assert_array_equal(late.jumps.transition, early.jumps.transition)
    np.testing.assert_array_equal(late.jumps.kind, early.jumps.kind)
    np.testing.assert_allclose(late.jumps.x_minus, early.jumps.x_minus, rtol=0, atol=1e-15)
    np.testing.assert_allclose(late.x[-1], early.x[-1], rtol=1e-14)
    np.testing.assert_allclose(late.fundamental, early.fundamental, rtol=1e-13, atol=1e-13)
    times = np.arange(1, 64) / 64 * min(span, 4.0)
    # The interpolant of a Runge-Kutta step is a sum of terms larger than the state.
    np.testing.assert_allclose(late(shift + times), early(times), rtol=1e-13, atol=1e-13)


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


_sum, _left, _forward, _set = clock.sum_in_two_parts, clock.time_left, clock.forward, clock.set_clock
_measured = clock.measured_time


class Clock(Structure, counters=("cycle",), numbers=("phase", "phase_low", "since_entry", "period")):
    """The parts of a run and of a model that the clock needs."""

    counters: INDICES
    numbers: VECTOR
    timed: INDICES


def clock(period, phase=0.0, timed=0):
    return Clock(
        counters=np.zeros(1, dtype=np.int64),
        numbers=np.array([phase, 0.0, 0.25, period]),
        timed=np.array([timed]),
    )


@njit
def sum_in_two_parts(a, b):
    return _sum(a, b)


@njit
def forward_all(run, period, spans):
    for span in spans:
        _forward(run, period, span)


@njit
def time_left(run, cycle, phase):
    return _left(run, run, cycle, phase)


@njit
def set_clock(run, cycle, phase):
    _set(run, cycle, phase)


def exact(run):
    """The time that a clock shows."""
    return run.cycle * Fraction(run.numbers[3]) + Fraction(run.phase) + Fraction(run.phase_low)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_a_sum_in_two_parts_is_exact(a, b):
    total, lost = sum_in_two_parts(a, b)
    assert total == a + b
    assert Fraction(total) + Fraction(lost) == Fraction(a) + Fraction(b)


@pytest.mark.parametrize("period", [0.0, 0.3, 2 * np.pi, 1e6])
@pytest.mark.parametrize("longest", [1e-3, 0.3, 5.0])
def test_the_clock_adds_up_without_rounding(period, longest):
    spans = np.random.default_rng(0).uniform(0.0, longest, 4000)
    run = clock(period, 0.1)
    forward_all(run, period, spans)
    expected = Fraction(0.1) + sum(map(Fraction, spans))
    # Four thousand sums in twice the digits.
    assert abs(exact(run) - expected) < 1e-24 * float(expected) * len(spans)
    assert period == 0.0 or 0.0 <= run.phase < period
    left = time_left(run, run.cycle + 2, run.phase + 1e-9)
    expected = (
        2 * Fraction(period) + Fraction(run.phase + 1e-9) - Fraction(run.phase) - Fraction(run.phase_low)
    )
    assert left == pytest.approx(float(expected), rel=4e-16, abs=1e-24)
    assert time_left(run, 0, math.inf) == math.inf


def test_a_clock_that_is_set_shows_just_that():
    run = clock(1.0, 0.1)
    forward_all(run, 1.0, np.array([0.7, 0.7]))
    set_clock(run, 12, 0.3)
    assert (run.cycle, run.phase, run.phase_low) == (12, 0.3, 0.0)


def test_only_a_mode_that_depends_on_time_rounds_with_its_phase():
    @njit
    def measured(run):
        return _measured(run, run, 0)

    assert measured(clock(0.0, -3.0, timed=0)) == 0.25
    assert measured(clock(0.0, -3.0, timed=1)) == 3.0
