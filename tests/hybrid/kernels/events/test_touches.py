"""Touches of guards: the same ones are recorded whatever the steps, beside crossings and each other."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate

GUARDS = {
    "affine": lambda t, x, p: x.q,
    "bent": lambda t, x, p: np.sin(x.q),
    "sum": lambda t, x, p: x.q + x.q**3,
}
# Where the guard touches zero, and where it crosses.
PLACES = {
    "touch": ([0.7], []),
    "touch, crossing": ([0.7], [1.31]),
    "crossing, touch": ([1.31], [0.7]),
    "touch, dip": ([0.5], [0.9, 1.4]),
    "two touches": ([0.7, 1.31], []),
    "three touches": ([0.3, 0.8, 1.3], []),
    "crossing between touches": ([0.4, 1.31], [0.83]),
    "touches at ends of steps": ([0.5, 1.0], []),
    "crossing in the middle of touches": ([0.5, 1.5], [1.0]),
}
STEPS = (np.inf, 0.5, 0.25, 0.11, 0.03)
TOLERANCE = 1e-6


@cache
def height(touches, crossings, lead, gap):
    """A polynomial in time that comes as close to zero as ``gap`` tells, and crosses zero."""
    time = np.polynomial.Polynomial([0.0, 1.0])
    product = np.polynomial.Polynomial([lead])
    for place in touches:
        product = product * ((time - place) ** 2 + gap)
    for place in crossings:
        product = product * (time - place)
    return product


def system(guard, motion, direction):
    """The motion, beside a pendulum that makes its flow neither affine nor exact."""
    rate = motion.deriv().coef.tolist()
    return HybridSystem(
        state=("q", "r"),
        modes=[Mode("m", lambda t, x, p: (sum(c * t**k for k, c in enumerate(rate)), -np.sin(x.r)))],
        transitions=[Transition("m", "m", Guard(GUARDS[guard], direction=direction), name="g")],
    )


@cache
def known_system(guard, touches, crossings, lead, direction):
    """One system for all solvers and steps."""
    return system(guard, height(touches, crossings, lead, 1e-8), direction)


def check(guard, touches, crossings, lead, direction, solver):
    motion = height(tuple(touches), tuple(crossings), lead, 1e-8)
    model = known_system(guard, tuple(touches), tuple(crossings), lead, direction)
    arc = simulate(model, (motion(0.0), 0.1), (0.0, 2.0), solver=solver)
    speeds = np.sign(motion.deriv()(np.array(crossings)))
    fired = [place for place, speed in zip(crossings, speeds, strict=True) if direction in (0, speed)]
    assert len(arc.jumps) == len(fired)
    np.testing.assert_allclose(arc.jumps.t, fired, rtol=0, atol=1e-4)
    assert len(arc.grazings) == len(touches)
    np.testing.assert_allclose([touch.t for touch in arc.grazings], touches, rtol=0, atol=1e-4)
    assert all(0.0 < touch.value * motion(touch.t) < TOLERANCE**2 for touch in arc.grazings)


@pytest.mark.parametrize("method", [Taylor, DOP853])
@pytest.mark.parametrize("case", PLACES)
@pytest.mark.parametrize("guard", GUARDS)
def test_the_steps_do_not_matter(guard, case, method):
    touches, crossings = PLACES[case]
    for lead in (0.3, -0.3):
        for direction in (-1, 0, +1):
            for step in STEPS:
                solver = method(rtol=TOLERANCE, atol=TOLERANCE, max_step=step)
                check(guard, touches, crossings, lead, direction, solver)


@pytest.mark.parametrize("method", [Tsit5, RadauIIA])
@pytest.mark.parametrize("case", ["touch", "touch, crossing", "crossing, touch"])
@pytest.mark.parametrize("guard", GUARDS)
def test_nor_do_they_for_methods_of_low_order(guard, case, method):
    touches, crossings = PLACES[case]
    for direction in (-1, 0, +1):
        for step in STEPS:
            solver = method(rtol=TOLERANCE, atol=TOLERANCE, max_step=step)
            check(guard, touches, crossings, 0.3, direction, solver)


@pytest.mark.parametrize("guard", GUARDS)
@pytest.mark.parametrize("method", [Taylor, DOP853])
def test_two_guards_touched_on_one_step_are_both_recorded(method, guard):
    """``q`` is a parabola with its bottom on one guard; the level of the other guard sinks onto it later."""
    bottom = GUARDS[guard]
    model = HybridSystem(
        state=("q", "s", "r"),
        modes=[Mode("m", lambda t, x, p: (2 * (t - 0.4), 2 * (t - 0.9), -np.sin(x.r)))],
        transitions=[
            Transition("m", "m", Guard(lambda t, x, p: x.s - 1e-9, +1), name="late"),
            Transition("m", "m", Guard(bottom, -1), name="early"),
        ],
    )
    for step in STEPS:
        solver = method(rtol=TOLERANCE, atol=TOLERANCE, max_step=step)
        arc = simulate(model, (0.4**2 + 1e-9, 0.9**2 + 2e-9, 0.1), (0.0, 2.0), solver=solver)
        assert len(arc.jumps) == 0
        assert [touch.transition for touch in arc.grazings] == ["early", "late"]
        np.testing.assert_allclose([touch.t for touch in arc.grazings], [0.4, 0.9], rtol=0, atol=1e-6)


@pytest.mark.parametrize("guard", GUARDS)
def test_a_flat_touch_is_one_touch(guard):
    """``q = (t - 1)^4`` stays within rounding of its minimum for a while."""
    motion = np.polynomial.Polynomial([-1.0, 1.0]) ** 4 + 3e-9
    for method in (Taylor, DOP853):
        for step in (np.inf, 0.5, 0.11):
            solver = method(rtol=TOLERANCE, atol=1e-8, max_step=step)
            arc = simulate(system(guard, motion, 0), (motion(0.0), 0.1), (0.0, 2.0), solver=solver)
            assert (len(arc.jumps), len(arc.grazings)) == (0, 1)
            assert arc.grazings[0].t == pytest.approx(1.0, abs=1e-2)
