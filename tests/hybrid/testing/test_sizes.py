"""Each component of a run has a size in its own unit."""

import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import Case


def run_of(unit_q=1.0, unit_v=1.0, unit_t=1.0):
    """A bouncing ball with each component and the time in other units, and a component that stays zero."""
    system = HybridSystem(
        state=("q", "v", "zero"),
        parameters={"g": 9.81 * unit_v / unit_t, "e": 0.8, "a": unit_q / unit_v / unit_t},
        modes=[Mode("flight", lambda t, x, p: (p.a * x.v, -p.g, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v, x.zero)),
                name="bounce",
            )
        ],
    )
    solver = hybrid.DOP853(rtol=1e-12, atol=1e-14 * min(unit_q, unit_v), max_steps=20_000)
    start = (unit_q, 0.0, 0.0)
    return Case(system, dict(system.parameters), "flight", start, 0.0, unit_t, solver=solver).run


@pytest.mark.parametrize("units", [(1e-9, 1e6, 1e3), (1e9, 1e-6, 1e-9), (1e-6, 1e-6, 1e9)])
def test_sizes_are_measured_in_units_of_their_components(units):
    plain = run_of().scale
    assert plain[:2] == pytest.approx([1.0, (2 * 9.81) ** 0.5], rel=1e-9)
    np.testing.assert_allclose(run_of(*units).scale[:2], plain[:2] * units[:2], rtol=1e-6)


def test_a_component_that_stays_zero_has_no_size():
    assert run_of().scale[2] == 1.0


def test_a_component_that_stays_small_has_a_share_of_what_the_others_make_of_it():
    """The oscillator starts with ``q`` alone, and after a short time ``v`` is still small."""
    system = HybridSystem(
        state=("q", "v"), parameters={"w": 100.0}, modes=[Mode("a", lambda t, x, p: (x.v, -(p.w**2) * x.q))]
    )
    case = Case(system, dict(system.parameters), "a", (1.0, 0.0), 0.0, 1e-9)
    # The spectral radius is 100, so the time is that of the run.
    assert case.run.scale[1] == pytest.approx(100.0**2 * 1e-9, rel=1e-6)
    assert case.run.scale[0] == pytest.approx(1.0, rel=1e-14)


def test_a_reset_makes_a_component_large():
    """``v`` is zero, but the difference of two large terms."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("a", lambda t, x, p: (1.0, 0.0))],
        transitions=[
            Transition(
                "a",
                "a",
                Guard(lambda t, x, p: x.q - 1.0, direction=1),
                Reset(lambda t, x, p: (0.0, 2000.0 * x.q - 2000.0)),
            )
        ],
    )
    run = Case(system, {}, "a", (0.5, 0.0), 0.0, 0.9).run
    assert len(run.arc.jumps) == 1
    assert run.scale[1] == pytest.approx(1e-3 * 2000.0 * run.scale[0], rel=1e-6)
