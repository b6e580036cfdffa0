"""Measures of arcs: closed forms of flights, of forced oscillations and of orbits with impacts."""

import math

import attrs
import mpmath as mp
import numpy as np
import pytest

import hybrid
import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Taylor, Transition, periodic_orbit, simulate
from hybrid.measures import Measure, amplitude, maximum, mean, minimum, rms
from models.one_impact import one_impact_orbits
from tests.reference.impacts import ImpactOscillator

G, E = 9.81, 0.8
TIGHT = Taylor(rtol=1e-12, atol=1e-14)


def close(value, exact, size=1.0):
    return value == pytest.approx(exact, rel=0.0, abs=1e-10 * size)


@pytest.mark.parametrize("speed", [1e-3, 2.0, 50.0])
def test_a_flight_and_its_bounce(speed):
    """The ball is thrown up and comes back; a little later it is on its way up again, more slowly."""
    flight = 2 * speed / G
    arc = simulate(models.bouncing_ball(), (0.0, speed), (0.0, 1.2 * flight))
    height = speed**2 / (2 * G)
    assert close(maximum("q")(arc), height, height)
    assert close(minimum("q")(arc), 0.0, height)
    # Both sides of the jump count: the speed down before it, and that up at the start.
    assert close(minimum("v")(arc), -speed, speed)
    assert close(maximum("v")(arc), speed, speed)
    assert close(amplitude("v")(arc), speed, speed)
    up = simulate(models.bouncing_ball(), arc.jumps[0].x_plus, (0.0, E * flight * (1 - 1e-12)))
    assert close(mean("q")(up), 2 / 3 * E**2 * height, height)
    assert close(mean("v")(up), 0.0, speed)
    assert close(rms("v")(up), E * speed / math.sqrt(3), speed)
    assert close(rms("q")(up), E**2 * height * math.sqrt(8 / 15), height)


@pytest.mark.parametrize("w", [0.3, 0.9, 2.0, 7.0])
@pytest.mark.parametrize("t0", [0.0, 1.3])
def test_a_forced_linear_oscillation_at_any_phase(w, t0):
    small = {"A": 0.01, "w": w}
    orbit = periodic_orbit(models.impact_oscillator(), (0.0, 0.0), parameters=small, t0=t0)
    arc = orbit.arc(TIGHT)
    exact = 0.01 / abs(1.0 - w**2 + 0.1j * w)
    for name, size in (("x", exact), ("v", w * exact)):
        assert close(maximum(name)(arc), size)
        assert close(minimum(name)(arc), -size)
        assert close(amplitude(name)(arc), size)
        assert close(mean(name)(arc), 0.0)
        assert close(rms(name)(arc), size / math.sqrt(2))


@pytest.mark.parametrize(("w", "r"), [(0.9, 0.8), (1.2, 0.8), (1.2, 0.5)])
def test_an_orbit_with_one_impact(w, r):
    """Its mean is the push of the wall; its smallest value and its RMS are those of the flight."""
    k, c, A, d = 1.0, 0.1, 1.0, 1.0
    known = one_impact_orbits(k, c, A, w, d, r)[0]
    guess = (d, -r * known.V)
    t0 = known.theta / w
    orbit = periodic_orbit(models.impact_oscillator(), guess, parameters={"w": w, "r": r}, t0=t0)
    arc = orbit.arc(TIGHT)
    period = 2 * math.pi / w
    assert close(maximum("x")(arc), d)
    assert close(arc.jumps.x_minus[0, 1], known.V)
    assert close(mean("x")(arc), -(1 + r) * known.V / (k * period))
    assert close(mean("v")(arc), 0.0)
    with mp.workdps(25):
        flight = ImpactOscillator(k, c, A, w, d, r).flight(d, -r * known.V, t0)
        low = mp.findroot(lambda t: flight(t)[1], t0 + float(arc.t[np.argmin(arc["x"])] - t0) % period)
        square = mp.quad(lambda t: flight(t)[0] ** 2, mp.linspace(t0, t0 + period, 9))
        assert close(minimum("x")(arc), float(flight(low)[0]))
        assert close(rms("x")(arc), float(mp.sqrt(square / period)))


