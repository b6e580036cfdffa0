"""Units of time far from the pace of the solution: the terms of a series stay floats."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate

BOUNCE = Transition(
    "swing",
    "swing",
    Guard(lambda t, x, p: x.q + 0.5, direction=-1),
    Reset(lambda t, x, p: (x.q, -0.9 * x.v)),
    name="stop",
)
HIT = Transition("swing", "contact", Guard(lambda t, x, p: x.q + 0.5, direction=-1), name="hit")
RELEASE = Transition("contact", "swing", Guard(lambda t, x, p: x.q + 0.5, direction=1), name="release")


def hertz(t, x, p):
    return (p.s * x.v, p.s * (10 * np.maximum(-0.5 - x.q, 0.0) ** 1.5 - x.q))


# The pace is ``s``: time enters only as ``s t``.
SWINGS = {
    "nonlinear": lambda t, x, p: (p.s * x.v, -p.s * np.sin(x.q)),
    "linear": lambda t, x, p: (p.s * x.v, -p.s * x.q),
    "forced": lambda t, x, p: (p.s * x.v, p.s * (np.cos(2 * p.s * t) - x.q - 0.1 * x.v)),
    "forced and nonlinear": lambda t, x, p: (p.s * x.v, p.s * (np.cos(2 * p.s * t) - np.sin(x.q))),
    "contact": lambda t, x, p: (p.s * x.v, -p.s * x.q),
}


@pytest.fixture(scope="module", params=SWINGS)
def system(request):
    modes, transitions = [Mode("swing", SWINGS[request.param])], [BOUNCE]
    if request.param == "contact":
        modes, transitions = [*modes, Mode("contact", hertz)], [HIT, RELEASE]
    return HybridSystem(state=("q", "v"), modes=modes, transitions=transitions, parameters={"s": 1.0})


def run(system, s):
    return simulate(system, (1.0, 0.0), (0.0, 20.0 / s), parameters={"s": s}, mode="swing", tangent=True)


@pytest.mark.parametrize("exponent", [-24, -18, -12, -10, -5, 5, 10, 11, 12, 18, 24])
def test_a_run_is_the_same_at_any_pace(system, exponent):
    s = 10.0**exponent
    arc, expected = run(system, s), run(system, 1.0)
    assert arc.status.ok
    assert [jump.transition for jump in arc.jumps] == [jump.transition for jump in expected.jumps]
    assert np.allclose(
        s * np.array([jump.t for jump in arc.jumps]), [jump.t for jump in expected.jumps], 1e-9
    )
    assert np.allclose(arc.x[-1], expected.x[-1], rtol=0, atol=1e-9)
    assert np.allclose(arc.fundamental, expected.fundamental, rtol=1e-7, atol=1e-7)


def test_many_steps_are_not_needed(system):
    for exponent in (-15, -12, 12, 15):
        assert run(system, 10.0**exponent).steps < 8 * run(system, 1.0).steps


def test_what_is_a_polynomial_at_these_parameters_keeps_its_step():
    # The series of a mode whose drag may be zero is written for any drag.
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, -1.0 - p.drag * x.v**3))],
        transitions=[],
        parameters={"drag": 0.0},
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 100.0))
    assert arc.x[-1] == pytest.approx([1.0 - 5000.0, -100.0], rel=1e-14)
    assert arc.steps < 10
