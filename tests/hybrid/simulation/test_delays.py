"""Delays: what happens a while after each jump, as often as there were jumps, and what is under way."""

import pickle

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import (
    After,
    ArgumentError,
    Delay,
    Every,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    Transition,
)
from hybrid.system.places import Places
from hybrid.testing import Case, PropertyError, check_dimensions, check_system, check_ticks
from lyapunov import lyapunov_spectrum

SPIKE = Transition(
    "run", "run", Guard(lambda t, x, p: x.y - 1.0, +1), Reset(lambda t, x, p: {"y": 0.0}), name="spike"
)
ADD = Reset(lambda t, x, p: {"z": x.z + 1.0})


def relay(*, delay="delay", **options):
    """A spike each unit of time from 0.5 on, which reaches ``z`` a delay later."""
    return HybridSystem(
        state=("y", "z"),
        parameters={"delay": 1.5},
        modes=[Mode("run", lambda t, x, p: (1.0, -0.5 * x.z))],
        transitions=[SPIKE, Transition("run", "run", Delay("spike", delay, **options), ADD, name="arrive")],
    )


def times_of(arc, *names):
    return [jump.t for jump in arc.jumps if jump.transition in names]


def quotient(end, h=1e-6):
    """Difference quotient of a function at zero."""
    return (end(h) - end(-h)) / (2.0 * h)


@pytest.mark.parametrize("solver", [None, hybrid.DOP853()])
@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 1.5, 2.0, 7.5])
def test_each_spike_arrives_a_delay_later(delay, solver):
    arc = hybrid.simulate(relay(), (0.5, 0.0), (0.0, 12.2), parameters={"delay": delay}, solver=solver)
    exact = np.arange(0.5, 12.2 - delay, 1.0) + delay
    assert arc.status.ok
    np.testing.assert_allclose(times_of(arc, "arrive"), exact, rtol=1e-10)
    assert arc["z"][-1] == pytest.approx(np.exp(-0.5 * (12.2 - exact)).sum(), rel=1e-7)


@pytest.mark.parametrize("delay", [0.3, 1.5, 2.2])
def test_derivatives_are_those_of_the_closed_form(delay):
    given = {"delay": delay}
    arc = hybrid.simulate(relay(), (0.5, 0.0), (0.0, 6.1), parameters=given, sensitivities=("delay",))
    exact = np.arange(0.5, 6.1 - delay, 1.0) + delay
    left = np.exp(-0.5 * (6.1 - exact))
    assert arc.sensitivity[1, 0] == pytest.approx(0.5 * left.sum(), rel=1e-9)
    arrivals = [i for i, jump in enumerate(arc.jumps) if jump.transition == "arrive"]
    np.testing.assert_allclose(arc.jumps.t_sensitivity[arrivals, 0], 1.0, rtol=1e-9)
    # An earlier first spike moves all arrivals.
    assert arc.jumps.t_gradient[arrivals, 0] == pytest.approx(np.full(len(arrivals), -1.0))
    tangents = hybrid.simulate(relay(), (0.5, 0.0), (0.0, 6.1), parameters=given, tangent=True)
    assert tangents.fundamental[1, 0] == pytest.approx(-0.5 * left.sum(), rel=1e-9)


def test_times_of_ticks_that_come_with_a_spike():
    """With the delay 2 each arrival comes at the instant of a spike, which does not set it off."""
    arc = hybrid.simulate(
        relay(), (0.5, 0.0), (0.0, 5.7), parameters={"delay": 2.0}, sensitivities=("delay",)
    )
    for jump, slope in zip(arc.jumps, arc.jumps.t_sensitivity[:, 0], strict=True):
        assert slope == pytest.approx(float(jump.transition == "arrive"), abs=1e-9)


