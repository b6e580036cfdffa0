"""Lyapunov spectra rule by rule: bursts of the kernel, lengths of intervals, annihilated vectors."""

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.accuracy.averages import TaperedMean
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.status import SUCCESS, Status, StatusCode
from lyapunov import spectrum
from lyapunov.spectrum import Estimate


class Burst(Estimate):
    """An estimate for one vector, whose rates are 1, 2, 3 and so on, and their negatives required.

    Each call of the kernel makes as many intervals as ``made`` says next, or all; after its last entry the
    code is ``last``.
    """

    def __init__(self, *, made=(), last=codes.DONE, growth=0.0):
        self.trajectory = SimpleNamespace(tangents=1, jumps=0, run=SimpleNamespace(steps=0))
        self.made, self.last, self.calls, self.done, self.told = [*made], last, [], 0, []
        self.end = SimpleNamespace(done=99)
        self.interval, self.grazed_growth = 2.0, growth
        self.hits = np.zeros(0, dtype=np.int64)

    def _rates(self, most, resumed, rates, batches):
        assert (most, batches) == (22, "batches")
        self.calls.append((len(rates), resumed))
        assert len(self.calls) < 20
        count = self.made.pop(0) if self.made else len(rates)
        for i in range(count):
            self.done += 1
            rates[i] = self.done, -self.done
        self.end.done = count
        return codes.MAX_STEPS if count < len(rates) and self.made else self.last

    def collect(self, intervals, monkeypatch, *, most=250, history=True):
        monkeypatch.setattr(spectrum, "INTERVALS_AT_ONCE", most)
        burst = SimpleNamespace(
            most=lambda: 22, judged=lambda code: codes.GO_ON if code == codes.MAX_STEPS else code
        )
        monkeypatch.setattr(spectrum, "Bursts", lambda runs: burst)
        mean, bar = TaperedMean(2), SimpleNamespace(update=self.told.append)
        growths, code = self._collect(intervals, mean, "batches", history, bar)
        assert mean.count == self.done
        assert growths.tolist() == ([[i] for i in range(1, self.done + 1)] if history else [])
        return code


@pytest.mark.parametrize("history", [False, True])
@pytest.mark.parametrize(("intervals", "calls"), [(1, [1]), (4, [4]), (5, [4, 1]), (8, [4, 4])])
def test_so_many_intervals_are_made_at_once(intervals, calls, history, monkeypatch):
    burst = Burst()
    assert burst.collect(intervals, monkeypatch, most=4, history=history) == codes.DONE
    assert burst.calls == [(each, False) for each in calls]
    assert (burst.done, burst.told) == (intervals, calls)


def test_a_burst_that_ends_within_an_interval_is_resumed(monkeypatch):
    burst = Burst(made=(1, 0, 2, 1))
    assert burst.collect(4, monkeypatch, most=3) == codes.DONE
    assert burst.calls == [(3, False), (2, True), (2, True), (1, False)]
    assert burst.told == [1, 0, 2, 1]


@pytest.mark.parametrize("code", [codes.NON_FINITE, codes.TERMINAL])
def test_a_run_that_ends_early_keeps_its_intervals(code, monkeypatch):
    burst = Burst(made=(3, 2), last=code)
    assert burst.collect(9, monkeypatch, most=5) == code
    assert (burst.done, burst.told) == (5, [3, 2])


def orbit(period, t=0.0):
    return SimpleNamespace(model=SimpleNamespace(period=period), t=t)


def test_the_length_of_an_interval(monkeypatch):
    monkeypatch.setattr(spectrum, "time_scale", lambda run: 0.25)
    assert spectrum.interval_length(orbit(3.0), None, 7) == 3.0
    assert spectrum.interval_length(orbit(0.0), None, 7) == 0.25
    assert spectrum.interval_length(orbit(3.0), 0.5, 7) == 0.5
    assert spectrum.interval_length(orbit(0.0), 0.5, 7) == 0.5


@pytest.mark.parametrize(
    ("jacobian", "x", "rate", "expected"),
    [
        ([[0.0, np.inf], [0.0, 0.0]], (1.0, 1.0), (1.0, 1.0), 1.0),
        ([[0.0, 0.0], [0.0, 0.0]], (3.0, 4.0), (0.5, -2.0), 6.0),
        ([[0.0, 0.0], [0.0, 0.0]], (3.0, 4.0), (0.0, 0.0), 1.0),
    ],
)
def test_the_time_in_which_the_field_changes_a_state(jacobian, x, rate, expected):
    found = SimpleNamespace(jacobian=lambda: np.array(jacobian), x=x, field=lambda: rate)
    assert spectrum.time_scale(found) == expected


@pytest.mark.parametrize("t0", [0.0, 2.0**52, -(2.0**52)])
def test_an_interval_is_at_least_1024_roundings_of_the_latest_time(t0):
    """At ``t0`` numbers are 1 apart; intervals of 1024 from zero reach a time with the same rounding."""
    run = orbit(0.0, t0)
    if t0:
        assert spectrum.interval_length(run, 1024.0, 2) == 1024.0
        with pytest.raises(ArgumentError, match=r"with t0 = -?4503599627370496\.0 and 2 intervals"):
            spectrum.interval_length(run, 1023.0, 2)
    else:
        most = 2**43 - 1
        assert spectrum.interval_length(run, 1024.0, most) == 1024.0
        with pytest.raises(ArgumentError, match=f"with t0 = 0.0 and {most + 1} intervals times are 2 apart"):
            spectrum.interval_length(run, 1024.0, most + 1)
    # Where the phase of a forcing is kept, the period is the latest time.
    assert spectrum.interval_length(orbit(2.0**42, t0), 1.0, 10**15) == 1.0
    with pytest.raises(ArgumentError, match=r"with a period of 4398046511104\.0 times are"):
        spectrum.interval_length(orbit(2.0**42, t0), 0.5, 1)


