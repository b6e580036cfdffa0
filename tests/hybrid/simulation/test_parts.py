"""A run that calls a part which was not compiled begins again, and comes out the same to the last bit."""

import attrs
import numpy as np
import pytest
import xarray

import hybrid
import lyapunov
import models
from hybrid.compiler.cache.loader import LIMITS
from hybrid.simulation import plan

# Impacts that accumulate on a table at rest, and rounds of two transitions that do; a run that never asks.
RUNS = {
    "impacts": (models.bouncing_ball, (1.0, 0.3), 6.0),
    "no chatter": (models.vibroimpact, (0.0, 0.0, 0.0, 0.0), 3.0),
}


def two_in_turn():
    """A ball that counts its bounces in two modes in turn."""

    def fall(t, x, p):
        return x.v, -1.0

    bounce = hybrid.Reset(lambda t, x, p: (0.0, -0.5 * x.v))
    floor = hybrid.Guard(lambda t, x, p: x.q, -1)
    return hybrid.HybridSystem(
        state=("q", "v"),
        modes=[hybrid.Mode("odd", fall), hybrid.Mode("even", fall)],
        transitions=[
            hybrid.Transition("odd", "even", floor, bounce, name="one"),
            hybrid.Transition("even", "odd", floor, bounce, name="other"),
        ],
    )


def arc_of(name, tangent, **options):
    if name == "two in turn":
        return hybrid.simulate(two_in_turn(), (1.0, 0.0), (0.0, 9.0), mode="odd", tangent=tangent)
    make, start, end = RUNS[name]
    system = make()
    return hybrid.simulate(system, start, (0.0, end), mode=system.mode_names[0], tangent=tangent, **options)


@pytest.fixture
def not_compiled(monkeypatch):
    """Plans as in a process that has not compiled the limits of chatter."""
    kept = plan.is_kept
    monkeypatch.setattr(plan, "is_kept", lambda module: module != LIMITS and kept(module))


@pytest.mark.parametrize("tangent", [False, True])
@pytest.mark.parametrize("name", [*RUNS, "two in turn"])
def test_same_to_the_last_bit(name, tangent, monkeypatch):
    complete = arc_of(name, tangent)
    kept, asked = plan.is_kept, []
    monkeypatch.setattr(plan, "is_kept", lambda module: module != LIMITS and kept(module))
    monkeypatch.setattr(plan, "completed", lambda parts, load=plan.completed: asked.append(1) or load(parts))
    found = arc_of(name, tangent)
    assert len(asked) == (0 if name == "no chatter" else 1)
    assert found.status == complete.status
    assert list(found.jumps.transition) == list(complete.jumps.transition)
    for one, other in ((found.t, complete.t), (found.x, complete.x), (found.jumps.t, complete.jumps.t)):
        np.testing.assert_array_equal(one, other)
    if tangent:
        np.testing.assert_array_equal(found.fundamental, complete.fundamental)


def forced_ball():
    """A ball on a floor that shakes: its impacts accumulate a while after the start, again and again."""
    return hybrid.HybridSystem(
        state=("q", "v"),
        modes=[hybrid.Mode("flight", lambda t, x, p: (x.v, -1.0 + 1.5 * np.sin(2.0 * np.pi * t)))],
        transitions=[
            hybrid.Transition(
                "flight",
                "flight",
                hybrid.Guard(lambda t, x, p: x.q, -1),
                hybrid.Reset(lambda t, x, p: (0.0, -0.3 * x.v)),
                name="impact",
            )
        ],
        period=1.0,
    )


def values_of(result):
    """All arrays and numbers of a result."""
    if isinstance(result, xarray.Dataset):
        return [each.values for each in result.data_vars.values()]
    return [
        getattr(result, each.name)
        for each in attrs.fields(type(result))
        if isinstance(getattr(result, each.name), float | int | np.ndarray)
    ]


ANALYSES = {
    "spectrum": lambda system: lyapunov.lyapunov_spectrum(system, (4.0, 0.0), intervals=12, transient=3),
    "strobe": lambda system: hybrid.stroboscopic_section(system, (4.0, 0.0), periods=12, transient=1),
    "many": lambda system: hybrid.simulate_many(system, [(1.0, 0.0), (4.0, 0.1), (2.0, 0.0)], (0.0, 12.0)),
}


@pytest.mark.parametrize("analysis", ANALYSES)
def test_analyses_begin_the_burst_again(analysis, monkeypatch):
    complete = ANALYSES[analysis](forced_ball())
    kept, asked = plan.is_kept, []
    monkeypatch.setattr(plan, "is_kept", lambda module: module != LIMITS and kept(module))
    monkeypatch.setattr(plan, "completed", lambda parts, load=plan.completed: asked.append(1) or load(parts))
    found = ANALYSES[analysis](forced_ball())
    assert len(asked) == 1
    for one, other in zip(values_of(found), values_of(complete), strict=True):
        np.testing.assert_array_equal(one, other)


def test_ctrl_c_while_a_part_is_compiled(not_compiled, monkeypatch):
    def interrupted(parts):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(plan, "completed", interrupted)
        arc = arc_of("impacts", False)
    assert arc.status.code == hybrid.StatusCode.INTERRUPTED
    assert arc.t[-1] == 0.0


def test_plans_are_complete_once_the_part_is_there(not_compiled):
    system = models.bouncing_ball()
    made = plan.plan_of(hybrid.compile_system(system), hybrid.Taylor(), 0)
    assert (made.parts_so_far.complete, made.parts_so_far.finish_chatter.address) == (0, 0)
    assert made.parts.complete == 1
    assert made.parts_so_far is made.parts
    assert made.parts.finish_chatter.address != 0
    assert made.parts.jump is plan.plan_of(hybrid.compile_system(system), hybrid.Taylor(), 0).parts.jump
