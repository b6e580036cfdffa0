"""A level that a root of it brings to zero is met, whatever parameter is zero."""

import numpy as np
import pytest

from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, simulate

LEVEL, VALVE = 0.05, 0.7
EMPTY = 2.0 * np.sqrt(LEVEL) / VALVE


def tank(field, others=()):
    return HybridSystem(
        state=("y",),
        parameters={"k": VALVE, "Q": 0.0},
        modes=[Mode("open", field), Mode("dry", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("open", "dry", Guard(lambda t, x, p: x.y, -1), name="empty"),
            *others,
        ],
        start="open",
    )


FIELDS = {
    "no inflow": lambda t, x, p: (-p.k * np.sqrt(x.y),),
    "an inflow of zero": lambda t, x, p: (p.Q - p.k * np.sqrt(x.y),),
    "an inflow of zero, guarded": lambda t, x, p: (p.Q - p.k * np.sqrt(np.maximum(x.y, 0.0)),),
    "an inflow in time of zero": lambda t, x, p: (p.Q * (1 + np.sin(t)) - p.k * np.sqrt(x.y),),
    "an inflow that is proportional to the level": lambda t, x, p: (p.Q * x.y - p.k * x.y**0.5,),
}


@pytest.mark.parametrize("name", FIELDS)
def test_a_tank_without_inflow_runs_dry(name):
    arc = simulate(tank(FIELDS[name]), (LEVEL,), (0.0, 10.0))
    assert arc.status.ok
    assert [jump.transition for jump in arc.jumps] == ["empty"]
    assert arc.jumps[0].t == pytest.approx(EMPTY, rel=1e-10)
    assert arc.x[-1, 0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", FIELDS)
def test_the_time_at_which_a_tank_runs_dry_has_derivatives(name):
    """``T = 2 sqrt(y0) / k``."""
    arc = simulate(tank(FIELDS[name]), (LEVEL,), (0.0, 10.0), sensitivities=("k",))
    assert arc.jumps.t_sensitivity[0, 0] == pytest.approx(-EMPTY / VALVE, rel=1e-7)
    assert arc.jumps.t_gradient[0, 0] == pytest.approx(1.0 / (VALVE * np.sqrt(LEVEL)), rel=1e-7)


def test_a_tank_with_an_inflow_does_not_run_dry():
    """It fills, or drains, to the level at which the valve lets as much through."""
    arc = simulate(tank(FIELDS["an inflow of zero"]), (LEVEL,), (0.0, 200.0), parameters={"Q": 0.05})
    assert len(arc.jumps) == 0
    assert arc.x[-1, 0] == pytest.approx((0.05 / VALVE) ** 2, rel=1e-9)


def test_a_tank_that_is_filled_anew_runs_dry_each_time():
    filled = Transition("dry", "open", Every(1.0), Reset(lambda t, x, p: {"y": LEVEL}), name="fill")
    arc = simulate(tank(FIELDS["an inflow of zero"], (filled,)), (LEVEL,), (0.0, 3.9))
    assert [jump.transition for jump in arc.jumps] == ["empty", "fill"] * 3 + ["empty"]
    empty = [jump.t for jump in arc.jumps if jump.transition == "empty"]
    np.testing.assert_allclose(empty, EMPTY + np.arange(4.0), rtol=1e-10)
