"""Rates, stages, errors and the first step of explicit methods, rule by rule, on fields that are known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import step
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(step)
MATRIX = np.array([[-0.5, 2.0], [-3.0, 0.25]])
CLOSE = {"rel": 1e-14, "abs": 0.0}


def rotation(**more):
    """``x' = A x + (t, 0)`` in mode 1, with the derivative in time in the last column of the Jacobian."""

    def field(mode, t, x, parameters, out):
        assert (mode, parameters) == (1, "p")
        out[:2] = MATRIX @ x[:2] + [t, 0.0]

    def variational_field(mode, t, y, parameters, out):
        field(mode, t, y, parameters, out)
        for first in range(2, len(y) - len(y) % 2, 2):
            out[first : first + 2] = MATRIX @ y[first : first + 2]

    def field_jacobian(mode, t, x, parameters, out):
        assert (mode, t, x[:2].tolist(), parameters) == (1, 0.25, [3.0, 4.0], "p")
        out[:, :2], out[:, 2] = MATRIX, [1.0, 0.0]

    given = {"field": field, "variational_field": variational_field, "field_jacobian": field_jacobian} | more
    return SimpleNamespace(
        dimension=2,
        parameters="p",
        first_slope=np.array([[9, 9, 9], [0, 2, 4]]),
        slope_column=np.array([0, 1, 0, 1]),
        period=0.0,
        **given,
    )


class TestRates:
    @pytest.mark.parametrize("tangents", [0, 1, 2])
    def test_vectors_move_by_the_jacobian(self, tangents):
        y = np.array([3.0, 4.0, 1.0, 2.0, -5.0, 7.0])
        out = np.full(6, 88.0)
        kernels.rates_by_jacobian(rotation(), 1, 0.25, y, tangents, np.full((2, 3), 77.0), out)
        vectors = [MATRIX @ y[:2] + [0.25, 0.0], MATRIX @ y[2:4], MATRIX @ y[4:]]
        expected = np.concatenate(vectors[: 1 + tangents])
        assert out.tolist() == [*expected, *[88.0] * (4 - 2 * tangents)]

    def test_the_variational_field_is_for_runs_with_tangent_vectors_only(self):
        asked = []
        model = SimpleNamespace(
            parameters="p",
            field=lambda *given: asked.append(("field", *given)),
            variational_field=lambda *given: asked.append(("variational", *given)),
        )
        for tangents in range(3):
            kernels.rates(model, 1, 0.25, "y", tangents, "out")
        given = (1, 0.25, "y", "p", "out")
        assert asked == [("field", *given), ("variational", *given), ("variational", *given)]

    def test_without_tangent_vectors_the_jacobian_is_not_evaluated(self):
        out = np.zeros(2)
        model = rotation(field_jacobian=None)
        kernels.rates_by_jacobian(model, 1, 0.25, np.array([3.0, 4.0]), 0, None, out)
        assert out.tolist() == [6.75, -8.0]

    def test_field_and_jacobian_for_python(self):
        out, jacobian = np.zeros(2), np.full((2, 3), 88.0)
        kernels.field_at(rotation(), 1, 0.25, np.array([3.0, 4.0]), out)
        kernels.jacobian_at(rotation(), 1, 0.25, np.array([3.0, 4.0]), jacobian)
        assert out.tolist() == [6.75, -8.0]
        assert jacobian.tolist() == [[-0.5, 2.0, 1.0], [-3.0, 0.25, 0.0]]


def test_a_combination_of_stages():
    """A stage of weight zero does not count, whatever it holds, nor do those after ``count``."""
    stages = np.array([[1.0, 2.0, 88.0], [math.nan] * 3, [4.0, -8.0, 88.0], [math.nan] * 3])
    out = np.full(3, 77.0)
    kernels.combine(np.array([10.0, 20.0, 30.0]), 0.5, [3.0, 0.0, -1.0, 1.0], stages, 3, 2, out)
    assert out.tolist() == [10.0 + 1.5 - 2.0, 20.0 + 3.0 + 4.0, 77.0]


