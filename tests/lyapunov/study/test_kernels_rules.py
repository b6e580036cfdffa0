"""One step of ode23s and its control against closed forms, as plain Python."""

import math

import numpy as np
import pytest

from lyapunov.study import kernels
from lyapunov.study.ode23s import scratch
from lyapunov.study.places import (
    ACCEPTED,
    DFDT,
    DONE,
    EVALUATIONS,
    F0,
    F1,
    F2,
    NEW,
    RECORD_FULL,
    REJECTED,
    STEP_TOO_SMALL,
    THRESHOLDS,
)
from tests.hybrid.kernels.plain import plain

PLAIN = plain(kernels)
D = 1.0 / (2.0 + math.sqrt(2.0))


def attempted(field, y, h, *, t=0.0, slope=0.0, dfdt=0.0, threshold=1e-3):
    """The new state and the relative error of a step; the Jacobian is a multiple of the identity."""
    y = np.array(y, dtype=float)
    n = len(y)
    work, _ = scratch(n)
    field(t, y, (), work[F0])
    work[DFDT] = dfdt
    arrays = np.zeros((n, n)), np.zeros(n, dtype=np.int64), slope * np.eye(n)
    error = PLAIN.attempt(field, t, y, (), h, 0.5, 0.5 * threshold, work, *arrays)
    return work[NEW].tolist(), error, work


class TestAttempt:
    def test_without_derivatives_it_is_the_midpoint_rule(self):
        """``y' = t^2`` from 1 to 2: ``1.5^2`` in place of 7/3, and the estimate is that of Simpson's rule."""

        def field(t, y, p, out):
            out[0] = t**2

        new, error, work = attempted(field, [0.0], 1.0, t=1.0)
        assert new == [2.25]
        # Simpson's rule is exact: 7/3 - 9/4, beside a state of 9/4.
        assert error == pytest.approx(1.0 / 12.0 / 2.25, rel=1e-14)
        assert (work[F1, 0], work[F2, 0]) == (2.25, 4.0)

    @pytest.mark.parametrize("rate", [-3.0, 0.5])
    def test_a_rate_in_time_makes_it_exact_for_parabolas(self, rate):
        def field(t, y, p, out):
            out[0] = 1.0 + rate * t

        new, error, _ = attempted(field, [5.0], 0.5, t=2.0, dfdt=rate)
        # The field midway is that at t = 2.25.
        assert new == pytest.approx([5.0 + 0.5 * (1.0 + 2.25 * rate)], rel=1e-14)
        assert error == pytest.approx(0.0, abs=1e-15)

    @pytest.mark.parametrize("z", [-1e6, -1.0, 0.5])
    def test_its_stability_function(self, z):
        """``(1 + (1 - 2 d) z) / (1 - d z)^2``, which vanishes far to the left."""

        def field(t, y, p, out):
            out[0] = z / 0.25 * y[0]

        [new], *_ = attempted(field, [2.0], 0.25, slope=z / 0.25)
        assert new == pytest.approx(2.0 * (1.0 + (1.0 - 2.0 * D) * z) / (1.0 - D * z) ** 2, rel=1e-9)

    def test_the_estimate_is_the_error_of_a_short_step(self):
        def field(t, y, p, out):
            out[0] = -y[0]

        for h in (0.02, 0.01):
            [new], error, _ = attempted(field, [1.0], h, slope=-1.0)
            assert error == pytest.approx(abs(new - math.exp(-h)), rel=3.0 * h)

    @pytest.mark.parametrize(
        ("y", "threshold", "weight"), [(-8.0, 1.0, 8.0), (0.0, 1.0, 2.25), (0.0, 5.0, 5.0), (-2.25, 5.0, 5.0)]
    )
    def test_the_error_is_relative_to_the_larger_state_or_the_threshold(self, y, threshold, weight):
        def field(t, y, p, out):
            out[0] = t**2

        assert attempted(field, [y], 1.0, t=1.0, threshold=threshold)[1] == pytest.approx(1 / 12 / weight)

    @pytest.mark.parametrize("first", [0, 1])
    def test_the_worst_component_counts(self, first):
        """Errors of 1/12 and of 10/12, beside states of 102.25 and of 122.5."""

        def field(t, y, p, out):
            out[first], out[1 - first] = t**2, 10.0 * t**2

        found = attempted(field, [100.0, 100.0], 1.0, t=1.0)[1]
        assert found == pytest.approx(10.0 / 12.0 / 122.5, rel=1e-12)

    @pytest.mark.parametrize("undefined", [0, 1])
    def test_a_state_that_is_not_a_number_is_no_small_error(self, undefined):
        def field(t, y, p, out):
            out[:] = 1.0
            out[undefined] = math.nan if t > 0.0 else 1.0

        assert not attempted(field, [1.0, 1.0], 0.5)[1] <= 1e300

    def test_a_singular_matrix_is_refused(self):
        def field(t, y, p, out):
            out[0] = y[0]

        assert attempted(field, [1.0], 0.25, slope=1.0 / (0.25 * D))[1] == math.inf


def integrated(field, y, span, rows=100, rtol=1e-3):
    y = np.array(y, dtype=float)
    record = np.full((rows, 1 + len(y)), np.nan)
    work, counters = scratch(len(y))
    code = PLAIN.integrate(field, (), *span, y, rtol, 1e-3 * rtol, record, work, counters)
    return code, y, record[: counters[ACCEPTED]], counters


