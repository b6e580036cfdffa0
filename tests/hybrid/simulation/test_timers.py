"""Clocks that count from the entry from another mode, and clocks whose numbers resets change."""

import numpy as np
import pytest

import hybrid
from hybrid import After, At, Every, Guard, HybridSystem, Mode, ModelError, Reset, StatusCode, Transition
from hybrid.testing import Case, check_jumps, check_saltation, check_system, check_ticks
from hybrid.testing.ticks import TICKS


def heater(**options):
    """A sampled controller in a mode that ends after a time, and that is entered again when it is cold."""
    return HybridSystem(
        state=("y",),
        held=("u",),
        parameters={"k": 1.0, "T": 0.1, "limit": 1.03},
        modes=[Mode("heat", lambda t, x, p: (x.u - x.y,)), Mode("off", lambda t, x, p: (-x.y,))],
        transitions=[
            Transition(
                "heat", "heat", Every("T"), Reset(lambda t, x, p: {"u": p.k * (2 - x.y)}), name="sample"
            ),
            Transition("heat", "off", After("limit", **options), name="timeout"),
            Transition("off", "heat", Guard(lambda t, x, p: x.y - 0.1, -1), name="again"),
        ],
        start="heat",
    )


def times_of(arc, name):
    return [jump.t for jump in arc.jumps[name]]


def quotient(end, h):
    """Difference quotient of a function at zero."""
    return (end(h) - end(-h)) / (2.0 * h)


@pytest.mark.parametrize("tangent", [None, np.eye(2)])
@pytest.mark.parametrize("period", [None, 0.4])
def test_a_timeout_counts_from_the_entry_from_another_mode(tangent, period):
    system = heater(restarts=False)
    arc = hybrid.simulate(system, {"y": 0.0}, (0.0, 6.0), tangent=tangent)
    first, again, second = times_of(arc, "timeout")[0], times_of(arc, "again")[0], times_of(arc, "timeout")[1]
    assert first == pytest.approx(1.03, rel=1e-14)
    assert second == pytest.approx(again + 1.03, rel=1e-14)
    assert arc.status.message == "Reached the end."


def test_a_run_says_that_a_clock_was_restarted_and_never_fired():
    arc = hybrid.simulate(heater(), {"y": 0.0}, (0.0, 6.0))
    assert arc.status.ok
    for words in ("'timeout' never fired: 60 jumps of 'sample' from mode 'heat' to itself", "restarts=False"):
        assert words in arc.status.message
    told = hybrid.simulate_many(heater(), {"y": [0.0, 0.5]}, (0.0, 6.0))["message"].to_numpy()
    assert all("'timeout' never fired" in message for message in told)
    # A sample takes longer than the time-out: the clock fires, and there is nothing to say.
    slow = hybrid.simulate(heater(), {"y": 0.0}, (0.0, 6.0), parameters={"T": 2.0})
    assert times_of(slow, "timeout")[0] == pytest.approx(1.03, rel=1e-14)
    assert "never fired" not in slow.status.message


def test_derivatives_of_a_timeout_that_is_not_restarted():
    system, names = heater(restarts=False), ("limit", "k")
    arc = hybrid.simulate(system, {"y": 0.0}, (0.0, 6.0), sensitivities=names)

    def end(name):
        given = system.parameters[name]
        return lambda h: hybrid.simulate(system, {"y": 0.0}, (0.0, 6.0), parameters={name: given + h}).x[-1]

    slopes = np.column_stack([quotient(end(name), 1e-6) for name in names])
    np.testing.assert_allclose(arc.sensitivity, slopes, rtol=1e-6, atol=1e-8)
    arc = hybrid.simulate(system, {"y": 0.0}, (0.0, 6.0), tangent=True)
    slope = quotient(lambda h: hybrid.simulate(system, {"y": h}, (0.0, 6.0)).x[-1], 1e-6)
    np.testing.assert_allclose(arc.fundamental[:, 0], slope, rtol=1e-6, atol=1e-8)


