"""Counters of impacts: the limit of a chatter leaves them at their last value, and the status says so."""

import math

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate

PULL = 10.0
RESTITUTIONS = (0.05, 0.3, 0.6, 0.8, 0.93)


def impact_speed(x0):
    return math.sqrt(x0[1] ** 2 + 2 * PULL * x0[0])


def end_of_chatter(e, x0=(1.0, 0.0)):
    impact = impact_speed(x0)
    return (impact + x0[1]) / PULL + 2 * e * impact / (PULL * (1 - e))


def ball(extra, *, rate=0.0, place=2, rest=True, when=None, transitions=(), pull=None, restitution=None):
    """A ball with one component more, at a ``place`` in the state; ``extra(v, n, p)`` is its reset."""

    def ordered(q, v, n):
        others = [q, v]
        others.insert(place, n)
        return tuple(others)

    def flight(t, x, p):
        return ordered(x.v, -PULL if pull is None else pull(x), rate)

    def hit(t, x, p):
        e = p.e if restitution is None else restitution(x, p)
        return ordered(0.0, -e * x.v, extra(x.v, x.n, p))

    modes = [Mode("flight", flight)]
    if rest:
        modes.append(Mode("rest", lambda t, x, p: ordered(0.0, 0.0, rate)))
    return HybridSystem(
        state=ordered("q", "v", "n"),
        parameters={"e": 0.8, "c": 1.0},
        modes=modes,
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1, when=when),
                Reset(hit),
                name="hit",
                accumulates_to="rest" if rest else None,
            ),
            *transitions,
        ],
    )


def start(place=2, n=0.0, q=1.0):
    others = [q, 0.0]
    others.insert(place, n)
    return tuple(others)


def limits(arc):
    return [jump for jump in arc.jumps if jump.kind == "limit"]


@pytest.mark.parametrize("solver", [None, DOP853(rtol=1e-10, atol=1e-12)], ids=["default", "DOP853"])
@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("e", RESTITUTIONS)
def test_a_counter_does_not_change_the_limit(e, place, solver):
    system, plain = ball(lambda v, n, p: n + p.c, place=place), ball(lambda v, n, p: n, place=place)
    options = {"mode": "flight", "solver": solver}
    for step in (1.0, 0.125, -2.0):
        given = {"parameters": {"e": e, "c": step}}
        arc = simulate(system, start(place), (0.0, 40.0), **options, **given)
        same = simulate(plain, start(place), (0.0, 40.0), **options, **given)
        assert arc.status.ok
        assert len(arc.jumps) == len(same.jumps)
        assert limits(arc)[0].t == pytest.approx(end_of_chatter(e), rel=1e-11)
        assert arc["n"][-1] == pytest.approx(step * (len(arc.jumps) - 1), rel=1e-14)
        assert "changes 'n'" in arc.status.message
        assert "'n'" not in same.status.message


def test_without_a_mode_for_the_limit_the_status_names_the_counter_too():
    arc = simulate(ball(lambda v, n, p: n + 1, rest=False), start(), (0.0, 10.0))
    assert arc.status.code == StatusCode.ACCUMULATION
    assert "changes 'n'" in arc.status.message
    assert len(arc.jumps) == 18


@pytest.mark.parametrize("first", [1e8, -3.0])
def test_a_counter_that_starts_anywhere_and_drifts(first):
    arc = simulate(ball(lambda v, n, p: n + 1, rate=0.5), start(n=first), (0.0, 10.0), mode="flight")
    assert arc["n"][-1] == pytest.approx(first + 5.0 + len(arc.jumps) - 1, rel=1e-14)


@pytest.mark.parametrize("e", RESTITUTIONS)
@pytest.mark.parametrize("power", [1.0, 1.5, 2.0])
def test_sums_that_converge_are_carried_to_their_limit(e, power):
    arc = simulate(
        ball(lambda v, n, p: n + np.abs(v) ** power), start(), (0.0, 40.0), mode="flight", parameters={"e": e}
    )
    exact = impact_speed((1.0, 0.0)) ** power / (1 - e**power)
    assert arc.status.message == "Reached the end."
    assert arc["n"][-1] == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("extra", [lambda v, n, p: n + 1 + v**2, lambda v, n, p: -n, lambda v, n, p: 1.1 * n])
