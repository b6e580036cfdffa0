"""The surface of a guard, rule by rule: where it is looked for, and what counts as smooth."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import surface
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(surface)


@pytest.mark.parametrize(
    ("x", "rate", "size"), [(3.0, 1.0, 3.0), (-3.0, 1.0, 3.0), (1.0, -4.0, 8.0), (0.0, 0.0, 0.0)]
)
def test_the_size_of_a_component_in_a_unit_of_time(x, rate, size):
    work = SimpleNamespace(field=np.array([9.0, rate]))
    assert kernels.weight(np.array([9.0, x]), 2.0, 1, work) == size


def test_the_unit_of_time_of_small_and_slow_states():
    for field, x, unit in (((0.5, -0.25), (0.1, -0.3), 0.6), ((1e-3, 0.0), (0.0, 9.0), 1.0)):
        work = SimpleNamespace(field=np.array(field))
        assert kernels.unit_of_time(SimpleNamespace(dimension=2), np.array(x), work) == unit


def memory(field):
    n = len(field)
    return SimpleNamespace(
        field=np.array(field),
        state=np.zeros(n),
        scalar=np.zeros(1),
        gradient=np.full(n + 1, 9.0),
        stages=np.zeros((2, n + 1)),
    )


def test_the_noise_of_a_guard_is_that_of_the_state_at_one_time():
    def guard(transition, t, x, parameters, out):
        out[0] = 3.0 * t

    model, work = SimpleNamespace(dimension=2, parameters=None, guard=guard), memory((2.0, -1.0))
    assert kernels.value_and_noise(model, 1, 5.0, np.array([1.0, 3.0]), 0.5, work) == (16.5, 0.0)


def test_directions_at_another_time():
    """The gradient is (t, 2, x) at the time 5 less a half."""

    def write(transition, t, x, parameters, out):
        out[:] = t, 2.0, x[0]

    model, work, out = (
        SimpleNamespace(dimension=2, parameters=None, guard_gradient=write),
        memory((2.0, -1.0)),
        np.zeros(2),
    )
    kernels.direction_on_path(model, 1, 5.0, np.array([1.0, 3.0]), -0.5, out, work)
    # The state is (0, 3.5) there, and the speed 2 * 4.5 - 2.
    assert out.tolist() == [4.5 / 7.0, 2.0 / 7.0]


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("pace", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("rises", [1.0, -1.0])
def test_the_plane_of_a_jump_in_any_units(size, pace, rises):
    """Of a bent surface; the third component is zero and stays so."""
    x, field = size * np.array([1.0, 3.0, 0.0]), size * pace * np.array([2.0, -1.0, 0.0])

    def guard(transition, t, y, parameters, out):
        e = (y[0] - 1.5 * y[1]) / size + 3.5 + pace * t
        out[0] = rises * np.sign(e + e**3 + 0.5 * y[2])

    model = SimpleNamespace(dimension=3, parameters=None, guard=guard)
    work = memory(field)
    unit = kernels.unit_of_time(model, x, work)
    assert kernels.plane_of_jump(model, 1, 0.0, x, unit, 1e-7 * unit, rises, work)
    speed = 4.5 * pace
    expected = np.array([1.0 / size, -1.5 / size, 0.5, pace]) / speed
    np.testing.assert_allclose(work.gradient, expected, rtol=1e-8)


@pytest.mark.parametrize(("steepness", "found"), [(500.0, True), (-500.0, True), (4e3, False), (1e9, False)])
def test_a_jump_that_is_shifted_by_too_much_has_no_plane(steepness, found):
    """The second component moves by 3e-5, and the first one by 2 per unit of time.

    The jump is looked for up to a tenth of the unit of time, 1/2.
    """

    def guard(transition, t, y, parameters, out):
        out[0] = np.sign(y[0] - 1.0 + steepness * (y[1] - 3.0))

    model, work = SimpleNamespace(dimension=2, parameters=None, guard=guard), memory((2.0, 0.0))
    assert kernels.plane_of_jump(model, 1, 0.0, np.array([1.0, 3.0]), 0.5, 5e-8, 1.0, work) == found
    expected = [0.5, 0.5 * steepness, 0.0] if found else [9.0] * 3
    np.testing.assert_allclose(work.gradient, expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(("offset", "turn"), [(0.0, 1), (0.5, 0), (-0.5, 0)])
def test_a_jump_that_does_not_reach_across_zero(offset, turn):
    """It jumps by 1/2, from 1/4 to 3/4 on either side, or across zero."""

    def guard(transition, t, x, parameters, out):
        out[0] = 0.25 * np.sign(x[0] - 1.0) + offset

    model, work = SimpleNamespace(dimension=2, parameters=None, guard=guard), memory((2.0, -1.0))
    assert kernels.jumps_across(model, 1, 0.0, np.array([1.0, 3.0]), 1e-7, 1e-9, work) == turn


class TestBeside:
    """Components of the sizes 3 and 30, in a unit of time of 1.5; the rates are (2, -1)."""

    def found(self, before, behind):
        def direction_on_path(model, transition, t, x, s, out, work):
            assert (transition, t, abs(s)) == (1, 5.0, 0.25)
            out[:2] = before if s < 0.0 else behind

        work = memory((2.0, -1.0))
        tested = plain(surface, direction_on_path=direction_on_path)
        found = tested.plane_beside(
            SimpleNamespace(dimension=2), 1, 5.0, np.array([1.0, 30.0]), 1.5, 0.25, work
        )
        self.gradient = work.gradient.tolist()
        return bool(found)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_directions_must_agree(self, way):
        """Up to a thousandth of their sizes, which are 2 * 3 + 0.2 * 30 together."""
        for share, expected in ((0.99, True), (1.01, False)):
            apart = way * share * 12e-3
            assert self.found((1.0, 0.1), (1.0 + apart / 3.0, 0.1)) == expected
            assert self.found((1.0, -0.1), (1.0, -0.1 + apart / 30.0)) == expected

    def test_the_gradient_has_the_speed_one(self):
        assert self.found((0.75, 0.125), (0.75 + 2.0**-12, 0.125))
        first = 0.75 + 2.0**-13
        assert self.gradient == [first, 0.125, 1.0 - 2.0 * first + 0.125]

    def test_directions_without_bound_do_not_agree(self):
        for bad in (math.inf, math.nan):
            with np.errstate(invalid="ignore"):
                assert not self.found((bad, 0.1), (bad, 0.1))
        assert self.gradient == [9.0] * 3


class TestLooks:
    """A guard with the speed 1 at its crossing, whose unit of time is 3/2: the first look is 1.5e-7 apart."""

    def found(self, speeds, *, jumps=lambda s: 0, plane=True, beside=True, t=0.0, speed=1.0):
        asked = []

        def speed_on_path(model, transition, t_, x, s, work):
            assert (transition, t_) == (1, t)
            asked.append(s)
            return speeds(s)

        def jumps_across(model, transition, t_, x, s, explained, work):
            assert explained == s * (abs(speeds(-s)) + abs(speeds(s)))
            return jumps(s)

        def plane_of_jump(model, transition, t_, x, unit, shortest, rises, work):
            self.planes.append(("jump", unit, shortest, rises))
            return plane

        def plane_beside(model, transition, t_, x, unit, s, work):
            self.planes.append(("beside", unit, s))
            return beside

        def write(transition, t_, x, parameters, out):
            self.planes.append("gradient")

        self.planes = []
        model = SimpleNamespace(
            dimension=2, parameters=None, affine_guard=np.array([9, 0]), guard_gradient=write
        )
        tested = plain(
            surface,
            speed_on_path=speed_on_path,
            jumps_across=jumps_across,
            plane_of_jump=plane_of_jump,
            plane_beside=plane_beside,
        )
        found = tested.finds_surface(model, 1, t, np.array([1.0, 3.0]), speed, memory((2.0, -1.0)))
        assert asked[::2] == [-s for s in asked[1::2]]
        self.places = asked[1::2]
        return bool(found)

    @pytest.mark.parametrize("bend", [0.0, 0.5, -0.5])
    def test_a_smooth_guard_shows_its_surface(self, bend):
        """Its speed grows or falls along the path."""
        assert not self.found(lambda s: 1.0 + math.copysign(bend, s))
        assert self.places == [1.5e-7]
        assert self.planes == ["gradient"]

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_speeds_beside_it_are_as_far_above_it_as_below(self, way):
        """Up to a thousandth of both."""
        for share, smooth in ((0.99, True), (1.01, False)):
            jump = way * share * 1e-3 * 2.0
            assert self.found(lambda s, jump=jump: 1.0 + (jump if s > 0.0 else 0.0)) != smooth

    @pytest.mark.parametrize("beside", [True, False])
    def test_a_flat_guard_is_looked_at_beside(self, beside):
        assert self.found(lambda s: s * s, beside=beside, speed=0.0) == beside
        assert self.places == pytest.approx([1.5e-7, 1.5e-10, 1.5e-13], rel=1e-12)
        assert self.planes == [("beside", 1.5, 1.5e-7), *([] if beside else ["gradient"])]
        # Also where it does not move at all.
        assert self.found(lambda s: 0.0, beside=beside, speed=0.0) == beside
        assert len(self.places) == 3

    def test_closer_looks_may_be_smooth(self):
        assert not self.found(lambda s: 1.0 if abs(s) < 1e-9 else 5.0)
        assert self.places == pytest.approx([1.5e-7, 1.5e-10], rel=1e-12)
        assert self.planes == ["gradient"]

    @pytest.mark.parametrize("rises", [1, -1])
    def test_a_jump_has_a_plane_of_its_own(self, rises):
        jumps = lambda s: rises if s < 1e-9 else 0  # noqa: E731
        assert self.found(lambda s: 5.0, jumps=jumps)
        assert self.planes == [("jump", 1.5, self.places[1], float(rises))]
        assert len(self.places) == 2
        # If it has none, it may have one beside.
        for beside in (True, False):
            assert self.found(lambda s: 5.0, jumps=jumps, plane=False, beside=beside) == beside
            assert self.planes[1:] == [("beside", 1.5, 1.5e-7), *([] if beside else ["gradient"])]

    @pytest.mark.parametrize("t", [1e6, -1e6])
    def test_no_look_is_closer_than_rounding_of_time_allows(self, t):
        finest = 1e3 * EPSILON * 1e6
        assert self.found(lambda s: s * s, t=t, speed=0.0)
        assert self.places == pytest.approx([finest] * 3, rel=1e-12)
        assert self.planes == [("beside", 1.5, pytest.approx(finest, rel=1e-12))]
