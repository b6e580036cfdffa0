"""The parts of the paper's method by themselves, as plain Python: the field, and numerical derivatives."""

from inspect import getmembers

import numpy as np
import pytest
from numba import cfunc

import models
from hybrid.compiler.cache.loader import load_kernels
from hybrid.kernels.types.kinds import REAL, VECTOR
from hybrid.kernels.types.numba_types import signature_of
from hybrid.system.derivatives import evaluate
from lyapunov.study import kernels
from lyapunov.study.ode23s import parameters_of, scratch
from lyapunov.study.places import DFDT, EVALUATIONS, F0, INCREMENTS, NEW, THRESHOLDS

EPSILON = np.finfo(float).eps


@pytest.fixture(autouse=True)
def _as_plain_python(monkeypatch):
    load_kernels("lyapunov.study.kernels")
    for name, each in getmembers(kernels, lambda each: hasattr(each, "py_func")):
        monkeypatch.setattr(kernels, name, each.py_func)


def field_of(system, mode, t, x, p):
    return evaluate(system.variables, system.modes[system.mode_index(mode)].field, t, x, p)


@pytest.mark.parametrize("seed", range(6))
def test_the_founding_field_and_its_linearisation(seed):
    """Both bodies apart, and in contact; tangent vectors against the central difference of the field."""
    system, rng = models.vibroimpact(), np.random.default_rng(seed)
    omega, t = rng.uniform(7.0, 8.0), rng.uniform(0.0, 1.0)
    p = parameters_of(system, omega)
    x = rng.uniform(-1.0, 1.0, 4)
    x[1] = x[0] + (0.3 if seed % 2 else -1e-3)
    vectors = rng.uniform(-1.0, 1.0, (3, 4))
    y = np.concatenate([x, vectors.ravel()])
    out = np.empty(16)
    kernels.founding_field(t, y, p, out)
    mode = "free" if x[1] > x[0] else "contact"
    wanted = field_of(system, mode, t, x, system.parameter_values({"omega": omega}))
    np.testing.assert_allclose(out[:4], wanted, rtol=1e-12)
    for vector, found in zip(vectors, out[4:].reshape(3, 4), strict=True):
        ends = []
        for sign in (1, -1):
            moved = np.empty(4)
            kernels.founding_field(t, x + sign * 1e-7 * vector, p, moved)
            ends.append(moved)
        np.testing.assert_allclose(
            found, (ends[0] - ends[1]) / 2e-7, rtol=1e-5, atol=1e-5 * np.abs(found).max()
        )


@pytest.mark.parametrize(
    ("increment", "largest", "wanted"),
    [
        # Rounding is near: ten times as much, at most 0.1.
        (1e-8, 0.5 * EPSILON**0.75, 1e-7),
        (0.05, 0.5 * EPSILON**0.75, 0.1),
        # Terms of the second order are lost: a tenth, but no less than what rounding leaves.
        (1e-8, 2.0 * EPSILON**0.25, 1e-9),
        (2.0 * EPSILON**0.78, 2.0 * EPSILON**0.25, EPSILON**0.78),
        # Between both it stays.
        (1e-8, 2.0 * EPSILON**0.75, 1e-8),
        (1e-8, 0.5 * EPSILON**0.25, 1e-8),
    ],
)
def test_increments_adapt_to_the_digits_of_the_difference(increment, largest, wanted):
    assert kernels.adapted(increment, 3.0 * largest, 3.0) == pytest.approx(wanted, rel=1e-14)


def begun(field, y, t=0.0, threshold=1e-6, increment=1e-8):
    work, counters = scratch(len(y))
    work[THRESHOLDS], work[INCREMENTS] = threshold, increment
    field(t, y, (), work[F0])
    return work, counters


MATRIX = np.array([[0.5, -2.0, 0.0], [4.0, -0.25, 1.0], [0.0, 8.0, -1.0]])


def linear(t, y, p, out):
    out[:] = MATRIX @ y


