"""Long runs as plain Python: times, distances, companions, and what is written down at each interval."""

from inspect import getmembers
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.types.codes import DONE, ENTERING, MAX_STEPS, NO_TRANSITION, READY, STALE
from lyapunov import kernels
from lyapunov.batches import new_batches
from lyapunov.interval import End

later, distance, rescale = (each.py_func for each in (kernels.later, kernels.distance, kernels.rescale))


class TestLater:
    @pytest.mark.parametrize("seed", range(20))
    def test_the_time_grows_by_the_interval_and_the_phase_stays_within_a_period(self, seed):
        rng = np.random.default_rng(seed)
        period, interval = rng.uniform(0.5, 2.0), rng.uniform(0.0, 8.0)
        cycle, phase = int(rng.integers(-5, 5)), rng.uniform(0.0, period)
        cycle_after, phase_after = later(period, cycle, phase, interval)
        assert 0.0 <= phase_after < period
        grown = (cycle_after - cycle) * period + phase_after - phase
        assert grown == pytest.approx(interval, rel=1e-12, abs=1e-12)

    def test_a_forcing_period_later_is_the_same_phase(self):
        assert later(0.7, 3, 0.1, 0.7) == (4, 0.1)
        assert later(0.5, 3, 0.25, 1.25) == (6, 0.0)

    def test_without_a_period_time_is_one_number(self):
        assert later(0.0, 0, 5.0, 3.0) == (0, 8.0)


@pytest.mark.parametrize("scale", [1.0, 2.0**-900, 2.0**900])
def test_distances_whose_squares_leave_the_range(scale):
    """A side of 3, 4 and 12; the fourth entry belongs to a tangent vector."""
    one = SimpleNamespace(y=scale * np.array([1.0, 0.0, -5.0, 7.0]))
    other = SimpleNamespace(y=scale * np.array([-2.0, 4.0, 7.0, 99.0]))
    assert distance(one, other, 3) == distance(other, one, 3) == 13.0 * scale
    assert distance(one, one, 3) == 0.0
    assert distance(one, SimpleNamespace(y=-one.y), 3) == pytest.approx(2 * np.sqrt(26.0) * scale, rel=1e-15)


def test_a_companion_is_put_beside_the_orbit():
    run = SimpleNamespace(
        y=np.array([1.0, 2.0, 9.0]),
        side=np.array([1, -1]),
        on_guard=np.array([0, 1]),
        mode=3,
        previous_mode=2,
    )
    other = SimpleNamespace(
        y=np.array([5.0, -2.0, 8.0]),
        side=np.array([-1, 1]),
        on_guard=np.array([1, 1]),
        due=np.array([1, 0]),
        **{"mode": 0, "previous_mode": 1, "stage": -7, "last_fired": 4, "pending": 5},
    )
    rescale(run, other, 2, 0.25)
    np.testing.assert_array_equal(other.y, [2.0, 1.0, 8.0])
    assert distance(run, other, 2) == pytest.approx(0.25 * np.hypot(4.0, 4.0))
    for name, wanted in (("side", [1, -1]), ("on_guard", [0, 1]), ("due", [0, 0])):
        np.testing.assert_array_equal(getattr(other, name), wanted)
    assert (other.mode, other.previous_mode) == (3, 3)
    assert (other.stage, other.last_fired, other.pending) == (ENTERING, NO_TRANSITION, NO_TRANSITION)
    np.testing.assert_array_equal(run.y, [1.0, 2.0, 9.0])


@pytest.fixture
def plain(monkeypatch):
    """The module with all functions as plain Python."""
    for name, each in getmembers(kernels, lambda each: hasattr(each, "py_func")):
        monkeypatch.setattr(kernels, name, each.py_func)
    return kernels