def test_nothing_is_seen_of_what_is_under_way_but_behind():
    system = relay(places=2)
    assert system.under_way == (
        "delay_clock", "delay_due0", "delay_due1", "delay_count", "delay_busy",
    )  # fmt: skip
    assert system.own_names == ("y", "z")
    assert "delay_" not in repr(system)
    assert "delay after 'spike'" in repr(system)
    seen = []

    def force(t, x, p):
        seen.append(x._fields)
        return x[1]

    shown = attrs.evolve(system, outputs={"force": force})
    hybrid.simulate(shown, (0.5, 0.0), (0.0, 1.0))["force"]
    [ax, other] = hybrid.plot.plot_arc(hybrid.simulate(system, (0.5, 0.0), (0.0, 3.0)))
    assert (ax.get_ylabel(), other.get_ylabel()) == ("y", "z")
    full = hybrid.simulate(system, {"y": 0.5, "z": 0.0}, (0.0, 3.2))
    assert full.x.shape[1] == 7
    values = dict(zip(system.state_names, full.x[-1], strict=True))
    # Spikes at 1.5 and 2.5; the list has changed last at 3.0, where the first one arrived.
    assert values["delay_count"] == 1.0
    assert values["delay_busy"] == 1.0
    assert values["delay_due0"] - values["delay_clock"] == pytest.approx(4.0 - 3.2, rel=1e-12)


@pytest.mark.as_given
@pytest.mark.parametrize("period", [None, 0.7])
def test_a_run_goes_on_with_what_is_under_way(period):
    system = attrs.evolve(relay(), period=period)
    whole = hybrid.simulate(system, (0.5, 0.0), (0.0, 9.3))
    first = hybrid.simulate(system, (0.5, 0.0), (0.0, 3.7))
    for end in (first.end, pickle.loads(pickle.dumps(first.end)), hybrid.open_end(first.end.to_xarray())):
        second = hybrid.simulate(system, end, (3.7, 9.3))
        both = [*times_of(first, "arrive"), *times_of(second, "arrive")]
        assert both == pytest.approx(times_of(whole, "arrive"), rel=1e-12)
        np.testing.assert_allclose(second.x[-1], whole.x[-1], atol=1e-12)
    again = hybrid.simulate(system, first.x[-1], (3.7, 9.3))
    np.testing.assert_allclose(again.x[-1], whole.x[-1], atol=1e-12)


def test_one_too_many_ends_the_run_with_what_it_has():
    for result in (
        hybrid.simulate(relay(), (0.5, 0.0), (0.0, 20.0), parameters={"delay": 9.5}),
        hybrid.simulate(relay(), (0.5, 0.0), (0.0, 20.0), parameters={"delay": 9.5}, tangent=True),
    ):
        assert result.status.code.name == "DELAY_FULL"
        assert "'arrive', delay after 'spike', has 8 places" in result.status.message
        assert "places=" in result.status.remedy
        assert result.t[-1] == pytest.approx(8.5)
        assert len(result.jumps) == 9
    many = hybrid.simulate_many(relay(), [(0.5, 0.0), (0.2, 0.0)], (0.0, 20.0), parameters={"delay": 9.5})
    assert all("has 8 places" in message for message in many.message.values)
    enough = hybrid.simulate(relay(places=10), (0.5, 0.0), (0.0, 20.0), parameters={"delay": 9.5})
    assert enough.status.ok
    found = hybrid.attractors(
        relay(), {"y": (0.0, 0.9), "z": 0.0}, parameters={"delay": 9.5}, interval=1.0, starts=5
    )
    assert found.status.code.name == "DELAY_FULL"
    assert "Of 5 of 5 starts" in found.status.message


