"""How long the signs of a guard that is zero where a step starts are noise, rule by rule."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.guards import hidden
from hybrid.kernels.guards.pieces import NO_COLUMN, Guard
from hybrid.kernels.types.codes import HIGH, LOW
from hybrid.kernels.types.layout import EPSILON, Path
from tests.hybrid.kernels.plain import plain

kernels = plain(hidden)
GUARD = Guard(1, NO_COLUMN, 1, 0, 0.0, 0.0, 0.0)
# One component, which is the place itself: time is 10 plus half of the place.
PATH, CLOCK, START, PACE = np.array([[0.0], [1.0]]), -1, 10.0, 0.5
ALONG = Path(PATH, 1, CLOCK, START, PACE, 1.0, True)


def memory():
    return SimpleNamespace(
        state=np.zeros(1), scalar=np.zeros(1), gradient=np.zeros(2), registers=np.full((4, 6), 99.0)
    )


def opaque(guard):
    """A model whose second transition has an opaque guard, as a function of time and place."""

    def write(transition, t, x, parameters, out):
        assert transition == 1
        out[0] = guard(t, x[0])

    def gradient(transition, t, x, parameters, out):
        assert (transition, t, x[0]) == (1, START, 3.0)
        out[:] = -2.0, 7.0

    return SimpleNamespace(
        dimension=1,
        parameters=np.zeros(0),
        programs=SimpleNamespace(first=np.array([0, 3, 3, 5])),
        propagator=np.zeros(1),
        guard=write,
        guard_gradient=gradient,
    )


def bounded(low, high):
    """A model whose guard has these bounds on the first half of each place."""

    def bound(programs, program, path, middle, radius, registers):
        assert (program, path is ALONG) == (1, True)
        assert middle == radius
        registers[2] = 0.0
        registers[2, LOW], registers[2, HIGH] = low(2.0 * middle), high(2.0 * middle)
        return 2

    programs = SimpleNamespace(first=np.array([0, 0, 3]))
    return SimpleNamespace(dimension=1, parameters=np.zeros(0), programs=programs, bound=bound)


def test_a_sample_is_the_guard_at_its_place_and_time():
    model = opaque(lambda t, x: 100.0 * t + x)
    assert kernels.sample(model, 1, ALONG, 4.0, memory()) == 1204.0


class TestFarthestFromZero:
    def far(self, model, place=2.0):
        return kernels.farthest_from_zero(model, ALONG, GUARD, place, memory())

    @pytest.mark.parametrize(("low", "high", "far"), [(-3.0, 2.0, 3.0), (-0.25, 0.5, 0.5), (1.0, 4.0, 4.0)])
    def test_is_the_farther_bound(self, low, high, far):
        assert self.far(bounded(lambda s: low, lambda s: high)) == far

    def test_is_the_bound_up_to_the_place(self):
        assert self.far(bounded(lambda s: 0.0, lambda s: s), 2.0) == 2.0

    @pytest.mark.parametrize("bounds", [(math.nan, 1.0), (math.nan, math.nan), (-math.inf, 1.0)])
    def test_is_infinite_without_bounds(self, bounds):
        assert self.far(bounded(*(lambda s, each=each: each for each in bounds))) == math.inf

    @pytest.mark.parametrize("i", range(10))
    @pytest.mark.parametrize("value", [3.0, -3.0])
    def test_is_sampled_at_eight_places(self, i, value):
        """The start, where the guard is zero, is none of them, and the end is the last one."""
        model = opaque(lambda t, x: value if x == 2.0 * i / 8 else 0.5)
        assert self.far(model) == (3.0 if 1 <= i <= 8 else 0.5)

    def test_is_infinite_where_a_sample_is_no_number(self):
        model = opaque(lambda t, x: math.nan if x == 1.0 else 0.5)
        assert self.far(model) == math.inf


class TestHiddenUntil:
    """The guard is the third power of the place, so that each halving makes it eight times smaller."""

    def until(self, guard=lambda t, x: x**3, *, jumps=False, rounding=0.0, exact=True, length=1.0, end=1.0):
        tested = plain(
            hidden, may_jump=lambda *given: jumps, rounding_band=lambda *given: rounding
        ).hidden_until
        method = SimpleNamespace(atol=1e-3, rtol=0.25)
        run = SimpleNamespace(mode=0, y=np.array([3.0]), scale=np.array([0.5]))
        path = ALONG._replace(length=length, exact=exact)
        return tested(opaque(guard), method, run, path, GUARD, end, memory())

    def test_ends_where_the_guard_is_farther_from_zero_than_rounding(self):
        assert self.until(rounding=1e-6) == (2.0**-7, False)
        assert self.until(rounding=2.0**-6) == (2.0**-2, False)
        assert self.until(rounding=2.0**-6, length=3.0) == (0.1875, False)

    def test_counts_what_the_size_of_the_guard_on_the_step_rounds(self):
        assert self.until() == (2.0**-16, False)
        assert self.until(lambda t, x: 8.0 * x**3) == (2.0**-16, False)
        assert 16 * EPSILON == 2.0**-48

    def test_counts_the_error_of_the_method(self):
        """The tolerances move the guard by ``|-2| (1e-3 + 0.25 * 0.5) = 0.252``."""
        assert self.until(exact=False, end=1e-9) == (0.5, False)
        assert self.until(lambda t, x: 2.0 * x**3, exact=False, end=1e-9) == (0.5, False)
        assert self.until(lambda t, x: 2.1 * x**3, exact=False, end=1e-9) == (0.25, False)
        # The guard at the end of the step is larger, and so may be the error of the interpolant.
        assert self.until(lambda t, x: 2.1 * x**3, exact=False, end=0.3) == (0.5, False)
        assert self.until(lambda t, x: 2.1 * x**3, exact=False, end=-2.1) == (1.0, False)
        assert self.until(lambda t, x: 2.1 * x**3, exact=True, end=-2.1) == (2.0**-16, False)

    def test_rests_if_the_whole_step_is_rounding(self):
        assert self.until(rounding=1.0) == (1.0, True)
        assert self.until(rounding=1.0 - 1e-9) == (0.5, False)
        assert self.until(lambda t, x: 0.0) == (1.0, True)
        # What may be an error of the method is no rest.
        assert self.until(lambda t, x: 0.1, exact=False) == (1.0, False)

    def test_looks_for_the_place_up_to_which_the_guard_has_a_value(self):
        guard = lambda t, x: math.nan if x > 0.2 else x**3  # noqa: E731
        assert self.until(guard, rounding=1.0) == (0.125, False)
        assert self.until(guard, rounding=2.0**-12) == (2.0**-4, False)

    def test_ends_at_the_start_for_a_guard_that_jumps(self):
        assert self.until(rounding=1.0, jumps=True) == (0.0, False)

    def test_ends_somewhere_for_a_guard_that_stays_far_from_zero(self):
        assert self.until(lambda t, x: 1.0) == (2.0**-50, False)