def test_error_estimates_need_only_stages_that_have_a_weight():
    stages = np.array([[1.0, 2.0, 88.0], [math.nan] * 3, [4.0, -8.0, 88.0], [16.0, 32.0, 88.0]])
    work = SimpleNamespace(stages=stages, error=np.full(3, 77.0), second_error=np.full(3, 77.0))
    method = SimpleNamespace(
        error=np.array([2.0, 0.0, 0.0, 1.0]), second_error=np.array([0.0, 0.0, -3.0, 1.0])
    )
    kernels.estimate_error(method, 2, work)
    assert work.error.tolist() == [2.0 + 16.0, 4.0 + 32.0, 77.0]
    assert work.second_error.tolist() == [-12.0 + 16.0, 24.0 + 32.0, 77.0]


class TestErrorRatio:
    ATOL, RTOL, H = 0.5, 0.25, 0.125

    def ratio(self, error, second=None, *, y=(0.0,) * 6, new=(0.0,) * 6, tangents=0):
        work = SimpleNamespace(
            error=np.array([*error, *[0.0] * 6]),
            second_error=np.array([*(second or ()), *[0.0] * 6]),
            new=np.array(new),
        )
        method = SimpleNamespace(atol=self.ATOL, rtol=self.RTOL)
        return kernels.error_ratio(method, self.H, np.array(y), 2, tangents, work)

    def test_is_the_root_mean_square_of_errors_in_tolerances(self):
        assert self.ratio([0.5, 0.0]) == pytest.approx(self.H / math.sqrt(2.0), **CLOSE)
        assert self.ratio([1.5, 2.0]) == pytest.approx(self.H * 5.0 / math.sqrt(2.0), **CLOSE)

    def test_the_second_estimate_damps_it(self):
        expected = self.H * 25.0 / math.sqrt(2.0 * (25.0 + 0.01 * (36.0 + 64.0)))
        assert self.ratio([1.5, 2.0], [3.0, 4.0]) == pytest.approx(expected, **CLOSE)

    @pytest.mark.parametrize("sizes", [(-6.0, 2.0), (2.0, -6.0)])
    def test_the_larger_end_of_the_step_is_the_size(self, sizes):
        found = self.ratio([0.0, 2.0], y=(0.0, sizes[0]), new=(0.0, sizes[1]))
        assert found == pytest.approx(self.H * (2.0 / 2.0) / math.sqrt(2.0), **CLOSE)

    def test_a_tangent_vector_is_weighed_against_its_own_root_mean_square(self):
        new = (0.0, 0.0, 8.0, 0.0, 0.0, 0.0)
        mean = 8.0 / math.sqrt(2.0)
        found = self.ratio([0.0, 0.0, 0.0, 4.0], new=new, tangents=1)
        assert found == pytest.approx(self.H * 4.0 / (0.25 * mean) / math.sqrt(2.0), **CLOSE)
        found = self.ratio([0.0, 0.0, 4.0, 0.0], new=new, tangents=2)
        assert found == pytest.approx(self.H * 4.0 / (0.25 * (mean + 8.0)) / math.sqrt(2.0), **CLOSE)

    def test_a_vector_of_one_component_has_no_absolute_size(self):
        work = SimpleNamespace(error=np.array([0.0, 4.0]), second_error=np.zeros(2), new=np.array([0.0, 8.0]))
        method = SimpleNamespace(atol=99.0, rtol=0.25)
        found = kernels.error_ratio(method, self.H, np.zeros(2), 1, 1, work)
        assert found == pytest.approx(self.H * 4.0 / (0.25 * (8.0 + 8.0)), **CLOSE)

    def test_the_worst_of_state_and_vectors_counts(self):
        """An error of one vector is not diluted by others that have none."""
        new = (0.0, 0.0, 8.0, 0.0, 8.0, 0.0)
        alone = self.ratio([0.0, 0.0, 0.0, 4.0], new=new, tangents=1)
        assert self.ratio([0.0, 0.0, 0.0, 4.0], new=new, tangents=2) == alone
        assert self.ratio([0.0, 0.0, 0.0, 1.0, 0.0, 4.0], new=new, tangents=2) == alone
        assert self.ratio([50.0, 0.0, 0.0, 4.0], new=new, tangents=1) > alone
        # Errors of vectors that the run does not have do not count.
        assert self.ratio([0.0, 0.0, 0.0, 4.0], new=new, tangents=0) == 0.0

    def test_a_vector_of_zero_has_no_error_that_is_allowed(self):
        assert self.ratio([0.0, 0.0, 0.0, 0.0], tangents=1) == 0.0
        assert self.ratio([0.0, 0.0, 0.0, 1e-200], tangents=1) == pytest.approx(
            self.H * 1e100 / math.sqrt(2.0), **CLOSE
        )

    @pytest.mark.parametrize("place", [0, 1, 2, 3])
    @pytest.mark.parametrize("error", [math.nan, math.inf])
    def test_an_error_without_bound_is_no_number(self, error, place):
        error = [0.0] * place + [error]
        assert math.isnan(self.ratio(error, new=(1.0,) * 6, tangents=1))


