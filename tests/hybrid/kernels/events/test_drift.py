"""A mode that holds a guard at zero does so up to the tolerances; what it has drifted by is no crossing.

A mass on a rope, in Cartesian coordinates: the taut mode keeps the length by its tension. Where the tension
ends, the gap of the slack mode begins to grow like the third power of time, from the drift.
"""

import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

GRAVITY = 9.81


def pull(s):
    """Tension over mass and length."""
    return (s.u**2 + s.v**2 - GRAVITY * s.y) / (s.x**2 + s.y**2)


def jerk(t, s, p):
    rate = (s.x * s.u + s.y * s.v) / (s.x**2 + s.y**2)
    return {"u": s.u - rate * s.x, "v": s.v - rate * s.y}


def rope(sign):
    """The rope; the guard of the slack mode is the length, or its negative."""
    return HybridSystem(
        state=("x", "y", "u", "v"),
        modes=[
            Mode("taut", lambda t, s, p: (s.u, s.v, -pull(s) * s.x, -GRAVITY - pull(s) * s.y)),
            Mode("slack", lambda t, s, p: (s.u, s.v, 0.0, -GRAVITY)),
        ],
        transitions=[
            Transition(
                "taut", "slack", Guard(lambda t, s, p: s.u**2 + s.v**2 - GRAVITY * s.y, -1), name="slacken"
            ),
            Transition(
                "slack",
                "taut",
                Guard(lambda t, s, p: sign * (s.x**2 + s.y**2 - 1.0), sign),
                Reset(jerk),
                name="jerk",
            ),
        ],
    )


ROPES = {sign: rope(sign) for sign in (1, -1)}


def tension(t, y):
    return y[1] ** 2 + GRAVITY * np.cos(y[0])


tension.terminal = True


@functools.cache
def exact(speed):
    """When a swing from the bottom at this speed slackens, and how long it flies (angle and parabola)."""
    swing = solve_ivp(
        lambda t, y: (y[1], -GRAVITY * np.sin(y[0])),
        (0, 2),
        (0, speed),
        rtol=1e-12,
        atol=1e-13,
        events=tension,
    )
    slack, (angle, rate) = swing.t[-1], swing.y[:, -1]
    x = np.polynomial.Polynomial([np.sin(angle), rate * np.cos(angle)])
    y = np.polynomial.Polynomial([-np.cos(angle), rate * np.sin(angle), -0.5 * GRAVITY])
    roots = (x * x + y * y - 1.0).roots()
    return slack, max(root.real for root in roots if abs(root.imag) < 1e-2)


@pytest.mark.parametrize("sign", ROPES)
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("method", [Taylor, DOP853, Tsit5, RadauIIA])
def test_rope_that_goes_slack_flies(method, rtol, sign):
    for speed in (4.6, 5.0, 5.7, 6.5):
        slack, flight = exact(speed)
        solver = method(rtol=rtol, atol=1e-2 * rtol)
        arc = simulate(ROPES[sign], (0.0, -1.0, speed, 0.0), (0.0, slack + 1.2 * flight), solver=solver)
        assert [jump.transition for jump in arc.jumps[:2]] == ["slacken", "jerk"]
        assert arc.jumps[0].t == pytest.approx(slack, abs=2e3 * rtol + 1e-9)
        assert arc.jumps[1].t == pytest.approx(slack + flight, abs=2e3 * rtol + 1e-9)


def test_gap_that_the_tolerances_do_not_explain_is_a_crossing():
    """A jump into a mode whose guard has been passed by more fires it at once."""
    stretched = HybridSystem(
        state=("x", "y", "u", "v"),
        modes=[
            Mode("a", lambda t, s, p: (1.0, 0.0, 0.0, 0.0)),
            Mode("slack", lambda t, s, p: (s.u, s.v, 0.0, 0.0)),
        ],
        transitions=[
            Transition("a", "slack", Guard(lambda t, s, p: s.x - 1.0 - 1e-6, +1)),
            Transition("slack", None, Guard(lambda t, s, p: s.x**2 + s.y**2 - 1.0, +1), name="jerk"),
        ],
    )
    arc = simulate(stretched, (0.0, 0.0, -1.0, 0.0), (0.0, 3.0), mode="a")
    assert [jump.transition for jump in arc.jumps][1:] == ["jerk"]
    assert arc.t[-1] == pytest.approx(1.0 + 1e-6, abs=1e-12)
