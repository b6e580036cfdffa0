"""Derivatives where a clock counts from the entry of its mode, against closed forms and differences."""

import math
import pickle

import numpy as np
import pytest

import hybrid
from hybrid import After, Every, Guard, HybridSystem, Mode, Reset, Transition, periodic_orbit, simulate, split
from hybrid.system.entries import has_age
from hybrid.testing import check_system
from hybrid.transform.aged import aged, original_of
from lyapunov import (
    chart,
    covariant_vectors,
    finite_time_exponents,
    floquet_exponents,
    lyapunov_spectrum,
    two_orbit_exponents,
)

PERIOD, DRIVE, REST = 1.45, 1.5, 0.3


def neuron(**changes):
    """A leaky integrate-and-fire neuron, clamped for a refractory time after each spike; it may be forced."""
    given = {"I": DRIVE, "A": 0.0, "theta": 1.0, "r": REST, "P": PERIOD}
    return HybridSystem(
        state=("v",),
        parameters=given | changes,
        modes=[
            Mode("rise", lambda t, x, p: (p.I + p.A * np.cos(2 * np.pi * t / p.P) - x.v,)),
            Mode("rest", lambda t, x, p: (0.0,)),
        ],
        transitions=[
            Transition(
                "rise",
                "rest",
                Guard(lambda t, x, p: x.v - p.theta, +1),
                Reset(lambda t, x, p: {"v": 0.0}),
                name="fire",
            ),
            Transition("rest", "rise", After("r"), name="recover"),
        ],
        start="rise",
        period=(lambda p: p.P) if "A" in changes else None,
    )


def bouncer():
    """A ball that rests for a time after each hit, and then leaves the ground faster the faster it came."""
    return HybridSystem(
        state=("q", "v"),
        held=("u",),
        counters=("n",),
        parameters={"g": 9.81, "e": 0.8, "c": 1.0, "r": 0.2},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g)), Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "flight",
                "rest",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: {"q": 0.0, "u": x.v, "v": 0.0, "n": x.n + 1}),
                name="hit",
            ),
            Transition(
                "rest", "flight", After("r"), Reset(lambda t, x, p: {"v": p.c - p.e * x.u}), name="go"
            ),
        ],
        start="flight",
    )


def alternating():
    """Two modes that take turns, each for a time of its own."""
    return HybridSystem(
        state=("q",),
        held=("u",),
        parameters={"a": 0.3, "b": 0.5},
        modes=[Mode("on", lambda t, x, p: (1.0 - x.q,)), Mode("off", lambda t, x, p: (-2.0 * x.q,))],
        transitions=[
            Transition("on", "off", After("a")),
            Transition("off", "on", After("b"), Reset(lambda t, x, p: {"u": 0.5 * x.u + x.q})),
        ],
        start="on",
    )


def charger():
    """A capacitor that is charged up to a voltage, or for a time, whichever comes first."""
    return HybridSystem(
        state=("q",),
        parameters={"I": 2.0, "top": 1.0, "low": 0.4, "most": 0.5},
        modes=[Mode("charge", lambda t, x, p: (p.I - x.q,)), Mode("empty", lambda t, x, p: (-x.q,))],
        transitions=[
            Transition("charge", "empty", Guard(lambda t, x, p: x.q - p.top, +1), name="full"),
            Transition("charge", "empty", After("most"), name="late"),
            Transition("empty", "charge", Guard(lambda t, x, p: x.q - p.low, -1), name="empty"),
        ],
        start="charge",
    )


def kinked():
    """A neuron with a kink in its rates, which becomes modes, and a rest that drifts."""
    return split(
        HybridSystem(
            state=("v",),
            parameters={"I": DRIVE, "r": REST},
            modes=[
                Mode("rise", lambda t, x, p: (p.I - x.v + 0.7 * np.maximum(x.v - 0.5, 0.0),)),
                Mode("rest", lambda t, x, p: (-np.abs(x.v - 0.1),)),
            ],
            transitions=[
                Transition(
                    "rise",
                    "rest",
                    Guard(lambda t, x, p: x.v - 1.0, +1),
                    Reset(lambda t, x, p: {"v": 0.15}),
                    name="fire",
                ),
                Transition("rest", "rise", After("r"), name="recover"),
            ],
            start="rise",
        )
    )