class TestExplicit:
    """Heun's method of order three, with one more stage for its interpolant."""

    A = np.array([[0, 0, 0, 0, 0], [1 / 3, 0, 0, 0, 0], [0, 2 / 3, 0, 0, 0], [0.25, 0, 0.75, 0, 0]])
    A = np.vstack([A, [0.125, 0.25, 0.0625, 0.5, 0]])
    B, C = np.array([0.25, 0.0, 0.75]), np.array([0.0, 1 / 3, 2 / 3, 1.0, 0.6])

    def attempt(self, tangents):
        y = np.array([3.0, 4.0, 1.0, 2.0, -5.0, 7.0])[: 2 + 2 * tangents]
        stages = np.full((5, 7), 88.0)
        model = rotation()
        kernels.rates(model, 1, 0.5, y, tangents, stages[0])
        work = SimpleNamespace(stages=stages, trial=np.zeros(y.size), new=np.zeros(y.size))
        work.error, work.second_error = np.zeros(y.size), np.zeros(y.size)
        method = SimpleNamespace(
            a=self.A, b=self.B, c=self.C, atol=1e-3, rtol=1e-2, exponent=1 / 3, implicit=0
        )
        method.error, method.second_error = np.array([1.0, 0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0, -1.0])
        return model, method, y, work

    def expected(self, y, h, stages):
        """The stages of the step at the time 0.5 from ``y``."""
        found = []
        for i in range(stages):
            at = y + h * sum((self.A[i, j] * found[j] for j in range(i)), np.zeros(y.size))
            rate = (at.reshape(-1, 2) @ MATRIX.T).ravel()
            rate[0] += 0.5 + self.C[i] * h
            found.append(rate)
        return np.array(found)

    def test_stages_of_the_interpolant_are_those_of_the_state_alone(self):
        model, method, y, work = self.attempt(1)
        kernels.attempt_explicit(model, method, 1, 0.5, 0.25, y, 1, work)
        work.stages[4] = 88.0
        kernels.interpolation_stages(model, method, 1, 0.5, 0.25, y, work)
        assert work.stages[4, :2] == pytest.approx(self.expected(y, 0.25, 5)[4, :2], rel=1e-14)
        assert work.stages[4, 2:].tolist() == [88.0] * 5
        assert work.stages[:4, :4] == pytest.approx(self.expected(y, 0.25, 4), rel=1e-14)


def test_the_interpolant_as_powers():
    powers = np.array([[88.0, 88.0], [1.0, 2.0], [-0.5, 3.0]])
    stages = np.array([[1.0, 2.0, 99.0], [4.0, -8.0, 99.0], [99.0, 99.0, 99.0]])
    work = SimpleNamespace(stages=stages, path=np.full((4, 3), 77.0))
    method = SimpleNamespace(powers=powers, a=np.zeros((2, 2)))
    kernels.interpolant_path(method, 0.5, np.array([10.0, 20.0]), 2, work)
    assert work.path.tolist() == [
        [10.0, 20.0, 77.0],
        [0.5 * (1.0 + 8.0), 0.5 * (2.0 - 16.0), 77.0],
        [0.5 * (-0.5 + 12.0), 0.5 * (-1.0 - 24.0), 77.0],
        [77.0] * 3,
    ]


