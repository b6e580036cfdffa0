"""Filippov systems with exact answers: crossing, sliding, tangencies, moving surfaces."""

import functools
import math

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid.system.functions import field_function
from hybrid.transform.filippov import filippov
from models import stick_slip
from tests.hybrid.transform.planes import PLANE, events, height, planar
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
FRICTION = reference("stick_slip")


@pytest.fixture(scope="module")
def block():
    return stick_slip()


@pytest.fixture(scope="module")
def ride(block):
    return hybrid.simulate(block, (0.5, 0.2), (0.0, 2.5 * FRICTION["period"]), solver=TIGHT)


class TestBlockOnBelt:
    def test_sticks_and_slips(self, ride):
        assert ride.status.ok
        assert ride.mode[0] == "sliding"
        assert events(ride) == ["sliding->below", "below->sliding"] * 2 + ["sliding->below"]

    def test_times(self, ride):
        t = [jump.t for jump in ride.jumps]
        assert t[0] == pytest.approx(2.5, abs=1e-12)
        np.testing.assert_allclose(np.diff(t)[::2], FRICTION["slip"], atol=1e-10)
        np.testing.assert_allclose(np.diff(t)[1::2], FRICTION["stick"], atol=1e-10)

    def test_states(self, ride):
        np.testing.assert_allclose(ride.jumps[1].x_plus, [FRICTION["x_restick"], 0.2], atol=1e-10)
        np.testing.assert_allclose(ride.jumps[2].x_plus, [1.0, 0.2], atol=1e-12)

    def test_multipliers(self, block):
        orbit = hybrid.periodic_orbit(block, (0.5, 0.2), period=12.0, solver=TIGHT)
        assert orbit.period == pytest.approx(FRICTION["period"], abs=1e-10)
        np.testing.assert_allclose(np.sort_complex(orbit.multipliers), [0.0, 1.0], atol=1e-9)

    def test_second_exponent_is_minus_infinity(self, block):
        result = lyapunov.lyapunov_spectrum(block, (0.5, 0.2), interval=FRICTION["period"], intervals=10)
        assert result.exponents[0] == pytest.approx(0.0, abs=1e-8)
        assert result.exponents[1] == -math.inf

    @pytest.mark.parametrize("x0", [(0.5, -1.0), (1.5, 0.2), (-1.5, 0.2), (0.5, 1.0), (3.0, 2.0)])
    def test_every_start_ends_on_the_orbit(self, block, x0):
        arc = hybrid.simulate(block, x0, (0.0, 60.0), solver=TIGHT)
        release = [jump.t for jump in arc.jumps if jump.transition == "sliding->below"]
        np.testing.assert_allclose(np.diff(release), FRICTION["period"], atol=1e-10)

    def test_release_holds_for_any_parameters(self, block):
        """The slip starts on the surface with zero acceleration, exact up to rounding."""
        rng = np.random.default_rng(1)
        for _ in range(100):
            p = {"belt": rng.uniform(0.1, 0.6), "delta": rng.uniform(0.5, 4), "Fs": rng.uniform(0.5, 2)}
            start = (rng.uniform(-0.3, 0.3), p["belt"])
            arc = hybrid.simulate(block, start, (0.0, 20.0), parameters=p)
            assert arc.status.ok
            assert arc.jumps[0].t == pytest.approx((p["Fs"] - start[0]) / p["belt"], rel=1e-12)
            gaps = np.diff([jump.t for jump in arc.jumps if jump.transition == "sliding->below"])
            assert len(gaps) == 0 or gaps.min() > 1.0


