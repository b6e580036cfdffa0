"""A step along series piece by piece: its length, its end, what is kept of it, and landings on guards."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED
from hybrid.kernels.steps import series as module
from hybrid.kernels.steps.series import ROUNDING
from hybrid.kernels.types.codes import (
    FROM_LAST_STEP,
    FROM_STATE,
    FROM_ZERO,
    READY,
    STALE,
)
from hybrid.kernels.types.layout import Path
from tests.hybrid.kernels.plain import plain

kernels = plain(module, power_of_two=np.exp2)


def path_of(series, h, clock=-1):
    """The path of a series of the second order from the time ``T``."""
    return Path(series, 2, clock, T, 1.0, h, False)


MODE, T = 1, 3.0


class TestFollowed:
    """The state is ``1 + 2 s``; the field differs from its slope by a given misfit."""

    def length(self, misfit, h=0.5, *, atol=1e-3, rtol=0.0, scale=1.0, **others):
        method = SimpleNamespace(atol=atol, rtol=rtol)

        def field(mode, t, x, parameters, out):
            assert mode == MODE
            # With the rounding that is tried, the state is beside the series.
            s = t - T
            assert abs(x[0] - scale * (1.0 + 2.0 * s)) <= 2.0 * ROUNDING * abs(x[0])
            out[0] = scale * 2.0 + misfit(s, x[0] - scale * (1.0 + 2.0 * s))

        series = np.array([[scale], [2.0 * scale], [0.0]])
        model = SimpleNamespace(dimension=1, parameters=None, field=field)
        work = SimpleNamespace(series=series, trial=np.zeros(1), stages=np.zeros((2, 1)))
        return kernels.followed(
            model, method, SimpleNamespace(mode=MODE, y=np.array([scale])), path_of(series, h), work
        )

    def test_a_step_with_a_misfit_is_halved(self):
        """A quarter of the step times the misfit, at the middle or at the end."""
        for sign in (1.0, -1.0):
            assert self.length(lambda s, beside, sign=sign: sign * 0.99 * 4e-3 / 0.5) == 0.5
            assert self.length(lambda s, beside, sign=sign: sign * 1.01 * 4e-3 / 0.5) == 0.25
            assert self.length(lambda s, beside, sign=sign: sign * 0.99 * 4e-3 / 0.125) == 0.125
            for place, length in ((0.25, 0.125), (0.5, 0.25)):
                assert (
                    self.length(lambda s, beside, place=place, sign=sign: sign * float(s == place)) == length
                )

    def test_no_misfit_at_other_places_counts(self):
        assert self.length(lambda s, beside: float(s not in (0.25, 0.5))) == 0.5

    def test_the_tolerance_is_that_of_the_larger_state(self):
        # At the start the state is 100, at the end 200, where the misfit is.
        for factor, length in ((0.99, 0.5), (1.02, 0.25)):
            misfit = factor * 4.0 * (1e-3 + 1e-4 * 200.0) / 0.5
            found = self.length(
                lambda s, beside, misfit=misfit: misfit * float(s == 0.5), scale=100.0, rtol=1e-4, atol=1e-3
            )
            assert found == length

    def test_noise_of_rounding_is_no_misfit(self):
        noise = 1.0 / (2.0 * ROUNDING)
        for share, length in ((1.09, 0.5), (1.11, 0.25)):
            # At the end, where the state is 2, what rounding makes of it counts as 1.
            found = self.length(
                lambda s, beside, share=share: float(s == 0.5) * (share + noise * beside), atol=0.0125
            )
            assert found == length


def test_rounding_is_tried_in_both_directions():
    """Two components grow, two shrink."""
    seen = []

    def field(mode, t, x, parameters, out):
        seen.append(x.copy())
        out[:] = 0.0

    model = SimpleNamespace(dimension=5, parameters=None, field=field)
    series = np.vstack([np.full(5, 2.0), np.zeros((2, 5))])
    work = SimpleNamespace(series=series, trial=np.zeros(5), stages=np.zeros((2, 5)))
    run = SimpleNamespace(mode=MODE, y=np.full(5, 2.0))
    kernels.followed(model, SimpleNamespace(atol=1.0, rtol=0.0), run, path_of(series, 0.5), work)
    assert len(seen) == 4
    assert seen[0].tolist() == seen[2].tolist() == [2.0] * 5
    signs = np.array([1.0, 1.0, -1.0, -1.0, 1.0])
    assert seen[1].tolist() == seen[3].tolist() == (2.0 * (1.0 + ROUNDING * signs)).tolist()


@pytest.mark.parametrize("remaining", [0.1, 0.5, 0.9])
@pytest.mark.parametrize(("clock", "root"), [(3, 8), (5, 8), (7, 16)])
def test_a_clock_stops_at_the_end_of_the_run(clock, root, remaining):
    """The clock shows ``s + s^2``; or ``2 s - s^2``, which turns at 1. Its root is in a column of its own."""
    work = SimpleNamespace(registers=np.zeros((1, 6)))
    series = np.zeros((3, 24))
    series[:2, root] = 1.0, 0.0
    series[1:, clock] = 1.0, 1.0
    expected = (math.sqrt(1.0 + 4.0 * remaining) - 1.0) / 2.0
    assert kernels.step_until(path_of(series, 3.0, clock), remaining, work) == pytest.approx(
        expected, rel=1e-14
    )
    # Where the end is not reached the step is kept.
    assert kernels.step_until(path_of(series, 0.5, clock), 0.76, work) == 0.5
    # The root is ``1 - s``: beyond 1 its clock runs backwards.
    series[:2, root] = 1.0, -1.0
    series[1:, clock] = 2.0, -1.0
    expected = 1.0 - math.sqrt(1.0 - remaining)
    assert kernels.step_until(path_of(series, 3.0, clock), remaining, work) == pytest.approx(
        expected, rel=1e-14
    )
    assert kernels.step_until(path_of(series, 3.0, clock), 1.25, work) == 3.0


class TestAccept:
    def accepted(self, tangents, on_guard=(0, 0, 0)):
        n, order = 2, 2
        series = np.zeros((order + 3, 24))
        # State, one guard, clock, divergence; then four vectors with two components.
        series[: order + 1, 8:16] = np.arange(24.0).reshape(3, 8)
        series[: order + 1, 16:24] = 100.0 + np.arange(24.0).reshape(3, 8)
        series[order + 1, :6] = 5.0, 6.0, 9.0, 9.0, 9.0, 0.75
        series[order + 2, :6] = 0.5, 8.0, 9.0, 9.0, 9.0, 9.0
        model = SimpleNamespace(
            dimension=n,
            first_outgoing=np.array([0, 1, 3]),
            outgoing=np.array([2, 0, 1]),
            tangent_start=8,
            tangent_columns=np.array([99, 8]),
        )
        run = SimpleNamespace(
            mode=MODE,
            on_guard=np.array(on_guard),
            scale=np.array([7.5, 7.5]),
            y=np.full(2 * (1 + max(tangents, 5)), -1.0),
            divergence=1.0,
        )
        kernels.accept_series(model, run, tangents, path_of(series, 0.5), SimpleNamespace(series=series))
        return run, series

    def test_sizes(self):
        assert self.accepted(0)[0].scale.tolist() == [0.5, 8.0]
        for on_guard in ((1, 0, 0), (0, 2, 0)):
            assert self.accepted(0, on_guard)[0].scale.tolist() == [7.5, 8.0]
        assert self.accepted(0, (0, 0, 1))[0].scale.tolist() == [0.5, 8.0]

    def test_tangent_vectors_and_divergence(self):
        run, _ = self.accepted(0)
        assert run.y.tolist() == [5.0, 6.0, *[-1.0] * 10]
        assert run.divergence == 1.0
        for tangents in (1, 3, 4, 5):
            run, series = self.accepted(tangents)
            assert run.divergence == 1.75
            assert run.y[:2].tolist() == [5.0, 6.0]
            for vector in range(tangents):
                columns = [8 + 8 * (vector // 4) + vector % 4 + 4 * i for i in range(2)]
                values = series[0, columns] + 0.5 * series[1, columns] + 0.25 * series[2, columns]
                assert run.y[2 + 2 * vector : 4 + 2 * vector].tolist() == values.tolist()
            assert np.all(run.y[2 + 2 * tangents :] == -1.0)


@pytest.mark.parametrize("clock", [-1, 3])
def test_a_step_is_kept_as_polynomials_in_its_share(clock):
    series = np.arange(20.0).reshape(5, 4)
    record = SimpleNamespace(step_coefficients=np.full((2, 5, 3), 9.0))
    tested = plain(module, start_record=lambda run, record, t, span: 1).remember_series
    tested(SimpleNamespace(dimension=2), None, record, path_of(series, 0.5, clock), 0.25)
    assert np.all(record.step_coefficients[0] == 9.0)
    time = [0.0, 0.25, 0.0] if clock < 0 else [3.0, 3.5, 2.75]
    expected = [[0.0, 1.0, time[0]], [2.0, 2.5, time[1]], [2.0, 2.25, time[2]], [0.0] * 3, [0.0] * 3]
    assert record.step_coefficients[1].tolist() == expected


def test_what_the_root_of_a_guard_is_taken_from():
    model = SimpleNamespace(dimension=2, first_outgoing=np.array([0, 1, 4]), outgoing=np.array([3, 2, 0, 1]))
    for stage, origin in ((READY, FROM_LAST_STEP), (STALE, FROM_STATE)):
        run = SimpleNamespace(
            mode=MODE, stage=stage, on_guard=np.array([BY_SPEED, BY_ACCELERATION, 0, BY_SPEED])
        )
        series = np.full((5, 8), 9.0)
        kernels.set_origins(model, run, 2, series)
        assert series[4].tolist() == [9.0, 9.0, origin, FROM_ZERO, origin, 9.0, 9.0, 9.0]
        assert np.all(series[:4] == 9.0)


class TestReachGuard:
    """The state is ``(2, 3)`` with the rates ``(4, -1)``; the guard is ``gap`` away at a speed of 8."""

    def reach(self, gap, *, longest=1.0, speed=8.0, affine=1, rounding=0.0, tangents=1):
        rates = np.array([4.0, -1.0, 0.5, 0.25])
        told = []

        def rates_by_jacobian(model, mode, t, y, tangents, jacobian, out):
            told.append((mode, t, tangents))
            out[: 2 * (1 + tangents)] = rates[: 2 * (1 + tangents)]

        def speed_rounding(model, run, transition, mode, t, x, work):
            assert (transition, mode, t) == (1, MODE, T)
            assert work.field.tolist() == [4.0, -1.0]
            return rounding

        tested = plain(
            module,
            rates_by_jacobian=rates_by_jacobian,
            guard_speed=lambda *given: speed,
            guard_value=lambda *given: gap,
            speed_rounding=speed_rounding,
        ).reach_guard
        model = SimpleNamespace(dimension=2, affine_guard=np.array([1 - affine, affine]))
        self.run = SimpleNamespace(mode=MODE, y=np.array([2.0, 3.0, 1.0, 1.0]))
        work = SimpleNamespace(
            stages=np.zeros((2, 5)), jacobian=None, gradient=None, scalar=None, field=np.zeros(2)
        )
        found = tested(model, self.run, tangents, 1, T, longest, work)
        assert told == [(MODE, T, tangents)]
        return found

    @pytest.mark.parametrize("affine", [0, 1])
    def test_the_guard_is_reached_by_an_euler_step(self, affine):
        for gap in (-2.0, 2.0):
            step = -gap / 8.0
            assert self.reach(gap, affine=affine) == step
            expected = [2.0 + 4.0 * step, 3.0 - step, 1.0 + 0.5 * step, 1.0 + 0.25 * step]
            assert self.run.y.tolist() == expected
            assert self.reach(gap, affine=affine, tangents=0) == step
            assert self.run.y.tolist() == [*expected[:2], 1.0, 1.0]
            assert self.reach(gap, affine=affine, speed=-8.0) == -step

    def test_nothing_is_done_if_it_is_far_or_has_no_speed(self):
        for others in (
            {"speed": 0.0},
            {"longest": 0.24},
            {"gap": 2.0, "longest": 0.24},
            {"gap": math.nan},
            {"affine": 0, "rounding": 8.1},
            {"affine": 0, "rounding": 8.0},
            {"affine": 0, "rounding": 8.1, "speed": -8.0},
        ):
            assert self.reach(**({"gap": -2.0} | others)) == 0.0
            assert self.run.y.tolist() == [2.0, 3.0, 1.0, 1.0]
        assert self.reach(-2.0, longest=0.25) == 0.25
        assert self.reach(-2.0, affine=0, rounding=7.9) == 0.25
        assert self.reach(-2.0, affine=1, rounding=8.1) == 0.25


def test_the_shortest_way_to_a_guard():
    """``3 x + 4 y`` is 50 too large: 10 along ``(0.6, 0.8)``; so is a hundredth of it in its unit."""
    for unit, gradient, expected in (
        (1.0, (3.0, 4.0, 7.0), [1.0, 1.0]),
        (0.01, (0.03, 0.04, 7.0), [1.0, 1.0]),
        (1.0, (0.0, 0.0, 7.0), [7.0, 9.0]),
    ):

        def guard_gradient(transition, t, x, parameters, out, gradient=gradient):
            assert (transition, t) == (1, T)
            out[:] = gradient

        tested = plain(module, guard_value=lambda *given, unit=unit: 50.0 * unit).project_on_guard
        run = SimpleNamespace(y=np.array([7.0, 9.0, 5.0]))
        model = SimpleNamespace(dimension=2, parameters=None, guard_gradient=guard_gradient)
        tested(model, run, 1, T, SimpleNamespace(gradient=np.zeros(3), scalar=None))
        np.testing.assert_allclose(run.y, [*expected, 5.0], rtol=1e-13)


@pytest.mark.parametrize(
    ("stay", "since", "time", "expected"),
    [
        (8.0, 0.0, 1.0, 10.0),
        (8.0, 5.0, 1.0, 5.0),
        (8.0, 7.5, 1.0, 2.5),
        (8.0, 8.0, 1.0, math.inf),
        (8.0, 9.0, 1.0, math.inf),
        (0.0, 0.0, 1.0, math.inf),
        (8.0, 0.0, 1.99e10, 10.0),
        (8.0, 0.0, 2.01e10, math.inf),
        (8.0, 0.0, -2.01e10, math.inf),
    ],
)
def test_a_step_ends_a_little_after_the_last_stay(stay, since, time, expected):
    run = SimpleNamespace(stay=np.array([99.0, stay]), since_entry=since, phase=time)
    model = SimpleNamespace(timed=np.array([0, 1]))
    assert kernels.as_far_as_last_time(model, run, MODE) == expected


def test_flights_without_an_end():
    """A hundred times the time in which the state changes by its size; twice as long each time."""
    series = np.array([[1.0, -4.0, 99.0], [-2.0, 0.5, 99.0]])
    run = SimpleNamespace(next_step=0.0)
    assert kernels.unhurried(series, 2, run) == 200.0
    assert run.next_step == 400.0
    assert kernels.unhurried(series, 2, run) == 400.0
    assert run.next_step == 800.0
    for resting in (np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([[1.0, 1.0], [0.0, 0.0]])):
        run.next_step = 0.0
        assert kernels.unhurried(resting, 2, run) == 1.0
    run.next_step = 0.0
    assert kernels.unhurried(0.125 * series, 2, run) == 200.0
    run.next_step = 6e49
    assert kernels.unhurried(series, 2, run) == 6e49
    assert run.next_step == 1e50