def difference(function, at, step=1e-6):
    """The derivative of a function of one number."""
    return (function(at + step) - function(at - step)) / (2.0 * step)


@pytest.mark.parametrize(
    ("system", "x0", "mode", "names"),
    [
        (neuron(), (0.2,), "rise", ("r", "theta", "I")),
        (neuron(A=0.2), (0.2,), "rise", ("r", "A")),
        (neuron(), (0.0,), "rest", ("r",)),
        (bouncer(), (1.0, 0.3, -0.5), "flight", ("r", "c", "g")),
        (alternating(), (0.2, 0.1), "on", ("a", "b")),
        (charger(), (0.2,), "charge", ("top", "most", "low")),
        (charger(), (0.7,), "charge", ("top", "most", "I")),
        (kinked(), (0.2,), None, ("r", "I")),
    ],
)
def test_derivatives_are_those_of_the_flow(system, x0, mode, names):
    end = 2.9
    n, start = len(x0), np.append(x0, np.zeros(system.dimension - len(x0)))
    asked = {"tangent": True, "sensitivities": names, "samples": [1.0, end]}
    arc = simulate(system, start, (0.0, end), mode=mode, **asked)
    assert arc.status.ok
    assert arc.jump_count > 3
    assert arc.x.shape == (2, system.dimension)
    assert arc.system.state_names == system.state_names
    assert arc.fundamental.shape == (n, n)
    assert arc.sampled_fundamental.shape == (2, n, n)
    for i in range(n):
        moved = difference(lambda h, i=i: run(system, x0 + h * np.eye(n)[i], end, mode)[:n], 0.0)
        np.testing.assert_allclose(arc.fundamental[:, i], moved, atol=2e-7)
        np.testing.assert_allclose(arc.sampled_fundamental[-1, :, i], moved, atol=2e-7)
    for i, name in enumerate(names):
        given = arc.parameters[name]
        moved = difference(lambda value, name=name: run(system, x0, end, mode, **{name: value})[:n], given)
        np.testing.assert_allclose(arc.sensitivity[:, i], moved, atol=5e-7)


def run(system, x0, end, mode, **parameters):
    """The state at the end of a run."""
    x0 = np.append(x0, np.zeros(system.dimension - len(x0)))
    return simulate(system, x0, (0.0, end), mode=mode, parameters=parameters).x[-1]


def test_the_arc_with_tangent_vectors_is_that_without():
    """Points, jumps and dense output have no age."""
    system = bouncer()
    plain = simulate(system, (1.0, 0.3), (0.0, 3.0))
    arc = simulate(system, (1.0, 0.3), (0.0, 3.0), tangent=True)
    times = np.linspace(0.0, 3.0, 50)
    np.testing.assert_allclose(arc(times), plain(times), atol=1e-13)
    np.testing.assert_allclose(arc.jumps.x_plus, plain.jumps.x_plus, atol=1e-13)
    np.testing.assert_allclose(arc.jumps.saltation, plain.jumps.saltation, atol=1e-11)
    assert arc.jumps.saltation.shape == (len(arc.jumps), 3, 3)


def test_times_of_spikes_move_with_what_went_before():
    """Spike ``k`` of a neuron comes ``k`` periods later: each carries a refractory time and a threshold."""
    system = neuron()
    arc = simulate(system, (0.2,), (0.0, 5.0), tangent=True, sensitivities=("r", "theta"))
    spikes = [i for i, jump in enumerate(arc.jumps) if jump.transition == "fire"]
    slope = 1.0 / (DRIVE - 1.0)
    for k, i in enumerate(spikes):
        np.testing.assert_allclose(arc.jumps.t_sensitivity[i], [k, (k + 1) * slope], atol=1e-10)
        np.testing.assert_allclose(arc.jumps.t_gradient[i], [-1.0 / (DRIVE - 0.2)], atol=1e-10)


