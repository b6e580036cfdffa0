"""Chatter whose flights fall below the rounding of the time or of their guards ends in its limit."""

import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    simulate,
)

METHODS = [None, Taylor(rtol=1e-12), DOP853(), Tsit5(), RadauIIA()]


def wall(name, slope, vertex, restitution):
    """A wall through a vertex, on which ``y - slope * x`` is constant."""
    size = np.hypot(slope, 1.0)
    nx, ny = -slope / size, 1.0 / size

    def bounce(t, x, p):
        kick = -(1.0 + restitution) * (x.u * nx + x.v * ny)
        return x.x, x.y, x.u + kick * nx, x.v + kick * ny

    def height(t, x, p):
        return (x.y - vertex[1]) - slope * (x.x - vertex[0])

    return Transition("flight", "flight", Guard(height, -1), Reset(bounce), name=name)


def groove(slopes=(2.0, -2.0), vertex=(0.0, 0.0), restitution=0.2):
    return HybridSystem(
        state=("x", "y", "u", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.u, x.v, 0.0, -9.81))],
        transitions=[wall(f"wall {k}", slope, vertex, restitution) for k, slope in enumerate(slopes)],
    )


@pytest.mark.parametrize("solver", METHODS)
def test_a_ball_comes_to_rest_in_a_groove(solver):
    arc = simulate(groove(), (0.02, 1.0, -0.1, 0.0), (0.0, 5.0), solver=solver)
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(0.480131769691, abs=1e-9)
    assert arc.x[-1] == pytest.approx([0.0] * 4, abs=1e-9)


@pytest.mark.parametrize("vertex", [(3.0, 5.0), (-0.5, 0.25)])
def test_a_groove_anywhere(vertex):
    start = (0.02 + vertex[0], 1.0 + vertex[1], -0.1, 0.0)
    arc = simulate(groove(vertex=vertex), start, (0.0, 5.0))
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(0.4801318, abs=1e-6)
    assert arc.x[-1] == pytest.approx([*vertex, 0.0, 0.0], abs=1e-5)


@pytest.mark.parametrize(("slopes", "restitution"), [((1.7, -2.5), 0.15), ((3.0, -3.0), 0.1)])
def test_other_grooves(slopes, restitution):
    arc = simulate(groove(slopes, restitution=restitution), (0.02, 1.0, -0.1, 0.0), (0.0, 5.0))
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.x[-1] == pytest.approx([0.0] * 4, abs=1e-7)


@pytest.mark.parametrize("solver", METHODS)
def test_a_wheel_rocks_to_rest_on_two_spokes(solver):
    """It turns about one spoke and then about the other: each hop begins on the guard of the other."""
    angle, kept = 0.3, 0.8

    def hop(to):
        return Reset(lambda t, x, p: (to, kept * x.w))

    wheel = HybridSystem(
        state=("th", "w"),
        modes=[Mode("rock", lambda t, x, p: (x.w, np.sin(x.th)))],
        transitions=[
            Transition("rock", "rock", Guard(lambda t, x, p: x.th - angle, +1), hop(-angle), name="right"),
            Transition("rock", "rock", Guard(lambda t, x, p: x.th + angle, -1), hop(angle), name="left"),
        ],
    )
    arc = simulate(wheel, (-0.2, 0.0), (0.0, 100.0), solver=solver, max_jumps=1000)
    assert arc.status.code == StatusCode.ACCUMULATION
    assert abs(arc.x[-1]) == pytest.approx([angle, 0.0], abs=1e-10)
    # The sum of the elliptic integrals of all hops.
    assert arc.t[-1] == pytest.approx(7.328729070513390, abs=2e-9)