def swing(outputs, end=7.0):
    """A run of an oscillation ``q = cos t`` with these outputs."""
    system = HybridSystem(
        state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))], outputs=outputs
    )
    return simulate(system, (1.0, 0.0), (0.0, end), solver=TIGHT)


def test_outputs_with_kinks_jumps_and_times():
    arc = swing(
        {
            "kinked": lambda t, x, p: np.abs(x.q - 0.2),
            "jumps": lambda t, x, p: np.where(x.q > 0.5, 2.0, 0.0),
            "fast": lambda t, x, p: np.sin(30 * t) + x.q,
            "constant": lambda t, x, p: x.q**2 + x.v**2,
        },
        2 * math.pi,
    )
    assert close(maximum("kinked")(arc), 1.2)
    assert close(minimum("kinked")(arc), 0.0)
    angle = math.acos(0.2)
    assert close(mean("kinked")(arc), 2 * (math.sin(angle) - 0.2 * angle + 0.1 * math.pi) / math.pi)
    assert close(rms("kinked")(arc), math.sqrt(0.54))
    assert close(amplitude("jumps")(arc), 1.0)
    assert close(mean("jumps")(arc), 2 / 3)
    assert close(rms("fast")(arc), 1.0)
    with mp.workdps(25):
        highest = mp.findroot(lambda t: 30 * mp.cos(30 * t) - mp.sin(t), math.pi / 60)
        top = mp.sin(30 * highest) + mp.cos(highest)
    assert close(maximum("fast")(arc), float(top))
    assert close(maximum("constant")(arc), 1.0)
    assert close(rms("constant")(arc), 1.0)


def test_an_output_that_cannot_be_traced():
    arc = swing({"odd": lambda t, x, p: math.exp(float(x.q))})
    assert close(maximum("odd")(arc), math.e)
    assert close(minimum("odd")(arc), 1 / math.e)


def test_an_output_of_some_modes_alone():
    """The force of a stop has extrema where it acts; a mean over the rest needs a value there."""
    parameters = {"A": 0.0, "c": 0.0}
    arc = simulate(models.stop_oscillator(), (0.0, 2.0), (0.0, 6.0), parameters=parameters)
    # In a stop of stiffness 10 beside one of stiffness 1, from a touch with the speed sqrt(3).
    deepest = (1 + math.sqrt(1 + 11 * 3)) / 11 - 1 / 11
    pressed = (-1 + math.sqrt(1 + 33)) / 11
    assert deepest == pytest.approx(pressed + 1 / 11)
    assert close(maximum("force")(arc), 10 * pressed)
    assert close(minimum("force")(arc), -10 * pressed)
    with pytest.raises(ArgumentError, match="'force' has no value in mode 'free', which the arc visits"):
        mean("force")(arc)
    early = simulate(models.stop_oscillator(), (0.0, 2.0), (0.0, 0.1), parameters=parameters)
    with pytest.raises(ArgumentError, match="'force' has no value in any mode of the arc"):
        maximum("force")(early)


def test_states_between_jumps_at_one_instant_count():
    """A push leads beyond another guard, which answers at once: the state between the two counts."""
    push = Transition(
        "m", "m", Guard(lambda t, x, p: x.q - 1.0, +1), hybrid.Reset(lambda t, x, p: {"v": 5.0}), name="push"
    )
    back = hybrid.Reset(lambda t, x, p: {"v": -1.0})
    answer = Transition("m", "m", Guard(lambda t, x, p: x.v - 4.0, +1), back, name="answer")
    system = HybridSystem(
        state=("q", "v"), modes=[Mode("m", lambda t, x, p: (x.v, 0.0))], transitions=[push, answer]
    )
    arc = simulate(system, (0.0, 1.0), (0.0, 1.5))
    assert len(arc.jumps) == 2
    assert maximum("v")(arc) == 5.0
    assert close(mean("v")(arc), 1 / 3)