def test_the_clock_must_reach_the_end_of_all_intervals(monkeypatch):
    """The message counts those of the transient too."""
    monkeypatch.setattr(spectrum, "first_vectors", lambda system, k: np.eye(1))
    monkeypatch.setattr(spectrum, "start", lambda *given, **options: orbit(0.0, 2.0**52))
    system = SimpleNamespace(growth=None)
    with pytest.raises(ArgumentError, match="and 7 intervals"):
        spectrum.lyapunov_spectrum(system, (0.0,), interval=1.0, intervals=5, transient=2)


def test_the_bar_counts_the_intervals_of_the_transient_too(monkeypatch):
    totals = []

    def bar(total, *given):
        totals.append(total)
        raise StopAsyncIteration

    monkeypatch.setattr(spectrum, "start", lambda *given, **options: SimpleNamespace(stop=nullcontext()))
    monkeypatch.setattr(spectrum, "first_vectors", lambda system, k: np.eye(1))
    monkeypatch.setattr(spectrum, "interval_length", lambda *given: 1.0)
    monkeypatch.setattr(spectrum, "load_kernels", lambda module: None)
    monkeypatch.setattr(spectrum, "progress_bar", bar)
    system = SimpleNamespace(growth=None, dimension=1)
    with pytest.raises(StopAsyncIteration):
        spectrum.lyapunov_spectrum(system, (0.0,), interval=1.0, intervals=5, transient=2)
    assert totals == [7]


def annihilated(vectors):
    """What the vectors, one per row, become."""
    vectors = np.array(vectors, dtype=float)
    n = vectors.shape[1]
    run = SimpleNamespace(y=np.concatenate([np.full(n, 7.0), vectors.ravel()]))
    estimate = object.__new__(Estimate)
    estimate.trajectory = SimpleNamespace(run=run, model=SimpleNamespace(dimension=n))
    estimate._replace_annihilated()
    assert run.y[:n].tolist() == [7.0] * n
    return run.y[n:].reshape(vectors.shape)


def test_vectors_that_are_there_are_left_alone():
    given = [[0.0, 0.0, 1.0], [0.0, 2.0, 1.0]]
    assert annihilated(given).tolist() == given


@pytest.mark.parametrize("gone", [[0], [1], [2], [0, 2], [1, 2], [0, 1, 2]])
def test_annihilated_vectors_become_new_directions(gone):
    given = np.array([[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    given[gone] = 0.0
    found = annihilated(given)
    np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-14)
    left = [i for i in range(3) if i not in gone]
    assert found[left].tolist() == given[left].tolist()


@pytest.mark.parametrize(("ok", "grazed", "told"), [(True, 3, True), (True, 0, False), (False, 3, False)])
def test_what_grazing_jumps_contribute(ok, grazed, told, monkeypatch):
    """Their growth in the intervals that count, per unit time."""
    status = SUCCESS if ok else Status(StatusCode.NON_FINITE, "Reached nan.")
    monkeypatch.setattr(spectrum, "status_of", lambda run, code: status)
    burst = Burst(growth=4.0)
    burst.trajectory.run = SimpleNamespace(ill_conditioned=grazed, ill_conditioned_growth=10.0)
    found = burst._status(codes.DONE, 5)
    text = " They contribute 0.6 to the first exponent."
    assert (found.code, found.message) == (status.code, status.message + text * told)


@pytest.mark.parametrize("failing", [False, True])
@pytest.mark.parametrize("transient", [0, 3])
def test_what_happens_in_the_transient_does_not_count(transient, failing, monkeypatch):
    """Its jumps, its steps and its parallel vectors; if it ends early, there are no intervals."""
    burst = Burst(growth=-1.0)
    run = SimpleNamespace(steps=0, indistinct=0, ill_conditioned_growth=0.0, ill_conditioned=0)
    burst.trajectory = SimpleNamespace(
        run=run,
        tangents=1,
        jumps=0,
        mode="a",
        x=np.array([9.0]),
        system=SimpleNamespace(state_names=("q",), units={"q": "m"}, transitions=(), transition_names=()),
    )
    replaced = []
    monkeypatch.setattr(burst, "_replace_annihilated", lambda: replaced.append(run.steps))

    def collect(intervals, mean, batches, history, bar):
        run.steps += 100 * intervals
        burst.trajectory.jumps += 10 * intervals
        run.indistinct += 1
        run.ill_conditioned_growth += 1.0
        if failing:
            return np.empty((0, 1)), codes.NON_FINITE
        mean.add(np.full((intervals, 2), [1.5, -2.5]))
        return np.full((intervals, 1), 1.5) if history else np.empty((0, 1)), codes.DONE

    monkeypatch.setattr(burst, "_collect", collect)
    monkeypatch.setattr(burst, "_status", lambda code, intervals: (code, intervals))
    found = burst.run(transient, 4, True, None)
    assert replaced == ([300] if transient else [])
    assert run.indistinct == (1 if not (transient and failing) else 0)
    assert burst.grazed_growth == (1.0 if transient else 0.0)
    if failing:
        assert (found.intervals, found.status) == (0, (codes.NON_FINITE, 1))
        assert np.isnan(found.exponents).all()
    else:
        assert (found.intervals, found.status) == (4, (codes.DONE, 4))
        assert (found.jumps_per_interval, found.steps_per_interval) == (10.0, 100.0)
        assert (found.exponents.tolist(), found.sum_rule) == ([1.5], -2.5)
        assert found.growths.tolist() == [[1.5]] * 4
    assert (found.interval, found.mode, found.x.tolist()) == (2.0, "a", [9.0])
