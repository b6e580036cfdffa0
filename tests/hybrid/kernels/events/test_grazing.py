"""Guards that touch or nearly touch zero: classified, stored on the arc, never lost or fired twice."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Transition, Tsit5, simulate

DEPTHS = tuple(10.0**-u for u in range(1, 17))
GUARDS = {
    "affine": lambda t, x, p: x.q,
    "bent": lambda t, x, p: np.sin(x.q),
}


@cache
def parabola(guard="affine", direction=0):
    """A motion ``q = (t - 1)^2 + c``, and a counter of the crossings of its guard."""
    return HybridSystem(
        state=("q", "v", "n"),
        modes=[Mode("move", lambda t, x, p: (x.v, 2.0, 0.0))],
        transitions=[
            Transition(
                "move",
                "move",
                Guard(GUARDS[guard], direction=direction),
                Reset(lambda t, x, p: (x.q, x.v, x.n + 1)),
                name="touch",
            )
        ],
    )


@cache
def rigid(e=0.8):
    """The parabola with a wall at zero that reflects it."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("move", lambda t, x, p: (x.v, 2.0))],
        transitions=[
            Transition(
                "move",
                "move",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -e * x.v)),
                name="bounce",
            )
        ],
    )


def run(c, guard="affine", direction=0, end=2.25, **options):
    return simulate(parabola(guard, direction), (1.0 + c, -2.0, 0.0), (0.0, end), mode="move", **options)


class TestTouches:
    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("c", DEPTHS)
    def test_above_the_guard_nothing_fires(self, c, guard):
        # 1 + c is a rounded number: below 2e-16 the touch is exact.
        arc = run(c, guard)
        assert arc.x[-1, 2] == len(arc.jumps)
        if c > 1e-14:
            assert len(arc.jumps) == 0
        assert len(arc.jumps) in (0, 2)

    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("direction", [-1, 0, +1])
    @pytest.mark.parametrize("c", DEPTHS)
    def test_below_the_guard_each_crossing_fires_once(self, c, guard, direction):
        arc = run(-c, guard, direction)
        expected = 2 if direction == 0 else 1
        if c >= 1e-13:
            assert len(arc.jumps) == expected
        else:
            # The depth is about the rounding of a state whose terms come to 4.
            assert arc.x[-1, 2] == len(arc.jumps) in (0, expected)
            assert len(arc.jumps) + len(arc.grazings) > 0
        if c >= 1e-9:
            exact = [1 - np.sqrt(c), 1 + np.sqrt(c)]
            chosen = {-1: exact[:1], 0: exact, +1: exact[1:]}[direction]
            # The time error is the guard's error divided by its speed.
            np.testing.assert_allclose(arc.jumps.t, chosen, rtol=0, atol=1e-14 / np.sqrt(c))

    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("direction", [-1, 0, +1])
    @pytest.mark.parametrize("method", [DOP853, Tsit5])
    def test_a_run_may_end_just_after_a_dip_within_its_tolerances(self, method, direction, guard):
        for c in (1e-9, 1e-8, 1e-7):
            exact = {-1: [-1.0], 0: [-1.0, 1.0], +1: [1.0]}[direction]
            for beyond in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0):
                end = 1.0 + (1.0 + beyond) * np.sqrt(c)
                arc = run(-c, guard, direction, end, solver=method(rtol=1e-6, atol=1e-6))
                np.testing.assert_allclose((arc.jumps.t - 1.0) / np.sqrt(c), exact, rtol=0, atol=1e-5)

    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("c", [0.0, 1e-12, 1e-13])
    def test_a_touch_within_the_tolerances_is_kept_on_the_arc(self, c, guard):
        arc = run(c, guard, solver=DOP853())
        if c == 0.0 and arc.jumps:
            # Rounding may take an exact touch for two crossings, and then says that these graze.
            assert [jump.kind for jump in arc.jumps] == ["grazing"] * 2
            return
        (grazing,) = arc.grazings
        assert grazing.transition == "touch"
        assert abs(grazing.t - 1) < 1e-6
        assert abs(grazing.value - c) < 1e-14
        assert grazing.acceleration == pytest.approx(2.0, rel=1e-6)
        np.testing.assert_allclose(grazing.x, [c, 0.0, 0.0], atol=1e-6)

    @pytest.mark.parametrize("guard", GUARDS)
    def test_an_exact_flight_tells_a_miss_from_a_touch(self, guard):
        """The flight is exact to rounding: 1e-12 above the guard is a clear miss.

        Rounding may take an exact touch for two crossings, and then says that these graze.
        """
        assert run(1e-12, guard).grazings == ()
        touch = run(0.0, guard)
        assert len(touch.grazings) == 1 or [jump.kind for jump in touch.jumps] == ["grazing", "grazing"]

    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("direction", [-1, 0, +1])
    @pytest.mark.parametrize("share", [3 / 8, 1 / 2, 3 / 4])
    def test_a_touch_between_two_pieces_of_its_step_is_kept(self, share, direction, guard):
        """The flight is one step, which is halved until the guard turns at an end of its pieces."""
        arc = run(0.0, guard, direction, end=1.0 / share)
        assert (arc.steps, len(arc.jumps)) == (1, 0)
        [grazing] = arc.grazings
        assert grazing.t == pytest.approx(1.0, abs=1e-7)
        assert grazing.value == pytest.approx(0.0, abs=1e-15)

    @pytest.mark.parametrize("c", [1e-3, 1e-6, 1e-8])
    def test_a_clear_miss_is_not(self, c):
        assert run(c).grazings == ()

    def test_more_tolerance_makes_more_a_grazing(self):
        assert len(run(1e-8, solver=DOP853(rtol=1e-6, atol=1e-8)).grazings) == 1
        assert len(run(1e-8, solver=DOP853(rtol=1e-12, atol=1e-14)).grazings) == 0

    def test_from_below(self):
        arc = simulate(parabola(direction=-1), (1.0, -2.0, 0.0), (0.0, 2.0))
        assert (len(arc.jumps), len(arc.grazings)) == (0, 1)


