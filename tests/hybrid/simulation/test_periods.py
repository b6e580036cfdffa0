"""Time as whole periods and a phase, and times too large to resolve a step."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid
import lyapunov
import models
from hybrid.simulation.periods import FINEST_PHASE, check_time, split_time


@pytest.mark.parametrize("period", [1.0, 0.1, 2 * math.pi, 1e-3, 1e6])
@pytest.mark.parametrize("count", [-1000, -3, -1, 0, 1, 3, 7, 1000, 10**9])
def test_a_whole_number_of_periods_has_no_phase(period, count):
    assert split_time(count * period, period) == (count, 0.0)


@pytest.mark.parametrize(
    ("t", "period", "found"),
    [
        (-1e-20, 1.0, (0, 0.0)),  # too close to the end of its period for a double
        (-0.25, 1.0, (-1, 0.75)),
        (2.75, 1.0, (2, 0.75)),
        (math.nextafter(3.0, 0.0), 1.0, (2, math.nextafter(3.0, 0.0) - 2)),
        (123.5, 0.0, (0, 123.5)),
    ],
)
def test_cycle_and_phase(t, period, found):
    assert split_time(t, period) == found


def test_the_phase_is_below_the_period():
    for i in range(-2000, 2000):
        cycle, phase = split_time(0.1 * i, 0.3)
        assert 0.0 <= phase < 0.3
        assert cycle * 0.3 + phase == pytest.approx(0.1 * i, abs=1e-12)


def test_a_time_whose_phase_is_lost():
    largest = FINEST_PHASE / 2**-52
    check_time("t0", largest, 1.0)
    check_time("t0", 1e300, 0.0)
    with pytest.raises(hybrid.ArgumentError, match="t0 must be small enough to have a phase"):
        check_time("t0", 4 * largest, 1.0)
    for call in (
        lambda t: hybrid.simulate(models.impact_oscillator(), (0.0, 0.0), (t, t)),
        lambda t: hybrid.stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=2, t0=t),
        lambda t: lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), t0=t),
    ):
        for t in (1e17, -1e300):
            with pytest.raises(hybrid.ArgumentError, match="must be small enough to have a phase"):
                call(t)


def lorenz():
    def field(t, x, p):
        return p.s * (x.y - x.x), x.x * (p.r - x.z) - x.y, x.x * x.y - p.b * x.z

    return hybrid.HybridSystem(
        state=("x", "y", "z"),
        parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
        modes=[hybrid.Mode("flow", field)],
    )


def test_an_interval_that_does_not_advance_the_clock():
    text = "interval must be long enough to advance the clock"
    with pytest.raises(hybrid.ArgumentError, match=text):
        lyapunov.lyapunov_spectrum(lorenz(), (1.0, 1.0, 1.0), t0=1e17)
    with pytest.raises(hybrid.ArgumentError, match=text):
        lyapunov.lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), interval=1e-20)
    with pytest.raises(hybrid.ArgumentError, match=text):
        lyapunov.two_orbit_exponents(lorenz(), (1.0, 1.0, 1.0), interval=1e-14, t0=1.0)


@pytest.mark.parametrize("solver", [hybrid.Taylor(), hybrid.DOP853(max_steps=10_000)])
def test_a_run_whose_steps_are_below_the_rounding_of_its_time(solver):
    """An autonomous run does not need the digits of its time, so it succeeds."""
    arc = hybrid.simulate(lorenz(), (1.0, 1.0, 1.0), (1e17, 1e17 + 16), solver=solver)
    near = hybrid.simulate(lorenz(), (1.0, 1.0, 1.0), (0.0, 16.0), solver=solver)
    if arc.status.ok:
        np.testing.assert_allclose(arc.x[-1], near.x[-1], atol=1e-2)


@given(
    period=st.floats(0.1, 30.0),
    share=st.sampled_from([0.0, 0.25, 0.5, 0.75]),
    yes_first=st.booleans(),
)
@settings(max_examples=25)
def test_guards_in_time_at_the_end_of_a_period(clocked, period, share, yes_first):
    """Each switch fires once a period, wherever rounding has left the phase when the period ends."""
    arc = hybrid.simulate(
        clocked,
        (0.3, 1.0),
        (0.2 * period, 6.2 * period),
        mode="a",
        parameters={"T": period, "share": share, "order": 1.0 if yes_first else -1.0},
    )
    wanted = np.arange(13) / 2 + share
    wanted = wanted[(wanted > 0.2) & (wanted < 6.2)] * period
    # The first switch that leaves mode a is the rising one.
    rising = np.isclose((wanted / period - share) % 1.0, 0.0) | np.isclose(
        (wanted / period - share) % 1.0, 1.0
    )
    first = int(np.argmax(rising))
    np.testing.assert_allclose(arc.jumps.t, wanted[first:], rtol=1e-12)


@pytest.fixture(scope="module")
def clocked():
    """Two modes switched by the clock; of two transitions on one guard, only one is ever allowed."""

    def clock(t, x, p):
        return np.sin(2 * np.pi * (t / p.T - p.share))

    return hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"T": 2.0, "share": 0.0, "order": 1.0},
        period=lambda p: p.T,
        modes=[
            hybrid.Mode("a", lambda t, x, p: (x.v, -x.q)),
            hybrid.Mode("b", lambda t, x, p: (x.v, -x.q + 1.0)),
        ],
        transitions=[
            hybrid.Transition(
                "a", "b", hybrid.Guard(clock, +1, when=lambda t, x, p: p.order > 0), name="first"
            ),
            hybrid.Transition(
                "a", "b", hybrid.Guard(clock, +1, when=lambda t, x, p: p.order < 0), name="second"
            ),
            hybrid.Transition("b", "a", hybrid.Guard(clock, -1)),
        ],
    )
