"""Many jumps at one instant: a light ball that a heavy one presses to the floor, or hits elastically."""

from functools import cache

import numpy as np
import pytest

from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    Reset,
    StatusCode,
    Transition,
    simulate,
)


def collide(i, count):
    """The collision of the balls ``i`` and ``i + 1``, with the restitution ``e`` of parameter ``i + 1``."""

    def reset(t, x, p):
        m, M, e = p[i], p[i + 1], p[count + i + 1]
        v, w = x[count + i], x[count + i + 1]
        common, apart = (m * v + M * w) / (m + M), e * (v - w)
        after = list(x)
        after[i + 1] = x[i]
        after[count + i] = common - M / (m + M) * apart
        after[count + i + 1] = common + m / (m + M) * apart
        return tuple(after)

    return reset


def land(count):
    def reset(t, x, p):
        return (0.0, *x[1:count], -p[count] * x[count], *x[count + 1 :])

    return reset


@cache
def column(count, at_rest=False):
    """Balls above each other on a floor: heights, then speeds; ``p`` has masses, then restitutions."""

    def between(i):
        return lambda t, x, p: x[i + 1] - x[i]

    names = [f"{letter}{i}" for letter in "me" for i in range(count)]
    return HybridSystem(
        state=2 * count,
        parameters=dict.fromkeys(names, 1.0),
        modes=[
            Mode("fly", lambda t, x, p: (*x[count:], *[-1.0] * count)),
            *([Mode("rest", lambda t, x, p: (0.0,) * (2 * count))] if at_rest else []),
        ],
        transitions=[
            Transition(
                "fly",
                "fly",
                Guard(lambda t, x, p: x[0], -1),
                Reset(land(count)),
                name="floor",
                accumulates_to="rest" if at_rest else None,
            ),
            *(
                Transition("fly", "fly", Guard(between(i), -1), Reset(collide(i, count)), name=f"hit {i}")
                for i in range(count - 1)
            ),
        ],
    )


def run(m, e, q, v, t1, solver=None, at_rest=False):
    count = len(m)
    parameters = {f"m{i}": m[i] for i in range(count)} | {f"e{i}": e[i] for i in range(count)}
    mode = "fly" if at_rest else None
    return simulate(
        column(count, at_rest), (*q, *v), (0.0, t1), parameters=parameters, solver=solver, mode=mode
    )


def test_pressed_to_the_floor():
    """All speed is lost in no time, but in more rounds than are followed at one instant."""
    arc = run((1.0, 1e6), (0.5, 0.8), (0.1, 0.2), (0.0, -1.0), 5.0)
    assert arc.status.code == StatusCode.STUCK
    assert "repeat endlessly" in arc.status.message
    assert arc.t[-1] < 5.0


@pytest.mark.parametrize(("ratio", "limit"), [(1e3, 0.183425490426022), (1e4, 0.1832368289832754)])
def test_pressed_to_the_floor_by_less(ratio, limit):
    """The limit of flights that are followed one by one."""
    arc = run((1.0, ratio), (0.5, 0.8), (0.1, 0.2), (0.0, -1.0), 5.0)
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(limit, rel=1e-14)
    np.testing.assert_allclose(arc.x[-1], 0.0, rtol=0, atol=1e-5)


@pytest.mark.parametrize("ratio", [10.0, 100.0, 1e3, 1e4, 3e4])
@pytest.mark.parametrize("loss", [0.0, 1e-6, 1e-3])
def test_speeds_that_turn_have_no_limit(ratio, loss):
    """A light ball on the floor that a heavy one hits elastically throws it up again, after many hits."""
    v, w, e = 0.0, -1.0, 1.0 - loss
    while v < 0.0 or v > w:
        reset = land(2) if v < 0.0 else collide(0, 2)
        v, w = reset(0.0, (0.0, 0.0, v, w), (1.0, ratio, e, e))[2:]
    arc = run((1.0, ratio), (e, e), (0.0, 0.0), (0.0, -1.0), 0.01)
    assert arc.status.ok
    np.testing.assert_allclose(arc.jumps[-1].x_plus[2:], [v, w], rtol=1e-11)


def test_a_restitution_that_depends_on_the_speed_is_not_followed():
    """Rounds that are not affine are said to be endless."""
    system = column(2)
    hit = Transition(
        "fly",
        "fly",
        Guard(lambda t, x, p: x[1] - x[0], -1),
        Reset(
            lambda t, x, p: (
                x[0],
                x[0],
                x[2] - (1.0 + 0.5 / (1.0 + (x[2] - x[3]) ** 2)) * (x[2] - x[3]) / (1.0 + 1e-5),
                x[3] + 1e-5 * (1.0 + 0.5 / (1.0 + (x[2] - x[3]) ** 2)) * (x[2] - x[3]) / (1.0 + 1e-5),
            )
        ),
    )
    bent = HybridSystem(
        state=4, parameters=system.parameters, modes=system.modes, transitions=[system.transitions[0], hit]
    )
    parameters = {"m0": 1.0, "m1": 1e5, "e0": 0.5}
    arc = simulate(bent, (0.1, 1.0, 0.0, -1.0), (0.0, 5.0), parameters=parameters)
    assert arc.status.code == StatusCode.STUCK