def machine(*transitions, **options):
    """Two modes that take turns, and a message each unit of time in either."""
    send = Reset(lambda t, x, p: {"z": x.z + 0.5})
    return HybridSystem(
        state=("y", "z"),
        counters=("n", "m"),
        parameters={"T": 0.7, "P": 1.0},
        modes=[
            Mode("up", lambda t, x, p: (1.0, -x.z)),
            Mode("down", lambda t, x, p: (0.5, -0.2 * x.z)),
        ],
        transitions=[
            Transition("up", "up", Every("P"), send, name="send"),
            Transition("down", "down", Every("P"), send, name="send on"),
            Transition("up", "down", After(2.25, restarts=False), name="stop"),
            Transition("down", "up", After(1.5, restarts=False), name="go"),
            *transitions,
        ],
        start="up",
        **options,
    )


SENDS = ("send", "send on")
COUNT = Reset(lambda t, x, p: {"n": x.n + 1, "z": 0.9 * x.z})
OTHER = Reset(lambda t, x, p: {"m": x.m + 1, "z": 0.8 * x.z})
GOT = Transition("up", "up", Delay(SENDS, "T"), COUNT, name="got")
GOT_DOWN = Transition("down", "down", Delay(SENDS, "T"), OTHER, name="got down")


def is_up(t):
    """Whether the machine is up: for 2.25 of each 3.75 units of time."""
    return t % 3.75 < 2.25


@pytest.mark.parametrize("delay", [0.2, 0.7, 1.3, 2.6])
def test_a_tick_in_another_mode_is_missed(delay):
    arc = hybrid.simulate(machine(GOT), (0.0, 0.0), (0.0, 20.1), parameters={"T": delay})
    due = np.arange(1.0, 20.1 - delay) + delay
    np.testing.assert_allclose(times_of(arc, "got"), [t for t in due if is_up(t)], rtol=1e-12)


@pytest.mark.parametrize("delay", [0.2, 0.7, 1.3, 2.6])
def test_transitions_of_two_modes_share_what_is_under_way(delay):
    system = machine(GOT, GOT_DOWN)
    assert len(system.under_way) == 11
    arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 20.1), parameters={"T": delay})
    due = np.arange(1.0, 20.1 - delay) + delay
    np.testing.assert_allclose(times_of(arc, "got"), [t for t in due if is_up(t)], rtol=1e-12)
    np.testing.assert_allclose(times_of(arc, "got down"), [t for t in due if not is_up(t)], rtol=1e-12)


@pytest.mark.parametrize("system", [machine(GOT), machine(GOT, GOT_DOWN)], ids=["missed", "shared"])
def test_derivatives_with_two_modes_and_other_clocks(system):
    names = ("T", "P")
    x0 = (0.1, 0.3)

    def end(**given):
        return hybrid.simulate(system, x0, (0.0, 11.9), parameters={**usual, **given}).x[-1][:2]

    # With a period of 1 a message comes at the instant of a stop.
    usual = {"T": 0.7, "P": 1.01}
    arc = hybrid.simulate(system, x0, (0.0, 11.9), parameters=usual, sensitivities=names)
    for k, name in enumerate(names):
        value = usual[name]
        slope = quotient(lambda h, name=name, value=value: end(**{name: value + h}))
        np.testing.assert_allclose(arc.sensitivity[:2, k], slope, atol=1e-7)


def test_conditions_choose_between_two_transitions():
    first = Transition("up", "up", Delay(SENDS, "T", when=lambda t, x, p: x.n < 1.5), COUNT, name="first")
    later = Transition("up", "up", Delay(SENDS, "T", when=lambda t, x, p: x.z > 1e3), OTHER, name="later")
    arc = hybrid.simulate(machine(first, later), (0.0, 0.0), (0.0, 12.1))
    assert times_of(arc, "first") == pytest.approx([1.7, 4.7])
    assert times_of(arc, "later") == []
    assert arc.status.ok


