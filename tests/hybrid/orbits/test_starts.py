"""Orbits that are given at a jump, as papers print them: the state just after an impact, or before it."""

import numpy as np
import pytest

import models
from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, continue_orbit, periodic_orbit
from tests.hybrid.orbits.traffic import traffic_light

OSCILLATOR = models.impact_oscillator()
FORCED = periodic_orbit(OSCILLATOR, (0.9, 1.0))
IMPACT = FORCED.arc().jumps[0]


def assert_same(found, wanted, atol=1e-8):
    found, wanted = (np.sort_complex(np.asarray(each, dtype=complex)) for each in (found, wanted))
    np.testing.assert_allclose(found, wanted, atol=atol)


def assert_is_a_start(orbit):
    assert orbit.status.ok, orbit.status
    arc = orbit.arc()
    # The arc begins after the jumps at the point.
    assert sorted(arc.jumps.transition) == sorted(orbit.transitions)
    assert arc.mode[0] == arc.mode[-1]
    np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-8)


@pytest.mark.parametrize("periods", [0, 3, 100])
@pytest.mark.parametrize("digits", [3, 4, 6, 16])
@pytest.mark.parametrize("side", ["x_minus", "x_plus"])
def test_an_orbit_from_its_impact(side, digits, periods):
    guess, t0 = np.round(getattr(IMPACT, side), digits), round(IMPACT.t + periods * FORCED.period, digits)
    orbit = periodic_orbit(OSCILLATOR, guess, t0=t0)
    assert_same(orbit.multipliers, FORCED.multipliers)
    assert_same(np.linalg.eigvals(orbit.fundamental), FORCED.multipliers)
    assert_is_a_start(orbit)
    assert orbit.t0 == t0


@pytest.mark.parametrize("side", ["x_minus", "x_plus"])
def test_the_point_is_on_the_side_of_the_impact_that_the_guess_is_on(side):
    guess = getattr(IMPACT, side)
    np.testing.assert_allclose(periodic_orbit(OSCILLATOR, guess, t0=IMPACT.t).x0, guess, rtol=1e-8)


@pytest.mark.parametrize("late", [-1e-3, -1e-6, -1e-9, -1e-12, 1e-12, 1e-9, 1e-6, 1e-3])
def test_an_orbit_from_beside_its_impact(late):
    t0 = IMPACT.t + late
    orbit = periodic_orbit(OSCILLATOR, FORCED.arc()(t0), t0=t0)
    assert_same(orbit.multipliers, FORCED.multipliers)
    assert_is_a_start(orbit)


def test_two_periods_from_an_impact():
    orbit = periodic_orbit(OSCILLATOR, IMPACT.x_plus, t0=IMPACT.t, periods=2)
    assert_same(orbit.multipliers, FORCED.multipliers**2)
    assert_is_a_start(orbit)
    assert len(orbit.transitions) == 2


@pytest.mark.parametrize("mode", ["move", "lower"])
def test_a_mass_that_leaves_its_stop_at_the_strobe(mode):
    """The force changes its sign there; the orbit is the same from before it leaves and from after."""

    def force(t, p):
        return p.A * np.sin(np.pi * t)

    stop = Reset(lambda t, x, p: {"v": 0.0})
    system = HybridSystem(
        state=("q", "v"),
        parameters={"A": 25.0, "c": 1.0, "b": 0.9},
        period=2.0,
        modes=[
            Mode("move", lambda t, x, p: (x.v, force(t, p) - p.c * x.v)),
            Mode("upper", lambda t, x, p: (0.0, 0.0)),
            Mode("lower", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("move", "upper", Guard(lambda t, x, p: x.q - p.b, +1), stop, name="hit upper"),
            Transition("move", "lower", Guard(lambda t, x, p: x.q + p.b, -1), stop, name="hit lower"),
            Transition("upper", "move", Guard(lambda t, x, p: force(t, p), -1), name="leave upper"),
            Transition("lower", "move", Guard(lambda t, x, p: force(t, p), +1), name="leave lower"),
        ],
    )
    orbit = periodic_orbit(system, (-0.9, 0.0), mode=mode)
    assert orbit.mode == mode
    assert sorted(orbit.transitions) == ["hit lower", "hit upper", "leave lower", "leave upper"]
    np.testing.assert_array_equal(orbit.multipliers, 0.0)
    assert_is_a_start(orbit)


def kicked(*transitions):
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": 0.5},
        modes=[Mode("on", lambda t, x, p: (x.v, -x.q - 0.2 * x.v + np.cos(2.0 * np.pi * t)))],
        transitions=transitions,
        period=1.0,
    )