class TestCrossing:
    """``(1, 1)`` below and ``(2, 3)`` above ``y = 0``."""

    SYSTEM = planar(lambda t, x, p: (1.0, 1.0), lambda t, x, p: (2.0, 3.0))

    def test_one_jump_with_the_exact_saltation(self):
        arc = hybrid.simulate(self.SYSTEM, (0.0, -0.5), (0.0, 1.0))
        [jump] = arc.jumps
        assert jump.transition == "below->above"
        assert jump.t == pytest.approx(0.5, abs=1e-15)
        np.testing.assert_allclose(jump.saltation, [[1.0, 1.0], [0.0, 3.0]], atol=1e-14)
        np.testing.assert_allclose(arc.x[-1], [1.5, 1.5], atol=1e-14)

    def test_a_start_on_the_surface_is_above(self):
        arc = hybrid.simulate(self.SYSTEM, (0.0, 0.0), (0.0, 1.0))
        assert arc.mode[0] == "above"
        assert arc.jump_count == 0

    def test_downwards(self):
        system = planar(lambda t, x, p: (2.0, -3.0), lambda t, x, p: (1.0, -1.0))
        assert hybrid.simulate(system, (0.0, 0.0), (0.0, 1.0)).mode[0] == "below"
        [jump] = hybrid.simulate(system, (0.0, 0.5), (0.0, 1.0)).jumps
        assert jump.transition == "above->below"
        np.testing.assert_allclose(jump.saltation, [[1.0, -1.0], [0.0, 3.0]], atol=1e-14)

    def test_tangent_map_of_linear_fields(self):
        """Two foci, one clockwise inside the other: exact by the linear flows and the jump between them."""
        A, B = np.array([[0.1, -1.0], [1.0, 0.1]]), np.array([[-0.2, -2.0], [2.0, -0.2]])
        system = planar(
            lambda t, x, p: (0.1 * x.x - x.y, x.x + 0.1 * x.y),
            lambda t, x, p: (-0.2 * x.x - 2 * x.y, 2 * x.x - 0.2 * x.y),
        )
        arc = hybrid.simulate(system, (1.0, 0.0), (0.0, math.pi), tangent=True, solver=TIGHT)
        assert arc.mode[0] == "above"
        [jump] = arc.jumps
        assert jump.t == pytest.approx(math.pi / 2, rel=1e-12)
        x = jump.x_minus
        np.testing.assert_allclose(x, [-math.exp(-0.1 * math.pi), 0.0], atol=1e-12)
        salt = np.eye(2) + np.outer((A - B) @ x, [0.0, 1.0]) / (B @ x)[1]
        np.testing.assert_allclose(jump.saltation, salt, atol=1e-12)
        half = math.pi / 2
        flows = (math.exp(0.1 * half) * rotation(half), math.exp(-0.2 * half) * rotation(2 * half))
        np.testing.assert_allclose(arc.fundamental, flows[0] @ salt @ flows[1], atol=1e-11)

    def test_same_speeds_never_slide(self):
        """Parabolas on both sides: every half turn has the same width."""
        system = planar(lambda t, x, p: (-1.0, -x.x), lambda t, x, p: (1.0, -x.x))
        assert system.mode_names == ("below", "above")
        arc = hybrid.simulate(system, (-0.3, 0.0), (0.0, 60.1))
        np.testing.assert_allclose([jump.t for jump in arc.jumps], 0.6 * np.arange(1, 101), atol=1e-11)


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


