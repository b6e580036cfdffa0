"""Guards with a condition and transitions that end the run, against closed forms."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
DAMPING = 0.1
FREQUENCY = math.sqrt(1 - DAMPING**2)


def rotation(t, x, p):
    return (x.v, -x.q - 2 * DAMPING * x.v)


def oscillator(*transitions, parameters=None):
    """``q = e^(-0.1 t) sin(w t)`` from ``(0, w)``: crosses zero every half turn, slower each time."""
    return HybridSystem(
        state=("q", "v"),
        parameters=parameters or {"c": 0.0},
        modes=[Mode("swing", rotation)],
        transitions=transitions,
    )


def speed(k):
    """Velocity at the k-th half turn."""
    return (-1) ** k * FREQUENCY * math.exp(-DAMPING * k * math.pi / FREQUENCY)


def height(t, x, p):
    return x.q


def fast(t, x, p):
    return x.v - p.c


class Opaque:
    """A condition written as a branch, which tracing cannot follow."""

    @staticmethod
    def fast(t, x, p):
        if x.v > p.c:
            return 1.0
        return -1.0


@pytest.mark.parametrize(
    "when", [fast, lambda t, x, p: x.v > p.c, lambda t, x, p: (x.v > p.c) & (t > 0.1), Opaque.fast]
)
@pytest.mark.parametrize("shape", [lambda q: q, lambda q: np.sinh(q)])
def test_only_crossings_where_the_condition_holds_fire(when, shape):
    system = oscillator(Transition("swing", "swing", Guard(lambda t, x, p: shape(x.q), +1, when=when)))
    c = 0.3
    arc = simulate(system, (0.0, FREQUENCY), (0.1, 40.0 + 0.1), parameters={"c": c}, solver=TIGHT)
    expected = [k for k in range(2, 13, 2) if speed(k) > c]
    assert 0 < len(expected) < 6
    turns = 0.1 + math.pi / FREQUENCY * np.array(expected)
    np.testing.assert_allclose(arc.jumps.t, turns, atol=1e-11)


@pytest.mark.parametrize("directions", [(-1, +1), (0,)])
def test_a_passed_crossing_changes_nothing(directions):
    """The state, the tangents and the sides of other guards stay the same."""
    passed = Transition("swing", "swing", Guard(height, when=lambda t, x, p: -1.0), name="passed")
    turning = [
        Transition("swing", "swing", Guard(lambda t, x, p: x.v, direction), name=f"turning {direction}")
        for direction in directions
    ]
    arc = simulate(oscillator(passed, *turning), (0.0, FREQUENCY), (0.0, 30.0), tangent=True, solver=TIGHT)
    decay = math.exp(-DAMPING * 30.0)
    sine, cosine = math.sin(FREQUENCY * 30.0), math.cos(FREQUENCY * 30.0)
    np.testing.assert_allclose(
        arc.x[-1], decay * np.array([sine, FREQUENCY * cosine - DAMPING * sine]), atol=1e-12
    )
    flow = np.array([[DAMPING, 1.0], [-1.0, -DAMPING]]) * sine / FREQUENCY + cosine * np.eye(2)
    np.testing.assert_allclose(arc.fundamental, decay * flow, atol=1e-12)
    first = math.acos(DAMPING) / FREQUENCY
    turns = first + np.arange(10) * math.pi / FREQUENCY
    turns = turns[turns < 30.0]
    for direction in directions:
        found = [jump.t for jump in arc.jumps if jump.transition == f"turning {direction}"]
        times = {-1: turns[::2], 0: turns, +1: turns[1::2]}
        np.testing.assert_allclose(found, times[direction], atol=1e-11)
    assert not any(jump.transition == "passed" for jump in arc.jumps)


@pytest.mark.parametrize("width", [0.5, 1e-3, 1e-6])
@pytest.mark.parametrize("direction", [0, +1])
@pytest.mark.parametrize("shape", [lambda q: q, lambda q: q + q**3])
def test_the_second_of_two_crossings_in_one_step(width, direction, shape):
    """``q = (t - 1)^2 - width^2`` is integrated exactly, so that both zeros lie in one step."""
    guard = Guard(lambda t, x, p: shape(x.q), direction, when=lambda t, x, p: t > 1.0)
    fall = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
        transitions=[Transition("fall", "fall", guard)],
    )
    arc = simulate(fall, (1.0 - width**2, -2.0), (0.0, 3.0))
    np.testing.assert_allclose(arc.jumps.t, [1.0 + width], atol=1e-12 / width)


def two_modes(when, **options):
    """``q' = 1``; the mode changes to "up" where ``q`` rises through zero, if the condition holds."""
    return HybridSystem(
        state=("q",),
        parameters={"c": 1.0},
        modes=[Mode("low", lambda t, x, p: (1.0,)), Mode("high", lambda t, x, p: (2.0,))],
        transitions=[
            Transition("low", "high", Guard(height, +1, when=when)),
            Transition("high", "low", Guard(height, -1)),
        ],
        **options,
    )


