"""Many starts in one call are those of simulate, one by one, up to rounding."""

import re

import numpy as np
import pytest

import hybrid
import models
from hybrid import (
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    StatusCode,
    Transition,
    simulate,
    simulate_many,
    split,
)
from hybrid.sweep import many
from hybrid.sweep.outcome import text_of
from hybrid.transform import splitter
from tests.hybrid import systems

RANDOM = np.random.default_rng(3)
OSCILLATOR = models.impact_oscillator()
STARTS = RANDOM.uniform(-1.0, 0.5, (40, 2))
SPAN = (0.3, 60.0)


def assert_one_by_one(found, system, starts, span, **options):
    for i, x0 in enumerate(starts):
        arc = simulate(system, x0, span, **options)
        np.testing.assert_allclose(found.x_end[i], arc.x[-1], rtol=1e-7, atol=1e-7)
        assert (found.jumps[i], found.mode_end[i]) == (len(arc.jumps), arc.mode[-1])
        assert found.status[i] == arc.status.code
        assert in_words(found.message.values[i]) == in_words(text_of(arc.status))
        assert found.t_end[i] == pytest.approx(arc.t[-1], rel=1e-12)


def in_words(message):
    """A message without its numbers, which rounding may change."""
    return re.sub(r"[-+.e\d]+", "#", message)


@pytest.mark.parametrize("threads", [1, 3])
def test_ends_are_those_of_simulate(threads):
    options = {"parameters": {"r": 0.75}, "solver": hybrid.Taylor(rtol=1e-8)}
    found = simulate_many(OSCILLATOR, STARTS, SPAN, executor=threads, **options)
    assert_one_by_one(found, OSCILLATOR, STARTS, SPAN, **options)


@pytest.mark.parametrize("solver", [hybrid.DOP853(rtol=1e-6), hybrid.RadauIIA(rtol=1e-5)])
def test_runs_know_nothing_of_one_another(solver):
    options = {"solver": solver, "executor": 1}
    found = simulate_many(OSCILLATOR, STARTS[:6], (0.0, 12.0), **options)
    assert_one_by_one(found, OSCILLATOR, STARTS[:6], (0.0, 12.0), solver=solver)
    again = simulate_many(OSCILLATOR, STARTS[5::-1], (0.0, 12.0), **options)
    np.testing.assert_array_equal(again.x_end[::-1], found.x_end)


def test_long_runs_go_on_after_each_burst():
    found = simulate_many(OSCILLATOR, STARTS[:2], (0.0, 3000.0), solver=hybrid.DOP853(), executor=1)
    assert_one_by_one(found, OSCILLATOR, STARTS[:2], (0.0, 3000.0), solver=hybrid.DOP853())


def test_samples_of_runs_that_go_on_after_each_burst():
    times = np.linspace(1.0, 3000.0, 41)
    options = {"samples": times, "solver": hybrid.DOP853(rtol=1e-6)}
    found = simulate_many(OSCILLATOR, STARTS[:2], (0.0, 3000.0), executor=1, **options)
    for i, x0 in enumerate(STARTS[:2]):
        # Of two runs that stop at the same places: the impacts are chaotic.
        for j in (0, 7, 40):
            until = simulate_many(
                OSCILLATOR,
                x0[None],
                (0.0, times[j]),
                executor=1,
                samples=times[: j + 1],
                solver=options["solver"],
            )
            np.testing.assert_array_equal(found.x[i, : j + 1], until.x[0])
        assert found.x[i, -1].values == pytest.approx(found.x_end[i].values, abs=0.0)
    assert len(np.unique(found.x[0, :, 0])) == 41


def test_the_mode_of_a_start_on_a_guard_is_that_of_simulate():
    """Where both modes allow the state the start is refused; one that is left at once does not count."""
    system = systems.pendulum()
    starts = np.array([[0.3, 1.0], [0.3, -1.0], [0.2, 0.5], [0.4, 0.5], [0.3, 0.0]])
    found = simulate_many(system, starts, (0.0, 2.0))
    assert_one_by_one(found, system, starts, (0.0, 2.0))


def test_runs_that_end_early_say_so():
    """A chatter, a limit of jumps, and a start beyond a guard of the only mode."""
    ball = models.bouncing_ball()
    starts = np.array([[1.0, 0.0], [5.0, 0.0], [-1.0, 0.0], [200.0, 0.0]])
    found = simulate_many(ball, starts, (0.0, 9.0), max_jumps=5)
    assert found.status.values[:2].tolist() == [StatusCode.MAX_JUMPS, StatusCode.MAX_JUMPS]
    assert found.status.values[2:].tolist() == [StatusCode.START_BEYOND, StatusCode.SUCCESS]
    assert "lies beyond the guard of 'bounce'" in found.message.values[2]
    assert_one_by_one(found[{"start": [0, 1]}], ball, starts[:2], (0.0, 9.0), max_jumps=5)
    named = simulate_many(ball, starts[2:3], (0.0, 1.0), mode="flight")
    assert "The start lies beyond the guard" in named.message.values[0]
    assert_one_by_one(named, ball, starts[2:3], (0.0, 1.0), mode="flight")