def test_what_stands_in_for_steps_that_no_mode_takes():
    ratio, length = kernels.no_step(None, 1.0)
    assert math.isnan(ratio)
    assert length == 0.0
    assert math.isnan(kernels.no_attempt(None, None, 1, 0.0, 0.1, None, 0, None))


class TestMovesNothing:
    """Steps of 2 whose rates move two states of 5 by a given number of roundings."""

    def nothing(self, *moved, timed=0, clock=1.0):
        state = np.array([5.0, -5.0])
        slopes = np.array(moved) * EPSILON * state / 2.0
        model = SimpleNamespace(dimension=2, timed=np.array([7, timed]))
        run = SimpleNamespace(mode=1, phase=clock, since_entry=0.0, y=state)
        return kernels.moves_nothing(model, run, slopes, 2.0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_is_asked_of_every_component(self, way):
        assert self.nothing(0.99 * way, 0.99 * way)
        assert not self.nothing(1.01 * way, 0.0)
        assert not self.nothing(0.0, 1.01 * way)

    def test_the_time_counts_where_the_mode_depends_on_it(self):
        for clock, moves in ((1.99, True), (2.01, False)):
            clock /= EPSILON
            assert self.nothing(0.0, 0.0, timed=1, clock=clock) == (not moves)
            assert self.nothing(0.0, 0.0, timed=0, clock=clock)
        assert not self.nothing(1.01, 0.0, timed=1, clock=2.01 / EPSILON)


class TestFirstStep:
    """From a state of two components, of which the rates are given, with a field that turns them.

    The tolerances of state and vectors are 1e-3 of their sizes and 1e-5.
    """

    def first(self, y, rates, turned, *, remaining=1e9, period=0.0, longest=math.inf, tangents=0, rtol=1e-3):
        """The rates are ``turned`` after the first trial step, which is kept."""

        def field(mode, t, x, parameters, out):
            self.trial = (t - 7.0, x.tolist())
            out[: len(turned)] = turned

        model = SimpleNamespace(
            dimension=2, parameters=None, period=period, field=field, variational_field=field
        )
        method = SimpleNamespace(rtol=rtol, atol=1e-5, max_step=longest, exponent=0.25)
        work = SimpleNamespace(trial=np.zeros(len(y)), stages=np.zeros((2, len(y) + 1)))
        work.stages[0, : len(y)] = rates
        return kernels.starting_step(model, method, 1, 7.0, np.array(y), tangents, remaining, work)

    # Of a state (9, 9) each component counts as 9 / (9e-3 + 1e-5) tolerances; that is less than 1e4.
    SCALE = 1e-3 * 9.0 + 1e-5

    def test_a_straight_orbit(self):
        """The unit is 1e4 tolerances over the speed, of which the step is (0.01 / (speed * unit))**0.25."""
        unit = 1e4 * self.SCALE / 2.0
        found = self.first((9.0, -9.0), (2.0, -2.0), (2.0, -2.0))
        assert found == pytest.approx(unit * (0.01 / 1e4) ** 0.25, **CLOSE)
        t, x = self.trial
        assert t == pytest.approx(0.01 * unit, rel=1e-12)
        assert x == pytest.approx([9.0 + 0.02 * unit, -9.0 - 0.02 * unit], rel=1e-14)

    def test_speeds_are_means_over_the_components(self):
        unit = 1e4 * self.SCALE / (2.0 / math.sqrt(2.0))
        found = self.first((9.0, -9.0), (0.0, -2.0), (0.0, -2.0))
        assert found == pytest.approx(unit * (0.01 / 1e4) ** 0.25, **CLOSE)

    @pytest.mark.parametrize("speed", [1e-6, 1e-3, 2.0])
    def test_a_slow_orbit(self, speed):
        """However few tolerances it moves per unit of time."""
        found = self.first((9.0, -9.0), (speed, -speed), (speed, -speed))
        assert found == pytest.approx(1e4 * self.SCALE / speed * (0.01 / 1e4) ** 0.25, **CLOSE)

    def test_a_state_of_many_tolerances_changes_by_its_size(self):
        """The means of both components count: of 9 and 3 in tolerances, and of rates of 2 and 0."""
        scales = np.array([9e-9 + 1e-5, 3e-9 + 1e-5])
        size = np.sqrt(np.mean((np.array([9.0, 3.0]) / scales) ** 2))
        speed = 2.0 / scales[0] / math.sqrt(2.0)
        found = self.first((9.0, -3.0), (2.0, 0.0), (2.0, 0.0), rtol=1e-9)
        assert size > 1e4
        assert found == pytest.approx(size / speed * (0.01 / size) ** 0.25, **CLOSE)

    def test_a_large_state_changes_by_its_size(self):
        """With an absolute tolerance that does not count it is 1000 tolerances, here of many more."""
        y = (9.0, 9.0, 50.0, 0.0)
        scales = np.array([self.SCALE, self.SCALE, 0.05 + 1e-3, 1e-3])
        rates = np.array([0.0, 0.0, 1.0, 3.0])
        speed = np.sqrt(np.mean((rates / scales) ** 2))
        unit = 1e4 / speed
        found = self.first(y, rates, rates, tangents=1)
        assert found == pytest.approx(unit * (0.01 / (speed * unit)) ** 0.25, **CLOSE)

    def test_a_bent_orbit(self):
        unit = 1e4 * self.SCALE / 2.0
        bend = 6.0 / self.SCALE / (0.01 * unit)
        found = self.first((9.0, -9.0), (2.0, -2.0), (8.0, 4.0))
        assert bend * unit > 1e2
        assert found == pytest.approx(unit * (0.01 / (bend * unit * unit)) ** 0.25, **CLOSE)

    @pytest.mark.parametrize("period", [0.0, 0.02, 4e-3])
    @pytest.mark.parametrize("remaining", [1e9, 0.01])
    def test_the_unit_ends_with_the_run_and_the_period(self, period, remaining):
        unit = min(1e4 * self.SCALE / 2.0, remaining, period or math.inf)
        found = self.first((9.0, -9.0), (2.0, -2.0), (2.0, -2.0), period=period, remaining=remaining)
        steepest = 2.0 / self.SCALE * unit
        assert found == pytest.approx(min(unit, unit * (0.01 / steepest) ** 0.25), **CLOSE)

    def test_a_state_at_rest_has_a_share_of_the_run(self):
        """It takes a hundredth of 1e-4 of the run if it stays there."""
        assert self.first((9.0, -9.0), (0.0, 0.0), (0.0, 0.0), remaining=3.0) == pytest.approx(3e-6, **CLOSE)
        assert self.first((9.0, -9.0), (0.0, 0.0), (0.0, 0.0), remaining=3.0, period=0.5) == pytest.approx(
            0.5e-6, **CLOSE
        )
        bend = 6.0 / self.SCALE / 3e-6
        found = self.first((9.0, -9.0), (0.0, 0.0), (6.0, -6.0), remaining=3.0)
        assert found == pytest.approx(3e-4 * (0.01 / (bend * 9e-8)) ** 0.25, **CLOSE)

    def test_is_never_longer_than_allowed(self):
        found = self.first((9.0, -9.0), (2.0, -2.0), (2.0, -2.0), longest=1e-3)
        assert found == 1e-3
        assert self.trial[0] == pytest.approx(1e-3, rel=1e-10)

    def test_is_at_most_a_hundred_trial_steps(self):
        """A state at rest with next to no curvature."""
        found = self.first((9.0, -9.0), (0.0, 0.0), (1e-9, 1e-9), remaining=3.0)
        assert found == pytest.approx(3e-4, **CLOSE)
        found = self.first((9.0, -9.0), (0.0, 0.0), (1e-17, 1e-17), remaining=3.0)
        assert found == pytest.approx(3e-6, **CLOSE)
