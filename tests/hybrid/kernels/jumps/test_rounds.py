"""Jumps of alternating transitions that accumulate: their limit, and runs without a limit."""

import math
from functools import cache

import attrs
import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate

SOLVERS = (Taylor(), DOP853(rtol=1e-12, atol=1e-14))
FALL = math.sqrt(2 / 9.81)


def height(t, x, p):
    return x.q


@cache
def two_flights(names_limit=True, direction=-1):
    """A ball whose impacts lead from one flight mode to the other, with one restitution per mode."""
    return HybridSystem(
        state=("q", "v", "s"),
        parameters={"one": 0.5, "two": 0.8},
        modes=[
            Mode("first", lambda t, x, p: (x.v, -9.81, 1.0)),
            Mode("second", lambda t, x, p: (x.v, -9.81, 1.0)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, 2.0)),
        ],
        transitions=[
            Transition(
                "first",
                "second",
                Guard(height, direction),
                Reset(lambda t, x, p: (0.0, -p.one * x.v, x.s)),
                accumulates_to="rest" if names_limit else None,
            ),
            Transition(
                "second", "first", Guard(height, direction), Reset(lambda t, x, p: (0.0, -p.two * x.v, x.s))
            ),
            *([] if names_limit else [Transition("rest", "first", Guard(height, +1))]),
        ],
    )


def time_of_two(one, two):
    """``v0 / g + 2 v0 / g (one + one two + one^2 two + ...)``."""
    return FALL + 2 * FALL * one * (1 + two) / (1 - one * two)


class TestTwoFlights:
    @pytest.mark.parametrize("solver", SOLVERS)
    @pytest.mark.parametrize(("one", "two"), [(0.5, 0.8), (0.2, 0.3), (1.3, 0.5), (0.95, 0.9), (0.05, 1.0)])
    def test_limit(self, one, two, solver):
        limit = time_of_two(one, two)
        arc = simulate(
            two_flights(),
            (1.0, 0.0, 0.0),
            (0.0, limit + 1.0),
            mode="first",
            solver=solver,
            parameters={"one": one, "two": two},
        )
        assert arc.status.ok
        last = arc.jumps[-1]
        assert (last.kind, last.source, last.target) == ("limit", "first", "rest")
        assert last.t == pytest.approx(limit, rel=2e-10)
        np.testing.assert_allclose(last.x_plus, [0.0, 0.0, limit], atol=1e-9)
        np.testing.assert_allclose(arc.x[-1], [0.0, 0.0, limit + 2.0], atol=1e-9)

    def test_without_a_mode_for_the_limit_the_status_names_both(self):
        arc = simulate(two_flights(False), (1.0, 0.0, 0.0), (0.0, 9.0), mode="first")
        assert arc.status.code == StatusCode.ACCUMULATION
        assert arc.t[-1] == pytest.approx(time_of_two(0.5, 0.8), rel=2e-10)
        assert "'first->second'" in arc.status.message
        assert "'second->first'" in arc.status.message
        assert "in turn" in arc.status.message

    def test_a_run_that_ends_before_is_not_taken_there(self):
        arc = simulate(two_flights(), (1.0, 0.0, 0.0), (0.0, 0.999 * time_of_two(0.5, 0.8)), mode="first")
        assert arc.status.ok
        assert not any(jump.kind == "limit" for jump in arc.jumps)

    def test_tangent_vectors_are_said_to_be_lost(self):
        arc = simulate(two_flights(), (1.0, 0.0, 0.0), (0.0, 9.0), mode="first", tangent=True)
        assert arc.status.code == StatusCode.SINGULAR_SALTATION
        assert "accumulate in turn" in arc.status.message
        assert np.isnan(arc.fundamental).all()

    def test_elastic_in_the_mean_there_is_no_limit(self):
        arc = simulate(
            two_flights(), (1.0, 0.0, 0.0), (0.0, 60.0), mode="first", parameters={"one": 1.25, "two": 0.8}
        )
        assert arc.status.ok
        assert not any(jump.kind == "limit" for jump in arc.jumps)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(("a", "b"), [(3.0, 1.0), (3.0, 2.5), (1.0, 0.1)])
