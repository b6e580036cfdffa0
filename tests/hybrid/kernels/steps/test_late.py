"""Late times are rounded: a run is as good as early, or says that it is not."""

from functools import cache
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    simulate,
)
from hybrid.kernels.steps import late
from hybrid.kernels.types.codes import NO_MODE
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(late)
METHOD = SimpleNamespace(rtol=1e-10, atol=1e-12)


def test_it_is_late_where_the_rounding_of_time_exceeds_the_tolerance_of_a_step():
    for phase, span, found in ((4e5, 1.0, False), (5e5, 1.0, True), (-5e5, 1.0, True), (5e5, 1.2, False)):
        assert kernels.is_late(METHOD, SimpleNamespace(phase=phase, longest_step=span)) == found


def test_the_largest_change_is_kept_in_tolerances():
    run = SimpleNamespace(scale=np.array([0.0, 3.0]), lateness=2.0)
    for i, change, other, kept in (
        (0, 1e-12, 0.0, 2.0),
        (0, -3e-12, 0.0, 3.0),
        (0, np.nan, 0.0, 3.0),
        (0, 12.0 * (1e-12 + 7e-10), -7.0, 12.0),
        (1, 13.0 * (1e-12 + 3e-10), 2.0, 13.0),
        (1, 1e-12, 0.0, 13.0),
    ):
        kernels.keep_largest(METHOD, run, i, change, other)
        assert run.lateness == pytest.approx(kept, rel=1e-12)


def kept(function, t, *given, marker=0, target=1, since_entry=2.0):
    """The changes of two components with the numbers beside, in a system whose functions are linear in time.

    The fields of the modes are ``(4 t, x_1)`` and ``(8 t, 7)``, the guard of the second transition is
    ``x_0 + 2 t`` and its reset ``(t x_0, x_1 - t)``.
    """
    changes = []

    def field(mode, t, x, parameters, out):
        out[:] = (4.0 * t, x[1]) if mode == 0 else (8.0 * t, 7.0)

    def guard(transition, t, x, parameters, out):
        assert transition == 1
        out[0] = x[0] + 2.0 * t

    def guard_gradient(transition, t, x, parameters, out):
        out[:] = 1.0, 0.0, 2.0

    def reset(transition, t, x, parameters, out):
        out[:] = t * x[0], x[1] - t

    model = SimpleNamespace(
        dimension=2,
        parameters=None,
        field=field,
        guard=guard,
        guard_gradient=guard_gradient,
        reset=reset,
        target=np.array([NO_MODE, target]),
        marker=np.array([0, marker]),
    )
    run = SimpleNamespace(mode=0, phase=t, y=np.array([4.0, 6.0]), since_entry=since_entry)
    names = ("field", "field_after", "new", "state", "trial")
    work = SimpleNamespace(gradient=np.zeros(3), scalar=np.zeros(1), **{name: np.zeros(2) for name in names})
    tested = plain(late, keep_largest=lambda method, run, i, *given: changes.append((i, *given)))
    vars(tested)[function](model, METHOD, run, *given, work)
    return changes


@pytest.mark.parametrize("t", [2.0**30, -(2.0**30)])
def test_a_step_changes_by_the_field_at_the_next_time(t):
    later = EPSILON * 2.0**30
    found = kept("late_step", t, 0.5)
    assert found == [(0, 0.5 * 4.0 * later, 0.5 * 4.0 * t), (1, 0.0, 0.5 * 6.0)]


def test_a_jump_comes_at_another_time_and_has_another_reset():
    """To first order, the image at the shifted time is compared with the image of the path behind."""
    t = 2.0**30
    later = EPSILON * t
    delay = 2.0 * later / (2.0 + 4.0 * t)
    (_, first, image), (_, second, other) = kept("late_jump", t, 1)
    assert (image, other) == (4.0 * t, 6.0 - t)
    assert first == pytest.approx((t + later) * (4.0 + delay * 4.0 * t) - 4.0 * t - delay * 8.0 * t, rel=1e-9)
    assert second == pytest.approx(-later + delay * (6.0 - 7.0), rel=1e-9)
    # Where the guard hardly moves, the delay is no longer than the flight.
    (_, first, _), _ = kept("late_jump", t, 1, since_entry=2.0**-120)
    assert first == pytest.approx(4.0 * later, rel=1e-9)