class TestEntry:
    @pytest.mark.parametrize("start", [0.0, 0.5])
    def test_a_start_on_or_beyond_the_guard(self, start):
        """A start on the guard fires if the condition holds; otherwise the guard is already passed."""
        system = two_modes(lambda t, x, p: p.c + t)
        arc = simulate(system, (start,), (0.0, 1.0), mode="low")
        assert [(jump.t, jump.target) for jump in arc.jumps] == ([(0.0, "high")] if start == 0 else [])
        assert ("counts as crossed" in arc.status.message) == (start > 0)
        arc = simulate(system, (start,), (0.0, 1.0), mode="low", parameters={"c": -0.5})
        assert not arc.jumps
        assert "counts as crossed" not in arc.status.message
        np.testing.assert_allclose(arc.x[-1], [start + 1.0], atol=1e-14)

    def test_the_condition_tells_which_mode_a_start_is_in(self):
        system = two_modes(lambda t, x, p: p.c)
        assert simulate(system, (0.5,), (0.0, 0.1)).mode[0] == "high"
        with pytest.raises(hybrid.ArgumentError, match="more than one mode: low, high"):
            simulate(system, (0.5,), (0.0, 0.1), parameters={"c": -1.0})

    def test_the_condition_is_that_after_a_reset(self):
        """A reset puts the state beyond the guard of the next mode, and the condition is evaluated there."""
        system = HybridSystem(
            state=("q",),
            parameters={"to": 1.0},
            modes=[Mode(name, lambda t, x, p: (1.0,)) for name in "abc"],
            transitions=[
                Transition("a", "b", Guard(height, +1), Reset(lambda t, x, p: (p.to,))),
                Transition("b", "c", Guard(lambda t, x, p: x.q - 0.5, +1, when=lambda t, x, p: x.q < 2)),
            ],
        )
        arc = simulate(system, (-1.0,), (0.0, 2.0), mode="a")
        assert [jump.target for jump in arc.jumps] == ["b", "c"]
        arc = simulate(system, (-1.0,), (0.0, 2.0), mode="a", parameters={"to": 3.0})
        assert [jump.target for jump in arc.jumps] == ["b"]


class TestTogether:
    """Several guards are reached at the same point, and conditions refuse some of them."""

    def system(self, *transitions):
        return HybridSystem(
            state=("q",),
            modes=[Mode("a", lambda t, x, p: (1.0,)), Mode("b", lambda t, x, p: (-2.0,))],
            transitions=[*transitions, Transition("b", "a", Guard(lambda t, x, p: x.q + 9, -1))],
        )

    @pytest.mark.parametrize("shape", [lambda q: q, lambda q: q + q**3])
    @pytest.mark.parametrize("order", [1, -1])
    def test_complementary_conditions_are_no_ambiguity(self, order, shape):
        guards = [
            Guard(lambda t, x, p: shape(x.q), +1, when=lambda t, x, p: -1.0),
            Guard(lambda t, x, p: shape(x.q), +1, when=lambda t, x, p: 1.0),
        ][::order]
        pair = [Transition("a", "b", guard, name=f"{i}") for i, guard in enumerate(guards)]
        arc = simulate(self.system(*pair), (-0.7,), (0.0, 1.0), mode="a")
        assert arc.status.ok
        [jump] = arc.jumps
        assert (jump.transition, jump.target) == ("1" if order > 0 else "0", "b")
        assert jump.t == pytest.approx(0.7, abs=1e-15)

    @pytest.mark.parametrize("order", [1, -1])
    def test_a_marker_is_not_lost_with_a_passed_crossing(self, order):
        pair = [
            Transition("a", "b", Guard(height, +1, when=lambda t, x, p: -1.0), name="passed"),
            Transition("a", "a", Guard(height, +1), name="marker"),
        ][::order]
        arc = simulate(self.system(*pair), (-0.7,), (0.0, 1.0), mode="a")
        assert [jump.transition for jump in arc.jumps] == ["marker"]

    def test_a_run_that_ends_on_a_passed_crossing(self):
        passed = Transition("a", "b", Guard(height, +1, when=lambda t, x, p: -1.0))
        arc = simulate(self.system(passed), (-0.5,), (0.0, 0.5), mode="a")
        assert not arc.jumps
        arc = simulate(self.system(passed), arc.x[-1], (0.5, 1.0), mode="a")
        assert not arc.jumps