def task(y, rates, tangents=0, steps=0):
    """A run whose entries grow at ``rates``, ``steps`` steps into its run; forcing of the period 2."""
    n = len(y) // (1 + tangents)
    run = SimpleNamespace(
        y=np.array(y, dtype=float), rates=np.array(rates, dtype=float), time=0.0, steps=steps,
        side=np.zeros(1, dtype=int), on_guard=np.zeros(1, dtype=int), due=np.zeros(1, dtype=int),
        growth=np.full(tangents, 99.0), divergence=99.0, log_determinant=99.0,
        indistinct=0, strain=5.0, stage=READY, mode=0, jumps=0, **{"previous_mode": 1},
    )  # fmt: skip
    model = SimpleNamespace(period=2.0, dimension=n)
    work = SimpleNamespace(jacobian=np.zeros((max(tangents, 1), max(n, 1))))
    return SimpleNamespace(run=run, model=model, tangents=tangents, work=work)


def new_end():
    return End(counters=np.array([0, 0]), numbers=np.array([0.0]))


# Counts of the jumps of no transition.
NONE = np.zeros(0, dtype=np.int64)


class Advance:
    """In place of the driver: the entries grow exponentially to the end of the interval.

    The calls of the numbers in ``refused`` get a code instead. Each call takes ten steps.
    """

    def __init__(self, refused=()):
        self.calls, self.refused = [], dict(refused)

    def __call__(self, parts, task, cycle, phase, max_steps, max_jumps):
        run = task.run
        self.calls.append((task, cycle * task.model.period + phase, max_steps, max_jumps))
        if len(self.calls) in self.refused:
            return self.refused[len(self.calls)]
        length = self.calls[-1][1] - run.time
        run.y *= np.exp(run.rates * length)
        run.time, run.steps = run.time + length, run.steps + 10
        run.divergence += 0.3 * length
        run.log_determinant += -0.1
        return DONE


class TestGrowthRates:
    """Two tangent vectors along the axes of a state ``(2,)`` grow at known rates."""

    def run(self, plain, advance, rows=3, resumed=False, stage=READY):
        ours = task([1.0, 1.0, 1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.5, 0.0, 0.0, -1.25], tangents=2)
        ours.run.stage = stage
        end, rates = new_end(), np.full((rows, 3), -7.0)
        batches, state = new_batches(3)
        code = plain.growth_rates(advance, None, ours, end, 1.5, 123, resumed, rates, NONE, batches, state)
        return code, ours, end, rates, (batches, state)

    def test_rates_are_growth_over_the_interval(self, plain):
        advance = Advance()
        code, ours, end, rates, (batches, state) = self.run(plain, advance)
        assert code == DONE
        # Divergence 0.3, and a logarithm -0.1 of the determinants of an interval of the length 1.5.
        np.testing.assert_allclose(rates, [[0.5, -1.25, 0.3 - 0.1 / 1.5]] * 3, rtol=1e-14)
        np.testing.assert_array_equal(batches[:3], rates)
        assert state.tolist() == [3, 1, 0]
        assert (end.done, end.cycle, end.phase) == (3, 2, 0.5)
        assert [call[1:] for call in advance.calls] == [(t, 123, 0) for t in (1.5, 3.0, 4.5)]
        np.testing.assert_array_equal(ours.run.y, [1.0, 1.0, 1.0, 0.0, 0.0, 1.0])
        assert (ours.run.strain, ours.run.indistinct) == (0.0, 0)

    def test_rates_of_change_kept_from_a_step_are_those_of_other_vectors(self, plain):
        assert self.run(plain, Advance(), 1)[1].run.stage == STALE
        assert self.run(plain, Advance(), 1, stage=ENTERING)[1].run.stage == ENTERING

    def test_an_interval_that_was_not_completed_is_resumed(self, plain):
        """Its end and what has grown in it stay as they are."""
        code, ours, end, rates, (_, state) = self.run(plain, Advance({2: MAX_STEPS}))
        assert (code, end.done, end.cycle, end.phase) == (MAX_STEPS, 1, 1, 1.0)
        assert rates[:, 0].tolist() == [0.5, -7.0, -7.0]
        assert state.tolist() == [1, 1, 0]
        ours.run.growth[:] = 3.0, 6.0
        ours.run.divergence, ours.run.log_determinant = 1.0, 2.0
        batches = new_batches(3)
        rates = np.zeros((2, 3))
        code = plain.growth_rates(Advance(), None, ours, end, 1.5, 123, True, rates, NONE, *batches)
        assert (code, end.done, end.cycle, end.phase) == (DONE, 2, 2, 0.5)
        grown = [3.0 / 1.5 + 0.5, 6.0 / 1.5 - 1.25, (1.0 + 2.0 - 0.1) / 1.5 + 0.3]
        np.testing.assert_allclose(rates, [grown, [0.5, -1.25, 0.3 - 0.1 / 1.5]], rtol=1e-14)

    def test_vectors_are_no_images_of_others(self, plain):
        """Old contents of the scratch memory say nothing of the size of the terms."""
        ours = task([1.0, 1.0, 1.0, 0.0, 0.0, 1.0], np.zeros(6), tangents=2)
        ours.work.jacobian[:] = 1e30
        rates = np.zeros((1, 3))
        plain.growth_rates(Advance(), None, ours, new_end(), 1.5, 9, False, rates, NONE, *new_batches(3))
        assert rates[0, :2].tolist() == [0.0, 0.0]

    def test_vectors_of_which_only_rounding_is_left_are_counted(self, plain, monkeypatch):
        monkeypatch.setattr(plain, "orthonormalise", lambda *_: 2)
        assert self.run(plain, Advance())[1].run.indistinct == 6