def test_markers_and_the_end_of_a_run_have_no_error_of_the_state():
    assert kept("late_jump", 2.0**30, 1, marker=1) == []
    assert kept("late_jump", 2.0**30, 1, target=NO_MODE) == []


def machine(field, guard, reset=None, direction=-1):
    """A system with one mode; all of its forcing has the period 2 pi."""
    transitions = [Transition("m", "m", Guard(guard, direction), None if reset is None else Reset(reset))]
    return {
        period: HybridSystem(
            state=("q", "v"), modes=[Mode("m", field)], transitions=transitions, period=period
        )
        for period in (None, 2.0 * np.pi)
    }


# What depends on time: a force, a wall and the impact law there, a kick by the clock, the impact law alone.
MACHINES = {
    "force": machine(
        lambda t, x, p: (x.v, -x.q - 0.1 * x.v + 2.0 * np.cos(t)),
        lambda t, x, p: x.q - 0.5,
        lambda t, x, p: (x.q, -0.8 * x.v),
        +1,
    ),
    "table": machine(
        lambda t, x, p: (x.v, -1.0),
        lambda t, x, p: x.q - 0.3 * np.sin(t),
        lambda t, x, p: (x.q, -0.8 * x.v + 1.8 * 0.3 * np.cos(t)),
    ),
    "clock": machine(
        lambda t, x, p: (x.v, -x.q), lambda t, x, p: np.sin(t), lambda t, x, p: (x.q, x.v + 1.0), +1
    ),
    "law": machine(lambda t, x, p: (x.v, -1.0), lambda t, x, p: x.q, lambda t, x, p: (0.0, 2.0 + np.cos(t))),
}


@cache
def exact(name, t0, t1):
    """From the phase of ``t0``, to 40 digits, over the same time."""
    with mpmath.workdps(40):
        phase = float(mpmath.fmod(t0, 2 * mpmath.pi))
    return simulate(MACHINES[name][None], (1.0, 0.1), (phase, phase + (t1 - t0)), mode="m").x[-1]


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), RadauIIA()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("name", MACHINES)
def test_a_late_run_is_as_good_as_an_early_one_or_says_that_it_is_not(name, solver):
    for t0 in (1e3, 1e5, 3e5, 1e6, -1e6, 3e6, 1e7, 1e8, 1e9, -1e9, 1e10, 1e12, 1e13):
        t1 = t0 + 6.0
        arc = simulate(MACHINES[name][None], (1.0, 0.1), (t0, t1), mode="m", solver=solver)
        error = np.abs(arc.x[-1] - exact(name, t0, t1)).max()
        if abs(t0) <= 1e6:
            assert arc.status.ok, t0
        if not arc.status.ok:
            assert arc.status.code in (StatusCode.ROUNDED_TIME, StatusCode.STEP_TOO_SMALL), t0
            assert "declare the period" in arc.status.remedy
        else:
            assert abs(t0) < 1e9
        assert error < 1e-8 or not arc.status.ok, t0


def test_looser_tolerances_and_a_period_are_remedies():
    for name, systems in MACHINES.items():
        loose = simulate(
            systems[None], (1.0, 0.1), (1e8, 1e8 + 6.0), mode="m", solver=Taylor(rtol=1e-6, atol=1e-8)
        )
        assert loose.status.ok, name
        assert np.abs(loose.x[-1] - exact(name, 1e8, 1e8 + 6.0)).max() < 1e-5
        turns = 10.0**8 * systems[2.0 * np.pi].period
        declared = simulate(systems[2.0 * np.pi], (1.0, 0.1), (turns, turns + 6.0), mode="m")
        assert declared.status.ok, name


def test_a_system_without_time_is_never_late():
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("m", lambda t, x, p: (x.v, -1.0))],
        transitions=[
            Transition("m", "m", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, 1.0 + x.v**2)))
        ],
    )
    early, after = (simulate(system, (1.0, 0.1), (t0, t0 + 8.0)) for t0 in (0.0, 1e15))
    assert after.status.ok
    assert np.array_equal(early.x[-1], after.x[-1])