def test_on_a_transition_to_itself_it_fires_once_a_stay():
    add = Reset(lambda t, x, p: {"n": x.n + 1.0})
    system = HybridSystem(
        state=("n",),
        modes=[Mode("a", lambda t, x, p: (0.0,)), Mode("b", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("a", "a", After(0.3, restarts=False), add, name="once"),
            Transition("a", "a", After(0.4), add, name="each"),
            Transition("a", "b", At([2.0]), name="away"),
            Transition("b", "a", After(0.5), name="back"),
        ],
        start="a",
    )
    arc = hybrid.simulate(system, (0.0,), (0.0, 4.0))
    np.testing.assert_allclose(times_of(arc, "once"), [0.3, 2.8], rtol=1e-14)
    np.testing.assert_allclose(times_of(arc, "each"), [0.7, 1.1, 1.5, 1.9, 3.2, 3.6, 4.0], rtol=1e-14)
    check_ticks(Case(system, system.parameters, "a", (0.0,), 0.0, 4.0))
    with pytest.raises(ModelError, match="tangent vectors would need two times of entry"):
        hybrid.simulate(system, (0.0,), (0.0, 1.0), tangent=True)


OFF = {
    "duration": After("on"),
    "duty": After(lambda p: p.d * p.T),
    "offset": Every("T", offset=lambda p: p.d * p.T),
}


def switched(off):
    """A coil whose duty is sampled: a proportional controller that saturates."""

    def sampled(t, x, p):
        duty = np.clip(0.4 + p.k * (p.ref - x.i), 0.0, 1.0)
        return {"d": duty, "on": duty * p.T}

    return HybridSystem(
        state=("i",),
        held=("d", "on"),
        parameters={"I": 12.0, "a": 2.0, "T": 0.1, "ref": 5.0, "k": 0.1},
        modes=[Mode("on", lambda t, x, p: (p.a * (p.I - x.i),)), Mode("off", lambda t, x, p: (-p.a * x.i,))],
        transitions=[
            Transition("off", "on", Every("T"), Reset(sampled), name="sample"),
            Transition("on", "off", OFF[off], name="off"),
        ],
        start="off",
        period=lambda p: p.T,
    )


def after_a_period(i, duty, full=12.0, a=2.0, T=0.1):
    """The current a period after a sample."""
    return (full + (i - full) * np.exp(-a * duty * T)) * np.exp(-a * (1.0 - duty) * T)


@pytest.mark.parametrize("off", OFF)
@pytest.mark.parametrize("k", [0.1, 3.0, -1.0])
def test_a_duty_that_is_sampled(off, k):
    """Also where it saturates, at nothing and at the whole period."""
    system = switched(off)
    arc = hybrid.simulate(system, {"i": 0.0}, (0.0, 5.0), parameters={"k": k})
    currents = np.array([jump.x_minus[0] for jump in arc.jumps["sample"]])
    duties = np.clip(0.4 + k * (5.0 - currents), 0.0, 1.0)
    assert len(duties) == 50
    assert currents[0] == 0.0
    np.testing.assert_allclose(currents[1:], after_a_period(currents, duties)[:-1], rtol=1e-12, atol=1e-13)
    # What a gain does: all in between, the first one whole, or none at all.
    assert (duties.max() == 1.0, duties.min() == 0.0) == {0.1: (False, False), 3.0: (True, True)}.get(
        k, (False, True)
    )


@pytest.mark.parametrize("off", OFF)
def test_derivatives_of_a_duty_that_is_sampled(off):
    system = switched(off)
    names = ("k", "T")
    arc = hybrid.simulate(system, {"i": 2.0}, (0.0, 0.55), sensitivities=names)

    def end(name):
        given = system.parameters[name]
        return lambda h: (
            hybrid.simulate(system, {"i": 2.0}, (0.0, 0.55), parameters={name: given * (1 + h)}).x[-1, 0]
            / given
        )

    np.testing.assert_allclose(arc.sensitivity[0], [quotient(end(name), 1e-6) for name in names], rtol=1e-6)
    settled = hybrid.simulate(system, {"i": 4.0}, (0.0, 5.0))
    orbit = hybrid.periodic_orbit(system, settled.x[-1], mode=str(settled.mode[-1]))
    i = orbit.x0[0]
    slope = quotient(lambda h: after_a_period(i + h, 0.4 + 0.1 * (5.0 - i - h)), 1e-6)
    assert max(orbit.multipliers, key=abs) == pytest.approx(slope, rel=1e-7)


def test_each_of_many_starts_has_its_own_duration():
    system = HybridSystem(
        state=("y",),
        held=("d",),
        modes=[Mode("up", lambda t, x, p: (1.0,)), Mode("down", lambda t, x, p: (-1.0,))],
        transitions=[Transition("up", "down", After("d"))],
        start="up",
    )
    starts = np.array([[0.0, d] for d in (0.0, 0.25, 0.5, 2.0)])
    found = hybrid.simulate_many(system, starts, (0.0, 1.0))["x_end"].to_numpy()[:, 0]
    np.testing.assert_allclose(found, [-1.0, -0.5, 0.0, 1.0], atol=1e-14)


def test_a_duration_that_becomes_shorter_than_the_time_that_has_passed_is_over_at_once():
    system = HybridSystem(
        state=("y",),
        held=("d",),
        modes=[Mode("up", lambda t, x, p: (1.0,)), Mode("down", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("up", "up", Guard(lambda t, x, p: x.y - 1.0, +1), Reset(lambda t, x, p: {"d": 0.3})),
            Transition("up", "down", After("d", restarts=False), name="over"),
        ],
        start="up",
    )
    arc = hybrid.simulate(system, (0.2, 10.0), (0.0, 2.0), tangent=True)
    assert times_of(arc, "over") == [pytest.approx(0.8, rel=1e-14)]
    # It happens at the time of the crossing: y = 2 - t - y0 at the end, whatever the duration was.
    assert arc.x[-1, 0] == pytest.approx(-0.2, abs=1e-13)
    np.testing.assert_allclose(arc.fundamental, [[-1.0, 0.0], [0.0, 0.0]], atol=1e-12)
    check_ticks(Case(system, system.parameters, "up", (0.2, 10.0), 0.0, 2.0))


def relay(delay=1.5):
    """Spikes of an oscillator whose effects arrive later, with two places for those that are under way."""

    def spiked(t, x, p):
        first = x.n % 2 < 0.5
        return {
            "y": 0.0,
            "n": x.n + 1,
            "due0": np.where(first, t + p.delay, x.due0),
            "due1": np.where(first, x.due1, t + p.delay),
        }

    return HybridSystem(
        state=("y", "z"),
        held=("due0", "due1"),
        counters=("n",),
        parameters={"rate": 1.0, "delay": delay},
        modes=[Mode("run", lambda t, x, p: (p.rate, -0.5 * x.z))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.y - 1.0, +1), Reset(spiked), name="spike"),
            Transition(
                "run", "run", At(["due0", "due1"]), Reset(lambda t, x, p: {"z": x.z + 1.0}), name="arrive"
            ),
        ],
    )


