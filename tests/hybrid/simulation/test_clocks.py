"""Clocks: exact ticks, the rules of one instant, derivatives, bad input."""

import math
import pickle
from fractions import Fraction

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import After, ArgumentError, At, Every, Guard, HybridSystem, Mode, ModelError, Reset, Transition
from hybrid.testing import Case, check_jumps, check_saltation

E = math.exp


def pwm(**parameters):
    """A coil that is switched on and off by two clocks."""
    return HybridSystem(
        state=("i",),
        parameters={"R": 1.0, "L": 2.0, "V": 3.0, "T": 0.1, "d": 0.3} | parameters,
        modes=[
            Mode("on", lambda t, x, p: ((p.V - p.R * x.i) / p.L,)),
            Mode("off", lambda t, x, p: (-p.R * x.i / p.L,)),
        ],
        transitions=[
            Transition("on", "off", Every("T", offset=lambda p: p.d * p.T), name="off"),
            Transition("off", "on", Every("T"), name="on"),
        ],
        start="on",
    )


def counted(*transitions, state=("a", "b")):
    """Components that do not move, with transitions from the one mode to itself."""
    return HybridSystem(
        state=state, modes=[Mode("m", lambda t, x, p: (0.0,) * len(state))], transitions=list(transitions)
    )


def loop(clock, name="tick", **changes):
    """A transition of the mode ``m`` to itself that adds to components."""
    return Transition(
        "m",
        "m",
        clock,
        Reset(lambda t, x, p: {n: getattr(x, n) + by for n, by in changes.items()}),
        name=name,
    )


def decay_through(times, dose, k, end):
    """Amount at the end after doses."""
    return E(-k * end) + dose * sum(E(-k * (end - t)) for t in times)


@pytest.mark.parametrize("period", [None, 0.1, 0.25, math.pi])
@pytest.mark.parametrize(("every", "offset"), [(0.1, 0.0), (0.1, 0.03), (1 / 3, 0.2)])
def test_ticks_do_not_drift(period, every, offset):
    system = HybridSystem(
        state=("n",),
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[loop(Every(every, offset), n=1.0)],
        period=period,
    )
    end = 1000.0 + every / 2
    arc = hybrid.simulate(system, (0.0,), (0.0, end), max_jumps=10**6)
    first = 0 if offset else 1
    exact = [float(Fraction(offset) + k * Fraction(every)) for k in range(first, first + len(arc.jumps))]
    assert len(exact) == math.floor((end - offset) / every) + 1 - first
    np.testing.assert_array_equal(arc.jumps.t, exact)
    np.testing.assert_array_equal(arc.t[np.flatnonzero(np.diff(arc.j))], exact)


def test_a_late_tick_is_exact():
    """After ten million ticks."""
    system = counted(loop(Every(0.1), a=1.0), state=("a",))
    arc = hybrid.simulate(system, (0.0,), (1e6 - 0.25, 1e6 + 0.05), max_jumps=100)
    np.testing.assert_array_equal(arc.jumps.t, [float(k * Fraction(0.1)) for k in range(9999998, 10000001)])


def test_the_closed_map_of_a_switched_coil():
    arc = hybrid.simulate(pwm(), (0.0,), (0.0, 1.0), tangent=True)
    i = 0.0
    for _ in range(10):
        i = (3.0 + (i - 3.0) * E(-0.015)) * E(-0.035)
    assert arc.x[-1, 0] == pytest.approx(i, rel=1e-13)
    assert arc.fundamental[0, 0] == pytest.approx(E(-0.5), rel=1e-13)


