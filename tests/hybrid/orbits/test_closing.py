"""Orbits whose point lies at a jump: a period has the jumps at one of its ends."""

import math

import numpy as np
import pytest

import lyapunov
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, periodic_orbit, stroboscopic_section
from models import impact_oscillator
from models.one_impact import one_impact_orbits

KICK = 0.3
DECAY = math.exp(-1)


def kicked(kicks=1):
    """``q' = -q / T``; once per period ``T``, at the phase 0.3, each kick takes ``q`` to ``a q + b``."""
    names = [f"kick {i}" for i in range(kicks)]

    def due(t, x, p):
        return np.sin(2 * np.pi * (t / p.T - KICK))

    return HybridSystem(
        state=("q",),
        parameters={"a": 3.0, "b": -1.0, "T": 1.0, "idle": 0.0},
        modes=[Mode("on", lambda t, x, p: (-x.q / p.T + 0 * p.idle,))],
        transitions=[
            Transition("on", "on", Guard(due, +1), Reset(lambda t, x, p: (p.a * x.q + p.b,)), name=name)
            for name in names
        ],
        period=lambda p: p.T,
    )


@pytest.mark.parametrize("T", [1e-9, 1.0, 3.7e9])
@pytest.mark.parametrize("cycle", [0, 7, -2])
@pytest.mark.parametrize(
    ("a", "b", "kicks", "periods"), [(3, -1, 1, 1), (-0.5, 1, 1, 3), (0, 2, 1, 1), (2, 1, 2, 2)]
)
def test_an_orbit_from_the_instant_of_its_kick(a, b, kicks, periods, cycle, T):
    """It starts before the kick: ``q = exp(-1) k(q)`` with all kicks ``k``, each of slope ``a``."""
    values = {"a": a, "b": b, "T": T}
    orbit = periodic_orbit(kicked(kicks), (0.2,), t0=(KICK + cycle) * T, parameters=values, periods=periods)
    assert orbit.status.ok
    slope, lift = a**kicks, b * sum(a**i for i in range(kicks))
    assert orbit.x0[0] == pytest.approx(DECAY * lift / (1 - DECAY * slope), rel=1e-9)
    assert orbit.multipliers[0] == pytest.approx((DECAY * slope) ** periods, rel=1e-8, abs=1e-300)
    np.testing.assert_allclose(orbit.fundamental, (DECAY * slope) ** periods, rtol=1e-8)
    assert len(orbit.signature) == 1 + kicks * periods


def test_an_orbit_from_just_before_its_impact():
    system = impact_oscillator()
    (exact, *_) = one_impact_orbits(**system.parameters)
    start = (system.parameters["d"], exact.V)
    orbit = periodic_orbit(system, start, t0=exact.theta / system.parameters["w"])
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, start, rtol=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers), np.sort_complex(exact.multipliers), rtol=1e-6
    )


@pytest.mark.parametrize("transient", [0, 1, 5])
def test_a_companion_does_not_make_the_jumps_that_the_orbit_has_made(transient):
    result = lyapunov.two_orbit_exponents(
        kicked(), (0.2,), t0=KICK, intervals=6, transient=transient, parameters={"a": -2.0}
    )
    np.testing.assert_allclose(result.renormalised_growths, math.log(2) - 1, atol=1e-5)
    np.testing.assert_allclose(np.diff(np.log(result.distances)), math.log(2) - 1, atol=1e-5)
    assert math.log(result.distances[0] / 1e-8) == pytest.approx(math.log(2) - 1, abs=1e-5)


def kicks_and_decays(start, a, periods):
    """States at the kicks, before each."""
    states = [start]
    for _ in range(periods):
        states.append(DECAY * (a * states[-1] - 1.0))
    return states


def test_rows_that_go_on_from_others_make_each_kick_once():
    """A row goes on from the state before the kick at the end of the last row's transient of 4 periods."""
    a, intervals, transient = 2.5, 3, 4
    chart = lyapunov.chart(
        kicked(),
        {"idle": [1.0, 2.0, 3.0]},
        (0.2,),
        t0=KICK,
        parameters={"a": a},
        intervals=intervals,
        transient=transient,
        continue_from="idle",
    )
    states = kicks_and_decays(0.2, a, 3 * transient + intervals)
    ends = [a * states[(row + 1) * transient + intervals] - 1.0 for row in range(3)]
    np.testing.assert_allclose(chart.x_end[:, 0], ends, rtol=1e-9)


def test_the_section_of_a_chart_goes_on_where_the_spectrum_has_ended():
    """At the quarter after each kick, of an orbit that repeats."""
    a = 2.0
    fixed = -DECAY / (1 - DECAY * a)
    chart = lyapunov.chart(
        kicked(),
        {"a": [a]},
        (fixed,),
        t0=KICK,
        intervals=5,
        section=4,
        at=Guard(lambda t, x, p: np.sin(2 * np.pi * (t - KICK - 0.25)), +1),
    )
    np.testing.assert_allclose(chart.section[0, :, 0], (a * fixed - 1) * math.exp(-0.25), rtol=1e-6)


def test_a_stroboscopic_section_is_taken_after_the_kicks():
    a = 2.0
    fixed = -DECAY / (1 - DECAY * a)
    section = stroboscopic_section(kicked(), (fixed,), periods=4, t0=KICK, parameters={"a": a})
    np.testing.assert_allclose(section.x[:, 0], a * fixed - 1, rtol=1e-8)
