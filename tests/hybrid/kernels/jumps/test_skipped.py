"""Limits of chatter: other guards that are crossed before them, and chatter without a steady ratio."""

import math
from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853()}
METHODS = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
# The limit of a ball's bounces that falls from 1, with g = 9.81 and e = 0.8.
LIMIT = math.sqrt(2 / 9.81) * 1.8 / 0.2


def column(*names_limit):
    """Two balls above each other on a floor; ``p.m`` is the mass of the upper one, that of the lower is 1."""

    def collide(t, x, p):
        common, apart = (x.v + p.m * x.w) / (1.0 + p.m), p.e * (x.v - x.w)
        return x.q, x.q, common - p.m / (1.0 + p.m) * apart, common + apart / (1.0 + p.m)

    return HybridSystem(
        state=("q", "s", "v", "w"),
        parameters={"m": 1.0, "e": 0.5, "f": 0.5},
        modes=[
            Mode("fly", lambda t, x, p: (x.v, x.w, -1.0, -1.0)),
            *([Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0, 0.0))] if names_limit else []),
        ],
        transitions=[
            Transition(
                "fly",
                "fly",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, x.s, -p.f * x.v, x.w)),
                accumulates_to="rest" if "floor" in names_limit else None,
                name="floor",
            ),
            Transition(
                "fly",
                "fly",
                Guard(lambda t, x, p: x.s - x.q, -1),
                Reset(collide),
                accumulates_to="rest" if "hit" in names_limit else None,
                name="hit",
            ),
        ],
    )


COLUMN = column()


def exact_limit(m, e, f, start):
    """When the jumps of a column accumulate, flight by flight in closed form."""
    q, s, v, w = start
    t, longest = 0.0, [1.0] * 30
    while max(longest[-30:]) > 1e-17:
        landing = v + math.sqrt(v * v + 2.0 * q)
        collision = (s - q) / (v - w) if v > w else math.inf
        span = min(landing, collision)
        t += span
        longest.append(span)
        q, s = q + span * (v - 0.5 * span), s + span * (w - 0.5 * span)
        v, w = v - span, w - span
        if span == landing:
            q, v = 0.0, -f * v
        else:
            common, apart = (v + m * w) / (1.0 + m), e * (v - w)
            s, v, w = q, common - m / (1.0 + m) * apart, common + apart / (1.0 + m)
    return t


def columns(count):
    rng = np.random.default_rng(2)
    for _ in range(count):
        m, e, f = np.exp(rng.uniform(-2, 2)), *rng.uniform(0.05, 0.95, 2)
        q, gap = rng.uniform(0, 1), rng.uniform(0.01, 1)
        yield float(m), float(e), float(f), tuple(map(float, (q, q + gap, *rng.uniform(-1, 1, 2))))


class TestBallsInVaryingOrder:
    @METHODS
    def test_random_columns(self, solver):
        for m, e, f, start in columns(60):
            limit = exact_limit(m, e, f, start)
            # Where order and shape of the flights vary without end, rounding decides about the limit.
            moved = [exact_limit(m, e, f, [s * (1 + d) for s in start]) for d in (1e-13, -1e-13, 3e-13)]
            unsure = max(abs(other - limit) for other in moved)
            arc = simulate(COLUMN, start, (0.0, 1e3), solver=solver, parameters={"m": m, "e": e, "f": f})
            assert arc.status.code == StatusCode.ACCUMULATION, (m, e, f, start)
            assert abs(arc.t[-1] - limit) <= 1e-8 * limit + 1e4 * unsure, (m, e, f, start)
            assert arc.x[-1, 0] >= -1e-12
            assert arc.x[-1, 1] >= arc.x[-1, 0] - 1e-12

    @pytest.mark.parametrize("names", [("floor",), ("hit",), ("floor", "hit")])
    def test_the_run_goes_on_in_the_mode_of_the_limit(self, names):
        m, e, f, start = 1.4503, 0.2919, 0.8311, (0.509, 1.025, 0.506, -0.704)
        arc = simulate(column(*names), start, (0.0, 5.0), mode="fly", parameters={"m": m, "e": e, "f": f})
        assert arc.status.ok
        assert arc.mode[-1] == "rest"
        assert np.isclose(arc.jumps[-1].t, exact_limit(m, e, f, start), rtol=1e-12)
        assert np.allclose(arc.x[-1], 0.0, atol=1e-14)

    def test_the_message_names_both_and_claims_no_ratio(self):
        m, e, f, start = 1.4503, 0.2919, 0.8311, (0.509, 1.025, 0.506, -0.704)
        arc = simulate(COLUMN, start, (0.0, 5.0), parameters={"m": m, "e": e, "f": f})
        assert "'floor'" in arc.status.message
        assert "'hit'" in arc.status.message


@cache
def ball_and(guard, direction):
    """A bouncing ball, and a counter with another guard."""
    return HybridSystem(
        state=("q", "v", "z", "n"),
        parameters={"at": 1.0},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -9.81, 1.0, 0.0)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, 1.0, 0.0)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -0.8 * x.v, x.z, x.n)),
                accumulates_to="rest",
                name="bounce",
            ),
            Transition(
                "flight",
                "flight",
                Guard(guard, direction),
                Reset(lambda t, x, p: (x.q, x.v, x.z, x.n + 1.0)),
                name="count",
            ),
        ],
    )


OTHERS = {
    "a time": (lambda t, x, p: t - p.at, +1),
    "a state": (lambda t, x, p: p.at - x.z, -1),
    "bent": (lambda t, x, p: np.sin(x.z - p.at), +1),
    "a spike": (lambda t, x, p: np.exp(-(((x.z - p.at) / 1e-6) ** 2)) - 0.5, +1),
}


class TestAnotherGuardBeforeTheLimit:
    @METHODS
    @pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
    def test_it_fires(self, other, solver):
        for before in 10.0 ** -np.arange(2.0, 9.0):
            at = LIMIT - before
            system = ball_and(*other)
            arc = simulate(
                system, (1.0, 0.0, 0.0, 0.0), (0.0, 5.0), mode="flight", parameters={"at": at}, solver=solver
            )
            counted = [jump.t for jump in arc.jumps if jump.transition == "count"]
            assert len(counted) == 1, before
            assert np.isclose(counted[0], at, rtol=0, atol=2e-6)
            assert arc.mode[-1] == "rest"
            assert np.isclose(arc.jumps[-1].t, LIMIT, rtol=1e-8)

    @METHODS
    @pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
    def test_after_the_limit_it_does_not(self, other, solver):
        arc = simulate(
            ball_and(*other),
            (1.0, 0.0, 0.0, 0.0),
            (0.0, 5.0),
            mode="flight",
            parameters={"at": LIMIT + 1e-5},
            solver=solver,
        )
        assert arc.x[-1, 3] == 0.0
        assert np.isclose(arc.jumps[-1].t, LIMIT, rtol=1e-9)