TICK = Transition(
    "on", "on", Every(1.0), Reset(lambda t, x, p: {"v": 0.3 * np.sin(x.q) - p.a * x.v}), name="tick"
)
STROBE = Transition(
    "on",
    "on",
    Guard(lambda t, x, p: np.sin(2.0 * np.pi * t), +1),
    Reset(lambda t, x, p: {"q": 0.8 * x.q + 0.2, "v": x.v - 0.1 * x.q}),
    name="strobe",
)


@pytest.mark.parametrize("t0", [0.0, 1.0, 7.0, -3.0, 1e-13, 1.0 - 1e-12])
@pytest.mark.parametrize("transitions", [(TICK,), (STROBE,), (TICK, STROBE), (STROBE, TICK)])
def test_an_orbit_from_the_instant_of_its_kicks(transitions, t0):
    """A run does not tick at its start, and a guard of time alone fires there once more."""
    system = kicked(*transitions)
    wanted = periodic_orbit(system, (0.1, 0.1), t0=0.37)
    orbit = periodic_orbit(system, (0.1, 0.1), t0=t0)
    assert_same(orbit.multipliers, wanted.multipliers)
    assert_same(np.linalg.eigvals(orbit.fundamental), wanted.multipliers)
    assert_is_a_start(orbit)
    assert orbit.t0 == pytest.approx(t0, abs=1e-7)


@pytest.mark.parametrize("transitions", [(TICK,), (STROBE,), (STROBE, TICK)])
def test_orbits_of_a_branch_at_the_instant_of_their_kicks_are_starts(transitions):
    branch = continue_orbit(periodic_orbit(kicked(*transitions), (0.1, 0.1)), "a", (0.3, 0.6))
    for i in range(0, len(branch), 8):
        assert_is_a_start(branch.orbit(i))


@pytest.mark.parametrize("side", ["x_minus", "x_plus"])
def test_an_orbit_of_an_autonomous_system_from_its_step(side):
    wheel = models.rimless_wheel()
    wanted = periodic_orbit(wheel, (0.2, 1.0), period=1.0)
    step = wanted.arc().jumps[0]
    orbit = periodic_orbit(wheel, getattr(step, side), period=wanted.period)
    assert_same(orbit.multipliers, wanted.multipliers)
    assert_is_a_start(orbit)


@pytest.mark.parametrize("E", [14.0, 20.0, 25.0])
def test_orbits_of_a_converter_are_starts_although_a_clock_ticks_at_their_point(E):
    converter, values = models.buck_converter(), {"E": 14.0}
    first = periodic_orbit(converter, (11.85, 0.56, 0.0), mode="off", parameters=values)
    branch = continue_orbit(first, "E", (11.0, 26.0))
    near = int(np.argmin(np.abs(branch.parameter - E)))
    orbit = branch.orbit(near)
    assert_is_a_start(orbit)
    again = periodic_orbit(converter, orbit.x0, mode=orbit.mode, t0=orbit.t0, parameters=orbit.parameters)
    assert again.transitions == orbit.transitions
    assert_same(again.multipliers, orbit.multipliers)
    assert_is_a_start(again)


def test_a_state_that_is_zero_for_a_time_is_controlled():
    """A queue at a traffic light grows while the light is red, and is empty before it turns red again."""
    orbit = periodic_orbit(traffic_light(), (3.0,), mode="green")
    assert orbit.status.ok
    assert orbit.x0[0] == pytest.approx(0.3 * 30.0, rel=1e-9)
    assert set(orbit.transitions) == {"go", "empty", "stop free"}