def test_twisting(a, b, solver):
    """``x'' = -a sign(x) - b sign(x')``: speeds at ``x = 0`` shrink by ``sqrt((a-b)/(a+b))``."""

    def quadrant(name, x, v):
        return Mode(name, lambda t, state, p: (state.v, -a * x - b * v))

    system = HybridSystem(
        state=("x", "v"),
        modes=[
            quadrant("++", 1, 1),
            quadrant("+-", 1, -1),
            quadrant("--", -1, -1),
            quadrant("-+", -1, 1),
            Mode("there", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("++", "+-", Guard(lambda t, x, p: x.v, -1)),
            Transition("+-", "--", Guard(lambda t, x, p: x.x, -1)),
            Transition("--", "-+", Guard(lambda t, x, p: x.v, +1), accumulates_to="there"),
            Transition("-+", "++", Guard(lambda t, x, p: x.x, +1)),
        ],
    )
    ratio, v = math.sqrt((a - b) / (a + b)), 2.0
    limit = v * (1 / (a + b) + ratio / (a - b)) / (1 - ratio)
    arc = simulate(system, (0.0, v), (0.0, limit + 1), mode="++", solver=solver)
    assert arc.status.ok
    assert arc.jumps[-1].kind == "limit"
    assert arc.jumps[-1].t == pytest.approx(limit, rel=1e-9)
    np.testing.assert_allclose(arc.x[-1], [0.0, 0.0], atol=1e-9)


def test_flights_that_a_reset_halves():
    """The reset leaves the guard, but the heights from which ``q`` falls still sum to ``1 + 2 h``."""
    system = HybridSystem(
        state=("q", "h"),
        modes=[Mode("fall", lambda t, x, p: (-1.0, 0.0)), Mode("down", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "fall",
                "fall",
                Guard(height, -1),
                Reset(lambda t, x, p: (x.h, 0.5 * x.h)),
                accumulates_to="down",
            )
        ],
    )
    arc = simulate(system, (1.0, 0.75), (0.0, 5.0), mode="fall")
    assert arc.status.ok
    assert arc.jumps[-1].t == pytest.approx(2.5, rel=1e-10)
    assert arc.mode[-1] == "down"


@pytest.mark.parametrize("e", [0.05, 0.5, 0.9])
def test_a_guard_that_fires_both_ways_chatters_too(e):
    system = HybridSystem(
        state=("q", "v"),
        parameters={"e": 0.5},
        modes=[Mode("flight", lambda t, x, p: (x.v, -9.81))],
        transitions=[Transition("flight", "flight", Guard(height), Reset(lambda t, x, p: (0.0, -p.e * x.v)))],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 20.0), parameters={"e": e})
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.t[-1] == pytest.approx(FALL * (1 + e) / (1 - e), rel=1e-11)


class TestNoLimit:
    @pytest.mark.parametrize("r", [1e-2, 1e-4, 1e-5, 1e-7, 1e-10, 0.0])
    def test_a_reset_that_leaves_the_guard(self, r):
        """A reset takes the spiral back at each turn; after the first turn all turns are the same."""
        system = spiral()
        arc = simulate(system, (0.5, 0.0), (0.0, 60.0), parameters={"r": r})
        assert arc.status.ok
        assert not any(jump.kind == "limit" for jump in arc.jumps)
        gaps = np.diff(arc.jumps.t)
        assert len(gaps) > 5
        np.testing.assert_allclose(gaps[1:], gaps[1], rtol=1e-8)

    def test_at_rest_on_a_guard_that_nothing_pushes_it_through(self):
        system = HybridSystem(
            state=("y", "v", "n"),
            modes=[Mode("go", lambda t, x, p: (x.v, 0.0, 0.0))],
            transitions=[
                Transition(
                    "go", "go", Guard(lambda t, x, p: x.y - 1, +1), Reset(lambda t, x, p: (x.y, 0.0, x.n + 1))
                )
            ],
        )
        arc = simulate(system, (0.0, 1.0, 0.0), (0.0, 5.0), mode="go")
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1], [1.0, 0.0, 1.0], atol=1e-14)

    def test_pushed_through_a_guard_by_a_reset_that_keeps_the_speed(self):
        """``x = -t^2`` from rest on the guard: the event counts once and the motion continues."""
        system = HybridSystem(
            state=("x", "n"),
            modes=[Mode("run", lambda t, x, p: (-2 * t, 0.0))],
            transitions=[
                Transition(
                    "run", "run", Guard(lambda t, x, p: x.x, -1), Reset(lambda t, x, p: (x.x, x.n + 1))
                )
            ],
        )
        arc = simulate(system, (0.0, 0.0), (0.0, 2.0), mode="run")
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1], [-4.0, 1.0], atol=1e-12)

    def test_pushed_against_the_guard_it_rests_on(self):
        system = HybridSystem(
            state=("q", "v"),
            modes=[Mode("flight", lambda t, x, p: (x.v, -9.81))],
            transitions=[
                Transition(
                    "flight", "flight", Guard(height, -1), Reset(lambda t, x, p: (0.0, 0.0)), name="stop"
                )
            ],
        )
        arc = simulate(system, (1.0, 0.0), (0.0, 5.0))
        assert arc.status.code == StatusCode.ACCUMULATION
        assert "rests on its guard" in arc.status.message
        assert "pushes it through the guard" in arc.status.message


@cache
def spiral():
    return HybridSystem(
        state=("x", "y"),
        parameters={"r": 0.0},
        modes=[Mode("turn", lambda t, x, p: (x.y, -x.x + 0.1 * x.y))],
        transitions=[
            Transition(
                "turn", "turn", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (-1.0, -p.r))
            )
        ],
    )


def test_a_limit_across_forcing_periods():
    """A declared period changes no limit, however many periods the jumps take."""
    system = two_flights()
    forced = attrs.evolve(system, period=lambda p: 0.05)
    for each in (system, forced):
        arc = simulate(each, (1.0, 0.0, 0.0), (0.0, 4.0), mode="first")
        assert arc.jumps[-1].kind == "limit"
        assert arc.jumps[-1].t == pytest.approx(time_of_two(0.5, 0.8), rel=2e-10)
        # The flights that were left out are one straight line to the limit.
        before, limit = arc.jumps[-2], arc.jumps[-1]
        middle = arc(0.5 * (before.t + limit.t))
        np.testing.assert_allclose(middle, 0.5 * (before.x_plus + limit.x_plus), rtol=1e-9, atol=1e-15)
