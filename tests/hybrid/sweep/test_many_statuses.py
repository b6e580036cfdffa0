"""Runs from many starts say of their ends what `simulate` says: every code, and every note."""

from typing import Any

import attrs
import numpy as np
import pytest

import models
from hybrid import (
    DOP853,
    Delay,
    Guard,
    HybridError,
    HybridSystem,
    Mode,
    Reset,
    Status,
    StatusCode,
    Taylor,
    Transition,
    simulate,
    simulate_many,
)
from hybrid.sweep.outcome import text_of
from tests.hybrid.systems import ball


def between():
    """Neither mode allows a state between 0 and 1."""
    return HybridSystem(
        state=("q",),
        modes=[Mode("left", lambda t, x, p: (1.0,)), Mode("right", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.q, direction=+1)),
            Transition("right", "left", Guard(lambda t, x, p: x.q - 1, direction=-1)),
        ],
    )


@attrs.frozen
class Case:
    """A run, its code, and a part of the message."""

    system: HybridSystem
    x0: tuple[float, ...]
    t_end: float
    code: StatusCode
    told: str
    options: dict[str, Any] = attrs.field(factory=dict)
    t0: float = 0.0


def alone(rate, *transitions, name="m", state=("x",)):
    """A system of one mode."""
    return HybridSystem(state=state, modes=[Mode(name, rate)], transitions=transitions)


def falling(rebound, **changes):
    """A ball whose impacts are counted in ``n``."""
    impact = Transition(
        "flight", "flight", Guard(lambda t, x, p: x.q, -1), Reset(rebound), name="impact", **changes
    )
    modes = [
        Mode("flight", lambda t, x, p: (x.v, -1.0, 0.0)),
        Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0)),
    ]
    return HybridSystem(state=("q", "v", "n"), modes=modes, transitions=[impact])


def tank(power, after=None, rate=lambda t, x, p: (-(x.h**p.a),)):
    """A level that runs dry; then the run ends, or goes on in the mode ``after``."""
    modes = [Mode("drain", rate)]
    modes += [Mode(after, lambda t, x, p: (0.0,))] if after else []
    dry = Transition("drain", after, Guard(lambda t, x, p: x.h, -1), name="dry")
    return HybridSystem(state=("h",), parameters={"a": power}, modes=modes, transitions=[dry])


def opaque(t, x, p):
    """A guard that cannot be traced."""
    return (x.q if x.q > 0.5 else 1.0 * x.q) - 0.7


def facing():
    """Two modes that send the state back to each other."""
    return HybridSystem(
        state=("x",),
        modes=[Mode("left", lambda t, x, p: (1.0,)), Mode("right", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.x, +1)),
            Transition("right", "left", Guard(lambda t, x, p: x.x, -1)),
        ],
    )


def corner():
    """A puck that reaches two walls at once; the order of the two resets matters."""

    def wall(name, guard, reset):
        return Transition("m", "m", Guard(guard, -1), Reset(reset), name=name)

    return alone(
        lambda t, x, p: (x.a, x.b, 0.0, 0.0),
        wall("left", lambda t, x, p: x.x, lambda t, x, p: (x.x, x.y, -x.a, 2.0 * x.b)),
        wall("bottom", lambda t, x, p: x.y, lambda t, x, p: (x.x, x.y, x.a + 1.0, -x.b)),
        state=("x", "y", "a", "b"),
    )


