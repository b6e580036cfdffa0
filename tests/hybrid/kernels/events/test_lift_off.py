"""Flights that start on a guard without speed or acceleration: the gap is about ``(t - start)**(n + 2)``.

The contact force comes to zero like ``(start - t)**n`` and stays below zero until ``start + back``.
"""

from functools import cache

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

GAPS = {
    "affine": lambda y: y,
    "square": lambda y: y + y * y,
    "sinh": np.sinh,
    "exponential": lambda y: y * np.exp(y),
}
SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}


@cache
def table(gap, order, sign):
    """A body on a table: ``sign`` times the gap grows after the lift-off, and shrinks to zero later."""
    distance = GAPS[gap]

    def pull(t, p):
        return p.strength * (t - p.start) ** order * (p.start + p.back - t)

    return HybridSystem(
        state=("y", "v"),
        parameters={"strength": 1.0, "start": 1.0, "back": 1.0},
        modes=[
            Mode("rest", lambda t, x, p: (0.0 * x.y, 0.0 * x.v)),
            Mode("flight", lambda t, x, p: (x.v, sign * pull(t, p))),
        ],
        transitions=[
            Transition(
                "rest",
                "flight",
                Guard(lambda t, x, p: pull(t, p), +1, when=lambda t, x, p: p.start + 0.5 * p.back - t),
                name="lift",
            ),
            Transition(
                "flight",
                "rest",
                Guard(lambda t, x, p: sign * distance(sign * x.y), -sign),
                Reset(lambda t, x, p: (0.0 * x.y, 0.0 * x.v)),
                name="hit",
            ),
        ],
    )


def time_of_hit(order, start, back):
    s = Polynomial([0.0, 1.0])
    height = (s**order * (back - s)).integ(2)
    return start + min(
        root.real for root in height.roots() if abs(root.imag) < 1e-9 and root.real > 0.5 * back
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("order", [1, 3, 5])
def test_a_body_lifts_off_once_and_lands_where_its_flight_ends(solver, gap, order):
    random = np.random.default_rng(order)
    for start, back, sign in [(0.7, 1.3, 1), (np.pi / 3, 1.0, -1), (1 / 3, 0.5, 1)]:
        parameters = {"strength": 10 ** random.uniform(-1, 0.5), "start": start, "back": back}
        for tangent in (False, True):
            arc = simulate(
                table(gap, order, sign),
                (0.0, 0.0),
                (0.0, start + 2.5 * back),
                mode="rest",
                solver=SOLVERS[solver],
                parameters=parameters,
                tangent=tangent,
            )
            assert arc.status.ok
            assert list(arc.jumps.transition) == ["lift", "hit"]
            # A root of the order n is found to the n-th root of its rounding.
            assert np.isclose(
                arc.jumps.t[0], start, rtol=0, atol=1e-16 ** (1 / order) if order > 1 else 1e-14
            )
            assert np.isclose(arc.jumps.t[1], time_of_hit(order, start, back), rtol=0, atol=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_marker_does_not_fire_where_a_run_starts_on_it(solver, gap, sign):
    for order in (1, 2, 3, 4):
        start = 0.7
        end = time_of_hit(order, start, 1.0)
        arc = simulate(marked(gap, order, sign), (0.0, 0.0), (start, end + 0.1), solver=SOLVERS[solver])
        assert sorted(arc.jumps.transition) == sorted(["any", "down" if sign > 0 else "up"]), order
        assert np.allclose(arc.jumps.t, end, rtol=0, atol=1e-8)


@cache
def marked(gap, order, sign):
    distance = GAPS[gap]
    return HybridSystem(
        state=("y", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, sign * (t - 0.7) ** order * (1.7 - t)))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: distance(x.y), direction), name=name)
            for direction, name in ((1, "up"), (-1, "down"), (0, "any"))
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("gap", GAPS)
def test_a_body_at_rest_on_a_guard_fires_it_when_a_growing_force_takes_it_beyond(solver, gap):
    distance = GAPS[gap]
    system = HybridSystem(
        state=("y", "v", "n"),
        modes=[Mode("pushed", lambda t, x, p: (x.v, t - 0.7, 0.0))],
        transitions=[
            Transition(
                "pushed",
                "pushed",
                Guard(lambda t, x, p: distance(x.y), +1),
                Reset(lambda t, x, p: (x.y, x.v, x.n + 1.0)),
            )
        ],
    )
    arc = simulate(system, (0.0, 0.0, 0.0), (0.7, 2.0), solver=SOLVERS[solver])
    assert arc.status.ok
    assert arc.x[-1, 2] == 1.0
    # The gap is (t - 0.7)**3 / 6, and one within the tolerances is not told from zero by every method.
    assert distance((arc.jumps.t[0] - 0.7) ** 3 / 6) < 1e-10
    assert np.isclose(arc.x[-1, 0], 1.3**3 / 6, rtol=1e-9)


@cache
def cancelling(direction):
    """A force that larger terms leave over, ``w t - sin(w t)``. The gap is positive forever."""
    return HybridSystem(
        state=("y", "v", "n"),
        parameters={"a": 1.0, "w": 1.0},
        modes=[Mode("flight", lambda t, x, p: (x.v, p.a * (p.w * t - np.sin(p.w * t)), 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.y, direction),
                Reset(lambda t, x, p: (x.y, x.v, x.n + 1)),
                name="cross",
            )
        ],
    )


@pytest.mark.parametrize(("direction", "jumps"), [(-1, 0), (0, 0), (1, 1)])
def test_rounding_of_terms_that_cancel_is_no_lift_off(direction, jumps):
    """The first powers of the series are this rounding."""
    random = np.random.default_rng(direction + 1)
    for _ in range(40):
        parameters = {"a": 10 ** random.uniform(-2, 9), "w": 10 ** random.uniform(-1, 1.5)}
        end = 10 ** random.uniform(-3, 0.5) / parameters["w"]
        arc = simulate(
            cancelling(direction),
            (0.0, 0.0, 0.0),
            (0.0, end),
            mode="flight",
            solver=Taylor(atol=10 ** random.uniform(-25, -12)),
            parameters=parameters,
        )
        assert arc.status.ok
        assert arc.jumps.t.tolist() == [0.0] * jumps