class TestSliding:
    """``(1, 1)`` below and ``(1, x)`` above: sliding for ``x < 0`` up to the fold at 0, crossing beyond."""

    SYSTEM = planar(lambda t, x, p: (1.0, 1.0), lambda t, x, p: (1.0, x.x))

    def test_entry_and_exit_from_below(self):
        arc = hybrid.simulate(self.SYSTEM, (-2.3, -0.5), (0.0, 5.0))
        entry, leave = arc.jumps
        assert events(arc) == ["below->sliding", "sliding->above"]
        assert entry.t == pytest.approx(0.5, abs=1e-14)
        assert leave.t == pytest.approx(2.3, abs=1e-13)
        np.testing.assert_allclose(arc.x[-1], [2.7, 2.7**2 / 2], rtol=1e-12)

    def test_entry_from_above(self):
        arc = hybrid.simulate(self.SYSTEM, (-2.7, 0.5), (0.0, 5.0))
        assert events(arc) == ["above->sliding", "sliding->above"]
        assert arc.jumps[0].t == pytest.approx(2.7 - math.sqrt(2.7**2 - 1), abs=1e-12)
        assert arc.jumps[1].t == pytest.approx(2.7, abs=1e-12)

    def test_beyond_the_fold_it_crosses(self):
        assert events(hybrid.simulate(self.SYSTEM, (0.5, -0.3), (0.0, 1.0))) == ["below->above"]

    @pytest.mark.parametrize("at", [1e-3, 1e-6, 1e-9, 0.0, -1e-9, -1e-6, -1e-3, -0.1])
    def test_arrival_near_the_fold(self, at):
        arc = hybrid.simulate(self.SYSTEM, (at - 0.5, -0.5), (0.0, 2.5))
        assert arc.status.ok
        assert arc.mode[-1] == "above"
        start = max(at, 0.0)
        np.testing.assert_allclose(arc.x[-1], [2 + at, ((2 + at) ** 2 - start**2) / 2], rtol=1e-11)

    @pytest.mark.parametrize("scale", [2.0**-30, 2.0**30])
    @pytest.mark.parametrize("x0", [(-2.3, -0.5), (-2.7, 0.5), (-0.6, -0.5), (0.5, -0.3)])
    def test_the_scale_of_the_switching_function_changes_nothing(self, scale, x0):
        scaled = planar(
            lambda t, x, p: (1.0, 1.0), lambda t, x, p: (1.0, x.x), switching=lambda t, x, p: scale * x.y
        )
        here, there = (hybrid.simulate(system, x0, (0.0, 5.0)) for system in (self.SYSTEM, scaled))
        assert events(there) == events(here)
        np.testing.assert_allclose(there.jumps.t, here.jumps.t, rtol=1e-14)
        np.testing.assert_allclose(there.x[-1], here.x[-1], rtol=1e-13)

    def test_starts_in_the_surface(self):
        assert hybrid.simulate(self.SYSTEM, (-1.0, 0.0), (0.0, 0.5)).mode[0] == "sliding"
        assert hybrid.simulate(self.SYSTEM, (1.0, 0.0), (0.0, 0.5)).mode[0] == "above"

    @pytest.mark.parametrize(("y", "mode"), [(0.3, "above"), (-0.3, "below")])
    @pytest.mark.parametrize("named", ["below", "above", "sliding"])
    @pytest.mark.parametrize("x", [-2.0, 2.0])
    def test_a_wrong_mode_is_left_at_once(self, x, named, y, mode):
        arc = hybrid.simulate(self.SYSTEM, (x, y), (0.0, 0.1), mode=named)
        assert arc.mode[-1] == mode
        assert all(jump.t == 0.0 for jump in arc.jumps)

    def test_plain_arrays(self):
        system = filippov(
            2, {}, lambda t, x, p: (1.0, 1.0), lambda t, x, p: (1.0, x[0]), lambda t, x, p: x[1]
        )
        assert events(hybrid.simulate(system, (-2.3, -0.5), (0.0, 5.0))) == [
            "below->sliding",
            "sliding->above",
        ]

    def test_a_field_at_rest_on_the_surface(self):
        """``L_a = 0`` everywhere: a state that arrives stays."""
        system = planar(lambda t, x, p: (1.0, 1.0), lambda t, x, p: (0.0, 0.0))
        arc = hybrid.simulate(system, (-2.3, -0.5), (0.0, 5.0))
        assert events(arc) == ["below->sliding"]
        np.testing.assert_allclose(arc.x[-1], [-1.8, 0.0], atol=1e-14)

    def test_relay_feedback(self):
        """``x' = y - sgn(s), y' = -x``, ``s = x + y``: on the surface ``y' = y`` until ``|s'| = 1``."""
        system = planar(
            lambda t, x, p: (x.y + 1.0, -x.x),
            lambda t, x, p: (x.y - 1.0, -x.x),
            switching=lambda t, x, p: x.x + x.y,
        )
        arc = hybrid.simulate(system, (-0.1, 0.1), (0.0, 2.5), solver=TIGHT)
        assert arc.mode[0] == "sliding"
        assert events(arc)[0] == "sliding->above"
        assert arc.jumps[0].t == pytest.approx(math.log(5.0), abs=1e-11)
        np.testing.assert_allclose(arc.jumps[0].x_plus, [-0.5, 0.5], atol=1e-11)