def test_a_touch_that_could_not_fire_is_no_grazing():
    def touch(when):
        guard = Guard(height, -1, when=when)
        fall = HybridSystem(
            state=("q", "v"),
            modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
            transitions=[Transition("fall", "fall", guard, Reset(lambda t, x, p: (x.q, x.v + 1)))],
        )
        return simulate(fall, (1.0, -2.0), (0.0, 2.0))

    assert len(touch(lambda t, x, p: 1.0).grazings) == 1
    assert len(touch(lambda t, x, p: -1.0).grazings) == 0


def test_a_section_with_a_condition():
    section = Guard(lambda t, x, p: x.v, -1, when=lambda t, x, p: t > 10.0)
    points = hybrid.poincare_section(oscillator(), (0.0, FREQUENCY), section, points=3, solver=TIGHT)
    first = math.acos(DAMPING) / FREQUENCY
    expected = first + 2 * math.pi / FREQUENCY * np.arange(2, 5)
    np.testing.assert_allclose(points.t, expected, atol=1e-11)


class TestEndOfTheRun:
    """A projectile whose run ends where it meets the slope ``y = s x``."""

    SYSTEM = HybridSystem(
        state=("x", "y", "u", "v"),
        parameters={"s": 0.5},
        modes=[Mode("flight", lambda t, x, p: (x.u, x.v, 0.0, -2.0))],
        transitions=[Transition("flight", None, Guard(lambda t, x, p: x.y - p.s * x.x, -1), name="landing")],
    )
    START = (0.0, 0.0, 1.0, 3.0)

    @pytest.fixture
    def arc(self):
        return simulate(self.SYSTEM, self.START, (0.0, 10.0), tangent=True)

    def test_where(self, arc):
        """``3 t - t^2 = t / 2``."""
        [jump] = arc.jumps
        assert jump.t == arc.t[-1] == pytest.approx(2.5, rel=1e-15)
        assert jump.target is None
        np.testing.assert_allclose(arc.x[-1], [2.5, 1.25, 1.0, -2.0], rtol=1e-13)
        np.testing.assert_array_equal(jump.x_plus, jump.x_minus)
        assert arc.mode[-1] == "flight"

    def test_status(self, arc):
        assert arc.status.code == StatusCode.TERMINAL
        assert not arc.status.ok
        assert "transition 'landing' at t = 2.5 in mode 'flight'" in arc.status.message

    def test_fundamental_is_the_derivative_of_the_end(self, arc):
        def end(x, y, u, v):
            """Lands where ``y + v T - T^2 = (x + u T) / 2``."""
            b = v - 0.5 * u
            T = (b + np.sqrt(b**2 + 4 * (y - 0.5 * x))) / 2
            return np.array([x + u * T, y + v * T - T**2, u, v - 2 * T])

        h = 1e-30j * np.eye(4)
        derivative = np.column_stack([end(*(np.array(self.START) + row)).imag / 1e-30 for row in h])
        np.testing.assert_allclose(arc.fundamental, derivative, atol=1e-12)
        matrix = hybrid.saltation_matrix(self.SYSTEM, "landing", 2.5, arc.x[-1])
        np.testing.assert_allclose(matrix, arc.jumps[0].saltation, atol=1e-12)

    def test_samples_stop_there(self):
        arc = simulate(self.SYSTEM, self.START, (0.0, 10.0), samples=np.arange(11.0))
        np.testing.assert_allclose(arc.t, [0.0, 1.0, 2.0], rtol=1e-14)

    def test_a_start_beyond_does_not_end_there(self):
        """``-1 + 3 t - t^2`` meets ``t / 2`` from below first, and then from above."""
        arc = simulate(self.SYSTEM, (0.0, -1.0, 1.0, 3.0), (0.0, 10.0), mode="flight")
        assert arc.status.code == StatusCode.TERMINAL
        assert "The start lies beyond the guard of 'landing'" in arc.status.message
        assert arc.t[-1] == pytest.approx(2.0, rel=1e-14)

    def test_the_order_with_another_guard_matters(self):
        bounce = Transition(
            "flight",
            "flight",
            Guard(lambda t, x, p: x.x - 2.5, +1),
            Reset(lambda t, x, p: (x.x, x.y, -x.u, x.v)),
        )
        system = HybridSystem(
            state=self.SYSTEM.state,
            parameters=self.SYSTEM.parameters,
            modes=self.SYSTEM.modes,
            transitions=[*self.SYSTEM.transitions, bounce],
        )
        arc = simulate(system, self.START, (0.0, 10.0))
        assert [jump.transition for jump in arc.jumps] == ["landing"]

    def test_no_periodic_orbit(self):
        orbit = hybrid.periodic_orbit(self.SYSTEM, self.START, period=3.0)
        assert orbit.status.code == StatusCode.TERMINAL


