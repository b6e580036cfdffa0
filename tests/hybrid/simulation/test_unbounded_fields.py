"""A field that cannot be traced is seen at single points of each step, and the status says so."""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Taylor,
    Transition,
    Tsit5,
    global_error,
    simulate,
    simulate_many,
)

TIMES, RATES = np.array([1.0, 1.01]), np.array([0.0, 100.0, 0.0])


def table(t, x, p):
    return (RATES[np.searchsorted(TIMES, t, side="right")],)


def filled(first):
    return HybridSystem(
        state=("q",),
        modes=[
            Mode("fill", first),
            Mode("wait", table if first is not table else lambda t, x, p: (0.0 * x.q,)),
        ],
        transitions=[Transition("fill", "wait", Guard(lambda t, x, p: x.q - 5, +1))],
    )


# Compiled once for all tests.
FILLED = filled(table)


@pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda each: type(each).__name__
)
def test_a_pulse_that_cannot_be_traced_may_be_stepped_over(solver):
    arc = simulate(FILLED, (0.0,), (0.0, 10.0), mode="fill", solver=solver)
    assert "forcing of mode 'fill' cannot be bounded" in arc.status.message
    assert "cannot be bounded" in repr(arc)
    short = simulate(FILLED, (0.0,), (0.0, 10.0), mode="fill", solver=type(solver)(max_step=0.005))
    assert short.x[-1, 0] == pytest.approx(1.0, abs=0.5)


def test_modes_that_a_run_does_not_visit_are_not_told():
    system = filled(lambda t, x, p: (1.0 + 0.0 * x.q,))
    assert simulate(system, (0.0,), (0.0, 4.0), mode="fill").status.message == "Reached the end."
    assert "mode 'wait' cannot be bounded" in simulate(system, (0.0,), (0.0, 6.0), mode="fill").status.message


def test_the_error_of_such_a_run_is_not_certain():
    found = global_error(FILLED, (0.0,), (0.0, 10.0), mode="fill")
    assert "cannot be bounded" in found.status.message
    assert "cannot be bounded" in repr(found)


def test_many_runs_tell_the_same():
    starts = np.linspace(0.0, 1.0, 3)[:, None]
    many = simulate_many(FILLED, starts, (0.0, 10.0), mode="fill")
    single = simulate(FILLED, starts[0], (0.0, 10.0), mode="fill")
    assert "cannot be bounded" in str(many.message.values[0])
    assert str(many.message.values[0]) in str(single.status)