@pytest.mark.parametrize(("duty", "mode", "on"), [(0.0, "off", 0.0), (1.0, "on", 1.05), (0.0, "on", 1.05)])
def test_a_duty_of_nothing_or_all_keeps_the_mode(duty, mode, on):
    """Each clock fires once at one instant, and the two undo each other."""
    system = HybridSystem(
        state=("i",),
        parameters={"d": duty},
        modes=[Mode("on", lambda t, x, p: (1.0,)), Mode("off", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("on", "off", Every(0.1, lambda p: 0.1 * p.d)),
            Transition("off", "on", Every(0.1)),
        ],
    )
    assert hybrid.simulate(system, (0.0,), (0.0, 1.05), mode=mode).x[-1, 0] == pytest.approx(on, abs=1e-12)


def test_a_tick_at_the_start_waits_and_one_at_the_end_fires():
    arc = hybrid.simulate(counted(loop(Every(0.5), a=1.0)), (0.0, 0.0), (1.0, 2.0))
    np.testing.assert_allclose(arc.jumps.t, [1.5, 2.0], rtol=1e-15)
    arc = hybrid.simulate(counted(loop(At([0.0, 1.0, 2.0]), a=1.0)), (0.0, 0.0), (0.0, 2.0))
    np.testing.assert_allclose(arc.jumps.t, [1.0, 2.0], rtol=1e-15)


def test_a_run_that_is_split_ticks_as_often():
    system = pwm()
    whole = hybrid.simulate(system, (0.2,), (0.0, 1.0))
    half = hybrid.simulate(system, (0.2,), (0.0, 0.53))
    rest = hybrid.simulate(system, half.x[-1], (0.53, 1.0), mode=str(half.mode[-1]))
    assert len(half.jumps) + len(rest.jumps) == len(whole.jumps)
    assert rest.x[-1, 0] == pytest.approx(whole.x[-1, 0], rel=1e-13)


@pytest.mark.parametrize("names", ["AB", "BA"])
def test_clocks_that_tick_together_fire_as_listed(names):
    """Three tenths and a third tick are one instant, although the numbers differ by rounding."""
    clocks = {"A": Every(0.1), "B": Every(0.3)}
    system = counted(*(loop(clocks[name], name, a=1.0) for name in names))
    arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 0.95))
    together = [
        name for t, name in zip(arc.jumps.t, arc.jumps.transition, strict=True) if abs(t - 0.6) < 1e-9
    ]
    assert together == list(names)
    assert arc.status.ok
    assert arc.x[-1, 0] == 12.0


def test_two_modes_take_turns():
    system = HybridSystem(
        state=("s",),
        parameters={"T": 0.5},
        modes=[Mode("up", lambda t, x, p: (1.0,)), Mode("down", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("up", "down", Every(lambda p: p.T)),
            Transition("down", "up", Every(lambda p: p.T)),
        ],
        start="up",
    )
    arc = hybrid.simulate(system, (0.0,), (0.0, 2.25))
    np.testing.assert_array_equal(arc.jumps.t, arc.parameters["T"] * np.arange(1, 5))
    assert arc.x[-1, 0] == pytest.approx(0.25, abs=1e-14)


def test_a_sample_is_taken_in_the_mode_that_a_slower_clock_enters():
    sample = Reset(lambda t, x, p: {"n": x.n + 1.0})
    for order in (1, -1):
        system = HybridSystem(
            state=("n",),
            modes=[Mode("a", lambda t, x, p: (0.0,)), Mode("b", lambda t, x, p: (0.0,))],
            transitions=[
                Transition("a", "a", Every(0.1), sample),
                Transition("b", "b", Every(0.1), sample),
                Transition("a", "b", Every(0.5)),
                Transition("b", "a", Every(0.5)),
            ][::order],
            start="a",
        )
        arc = hybrid.simulate(system, (0.0,), (0.0, 2.05))
        assert arc.x[-1, 0] == 20.0
        assert len(arc.jumps) == 24


def test_a_reset_that_may_land_in_several_parts_misses_no_tick():
    """Each part is a copy of the transition with a condition; the copies share their ticks."""
    kicked = Transition("m", "m", Every(1.0), Reset(lambda t, x, p: {"v": x.v + 1.0, "n": x.n + 1}))
    pieces = hybrid.split(
        HybridSystem(
            state=("v",),
            counters=("n",),
            modes=[Mode("m", lambda t, x, p: (-0.5 * np.sign(x.v),))],
            transitions=[kicked],
        )
    )
    for start in (-20.3, -2.3, -0.3, 0.3):
        assert hybrid.simulate(pieces, {"v": start}, (0.0, 12.5))["n"][-1] == 12.0


def test_clocks_in_a_system_that_is_split():
    """Crossing a kink neither enters the mode anew nor makes a clock tick twice."""
    field = Mode("m", lambda t, x, p: (np.cos(t) + 0.1 * np.abs(x.q), 0.0))
    twice = [loop(Every(0.25), "one", n=1.0), loop(Every(0.25), "two", n=1.0)]
    pieces = hybrid.split(HybridSystem(state=("q", "n"), modes=[field], transitions=twice))
    assert hybrid.simulate(pieces, (0.3, 0.0), (0.0, 10.0)).x[-1, 1] == 80.0
    end = [Transition("m", None, After(6.0), name="end")]
    pieces = hybrid.split(HybridSystem(state=("q", "n"), modes=[field], transitions=end))
    arc = hybrid.simulate(pieces, (0.3, 0.0), (0.0, 10.0))
    assert len(arc.jumps) > 1
    assert arc.t[-1] == 6.0


def test_a_guard_and_a_tick_at_one_instant_fire_both():
    for order in (1, -1):
        both = [
            Transition("m", "m", Every(1.0), Reset(lambda t, x, p: {"c": x.c + 10.0}), name="tick"),
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: x.q - 1, 1),
                Reset(lambda t, x, p: {"q": x.q - 1, "c": 2 * x.c}),
                name="saw",
            ),
        ][::order]
        system = HybridSystem(
            state=("q", "c"), modes=[Mode("m", lambda t, x, p: (1.0, 0.0))], transitions=both
        )
        arc = hybrid.simulate(system, (0.0, 1.0), (0.0, 3.5))
        assert list(arc.jumps.transition) == [each.name for each in both] * 3
        assert arc.jumps.t == pytest.approx([1, 1, 2, 2, 3, 3], abs=1e-12)