class TestDifference:
    @pytest.mark.parametrize(
        ("y", "scale"), [((1.0, -2.0, 4.0), 4.0), ((1.0, -2.0, 0.0), 1e-6), ((1.0, -2.0, -1e-9), 1e-6)]
    )
    def test_the_move_is_a_share_of_the_component_or_of_its_threshold(self, y, scale):
        y = np.array(y)
        work, _ = begun(linear, y)
        move, largest, magnitude, increment = kernels.difference(linear, 0.0, y, (), work, 1e-3, 2)
        assert increment == 1e-3
        # The third component falls: f = 8 * -2 - y.
        assert move == pytest.approx(-1e-3 * scale, rel=1e-9)
        far = MATRIX @ np.add(y, [0.0, 0.0, move])
        assert largest == pytest.approx(abs(move), rel=1e-6)
        both = [np.abs(far[[1, 2]]), np.abs(work[F0, 1:])]
        assert np.isclose(magnitude, np.max(both, axis=0), rtol=1e-12).any()

    def test_the_move_goes_the_way_of_the_component(self):
        for sign in (1.0, -1.0):
            y = np.array([sign, 0.0, 0.0])
            work, _ = begun(linear, y)
            move, largest, magnitude, _ = kernels.difference(linear, 0.0, y, (), work, 0.5, 0)
            assert (move, largest) == (0.5 * sign, 2.0)
            assert magnitude == 6.0

    def test_the_magnitude_is_zero_beside_a_value_of_zero(self):
        y = np.zeros(3)
        work, _ = begun(linear, y)
        assert kernels.difference(linear, 0.0, y, (), work, 0.5, 0)[:3] == (5e-7, 2e-6, 0.0)

    def test_a_move_that_rounds_to_nothing_is_made_larger(self):
        y = np.array([1.0, 0.0, 0.0])
        work, _ = begun(linear, y)
        move, *_, increment = kernels.difference(linear, 0.0, y, (), work, 1e-20, 0)
        assert increment == pytest.approx(1e-14)
        assert move == pytest.approx(1e-14, rel=0.02)


class TestQuotients:
    def found(self, field, y, increment=1e-8):
        y = np.array(y, dtype=float)
        work, counters = begun(field, y, increment=increment)
        jacobian = np.empty((len(y), len(y)))
        kernels.difference_quotients(field, 0.0, y, (), work, jacobian, counters)
        return jacobian, work[INCREMENTS].tolist(), counters[EVALUATIONS]

    def test_a_linear_field(self):
        jacobian, _, evaluations = self.found(linear, (1.0, -2.0, 4.0))
        np.testing.assert_allclose(jacobian, MATRIX, atol=1e-6)
        assert evaluations == 3

    @pytest.mark.parametrize("unit", [2.0**-40, 1.0, 2.0**40])
    def test_increments_of_steep_and_of_flat_columns(self, unit):
        """The first column changes its function by a share of 3e-4, the second by 3e-13."""

        def field(t, y, p, out):
            out[0], out[1] = unit * (1.0 + 3e4 * (y[0] - 1.0)), unit * (1.0 + 3e-5 * (y[1] - 1.0))

        jacobian, increments, evaluations = self.found(field, (1.0, 1.0))
        np.testing.assert_allclose(np.diag(jacobian) / unit, [3e4, 3e-5], rtol=1e-3)
        assert increments == pytest.approx([1e-9, 1e-7])
        assert evaluations == 2

    def test_a_difference_of_rounding_only_is_made_wider(self):
        """The move of 1e-8 is lost in 1e10; that of its root shows two digits of the slope."""

        def field(t, y, p, out):
            out[0] = 1e10 + y[0]

        jacobian, increments, evaluations = self.found(field, (1.0,))
        assert jacobian[0, 0] == pytest.approx(1.0, rel=0.02)
        assert increments == pytest.approx([1e-3])
        assert evaluations == 2

    def test_a_wider_difference_that_says_less_is_not_taken(self):
        """The function is steep at the point and flat beyond; beside its constant that is near rounding."""

        def field(t, y, p, out):
            out[0] = 1e10 + 1e3 * min(y[0] - 1.0, 1e-8)

        jacobian, increments, evaluations = self.found(field, (1.0,))
        assert jacobian[0, 0] == pytest.approx(1e3, rel=0.2)
        assert increments == [1e-8]
        assert evaluations == 2

    def test_a_column_of_zeros_is_tried_with_the_widest_difference(self):
        def field(t, y, p, out):
            out[0] = 1.0

        jacobian, increments, evaluations = self.found(field, (1.0,))
        assert (jacobian[0, 0], evaluations) == (0.0, 2)
        assert increments == pytest.approx([1e-3])
        assert self.found(field, (1.0,), increment=0.1)[2] == 1

    def test_values_of_zero_do_not_tell_where_rounding_is(self):
        """A slope is taken as it is found; a function that is zero at both places is tried further away."""

        def field(t, y, p, out):
            out[0], out[1] = 0.0, 1e-3 * y[1]

        jacobian, increments, evaluations = self.found(field, (1.0, 0.0))
        np.testing.assert_allclose(jacobian, np.diag([0.0, 1e-3]), atol=1e-18)
        assert increments == pytest.approx([1e-3, 1e-8])
        assert evaluations == 3