def test_each_thread_tells_of_its_own_starts():
    """Each kind of end, the same starts in other orders, shared among three threads."""
    ball = models.bouncing_ball()
    kinds = np.array([[1.0, 0.0], [-1.0, 0.0], [200.0, 0.0]])
    for turn in range(3):
        starts = np.vstack([np.roll(kinds, turn + i, axis=0) for i in range(4)])
        for options in ({}, {"mode": "flight"}):
            found = simulate_many(ball, starts, (0.0, 9.0), max_jumps=5, executor=3, **options)
            each = [
                simulate_many(ball, x0[None], (0.0, 9.0), max_jumps=5, executor=1, **options) for x0 in starts
            ]
            for name in ("x_end", "t_end", "mode_end", "jumps", "status", "message"):
                np.testing.assert_array_equal(
                    found[name].values, np.concatenate([one[name].values for one in each])
                )
            wanted = {1.0: StatusCode.MAX_JUMPS, -1.0: StatusCode.START_BEYOND, 200.0: StatusCode.SUCCESS}
            if not options:
                assert found.status.values.tolist() == [wanted[q] for q, _ in starts]


def test_samples():
    times = [0.5, 0.5, 2.0]
    found = simulate_many(OSCILLATOR, {"x": [0.1, 0.2], "v": 0.0}, (0.0, 2.0), samples=times)
    assert found.x.dims == ("start", "t", "state")
    for i, x in enumerate((0.1, 0.2)):
        arc = simulate(OSCILLATOR, (x, 0.0), (0.0, 2.0), samples=times)
        np.testing.assert_allclose(found.x[i], arc.x, atol=1e-9)
    np.testing.assert_array_equal(found.x.isel(t=-1), found.x_end)


@pytest.mark.as_given
def test_systems_that_grow(monkeypatch):
    monkeypatch.setattr(splitter, "MOST_WHOLE", 1)
    block = hybrid.from_equations(
        lambda t, x, p: (x.v, -x.q - p.mu * np.sign(x.v) - 0.2 * np.sign(x.q)),
        state=("q", "v"),
        parameters={"mu": 0.3},
    )
    starts = [(1.0, -0.1), (2.0, 0.1)]
    found = simulate_many(block, starts, (0.0, 4.0), executor=2)
    assert not found.status.any()
    times = [0.5, 2.0, 4.0]
    sampled = simulate_many(block, starts, (0.0, 4.0), samples=times)
    for i, x0 in enumerate(starts):
        arc = simulate(block, x0, (0.0, 4.0))
        assert arc.mode[-1] != arc.mode[1]
        np.testing.assert_allclose(sampled.x[i], arc(times), atol=1e-9)
    assert_one_by_one(found, block, starts, (0.0, 4.0))
    np.testing.assert_array_equal(sampled.mode_end, found.mode_end)


@pytest.mark.as_given
def test_a_mode_that_is_named_may_have_several_parts():
    """A block that rubs: each start is in the part that its velocity belongs to."""
    rubbing = hybrid.HybridSystem(
        state=("q", "v"), modes=[hybrid.Mode("rub", lambda t, x, p: (x.v, -x.q - 0.3 * np.sign(x.v)))]
    )
    block = hybrid.split(rubbing)
    assert len(block.parts_of("rub")) > 1
    starts = [(1.0, 1.0), (1.0, -1.0), (-1.0, 0.5), (2.0, -0.5)]
    found = simulate_many(block, starts, (0.0, 3.0), mode="rub")
    assert_one_by_one(found, block, starts, (0.0, 3.0), mode="rub")


class Impatient:
    """Ctrl-C at the fifth question."""

    def __init__(self):
        self.asked = 0

    def is_set(self):
        self.asked += 1
        return self.asked > 4

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        pass


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_keeps_what_is_there(threads, monkeypatch):
    monkeypatch.setattr(many, "CTRL_C", Impatient())
    starts = np.tile(STARTS, (50, 1))
    found = simulate_many(OSCILLATOR, starts, (0.0, 600.0), executor=threads)
    done = found.status == StatusCode.SUCCESS
    assert 0 < done.sum() < len(starts)
    assert (found.status[~done] == StatusCode.NOT_RUN).all()
    assert np.isfinite(found.x_end[done]).all()


