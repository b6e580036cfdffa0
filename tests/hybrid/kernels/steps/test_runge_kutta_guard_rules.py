"""Guards along a Runge-Kutta step, rule by rule, on steps whose solution is known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.onset import BY_STEP
from hybrid.kernels.events.resolution import MARGIN
from hybrid.kernels.steps import runge_kutta_guards
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

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