class TestLongRuns:
    """Turns at rate 1 with a radius that grows like ``e^(t / 10)``, until the radius is ``e``."""

    SYSTEM = HybridSystem(
        state=("x", "y"),
        modes=[Mode("spiral", lambda t, x, p: (0.1 * x.x - x.y, x.x + 0.1 * x.y))],
        transitions=[
            Transition("spiral", None, Guard(lambda t, x, p: x.x**2 + x.y**2 - np.exp(2.0), +1), name="out")
        ],
        period=1.0,
    )

    def test_spectrum_keeps_what_it_has(self):
        spectrum = lyapunov.lyapunov_spectrum(self.SYSTEM, (1.0, 0.0), intervals=50, transient=0)
        assert spectrum.status.code == StatusCode.TERMINAL
        assert spectrum.intervals in (9, 10)
        np.testing.assert_allclose(spectrum.exponents, [0.1, 0.1], atol=1e-9)

    def test_stroboscopic_section(self):
        section = hybrid.stroboscopic_section(self.SYSTEM, (1.0, 0.0), periods=50)
        assert section.status.code == StatusCode.TERMINAL
        np.testing.assert_allclose(np.hypot(*section.x.T[:, :9]), np.exp(0.1 * np.arange(1, 10)), rtol=1e-9)

    def test_poincare_section(self):
        surface = Guard(lambda t, x, p: x.y, +1)
        section = hybrid.poincare_section(self.SYSTEM, (1.0, -1e-3), surface, points=5)
        assert section.status.code == StatusCode.TERMINAL
        assert len(section) == 2

    def test_two_orbits(self):
        result = lyapunov.two_orbit_exponents(self.SYSTEM, (1.0, 0.0), intervals=50, transient=0)
        assert result.status.code == StatusCode.TERMINAL
        assert len(result.telescoped) >= 9


class TestModel:
    def test_graph(self):
        graph = TestEndOfTheRun.SYSTEM.graph
        assert list(graph.nodes) == ["flight", "(end)"]
        assert set(graph.edges(keys=True)) == {("flight", "(end)", "landing")}
        assert "mode" not in graph.nodes["(end)"]

    def test_default_name(self):
        assert Transition("a", None, Guard(height)).name == "a->(end)"
        assert not Transition("a", None, Guard(height)).is_marker

    def test_errors(self):
        with pytest.raises(hybrid.ModelError, match="a reset has no effect without a target"):
            Transition("a", None, Guard(height), Reset(lambda t, x, p: (0.0,)))
        with pytest.raises(
            hybrid.ModelError, match="accumulates_to='b' is for transitions whose jumps may accumulate"
        ):
            Transition("a", None, Guard(height), accumulates_to="b")
        with pytest.raises(hybrid.ModelError, match=r"Guard: when must be a function of \(t, x, p\); got 3"):
            Guard(height, when=3)
        with pytest.raises(hybrid.ModelError, match=r"mode name '\(end\)' is reserved for the end of a run"):
            HybridSystem(state=("q",), modes=[Mode("(end)", lambda t, x, p: (1.0,))])

    @pytest.mark.parametrize(
        ("when", "text"),
        [
            (lambda t, x, p: (x.q, x.v), "when must return one number, positive where the guard may fire"),
            (lambda t, x, p: x.w > 0, "when: State component 'w' does not exist"),
            (lambda t, x: x.v, r"when must take \(t, x, p\)"),
        ],
    )
    def test_a_condition_is_probed(self, when, text):
        with pytest.raises(hybrid.ModelError, match=f"Transition 'swing->swing': {text}"):
            oscillator(Transition("swing", "swing", Guard(height, when=when)))
