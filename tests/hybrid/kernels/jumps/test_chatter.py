"""Jumps that accumulate: their limit, the run after it, and the tangent map through it."""

import math
from functools import cache

import attrs
import numpy as np
import pytest

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    StatusCode,
    Transition,
    simulate,
)
from lyapunov import lyapunov_spectrum
from models import bouncing_ball

RESTITUTIONS = (0.0, 0.1, 0.5, 0.8, 0.9, 0.99)
FALL = math.sqrt(2 / 9.81)
TIGHT = DOP853(rtol=1e-12, atol=1e-14)
SLOPE = 0.3


@cache
def resting_ball():
    """The bouncing ball with a mode of rest after its bounces."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81, "e": 0.8},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -p.g)),
            Mode("rest", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v)),
                name="bounce",
                accumulates_to="rest",
            )
        ],
    )


@cache
def ball_on_a_table():
    """A ball above a table that moves as ``A sin(w t)``, in the coordinates of the table."""

    def push(t, p):
        return p.A * p.w**2 * np.sin(p.w * t) - p.g

    return HybridSystem(
        state=("q", "v"),
        parameters={"A": 0.3, "w": 2 * np.pi, "e": 0.5, "g": 9.81},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, push(t, p))),
            Mode("stick", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -p.e * x.v)),
                name="hit",
                accumulates_to="stick",
            ),
            Transition("stick", "flight", Guard(lambda t, x, p: push(t, p), direction=+1), name="lift-off"),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


@cache
def incline():
    """A ball that bounces down a frictionless incline in air, and slides after its bounces."""
    sine, cosine = math.sin(SLOPE), math.cos(SLOPE)

    def hit(t, x, p):
        normal = (1 + p.e) * (x.u * sine + x.w * cosine)
        return x.x, x.y, x.u - normal * sine, x.w - normal * cosine

    return HybridSystem(
        state=("x", "y", "u", "w"),
        parameters={"e": 0.7, "drag": 0.0, "g": 9.81},
        modes=[
            Mode("flight", lambda t, x, p: (x.u, x.w, -p.drag * x.u, -p.g - p.drag * x.w)),
            Mode(
                "slide",
                lambda t, x, p: (
                    x.u,
                    x.w,
                    p.g * cosine * sine - p.drag * x.u,
                    -p.g * sine * sine - p.drag * x.w,
                ),
            ),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.x * sine + x.y * cosine, direction=-1),
                Reset(hit),
                name="hit",
                accumulates_to="slide",
            )
        ],
    )


@cache
def braked(brake):
    """A ball that bounces on level ground without friction, and is braked once it slides."""
    return HybridSystem(
        state=("q", "v", "s", "u"),
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -10.0, x.u, 2.0)),
            Mode("slide", lambda t, x, p: (0.0, 0.0, x.u, 2.0 - brake * x.u)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -0.5 * x.v, x.s, x.u)),
                name="hit",
                accumulates_to="slide",
            )
        ],
    )


@cache
def braked_by_its_square():
    """The same ball on ground whose friction grows with the square of the speed."""
    flight, _ = braked(0.0).modes
    slide = Mode("slide", lambda t, x, p: (0.0, 0.0, x.u, -(x.u**2)))
    return attrs.evolve(braked(0.0), modes=[flight, slide])


def limit_time(e):
    return FALL * (1 + e) / (1 - e)


def run(e, t_end=None, **options):
    end = 2 * limit_time(e) if t_end is None else t_end
    return simulate(resting_ball(), (1.0, 0.0), (0.0, end), mode="flight", parameters={"e": e}, **options)


class TestBall:
    @pytest.mark.parametrize("e", RESTITUTIONS)
    @pytest.mark.parametrize("solver", [None, TIGHT], ids=["default", "tight"])
    def test_goes_to_its_limit_and_rests_there(self, e, solver):
        arc = run(e, solver=solver)
        assert arc.status.ok
        assert abs(arc.jumps[-1].t / limit_time(e) - 1) < 1e-12
        assert arc.mode[-1] == "rest"
        assert arc.t[-1] == pytest.approx(2 * limit_time(e), rel=1e-14)
        np.testing.assert_allclose(arc.x[-1], [0.0, 0.0], rtol=0, atol=1e-11)

    @pytest.mark.parametrize("e", RESTITUTIONS)
    def test_number_of_jumps_does_not_depend_on_how_many_the_limit_skips(self, e):
        arc = run(e)
        assert len(arc.jumps) <= 60
        assert arc.steps <= 1000

    @pytest.mark.parametrize("e", RESTITUTIONS[1:])
    def test_the_limit_is_the_last_jump_and_leads_to_rest(self, e):
        kinds = [jump.kind for jump in run(e).jumps]
        assert kinds[-1] == "limit"
        assert kinds.count("limit") == 1
        assert run(e).jumps[-1].target == "rest"

    @pytest.mark.parametrize("e", RESTITUTIONS[1:])
    def test_bounces_before_the_limit_are_exact(self, e):
        times = run(e).jumps.t[:-1]
        k = np.arange(len(times))
        exact = FALL * (1 + 2 * e * (1 - e**k) / (1 - e))
        np.testing.assert_allclose(times, exact, rtol=1e-13)

    @pytest.mark.parametrize("e", RESTITUTIONS)
    def test_without_a_mode_for_the_limit_the_run_ends_there(self, e):
        arc = simulate(bouncing_ball(), (1.0, 0.0), (0.0, 2 * limit_time(e)), parameters={"e": e})
        assert arc.status.code == StatusCode.ACCUMULATION
        assert abs(arc.t[-1] / limit_time(e) - 1) < 1e-12
        assert f"{limit_time(e):.6g}"[:6] in arc.status.message

    @pytest.mark.parametrize("e", [0.5, 0.9])
    def test_a_run_that_ends_before_the_limit_does_not_reach_it(self, e):
        arc = run(e, t_end=0.999 * limit_time(e))
        assert arc.status.ok
        assert arc.mode[-1] == "flight"
        assert "limit" not in [jump.kind for jump in arc.jumps]

    def test_elastic_balls_never_rest(self):
        arc = run(1.0, t_end=100.75 * 2 * FALL)
        assert arc.status.ok
        assert len(arc.jumps) == 101
        assert "limit" not in [jump.kind for jump in arc.jumps]

    @pytest.mark.parametrize("e", [0.5, 0.9])
    def test_splitting_the_run_anywhere_changes_nothing(self, e):
        whole = run(e)
        for t in (0.5 * limit_time(e), limit_time(e), 1.5 * limit_time(e)):
            first = run(e, t_end=t)
            second = simulate(
                resting_ball(),
                first.x[-1],
                (t, 2 * limit_time(e)),
                mode=str(first.mode[-1]),
                parameters={"e": e},
            )
            times = [jump.t for arc in (first, second) for jump in arc.jumps if jump.kind == "limit"]
            assert second.mode[-1] == "rest"
            np.testing.assert_allclose(times, [whole.jumps[-1].t], rtol=1e-11)


class TestTable:
    PERIODS = 12

    @pytest.fixture
    def arc(self):
        return simulate(ball_on_a_table(), (0.1, 0.0), (0.0, self.PERIODS + 0.0), mode="flight")

    def test_it_chatters_sticks_and_lifts_off_once_a_period(self, arc):
        assert arc.status.ok
        names = [jump.transition if jump.kind != "limit" else "limit" for jump in arc.jumps]
        settled = [
            [name for name, t in zip(names, arc.jumps.t, strict=True) if period <= t < period + 1]
            for period in range(2, self.PERIODS)
        ]
        assert all(row.count("lift-off") == 1 and row.count("limit") == 1 for row in settled)
        assert all(row == settled[0] for row in settled)
        # The visible impacts of each chatter are in the arc, not only those of the first.
        assert all(row.count("hit") >= 17 for row in settled)

    def test_it_lifts_off_where_the_table_falls_away_as_fast_as_it_would(self, arc):
        exact = math.asin(9.81 / (0.3 * (2 * math.pi) ** 2)) / (2 * math.pi)
        lifts = np.array([jump.t for jump in arc.jumps if jump.transition == "lift-off"])
        assert len(lifts) >= self.PERIODS - 1
        np.testing.assert_allclose(lifts % 1.0, exact, rtol=0, atol=1e-13)

    def test_after_a_stick_the_past_is_forgotten(self, arc):
        limits = np.array([jump.t for jump in arc.jumps if jump.kind == "limit"])
        np.testing.assert_allclose(np.diff(limits[2:]), 1.0, rtol=0, atol=1e-10)

    def test_its_last_exponent_is_minus_infinity(self):
        spectrum = lyapunov_spectrum(ball_on_a_table(), (0.1, 0.0), mode="flight", intervals=10, transient=2)
        assert spectrum.exponents[1] == -np.inf

    def test_so_is_its_first(self):
        spectrum = lyapunov_spectrum(ball_on_a_table(), (0.1, 0.0), mode="flight", intervals=10, transient=2)
        assert spectrum.exponents[0] == -np.inf


@cache
def smooth_incline():
    """A ball that bounces down a frictionless incline of any angle, and slides."""

    def normal(x, p):
        return x.u * np.sin(p.angle) + x.w * np.cos(p.angle)

    def hit(t, x, p):
        push = (1 + p.e) * normal(x, p)
        return x.x, x.y, x.u - push * np.sin(p.angle), x.w - push * np.cos(p.angle)

    def slide(t, x, p):
        pull = 9.81 * np.sin(p.angle)
        return x.u, x.w, pull * np.cos(p.angle), -pull * np.sin(p.angle)

    def clearance(t, x, p):
        return x.x * np.sin(p.angle) + x.y * np.cos(p.angle)

    return HybridSystem(
        state=("x", "y", "u", "w"),
        parameters={"angle": 0.3, "e": 0.7},
        modes=[Mode("flight", lambda t, x, p: (x.u, x.w, 0.0, -9.81)), Mode("slide", slide)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(clearance, direction=-1),
                Reset(hit),
                name="hit",
                accumulates_to="slide",
            )
        ],
    )


class TestIncline:
    """Normal to the incline the ball bounces; along it the acceleration is uniform, unaffected by bounces."""

    START = np.array([0.1, 1.0, 0.2, -0.3])

    def limit(self, angle, e):
        normal, pull = np.array([np.sin(angle), np.cos(angle)]), 9.81 * np.cos(angle)
        q, v = self.START[:2] @ normal, self.START[2:] @ normal
        impact = np.sqrt(v * v + 2 * pull * q)
        return (v + impact) / pull + 2 * e * impact / pull / (1 - e)

    def slid(self, angle, t):
        along, pull = np.array([np.cos(angle), -np.sin(angle)]), 9.81 * np.sin(angle)
        s, u = self.START[:2] @ along, self.START[2:] @ along
        return np.concatenate([(s + u * t + pull * t**2 / 2) * along, (u + pull * t) * along])

    @pytest.mark.parametrize("angle", [0.1, 0.3, 0.8, 1.2])
    @pytest.mark.parametrize("e", [0.05, 0.2, 0.5, 0.7, 0.9, 0.97])
    def test_state_at_the_limit_and_after(self, angle, e):
        limit = self.limit(angle, e)
        arc = simulate(
            smooth_incline(),
            self.START,
            (0.0, limit + 1.0),
            mode="flight",
            parameters={"angle": angle, "e": e},
            tangent=True,
        )
        last = arc.jumps[-1]
        assert last.kind == "limit"
        # The error of a time is the rounding of the distance divided by the speed of the last bounces.
        assert last.t == pytest.approx(limit, rel=2e-11 if e < 0.95 else 2e-10)
        np.testing.assert_allclose(last.x_plus, self.slid(angle, last.t), rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(arc.x[-1], self.slid(angle, limit + 1.0), rtol=2e-13, atol=1e-13)
        along = np.array([np.cos(angle), -np.sin(angle)])
        kept = np.outer(along, along)
        flow = np.block([[kept, (limit + 1.0) * kept], [0 * kept, kept]])
        np.testing.assert_allclose(arc.fundamental, flow, rtol=0, atol=1e-9)


class TestTangents:
    @pytest.mark.parametrize("drag", [0.0, 0.3])
    @pytest.mark.parametrize("e", [0.2, 0.7])
    def test_through_a_complete_chatter(self, drag, e):
        """The end is affine in the start, so that a wide finite difference has only rounding errors."""
        x0, step = np.array([0.1, 1.0, 0.2, -0.3]), 0.02

        def end(start, **options):
            return simulate(
                incline(),
                start,
                (0.0, 4.0),
                mode="flight",
                parameters={"drag": drag, "e": e},
                solver=TIGHT,
                **options,
            )

        arc = end(x0, tangent=True)
        assert arc.mode[-1] == "slide"
        difference = np.column_stack(
            [(end(x0 + d).x[-1] - end(x0 - d).x[-1]) / (2 * step) for d in step * np.eye(4)]
        )
        np.testing.assert_allclose(arc.fundamental, difference, rtol=0, atol=3e-6)

    def test_on_an_incline_without_drag_it_is_exact(self):
        arc = simulate(incline(), (0.1, 1.0, 0.2, -0.3), (0.0, 4.0), mode="flight", tangent=True)
        along = np.array([math.cos(SLOPE), -math.sin(SLOPE)])
        kept = np.outer(along, along)
        exact = np.block([[kept, 4.0 * kept], [np.zeros((2, 2)), kept]])
        np.testing.assert_allclose(arc.fundamental, exact, rtol=0, atol=1e-11)

    def test_when_the_limit_mode_brakes(self):
        """The time of the limit affects the motion after it; compared with the closed form."""
        brake, end = 1.0, 4.0
        system = braked(brake)

        def exact(x0):
            q, v, s, u = x0
            impact = np.sqrt(v * v + 20 * q)
            limit = (impact + v) / 10 + 2 * 0.5 * impact / (10 * (1 - 0.5))
            s, u = s + u * limit + limit**2, u + 2 * limit
            decay, rest = np.exp(-brake * (end - limit)), u - 2 / brake
            s += 2 / brake * (end - limit) + rest * (1 - decay) / brake
            return np.array([0 * q, 0 * q, s, 2 / brake + rest * decay])

        x0 = np.array([1.0, 0.2, 0.1, 0.3])
        arc = simulate(system, x0, (0.0, end), mode="flight", tangent=True)
        np.testing.assert_allclose(arc.x[-1], exact(x0), rtol=0, atol=1e-11)
        derivative = np.column_stack([exact(x0 + 1e-30j * d).imag / 1e-30 for d in np.eye(4)])
        np.testing.assert_allclose(arc.fundamental, derivative, rtol=0, atol=1e-9)

    @pytest.mark.parametrize("solver", [None, TIGHT], ids=["default", "tight"])
    def test_into_a_mode_whose_jacobian_varies(self, solver):
        """``u' = 2`` in flight and ``u' = -u^2`` on the ground, against the closed form."""
        end, system = 4.0, braked_by_its_square()

        def exact(x0):
            q, v, s, u = x0
            impact = np.sqrt(v * v + 20 * q)
            limit = (impact + v) / 10 + 2 * 0.5 * impact / (10 * (1 - 0.5))
            s, u = s + u * limit + limit**2, u + 2 * limit
            return np.array([0 * q, 0 * q, s + np.log(1 + u * (end - limit)), u / (1 + u * (end - limit))])

        x0 = np.array([1.0, 0.2, 0.1, 0.3])
        arc = simulate(system, x0, (0.0, end), mode="flight", tangent=True, solver=solver)
        np.testing.assert_allclose(arc.x[-1], exact(x0), rtol=0, atol=1e-11)
        derivative = np.column_stack([exact(x0 + 1e-30j * d).imag / 1e-30 for d in np.eye(4)])
        np.testing.assert_allclose(arc.fundamental, derivative, rtol=0, atol=1e-9)

    def test_it_is_singular_in_two_directions(self):
        arc = simulate(incline(), (0.1, 1.0, 0.2, -0.3), (0.0, 4.0), mode="flight", tangent=True)
        values = np.linalg.svd(arc.fundamental, compute_uv=False)
        assert values[1] > 0.1
        assert values[2] < 1e-9 * values[0]

    def test_the_slide_stays_on_the_incline(self):
        arc = simulate(incline(), (0.1, 1.0, 0.2, -0.3), (0.0, 4.0), mode="flight")
        normal = np.array([math.sin(SLOPE), math.cos(SLOPE)])
        np.testing.assert_allclose([arc.x[-1, :2] @ normal, arc.x[-1, 2:] @ normal], 0.0, atol=1e-10)


def test_the_matrix_of_the_limit_does_not_depend_on_who_looks():
    """Height and speed are lost; ``w``, which grew with the height, keeps its value from the ground."""
    system = HybridSystem(
        state=("q", "v", "w"),
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -9.81, x.w + x.v)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, x.w)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -0.8 * x.v, x.w)),
                accumulates_to="rest",
            )
        ],
    )
    for tangent in (None, True):
        arc = simulate(system, (1.0, 0.0, 1.0), (0.0, 10.0), mode="flight", tangent=tangent)
        assert arc.jumps[-1].kind == "limit"
        grown = np.exp(arc.jumps[-1].t - arc.jumps[-2].t)
        expected = [[0, 0, 0], [0, 0, 0], [-grown, 0, grown]]
        np.testing.assert_allclose(arc.jumps[-1].saltation, expected, rtol=1e-6, atol=1e-12)
