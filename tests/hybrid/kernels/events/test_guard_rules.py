"""Guards at a point, rule by rule: conditions, rounding of each kind of guard, sizes, accelerations."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import guards
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(guards)
# Rounding of a state, as a share.
SHARE = 16.0 * EPSILON


def near(value):
    """Without the absolute tolerance of ``pytest.approx``, which is wider than rounding."""
    return pytest.approx(value, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(("value", "expected"), [(0.5, True), (2.0, True), (0.0, False), (-1.0, False)])
def test_a_condition_holds_if_it_is_positive(value, expected):
    """Conditions follow the three guards; one that does not exist writes nothing."""

    def guard(program, t, x, parameters, out):
        assert (t, x, parameters) == (7.0, "x", "p")
        if program == 4:
            out[0] = value

    model = SimpleNamespace(target=np.zeros(3), guard=guard, parameters="p")
    scalar = np.array([-9.0])
    assert bool(kernels.allowed(model, 1, 7.0, "x", scalar)) == expected
    assert kernels.allowed(model, 2, 7.0, "x", scalar)


def test_speed_of_a_guard():
    def guard_gradient(transition, t, x, parameters, out):
        assert (transition, t, x, parameters) == (5, 7.0, "x", "p")
        out[:] = 2.0, -3.0, 0.5

    model = SimpleNamespace(dimension=2, guard_gradient=guard_gradient, parameters="p")
    assert kernels.guard_speed(model, 5, 7.0, "x", np.array([4.0, 6.0]), np.zeros(3)) == 0.5 + 8.0 - 18.0


def test_which_guards_have_programs_and_which_modes_are_forced():
    model = SimpleNamespace(
        programs=SimpleNamespace(first=np.array([0, 0, 4, 4])), first_forcing=np.array([0, 2, 2, 3])
    )
    assert [bool(kernels.has_program(model, i)) for i in range(3)] == [False, True, False]
    assert [bool(kernels.is_forced(model, i)) for i in range(3)] == [True, False, True]


def test_the_largest_time_that_a_phase_may_have_come_from():
    for t, period, size in ((3.0, 0.0, 3.0), (-3.0, 0.0, 3.0), (1.0, 2.0, 2.0), (-3.0, 2.0, 3.0)):
        assert kernels.size_of_time(SimpleNamespace(period=period), t) == size


class TestBands:
    """Guard 1 has a program, guard 0 has none; the time is 7 in a period of 10."""

    def scene(self, spread):
        def told(programs, program, t, clock, x, scale, share, registers):
            assert (t, clock, x, scale, registers) == (7.0, 10.0, "x", "scale", "registers")
            self.asked.append((int(program), share))
            return spread

        self.asked = []
        model = SimpleNamespace(
            programs=SimpleNamespace(first=np.array([0, 0, 4] + [4] * 9 + [5])), period=10.0, spread=told
        )
        return model, SimpleNamespace(scale="scale"), SimpleNamespace(registers="registers")

    @pytest.mark.parametrize(
        ("spread", "band", "jumps", "of_terms"),
        [
            (0.25, 0.25, False, 0.25),
            (0.0, 0.0, False, 0.0),
            # A guard that may jump has its band with a sign.
            (-0.25, 0.25, True, 0.0),
            (math.nan, 0.0, False, 0.0),
            (math.inf, math.inf, False, 0.0),
        ],
    )
    def test_of_a_guard_with_a_program(self, spread, band, jumps, of_terms):
        model, run, work = self.scene(spread)
        assert kernels.rounding_band(model, run, 1, 7.0, "x", work) == band
        assert bool(kernels.may_jump(model, run, 1, 7.0, "x", work)) == jumps
        assert kernels.spread_of_terms(model, run, 1, 0.75, 7.0, "x", work) == of_terms
        assert self.asked == [(1, SHARE), (1, SHARE), (1, 0.75)]

    def test_of_a_guard_without_one(self):
        model, run, work = self.scene(-0.25)
        tested = plain(guards, smooth_band=lambda model, run, transition, t, x, work: (transition, t, x))
        assert tested.rounding_band(model, run, 0, 7.0, "x", work) == (0, 7.0, "x")
        assert not kernels.may_jump(model, run, 0, 7.0, "x", work)
        assert kernels.spread_of_terms(model, run, 0, 0.75, 7.0, "x", work) == 0.0
        assert self.asked == []

    def test_from_the_gradient_and_from_terms_that_may_cancel(self):
        """The terms of guard 1 come after 3 guards, 5 forcings and 2 residues: program 11 of 12."""
        model, run, work = self.scene(0.25)
        model.dimension, model.target = 2, np.zeros(3)
        model.first_forcing, model.first_residue = np.array([0, 1, 5]), np.array([0, 1, 2])
        run.scale, work.gradient = np.array([4.0, 3.0]), np.array([2.0, -5.0, -0.5])
        plainly = SHARE * (2.0 * 4.0 + 5.0 * 3.0 + 0.5 * 10.0)
        assert kernels.gradient_band(model, run, 7.0, work.gradient) == near(plainly)
        run.scale = "scale"
        tested = plain(guards, gradient_band=lambda model, run, t, gradient: 0.5)
        assert tested.smooth_band(model, run, 1, 7.0, "x", work) == 0.75
        assert self.asked == [(11, SHARE)]
        assert tested.smooth_band(model, run, 0, 7.0, "x", work) == 0.5

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_larger_than_its_slope_lets_rounding_make_it(self, way):
        """More than four times 0.5, or four times 0.75 with the rounding of its terms; a jump has none."""
        asked = []

        def spread_of_terms(model, run, program, share, t, x, work):
            asked.append((program, share))
            return 0.25

        for jumps, most in ((True, 2.0), (False, 3.0)):
            tested = plain(
                guards,
                smooth_band=lambda *given: 0.5,
                may_jump=lambda *given, jumps=jumps: jumps,
                spread_of_terms=spread_of_terms,
            )
            for share, expected in ((0.99, False), (1.01, True)):
                found = tested.exceeds_slope(None, None, 1, 7.0, "x", way * share * most, None)
                assert bool(found) == expected
        assert asked == [(1, 0.0), (1, 0.0)]

    @pytest.mark.parametrize("side", [1, -1])
    def test_left_beyond_zero_by_the_rounding_of_a_jump(self, side):
        """By 16 bands of 0.5, if it moves back to its side."""
        value = [0.0]
        tested = plain(guards, guard_value=lambda *given: value[0], rounding_band=lambda *given: 0.5)
        work = SimpleNamespace(scalar=None)
        for value[0], speed, expected in (
            (7.9, 1.0, True),
            (-7.9, 1.0, True),
            (8.1, 1.0, False),
            (-8.1, 1.0, False),
            (0.0, -1.0, False),
            (0.0, 0.0, False),
            (0.0, 1e-300, True),
            (0.0, math.nan, False),
        ):
            found = tested.was_left_behind(None, None, 1, 7.0, "x", side * speed, side, work)
            assert bool(found) == expected
        assert not tested.was_left_behind(None, None, 1, 7.0, "x", 1.0, 0, work)

    def test_tolerances_move_a_guard(self):
        method, run = SimpleNamespace(atol=0.5, rtol=0.25), SimpleNamespace(scale=np.array([4.0, 6.0]))
        assert kernels.error_band(method, run, np.array([2.0, -3.0, 99.0]), 2) == 2.0 * 1.5 + 3.0 * 2.0


def test_a_state_beside_another_where_a_guard_is_larger():
    model, out = SimpleNamespace(dimension=2), np.full(3, 77.0)
    kernels.displace(model, np.array([1.0, 2.0]), 5.0, np.array([3.0, -4.0, 9.0]), out)
    assert out == pytest.approx([1.6, 1.2, 77.0], rel=1e-15)
    kernels.displace(model, np.array([1.0, 2.0]), 0.5, np.array([0.3, -0.4, 9.0]), out)
    assert out == pytest.approx([1.6, 1.2, 77.0], rel=1e-15)
    kernels.displace(model, np.array([1.0, 2.0]), 5.0, np.array([0.0, 0.0, 9.0]), out)
    assert out.tolist() == [1.0, 2.0, 77.0]


class TestScale:
    """The rates of the state (2, -3, 5) are (4, -6, 0), all sizes are 1; mode 1 has the Jacobian given."""

    def widened(self, jacobian, *, rates=(4.0, -6.0, 0.0), t=0.0, period=0.0, horizon=0.0, residues=()):
        jacobian = np.array(jacobian)
        rows, columns = np.nonzero(jacobian[:, :3])

        def field_jacobian(mode, t_, x, parameters, out):
            assert (mode, t_, x is run.y, parameters) == (1, t, True, "p")
            out[rows, columns], out[:, 3] = jacobian[rows, columns], jacobian[:, 3]

        def spread_of_terms(model, run, program, share, t_, x, work):
            assert (share, t_, x is run.y) == (SHARE, t, True)
            return SHARE * dict(zip((7, 8), residues, strict=False))[program]

        model = SimpleNamespace(
            dimension=3,
            parameters="p",
            period=period,
            field_jacobian=field_jacobian,
            first_slope=np.array([[9] * 4, [int(np.sum(rows < i)) for i in range(4)]]),
            slope_column=columns,
            # Programs of residues come after those of 2 guards and of 4 forcings; the mode before has one.
            target=np.zeros(2),
            first_forcing=np.array([0, 1, 4]),
            first_residue=np.array([0, 1, 1 + len(residues)]),
            residue_component=np.array([0, 1, 1]),
        )
        run = SimpleNamespace(
            mode=1, phase=t, horizon=horizon, y=np.array([2.0, -3.0, 5.0]), scale=np.ones(3)
        )
        work = SimpleNamespace(field=np.array(rates), state=np.zeros(3), jacobian=np.full((3, 4), 88.0))
        plain(guards, spread_of_terms=spread_of_terms).widen_scale(model, run, work)
        return run.scale.tolist()

    def jacobian(self, **entries):
        """``J01=3.0`` is the entry in the row 0 and the column 1; column 3 is time."""
        out = np.zeros((3, 4))
        for name, value in entries.items():
            out[int(name[1]), int(name[2])] = value
        return out

    def test_while_a_rate_changes_by_its_own_size(self):
        assert self.widened(self.jacobian()) == [1.0, 1.0, 1.0]
        # 1 (-6) against 4, and 8 against 4.
        assert self.widened(self.jacobian(J01=1.0)) == [near(16.0 / 6.0), 1.0, 1.0]
        assert self.widened(self.jacobian(J03=8.0)) == [2.0, 1.0, 1.0]
        assert self.widened(self.jacobian(J03=8.0, J01=-1.0)) == [near(16.0 / 14.0), 1.0, 1.0]
        # Sizes do not shrink.
        assert self.widened(self.jacobian(J03=32.0)) == [1.0, 1.0, 1.0]

    def test_while_the_fastest_feedback_acts(self):
        """Of a component on itself, or of two on each other; the other rates last no longer."""
        assert self.widened(self.jacobian(J00=-2.0)) == [2.0, 3.0, 1.0]
        # Change of the rates: 1 (-6) and 0.25 * 4.
        assert self.widened(self.jacobian(J01=1.0, J10=0.25)) == [near(16.0 / 6.0), 12.0, 1.0]
        assert self.widened(self.jacobian(J01=-1.0, J10=4.0)) == [2.0, near(36.0 / 16.0), 1.0]
        # Without an entry across the diagonal there is none.
        assert self.widened(self.jacobian(J21=1e9, J03=8.0)) == [2.0, 1.0, 1.0]

    def test_no_longer_than_the_run_or_its_clock(self):
        """Where a rate changes by 4 in a time of 1."""
        jacobian = self.jacobian(J03=4.0)
        assert self.widened(jacobian)[0] == 4.0
        for horizon, t, period, size in (
            (0.5, 0.0, 0.0, 2.0),
            (0.5, -0.75, 0.0, 3.0),
            (0.5, 0.25, 0.875, 3.5),
            (2.0, 0.0, 0.0, 4.0),
            (0.0, 0.5, 0.0, 4.0),
        ):
            assert self.widened(jacobian, horizon=horizon, t=t, period=period)[0] == size

    @pytest.mark.parametrize(
        ("entries", "t", "residues", "size"),
        [
            # The second rate is off by the rounding of its time, of its arguments, or of its terms.
            ({"J13": 5.0}, 2.0, (), 10.0),
            ({"J13": 5.0}, -2.0, (), 10.0),
            ({"J12": 7.0}, 0.0, (), 35.0),
            ({"J12": -7.0}, 0.0, (), 35.0),
            ({}, 0.0, (3.0, 8.0), 11.0),
            ({"J12": 7.0}, 0.0, (3.0,), 38.0),
        ],
    )
    def test_a_change_that_is_rounding_tells_nothing(self, entries, t, residues, size):
        """The first rate is three times the second component."""
        for share, expected in ((0.95, 1.0), (1.05, 4.0 * 2.5)):
            rates = (4.0, -share * size * SHARE, 0.0)
            jacobian = self.jacobian(J01=3.0, **entries)
            assert self.widened(jacobian, rates=rates, t=t, horizon=2.5, residues=residues)[0] == expected


class TestSides:
    """The second of three modes has the guards 1 and 2; rounding of a guard is 0.5."""

    def sides(self, values, before, directions=(1, 1)):
        def guard_gradient(transition, t, x, parameters, out):
            out[:] = transition

        def rounding_band(model, run, transition, t, x, work):
            assert (t, x) == (7.0, "y")
            # The gradient is that of this guard.
            assert work.gradient.tolist() == [transition]
            return 0.5

        model = SimpleNamespace(
            first_outgoing=np.array([0, 1, 3, 4]), outgoing=np.array([0, 1, 2, 3]), parameters="p"
        )
        model.direction, model.guard_gradient = np.array([9, *directions, 9]), guard_gradient
        run = SimpleNamespace(mode=1, y="y", side=np.array([5, *before, 5]))
        work = SimpleNamespace(scalar=None, gradient=np.zeros(1))
        tested = plain(
            guards,
            guard_value=lambda model, transition, t, x, scalar: values[transition - 1],
            rounding_band=rounding_band,
        )
        tested.sides_at(model, run, 7.0, work)
        assert run.side[[0, 3]].tolist() == [5, 5]
        return run.side[1:3].tolist()

    def test_beyond_rounding_its_sign_is_its_side(self):
        for before in ((1, 1), (-1, -1), (0, 0)):
            assert self.sides((0.6, -0.6), before) == [1, -1]
            assert self.sides((-0.6, 0.6), before, (0, 0)) == [-1, 1]

    def test_within_it_has_not_crossed(self):
        for value in (0.4, -0.4, 0.5, -0.5):
            assert self.sides((value, value), (1, -1), (1, 1)) == [-1, -1]
            assert self.sides((value, value), (1, -1), (-1, -1)) == [1, 1]
            # Either way, or without a side, it stays as it was.
            assert self.sides((value, value), (1, -1), (0, 0)) == [1, -1]
            assert self.sides((value, value), (0, 0)) == [0, 0]

    def test_without_a_value_it_keeps_its_side(self):
        assert self.sides((math.nan, math.nan), (1, -1)) == [1, -1]


class TestAcceleration:
    """``x'' = a + c t`` and the guard ``x + b v^2``, which does not depend on a third, huge component."""

    A, C, T = 3.0, 0.5, 2.0

    def acceleration(self, b, *, affine=0, curvature=True, place=4.0, scale=1.0, rates=None):
        x = np.array([place, 5.0, 1e12])
        rates = np.array([5.0, self.A + self.C * self.T, 0.0]) if rates is None else np.array(rates)
        times = []

        def guard_gradient(transition, t, x, parameters, out):
            times.append(t)
            out[:] = 1.0, 2.0 * b * x[1], 0.0, 0.0

        def field_jacobian(mode, t, x, parameters, out):
            out[0, 1], out[:, 3] = 1.0, (0.0, self.C, 77.0)

        def guard_curvature(transition, t, x, parameters, out):
            # The rates come in, the second derivative along them goes out.
            assert out.tolist() == rates.tolist()
            out[0] = 2.0 * b * out[1] ** 2 if curvature else math.nan

        model = SimpleNamespace(
            dimension=3,
            parameters="p",
            affine_guard=np.array([0, affine]),
            direction=np.array([0, 0]),
            steep=np.array([1, 0]),
            first_slope=np.array([[0, 0, 0, 0], [0, 1, 1, 1]]),
            slope_column=np.array([1]),
            guard_gradient=guard_gradient,
            field_jacobian=field_jacobian,
            guard_curvature=guard_curvature,
        )
        run = SimpleNamespace(scale=np.array([scale, scale, 1e12]))
        work = SimpleNamespace(field=rates, gradient=np.array([1.0, 2.0 * b * 5.0, 0.0, 0.0]))
        work.jacobian, work.state = np.full((3, 4), 88.0), np.zeros(3)
        found = kernels.guard_acceleration(model, run, 1, 1, self.T, x, work)
        # The gradient is that at the state again.
        assert work.gradient.tolist() == [1.0, 10.0 * b, 0.0, 0.0]
        self.moments = [(t - self.T) / 1e-7 for t in times]
        return found

    def test_of_an_affine_guard(self):
        """``v' + 2 b v c`` without the bend of the guard."""
        assert self.acceleration(0.0, affine=1) == 4.0
        assert self.acceleration(0.25, affine=1) == 4.0 + 0.25 * 2.0 * 5.0 * 0.5
        assert self.moments == []

    def test_of_a_bent_guard(self):
        """The second derivative of ``b v^2`` along the rates is ``2 b v'^2``."""
        expected = 4.0 + 0.25 * 2.0 * 5.0 * 0.5 + 2.0 * 0.25 * 16.0
        assert self.acceleration(0.25) == expected
        assert self.acceleration(0.25, curvature=False) == pytest.approx(expected, rel=1e-6)

    @pytest.mark.parametrize(
        ("given", "moment"),
        [
            # The size of what the guard depends on, over the largest rate.
            ({}, 5.0 / 5.0),
            ({"place": -20.0}, 20.0 / 5.0),
            ({"scale": 30.0}, 30.0 / 5.0),
            ({"rates": (0.0, -0.25, 0.0)}, 5.0 / 0.25),
            ({"rates": (0.0, 0.0, 0.0)}, 5.0),
            ({"b": 0.0, "place": 0.0, "scale": 0.0}, 1.0 / 5.0),
            ({"b": 0.0, "place": 0.25, "scale": 0.0}, 0.25 / 5.0),
        ],
    )
    def test_moment_of_a_difference_quotient(self, given, moment):
        self.acceleration(**({"b": 0.25, "curvature": False} | given))
        assert self.moments == pytest.approx([0.0, moment, 0.0], rel=1e-6)