class TestKinds:
    def test_a_dip_below_the_tolerances_is_a_grazing_jump(self):
        assert [jump.kind for jump in run(-1e-12, direction=-1).jumps] == ["grazing"]

    @pytest.mark.parametrize("guard", GUARDS)
    def test_both_crossings_of_a_shallow_dip_are(self, guard):
        arc = run(-1e-12, guard)
        assert [jump.kind for jump in arc.jumps] == ["grazing"] * 2
        assert [jump.kind for jump in run(-1e-12, guard, direction=+1).jumps] == ["grazing"]

    def test_a_guard_without_speed_or_acceleration_is_crossed(self):
        """``q = (t - 1)^3``: a triple root is a crossing, and its matrix is that of a grazing."""
        system = HybridSystem(
            state=("q", "v", "a"),
            modes=[Mode("move", lambda t, x, p: (x.v, x.a, 6.0))],
            transitions=[
                Transition(
                    "move", "move", Guard(lambda t, x, p: x.q, +1), Reset(lambda t, x, p: (x.q, x.v, x.a))
                )
            ],
        )
        arc = simulate(system, (-1.0, 3.0, -6.0), (0.0, 2.0))
        assert len(arc.jumps) == 1
        assert arc.jumps[0].t == pytest.approx(1.0, abs=1e-4)

    def test_a_deeper_one_is_transverse(self):
        assert [jump.kind for jump in run(-1e-6).jumps] == ["transverse"] * 2

    @pytest.mark.parametrize("c", [1e-2, 1e-4, 1e-6, 1e-8])
    def test_the_saltation_grows_like_one_over_the_root_of_the_depth(self, c):
        arc = simulate(rigid(), (1.0 - c, -2.0), (0.0, 1.0))
        (jump,) = arc.jumps
        assert jump.transversality == pytest.approx(-2 * np.sqrt(c), rel=1e-6)
        assert abs(jump.saltation[1, 0]) == pytest.approx(1.8 * 2 / (2 * np.sqrt(c)), rel=1e-6)