@pytest.mark.parametrize("delay", [0.3, 1.0, 1.5, 1.9])
def test_due_times_that_a_reset_sets(delay):
    """Each spike arrives, also two at once and one at the instant of a spike."""
    system, end = relay(), 9.75
    given, start = {"delay": delay}, {"y": 0.5, "z": 0.0}
    arc = hybrid.simulate(system, start, (0.0, end), parameters=given)
    arrivals = [t + delay for t in np.arange(0.5, end) if t + delay <= end]
    np.testing.assert_allclose(times_of(arc, "arrive"), arrivals, rtol=1e-13)
    assert arc["z"][-1] == pytest.approx(sum(np.exp(-0.5 * (end - t)) for t in arrivals), rel=1e-12)


def test_derivatives_of_due_times():
    system, start = relay(1.4), {"y": 0.5, "z": 0.0}
    arc = hybrid.simulate(system, start, (0.0, 9.75), sensitivities=("delay", "rate"))

    def end(name):
        given = system.parameters[name]
        return lambda h: hybrid.simulate(system, start, (0.0, 9.75), parameters={name: given + h})["z"][-1]

    found = arc.sensitivity[1]
    np.testing.assert_allclose(found, [quotient(end(name), 1e-6) for name in ("delay", "rate")], rtol=1e-7)


def test_a_due_time_in_the_past_is_missed():
    """A reset at 1 sets it to 0.5, one at 2 to 2.5."""
    system = HybridSystem(
        state=("n",),
        held=("due",),
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("m", "m", At([1.0]), Reset(lambda t, x, p: {"due": 0.5}), name="past"),
            Transition("m", "m", At([2.0]), Reset(lambda t, x, p: {"due": 2.5}), name="ahead"),
            Transition("m", "m", At("due"), Reset(lambda t, x, p: {"n": x.n + 1.0}), name="due"),
        ],
    )
    assert times_of(hybrid.simulate(system, (0.0,), (0.0, 4.0)), "due") == [2.5]


@pytest.mark.parametrize("number", [0.0, -1.0, np.inf])
def test_a_run_ends_where_a_reset_gives_a_clock_no_number(number):
    system = HybridSystem(
        state=("n",),
        held=("T",),
        parameters={"new": number if number <= 0.0 else 0.0},
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("m", "m", Every(lambda p: p.T if number <= 0.0 else 1.0 / p.T), name="tick"),
            Transition("m", "m", At([0.6]), Reset(lambda t, x, p: {"T": p.new}), name="change"),
        ],
    )
    arc = hybrid.simulate(system, (0.0, 1.0), (0.0, 2.0))
    assert arc.status.code == StatusCode.NON_FINITE
    assert arc.t[-1] == 0.6
    assert (
        f"'tick' cannot go on at t = 0.6 in mode 'm': period must be positive and finite; got {number:g}"
        in (arc.status.message)
    )