@pytest.mark.parametrize(
    ("x0", "message"),
    [
        ((1.0, 2.0), r"x0 must be states of shape \(N, n\).*here n = 2; got shape \(2,\)"),
        ({"q": [1.0]}, "x0 lacks v"),
        ({"q": [1.0], "w": [1.0]}, "x0: State component 'w' does not exist"),
        ({"q": [1.0, 2.0], "v": [1.0, 2.0, 3.0]}, "x0 must be states"),
        ([(1.0, np.nan)], r"x0 must be finite; got x0\[0\]"),
    ],
)
def test_starts_are_checked(x0, message):
    with pytest.raises(ArgumentError, match=message):
        simulate_many(systems.ball(), x0, (0.0, 1.0))


@pytest.mark.parametrize("count", [1, 7, 37])
def test_every_start_is_in_one_block(count, monkeypatch):
    run, starts = many._Runs.run, []

    def recorded(self, block):
        starts.extend(block)
        run(self, block)

    monkeypatch.setattr(many._Runs, "run", recorded)
    simulate_many(OSCILLATOR, STARTS[:count], (0.3, 0.5), executor=1)
    assert starts == list(range(count))


def late():
    """A force at a time so late that its rounding matters."""
    mode = hybrid.Mode("swing", lambda t, x, p: (x.v, np.cos(t) - x.q))
    return (
        hybrid.HybridSystem(state=("q", "v"), modes=[mode], transitions=[]),
        (1e12, 1e12 + 10.0),
        (1.0, 0.0),
    )


def dry():
    """A level that runs dry in steps in time, and waits."""
    modes = [
        hybrid.Mode("drain", lambda t, x, p: (-(x.h**0.9),)),
        hybrid.Mode("empty", lambda t, x, p: (0.0,)),
    ]
    guard = hybrid.Guard(lambda t, x, p: x.h, -1)
    transitions = [hybrid.Transition("drain", "empty", guard)]
    return hybrid.HybridSystem(state=("h",), modes=modes, transitions=transitions), (0.0, 20.0), (1.0,)


def counted():
    """A ball that counts its impacts up to their limit, where it rests."""
    modes = [
        hybrid.Mode("flight", lambda t, x, p: (x.v, -1.0, 0.0)),
        hybrid.Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0)),
    ]
    impact = hybrid.Transition(
        "flight",
        "flight",
        hybrid.Guard(lambda t, x, p: x.q, -1),
        hybrid.Reset(lambda t, x, p: (x.q, -0.5 * x.v, x.n + 1.0)),
        accumulates_to="rest",
    )
    system = hybrid.HybridSystem(state=("q", "v", "n"), modes=modes, transitions=[impact])
    return system, (0.0, 20.0), (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("made", "ok", "told"),
    [(late, False, "time is so large"), (dry, False, "may be off by"), (counted, True, "changes 'n'")],
)
def test_what_a_status_tells_is_told_of_many_runs_too(made, ok, told):
    system, span, x0 = made()
    mode = system.mode_names[0]
    found = simulate_many(system, [x0, x0], span, mode=mode, executor=1)
    assert (found.status.values == StatusCode.SUCCESS).tolist() == [ok, ok]
    assert all(told in message for message in found.message.values)
    assert_one_by_one(found, system, [x0, x0], span, mode=mode)


@pytest.mark.parametrize("divided", [False, True], ids=["whole", "split"])
def test_outputs_at_samples(divided):
    """Outputs at the samples are those of a run alone, also of one that does not get that far."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -1.0 - 0.1 * np.sign(x.v) * x.v**2)),
            Mode("contact", lambda t, x, p: (x.v, -1.0 - 40.0 * x.q)),
        ],
        transitions=[
            Transition("flight", "contact", Guard(lambda t, x, p: x.q, -1)),
            Transition("contact", "flight", Guard(lambda t, x, p: x.q, +1)),
            Transition("flight", None, Guard(lambda t, x, p: x.q - 3.0, +1)),
        ],
        start="flight",
        outputs={
            "force": {"contact": lambda t, x, p: -40.0 * x.q},
            "energy": lambda t, x, p: x.v**2 / 2 + x.q,
        },
    )
    system = split(system) if divided else system
    times, starts = np.linspace(0.0, 3.9, 21), np.array([[1.0, 0.0], [0.5, 0.3], [2.0, 3.0]])
    names = ("force", "energy")
    found = simulate_many(system, starts, (0.0, 4.0), samples=times, outputs=names)
    assert found.outputs.dims == ("start", "t", "output")
    assert list(found.output.values) == [*names]
    for i, start in enumerate(starts):
        arc = simulate(system, start, (0.0, 4.0))
        reached = times <= arc.t[-1]
        alone = np.column_stack([arc(times[reached], name) for name in names])
        np.testing.assert_allclose(found.outputs[i, reached], alone, rtol=1e-7, atol=1e-7)
        assert np.isnan(found.outputs[i, ~reached]).all()
        assert found.mode_end[i] == arc.mode[-1]
    assert np.isnan(found.outputs.sel(output="energy")).any()
    assert (~np.isnan(found.outputs.sel(output="force"))).any()