class TestDistances:
    """An orbit at rest; the companions leave it at the rate 0.5 and 0.25."""

    def run(self, plain, advance, rows=2, max_steps=1000, burst=400, resumed=False, apart=1e-3):
        ours = task([1.0, 2.0], [0.0, 0.0], steps=5)
        free = task([0.0, 0.0], [0.5, 0.5], steps=50)
        renormalised = task([0.0, 0.0], [0.25, 0.25], steps=700)
        ours.run.y[:] = 0.0
        free.run.y[:] = 0.0, 1e-3
        renormalised.run.y[:] = apart, 0.0
        end, out = new_end(), np.full((rows, 2), -7.0)
        code = plain.distances(
            advance, None, ours, free, renormalised, end, 1.5, 1e-4, max_steps, burst, resumed, out
        )  # fmt: skip
        return code, (ours, free, renormalised), end, out

    def test_one_companion_runs_freely_and_one_is_brought_back(self, plain):
        advance = Advance()
        code, tasks, end, out = self.run(plain, advance)
        first, second = 1e-3 * np.exp(0.25 * 1.5), 1e-4 * np.exp(0.25 * 1.5)
        assert code == DONE
        np.testing.assert_allclose(
            out, [[1e-3 * np.exp(0.75), first], [1e-3 * np.exp(1.5), second]], rtol=1e-14
        )
        np.testing.assert_allclose(tasks[2].run.y, [1e-4, 0.0], rtol=1e-14)
        assert (end.done, end.cycle, end.phase) == (2, 1, 1.0)
        ends = [(1.5, most, 2**63 - 1) for most in (405, 450, 1000)]
        assert [call[1:] for call in advance.calls] == [*ends, *[(3.0, *each[1:]) for each in ends]]
        assert [call[0] for call in advance.calls] == [*tasks] * 2

    @pytest.mark.parametrize("refused", range(1, 7))
    def test_the_first_of_the_runs_that_stops_is_the_last_to_be_advanced(self, plain, refused):
        advance = Advance({refused: MAX_STEPS})
        code, _, end, out = self.run(plain, advance)
        assert (code, len(advance.calls)) == (MAX_STEPS, refused)
        assert end.done == (refused - 1) // 3
        assert (end.cycle, end.phase) == ((0, 1.5), (1, 1.0))[end.done]
        assert (out[:, 0] > 0.0).tolist() == [end.done == 1, False]

    def test_an_interval_that_was_not_completed_is_resumed(self, plain):
        advance = Advance()
        _, _, end, _ = self.run(plain, advance, resumed=True)
        assert (end.cycle, end.phase) == (0, 1.5)
        assert [call[1] for call in advance.calls] == [0.0] * 3 + [1.5] * 3

    def test_a_companion_that_coincides_with_the_orbit_stays_there(self, plain):
        _, tasks, _, out = self.run(plain, Advance(), apart=0.0)
        assert out[:, 1].tolist() == [0.0, 0.0]
        np.testing.assert_array_equal(tasks[2].run.y, 0.0)
