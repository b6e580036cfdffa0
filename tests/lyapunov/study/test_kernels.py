"""The parts of the paper's method by themselves, as plain Python: the field, and numerical derivatives."""

from inspect import getmembers

import numpy as np
import pytest

import models
from hybrid.compiler.cache.loader import load_kernels
from hybrid.system.derivatives import evaluate
from lyapunov.study import kernels
from lyapunov.study.ode23s import parameters_of, scratch
from lyapunov.study.places import EVALUATIONS, F0, INCREMENTS, THRESHOLDS
from tests.lyapunov.study.compiled import compiled


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


def begun(field, y, t=0.0, threshold=1e-6, increment=1e-8):
    work, counters = scratch(len(y))
    work[THRESHOLDS], work[INCREMENTS] = threshold, increment
    field(t, y, (), work[F0])
    return work, counters


MATRIX = np.array([[0.5, -2.0, 0.0], [4.0, -0.25, 1.0], [0.0, 8.0, -1.0]])


def linear(t, y, p, out):
    out[:] = MATRIX @ y


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


def test_growth_rates_of_a_linear_field_are_its_eigenvalues():
    """State and vectors decay at rates 1/4 and 2; from the second period on vectors are eigenvectors."""

    def decay(t, y, p, out):
        for i in range(0, 6, 2):
            out[i], out[i + 1] = -0.25 * y[i], -2.0 * y[i + 1]

    field = compiled(decay)
    y = np.array([1.0, 1.0, 1.0, 0.0, 0.5, 1.0])
    rates = np.empty((3, 2))
    work, counters = scratch(6)
    kernels = load_kernels("lyapunov.study.kernels")
    done = kernels.growth_rates(field, np.zeros(0), 0.0, 1.5, y, 1e-6, 1e-9, rates, work, counters)
    assert done == 3
    np.testing.assert_allclose(rates[1:], [[-0.25, -2.0]] * 2, atol=1e-4)
    np.testing.assert_allclose(y[:2], np.exp([-0.25 * 4.5, -2.0 * 4.5]), rtol=1e-3)
    # The vector of length one along the first axis, and the part of the second one across it.
    np.testing.assert_allclose(rates[0], [-0.25, -2.0], atol=1e-4)