class TestRounding:
    """Dips as deep as rounding of 1: the result depends on rounding but must be consistent."""

    @pytest.mark.parametrize("guard", GUARDS)
    @pytest.mark.parametrize("direction", [-1, 0, +1])
    def test_either_a_pair_or_a_touch(self, guard, direction):
        rng = np.random.default_rng(7)
        found = set()
        for _ in range(100):
            bottom, depth = rng.uniform(0.3, 1.7), 10.0 ** rng.uniform(-16, -13)
            start = (bottom**2 - depth, -2.0 * bottom, 0.0)
            solver = DOP853(max_step=rng.choice([0.05, 0.3, 10.0]))
            arc = simulate(
                parabola(guard, direction), start, (0.0, bottom + 1.25), mode="move", solver=solver
            )
            speeds = [jump.transversality for jump in arc.jumps]
            assert np.sign(speeds).tolist() in ([], [direction] if direction else [-1, 1])
            assert all(jump.kind == "grazing" for jump in arc.jumps)
            assert all(abs(jump.t - bottom) < 1e-6 for jump in arc.jumps)
            assert len(arc.jumps) + len(arc.grazings) > 0
            found.add(len(arc.jumps))
        assert found == {0, 2 if direction == 0 else 1}


class TestBounces:
    @pytest.mark.parametrize("c", DEPTHS)
    def test_one_bounce_or_none(self, c):
        """After a grazing bounce the parabola leads away, and the state follows the exact motion."""
        arc = simulate(rigid(), (1.0 - c, -2.0), (0.0, 2.0))
        assert len(arc.jumps) in ((1,) if c >= 1e-13 else (0, 1))
        s = np.sqrt(c)
        exact = 0.8 * 2 * s * (1 + s) + (1 + s) ** 2
        # Rounding of the height, about 1e-14, divided by the wall speed; near the wall its square root.
        assert arc.x[-1, 0] == pytest.approx(exact, abs=3e-14 / s if c >= 1e-13 else 4e-7)

    @given(
        u=st.floats(0.5, 13.0),
        sign=st.sampled_from([-1, 1]),
        step=st.floats(0.05, 10.0),
        guard=st.sampled_from(sorted(GUARDS)),
        method=st.sampled_from([DOP853, Tsit5]),
    )
    def test_never_doubled_never_lost(self, u, sign, step, guard, method):
        c = sign * 10.0**-u
        arc = run(c, guard, end=2.0, solver=method(rtol=1e-10, atol=1e-12, max_step=step))
        assert arc.status.ok
        assert arc.x[-1, 2] == len(arc.jumps) == (2 if sign < 0 else 0)


def test_a_guard_that_is_not_affine_is_followed_from_a_turning_point():
    """The state hardly moves at first, which says nothing about the convergence of the guard's series."""
    first, gap = 0.225031, 2e-8

    def height(t):
        pair = (t - first) * (t - first - gap)
        return pair * ((t - 1.31511) ** 2 + 0.477723**2) * ((t - 1.05357) ** 2 + 0.522964**2)

    time = np.polynomial.Polynomial([0.0, 1.0])
    speed = height(time).deriv()
    system = HybridSystem(
        state=("x", "n"),
        modes=[Mode("run", lambda t, x, p: (sum(c * t**k for k, c in enumerate(speed.coef.tolist())), 0.0))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: np.sin(x.x) + x.x**3),
                Reset(lambda t, x, p: (x.x, x.n + 1)),
            )
        ],
    )
    arc = simulate(system, (height(0.0), 0.0), (0.0, 1.0), mode="run")
    assert len(arc.jumps) in (0, 2)
    np.testing.assert_allclose(arc.jumps.t, first, atol=1e-7)


def test_a_touch_is_kept_whatever_the_guard_would_be_outside_of_the_step():
    """``q = (t + a) (t - b)^2`` is negative before the run begins, and touches zero on its only step."""
    system = HybridSystem(
        state=("q",),
        parameters={"a": 0.5, "b": 1.0},
        modes=[Mode("run", lambda t, x, p: ((t - p.b) ** 2 + 2.0 * (t + p.a) * (t - p.b),))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: np.sin(x.q)))],
    )
    for a in (0.2, 0.5, 0.9):
        for b in np.linspace(0.4, 1.4, 41):
            arc = simulate(system, (a * b * b,), (0.0, 1.5), parameters={"a": a, "b": b})
            assert (arc.steps, len(arc.jumps), len(arc.grazings)) == (1, 0, 1)
            assert arc.grazings[0].t == pytest.approx(b, abs=1e-7)
