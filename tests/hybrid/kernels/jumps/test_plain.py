"""A jump that keeps the state has the same tangent map, worked out in another way, as with a reset."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate
from lyapunov import lyapunov_spectrum

START = (-1.0, 0.4, 0.0)


def switched(reset):
    """A mass on a spring, and a component that follows it; another force acts beyond a curved line."""
    line = lambda t, x, p: x.x + 0.3 * x.v**2 + 0.1 * np.sin(t)  # noqa: E731
    return HybridSystem(
        state=("x", "v", "w"),
        parameters={"one": 1.0},
        modes=[
            Mode("left", lambda t, x, p: (x.v, 1.0 - x.x - 0.1 * x.v, 0.2 * x.x - x.w)),
            Mode("right", lambda t, x, p: (x.v + 0.3, -1.5 - x.x + np.cos(t), x.v - x.w)),
        ],
        transitions=[
            Transition("left", "right", Guard(line, +1), reset),
            Transition("right", "left", Guard(line, -1), reset),
        ],
    )


SYSTEMS = [switched(None), switched(Reset(lambda t, x, p: (p.one * x.x, x.v, p.one * x.w)))]


@pytest.mark.parametrize("solver", [Taylor(), DOP853(rtol=1e-12, atol=1e-14)], ids=["Taylor", "DOP853"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_jump_that_keeps_the_state_is_one_whose_reset_changes_nothing(solver, count):
    short, long = (
        simulate(each, START, (0.0, 12.0), mode="left", solver=solver, tangent=np.eye(3)[:, :count])
        for each in SYSTEMS
    )
    assert len(short.jumps) == len(long.jumps) == 5
    np.testing.assert_allclose(short.fundamental, long.fundamental, rtol=1e-11, atol=1e-13)
    for one, other in zip(short.jumps, long.jumps, strict=True):
        np.testing.assert_allclose(one.saltation, other.saltation, rtol=1e-11, atol=1e-13)
        assert not np.allclose(one.saltation, np.eye(3))


@pytest.mark.parametrize("k", [1, 3])
def test_the_sum_rule_counts_jumps_that_keep_the_state(k):
    short, long = (
        lyapunov_spectrum(each, START, mode="left", k=k, interval=2.0, intervals=20, transient=0)
        for each in SYSTEMS
    )
    np.testing.assert_allclose(short.exponents, long.exponents, rtol=0, atol=1e-12)
    assert short.sum_rule == pytest.approx(long.sum_rule, abs=1e-12)
    if k == 3:
        assert short.exponents.sum() == pytest.approx(short.sum_rule, abs=1e-9)