def steady(t, y, p, out):
    out[0], out[1] = 1.0, -2.0


class TestIntegrate:
    @pytest.mark.parametrize("start", [-5.0, 0.0, 3.0, 1000.0])
    def test_the_longest_step_is_a_tenth_of_the_run_wherever_it_starts(self, start):
        """A field that is constant needs no shorter steps."""
        code, y, record, counters = integrated(steady, [1e6, 2e6], (start, start + 2.0))
        assert (code, counters[ACCEPTED], counters[REJECTED]) == (DONE, 10, 0)
        np.testing.assert_allclose(record[:, 0], start + 0.2 * np.arange(1, 11), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(record[:, 1], 1e6 + 0.2 * np.arange(1, 11), rtol=1e-12)
        np.testing.assert_allclose(record[:, 2], 2e6 - 0.4 * np.arange(1, 11), rtol=1e-12)
        assert record[-1].tolist() == [start + 2.0, *y]
        # The field and the first step at the start; per step the Jacobian, the rate in time and the attempt.
        # The first two Jacobians are tried with wider differences too, since nothing changes.
        assert counters[EVALUATIONS] == 2 + 10 * (2 + 1 + 2) + 2 * 2

    def test_steps_of_a_decay_do_not_depend_on_the_clock(self):
        def field(t, y, p, out):
            out[0] = -4.0 * y[0]

        runs = [integrated(field, [1.0], (start, start + 2.0), rtol=1e-4) for start in (0.0, 3.0)]
        for start, (code, y, record, counters) in zip((0.0, 3.0), runs, strict=True):
            assert (code, counters[REJECTED]) == (DONE, 0)
            assert y[0] == pytest.approx(math.exp(-8.0), rel=0.01)
            np.testing.assert_allclose(record[:, 0] - start, runs[0][2][:, 0], rtol=1e-6)
            np.testing.assert_allclose(record[:, 1], runs[0][2][:, 1], rtol=1e-6)

    @pytest.mark.parametrize(("rows", "code"), [(9, RECORD_FULL), (10, DONE)])
    def test_a_record_with_too_few_rows(self, rows, code):
        found, _, record, _ = integrated(steady, [1e6, 2e6], (3.0, 5.0), rows=rows)
        assert found == code
        np.testing.assert_allclose(record[:rows, 1], 1e6 + 0.2 * np.arange(1, rows + 1), rtol=1e-12)

    def test_no_rows_no_record(self):
        code, y, _, counters = integrated(steady, [1e6, 2e6], (3.0, 5.0), rows=0)
        assert (code, counters[ACCEPTED]) == (DONE, 10)
        assert y[0] == pytest.approx(1e6 + 2.0, rel=1e-14)


class TestControl:
    """Steps that are tried where the errors, in units of the tolerance, are given."""

    def tried(self, span, first, errors):
        steps, jacobians, errors = [], [], iter(errors)

        def first_step(field, t, y, p, length, rtol, work, jacobian, counters):
            assert length == span[1] - span[0]
            # Nothing is known yet: the new state counts as the threshold atol / rtol.
            assert (work[NEW, 0], work[THRESHOLDS, 0]) == (pytest.approx(1e-2), 1e-5)
            return first

        def attempt(field, t, y, p, h, rtol, *rest):
            steps.append(h)
            return next(errors, math.inf) * rtol

        replaced = {
            "first_step": first_step,
            "attempt": attempt,
            "difference_quotients": lambda *arguments: jacobians.append(len(steps)),
            "time_derivative": lambda *arguments: None,
        }
        work, counters = scratch(2)
        record = np.zeros((0, 3))
        integrate = plain(kernels, **replaced).integrate
        code = integrate(steady, (), *span, np.zeros(2), 1e-3, 1e-5, record, work, counters)
        return code, steps, jacobians, counters

    def test_steps_shrink_and_grow_with_the_cube_root_of_the_error(self):
        """By 0.8 times the root, within 0.1 and 5; no step grows that follows a rejected one."""
        errors = [8.0, 1.0 / 8.0, 1.0 / 8.0, 0.0, 1e-9, 1e9, math.nan, 1.0, 1.0, 1.0 / 64.0]
        code, steps, jacobians, counters = self.tried((1.0, 101.0), 0.01, errors)
        wanted = [0.01, 0.004, 0.004, 0.0064, 0.032, 0.16, 0.016, 0.0016, 0.0016, 0.00128, 0.004096]
        np.testing.assert_allclose(steps[:11], wanted, rtol=1e-9)
        assert counters[ACCEPTED] == 7
        # A rejected step is tried again with the same Jacobian.
        assert jacobians == [0, 2, 3, 4, 5, 8, 9, 10]
        # Then no step is good enough, down to sixteen units of rounding of the time.
        assert code == STEP_TOO_SMALL
        assert steps[-1] == pytest.approx(16.0 * 2.0**-52, rel=0.05)
        assert steps[-2] > steps[-1]
        assert counters[REJECTED] == len(steps) - counters[ACCEPTED]

    def test_a_last_step_that_is_rejected_is_not_the_last(self):
        errors = [0.0] * 9 + [8.0] + [0.0] * 3
        code, steps, _, counters = self.tried((0.0, 1.0), 0.5, errors)
        np.testing.assert_allclose(steps, [0.1] * 10 + [0.04, 0.04, 0.02], rtol=1e-9)
        assert (code, counters[ACCEPTED], counters[REJECTED]) == (DONE, 12, 1)