@pytest.mark.parametrize(
    ("t", "h", "ahead"), [(2.0, 0.1, 2.1 * 2.0**-26), (0.0, 0.5, 2.0**-27), (1e9, 0.125, 0.125)]
)
def test_the_derivative_in_time_looks_ahead_by_half_of_the_digits_and_at_most_a_step(t, h, ahead):
    times = []

    def field(t, y, p, out):
        times.append(t)
        out[:] = 3.0 * t, -0.5 * t

    work, _ = begun(field, np.zeros(2), t)
    kernels.time_derivative(field, t, np.zeros(2), (), h, work)
    assert times[1] - times[0] == pytest.approx(ahead, rel=1e-6)
    np.testing.assert_allclose(work[DFDT], [3.0, -0.5], rtol=1e-6)


@pytest.mark.parametrize(
    ("y", "f", "slope", "dfdt", "ahead", "step"),
    [
        # A rate of 50, and a second derivative of 1250 over the state: (1250 / 2)**0.5 = 25.
        (2.0, -100.0, -25.0, 0.0, 0.08 / 50.0, 0.08 / 25.0),
        # The change of the field in time adds to it: 7500, or takes it away.
        (-2.0, -100.0, -25.0, 7500.0, 0.08 / 50.0, 0.08 / 50.0),
        (-2.0, -100.0, -25.0, -2500.0, 0.08 / 50.0, 1.0),
        # Below the threshold of 0.5 the state counts as that.
        (0.0, 25.0, 25.0, 0.0, 0.08 / 50.0, 0.08 / 25.0),
        # A tenth of the span, 10, where neither is large.
        (2.0, -0.1, -0.05, 0.0, 1.0, 1.0),
        (2.0, -0.2, 0.0, 0.04, 0.8, 0.8),
    ],
)
def test_the_first_step(y, f, slope, dfdt, ahead, step, monkeypatch):
    """Its square times half of the second derivative, and the step itself times the first, are 0.08."""
    steps = []

    def time_derivative(field, t, state, p, h, work):
        assert (field, t, state.tolist(), p) == ("field", 3.0, [1e9, y], ())
        steps.append(h)
        work[DFDT] = 0.0, dfdt

    monkeypatch.setattr(kernels, "time_derivative", time_derivative)
    work, counters = scratch(2)
    # The first component moves slowly for its size, and has no part in the rate of the second.
    work[F0], work[NEW] = (1.0, f), 0.5
    jacobian = np.array([[0.0, 0.0], [0.0, slope]])
    found = kernels.first_step("field", 3.0, np.array([1e9, y]), (), 10.0, 1e-3, work, jacobian, counters)
    assert steps == [pytest.approx(ahead)]
    assert found == pytest.approx(step)
    assert counters[EVALUATIONS] == 1


def test_growth_rates_of_a_linear_field_are_its_eigenvalues():
    """State and vectors decay at rates 1/4 and 2; from the second period on vectors are eigenvectors."""

    def decay(t, y, p, out):
        for i in range(0, 6, 2):
            out[i], out[i + 1] = -0.25 * y[i], -2.0 * y[i + 1]

    field = cfunc(signature_of(None, REAL, VECTOR, VECTOR, VECTOR))(decay)
    y = np.array([1.0, 1.0, 1.0, 0.0, 0.5, 1.0])
    rates = np.empty((3, 2))
    work, counters = scratch(6)
    compiled = load_kernels("lyapunov.study.kernels")
    done = compiled.growth_rates(field, np.zeros(0), 0.0, 1.5, y, 1e-6, 1e-9, rates, work, counters)
    assert done == 3
    np.testing.assert_allclose(rates[1:], [[-0.25, -2.0]] * 2, atol=1e-4)
    np.testing.assert_allclose(y[:2], np.exp([-0.25 * 4.5, -2.0 * 4.5]), rtol=1e-3)
    # The vector of length one along the first axis, and the part of the second one across it.
    np.testing.assert_allclose(rates[0], [-0.25, -2.0], atol=1e-4)