class TestSaltation:
    """Curved surface, nonlinear fields: entry, sliding, and the map across them by finite differences."""

    SYSTEM = planar(
        lambda t, x, p: (-x.y + x.x, x.x + x.y),
        lambda t, x, p: (-2 * x.y - x.x, 2 * x.x - x.y + 0.1),
        switching=lambda t, x, p: x.x**2 + x.y**2 - 1,
    )

    def test_entry_time(self):
        arc = hybrid.simulate(self.SYSTEM, (0.1, 0.0), (0.0, 4.0))
        assert events(arc) == ["below->sliding"]
        assert arc.jumps[0].t == pytest.approx(math.log(10.0), abs=1e-9)

    def test_entry_loses_a_rank(self):
        [jump] = hybrid.simulate(self.SYSTEM, (0.1, 0.0), (0.0, 4.0), solver=TIGHT).jumps
        x, y = jump.x_plus
        f_b = np.array([x - y, x + y])
        f_a = np.array([-2 * y - x, 2 * x - y + 0.1])
        normal = 2 * np.array([x, y])
        alpha = normal @ f_b / (normal @ (f_b - f_a))
        expected = np.eye(2) + np.outer(alpha * (f_a - f_b), normal) / (normal @ f_b)
        np.testing.assert_allclose(jump.saltation, expected, atol=1e-11)
        np.testing.assert_allclose(jump.saltation @ (f_a - f_b), 0.0, atol=1e-11)
        assert np.linalg.matrix_rank(jump.saltation, tol=1e-9) == 1

    @pytest.mark.parametrize("x0", [(0.1, 0.0), (-0.2, 0.3), (2.0, 1.0)])
    def test_tangents_equal_differences_of_the_flow(self, x0):
        def end(x):
            return hybrid.simulate(self.SYSTEM, x, (0.0, 4.0), solver=TIGHT)

        arc = hybrid.simulate(self.SYSTEM, x0, (0.0, 4.0), solver=TIGHT, tangent=True)
        assert arc.mode[-1] == "sliding"
        h = 1e-5
        shifts = h * np.eye(2)
        differences = [(end(x0 + s).x[-1] - end(x0 - s).x[-1]) / (2 * h) for s in shifts]
        np.testing.assert_allclose(arc.fundamental, np.column_stack(differences), atol=1e-8)

    def test_sliding_drifts_no_more_than_the_solver(self):
        times = np.array([0.0, 100.0, 1000.0])
        arc = hybrid.simulate(self.SYSTEM, (1.0, 0.0), (0.0, 1000.0), samples=times)
        assert arc.status.ok
        assert arc.jump_count == 0
        np.testing.assert_allclose(np.hypot(*arc.x.T), 1.0, atol=1e-8)

    def test_an_affine_surface_is_kept_to_rounding(self, block):
        arc = hybrid.simulate(block, (-100.0, 0.2), (0.0, 500.0), parameters={"Fs": 200.0})
        assert arc.mode[-1] == "sliding"
        np.testing.assert_allclose(arc.x[:, 1], 0.2, rtol=1e-15)


class TestMovingSurface:
    """``(1, 2)`` and ``(1, -2)`` below and above ``y = sin(w t)``: sliding while ``w |cos| < 2``."""

    SYSTEM = planar(
        lambda t, x, p: (1.0, 2.0),
        lambda t, x, p: (1.0, -2.0),
        switching=lambda t, x, p: x.y - np.sin(p.w * t),
        parameters={"w": 1.0},
        period=lambda p: 2 * np.pi / p.w,
    )

    @pytest.mark.parametrize("start", [-0.5, 0.0, 0.5])
    def test_sliding_follows_it(self, start):
        arc = hybrid.simulate(self.SYSTEM, (0.0, start), (0.0, 50.0))
        assert arc.status.ok
        assert arc.mode[-1] == "sliding"
        np.testing.assert_allclose(arc.x[-1], [50.0, math.sin(50.0)], atol=1e-8)

    def test_leaves_where_it_turns_too_fast(self):
        """``w = 4``: tangent where ``cos(4 t) = -1/2`` on the way down; ``y = y0 - 2 t`` meets it again."""
        arc = hybrid.simulate(
            self.SYSTEM, (0.0, 1.0), (math.pi / 8, 2.0), parameters={"w": 4.0}, solver=TIGHT
        )
        assert arc.mode[0] == "sliding"
        assert events(arc)[0] == "sliding->above"
        leave = arc.jumps[0]
        assert leave.t == pytest.approx(math.pi / 6, abs=1e-11)
        np.testing.assert_allclose(leave.x_plus[1], math.sqrt(3) / 2, atol=1e-11)
        back = arc.jumps[1]
        assert math.sqrt(3) / 2 - 2 * (back.t - leave.t) == pytest.approx(math.sin(4 * back.t), abs=1e-11)

    def test_crossing_saltation_has_the_surface_speed(self):
        arc = hybrid.simulate(self.SYSTEM, (0.0, -0.5), (0.0, 1.0), parameters={"w": 4.0})
        [jump] = arc.jumps[:1]
        speed = 2.0 - 4.0 * math.cos(4.0 * jump.t)
        assert jump.transition == "below->above"
        np.testing.assert_allclose(jump.saltation, [[1.0, 0.0], [0.0, 1.0 - 4.0 / speed]], atol=1e-9)