def test_a_condition_passes_ticks_over():
    odd = Every(1.0, when=lambda t, x, p: np.mod(x.a, 2) - 0.5)
    system = counted(loop(Every(1.0), "count", a=1.0), loop(odd, "odd", b=1.0))
    assert hybrid.simulate(system, (0.0, 0.0), (0.0, 9.5)).x[-1].tolist() == [9.0, 5.0]


def test_doses_at_listed_times_and_their_derivatives():
    system = HybridSystem(
        state=("A",),
        parameters={"k": 0.1, "dose": 5.0, "t2": 30.0},
        modes=[Mode("run", lambda t, x, p: (-p.k * x.A,))],
        transitions=[
            Transition("run", "run", At([0.0, 24.0, "t2", 48.0]), Reset(lambda t, x, p: {"A": x.A + p.dose}))
        ],
    )
    arc = hybrid.simulate(system, (1.0,), (0.0, 50.0), sensitivities=("dose", "t2", "k"))
    np.testing.assert_array_equal(arc.jumps.t, [24.0, arc.parameters["t2"], 48.0])
    assert arc.x[-1, 0] == pytest.approx(decay_through([24, 30, 48], 5.0, 0.1, 50.0), rel=1e-12)
    shares = [sum(E(-0.1 * (50 - t)) for t in (24, 30, 48)), 0.5 * E(-2.0)]
    in_k = -50 * E(-5.0) - 5 * sum((50 - t) * E(-0.1 * (50 - t)) for t in (24, 30, 48))
    np.testing.assert_allclose(arc.sensitivity, [[*shares, in_k]], rtol=1e-8)
    np.testing.assert_array_equal(arc.jumps.t_sensitivity[:, 1], [0.0, 1.0, 0.0])


def test_many_listed_times_each_fire():
    times = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 10_000))
    arc = hybrid.simulate(counted(loop(At(times), a=1.0)), (0.0, 0.0), (0.0, 2e4), max_jumps=10**5)
    np.testing.assert_array_equal(arc.jumps.t, times)


def test_sensitivities_in_period_and_offset():
    system = HybridSystem(
        state=("q",),
        parameters={"T": 0.5, "o": 0.1},
        modes=[Mode("f", lambda t, x, p: (x.q,))],
        transitions=[
            Transition("f", "f", Every("T", offset="o"), Reset(lambda t, x, p: {"q": 0.5 * x.q + t}))
        ],
    )

    def end(T, o):
        return hybrid.simulate(system, (1.0,), (0.0, 3.0), parameters={"T": T, "o": o}).x[-1, 0]

    arc = hybrid.simulate(system, (1.0,), (0.0, 3.0), sensitivities=("T", "o"))
    h = 1e-5
    differences = [
        (end(0.5 + h, 0.1) - end(0.5 - h, 0.1)) / (2 * h),
        (end(0.5, 0.1 + h) - end(0.5, 0.1 - h)) / (2 * h),
    ]
    np.testing.assert_allclose(arc.sensitivity, [differences], rtol=1e-8)
    np.testing.assert_allclose(arc.jumps.t_sensitivity, [[k, 1.0] for k in range(6)], atol=1e-12)


def neuron():
    """A leaky integrate-and-fire neuron with a refractory time."""
    return HybridSystem(
        state=("v",),
        parameters={"I": 1.5, "r": 0.7},
        modes=[Mode("rise", lambda t, x, p: (p.I - x.v,)), Mode("rest", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "rise",
                "rest",
                Guard(lambda t, x, p: x.v - 1, 1),
                Reset(lambda t, x, p: {"v": 0.0}),
                name="spike",
            ),
            Transition("rest", "rise", After("r"), name="again"),
        ],
        start="rise",
    )