def test_measures_of_other_names_and_scales():
    arc = swing({"less": lambda t, x, p: -1e-9 * x.q})
    assert maximum("less")(arc) == pytest.approx(-1e-9 * minimum("q")(arc), rel=1e-10)
    assert rms("less")(arc) == pytest.approx(1e-9 * rms("q")(arc), rel=1e-10)


def test_a_stiff_and_a_runge_kutta_solver():
    for solver in (hybrid.DOP853(rtol=1e-13, atol=1e-14), hybrid.RadauIIA(rtol=1e-11, atol=1e-12)):
        system = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))])
        arc = simulate(system, (0.6, 0.8), (0.0, 2 * math.pi), solver=solver)
        assert maximum("q")(arc) == pytest.approx(1.0, abs=1e-9)
        assert rms("q")(arc) == pytest.approx(math.sqrt(0.5), abs=1e-9)


def test_held_components_and_counters():
    count = hybrid.Reset(lambda t, x, p: {"u": x.u + 1.0, "n": x.n + 1})
    system = HybridSystem(
        state=("q",),
        held=("u",),
        counters=("n",),
        modes=[Mode("m", lambda t, x, p: (x.u,))],
        transitions=[Transition("m", "m", hybrid.Every(1.0), count)],
    )
    arc = simulate(system, (0.0,), (0.0, 2.5))
    assert maximum("u")(arc) == maximum("n")(arc) == 2.0
    assert close(mean("u")(arc), (1.0 + 2 * 0.5) / 2.5)
    assert close(maximum("q")(arc), 2.0)


@pytest.mark.parametrize("name", ["v", "power"])
def test_what_has_come_to_rest_is_measured_up_to_rounding(name):
    """The speed of a pendulum at rest is rounding, which no part of a step resolves."""
    pendulum = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, 0.5 - 0.2 * x.v - np.sin(x.q)))],
        outputs={"power": lambda t, x, p: 0.5 * x.v},
    )
    settled = simulate(pendulum, (0.3, 0.0), (0.0, 340.0))
    arc = simulate(pendulum, settled.x[-1], (340.0, 380.0))
    assert abs(mean(name)(arc)) < 1e-12
    assert rms(name)(arc) < 1e-12
    assert maximum(name)(arc) < 1e-12


def test_a_measure_is_a_value():
    assert maximum("x") == Measure("maximum", "x")
    assert maximum("x") != minimum("x")
    assert hash(rms("x")) == hash(rms("x"))
    assert repr(amplitude("x")) == "amplitude('x')"
    assert attrs.evolve(maximum("x"), kind="mean") == mean("x")
    assert maximum("q").unit(models.bouncing_ball()) == "m"
    assert maximum("x").unit(models.impact_oscillator()) is None


def test_refusals():
    arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
    with pytest.raises(ArgumentError, match=r"name must be the name of a component or an output; got 0\."):
        maximum(0)
    with pytest.raises(ArgumentError, match='kind must be "maximum", "minimum"'):
        Measure("median", "q")
    with pytest.raises(ArgumentError, match=r"name: State component .*'x' does not exist\. State components"):
        maximum("x")(arc)
    with pytest.raises(ArgumentError, match=r"arc must be a HybridArc; got .* or with orbit.arc\(\)"):
        maximum("q")(arc.t)
    sampled = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), samples=[0.5])
    with pytest.raises(ArgumentError, match=r"arc keeps samples only. Run simulate without samples="):
        maximum("q")(sampled)
    with pytest.raises(ArgumentError, match="arc must take some time to be measured"):
        mean("q")(simulate(models.bouncing_ball(), (1.0, 0.0), (2.0, 2.0)))
    with pytest.raises(ArgumentError, match=r"'root' is nan at t = .* in mode 'swing'; a measure needs"):
        maximum("root")(swing({"root": lambda t, x, p: np.sqrt(x.q)}))
