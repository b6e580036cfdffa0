"""Events land on the far side: a reset that asks for the quantity of its guard sees the crossing as made."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate
from lyapunov import lyapunov_spectrum

SOLVERS = pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__
)


def turning(guard, direction, reset, rate=lambda t, x, p: (1.3 - 0.2 * x.th,)):
    return HybridSystem(
        state=("th",),
        modes=[Mode("turn", rate)],
        transitions=[Transition("turn", "turn", Guard(guard, direction), Reset(reset))],
    )


def fraction_after(length, start=0.3):
    """Turns and angle left on ``th' = 1.3 - 0.2 th``, wrapped at 1: later turns take ``5 ln(1.3 / 1.1)``."""
    first, period = 5 * np.log((1.3 - 0.2 * start) / 1.1), 5 * np.log(1.3 / 1.1)
    turns = 1 + int((length - first) // period)
    return turns, 6.5 * (1 - np.exp(-0.2 * ((length - first) % period)))


WRAPS = {
    "mod": lambda t, x, p: (np.mod(x.th, 1.0),),
    "floor": lambda t, x, p: (x.th - np.floor(x.th),),
    "comparison": lambda t, x, p: (np.where(x.th > 1.0, x.th - 1.0, x.th),),
    "sign": lambda t, x, p: (x.th - 0.5 - 0.5 * np.sign(x.th - 1.0),),
    "angle": lambda t, x, p: (
        0.5 + np.arctan2(np.sin(2 * np.pi * (x.th - 0.5)), np.cos(2 * np.pi * (x.th - 0.5))) / (2 * np.pi),
    ),
}


@SOLVERS
@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize(
    "guard", [lambda t, x, p: x.th - 1, lambda t, x, p: x.th**2 - 1], ids=["affine", "bent"]
)
def test_an_angle_that_wraps_at_its_own_guard(wrap, guard, solver):
    arc = simulate(turning(guard, +1, WRAPS[wrap]), (0.3,), (0.0, 30.0), solver=solver)
    turns, angle = fraction_after(30.0)
    assert (len(arc.jumps), arc.status.ok) == (turns, True)
    np.testing.assert_allclose(arc.x[-1], angle, atol=1e-4)
    assert np.all(arc.jumps.x_minus > 1.0)
    np.testing.assert_allclose(arc.jumps.x_minus, 1.0, rtol=1e-14)


@SOLVERS
def test_an_angle_that_wraps_on_its_way_down(solver):
    falling = turning(
        lambda t, x, p: x.th, -1, lambda t, x, p: (np.mod(x.th, 1.0),), lambda t, x, p: (-1.3 + 0.0 * x.th,)
    )
    arc = simulate(falling, (0.3,), (0.0, 30.0), solver=solver)
    assert len(arc.jumps) == 39
    np.testing.assert_allclose(arc.x[-1], 0.3, atol=1e-9)


def test_the_exponent_of_a_wrapped_angle():
    """Between wraps orbits approach like ``exp(-t)``; each wrap stretches by ``f_plus / f_minus``."""
    driven = HybridSystem(
        state=("v",),
        modes=[Mode("m", lambda t, x, p: (1.3 - x.v + 0.4 * np.cos(2 * np.pi * t),))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.v - 1, +1), Reset(lambda t, x, p: (np.mod(x.v, 1.0),))
            )
        ],
        period=1.0,
    )
    spectrum = lyapunov_spectrum(driven, (0.3,), intervals=2000)
    assert abs(spectrum.exponents[0] + 0.2766) < 4 * spectrum.standard_error[0]
    assert spectrum.exponents[0] == pytest.approx(spectrum.sum_rule, abs=1e-9)


@SOLVERS
@pytest.mark.parametrize("width", [1.0, 0.5, 0.3, 0.7, 3.0])
@pytest.mark.parametrize("reset", ["count", "read"])
def test_every_step_of_a_staircase_fires(width, reset, solver):
    """The guard jumps from -1.5 to -0.5 where it has just fired: on one side of zero, no crossing."""
    resets = {"count": lambda t, x, p: (x.n + 1,), "read": lambda t, x, p: (np.floor(t / width),)}
    stairs = HybridSystem(
        state=("n",),
        modes=[Mode("hold", lambda t, x, p: (0.0 * x.n,))],
        transitions=[
            Transition(
                "hold",
                "hold",
                Guard(lambda t, x, p: np.floor(t / width) - x.n - 0.5, +1),
                Reset(resets[reset]),
            )
        ],
    )
    arc = simulate(stairs, (0.0,), (0.0, 10.25 * width), mode="hold", solver=solver)
    assert len(arc.jumps) == 10
    assert arc.x[-1, 0] == 10.0
    np.testing.assert_allclose(arc.jumps.t, width * np.arange(1, 11), rtol=1e-14)