def test_a_clock_that_reads_what_flows_is_refused():
    for clock in (After("y"), Every(lambda p: 1.0 + p.y)):
        with pytest.raises(ModelError, match=r"'t': (After|Every) reads 'y', which has a field.*held="):
            HybridSystem(
                state=("y",),
                modes=[Mode("m", lambda t, x, p: (1.0,))],
                transitions=[Transition("m", "m", clock, Reset(lambda t, x, p: {"y": 0.0}), name="t")],
            )


@pytest.mark.parametrize("off", OFF)
def test_the_laws_hold_for_a_sampled_duty(off):
    system = switched(off)
    states = {"i": (0.0, 8.0), "d": (0.1, 0.9), "on": 0.05}
    report = check_system(system, states=states, t_span=(0.0, 0.35), examples=10, mode="off")
    [ticks] = (each for each in report.properties if each.name == TICKS)
    assert ticks.examples > 0
    case = Case(system, system.parameters, "off", (3.0, 0.4, 0.04), 0.05, 0.12)
    check_jumps(case)
    check_saltation(case)


@pytest.mark.parametrize("absolute", [False, True])
def test_an_offset_that_changes_in_between(absolute):
    """At 0.3, from 0.2 on to 0.8, also told as a time; at 3.9 back."""
    system = HybridSystem(
        state=("n",),
        held=("o",),
        parameters={"late": 10.8 if absolute else 0.8},
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "m", "m", Every(1.0, offset="o"), Reset(lambda t, x, p: {"n": x.n + 1.0}), name="tick"
            ),
            Transition("m", "m", At([0.3]), Reset(lambda t, x, p: {"o": p.late}), name="later"),
            Transition("m", "m", At([3.9]), Reset(lambda t, x, p: {"o": 0.2}), name="back"),
        ],
    )
    arc = hybrid.simulate(system, (0.0, 0.2), (0.0, 6.0))
    np.testing.assert_allclose(times_of(arc, "tick"), [0.2, 0.8, 1.8, 2.8, 3.8, 4.2, 5.2], rtol=1e-14)
    check_ticks(Case(system, system.parameters, "m", (0.0, 0.2), 0.0, 6.0))


def test_a_period_that_changes():
    """Each tick doubles the period: the ticks are at whole multiples of it."""
    system = HybridSystem(
        state=("n",),
        held=("T",),
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[Transition("m", "m", Every("T"), Reset(lambda t, x, p: {"T": 2.0 * x.T}), name="tick")],
    )
    arc = hybrid.simulate(system, (0.0, 0.25), (0.0, 5.0))
    np.testing.assert_allclose(times_of(arc, "tick"), [0.25, 0.5, 1.0, 2.0, 4.0], rtol=1e-15)


def test_clocks_that_read_held_components_go_through_a_split():
    """A block under dry friction is kicked each second, and rests for a time that the kick decides."""
    system = HybridSystem(
        state=("v",),
        held=("d",),
        parameters={"mu": 0.5},
        modes=[Mode("slide", lambda t, x, p: (-p.mu * np.sign(x.v),)), Mode("rest", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "slide",
                "slide",
                Every(1.0),
                Reset(lambda t, x, p: {"v": x.v - 1.7, "d": 0.1 * t}),
                name="kick",
            ),
            Transition("slide", "rest", After(lambda p: 10.0 * p.mu * p.d, restarts=False), name="pause"),
            Transition("rest", "slide", After("d"), name="on"),
        ],
        start="slide",
    )
    start, span = (1.0, 10.0), (0.0, 6.0)
    whole, parts = (hybrid.simulate(each, start, span) for each in (system, hybrid.split(system)))
    np.testing.assert_allclose(parts.jumps.t, whole.jumps.t, rtol=1e-14)
    # The kick at 1 cuts the first stay short. The next begin at 1.1, 1.7 and 2.9, for 5 times the duration.
    assert times_of(whole, "pause") == pytest.approx([1.0, 1.1 + 0.5, 1.7 + 1.0, 2.9 + 2.0])
    np.testing.assert_allclose(parts.x[-1], whole.x[-1], rtol=1e-13)
    slope = quotient(lambda h: hybrid.simulate(system, (1.0 + h, 10.0), span).x[-1], 1e-6)
    found = hybrid.simulate(hybrid.split(system), start, span, tangent=True).fundamental[:, 0]
    np.testing.assert_allclose(found, slope, atol=1e-8)