def test_ticks_at_one_instant_each_fire():
    """Two triggers at one instant, and one transition that either of them sets off."""
    twice = HybridSystem(
        state=("y",),
        counters=("n",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[
            Transition("run", "run", Every(1.0), Reset(lambda t, x, p: {"y": 0.0}), name="one"),
            Transition("run", "run", Every(1.0), Reset(lambda t, x, p: {"y": 0.1}), name="other"),
            Transition(
                "run",
                "run",
                Delay(("one", "other"), 0.25),
                Reset(lambda t, x, p: {"n": x.n + 1}),
                name="echo",
            ),
        ],
    )
    for solver in (None, hybrid.DOP853()):
        arc = hybrid.simulate(twice, (0.0,), (0.0, 3.5), solver=solver)
        assert times_of(arc, "echo") == pytest.approx([1.25, 1.25, 2.25, 2.25, 3.25, 3.25])
        assert arc["n"][-1] == 6.0


def test_a_transition_may_follow_itself_and_a_marker():
    echo = HybridSystem(
        state=("y",),
        counters=("n",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.y - 0.3, +1), name="pass"),
            Transition(
                "run", "run", Delay(("pass", "echo"), 0.5), Reset(lambda t, x, p: {"n": x.n + 1}), name="echo"
            ),
            Transition("run", None, After(2.4, restarts=False), name="end"),
        ],
    )
    arc = hybrid.simulate(echo, (0.0,), (0.0, 5.0))
    assert times_of(arc, "pass") == pytest.approx([0.3])
    assert times_of(arc, "echo") == pytest.approx([0.8, 1.3, 1.8, 2.3])
    assert arc.status.code.name == "TERMINAL"


def test_a_marker_that_is_followed_enters_its_mode_no_more_than_before():
    def watched(*more):
        return HybridSystem(
            state=("y",),
            modes=[Mode("run", lambda t, x, p: (1.0,))],
            transitions=[
                Transition("run", "run", Guard(lambda t, x, p: x.y - 0.3, +1), name="pass"),
                Transition("run", None, After(1.0), name="timeout"),
                *more,
            ],
        )

    late = Transition("run", None, Delay("pass", 5.0), name="late")
    for system in (watched(), watched(late)):
        assert hybrid.simulate(system, (0.0,), (0.0, 3.0)).t[-1] == pytest.approx(1.0)


def test_a_held_duration_counts_as_the_trigger_leaves_it():
    held = HybridSystem(
        state=("y",),
        held=("d",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.y - 1.0, +1),
                Reset(lambda t, x, p: {"y": 0.0, "d": 2.6 - t}),
                name="spike",
            ),
            Transition("run", "run", Delay("spike", "d"), Reset(lambda t, x, p: {"y": x.y}), name="echo"),
        ],
    )
    arc = hybrid.simulate(held, {"y": 0.0}, (0.0, 4.5))
    # Both first spikes arrive at 2.6. What is negative is over at once.
    assert times_of(arc, "echo") == pytest.approx([2.6, 2.6, 3.0, 4.0])


def forced(**given):
    return HybridSystem(
        state=("v",),
        parameters={"I": 1.5, "eps": -0.2, "tau": 1.6, "A": 0.2, "T": 1.27} | given,
        period=lambda p: p.T,
        modes=[Mode("run", lambda t, x, p: (p.I + p.A * np.cos(2 * np.pi * t / p.T) - x.v,))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.v - 1.0, +1),
                Reset(lambda t, x, p: {"v": 0.0}),
                name="spike",
            ),
            Transition(
                "run",
                "run",
                Delay("spike", "tau", places=3),
                Reset(lambda t, x, p: {"v": x.v + p.eps}),
                name="arrive",
            ),
        ],
    )