SWING = alone(
    lambda t, x, p: (x.v, -x.q),
    Transition("m", "m", Guard(opaque, -1, gradient=lambda t, x, p: (1.0, 0.0)), name="mark"),
    state=("q", "v"),
)
# Comes to rest at a fourfold root of the guard.
HARD_TO_BOUND = alone(
    lambda t, x, p: (-x.x,),
    Transition(
        "m", "m", Guard(lambda t, x, p: (np.sin(1e7 * x.x) + 2) * (np.cos(1e7 * x.x) + 2) - 1.2 * x.x, -1)
    ),
)
# Hardly wider than the rounding of the time.
PULSE = HybridSystem(
    state=("q",),
    parameters={"a": 1e6 + 0.4, "w": 60 * float(np.spacing(1e6))},
    modes=[Mode("m", lambda t, x, p: (np.exp(-(((t - p.a) / p.w) ** 2)) / p.w,))],
)
# The guard is not finite where the other mode runs.
HALF = HybridSystem(
    state=("x",),
    modes=[Mode("low", lambda t, x, p: (0.1,)), Mode("high", lambda t, x, p: (0.1,))],
    transitions=[
        Transition("low", "high", Guard(lambda t, x, p: x.x - 1.0, +1)),
        Transition("high", "low", Guard(lambda t, x, p: np.sqrt(x.x) - 1.0, -1)),
    ],
)
DRAINED = "may be off by 0.6"
BEYOND = "The start lies beyond the guard of"
CASES = {
    "a delay without a place": Case(
        alone(
            lambda t, x, p: (1.0,),
            Transition(
                "m", "m", Guard(lambda t, x, p: x.x - 1.0, +1), Reset(lambda t, x, p: {"x": 0.0}), name="send"
            ),
            Transition("m", "m", Delay("send", 2.5, places=2), name="get"),
        ),
        (0.0,),
        5.0,
        StatusCode.DELAY_FULL,
        "places",
    ),
    "plain": Case(ball(), (1.0, 0.0), 0.1, StatusCode.SUCCESS, "Reached the end."),
    "beyond": Case(ball(), (-1.0, 0.0), 0.1, StatusCode.START_BEYOND, BEYOND, {"mode": "flight"}),
    "beyond, and crossed later": Case(
        ball(), (-1.0, 6.0), 1.5, StatusCode.SUCCESS, BEYOND, {"mode": "flight"}
    ),
    "beyond, in a mode with a root": Case(
        tank(0.5, "empty", lambda t, x, p: (-np.sqrt(np.abs(x.h)),)),
        (-1.0,),
        0.1,
        StatusCode.START_BEYOND,
        BEYOND,
        {"mode": "drain"},
    ),
    "not finite in another mode": Case(HALF, (-1.0,), 0.1, StatusCode.SUCCESS, "Reached the end."),
    "held": Case(
        falling(lambda t, x, p: (x.q, -0.5 * x.v, x.n + 1.0), accumulates_to="rest"),
        (1.0, 0.0, 0.0),
        20.0,
        StatusCode.SUCCESS,
        "changes 'n'",
        {"mode": "flight"},
    ),
    "a level below the tolerance": Case(
        tank(0.95), (1.0,), 40.0, StatusCode.SUCCESS, "is below atol", {"mode": "drain"}
    ),
    "a level that ran dry": Case(tank(0.9), (1.0,), 20.0, StatusCode.TERMINAL, DRAINED),
    "a level that ran dry before": Case(
        tank(0.9, "empty"), (1.0,), 20.0, StatusCode.INFINITE_SLOPE, DRAINED, {"mode": "drain"}
    ),
    "sampled": Case(SWING, (1.5, 0.0), 5.0, StatusCode.SUCCESS, "'mark' are not proved"),
    "not proved": Case(
        HARD_TO_BOUND, (1.0,), 0.1, StatusCode.SUCCESS, "Not all crossings of 'm->m' are proved"
    ),
    "not resolved": Case(
        PULSE,
        (1.0,),
        1e6 + 1.0,
        StatusCode.SUCCESS,
        "the forcing is not resolved",
        {"solver": Taylor(rtol=1e-6, atol=1e-8)},
        1e6,
    ),
    "late": Case(
        alone(lambda t, x, p: (x.v, np.cos(t) - x.q), state=("q", "v")),
        (1.0, 0.0),
        1e12 + 10.0,
        StatusCode.ROUNDED_TIME,
        "time is so large",
        t0=1e12,
    ),
    "two guards": Case(corner(), (1.0, 1.0, -1.0, -1.0), 1.5, StatusCode.AMBIGUOUS_ORDER, "1 times two"),
    "steps": Case(
        models.impact_oscillator(),
        (0.0, 0.0),
        100.0,
        StatusCode.MAX_STEPS,
        "limit of steps",
        {"solver": DOP853(max_steps=20)},
    ),
    "jumps": Case(ball(), (1.0, 0.0), 4.0, StatusCode.MAX_JUMPS, "limit of jumps", {"max_jumps": 2}),
    "small steps": Case(
        alone(lambda t, x, p: (np.abs(1.0 - t) ** -0.5,)),
        (0.0,),
        2.0,
        StatusCode.STEP_TOO_SMALL,
        "at t = 1",
        {"solver": DOP853()},
    ),
    "not finite": Case(
        alone(lambda t, x, p: (np.log(x.x),)), (-1.0,), 1.0, StatusCode.NON_FINITE, "nan at t = 0"
    ),
    "chatter": Case(ball(), (1.0, 0.0), 9.0, StatusCode.ACCUMULATION, "ever shorter"),
    "at rest": Case(
        ball(), (1.0, 0.0), 9.0, StatusCode.ACCUMULATION, "rests on its guard", {"parameters": {"e": 0.0}}
    ),
    "stuck": Case(facing(), (-1.0,), 3.0, StatusCode.STUCK, "left->right", {"mode": "left"}),
    "refused": Case(between(), (0.5,), 1.0, StatusCode.FAILED, "is allowed in no mode"),
}
# Only with tangent vectors; of results that are no runs; of Ctrl-C; and of steps that are kept.
NEVER = {
    *(StatusCode.SINGULAR_SALTATION, StatusCode.DISCONTINUOUS_FIELD, StatusCode.INDISTINCT_TANGENTS),
    *(StatusCode.NOT_CONVERGED, StatusCode.NOT_RUN, StatusCode.INTERRUPTED, StatusCode.OUT_OF_MEMORY),
}


def of_one(case):
    """The status of the run by itself."""
    try:
        return simulate(case.system, case.x0, (case.t0, case.t_end), **case.options).status
    except HybridError as failure:
        return Status(StatusCode.FAILED, str(failure))


@pytest.mark.parametrize("name", CASES)
def test_each_status_is_that_of_simulate(name):
    case = CASES[name]
    wanted = of_one(case)
    assert (wanted.code, case.told in wanted.message) == (case.code, True), wanted
    found = simulate_many(case.system, [case.x0] * 2, (case.t0, case.t_end), executor=1, **case.options)
    assert found.status.values.tolist() == [wanted.code] * 2
    assert found.message.values.tolist() == [text_of(wanted)] * 2


def test_every_code_that_a_run_can_end_with_is_compared():
    assert {case.code for case in CASES.values()} == set(StatusCode) - NEVER