def test_a_neuron_rests_so_long_after_each_spike():
    arc = hybrid.simulate(neuron(), (0.0,), (0.0, 30.0))
    spikes, ends = (np.array([jump.t for jump in arc.jumps[name]]) for name in ("spike", "again"))
    np.testing.assert_allclose(ends - spikes[: len(ends)], 0.7, rtol=1e-14)
    np.testing.assert_allclose(np.diff(spikes), 0.7 + math.log(3.0), rtol=1e-12)


def test_the_start_and_a_self_transition_enter_a_mode():
    system = counted(loop(After(0.4), a=1.0), loop(At([1.0]), "push", b=1.0))
    arc = hybrid.simulate(system, (0.0, 0.0), (0.1, 2.0))
    # Entered at 0.1, 0.5 and 0.9, and anew by the push at 1.
    assert arc.jumps.t == pytest.approx([0.5, 0.9, 1.0, 1.4, 1.8])


def test_a_dwell_that_ends_with_the_run_fires():
    """Up to the rounding of its times, as every clock: ten stays of 0.1 make 1.0."""
    system = counted(loop(After(0.1), a=1.0), state=("a",))
    for k in range(1, 60):
        assert hybrid.simulate(system, (0.0,), (0.0, k / 10)).x[-1, 0] == k


def test_a_marker_does_not_enter_a_mode():
    system = counted(loop(After(0.4), a=1.0), Transition("m", "m", At([0.3]), name="mark"))
    arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 0.5))
    assert list(arc.jumps.transition) == ["mark", "tick"]
    assert arc.jumps.t == pytest.approx([0.3, 0.4])


@pytest.mark.parametrize("backwards", [False, True])
def test_copies_of_a_clock_have_one_tick(backwards):
    """A mode that has been split is left to the part in which the state lies, whichever copy comes first."""
    system = hybrid.split(
        HybridSystem(
            state=("v", "spikes"),
            modes=[
                Mode("rise", lambda t, x, p: (1.5 - x.v + 0.5 * np.maximum(x.v - 0.5, 0.0), 0.0)),
                Mode("rest", lambda t, x, p: (0.0, 0.0)),
            ],
            transitions=[
                Transition(
                    "rise", "rest", Guard(lambda t, x, p: x.v - 1, 1), Reset(loop_reset), name="spike"
                ),
                Transition("rest", "rise", After(0.7), name="again"),
            ],
            start="rise",
        )
    )
    order = system.transitions[::-1] if backwards else system.transitions
    arc = hybrid.simulate(attrs.evolve(system, transitions=order), (0.0, 0.0), (0.0, 20.0))
    assert {jump.target for jump in arc.jumps["again"]} == {"rise: v<0.5", "rise: v>0.5"}
    assert arc["spikes"][-1] == len(arc.jumps["spike"]) > 20


def loop_reset(t, x, p):
    """Low and high by turns."""
    return {"v": 0.8 * (x.spikes % 2), "spikes": x.spikes + 1}


def test_multipliers_of_a_switched_coil():
    system = HybridSystem(
        state=("i",),
        parameters=pwm().parameters,
        modes=pwm().modes,
        transitions=pwm().transitions,
        start="on",
        period=lambda p: p.T,
    )
    orbit = hybrid.periodic_orbit(system, (1.0,), mode="on")
    assert orbit.status.ok
    assert orbit.multipliers[0] == pytest.approx(E(-0.05), rel=1e-12)


def test_a_clock_beside_a_table():
    """Steps end at knots and at ticks, also where both are at one time."""
    rate = hybrid.Table([0.0, 1.0, 2.5, 4.0], [0.0, 2.0, 1.0, 3.0], kind="step")
    system = HybridSystem(
        state=("q", "n"),
        modes=[Mode("m", lambda t, x, p: (rate(t), 0.0))],
        transitions=[Transition("m", "m", Every(0.5), Reset(lambda t, x, p: {"n": x.n + x.q}))],
    )
    arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 4.0), tangent=True)
    amounts = [2.0 * (min(t, 2.5) - 1.0) * (t > 1.0) + max(t - 2.5, 0.0) for t in 0.5 * np.arange(1, 9)]
    np.testing.assert_allclose(arc.jumps.t, 0.5 * np.arange(1, 9), rtol=1e-15)
    np.testing.assert_allclose(arc.x[-1], [4.5, sum(amounts)], rtol=1e-12)
    np.testing.assert_allclose(arc.fundamental, [[1.0, 0.0], [8.0, 1.0]], rtol=1e-12)