class TestSlopes:
    """A steep mode, and the guard ``3 x - 4 y``, whose rounding is 0.5; it is left towards 5 to a side."""

    def place(self, value, *, direction=1, steep=1):
        """Where the Jacobian is taken at the origin."""
        found = []
        model = SimpleNamespace(
            dimension=2,
            parameters="p",
            direction=np.array([9, direction]),
            steep=np.array([0, steep]),
            field_jacobian=lambda mode, t, x, parameters, out: found.append((mode, t, *x)),
        )
        work = SimpleNamespace(
            gradient=np.array([3.0, -4.0, 0.0]), rounding=np.zeros((4, 2)), jacobian=None, scalar=None
        )
        tested = plain(guards, guard_value=lambda *given: value, gradient_band=lambda *given: 0.5)
        tested.slopes_at_guard(model, None, 1, 1, 7.0, np.zeros(2), work)
        ((mode, t, *x),) = found
        assert (mode, t) == (1, 7.0)
        return np.array(x) @ work.gradient[:2]

    @pytest.mark.parametrize("direction", [1, -1])
    def test_next_to_a_root_they_are_taken_beyond_the_guard(self, direction):
        for value in (0.0, 2.0, -2.0, 7.9, -7.9):
            found = self.place(value, direction=direction)
            assert found == pytest.approx(direction * (abs(value) + 0.5), rel=1e-14)
        for value in (8.1, -8.1):
            assert self.place(value, direction=direction) == 0.0

    def test_elsewhere_they_are_taken_at_the_state(self):
        assert self.place(2.0, direction=0) == 0.0
        assert self.place(2.0, steep=0) == 0.0