def test_other_components_without_a_limit(extra):
    arc = simulate(ball(extra), start(n=1.0), (0.0, 40.0), mode="flight")
    assert arc.status.ok
    assert "changes 'n'" in arc.status.message
    assert limits(arc)[0].t == pytest.approx(end_of_chatter(0.8), rel=1e-11)
    expected = 1.0
    for jump in arc.jumps[:-1]:
        expected = extra(jump.x_minus[1], expected, None)
    assert arc["n"][-1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("e", [0.3, 0.8])
def test_tangent_vectors_of_a_counter(e):
    """The number of jumps does not depend on the start, nor does anything on the counter."""
    system = ball(lambda v, n, p: n + p.c, rate=0.5)
    arc = simulate(system, start(q=0.7), (0.0, 9.0), mode="flight", parameters={"e": e}, tangent=True)
    assert arc.status.ok
    np.testing.assert_allclose(arc.fundamental, np.diag([0.0, 0.0, 1.0]), rtol=0, atol=1e-9)


class TestDependence:
    """Where something depends on the counter, jumps are followed one by one."""

    def test_a_guard_that_waits_for_the_counter(self):
        for most in (20, 29, 40):
            stop = Transition("flight", None, Guard(lambda t, x, p, m=most: x.n - m + 0.5, +1), name="stop")
            arc = simulate(
                ball(lambda v, n, p: n + 1, transitions=[stop]), start(), (0.0, 9.0), mode="flight"
            )
            assert arc.status.code == StatusCode.TERMINAL
            assert arc["n"][-1] == most

    def test_a_condition(self):
        system = ball(lambda v, n, p: n + 1, when=lambda t, x, p: x.n < 30)
        arc = simulate(system, start(), (0.0, 6.0), mode="flight")
        assert len(arc.jumps) == 30
        assert arc["q"][-1] < -1.0

    def test_the_restitution(self):
        """0.8 up to the 25th impact, 0.5 from then on."""
        system = ball(lambda v, n, p: n + 1, restitution=lambda x, p: np.where(x.n < 25, 0.8, 0.5))
        arc = simulate(system, start(), (0.0, 9.0), mode="flight")
        speed = impact_speed((1.0, 0.0))
        t = speed / PULL
        for k in range(200):
            speed *= 0.8 if k < 25 else 0.5
            t += 2 * speed / PULL
        assert limits(arc)[0].t == pytest.approx(t, rel=1e-12)

    def test_the_pull(self):
        """It grows with each impact, so flights shorten by no steady ratio: the ball comes to rest."""
        system = ball(lambda v, n, p: n + 1, pull=lambda x: -PULL - x.n)
        arc = simulate(system, start(), (0.0, 9.0), mode="flight")
        speed = impact_speed((1.0, 0.0))
        t = speed / PULL
        for k in range(1, 400):
            speed *= 0.8
            t += 2 * speed / (PULL + k)
        assert limits(arc)[0].t == pytest.approx(t, rel=1e-12)


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("rate", [0.0, 0.3])
def test_two_transitions_in_turn(both, rate):
    def flight(t, x, p):
        return (x.v, -PULL, rate)

    system = HybridSystem(
        state=("q", "v", "n"),
        modes=[Mode("a", flight), Mode("b", flight), Mode("rest", lambda t, x, p: (0.0, 0.0, rate))],
        transitions=[
            Transition(
                "a",
                "b",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -0.5 * x.v, x.n + 1)),
                accumulates_to="rest",
            ),
            Transition(
                "b",
                "a",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -0.8 * x.v, x.n + (1 if both else 0))),
            ),
        ],
    )
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 9.0), mode="a")
    fall = math.sqrt(2 / PULL)
    limit = fall + 2 * fall * 0.5 * 1.8 / (1 - 0.4)
    assert arc.status.ok
    assert "changes 'n'" in arc.status.message
    assert limits(arc)[0].t == pytest.approx(limit, rel=1e-9)
    jumps = len(arc.jumps) - 1
    assert arc["n"][-1] == pytest.approx(9.0 * rate + (jumps if both else (jumps + 1) // 2), rel=1e-9)


@pytest.mark.parametrize("e", [0.2, 0.5, 0.8])
def test_two_balls_on_a_floor(e):
    """They fall on each other and on the floor, in any order; each counts its impacts."""

    def meet(t, x, p):
        relative = (1 + p.e) * (x.w - x.v)
        return (x.q, x.v + relative * p.m / (1 + p.m), x.r, x.w - relative / (1 + p.m), x.k, x.n + 1)

    system = HybridSystem(
        state=("q", "v", "r", "w", "k", "n"),
        parameters={"e": e, "m": 0.7},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -PULL, x.w, -PULL, 0.0, 0.0)),
            Mode("rest", lambda t, x, p: (0.0,) * 6),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v, x.r, x.w, x.k + 1, x.n)),
                name="floor",
                accumulates_to="rest",
            ),
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.r - x.q, -1),
                Reset(meet),
                name="meet",
                accumulates_to="rest",
            ),
        ],
    )
    for m in (0.5, 1.0, 30.0):
        arc = simulate(
            system, (0.5, 0.0, 0.9, 0.0, 0.0, 0.0), (0.0, 60.0), mode="flight", parameters={"m": m}
        )
        assert arc.status.ok
        assert arc.mode[-1] == "rest"
        fired = [jump.transition for jump in arc.jumps if jump.kind != "limit"]
        assert arc["k"][-1] == fired.count("floor")
        assert arc["n"][-1] == fired.count("meet")
