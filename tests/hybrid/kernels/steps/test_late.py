"""Late times are rounded: a run is as good as early, or says that it is not."""

from functools import cache

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
            assert abs(t0) < 3e9
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
    late = simulate(system, (1.0, 0.1), (1e15, 1e15 + 8.0))
    early = simulate(system, (1.0, 0.1), (0.0, late.t[-1] - late.t[0]))
    assert late.status.ok
    np.testing.assert_allclose(late.x[-1], early.x[-1], rtol=1e-13)