def test_a_free_neuron_has_the_multiplier_of_the_flow_alone():
    orbit = periodic_orbit(neuron(), (0.2,), period=1.3)
    assert orbit.status.ok
    assert orbit.mode == "rise"
    assert orbit.x0.shape == (1,)
    assert orbit.period == pytest.approx(math.log(DRIVE / (DRIVE - 1.0)) + REST, rel=1e-12)
    np.testing.assert_allclose(orbit.multipliers, [1.0], rtol=1e-12)
    found = orbit.sensitivity(("r", "theta", "I"))
    exact = [1.0, 1.0 / (DRIVE - 1.0), 1.0 / DRIVE - 1.0 / (DRIVE - 1.0)]
    np.testing.assert_allclose(found.period, exact, atol=1e-11)
    assert found.x0.shape == (1, 3)
    assert found.multipliers.shape == (1, 3)
    end = simulate(orbit.system, orbit.x0, (orbit.t0, orbit.t0 + orbit.period), mode=orbit.mode).x[-1]
    np.testing.assert_allclose(end, orbit.x0, atol=1e-11)


@pytest.mark.parametrize(("name", "span"), [("r", (0.1, 0.6)), ("theta", (0.5, 1.4))])
def test_a_branch_has_the_closed_period(name, span):
    system = neuron()
    branch = hybrid.continue_orbit(periodic_orbit(system, (0.2,), period=1.3), name, span)
    values = {each: np.full(len(branch), system.parameters[each]) for each in ("r", "theta", "I")}
    values[name] = branch.parameter
    exact = values["r"] - np.log(1.0 - values["theta"] / values["I"])
    assert branch.status.ok
    assert branch.bifurcations == ()
    assert branch.x0.shape[1] == 1
    np.testing.assert_allclose(branch.period, exact, rtol=1e-11)
    np.testing.assert_allclose(branch.orbit(3).multipliers, [1.0], rtol=1e-10)


def closed_multiplier(spike, amplitude=0.2):
    """``dt'/dt`` of a spike and the next one, of the neuron that is locked to its forcing."""

    def rate(t, v):
        return DRIVE + amplitude * math.cos(2.0 * math.pi * t / PERIOD) - v

    return rate(spike + REST, 0.0) * math.exp(REST - PERIOD) / rate(spike, 1.0)


def locked():
    """The neuron that fires once per forcing period, its time of a spike, and a time at which it rises."""
    system = neuron(A=0.2)
    arc = simulate(system, (0.0,), (0.0, 200 * PERIOD))
    spike = arc.jumps["fire"][-1].t % PERIOD
    return system, spike, spike + 0.7 * PERIOD


def test_a_forced_orbit_has_the_multiplier_of_the_map_of_spikes():
    """From a time at which the neuron rises, and from one at which it rests and all is in its age."""
    system, spike, rising = locked()
    guess = simulate(system, (0.0,), (spike, rising), mode="rest").x[-1]
    orbit = periodic_orbit(system, guess, mode="rise", t0=rising)
    exact = closed_multiplier(orbit.arc().jumps["fire"][0].t)
    assert orbit.status.ok
    assert orbit.system.state_names == ("v",)
    np.testing.assert_allclose(orbit.multipliers, [exact], rtol=1e-12)
    np.testing.assert_allclose(floquet_exponents(orbit), [math.log(exact) / PERIOD], rtol=1e-12)

    resting = periodic_orbit(system, (0.0,), mode="rest", t0=spike + 0.1)
    assert resting.status.ok
    assert resting.system.state_names == ("v", "age")
    np.testing.assert_allclose(resting.x0, [0.0, 0.1], atol=1e-9)
    np.testing.assert_allclose(resting.multipliers, [exact, 0.0], rtol=1e-12)
    again = simulate(resting.system, resting.x0, (resting.t0, resting.t0 + PERIOD), mode="rest")
    np.testing.assert_allclose(again.x[-1], resting.x0, atol=1e-12)