def rescaled(k, turn):
    """An oscillator whose second mode measures the state in units of ``1 / k``, with the sign ``turn``."""
    return HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("metres", lambda t, x, p: (x.v, -x.q + np.cos(t))),
            Mode("other", lambda t, x, p: (x.v, -4 * x.q + turn * k * np.cos(t))),
        ],
        transitions=[
            Transition(
                "metres",
                "other",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (turn * k * x.q, 0.9 * turn * k * x.v)),
            ),
            Transition(
                "other",
                "metres",
                Guard(lambda t, x, p: turn * x.q, +1),
                Reset(lambda t, x, p: (turn * x.q / k, turn * x.v / k)),
            ),
        ],
    )


@SOLVERS
@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("k", [1e-3, 1.0, 100.0, 1000.0, 1e6])
def test_a_mode_may_measure_its_state_in_other_units(k, turn, solver):
    arc = simulate(rescaled(k, turn), (0.3, 0.1), (0.0, 40.0), mode="metres", solver=solver)
    assert (len(arc.jumps), arc.status.ok) == (12, True)
    np.testing.assert_allclose(arc.x[-1], (0.46906, -0.99981), atol=2e-4)


@SOLVERS
@pytest.mark.parametrize("k", [1.0, 1e6, 1e-6])
def test_a_bounce_into_other_units_stays_on_its_side(k, solver):
    """The rounding of a landing grows with the unit: what is on the guard stays on it."""
    bounce = lambda factor: Reset(lambda t, x, p: (factor * x.q, -0.9 * factor * x.v))  # noqa: E731
    ball = HybridSystem(
        state=("q", "v"),
        modes=[Mode("a", lambda t, x, p: (x.v, -9.81)), Mode("b", lambda t, x, p: (x.v, -9.81 * k))],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.q, -1), bounce(k)),
            Transition("b", "a", Guard(lambda t, x, p: x.q, -1), bounce(1 / k)),
        ],
    )
    arc = simulate(ball, (1.0, 0.0), (0.0, 5.0), mode="a", solver=solver)
    first = np.sqrt(2 / 9.81)
    times = first * (1 + 2 * np.cumsum(0.9 ** np.arange(1, 40)))
    expected = np.concatenate([[first], times[times < 5.0]])
    assert len(arc.jumps) == len(expected)
    np.testing.assert_allclose(arc.jumps.t, expected, rtol=1e-7)


@SOLVERS
@pytest.mark.parametrize("length", [2.0, 0.3, np.pi / 4])
def test_a_force_that_jumps_in_guard_and_field(length, solver):
    """A mass is pushed from wall to wall: it leaves one when the force turns, and hits the other once."""

    def force(t):
        return np.where(np.mod(t, 2 * length) > length, 5.0, -5.0)

    pusher = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("move", lambda t, x, p: (x.v, p.a * force(t) - x.q - 0.2 * x.v)),
            Mode("low", lambda t, x, p: (0.0, 0.0)),
            Mode("high", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("move", "low", Guard(lambda t, x, p: x.q + 3, -1), Reset(lambda t, x, p: (-3.0, 0.0))),
            Transition("move", "high", Guard(lambda t, x, p: x.q - 3, +1), Reset(lambda t, x, p: (3.0, 0.0))),
            Transition("low", "move", Guard(lambda t, x, p: force(t) + 3, +1)),
            Transition("high", "move", Guard(lambda t, x, p: force(t) - 3, -1)),
        ],
        parameters={"a": max(1.0, 6.0 / length**2)},
    )
    arc = simulate(pusher, (1.0, 1.0), (0.0, 60 * length), mode="move", solver=solver)
    walls = [jump.target for jump in arc.jumps if jump.source == "move"]
    assert walls == ["low", "high"] * 30


@SOLVERS
def test_guards_that_are_reached_together_are_all_crossed(solver):
    """The first reset reads the quantity of the second guard, which is crossed at the same instant."""
    pair = HybridSystem(
        state=("a", "b", "seen"),
        modes=[Mode("m", lambda t, x, p: (1.1, 0.7, 0.0))],
        transitions=[
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: x.a - 1.1, +1),
                Reset(lambda t, x, p: (x.a - 1.1, x.b, np.floor(x.b / 0.7))),
                name="first",
            ),
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: x.b - 0.7, +1),
                Reset(lambda t, x, p: (x.a, x.b - 0.7, x.seen)),
                name="second",
            ),
        ],
    )
    arc = simulate(pair, (0.0, 0.0, 0.0), (0.0, 1.5), solver=solver)
    assert len(arc.jumps) == 2
    assert arc.x[-1, 2] == 1.0
