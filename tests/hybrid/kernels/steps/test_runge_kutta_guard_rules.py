"""Guards along a Runge-Kutta step, rule by rule, on steps whose solution is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP
from hybrid.kernels.events.resolution import MARGIN
from hybrid.kernels.steps import runge_kutta_guards
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain, run_at_guards

kernels = plain(runge_kutta_guards)


def constant(*gradient):
    """A gradient that is the same everywhere."""

    def write(transition, t, x, parameters, out):
        out[:] = gradient

    return write


def test_an_affine_guard_on_the_interpolant():
    """The guard ``3 x - 2 y + 5 t``; time runs evenly, so its coefficients do too."""
    interpolant = np.array([[0.0, 0.0], [0.5, -0.25], [1.0, 2.0], [-0.125, 4.0]])
    stages = np.array([[1.0, 2.0, 99.0], [4.0, -8.0, 99.0], [99.0, 99.0, 99.0]])
    model = SimpleNamespace(dimension=2, guard_gradient=constant(3.0, -2.0, 5.0), parameters=None)
    method = SimpleNamespace(interpolant=interpolant, a=np.zeros((2, 5)))
    work = SimpleNamespace(gradient=np.zeros(3), stages=stages, speeds=np.zeros(3), polynomial=np.zeros(6))
    found = kernels.affine_polynomial(model, method, 1, 7.0, 6.0, np.zeros(2), 10.0, work)
    speeds = [3.0 * 1.0 - 2.0 * 2.0, 3.0 * 4.0 + 2.0 * 8.0]
    expected = 10.0 + 6.0 * 5.0 * np.arange(4) / 3.0 + 6.0 * interpolant @ speeds
    assert found == 3
    assert work.polynomial.tolist() == [*expected, 0.0, 0.0]


def test_rounding_on_a_step_counts_how_far_the_guard_moves():
    """Terms that cancel in its speed do not cancel in its rounding."""
    tested = plain(runge_kutta_guards, rounding_band=lambda model, run, i, t, x, work: 1e-15 * i * t * x)
    model, run = SimpleNamespace(dimension=2), SimpleNamespace(y=3.0)
    work = SimpleNamespace(gradient=np.array([4.0, -2.0, -6.0]), stages=np.array([[-1.0, -5.0, 99.0]]))
    found = tested.rounding_on_step(model, run, 2, 7.0, 0.5, work)
    assert found == pytest.approx(42e-15 + 16.0 * EPSILON * 0.5 * (6.0 + 4.0 + 10.0), rel=1e-14, abs=0.0)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("share", [1.01, 0.99, -0.99, -1.01])
def test_the_side_of_a_guard_that_is_left_alone_is_that_at_the_end(side, share):
    band = 1e-3
    tested = plain(
        runge_kutta_guards,
        guard_value=lambda model, i, t, x, scalar: share * band if (i, t, x) == (1, 7.0, "new") else math.nan,
        rounding_band=lambda model, run, i, t, x, work: band if (i, t, x) == (1, 7.0, "new") else math.nan,
    )
    model = SimpleNamespace(guard_gradient=constant(2.0), parameters=None)
    run = SimpleNamespace(side=[9, side], on_guard=[9, BY_STEP])
    work = SimpleNamespace(new="new", scalar=None, gradient=np.zeros(1))
    tested.leave_guard(model, run, 1, 7.0, work)
    if abs(share) > 1.0:
        assert (run.side, run.on_guard) == ([9, 1 if share > 0.0 else -1], [9, 0])
    else:
        assert (run.side, run.on_guard) == ([9, side], [9, BY_STEP])
    assert work.gradient.tolist() == [2.0]


class TestIsResolved:
    """A step of 2 from the time 7; the guard is ``3 x - 2 y`` unless stated otherwise."""

    def resolved(self, *, keeps=(False, False), rates=((0.0, 0.0),) * 3, gradient=(3.0, -2.0, 0.0), **given):
        asked = []

        def keeps_sign(model, transition, t, x, work):
            asked.append((transition, t, x.tolist(), work.field_after.tolist()))
            return keeps[len(asked) - 1]

        model = SimpleNamespace(dimension=2, guard_gradient=given.get("write", constant(*gradient)))
        model.parameters = None
        method = SimpleNamespace(b=np.zeros(2))
        run = SimpleNamespace(y=np.array(given.get("y", (0.0, 0.0))))
        work = SimpleNamespace(
            error=np.array(given.get("error", (0.0, 0.0))),
            second_error=np.array(given.get("second", (0.0, 0.0))),
            new=np.array(given.get("new", (0.0, 0.0))),
            stages=np.array(rates),
            field_after=np.zeros(2),
            gradient=np.zeros(3),
        )
        tested = plain(runge_kutta_guards, keeps_sign=keeps_sign)
        self.asked = asked
        return tested.is_resolved(model, method, run, 1, 7.0, 2.0, work)

    @pytest.mark.parametrize("keeps", [(True, True), (True, False), (False, True), (False, False)])
    def test_the_signs_at_both_ends_bear_the_error(self, keeps):
        found = self.resolved(
            keeps=keeps, error=(-1.0, 0.5), second=(0.25, -2.0), y=(1.0, 2.0), new=(3.0, 4.0)
        )
        assert found == all(keeps)
        error = [2.0 * 1.25, 2.0 * 2.5]
        ends = [(1, 7.0, [1.0, 2.0], error), (1, 9.0, [3.0, 4.0], error)]
        assert self.asked == (ends if keeps[0] else ends[:1])

    @pytest.mark.parametrize("place", ["start", "end", "way"])
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_an_error_below_rounding_of_the_state_does_not_count(self, place, sign):
        """Its size is the largest of both ends and the way of the first rate."""
        for share in (0.99, 1.01):
            size = sign * share / (16.0 * EPSILON)
            self.resolved(
                error=(0.0, 0.5),
                y=(0.0, size if place == "start" else 0.0),
                new=(0.0, size if place == "end" else 0.0),
                rates=((0.0, 0.5 * size if place == "way" else 0.0), (0.0, 0.0), (0.0, 0.0)),
            )
            assert self.asked[0][3] == [0.0, 0.0 if share > 1.0 else 1.0]

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_a_guard_that_moves_on_through_zero_is(self, sign):
        """The error moves it by 2 (3 * 1 + 2 * 0.5) = 8, and each speed moves it by far more."""
        least = MARGIN * 8.0 / 2.0

        def found(before, after):
            rates = ((0.0, -0.5 * sign * before), (99.0, 99.0), (0.0, -0.5 * sign * after))
            return self.resolved(error=(1.0, 0.0), second=(0.0, -0.5), rates=rates)

        assert found(1.01 * least, 1.01 * least)
        assert found(5.0 * least, 1.01 * least)
        assert found(1.01 * least, 5.0 * least)
        assert not found(0.99 * least, 1.01 * least)
        assert not found(1.01 * least, 0.99 * least)
        assert not found(2.0 * least, -2.0 * least)
        assert not found(0.0, 2.0 * least)

    def test_its_speeds_are_those_at_the_ends(self):
        def write(transition, t, x, parameters, out):
            out[:] = 0.0, 0.0, {(7.0, 5.0): 1.0, (9.0, 6.0): way}[t, x[0]]

        for way in (1.0, -1.0):
            assert self.resolved(write=write, y=(5.0, 0.0), new=(6.0, 0.0)) == (way > 0.0)


class TestEarliest:
    """Guards that are the components of a state, in Bernstein form on a step of 4 from the time 7."""

    H, DEGREE = 4.0, 6

    def earliest(self, *guards, sides=None, on_guard=None, band=0.0, rounding=0.0, **given):
        """``guards`` are Bernstein coefficients, or what ``crossing_on_path`` finds: place, side, share."""
        count, path = len(guards), given.get("path", {})
        coefficients = np.array(guards)
        start = coefficients[:, 0]
        stages = np.zeros((self.DEGREE + 1, count))
        stages[1:] = (coefficients.T[1:] - start) / self.H
        # The rates at the start are no part of this interpolant.
        stages[0] = 777.0
        interpolant = np.eye(self.DEGREE + 1)
        interpolant[0, 0] = 0.0
        asked = []

        def guard(transition, t, x, parameters, out):
            assert t == (11.0 if x is work.new else 7.0)
            out[0] = x[transition - 1]

        def gradient(transition, t, x, parameters, out):
            out[:] = 0.0
            out[transition - 1] = 1.0

        def crossing_on_path(model, method, run, transition, *rest):
            asked.append((transition, *rest[:-1]))
            return path[transition]

        def underflows(model, transition, t, x, later, y, scalar):
            assert (t, later, x is run.y, y is work.new) == (7.0, 11.0, True, True)
            return transition in given.get("underflows", ())

        def resolved(model, method, run, transition, t, h, work):
            assert (t, h) == (7.0, self.H)
            asked.append(("resolved", transition))
            return transition not in given.get("blurred", ())

        def leave_guard(model, run, transition, t, work):
            asked.append(("leave", transition, t))

        tested = plain(
            runge_kutta_guards,
            crossing_on_path=crossing_on_path,
            error_band=lambda method, run, gradient, n: band if n == count and gradient.any() else math.nan,
            rounding_on_step=lambda model, run, transition, t, h, work: rounding,
            is_resolved=resolved,
            underflows=underflows,
            leaves_as_known=lambda *arguments: True,
            leave_guard=leave_guard,
        )
        model = SimpleNamespace(
            dimension=count,
            parameters=None,
            guard=guard,
            guard_gradient=gradient,
            first_outgoing=np.array([0, 1, 1 + count]),
            outgoing=np.arange(1 + count),
            affine_guard=np.array([9, *(0 if i in path else 1 for i in range(1, 1 + count))]),
            direction=np.array([9, *given.get("directions", [0] * count)]),
        )
        sides = sides or [1 if each > 0.0 else -1 for each in start]
        run = run_at_guards(start.copy(), sides, on_guard, given.get("fired", -1))
        work = SimpleNamespace(
            path=None,
            new=np.array(given.get("new", coefficients[:, -1])),
            stages=stages,
            speeds=np.zeros(self.DEGREE + 1),
            error=np.full(count, given.get("error", 0.0)),
            second_error=np.zeros(count),
            field_after=np.zeros(count),
            gradient=np.zeros(count + 1),
            scalar=np.zeros(1),
            # Behind the coefficients is what an earlier guard has left.
            polynomial=np.full(40, 88.0),
            stack=np.full((80, 40), 88.0),
        )
        method = SimpleNamespace(
            interpolant=interpolant,
            a=np.zeros((self.DEGREE + 1, self.DEGREE + 1)),
            b=np.zeros(2),
            powers=np.zeros((4, 7)),
        )
        found = tested.earliest_crossing(
            model, method, run, 7.0, self.H, given.get("ignored", NO_TRANSITION), 0.375, work
        )
        self.run, self.asked = run, asked
        return found

    def bernstein(self, *roots, factor=1.0):
        """Coefficients of a polynomial of the place on the step, which has these roots."""
        powers = np.zeros(self.DEGREE + 1)
        powers[: len(roots) + 1] = factor * np.polynomial.Polynomial.fromroots(roots).coef
        n = self.DEGREE
        return [
            sum(math.comb(i, k) / math.comb(n, k) * powers[k] for k in range(i + 1)) for i in range(n + 1)
        ]

    NONE = (NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_crosses_at_its_root(self, way):
        for root in (0.125, 0.5, 0.875):
            for direction in (0, -1, 1):
                guard = self.bernstein(root, 5.0, factor=way)
                found = self.earliest(guard, directions=[way * direction])
                if direction == 1:
                    assert found == self.NONE
                    # An event on the last half of the rest of the step finds it on the other side.
                    assert self.run.side[1] == self.run.rehearsal[3, 1] == -way
                    assert self.run.passed[1] == pytest.approx(0.5 + 0.5 * root, rel=1e-13)
                else:
                    assert found == (pytest.approx(root, rel=1e-13), 1, 1.0, NO_TRANSITION)
                    assert self.run.side[1] == self.run.rehearsal[3, 1] == way
                assert self.run.rehearsal[0, 1] == way
                assert self.run.rehearsal[1, 1] == 0

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_the_earliest_of_several(self, way):
        near, far, none = (self.bernstein(root, factor=-way) for root in (0.25, 0.75, 9.0))
        for guards, place in (((near, far, none), 1), ((far, none, near), 3), ((none, near, near), 2)):
            found = self.earliest(*guards)
            assert found == (pytest.approx(0.25, rel=1e-13), place, 1.0, NO_TRANSITION)
            assert self.run.side.tolist() == [9, way, way, way]
        assert self.earliest(none, none) == self.NONE
        assert self.run.rehearsal[3].tolist() == [88, 0, 0]
        # Guards that stay beyond the band are not asked anything.
        assert self.asked == []
        assert self.earliest(none, none, band=9.1) == self.NONE
        assert self.asked == [("resolved", 1), ("resolved", 2)]

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_that_turns_back_has_passed_before_it_crosses(self, way):
        """A guard that crosses between both places is an event before the second one."""
        turning = self.bernstein(0.25, 0.75, factor=way)
        assert self.earliest(turning, directions=[-way])[0] == pytest.approx(0.25, rel=1e-13)
        found = self.earliest(turning, directions=[way])
        assert found == (pytest.approx(0.75, rel=1e-13), 1, 1.0, NO_TRANSITION)
        assert self.run.passed[1] == pytest.approx(0.5, rel=1e-13)
        assert self.run.rehearsal[3, 1] == -way
        for root, side in ((0.4, way), (0.6, -way)):
            found = self.earliest(turning, self.bernstein(root), directions=[way, 0])
            assert found[:2] == (pytest.approx(root, rel=1e-13), 2)
            assert self.run.rehearsal[3, 1] == side

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_touches(self, way):
        touching = np.array(self.bernstein(0.4, 0.4, factor=way)) + way * 1e-6
        for band, place in ((1e-5, 0.4), (1e-7, NO_ROOT)):
            assert self.earliest([*touching], band=band) == self.NONE
            assert self.run.grazing_place == pytest.approx(place, rel=1e-6)
        # One touch per step: it ends between the first two.
        other = np.array(self.bernstein(0.6, 0.6, factor=way)) + way * 1e-6
        found = self.earliest([*touching], [*other], band=1e-5)
        assert found[2] == pytest.approx(0.4 + 0.3819 * 0.2, rel=1e-6)
        found = self.earliest([*touching], [*other], band=1e-5, path={2: (NO_ROOT, 1, 0.25)})
        assert found == (NO_ROOT, NO_TRANSITION, 0.25, NO_TRANSITION)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("on_guard", [BY_SPEED, BY_ACCELERATION])
    def test_roots_at_the_start_are_known(self, way, on_guard):
        roots = [0.0] * on_guard
        guard = self.bernstein(*roots, 0.5, factor=-way)
        # What the state has there is rounding.
        shifted = [each + 0.01 * way for each in guard]
        for given in (guard, shifted):
            found = self.earliest(given, sides=[way], on_guard=[on_guard])
            assert found == (pytest.approx(0.5, rel=1e-12), 1, 1.0, NO_TRANSITION)
            assert self.run.on_guard[1] == 0
            assert self.run.rehearsal[1, 1] == on_guard
            assert self.asked == []

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_start_that_the_error_outweighs_is_blurred(self, way):
        """Its speed moves it by 0.5 over the step of 4, and so does an error of 1.25e-3 with its margin."""
        guard = self.bernstein(0.0, 0.5, factor=-way)
        for error, blurred in ((0.9e-3, NO_TRANSITION), (1.5e-3, 1)):
            found = self.earliest(guard, sides=[way], on_guard=[BY_SPEED], error=error)
            assert found == (pytest.approx(0.5, rel=1e-12), 1, 1.0, blurred)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_touch_after_a_known_root(self, way):
        square, line = self.bernstein(0.0, 0.5, 0.5, factor=way), self.bernstein(0.0, factor=way)
        guard = [*(np.array(square) + 1e-9 * np.array(line))]
        assert self.earliest(guard, sides=[way], on_guard=[BY_SPEED], band=1e-8) == self.NONE
        assert self.run.grazing_place == pytest.approx(0.5, rel=1e-5)

    def test_a_guard_at_rest_stays_on_zero(self):
        rising = [0.0, *[0.0] * 5, 0.5e-3]
        for guard in (rising, [-each for each in rising], [5.0 + each for each in rising]):
            for rounding, stays in ((0.51e-3, True), (0.49e-3, False)):
                self.earliest(guard, sides=[1], on_guard=[BY_SPEED], rounding=rounding)
                assert self.run.on_guard[1] == (BY_SPEED if stays else 0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_whose_step_shows_the_side(self, way):
        """It goes the other way at once: that is a crossing unless its transition has just fired."""
        guard = self.bernstein(0.0, 0.0, 0.0, factor=way)
        assert self.earliest(guard, sides=[-way], on_guard=[BY_STEP])[:2] == (0.0, 1)
        assert self.earliest(guard, sides=[-way], on_guard=[BY_STEP], fired=1) == self.NONE
        assert self.run.side[1] == way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_signs_within_the_noise_are_hidden(self, way):
        """``s^3 (s - 1/32) (s - 3/4)``: the early root is noise, the later one is found beyond it."""
        guard = self.bernstein(0.0, 0.0, 0.0, 0.03125, 0.75, factor=-way)
        found = self.earliest(guard, sides=[way], on_guard=[BY_STEP], band=1e-4)
        assert found == (pytest.approx(0.75, rel=1e-12), 1, 1.0, NO_TRANSITION)
        assert self.run.rehearsal[3, 1] == way
        # The end of the step is more exact than its interpolant.
        ended = [*guard[:-1], guard[-1] + 0.5 * way]
        found = self.earliest(ended, sides=[way], on_guard=[BY_STEP], band=1e-4, new=[guard[-1]])
        assert found == (pytest.approx(0.75, rel=1e-12), 1, 1.0, NO_TRANSITION)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_crossing_that_the_error_may_have_made_is_blurred(self, way):
        crossing, none = self.bernstein(0.5, factor=way), self.bernstein(-0.5, factor=way)
        assert self.earliest(crossing, none, blurred=(1,)) == (pytest.approx(0.5), 1, 1.0, 1)
        assert self.earliest(none, crossing, blurred=(2,))[3] == 2
        assert self.earliest(none, crossing, blurred=(1,))[3] == NO_TRANSITION
        # A guard that is zero at the start tells its side.
        held = self.bernstein(0.0, 0.5, factor=-way)
        found = self.earliest(held, sides=[way], on_guard=[BY_SPEED], blurred=(1,))
        assert found[3] == NO_TRANSITION

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_that_underflows_has_no_crossing(self, way):
        guard = self.bernstein(0.5, factor=way)
        assert self.earliest(guard, guard, underflows=(1, 2), blurred=(1, 2)) == self.NONE
        assert self.earliest(guard, guard, underflows=(1,))[:2] == (pytest.approx(0.5), 2)
        assert self.run.side.tolist() == [9, -way, -way]

    def test_an_ignored_guard_is_left_to_its_side_at_the_end(self):
        near, far = self.bernstein(0.25), self.bernstein(0.5)
        found = self.earliest(near, far, ignored=1)
        assert found == (pytest.approx(0.5), 2, 1.0, NO_TRANSITION)
        assert self.asked == [("leave", 1, 11.0), ("resolved", 2)]
        assert (self.run.grazing_place, self.run.grazing_guard, self.run.grazing_value) == (0.375, 1, 0.0)
        assert self.run.rehearsal[0].tolist() == [88, -1, -1]

    @pytest.mark.parametrize("on_guard", [0, BY_SPEED, BY_STEP])
    def test_guards_that_are_not_affine(self, on_guard):
        guard = self.bernstein(-0.5)
        held = on_guard != 0
        for theta, share, fired, proved in ((0.25, 1.0, 1, 1.0), (NO_ROOT, 0.5, NO_TRANSITION, 0.5)):
            found = self.earliest(guard, sides=[1], on_guard=[on_guard], path={1: (theta, -1, share)})
            assert found == (theta, fired, proved, NO_TRANSITION)
            end = 1.5 if on_guard == BY_STEP else 0.0
            call = (1, None, 3, -1, 7.0, 4.0, 1.0, pytest.approx(end), False)
            assert self.asked == [call] if held else [call, ("resolved", 1)]
            assert self.run.side[1] == (1 if fired == 1 else -1)
            assert self.run.rehearsal[3, 1] == 1
        found = self.earliest(guard, guard, path={1: (NO_ROOT, 1, 0.5), 2: (NO_ROOT, 1, 0.75)})
        assert found == (NO_ROOT, NO_TRANSITION, 0.5, NO_TRANSITION)