class TestModel:
    def test_names(self, block):
        assert block.mode_names == ("below", "above", "sliding")
        assert block.transition_names == (
            "below too high",
            "above too low",
            "sliding too high",
            "sliding too low",
            "below->sliding",
            "below->above",
            "above->sliding",
            "above->below",
            "two-fold at start",
            "two-fold",
            "sliding->above",
            "sliding->below",
        )

    def test_sliding_field_keeps_the_surface(self):
        """A general case: a moving, curved surface in three dimensions."""
        system = filippov(
            ("x", "y", "z"),
            {"k": 0.7},
            lambda t, x, p: (np.sin(x.y), 1 + x.z**2, p.k * t),
            lambda t, x, p: (-x.x, -2.0 + np.cos(t), np.exp(-x.z)),
            lambda t, x, p: x.x * x.y - np.cos(p.k * t) * np.sqrt(1 + x.z**2),
        )
        compiled = hybrid.compile_system(system)
        sliding = field_function(system.modes[2], system.variables)
        rng = np.random.default_rng(3)
        for _ in range(5):
            t, x = rng.uniform(0, 3), rng.uniform(0.5, 1.5, 3)
            field = compiled.value(sliding, 2, t, x, np.array([0.7]))

            def h(s, t=t, x=x, field=field):
                x, y, z = x + s * field
                return x * y - math.cos(0.7 * (t + s)) * math.sqrt(1 + z**2)

            assert (h(1e-6) - h(-1e-6)) / 2e-6 == pytest.approx(0.0, abs=1e-8)

    @pytest.mark.parametrize(
        ("functions", "text"),
        [
            ({"below": 3}, "filippov: below must be a function"),
            ({"switching": lambda t, x, p: (x.x, x.y)}, "switching must return 1 values; got 2"),
            ({"above": lambda t, x, p: (1.0,)}, "above must return 2 values; got 1"),
            ({"above": lambda t, x, p: (1.0, x.q)}, "above: State component 'q' does not exist"),
            ({"below": lambda t, x, p: (1.0, math.sin(x.x))}, "below cannot be traced"),
            ({"switching": lambda t, x, p: x.x if x.y > 0 else x.y}, "switching cannot be traced"),
        ],
    )
    def test_errors(self, functions, text):
        arguments = {
            "below": lambda t, x, p: (1.0, 1.0),
            "above": lambda t, x, p: (1.0, -1.0),
            "switching": height,
        }
        with pytest.raises(hybrid.ModelError, match=text):
            filippov(PLANE, {}, **(arguments | functions))


@functools.cache
def in_units(state, time):
    """The relay and the block in other units of length and time."""
    relay = planar(
        lambda t, x, p: ((x.y + state) / time, -x.x / time),
        lambda t, x, p: ((x.y - state) / time, -x.x / time),
        switching=lambda t, x, p: x.x + x.y,
    )
    fold = planar(
        lambda t, x, p: (state / time, 2 * state / time),
        lambda t, x, p: (state / time, x.x / time),
    )
    return relay, fold


class TestUnits:
    """No threshold has a unit: powers of two as units change no digit."""

    @pytest.mark.parametrize(("state", "time"), [(2.0**-30, 1.0), (2.0**-60, 2.0**20), (2.0**30, 2.0**-20)])
    @pytest.mark.parametrize("solver", [hybrid.Taylor, hybrid.DOP853])
    @pytest.mark.parametrize(
        ("which", "x0"), [(0, (-0.1, 0.1)), (0, (-1.0, -0.5)), (1, (-2.3, -0.5)), (1, (-1.5, 0.5))]
    )
    def test_the_run_is_the_same(self, state, time, solver, which, x0):
        arcs = []
        for unit, second in ((1.0, 1.0), (state, time)):
            system = in_units(unit, second)[which]
            options = {"solver": solver(rtol=1e-10, atol=unit * 1e-12), "tangent": True}
            arcs.append(hybrid.simulate(system, unit * np.array(x0), (0.0, 4.0 * second), **options))
        here, there = arcs
        assert here.status.ok
        assert here.jumps
        assert there.status.code == here.status.code
        assert events(there) == events(here)
        np.testing.assert_allclose(there.jumps.t / time, here.jumps.t, rtol=1e-14)
        np.testing.assert_allclose(there.x[-1] / state, here.x[-1], rtol=1e-13, atol=1e-15)
        np.testing.assert_allclose(there.fundamental, here.fundamental, rtol=1e-12, atol=1e-13)


