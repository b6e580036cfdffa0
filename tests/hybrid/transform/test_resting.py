"""Surfaces that a state reaches like a root reaches zero: it stays there."""

import numpy as np
import pytest

from hybrid import DOP853, RadauIIA, StatusCode, Taylor, Tsit5, from_equations, simulate

SOLVERS = pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda each: type(each).__name__
)


def tanks(inflow=0.0):
    """Two tanks joined by a pipe; its flow goes with the root of the difference of levels (Torricelli)."""

    def field(t, x, p):
        flow = np.sign(x.a - x.b) * np.sqrt(np.abs(x.a - x.b))
        return -flow + inflow, flow + inflow

    return from_equations(field, state=("a", "b"))


@SOLVERS
@pytest.mark.parametrize("start", [(1.5, 0.5), (0.2, 1.9)])
def test_two_tanks_come_to_one_level_and_stay(start, solver):
    """The root of the difference falls at the rate 1."""
    end = np.sqrt(abs(start[0] - start[1]))
    arc = simulate(tanks(), start, (0.0, 3.0), solver=solver)
    assert arc.mode[-1] == "a=b"
    assert arc.status.code in (StatusCode.SUCCESS, StatusCode.INFINITE_SLOPE)
    assert arc.jumps.t == pytest.approx([end], abs=1e-4)
    assert arc.x[-1] == pytest.approx([np.mean(start)] * 2, abs=1e-8)


def test_levels_rise_together():
    """With an inflow to both, the common level rises."""
    arc = simulate(tanks(inflow=0.25), (1.5, 0.5), (0.0, 3.0))
    assert arc.status.ok
    assert arc.jumps.t == pytest.approx([1.0], abs=1e-12)
    assert arc.x[-1] == pytest.approx([1.75, 1.75], abs=1e-12)


def test_a_level_that_is_passed_is_no_rest():
    """An outflow from one tank alone takes the difference through zero."""

    def field(t, x, p):
        return (-np.sign(x.d) * np.sqrt(np.abs(x.d)) - 1.0,)

    arc = simulate(from_equations(field, state=("d",)), (1.0,), (0.0, 2.0))
    assert "d=0" not in arc.mode
    assert arc.x[-1, 0] < 0.0