def test_a_branch_of_orbits_that_rest_has_their_age():
    system, spike, _ = locked()
    resting = periodic_orbit(system, (0.0,), mode="rest", t0=spike + 0.1)
    branch = hybrid.continue_orbit(resting, "A", (0.18, 0.25))
    assert branch.status.ok
    assert branch.system.state_names == ("v", "age")
    assert branch.x0.shape[1] == 2
    i = len(branch) // 2
    orbit = branch.orbit(i)
    fire = orbit.arc().jumps["fire"][0].t
    np.testing.assert_allclose(orbit.multipliers[0], closed_multiplier(fire, branch.parameter[i]), rtol=1e-10)
    again = hybrid.open_branch(system, branch.to_xarray())
    np.testing.assert_allclose(again.orbit(i).fundamental, orbit.fundamental, atol=1e-9)


def test_a_ball_that_rests_has_the_multiplier_of_its_launches():
    """``v' = c + e v``: the multiplier is ``e``, and rests add to the period alone."""
    g, e, c, r = 9.81, 0.8, 1.0, 0.2
    orbit = periodic_orbit(bouncer(), (1.2, 0.0), period=1.2)
    v = c / (1.0 - e)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(2.0 * v / g + r, rel=1e-12)
    np.testing.assert_allclose(orbit.multipliers, [1.0, e, 0.0], rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(orbit.x0[2], -v, rtol=1e-11)


def test_modes_that_take_turns_have_the_age_as_one_more_direction():
    """Nothing but the ages tells when the modes change: the multiplier 1 of the flow is beside the others."""
    system = alternating()
    orbit = periodic_orbit(system, (0.2, 0.0), period=0.8)
    assert orbit.status.ok
    assert orbit.system.state_names == ("q", "u", "age")
    np.testing.assert_allclose(orbit.multipliers, [1.0, 0.5, math.exp(-1.3)], rtol=1e-11)
    spectrum = lyapunov_spectrum(system, (0.2, 0.0), interval=0.8, intervals=300)
    np.testing.assert_allclose(0.8 * spectrum.exponents, [0.0, math.log(0.5), -1.3], atol=1e-12)
    assert abs(spectrum.sum_defect) < 1e-12


@pytest.mark.parametrize(("mode", "v"), [("rise", 0.5), ("rest", 0.0)])
def test_exponents_are_those_of_the_orbit(mode, v):
    system, spike, _rising = locked()
    exact = math.log(closed_multiplier(spike)) / PERIOD
    spectrum = lyapunov_spectrum(system, (v,), mode=mode, intervals=300, transient=60)
    np.testing.assert_allclose(spectrum.exponents, [exact], atol=1e-8)
    assert spectrum.x.shape == (1,)
    assert math.isnan(spectrum.sum_rule)
    pair = two_orbit_exponents(system, (v,), mode=mode, intervals=200, transient=60, separation=1e-7)
    assert pair.status.ok
    assert pair.renormalised_exponent == pytest.approx(exact, abs=1e-6)


def test_other_exponents():
    system, spike, _ = locked()
    exact = math.log(closed_multiplier(spike)) / PERIOD
    vectors = covariant_vectors(system, (0.5,), intervals=30)
    np.testing.assert_allclose(vectors.exponents, [exact, -np.inf], atol=1e-8)
    assert vectors.names.state == ("v", "age")
    growth = finite_time_exponents(system, [(0.5,), (0.2,)], interval=PERIOD)
    assert growth.shape == (2, 1)
    assert np.all(np.isfinite(growth))
    found = chart(system, {"A": [0.2]}, (0.5,), intervals=300, transient=60, section=2)
    np.testing.assert_allclose(found.exponents, [[exact]], atol=1e-8)
    assert found.section.shape == (1, 2, 1)
    assert np.all(np.isfinite(found.section))


def test_an_orbit_that_never_rests_pays_nothing():
    """A damped oscillator beside a mode that its guard keeps far away."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"k": 1.0},
        modes=[
            Mode("free", lambda t, x, p: (x.v, np.cos(t) - p.k * x.q - 0.5 * x.v)),
            Mode("held", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("free", "held", Guard(lambda t, x, p: x.q - 50.0, +1)),
            Transition("held", "free", After(1.0)),
        ],
        start="free",
        period=2.0 * np.pi,
    )
    orbit = periodic_orbit(system, (0.0, 2.0))
    moduli = np.full(2, math.exp(-0.5 * math.pi))
    assert orbit.status.ok
    assert "family" not in orbit.status.message
    np.testing.assert_allclose(np.abs(orbit.multipliers), moduli, rtol=1e-11)
    branch = hybrid.continue_orbit(orbit, "k", (0.9, 1.1))
    assert branch.stable.all()
    assert branch.x0.shape == branch.multipliers.shape == (len(branch), 2)


def test_a_system_whose_clocks_count_from_time_zero_pays_nothing():
    system = HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (-x.q,))],
        transitions=[Transition("run", "run", Every(1.0), Reset(lambda t, x, p: {"q": x.q + 1.0}))],
    )
    assert aged(system) is system


def test_the_age_is_a_component_as_any_other():
    system = bouncer()
    whole = aged(system)
    assert whole is aged(system)
    assert aged(whole) is whole
    assert whole.state_names == ("q", "v", "u", "age", "n")
    assert whole.age == 3
    assert [has_age(system, mode) for mode in system.mode_names] == [False, True]
    arc = simulate(whole, (1.0, 0.3, -1.0, 0.0, 0.0), (0.0, 4.0))
    go, hit = arc.jumps["go"], arc.jumps["hit"]
    np.testing.assert_allclose([jump.x_minus[3] for jump in go], 0.2, rtol=1e-12)
    assert all(jump.x_plus[3] == 0.0 for jump in (*go, *hit))
    # A run that starts in the middle of a rest leaves it as much earlier.
    arc = simulate(whole, (0.0, 0.0, -1.0, 0.15, 0.0), (5.0, 6.0), mode="rest")
    assert arc.jumps[0].t == pytest.approx(5.05, rel=1e-15)


def test_an_aged_system_is_pickled_as_its_original():
    again = pickle.loads(pickle.dumps(aged(PORTABLE)))
    assert again.state_names == ("q", "age")
    assert original_of(again).state_names == ("q",)
    arc = simulate(again, (0.3, 0.0), (0.0, 2.0))
    np.testing.assert_array_equal(arc.x, simulate(aged(PORTABLE), (0.3, 0.0), (0.0, 2.0)).x)


def fall(t, x, p):
    """The rate of a quantity that falls."""
    return (-x.q,)


def more(t, x, p):
    """One more of it."""
    return {"q": x.q + 1.0}


PORTABLE = HybridSystem(
    state=("q",),
    modes=[Mode("fall", fall)],
    transitions=[Transition("fall", "fall", After(0.7), Reset(more))],
)


def test_a_name_that_is_taken_is_left_alone():
    system = HybridSystem(
        state=("age",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[Transition("run", "run", After(0.5), Reset(lambda t, x, p: {"age": 0.5 * x.age}))],
    )
    assert aged(system).state_names == ("age", "age2")
    arc = simulate(system, (0.0,), (0.0, 1.2), tangent=True)
    np.testing.assert_allclose(arc.fundamental, [[0.25]])


def test_a_state_without_names():
    system = HybridSystem(
        state=2,
        modes=[
            Mode("go", lambda t, x, p: (1.0 - x[0], x[0])),
            Mode("wait", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "go", "wait", Guard(lambda t, x, p: x[0] - 0.5, +1), Reset(lambda t, x, p: (0.0, x[1]))
            ),
            Transition("wait", "go", After(0.3)),
        ],
        start="go",
    )
    arc = simulate(system, (0.1, 0.0), (0.0, 2.0), tangent=True)
    moved = difference(lambda v: simulate(system, (v, 0.0), (0.0, 2.0)).x[-1], 0.1)
    np.testing.assert_allclose(arc.fundamental[:, 0], moved, atol=1e-7)


@pytest.mark.parametrize("system", [neuron(), alternating(), charger(), kinked()])
def test_systems_with_after_keep_every_law(system):
    check_system(system, examples=10)