def test_an_arrival_from_above_is_one_jump():
    system = planar(lambda t, x, p: (1.0, 1.0), lambda t, x, p: (1.0, -3.0))
    for offset in (0.0, 7.0, -1e3):
        arc = hybrid.simulate(system, (offset, 0.75), (0.0, 1.0))
        assert events(arc) == ["above->sliding"]
        assert arc.jumps[0].t == pytest.approx(0.25, abs=1e-15)
        np.testing.assert_allclose(arc.x[-1], [offset + 1.0, 0.0], atol=1e-15)
        # The height is lost; from above it becomes time spent in the field above.
        np.testing.assert_allclose(arc.jumps[0].saltation, [[1.0, 0.0], [0.0, 0.0]], atol=1e-15)


def test_leaving_projects_what_the_solver_has_let_drift():
    arc = hybrid.simulate(
        TestMovingSurface.SYSTEM,
        (0.0, 1.0),
        (math.pi / 8, 0.6),
        parameters={"w": 4.0},
        solver=hybrid.Tsit5(rtol=1e-4, atol=1e-5),
    )
    [leave] = arc.jumps
    assert leave.transition == "sliding->above"
    assert abs(leave.x_minus[1] - math.sin(4.0 * leave.t)) > 1e-10
    assert leave.x_plus[1] == pytest.approx(math.sin(4.0 * leave.t), abs=1e-15)


@pytest.mark.parametrize("height", [5e-6, -5e-6])
def test_a_start_in_the_sliding_mode_off_the_surface_falls_onto_it(height):
    system = planar(lambda t, x, p: (1.0, 2.0), lambda t, x, p: (1.0, -2.0))
    arc = hybrid.simulate(system, (-0.7, height), (0.0, 1.0), mode="sliding")
    first = "high" if height > 0 else "low"
    side = "above" if height > 0 else "below"
    assert events(arc) == [f"sliding too {first}", f"{side}->sliding"]
    np.testing.assert_allclose(arc.jumps.t, [0.0, 2.5e-6], atol=1e-15)
    np.testing.assert_allclose(arc.x[-1], [0.3, 0.0], atol=1e-15)


def test_a_run_that_slides_can_be_taken_up_again():
    for system, x0 in ((TestSaltation.SYSTEM, (1.0, 0.0)), (TestMovingSurface.SYSTEM, (0.0, 0.5))):
        first = hybrid.simulate(system, x0, (0.0, 3.0))
        assert first.mode[-1] == "sliding"
        second = hybrid.simulate(system, first.x[-1], (3.0, 4.0), mode="sliding")
        assert not second.jumps
        assert second.mode[0] == "sliding"


def test_a_forcing_that_both_fields_share_cancels_along_the_surface():
    """A controller holds ``v = -l q``, whatever force is common to both sides: ``q = q0 exp(-l t)``."""

    def field(side):
        return lambda t, x, p: (x.v, side * p.K + p.d * np.cos(p.w * t))

    controlled = filippov(
        state=("q", "v"),
        parameters={"K": 4.0, "l": 1.5, "d": 0.5, "w": 2.0},
        below=field(+1.0),
        above=field(-1.0),
        switching=lambda t, x, p: x.v + p.l * x.q,
        period=lambda p: 2 * np.pi / p.w,
    )
    arc = hybrid.simulate(controlled, (0.1, -0.15), (0.0, 3.0), mode="sliding")
    assert arc.status.ok
    assert arc.steps < 50
    np.testing.assert_allclose(arc.x[-1], 0.1 * np.exp(-4.5) * np.array([1.0, -1.5]), rtol=1e-10)