def test_orbits_with_a_period_have_the_multipliers_of_their_return_map():
    system = forced()
    start = hybrid.simulate(system, (0.3,), (0.0, 100 * 1.27)).x[-1]
    orbit = hybrid.periodic_orbit(system, start)
    assert orbit.status.ok
    x0, columns = orbit.x0, []
    for i in range(system.tangent_dimension):
        step = np.eye(system.dimension)[i]
        columns.append(
            quotient(lambda h, step=step: hybrid.simulate(system, x0 + h * step, (0.0, 1.27)).x[-1][:5])
        )
    np.testing.assert_allclose(orbit.fundamental, np.array(columns).T, atol=1e-7)
    spectrum = lyapunov_spectrum(system, x0, intervals=60, transient=5, k=2)
    largest = np.sort(np.abs(orbit.multipliers))[::-1][:2]
    np.testing.assert_allclose(spectrum.exponents, np.log(largest) / 1.27, rtol=1e-6)
    branch = hybrid.continue_orbit(orbit, "tau", (1.55, 1.65))
    assert branch.status.ok
    assert len(branch) > 3
    found = hybrid.attractors(system, {"v": (0.0, 0.9)}, starts=10)
    np.testing.assert_allclose(found[1].points[0][:1], x0[:1], atol=1e-6)
    labels = hybrid.basins(system, {"v": np.linspace(0.0, 0.9, 4)}).label.values
    assert labels.tolist() == [1, 1, 1, 1]
    again = hybrid.simulate(system, found[1].points[0], (0.0, 1.27))
    np.testing.assert_allclose(again.x[-1], found[1].points[0], atol=1e-6)


def test_a_split_system_keeps_its_delays():
    friction = HybridSystem(
        state=("q", "v", "y"),
        parameters={"mu": 0.3},
        modes=[Mode("m", lambda t, x, p: (x.v, -x.q - p.mu * np.sign(x.v), 1.0))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.y - 1.0, +1), Reset(lambda t, x, p: {"y": 0.0}), name="beat"
            ),
            Transition("m", "m", Delay("beat", 1.7), Reset(lambda t, x, p: {"v": x.v + 0.9}), name="push"),
        ],
    )
    arc = hybrid.simulate(hybrid.split(friction), (1.0, 0.0, 0.0), (0.0, 9.0))
    assert arc.status.ok
    assert [jump.t for jump in arc.jumps["push"]] == pytest.approx(np.arange(2.7, 9.0))


def test_checks_of_a_system_know_delays():
    assert check_system(relay(), states={"y": (0.0, 0.9), "z": (-1.0, 1.0)}, examples=10)
    inner = machine(GOT, GOT_DOWN)
    start = np.r_[0.0, 0.0, np.zeros(inner.dimension - 2)]
    check_ticks(Case(inner, {**inner.parameters, "T": 1.3}, "up", start, 0.0, 12.0))
    units = {"y": "m", "z": "m", "t": "ms", "delay": "ms"}
    moved = attrs.evolve(SPIKE, guard=Guard(lambda t, x, p: x.y - p.top, +1))
    with_units = HybridSystem(
        state=("y", "z"),
        parameters={"delay": 1.5, "speed": 1.0, "rate": 0.5, "top": 1.0, "one": 1.0},
        units={**units, "speed": "m/ms", "rate": "1/ms", "top": "m", "one": "m"},
        modes=[Mode("run", lambda t, x, p: (p.speed, -p.rate * x.z))],
        transitions=[
            moved,
            Transition(
                "run", "run", Delay("spike", "delay"), Reset(lambda t, x, p: {"z": x.z + p.one}), name="a"
            ),
        ],
    )
    check_dimensions(with_units)


def test_a_lost_tick_is_noticed(monkeypatch):
    lose = Places.after

    def losing(self, x, wait, fires, begins):
        return lose(self, x, 1.001 * wait, fires, begins)

    monkeypatch.setattr(Places, "after", losing)
    system = relay()
    case = Case(system, system.parameters, "run", np.r_[0.5, np.zeros(system.dimension - 1)], 0.0, 5.0)
    with pytest.raises(PropertyError, match="no jump was that long before"):
        check_ticks(case)