def test_the_properties_hold():
    system = pwm()
    case = Case(system, system.parameters, "on", (0.2,), 0.05, 0.9)
    for check in (check_jumps, check_saltation):
        check(case)


def test_clocks_are_told_and_pickled():
    text = repr(pwm())
    assert "every T" in text
    assert "clock, its ticks are known" in repr(hybrid.compile_system(pwm()))
    assert "after r" in repr(neuron())
    assert pickle.loads(pickle.dumps(Every("T", offset=0.5))) == Every("T", offset=0.5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Every(0.0), "Every: period must be positive and finite; got 0"),
        (
            lambda: Every(None),
            "Every: period must be a finite number, the name of a parameter, or a function",
        ),
        (lambda: At([]), "At: times must hold at least one time"),
        (lambda: At([math.nan]), r"At: times\[0\] must be a finite number"),
        (lambda: After(-1.0), "After: duration must be positive and finite; got -1"),
        (lambda: After(1.0, when=3), "After: when must be a function"),
    ],
)
def test_bad_numbers_are_refused(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_an_unknown_parameter_is_refused_with_the_known_ones():
    with pytest.raises(ModelError, match=r"clock.*'tau'.*Parameters: T"):
        HybridSystem(
            state=("a",),
            parameters={"T": 1.0},
            modes=[Mode("m", lambda t, x, p: (0.0,))],
            transitions=[loop(Every("tau"), a=1.0)],
        )


@pytest.mark.parametrize(
    ("clock", "period", "message"),
    [
        (Every(0.3), 1.0, "ticks every 0.3, not at the same phases again after 1"),
        (At([0.5]), 1.0, "ticks at 0.5, not at the same phases again after 1"),
        (Every(1.0), None, "the clock of transition 'tick' makes it depend on time"),
    ],
)
def test_orbits_that_clocks_do_not_repeat_are_refused(clock, period, message):
    system = HybridSystem(
        state=("x",),
        modes=[Mode("m", lambda t, x, p: (1.0 - x.x,))],
        transitions=[Transition("m", "m", clock, Reset(lambda t, x, p: {"x": 0.5 * x.x}), name="tick")],
        period=period,
    )
    with pytest.raises(ArgumentError, match=message):
        hybrid.periodic_orbit(system, (0.4,), period=None if period else 1.0)
    if isinstance(clock, Every) and period:
        # Ten ticks of 0.3 are three periods of 1.
        assert hybrid.periodic_orbit(system, (0.4,), periods=3).status.ok
    if isinstance(clock, At):
        assert hybrid.periodic_orbit(system, (0.4,), t0=0.5).multipliers == pytest.approx([math.exp(-1.0)])


def test_a_period_of_zero_is_refused_at_the_run():
    with pytest.raises(ArgumentError, match="Transition 'off': Every: period must be positive"):
        hybrid.simulate(pwm(), (0.0,), (0.0, 1.0), parameters={"T": 0.0})


@pytest.mark.parametrize("solver", [hybrid.DOP853(), hybrid.Tsit5(), hybrid.Taylor()])
@pytest.mark.parametrize("tangent", [None, np.eye(1)])
@pytest.mark.parametrize("begin", [0.35, 0.62, 300.71])
def test_no_tick_is_lost_to_a_crossing_at_the_same_instant(begin, tangent, solver):
    """Two modes take turns: the first edge, a tick or a crossing, leads on, and the other one leads back."""
    edge, back = Guard(lambda t, x, p: x.phase - 1.0, +1), Reset(lambda t, x, p: {"phase": x.phase - 1.0})
    fields = {"both": 1.0, "ticked": 1.3, "crossed": 0.7}
    system = HybridSystem(
        state=("phase",),
        modes=[
            Mode(name, lambda t, x, p, rate=rate: (rate + 0.0 * x.phase,)) for name, rate in fields.items()
        ],
        transitions=[
            Transition("both", "ticked", Every(1.0), name="tick"),
            Transition("both", "crossed", edge, back, name="cross"),
            Transition("ticked", "both", edge, back, name="late cross"),
            Transition("crossed", "both", Every(1.0), name="late tick"),
        ],
        start="both",
        period=1.0,
    )
    for ulps in range(-8, 9):
        phase = begin % 1.0 + ulps * np.spacing(0.5)
        arc = hybrid.simulate(system, (phase,), (begin, begin + 6.0), solver=solver, tangent=tangent)
        names = list(arc.jumps.transition)
        ticks = sum(name.endswith("tick") for name in names)
        assert (ticks, len(names) - ticks) == (6, 6)