BROKEN = Transition("up", None, After(9.0, restarts=False), name="off")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Delay("a", -1.0), "duration must be finite and not negative; got -1"),
        (lambda: Delay("a", np.inf), "Delay: duration must be a finite number"),
        (lambda: Delay("", 1.0), "trigger must name at least one transition"),
        (lambda: Delay([], 1.0), "trigger must name at least one transition"),
        (lambda: Delay(3, 1.0), "Delay: trigger must be the name of a transition"),
        (lambda: Delay("a", 1.0, places=0), "Delay: places must be a whole number of at least 1; got 0"),
        (lambda: Delay("a", 1.0, places=101), "Delay: places must be at most 100"),
        (lambda: Delay("a", 1.0, when=3), "Delay: when must be a function"),
        (lambda: relay(delay="z"), "Delay reads 'z', which has a field"),
        (lambda: relay(delay="nothing"), "Parameter 'nothing' does not exist"),
        (lambda: machine(attrs.evolve(GOT, guard=Delay("sent", 1.0))), "'sent' does not exist"),
        (lambda: machine(BROKEN, attrs.evolve(GOT, guard=Delay("off", 1.0))), "'off' has no target"),
        (lambda: attrs.evolve(relay(), transitions=[SPIKE, relay().transitions[1]]), "Make the system anew"),
        (
            lambda: attrs.evolve(
                relay(), transitions=[attrs.evolve(SPIKE, guard=Delay("b", 1.0)), relay().transitions[1]]
            ),
            "does not exist|Make the system anew",
        ),
    ],
)
def test_wrong_delays_are_refused(make, words):
    with pytest.raises(ModelError, match=words):
        make()


def test_a_state_without_names_is_refused():
    echo = Transition("run", "run", Delay("echo", 1.0), name="echo")
    with pytest.raises(ModelError, match="Name them with state="):
        HybridSystem(state=1, modes=[Mode("run", lambda t, x, p: (1.0,))], transitions=[echo])


def test_wrong_starts_are_refused():
    with pytest.raises(ArgumentError, match="Delay: duration must be finite and not negative; got -1"):
        hybrid.simulate(relay(), (0.5, 0.0), (0.0, 1.0), parameters={"delay": -1.0})
    for name, value in (("delay_count", -1.0), ("delay_busy", 1.0)):
        with pytest.raises(ArgumentError, match=f"what transition 'arrive' has under way: '{name}'"):
            hybrid.simulate(relay(), {"y": 0.0, "z": 0.0, name: value}, (0.0, 1.0))
    past = {"y": 0.0, "z": 0.0, "delay_count": 1.0, "delay_busy": 1.0, "delay_clock": 1.0}
    with pytest.raises(ArgumentError, match="a tick was 1 ago"):
        hybrid.simulate(relay(), past, (0.0, 1.0))


def test_a_guess_whose_run_fills_the_places_is_no_orbit():
    """The run from the guess fills the places before as many arrive as leave."""
    found = hybrid.periodic_orbit(relay(places=4), (0.5, 0.0), period=1.0, parameters={"delay": 9.5})
    assert not found.closes


def test_a_jump_in_a_counter_does_not_lock_a_jump_beside_it():
    """Two guards are reached at one instant up to rounding; each reset jumps where a counter passes 1/2."""

    def flag(count):
        return np.where(count > 0.5, 1.0, 0.0)

    pair = HybridSystem(
        state=("v", "w"),
        held=("a", "b"),
        counters=("n",),
        modes=[Mode("run", lambda t, x, p: (1.5 - x.v, 1.5 - x.w))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.v - 1.0, +1),
                Reset(lambda t, x, p: {"v": 0.0, "a": flag(x.n)}),
                name="first",
            ),
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.w - 1.0, +1),
                Reset(lambda t, x, p: {"w": 0.0, "b": flag(x.n)}),
                name="second",
            ),
        ],
    )
    for apart in np.arange(20, 60, 2) * 2.2e-16:
        arc = hybrid.simulate(pair, {"v": 0.3409, "w": 0.3409 + apart}, (0.0, 1.1), tangent=True)
        assert np.linalg.svd(arc.fundamental[:2, :2], compute_uv=False)[1] > 0.9
